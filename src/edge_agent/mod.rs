//! The edge agent, `offbd forward`: takes telemetry beside the rig, keeps it in a spool that
//! survives crashes, and forwards it until the service has acknowledged it.
//!
//! What the agent has acknowledged is on its disk. It is sent in order for each asset, and again
//! until the service says that it is stored; as the service recognises a sample that comes again,
//! nothing is lost or counted twice. When the spool is full the agent takes no more. A batch that
//! the service refuses for good stays in the spool, with the reason, until a person deletes it.

mod delivery;
mod intake;
mod lines;
mod spool;

pub use delivery::{InvalidServiceUrl, ServiceUrl, SpoolSender};
pub use intake::router;
pub use lines::{LineFormat, spool_lines};
pub use spool::{MAX_SPOOL_BYTES, NewBatch, RefusedBatch, Spool, SpoolError, SpoolStatus};

/// The format of a batch, by its media type.
fn media_type(header: Option<&str>) -> &str {
    header.unwrap_or("application/json")
}
