//! The changes of the database, a row for each: its fields, how messages name it as in "the
//! store does not accept …", and how it is applied.

use sqlx::AnyConnection;

use super::deletion;
use super::group::GroupCommit;
use super::statements::{
    activate, change_communication, create_asset, insert_action, insert_transition, insert_trend,
    open_session, published, put_calibration, put_fault, put_learning, put_replay, update_asset,
};
use crate::{
    AccessWrite, ActionRow, AlarmWrite, AssetRow, CalibrationRow, CommunicationChange,
    ConditionalWrite, FaultRow, Micros, NotificationWrite, PartitionId, RemarkWrite, ReplayRow,
    SessionEnd, SessionProgress, SessionRow, Snapshot, StoreError, TransitionRow, TrendRow,
    snapshot, tag,
};
use offbd_core::vocabulary::Sample;

/// Defines the changes. A row that begins with `[event]` gets the number of an event.
macro_rules! changes {
    (|$group:ident, $db:ident, $partition:ident| $(
        $(#[$doc:meta])* $([$event:ident])? $variant:ident $(($row:ident: $type:ty))? $({ $(
            $(#[$field_doc:meta])* $field:ident: $field_type:ty
        ),+ $(,)? })? as ($($subject:tt)+) => $apply:expr;
    )+) => {
        /// A change of the database.
        #[derive(Clone, Debug)]
        pub enum Write { $(
            $(#[$doc])* $variant $(($type))? $({ $($(#[$field_doc])* $field: $field_type),+ })?
        ),+ }

        impl Write {
            /// Whether it gets the number of an event.
            pub(super) const fn is_event(&self) -> bool {
                match self { $(Self::$variant { .. } => changes!(@ $($event)?)),+ }
            }

            /// Describes the change as a noun, as in "the store does not accept …".
            #[must_use]
            #[expect(unused_variables, reason = "a subject names few of the fields")]
            pub fn subject(&self) -> String {
                match self {
                    $(Self::$variant $(($row))? $({ $($field),+ })? => format!($($subject)+)),+
                }
            }

            pub(super) async fn apply(
                &mut self,
                $group: &mut GroupCommit<'_>,
                $db: &mut AnyConnection,
                $partition: PartitionId,
            ) -> Result<(), StoreError> {
                match self {
                    $(Self::$variant $(($row))? $({ $($field),+ })? => $apply.await),+
                }
            }
        }
    };
    (@) => { false };
    (@ event) => { true };
}

changes! {
    |group, db, partition|
    /// Creates an asset. It is a conflict if its name is taken.
    CreateAsset(row: AssetRow) as ("asset `{}`", row.name) => create_asset(db, partition, row);
    /// Replaces the document of an existing asset.
    UpdateAsset(row: AssetRow) as ("asset `{}`", row.name) => update_asset(db, row);
    /// Hides an asset and its sessions from all readers, and ends its open session. The
    /// first step of its deletion.
    HideAsset { name: String, at: Micros } as ("the deletion of asset `{name}`")
        => group.hide_asset(db, name, *at);
    /// Deletes a hidden asset, with what is left of its sessions.
    DeleteAsset { name: String } as ("the deletion of asset `{name}`")
        => deletion::delete_asset(db, name);
    OpenSession(row: SessionRow) as ("session {}", row.id) => open_session(db, row);
    /// Appends samples, possibly none, to the recording of a session, and sets the
    /// session's progress.
    Append {
        session: String,
        first_index: i64,
        samples: Vec<Sample>,
        progress: SessionProgress,
    } as ("{} samples of session {session}", samples.len())
        => async { group.defer(partition, session, *first_index, samples, *progress); Ok(()) };
    /// Stores a snapshot of the engine of an open session.
    PutSnapshot(row: Snapshot) as ("a snapshot of session {}", row.session)
        => snapshot::put(db, row);
    /// Removes all snapshots of a session.
    RemoveSnapshots { session: String } as ("the removal of the snapshots of session {session}")
        => snapshot::remove_all(db, session);
    EndSession(row: SessionEnd) as ("the end of session {}", row.session)
        => group.end_session(db, partition, row);
    /// Deletes a session, with what is left of its chunks and transitions.
    DeleteSession { session: String } as ("the deletion of session {session}")
        => group.delete_session(db, session);
    /// Ends an open session without a verdict and hides it from all readers. The first
    /// step of its deletion.
    DiscardSession { session: String, at: Micros } as ("the deletion of session {session}")
        => group.discard_session(db, session, *at);
    /// Hides an ended session from all readers. The first step of its deletion.
    HideSession { session: String, at: Micros } as ("the deletion of session {session}")
        => deletion::hide_session(db, session, *at);
    /// Deletes the first chunks of a hidden session, at most `limit`.
    DropChunks { session: String, limit: u32 } as ("the deletion of session {session}")
        => deletion::drop_chunks(db, session, *limit);
    /// Deletes the first transitions of a hidden session, at most `limit`.
    DropTransitions { session: String, limit: u32 } as ("the deletion of session {session}")
        => deletion::drop_transitions(db, session, *limit);
    [event] Action(row: ActionRow) as ("an action on {} of asset `{}`", row.code, row.asset)
        => insert_action(db, group, row);
    [event] Transition(row: TransitionRow)
        as ("a change of {} of asset `{}`", row.code, row.asset)
        => insert_transition(db, group, row);
    Fault(row: FaultRow) as ("the fault {} of asset `{}`", row.code, row.asset)
        => put_fault(db, row);
    Trend(row: TrendRow) as ("a servo estimate of session {}", row.session)
        => insert_trend(db, row);
    PutReplay(row: ReplayRow) as ("replay {}", row.id) => put_replay(db, row);
    PutCalibration(row: CalibrationRow) as ("calibration {}", row.id) => put_calibration(db, row);
    /// Makes a calibration the active one of its asset; an empty `id` is none of them.
    ActivateCalibration { asset: String, id: String, by: Option<String>, at: Micros }
        as ("the active calibration of asset `{asset}`")
        => activate(db, asset, id, (by.as_deref(), *at));
    /// Stores the learning record of an asset (its automatic calibration).
    PutLearning { asset: String, document: String } as ("the learning record of asset `{asset}`")
        => put_learning(db, asset, document);
    /// Stores the last event that was published on a bus.
    Published { bus: &'static str, event: i64 } as ("the last event published over {bus}")
        => published(db, bus, *event);
    /// Replaces the tags of an asset.
    PutTags { asset: String, tags: Vec<String> } as ("the tags of asset `{asset}`")
        => tag::put(db, asset, tags);
    /// A change of tags, rules or channels that depends on what is stored.
    Conditional(write: ConditionalWrite) as ("a change of tags or notifications")
        => write.apply(db);
    Access(write: AccessWrite) as ("a change of tokens, logins or the audit log")
        => write.apply(db);
    Alarm(write: AlarmWrite) as ("a change of mutes or notes") => write.apply(db);
    Notification(write: NotificationWrite) as ("a change of notifications") => write.apply(db);
    Remark(write: RemarkWrite) as ("a remark on session {}", write.session()) => write.apply(db);
    /// A rig stops or resumes sending; published as an event.
    [event] Communication(row: CommunicationChange)
        as ("the communication of asset `{}`", row.asset) => change_communication(db, group, row);
}

/// Changes that belong together, and the partition of their asset; `None` for changes that
/// concern no engine, such as tokens.
#[derive(Debug)]
pub struct ChangeSet<'a> {
    pub partition: Option<PartitionId>,
    pub writes: &'a mut Vec<Write>,
}

impl<'a> ChangeSet<'a> {
    /// Changes in a database that has one partition.
    pub const fn unpartitioned(writes: &'a mut Vec<Write>) -> Self {
        Self { partition: Some(PartitionId(0)), writes }
    }
}
