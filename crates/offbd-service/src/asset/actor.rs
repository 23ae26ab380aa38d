//! An asset with its engine.

use super::ended_session::EndedSession;
use super::learning_record::LearningRecord;
use super::link_health::LinkHealth;
use super::session::OpenSession;
use super::session_rate::SessionRate;
use crate::writing::EngineGeneration;
use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::Rig;
use offbd_core::vocabulary::FaultCode;
use offbd_store::{AssetRow, Micros, Snapshot};
use offbd_wire::stored::StoredProvenance;

/// The provenance of each code's fault memory entry, in the order of [`FaultCode::ALL`].
pub(super) type Provenance = [StoredProvenance; FaultCode::COUNT];

/// An asset that is loaded on its shard, or that was read for one question; see [`super::stored`].
pub(crate) struct Asset {
    pub(super) row: AssetRow,
    pub(super) rig: Rig,
    /// The fault memory as last written.
    pub(super) memory: FaultMemory,
    /// The provenance of its entries, as last written.
    pub(super) provenance: Provenance,
    /// Boxed: most of an asset, and many assets have none.
    pub(super) open: Option<Box<OpenSession>>,
    pub(super) session_rate: SessionRate,
    pub(super) link: LinkHealth,
    /// Rows of the batch that is being recorded that are not samples, and that the engine has
    /// not been told of yet.
    pub(super) malformed: Vec<usize>,
    /// When the last batch arrived.
    pub(super) batch_at: Option<Micros>,
    /// The last sessions that have ended, the newest first.
    pub(super) ended: Vec<EndedSession>,
    /// Whether it has, or may have had, any session.
    pub(super) has_sessions: bool,
    /// The progress of the automatic calibration.
    pub(super) learning: LearningRecord,
    pub(super) generation: EngineGeneration,
    pub(super) deleted: bool,
    /// Whether it is to be loaded again before its next command.
    pub(super) dropped: bool,
    /// Snapshots of the engine to be stored, taken while it was rebuilt or before it is dropped.
    pub(super) snapshots: Vec<Snapshot>,
}
