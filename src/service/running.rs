//! A running asset: its rig, its fault memory and the engine of its open
//! session. Says what is to be written; writes nothing.

use tokio::sync::mpsc::OwnedPermit;
use uuid::Uuid;

use super::clock::rfc3339;
use super::commit::Life;
use super::jobs::Job;
use super::learning::Record;
use super::recent::Recent;
use super::shard::Context;
use super::telemetry::unjudged;
use super::{ServiceError, trends, views};
use crate::judging::Judging;
use crate::store::{
    ActionKind, ActionRow, AssetRow, FaultRow, Micros, Progress, SessionRow, TransitionRow, Write,
};
use crate::wire::provenance::{ActView, OccurrenceView, ProvenanceView};
use crate::wire::service::cleared_view;
use crate::wire::telemetry::{AckView, RowView};
use crate::wire::verdict::{SummaryView, fault_view};
use crate::wire::{asset, memory};
use offbd_core::diagnosis::{FaultMemory, FaultRecord, MemoryRules};
use offbd_core::engine::{Admission, Input, Rig, Setup, UsableMotion};
use offbd_core::vocabulary::{FaultCode, FaultStatus, Sample};

/// How far a nameless device's clock must fall back to mean that it started
/// anew, s. Below, samples are late.
pub(super) const RESTART_S: f64 = 10.0;

/// What follows from one thing done, and when it was done.
pub(super) struct Work {
    pub(super) at: Micros,
    pub(super) writes: Vec<Write>,
    /// Whether an engine has taken something: if the rest fails, it is ahead of
    /// the store.
    pub(super) engine_moved: bool,
    /// Begun once the writes are durable, each with its place in the queue.
    pub(super) jobs: Vec<(OwnedPermit<Job>, Job)>,
}

impl Work {
    pub(super) const fn at(at: Micros) -> Self {
        Self { at, writes: Vec::new(), engine_moved: false, jobs: Vec::new() }
    }
}

/// An asset in the hands of its shard.
pub(super) struct Running {
    pub(super) row: AssetRow,
    pub(super) rig: Rig,
    /// The fault memory as last written.
    pub(super) memory: FaultMemory,
    /// What is known beside it, as last written.
    pub(super) provenance: Provenance,
    pub(super) open: Option<OpenSession>,
    /// What its learning by itself has come to.
    pub(super) learning: Record,
    pub(super) life: Life,
    pub(super) deleted: bool,
}

/// An open session and its engine.
pub(super) struct OpenSession {
    pub(super) id: String,
    pub(super) name: String,
    pub(super) judging: Judging,
    pub(super) progress: Progress,
    pub(super) n_transitions: i64,
    /// Whether a recording is being imported into it: no live telemetry then.
    pub(super) importing: bool,
    /// For those who watch.
    pub(super) recent: Recent,
    /// Motion that the rig can be learnt from; none where that is not wanted.
    pub(super) motion: Option<UsableMotion>,
    /// The latest time among the samples that were taken as they should be.
    latest_t_s: f64,
    /// Whether the last sample was far behind the latest.
    fell_back: bool,
}

impl OpenSession {
    /// Motion is counted for a rig that is not learnt, or that `refines` what is.
    pub(super) fn new(
        id: String,
        name: String,
        setup: Setup,
        baseline: FaultMemory,
        refines: bool,
    ) -> Self {
        let counts = refines || setup.rig.calibration.is_none();
        Self {
            motion: counts.then(|| UsableMotion::new(&setup.rig)),
            id,
            name,
            judging: Judging::new(setup, baseline),
            progress: Progress::default(),
            n_transitions: 0,
            importing: false,
            recent: Recent::default(),
            latest_t_s: f64::NEG_INFINITY,
            fell_back: false,
        }
    }

    /// Judges one sample.
    pub(super) fn take(&mut self, sample: &Sample) -> Admission {
        let admission = self.judging.sample(*sample);
        if let (Admission::Accepted, Some(motion)) = (admission, &mut self.motion) {
            motion.take(sample);
        }
        if matches!(admission, Admission::Accepted | Admission::SetAside(_)) {
            self.note(sample, admission == Admission::Accepted);
        }
        self.recent.take(|| self.judging.engine().state());
        admission
    }

    fn note(&mut self, sample: &Sample, in_time: bool) {
        self.fell_back = self.behind(sample);
        if in_time {
            self.latest_t_s = self.latest_t_s.max(sample.t_s);
        }
        let progress = &mut self.progress;
        progress.n_samples += 1;
        (progress.first_t_s, progress.last_t_s) = self.judging.counts().span_s.unzip();
        let seq = sample.seq.and_then(|seq| i64::try_from(seq).ok());
        progress.last_seq = progress.last_seq.max(seq);
    }

    fn behind(&self, sample: &Sample) -> bool {
        sample.t_s < self.latest_t_s - RESTART_S
    }

    /// Whether `sample` looks like the first one, or the second, after the
    /// device started anew: its clock is far behind and, where it counts, its
    /// count is not ahead. One sample without a count may be a slip of the
    /// clock, so it takes two.
    pub(super) fn seems_restarted(&self, sample: &Sample) -> bool {
        let count = sample.seq.and_then(|seq| i64::try_from(seq).ok());
        self.behind(sample)
            && match (count, self.progress.last_seq) {
                (Some(count), Some(last)) => count <= last,
                _ => self.fell_back,
            }
    }

    /// Appends what followed from the last input to `work`.
    fn report(&mut self, asset: &str, work: &mut Work) -> Result<(), ServiceError> {
        for transition in self.judging.transitions() {
            let view = fault_view(&self.name, self.judging.basis(), transition);
            work.writes.push(Write::Transition(TransitionRow {
                id: 0,
                asset: asset.to_owned(),
                session: self.id.clone(),
                ordinal: self.n_transitions,
                t_s: view.t_s,
                code: view.code.clone(),
                status: view.status.clone(),
                at: work.at,
                document: views::to_json(&view)?,
            }));
            self.n_transitions += 1;
        }
        Ok(())
    }

    /// What a code that fails anew now is said to come from.
    fn occurrence(&self, at: Micros) -> OccurrenceView {
        OccurrenceView {
            session: self.name.clone(),
            session_id: self.id.clone(),
            noted_at: rfc3339(at),
            calibration_id: self.judging.basis().calibration_id.clone(),
            settings_id: self.judging.basis().settings_id.clone(),
        }
    }

    fn summary(&self) -> SummaryView {
        let n_rejected = u64::try_from(self.progress.n_rejected).unwrap_or_default();
        self.judging.summary(&self.name, n_rejected)
    }
}

impl Running {
    /// Replaces the asset file by `document`.
    pub(super) fn update(&mut self, document: String, work: &mut Work) {
        self.row.document = document;
        self.row.revision += 1;
        self.row.updated_at = work.at;
        work.writes.push(Write::UpdateAsset(self.row.clone()));
    }

    /// Opens a session; the one that was open must have been ended.
    pub(super) fn open(&mut self, name: String, work: &mut Work) -> Result<(), ServiceError> {
        let id = Uuid::now_v7().to_string();
        let setup = Setup::new(self.rig.clone(), None)?;
        work.writes.push(Write::OpenSession(SessionRow {
            id: id.clone(),
            asset: self.row.name.clone(),
            name: name.clone(),
            state: "open".to_owned(),
            opened_at: work.at,
            ended_at: None,
            setup: views::to_json(&asset::view(&self.rig))?,
            baseline: views::to_json(&memory::view(&self.memory, &setup.settings.memory))?,
            progress: Progress::default(),
            verdict: None,
            verdict_hash: None,
        }));
        let refines = self.learning.refines();
        self.open = Some(OpenSession::new(id, name, setup, self.memory.clone(), refines));
        self.remember(None, work)
    }

    /// Opens a session named by this moment.
    pub(super) fn open_nameless(&mut self, work: &mut Work) -> Result<(), ServiceError> {
        self.open(rfc3339(work.at), work)
    }

    /// Ends the open session, if there is one.
    pub(super) fn end(&mut self, context: &Context, work: &mut Work) -> Result<(), ServiceError> {
        let Some(mut open) = self.open.take() else { return Ok(()) };
        work.engine_moved = true;
        open.judging.input(Input::End);
        open.report(&self.row.name, work)?;
        let summary = open.summary();
        work.writes.push(Write::EndSession {
            session: open.id.clone(),
            ended_at: work.at,
            verdict: views::to_json(&summary)?,
            hash: summary.verdict_hash.clone(),
        });
        let mut trends = trends::ended(context, &self.row.name, &open, work.at)?;
        let warned = |write: &Write| matches!(write, Write::Trend(row) if row.warnings.is_some());
        let warned = trends.iter().any(warned);
        work.writes.append(&mut trends);
        self.gather(&open, &summary, warned, work)?;
        let memory = open.judging.engine().memory().clone();
        self.remember_as(memory, Some(&open.occurrence(work.at)), None, work)?;
        self.learn_if_due(context, work)
    }

    /// Puts `samples`, each with its index in the batch, into the open session;
    /// with `watch` only those before the device seems to have started anew.
    /// Returns how many were put in.
    pub(super) fn ingest(
        &mut self,
        samples: &[(usize, Sample)],
        watch: bool,
        work: &mut Work,
        ack: &mut AckView,
    ) -> Result<usize, ServiceError> {
        let Some(open) = &mut self.open else { return Ok(samples.len()) };
        work.engine_moved = true;
        let first_index = open.progress.n_samples;
        let mut recorded = Vec::with_capacity(samples.len());
        let mut transitions = Work::at(work.at);
        let mut n_taken = 0;
        for (index, sample) in samples {
            if watch && open.seems_restarted(sample) {
                break;
            }
            n_taken += 1;
            let row = |reason: String| RowView { index: *index, reason };
            match open.take(sample) {
                Admission::Accepted => recorded.push(*sample),
                Admission::SetAside(why) => {
                    recorded.push(*sample);
                    unjudged(why.as_str());
                    ack.late.push(row(why.to_string()));
                }
                Admission::Duplicate => ack.duplicate += 1,
                Admission::Rejected(why) => {
                    unjudged(why.as_str());
                    ack.rejected.push(row(why.to_string()));
                }
            }
            open.report(&self.row.name, &mut transitions)?;
        }
        ack.accepted += recorded.len();
        ack.session = Some(open.name.clone());
        ack.session_id = Some(open.id.clone());
        ack.last_seq = open.progress.last_seq.and_then(|seq| u64::try_from(seq).ok());
        self.append(first_index, recorded, work);
        work.writes.append(&mut transitions.writes);
        self.remember(None, work)?;
        Ok(n_taken)
    }

    fn append(&mut self, first_index: i64, samples: Vec<Sample>, work: &mut Work) {
        let Some(open) = &self.open else { return };
        if !samples.is_empty() {
            let (session, progress) = (open.id.clone(), open.progress);
            work.writes.push(Write::Append { session, first_index, samples, progress });
        }
    }

    /// Counts rows that were no samples.
    pub(super) fn count_rejected(&mut self, n: usize, work: &mut Work) {
        let Some(open) = self.open.as_mut().filter(|_| n > 0) else { return };
        open.progress.n_rejected += i64::try_from(n).unwrap_or(i64::MAX);
        let (session, progress) = (open.id.clone(), open.progress);
        let first_index = progress.n_samples;
        work.writes.push(Write::Append { session, first_index, samples: Vec::new(), progress });
    }

    /// A person clears or acknowledges `code`.
    pub(super) fn action(
        &mut self,
        kind: ActionKind,
        code: FaultCode,
        actor: String,
        work: &mut Work,
    ) -> Result<(), ServiceError> {
        let mut memory = self.memory.clone();
        match kind {
            ActionKind::Clear => memory.clear(code),
            ActionKind::Acknowledge => drop(memory.acknowledge(code)),
        }
        let cleared = kind == ActionKind::Clear
            && self.open.is_none()
            && self.memory.record(code).word() != FaultStatus::Cleared;
        let event = cleared.then(|| views::to_json(&cleared_view(code, &actor))).transpose()?;
        work.writes.push(Write::Act(ActionRow {
            id: 0,
            asset: self.row.name.clone(),
            session: self.open.as_ref().map(|open| open.id.clone()),
            after_index: self.open.as_ref().map_or(0, |open| open.progress.n_samples),
            kind: kind.as_str().to_owned(),
            code: code.to_string(),
            actor: actor.clone(),
            at: work.at,
            event,
        }));
        let act = Act { kind, code, view: ActView { by: actor, at: rfc3339(work.at) } };
        if let Some(open) = &mut self.open {
            work.engine_moved = true;
            open.judging.input(input(kind, code));
            open.report(&self.row.name, work)?;
            return self.remember(Some(&act), work);
        }
        self.remember_as(memory, None, Some(&act), work)
    }

    /// The fault memory as the engine has it, or as last written.
    pub(super) fn current_memory(&self) -> &FaultMemory {
        self.open.as_ref().map_or(&self.memory, |open| open.judging.engine().memory())
    }

    /// Writes what has changed in the engine's fault memory.
    fn remember(&mut self, act: Option<&Act>, work: &mut Work) -> Result<(), ServiceError> {
        let Some(open) = &self.open else { return Ok(()) };
        if act.is_none() && *open.judging.engine().memory() == self.memory {
            return Ok(());
        }
        let (memory, here) = (open.judging.engine().memory().clone(), open.occurrence(work.at));
        self.remember_as(memory, Some(&here), act, work)
    }

    /// Writes what has changed with `memory`, in the session of `here`, and
    /// with what a person did.
    fn remember_as(
        &mut self,
        memory: FaultMemory,
        here: Option<&OccurrenceView>,
        act: Option<&Act>,
        work: &mut Work,
    ) -> Result<(), ServiceError> {
        let rules = self.rules();
        for (&code, known) in FaultCode::ALL.iter().zip(&mut self.provenance) {
            let (before, record) = (self.memory.record(code), memory.record(code));
            let act = act.filter(|act| act.code == code);
            let provenance = follow(known, before, record, here, act);
            if record == before && provenance == *known {
                continue;
            }
            let view = memory::record_view(code, record, &rules);
            work.writes.push(Write::Fault(FaultRow {
                asset: self.row.name.clone(),
                code: code.to_string(),
                status: view.status.clone(),
                acknowledged: i64::from(view.acknowledged),
                changed_at: work.at,
                record: views::to_json(&view)?,
                provenance: views::to_json(&provenance)?,
            }));
            *known = provenance;
        }
        self.memory = memory;
        Ok(())
    }

    /// The rules in force: those of the open session, or of the asset file.
    fn rules(&self) -> MemoryRules {
        let of_file = || self.rig.settings(self.rig.diagnostics.profile).ok().map(|s| s.memory);
        let open = self.open.as_ref().map(|open| open.judging.engine().setup().settings.memory);
        open.or_else(of_file).unwrap_or_default()
    }
}

/// What is known of each code beside its record, in the order of
/// [`FaultCode::ALL`].
pub(super) type Provenance = [ProvenanceView; FaultCode::COUNT];

/// What a person did about a code.
struct Act {
    kind: ActionKind,
    code: FaultCode,
    view: ActView,
}

/// What is known of a code after its record has become `after`.
fn follow(
    known: &ProvenanceView,
    before: &FaultRecord,
    after: &FaultRecord,
    here: Option<&OccurrenceView>,
    act: Option<&Act>,
) -> ProvenanceView {
    let mut known = known.clone();
    match act.map(|act| (act.kind, &act.view)) {
        Some((ActionKind::Clear, view)) => known.cleared = Some(view.clone()),
        Some((ActionKind::Acknowledge, view)) if !before.acknowledged => {
            known.acknowledgement = Some(view.clone());
        }
        _ => {}
    }
    if after.occurrences > before.occurrences {
        known.last_occurrence = here.cloned().map(Box::new);
        if before.occurrences == 0 {
            known.first_occurrence = here.cloned().map(Box::new);
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

/// The engine's input for an action.
pub(super) const fn input(kind: ActionKind, code: FaultCode) -> Input {
    match kind {
        ActionKind::Clear => Input::Clear(code),
        ActionKind::Acknowledge => Input::Acknowledge(code),
    }
}
