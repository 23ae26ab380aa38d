//! The edge agent, `offbd forward`: takes telemetry beside the rig, keeps it in a spool that
//! survives crashes, and forwards it until the service has acknowledged it.
//!
//! What the agent has acknowledged is on its disk. It is sent in order for each asset, and again
//! until the service says that it is stored; as the service recognises a sample that comes again,
//! nothing is lost or counted twice. When the spool is full the agent takes no more. A batch that
//! the service refuses for good, samples that it rejects, and batches that the disk has damaged
//! stay in the spool, with the reason, until a person sends them again or deletes them.

mod answer;
mod batch;
pub mod command;
mod database;
mod delays;
mod delivery;
mod files;
mod intake;
mod lines;
mod listen;
mod log;
mod refusal;
mod reserve;
mod source;
mod spool;
mod stop;
mod strangers;

use offbd_wire::telemetry::{Batch, TelemetryFormat};

pub use batch::{NewBatch, SpoolError};
pub use delays::Delays;
pub use delivery::{InvalidServiceUrl, ServiceUrl, SpoolSender};
pub use intake::router;
pub use lines::{LineFormat, spool_lines};
pub use source::Lines;
pub use spool::{MAX_SPOOL_BYTES, RefusedBatch, Spool, SpoolStatus};

/// Parses a batch, as the service does.
fn parsed(batch: &NewBatch) -> Result<Batch, String> {
    let format = TelemetryFormat::of_type(&batch.media_type).map_err(|e| e.to_string())?;
    format.parse(&batch.body, intake::MAX_BATCH_SAMPLES).map_err(|e| e.to_string())
}
