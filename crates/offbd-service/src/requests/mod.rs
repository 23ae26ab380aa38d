//! The public methods of [`Service`](super::Service), by subject: each file has an
//! `impl Service` block. Queries read the store; changes of an asset are sent as commands
//! to its shard, others directly to the writer.

mod alarms;
mod assets;
mod audit;
mod calibrations;
mod drive_cycles;
mod events;
mod faults;
mod fleet;
mod history;
mod import;
mod jobs;
mod learning;
mod mutes;
mod notifications;
mod principals;
mod readiness;
mod recordings;
mod remarks;
mod replays;
mod series;
mod sessions;
mod tags;
mod telemetry;
mod tokens;
mod traces;
mod trends;
mod trials;

pub use alarms::AlarmQuery;
pub(crate) use drive_cycles::LastSearch;
pub use events::PresentFault;
pub use faults::FaultQuery;
pub use fleet::FleetQuery;
pub use import::ImportFile;
pub use notifications::DeliveryQuery;
pub use readiness::QueueLoad;
pub use series::{MAX_SERIES_SESSIONS, SeriesQuery};
pub use sessions::SessionListQuery;
pub use telemetry::PendingBatch;
pub use traces::TraceReader;
