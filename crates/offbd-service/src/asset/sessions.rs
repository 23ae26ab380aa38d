//! Opening, ending and deleting the sessions of an asset.

use uuid::Uuid;

use super::actor::Asset;
use super::ended_session::EndedSession;
use super::part::Part;
use super::session::OpenSession;
use super::trend;
use super::turn::Turn;
use crate::clock::rfc3339;
use crate::limits::check_session_name;
use crate::{ServiceError, views};
use offbd_core::engine::{Input, Setup};
use offbd_store::{SessionEnd, SessionProgress, SessionRow, Write};
use offbd_wire::asset;
use offbd_wire::stored::{StoredMemory, StoredVerdict};
use offbd_wire::words::SessionState;

/// The result of switching to the session that a batch names.
pub(super) enum SessionSwitch {
    /// The session is open now.
    Open,
    /// The session ended earlier.
    Ended(Box<SessionRow>),
}

impl Asset {
    /// Ends the open session and opens a new one, for live samples or, with `importing`, for
    /// a recording; returns its id. Without a name it is named by the current time.
    pub(super) fn open_session(
        &mut self,
        name: Option<String>,
        importing: bool,
        turn: &mut Turn<'_>,
    ) -> Result<String, ServiceError> {
        if self.open.as_ref().is_some_and(|open| open.importing) {
            let what = "a recording is being imported into this asset";
            return Err(ServiceError::Busy { what });
        }
        let name = name.unwrap_or_else(|| rfc3339(turn.at));
        let open = self.open.as_ref().is_some_and(|open| open.is_named(&name));
        if open || matches!(self.switch_to(&name, importing, turn)?, SessionSwitch::Ended(_)) {
            let asset = self.row.name.clone();
            return Err(ServiceError::SessionExists { asset, name });
        }
        let failed = ServiceError::Unavailable { what: "the session could not be opened" };
        self.open.as_ref().map(|open| open.id.clone()).ok_or(failed)
    }

    /// Ends the session `id` if it is open.
    pub(super) fn end_session(
        &mut self,
        id: &str,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        if self.open.as_ref().is_some_and(|open| open.id == id) {
            self.end(turn)?;
        }
        Ok(())
    }

    /// Hides the session `id`, whose data are deleted later, and ends it if it is open.
    pub(super) fn delete_session(
        &mut self,
        id: String,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        let open = self.open.as_ref().is_some_and(|open| open.id == id);
        if self.learning.remove(&id, open) {
            self.write_learning(turn)?;
        }
        if open {
            self.end(turn)?;
        }
        turn.writes.push(Write::HideSession { session: id, at: turn.at });
        Ok(())
    }

    /// Discards the session `id` of an import that failed. The fault memory is that before
    /// the import.
    pub(super) fn discard_import(
        &mut self,
        id: String,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        if self.open.as_ref().is_some_and(|open| open.id == id && open.importing) {
            self.open = None;
            turn.engine_changed = true;
            turn.writes.push(Write::DiscardSession { session: id, at: turn.at });
        }
        Ok(())
    }

    /// Opens the session `name` for live samples if it is not open, and ends the one that
    /// was open.
    pub(super) fn switch(
        &mut self,
        name: &str,
        turn: &mut Turn<'_>,
    ) -> Result<SessionSwitch, ServiceError> {
        self.switch_to(name, false, turn)
    }

    fn switch_to(
        &mut self,
        name: &str,
        importing: bool,
        turn: &mut Turn<'_>,
    ) -> Result<SessionSwitch, ServiceError> {
        if self.open.as_ref().is_some_and(|open| open.is_named(name)) {
            return Ok(SessionSwitch::Open);
        }
        check_session_name(name)?;
        if let Some(row) = self.ended_session_named(name, turn)? {
            return Ok(SessionSwitch::Ended(Box::new(row)));
        }
        if !self.session_rate.allows(turn.at) {
            let what = "sessions of this asset begin too often";
            return Err(ServiceError::Busy { what });
        }
        self.end(turn)?;
        self.open(name.to_owned(), None, importing, turn)?;
        Ok(SessionSwitch::Open)
    }

    /// Returns a session that a device has called `name`, or a part of it. An asset without any
    /// session does not wait for earlier changes.
    fn ended_session_named(
        &self,
        name: &str,
        turn: &Turn<'_>,
    ) -> Result<Option<SessionRow>, ServiceError> {
        if !self.has_sessions {
            return Ok(None);
        }
        turn.barrier()?;
        let handles = &turn.env.handles;
        let (store, asset) = (&handles.store, &self.row.name);
        match handles.wait(store.session_named(asset, name))? {
            None => handles.wait(store.later_part_of(asset, name)).map_err(Into::into),
            found => Ok(found),
        }
    }

    /// Opens a session, which is the part `part` of one that continues. No session must be
    /// open.
    pub(super) fn open(
        &mut self,
        name: String,
        part: Option<&Part>,
        importing: bool,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        self.session_rate.count(turn.at);
        self.has_sessions = true;
        let id = Uuid::now_v7().to_string();
        let setup = Setup::new(self.rig.clone(), None)?;
        let row = SessionRow {
            id,
            asset: self.row.name.clone(),
            name,
            state: SessionState::Open.to_string(),
            opened_at: turn.at,
            ended_at: None,
            setup: views::to_json(&asset::view(&self.rig))?,
            baseline: views::to_json(&StoredMemory::of(&self.memory))?,
            progress: SessionProgress::default(),
            importing: importing.into(),
            part: part.map_or(1, |part| part.number),
            first_part: part.map(|part| part.first.clone()),
            verdict: None,
            verdict_hash: None,
        };
        let refines = self.learning.refines();
        let open = OpenSession::new(&row, setup, self.memory.clone(), refines);
        self.open = Some(Box::new(open));
        turn.writes.push(Write::OpenSession(row));
        self.write_memory(None, turn)
    }

    /// Opens a session named by the current time, or by the next microsecond whose name is
    /// not used yet: the clock may stand still or go back.
    pub(super) fn open_nameless(&mut self, turn: &mut Turn<'_>) -> Result<(), ServiceError> {
        let mut at = turn.at;
        if self.has_sessions {
            turn.barrier()?;
            let (handles, asset) = (&turn.env.handles, &self.row.name);
            // This turn may have opened a session before, for an earlier run of the same batch.
            let opened = |name: &str| {
                let is_named = |w: &Write| matches!(w, Write::OpenSession(row) if row.name == name);
                turn.writes.iter().any(is_named)
            };
            while opened(&rfc3339(at))
                || handles.wait(handles.store.session_named(asset, &rfc3339(at)))?.is_some()
            {
                at += 1;
            }
        }
        self.open(rfc3339(at), None, false, turn)
    }

    /// Removes the snapshots of the open session, and drops its engine.
    pub(super) fn rebuild(&mut self, turn: &mut Turn<'_>) -> Result<(), ServiceError> {
        if let Some(open) = &self.open {
            turn.writes.push(Write::RemoveSnapshots { session: open.id.clone() });
            self.dropped = true;
        }
        Ok(())
    }

    /// Ends the open session, if there is one: finalizes its verdict, trends and fault
    /// memory.
    pub(super) fn end(&mut self, turn: &mut Turn<'_>) -> Result<(), ServiceError> {
        let Some(mut open) = self.open.take() else { return Ok(()) };
        turn.engine_changed = true;
        self.note_ended(EndedSession::of(&open));
        turn.env.presences.end_session(&self.row.name);
        open.judging.input(Input::End);
        open.report(&self.row.name, turn.at, &mut turn.writes)?;
        let summary = open.summary();
        turn.writes.push(Write::EndSession(SessionEnd {
            session: open.id.clone(),
            ended_at: turn.at,
            verdict: views::to_json(&StoredVerdict::new(summary.clone()))?,
            hash: summary.verdict_hash.clone(),
            found_fault: !summary.faults.is_empty(),
        }));
        let mut trends = trend::ended(&self.row.name, &open, turn)?;
        let warns = |write: &Write| matches!(write, Write::Trend(row) if row.warnings.is_some());
        let has_warning = trends.iter().any(warns);
        turn.writes.append(&mut trends);
        self.gather(&open, &summary, has_warning, turn)?;
        let memory = open.judging.engine().memory().clone();
        self.replace_memory(memory, Some(&open.occurrence(turn.at)), None, turn)?;
        self.learn_if_due(turn)
    }
}
