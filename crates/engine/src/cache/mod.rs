//! The cache on disk: results that are found again by what they were made of.
//!
//! Nothing in it is trusted. Artifacts carry their hash in their name and header, records carry a checksum; what does
//! not verify is moved aside, reported and made anew. Every file appears under its name in one step (written beside
//! it, flushed, renamed), and the record that makes a result findable is published last, so a kill at any time leaves
//! either a whole result or none.

mod checkpoints;
mod gc;
mod layout;
mod lease;
mod lock;
mod remote;
mod runs;
mod seal;
mod segment;
mod store;
mod temporary;
mod units_at_hand;
mod verify;

pub use checkpoints::UnitCounts;
pub(crate) use checkpoints::{Notice, UnitCheckpoints};
pub use gc::{Collected, GcItem, GcLimits, GcPlan, GcReason, HurtRun};
pub use layout::Bucket;
pub(crate) use lease::Lease;
pub use lock::{KeyLock, LockError};
pub use remote::{Remote, SharedFolder};
pub use runs::KeptRun;
pub(crate) use seal::{seal, unseal};
pub(crate) use segment::read_at;
pub use store::{Cache, CacheError, Damage, KeyRecord, StoredArtifact, Usage};
pub use temporary::write_atomically;
pub(crate) use temporary::{Durability, Temporary, sweep};
pub use units_at_hand::UnitsAtHand;
