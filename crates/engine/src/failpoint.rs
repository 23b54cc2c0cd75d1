//! Places at which a test may end the process, to see what the next one makes of what is left.

use std::sync::OnceLock;

static HOOK: OnceLock<fn(&'static str)> = OnceLock::new();

/// Calls `hook` with the name of each commit point that is passed from now on, in any thread. For tests; the first
/// hook stays.
pub fn on_commit_point(hook: fn(&'static str)) {
    let _ = HOOK.set(hook);
}

/// The names of all commit points, in the order in which a run first meets them.
pub const COMMIT_POINTS: [&str; 9] = [
    "lock taken",
    "unit put",
    "temporary written",
    "temporary flushed",
    "file renamed",
    "artifact stored",
    "key published",
    "export written",
    "run record written",
];

/// A commit point is passed.
pub(crate) fn pass(name: &'static str) {
    debug_assert!(COMMIT_POINTS.contains(&name), "{name} is not listed");
    if let Some(hook) = HOOK.get() {
        hook(name);
    }
}
