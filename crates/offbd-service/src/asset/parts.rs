//! The parts of a long session. A session that has become too long ends and continues in
//! another one, its next part, which has the same name with a number.

use super::actor::Asset;
use super::part::Part;
use super::session::OpenSession;
use super::turn::Turn;
use crate::ServiceError;
use crate::limits::SessionLimits;

impl OpenSession {
    /// Whether a batch with the session name `name` belongs to this session.
    pub(super) fn is_named(&self, name: &str) -> bool {
        self.name == name || self.part.name == name
    }

    /// Whether the session must not get longer.
    const fn is_long(&self, limits: SessionLimits) -> bool {
        !self.importing && self.progress.n_samples >= limits.samples
    }
}

impl Asset {
    /// Ends the open session if it has become too long, and opens its next part; later if
    /// sessions of this asset begin too often.
    pub(super) fn continue_if_long(&mut self, turn: &mut Turn<'_>) -> Result<(), ServiceError> {
        let limits = turn.env.handles.sessions;
        let Some(open) = self.open.as_ref().filter(|open| open.is_long(limits)) else {
            return Ok(());
        };
        if !self.session_rate.allows(turn.at) {
            return Ok(());
        }
        turn.barrier()?;
        let handles = &turn.env.handles;
        let mut part = open.part.next();
        let named = |part: &Part| {
            handles.wait(handles.store.session_named(&self.row.name, &part.session_name()))
        };
        while named(&part)?.is_some() {
            // Another session of the device has this name.
            part = part.next();
        }
        tracing::info!(
            asset = self.row.name,
            session = open.name,
            "the session continues in another"
        );
        self.end(turn)?;
        self.open(part.session_name(), Some(&part), false, turn)
    }
}
