//! Background upkeep: deletion in parts, retention, and the watchdog of ingest.

mod deletion;
mod retention;
mod watchdog;

pub(super) use deletion::Deleter;
pub(super) use retention::Sweeper;
pub(super) use watchdog::{STALLED_AFTER, Watchdog};
