//! The fault memory of an asset: actions of persons, and writing its changes.

use super::actor::Asset;
use super::turn::Turn;
use crate::clock::rfc3339;
use crate::playback::input;
use crate::{ServiceError, views};
use offbd_core::diagnosis::{FaultMemory, FaultRecord};
use offbd_core::vocabulary::{FaultCode, FaultStatus};
use offbd_store::{ActionKind, ActionRow, FaultRow, Write};
use offbd_wire::service::cleared_view;
use offbd_wire::stored::{StoredAct, StoredOccurrence, StoredProvenance, StoredRecord};

impl Asset {
    /// Erases the entry of `code` on request of a person.
    pub(super) fn clear(
        &mut self,
        code: FaultCode,
        actor: String,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        self.act(ActionKind::Clear, code, actor, turn)
    }

    /// Acknowledges the current occurrence of `code` on request of a person.
    ///
    /// # Errors
    /// [`ServiceError::NothingToAcknowledge`] if the code is neither pending nor confirmed.
    pub(super) fn acknowledge(
        &mut self,
        code: FaultCode,
        actor: String,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        let status = self.current_memory().record(code).status;
        if !status.pending() && !status.confirmed() {
            let (asset, code) = (self.row.name.clone(), code.to_string());
            return Err(ServiceError::NothingToAcknowledge { asset, code });
        }
        self.act(ActionKind::Acknowledge, code, actor, turn)
    }

    fn act(
        &mut self,
        kind: ActionKind,
        code: FaultCode,
        actor: String,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        if self.open.as_ref().is_some_and(|open| open.importing) {
            let what = "a recording is being imported into this asset";
            return Err(ServiceError::Busy { what });
        }
        let mut memory = self.memory.clone();
        match kind {
            ActionKind::Clear => memory.clear(code),
            ActionKind::Acknowledge => drop(memory.acknowledge(code)),
        }
        let cleared = kind == ActionKind::Clear
            && self.open.is_none()
            && self.memory.record(code).word() != FaultStatus::Cleared;
        let event = cleared.then(|| views::to_json(&cleared_view(code, &actor))).transpose()?;
        turn.writes.push(Write::Action(ActionRow {
            id: 0,
            asset: self.row.name.clone(),
            session: self.open.as_ref().map(|open| open.id.clone()),
            after_index: self.open.as_ref().map_or(0, |open| open.progress.n_samples),
            kind: kind.as_str().to_owned(),
            code: code.to_string(),
            actor: actor.clone(),
            at: turn.at,
            event,
        }));
        let action =
            PersonAction { kind, code, act: StoredAct { by: actor, at: rfc3339(turn.at) } };
        if let Some(open) = &mut self.open {
            turn.engine_changed = true;
            open.acted_at = Some(open.progress.n_samples);
            open.judging.input(input(kind, code));
            open.report(&self.row.name, turn.at, &mut turn.writes)?;
            return self.write_memory(Some(&action), turn);
        }
        self.replace_memory(memory, None, Some(&action), turn)
    }

    /// Returns the fault memory of the engine; the one last written if no session is open.
    fn current_memory(&self) -> &FaultMemory {
        self.open.as_ref().map_or(&self.memory, |open| open.judging.engine().memory())
    }

    /// Writes the changes of the engine's fault memory; those of an import are written when
    /// it is complete.
    pub(super) fn write_memory(
        &mut self,
        action: Option<&PersonAction>,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        let Some(open) = self.open.as_ref().filter(|open| !open.importing) else { return Ok(()) };
        if action.is_none() && *open.judging.engine().memory() == self.memory {
            return Ok(());
        }
        let (memory, occurrence) =
            (open.judging.engine().memory().clone(), open.occurrence(turn.at));
        self.replace_memory(memory, Some(&occurrence), action, turn)
    }

    /// Replaces the fault memory by `memory` and writes the changes. New failures have the
    /// provenance `occurrence`; `action` is the action of a person that caused them.
    pub(super) fn replace_memory(
        &mut self,
        memory: FaultMemory,
        occurrence: Option<&StoredOccurrence>,
        action: Option<&PersonAction>,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        for (&code, known) in FaultCode::ALL.iter().zip(&mut self.provenance) {
            let (before, record) = (self.memory.record(code), memory.record(code));
            let action = action.filter(|action| action.code == code);
            let provenance = next_provenance(known, before, record, occurrence, action);
            if record == before && provenance == *known {
                continue;
            }
            turn.writes.push(Write::Fault(FaultRow {
                asset: self.row.name.clone(),
                code: code.to_string(),
                status: record.word().to_string(),
                acknowledged: i64::from(record.acknowledged),
                changed_at: turn.at,
                record: views::to_json(&StoredRecord::of(code, record))?,
                provenance: views::to_json(&provenance)?,
            }));
            *known = provenance;
        }
        self.memory = memory;
        Ok(())
    }
}

/// An action of a person on a code.
pub(super) struct PersonAction {
    kind: ActionKind,
    code: FaultCode,
    act: StoredAct,
}

/// Returns the provenance of a code after its record has changed from `before` to `after`.
fn next_provenance(
    known: &StoredProvenance,
    before: &FaultRecord,
    after: &FaultRecord,
    occurrence: Option<&StoredOccurrence>,
    action: Option<&PersonAction>,
) -> StoredProvenance {
    let mut known = known.clone();
    match action.map(|action| (action.kind, &action.act)) {
        Some((ActionKind::Clear, view)) => known.cleared = Some(Box::new(view.clone())),
        Some((ActionKind::Acknowledge, view)) if !before.acknowledged => {
            known.acknowledgement = Some(Box::new(view.clone()));
        }
        _ => {}
    }
    if after.occurrences > before.occurrences {
        known.last_occurrence = occurrence.cloned().map(Box::new);
        if before.occurrences == 0 {
            known.first_occurrence = occurrence.cloned().map(Box::new);
        }
    }
    if !after.acknowledged {
        known.acknowledgement = None;
    }
    if after.occurrences == 0 {
        (known.first_occurrence, known.last_occurrence) = (None, None);
    }
    known
}
