//! The engine as its users see it, with stages that handle text instead of meshes.

mod cache_damage;
mod caching;
mod child;
mod concurrency;
mod exports;
mod failures;
#[cfg(target_os = "linux")]
mod full_disk;
mod gc;
mod keys;
mod kills;
mod processes;
mod random_damage;
mod remote;
mod reproducing;
mod schema;
mod selection;
#[cfg(target_os = "linux")]
#[path = "../../../../tests/small_disk/mod.rs"]
mod small_disk;
mod spec_errors;
mod sweeps;
mod toy;
mod trouble;
mod units;
