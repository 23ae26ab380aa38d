//! The commands of an asset.

use tracing::Span;

use super::actor::Asset;
use super::reply::Reply;
use crate::{Expected, ServiceError};
use offbd_core::engine::Rig;
use offbd_core::vocabulary::FaultCode;
use offbd_store::CalibrationRow;
use offbd_wire::asset::CalibrationView;
use offbd_wire::telemetry::{AckView, Batch};

/// A command to an asset.
///
/// The reply to a command that changes something is sent once the change is durable. What
/// `Look` sees may not be durable yet.
pub(crate) enum AssetCommand {
    /// Registers the asset with this asset file.
    Create { document: String, reply: Reply<()> },
    /// Replaces the asset file. An open session keeps the one that it started with.
    Replace { rig: Box<Rig>, expected: Expected, reply: Reply<()> },
    /// Hides the asset and revokes the tokens of its devices.
    Delete { expected: Expected, reply: Reply<()> },

    /// Evaluates and records a batch. `importing` is set for a recording that is being
    /// imported; `request` is the tracing span of the request.
    Ingest { batch: Batch, importing: bool, request: Span, reply: Reply<AckView> },

    /// Ends the open session and opens a new one, by default named by the current time;
    /// returns its id.
    OpenSession { name: Option<String>, importing: bool, reply: Reply<String> },
    /// Ends the session with this id if it is open.
    EndSession { session: String, reply: Reply<()> },
    /// Discards the session with this id, whose import failed.
    DiscardImport { session: String, reply: Reply<()> },
    /// Hides the session with this id, and ends it if it is open.
    DeleteSession { session: String, reply: Reply<()> },

    /// Erases the fault memory entry of a code.
    Clear { code: FaultCode, actor: String, reply: Reply<()> },
    /// Acknowledges the current occurrence of a code.
    Acknowledge { code: FaultCode, actor: String, reply: Reply<()> },

    /// Writes a calibration that a person chose to the asset file.
    Activate { id: String, calibration: Box<CalibrationView>, by: Option<String>, reply: Reply<()> },
    /// Records the outcome of a calibration job.
    FinishCalibration { row: Box<CalibrationRow>, reply: Reply<()> },
    /// Returns the id of the calibration that waits to be accepted, if there is one.
    OfferedCalibration { reply: Reply<Option<String>> },
    /// Writes the offered calibration to the asset file if it is still this one.
    AcceptLearning {
        id: String,
        calibration: Box<CalibrationView>,
        by: Option<String>,
        reply: Reply<()>,
    },
    /// Discards the motion gathered for the automatic calibration.
    DiscardLearning { reply: Reply<()> },

    /// Removes the snapshots of the open session and drops its engine, which the next command
    /// rebuilds from the recording.
    Rebuild { reply: Reply<()> },

    /// Loads the asset if it is not running, and evaluates its open session again.
    Load { reply: Reply<()> },
    /// Looks at the asset. It is the one command that does not load it.
    Look(AssetLook),
}

/// Takes the asset; `None` if it is not loaded.
pub(super) type AssetLook = Box<dyn FnOnce(Result<Option<&Asset>, ServiceError>) + Send>;
