//! The command as a user meets it: exit codes, outputs, what a second run does.

mod beginning;
mod caching;
mod editing;
mod edits;
#[cfg(target_os = "linux")]
mod full_disk;
mod looking;
mod mistakes;
mod reporting;
mod running;
#[cfg(feature = "s3")]
mod s3;
#[cfg(target_os = "linux")]
#[path = "../small_disk/mod.rs"]
mod small_disk;
mod stopping;
mod workshop;
