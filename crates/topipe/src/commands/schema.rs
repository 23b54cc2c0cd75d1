//! `topipe schema`.

use crate::failure::Failure;
use crate::stages::registry;
use topipe_engine::{ExitCode, pipeline_schema};

pub(crate) fn run() -> Result<ExitCode, Failure> {
    super::print(&format!("{:#}\n", pipeline_schema(&registry())))
}
