//! Background upkeep: deletion in parts, retention, the scrub of stored data, and the
//! watchdog of ingest.

mod deletion;
mod page_scrub;
mod retention;
mod scrub;
mod watchdog;

pub(super) use deletion::Deleter;
pub(super) use page_scrub::PageScrubber;
pub(super) use retention::Sweeper;
pub(super) use scrub::Scrubber;
pub(super) use watchdog::{STALLED_AFTER, Watchdog};
