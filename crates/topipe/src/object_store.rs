//! A remote cache in S3 or a compatible store.
//!
//! `s3://BUCKET/PREFIX`; key, region and endpoint come from the usual variables (`AWS_ACCESS_KEY_ID`,
//! `AWS_SECRET_ACCESS_KEY`, `AWS_REGION`, `AWS_ENDPOINT`, `AWS_ALLOW_HTTP`).

use object_store::aws::AmazonS3Builder;
use object_store::path::Path;
use object_store::{ObjectStore, ObjectStoreExt, PutPayload, RetryConfig};
use std::io::{Error, Result};
use std::time::Duration;
use tokio::runtime::Runtime;
use topipe_engine::cache::Remote;

/// A bucket, or a part of one.
pub(crate) struct ObjectStoreRemote {
    name: String,
    prefix: Path,
    store: Box<dyn ObjectStore>,
    runtime: Runtime,
}

/// A store that does not answer within this time counts as away: a run must not hang for its cache.
const PATIENCE: Duration = Duration::from_secs(10);

impl ObjectStoreRemote {
    /// The store at `s3://BUCKET/PREFIX`.
    pub(crate) fn s3(url: &str) -> Result<Self> {
        let retry = RetryConfig { max_retries: 2, retry_timeout: PATIENCE, ..RetryConfig::default() };
        let store =
            AmazonS3Builder::from_env().with_url(url).with_retry(retry).build().map_err(Error::other)?;
        let inside = url.splitn(4, '/').nth(3).unwrap_or_default();
        // One thread of its own: calls wait for their answer anyway.
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
        Ok(Self { name: url.to_owned(), prefix: Path::from(inside), store: Box::new(store), runtime })
    }

    fn path(&self, name: &str) -> Path {
        Path::from(format!("{}/{name}", self.prefix))
    }
}

impl Remote for ObjectStoreRemote {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn get(&self, name: &str) -> Result<Option<Vec<u8>>> {
        let path = self.path(name);
        let read = async { self.store.get(&path).await?.bytes().await };
        match self.runtime.block_on(read) {
            Ok(bytes) => Ok(Some(bytes.to_vec())),
            Err(object_store::Error::NotFound { .. }) => Ok(None),
            Err(error) => Err(Error::other(error)),
        }
    }

    fn has(&self, name: &str) -> Result<bool> {
        match self.runtime.block_on(self.store.head(&self.path(name))) {
            Ok(_) => Ok(true),
            Err(object_store::Error::NotFound { .. }) => Ok(false),
            Err(error) => Err(Error::other(error)),
        }
    }

    fn put(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let content = PutPayload::from(bytes.to_vec());
        self.runtime.block_on(self.store.put(&self.path(name), content)).map(drop).map_err(Error::other)
    }
}
