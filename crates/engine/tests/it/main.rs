//! The engine as its users see it, with stages that handle text instead of meshes.

mod cache_damage;
mod caching;
mod child;
mod concurrency;
mod exports;
mod failures;
mod gc;
mod keys;
mod kills;
mod processes;
mod random_damage;
mod remote;
mod reproducing;
mod schema;
mod selection;
mod spec_errors;
mod sweeps;
mod toy;
mod trouble;
mod units;
