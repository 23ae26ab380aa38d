//! Descriptions of changes, for error messages and logs.

use super::Write;

impl Write {
    /// Describes the change as a noun, as in "the store does not accept …".
    #[must_use]
    pub fn subject(&self) -> String {
        match self {
            Self::CreateAsset(row) | Self::UpdateAsset(row) => format!("asset `{}`", row.name),
            Self::HideAsset { name, .. } | Self::DeleteAsset { name } => {
                format!("the deletion of asset `{name}`")
            }
            Self::OpenSession(row) => format!("session {}", row.id),
            Self::Append { session, samples, .. } => {
                format!("{} samples of session {session}", samples.len())
            }
            Self::PutSnapshot(row) => format!("a snapshot of session {}", row.session),
            Self::RemoveSnapshots { session } => {
                format!("the removal of the snapshots of session {session}")
            }
            Self::EndSession { session, .. } => format!("the end of session {session}"),
            Self::DeleteSession { session }
            | Self::DiscardSession { session, .. }
            | Self::HideSession { session, .. }
            | Self::DropChunks { session, .. }
            | Self::DropTransitions { session, .. } => format!("the deletion of session {session}"),
            Self::Action(row) => format!("an action on {} of asset `{}`", row.code, row.asset),
            Self::Transition(row) => format!("a change of {} of asset `{}`", row.code, row.asset),
            Self::Fault(row) => format!("the fault {} of asset `{}`", row.code, row.asset),
            Self::Trend(row) => format!("a servo estimate of session {}", row.session),
            Self::PutReplay(row) => format!("replay {}", row.id),
            Self::PutCalibration(row) => format!("calibration {}", row.id),
            Self::ActivateCalibration { asset, .. } => {
                format!("the active calibration of asset `{asset}`")
            }
            Self::PutLearning { asset, .. } => format!("the learning record of asset `{asset}`"),
            Self::PutTags { asset, .. } => format!("the tags of asset `{asset}`"),
            Self::Alarm(_) => "a change of mutes or notes".to_owned(),
            Self::Notification(_) => "a change of notifications".to_owned(),
            Self::Remark(write) => format!("a remark on session {}", write.session()),
            Self::Communication(row) => format!("the communication of asset `{}`", row.asset),
            Self::Published { bus, .. } => format!("the last event published over {bus}"),
            Self::Access(_) => "a change of tokens, logins or the audit log".to_owned(),
        }
    }
}
