//! The cache of a command, with the remote one behind it.

use crate::args::PipelineArguments;
use crate::failure::Failure;
use topipe_engine::cache::SharedFolder;
use topipe_engine::{Cache, ExitCode};

/// The cache that the command line names.
pub(crate) fn cache(arguments: &PipelineArguments) -> Result<Cache, Failure> {
    let cache = Cache::new(arguments.cache_folder());
    let Some(remote) = &arguments.remote else { return Ok(cache) };
    match remote.split_once("://") {
        None => Ok(cache.with_remote(SharedFolder::new(remote), arguments.remote_read_only)),
        #[cfg(feature = "s3")]
        Some(("s3", _)) => {
            let store = crate::object_store::ObjectStoreRemote::s3(remote).map_err(|error| {
                Failure::new(ExitCode::Usage, format!("the remote cache {remote}: {error}"))
            })?;
            Ok(cache.with_remote(store, arguments.remote_read_only))
        }
        Some((scheme, _)) => {
            let help = if scheme == "s3" { "; build with `--features s3`" } else { "" };
            let message = format!("this program has no remote cache for {scheme}://{help}");
            Err(Failure::new(ExitCode::Usage, message))
        }
    }
}
