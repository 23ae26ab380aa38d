//! Judging a recorded session again, with other settings if wanted.

use uuid::Uuid;

use super::clock::rfc3339;
use super::jobs::{Job, JobContext};
use super::playback::{Flow, play};
use super::{Service, ServiceError, views};
use crate::judging::Judging;
use crate::store::{JobState, Micros, ReplayRow, SessionRow, Store, Write};
use crate::wire::asset::{self, CalibrationView};
use crate::wire::difference::{Compared, compare, tally};
use crate::wire::service::{DifferenceView, ReplayResultView, ReplaySettingsView, ReplayView};
use crate::wire::verdict::{FaultView, fault_view};
use offbd_core::diagnosis::Profile;
use offbd_core::engine::{Input, Rig, Setup};
use offbd_core::vocabulary::Invalid;

/// Fault lines, and differences, in a result; more are left out, and it says so.
const MAX_LINES: usize = 10_000;

/// Calibrations that are looked through at a time for the one that is wanted.
const PAGE: u32 = 64;

/// Samples between two looks at whether the service is closing.
const LOOK_EVERY: u64 = 1024;

impl Service {
    /// Begins to judge a session again.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`]; [`ServiceError::Invalid`] for settings
    /// that cannot be; [`ServiceError::Busy`].
    pub async fn replay(
        &self,
        session: &str,
        settings: ReplaySettingsView,
    ) -> Result<ReplayView, ServiceError> {
        let session = self.session_row(session).await?;
        let learnt = learnt(&self.inner.handles.store, &session.asset, &settings).await?;
        setup(&session, &settings, learnt.as_ref())?;
        let place = self.job_place()?;
        let row = ReplayRow {
            id: Uuid::now_v7().to_string(),
            session: session.id,
            state: JobState::Queued.to_string(),
            settings: views::to_json(&settings)?,
            created_at: self.inner.handles.clock.now(),
            finished_at: None,
            result: None,
            error: None,
        };
        self.inner.handles.write(Write::PutReplay(row.clone())).await?;
        place.send(Job::Replay(row.id.clone()));
        view(row, 0.0)
    }

    /// Where a replay stands, and its result.
    ///
    /// # Errors
    /// [`ServiceError::UnknownReplay`].
    pub async fn replay_state(&self, id: &str) -> Result<ReplayView, ServiceError> {
        let share = self.inner.job_context.progress.of(id);
        let row = self.inner.handles.store.replay(id).await?;
        let row = row.ok_or_else(|| ServiceError::UnknownReplay { id: id.to_owned() })?;
        view(row, share.unwrap_or(0.0))
    }
}

fn view(row: ReplayRow, share: f64) -> Result<ReplayView, ServiceError> {
    let done = row.state == JobState::Done.as_str();
    Ok(ReplayView {
        id: row.id,
        session_id: row.session,
        progress: if done { 1.0 } else { share },
        state: row.state,
        settings: views::from_json(&row.settings)?,
        created_at: rfc3339(row.created_at),
        finished_at: row.finished_at.map(rfc3339),
        result: row.result.as_deref().map(views::from_json).transpose()?,
        error: row.error,
    })
}

/// The calibration that `settings` ask for.
async fn learnt(
    store: &Store,
    asset: &str,
    settings: &ReplaySettingsView,
) -> Result<Option<CalibrationView>, ServiceError> {
    let Some(id) = &settings.calibration else { return Ok(None) };
    let mut before = None::<(Micros, String)>;
    loop {
        let from = before.as_ref().map(|(made_at, id)| (*made_at, id.as_str()));
        let rows = store.calibrations(asset, from, PAGE).await?;
        let Some(last) = rows.last() else {
            let reason = format!("asset `{asset}` has no calibration `{id}` that is done");
            return Err(Invalid::new("/calibration", reason).into());
        };
        before = Some((last.made_at, last.id.clone()));
        for row in &rows {
            let Some(document) = &row.document else { continue };
            let view: CalibrationView = views::from_json(document)?;
            if row.id == *id || view.id == *id {
                return Ok(Some(view));
            }
        }
    }
}

/// The set-up for a replay of `session` on what was `learnt`, if that is not
/// what it was recorded with.
pub(super) fn setup(
    session: &SessionRow,
    settings: &ReplaySettingsView,
    learnt: Option<&CalibrationView>,
) -> Result<Setup, ServiceError> {
    let profile = settings.profile.as_deref().map(str::parse::<Profile>).transpose();
    let profile = profile.map_err(|e| Invalid::new("/profile", e.to_string()))?;
    let mut file = asset::view(&rig(session, settings)?);
    if learnt.is_some() {
        file.calibration = learnt.cloned();
    }
    let diagnostics = file.diagnostics.get_or_insert_default();
    diagnostics.debounce_s = settings.debounce_s.or(diagnostics.debounce_s);
    let rate = &mut diagnostics.false_alarms_per_rig_year;
    *rate = settings.false_alarms_per_rig_year.or(*rate);
    // The wish stands at the top of the body, not inside an asset file.
    let top = |e: Invalid| {
        let element = e.element.strip_prefix("/diagnostics").unwrap_or(&e.element).to_owned();
        Invalid::new(element, e.reason)
    };
    Ok(Setup::new(asset::rig(&file).map_err(top)?, profile)?)
}

fn rig(session: &SessionRow, settings: &ReplaySettingsView) -> Result<Rig, ServiceError> {
    let Some(patch) = &settings.asset else { return views::rig(&session.setup) };
    let mut document: serde_json::Value = views::from_json(&session.setup)?;
    merge(&mut document, patch);
    let bytes = views::to_json(&document)?.into_bytes();
    let within = |e: Invalid| Invalid::new(format!("/asset{}", e.element), e.reason);
    Ok(asset::parse(&bytes).map_err(within)?)
}

/// JSON merge patch (RFC 7396).
fn merge(target: &mut serde_json::Value, patch: &serde_json::Value) {
    use serde_json::Value;
    let Value::Object(patch) = patch else {
        *target = patch.clone();
        return;
    };
    if !target.is_object() {
        *target = Value::Object(serde_json::Map::new());
    }
    let Value::Object(target) = target else { return };
    for (key, value) in patch {
        if value.is_null() {
            target.remove(key);
        } else {
            merge(target.entry(key.clone()).or_insert(Value::Null), value);
        }
    }
}

/// Runs a replay to its end, or leaves it unfinished when the service closes.
pub(super) async fn run(context: &JobContext, id: &str) -> Result<(), ServiceError> {
    let Some(mut row) = context.handles.store.replay(id).await? else { return Ok(()) };
    row.state = JobState::Running.to_string();
    context.handles.write(Write::PutReplay(row.clone())).await?;
    let (worker, job) = (context.clone(), row.clone());
    let judged = tokio::task::spawn_blocking(move || judge(&worker, &job)).await;
    let failed = ServiceError::Unavailable { what: "judging the recording has failed" };
    match judged.unwrap_or(Err(failed)) {
        Ok(None) => return Ok(()),
        Ok(Some(result)) => {
            row.state = JobState::Done.to_string();
            row.result = Some(views::to_json(&result)?);
        }
        Err(error) => {
            row.state = JobState::Failed.to_string();
            row.error = Some(error.to_string());
        }
    }
    row.finished_at = Some(context.handles.clock.now());
    context.handles.write(Write::PutReplay(row)).await
}

/// The result; none if the service closes before.
fn judge(context: &JobContext, row: &ReplayRow) -> Result<Option<ReplayResultView>, ServiceError> {
    let session = context.handles.wait(context.handles.store.session(&row.session))?;
    let session =
        session.ok_or_else(|| ServiceError::UnknownSession { id: row.session.clone() })?;
    let recorded = recorded(context, &session)?;
    let settings: ReplaySettingsView = views::from_json(&row.settings)?;
    let learnt = context.handles.wait(learnt(&context.handles.store, &session.asset, &settings))?;
    let setup = setup(&session, &settings, learnt.as_ref())?;
    let mut player = Player {
        judging: Judging::new(setup, views::memory(&session.baseline)?),
        session: &session,
        faults: Vec::new(),
        n_played: 0,
        stopped: false,
    };
    play(&context.handles, &session.id, |input| player.take(context, &row.id, input))?;
    if player.stopped {
        return Ok(None);
    }
    if !session.is_open() {
        player.put(Input::End);
    }
    Ok(Some(player.result(recorded)))
}

/// The transitions that the session's record has.
fn recorded(context: &JobContext, session: &SessionRow) -> Result<Vec<FaultView>, ServiceError> {
    let limit = u32::try_from(MAX_LINES + 1).unwrap_or(u32::MAX);
    let rows = context.handles.wait(context.handles.store.transitions(&session.id, 0, limit))?;
    rows.iter().map(|row| views::from_json(&row.document)).collect()
}

struct Player<'a> {
    judging: Judging,
    session: &'a SessionRow,
    faults: Vec<FaultView>,
    n_played: u64,
    stopped: bool,
}

impl Player<'_> {
    fn take(&mut self, context: &JobContext, id: &str, input: Input) -> Flow {
        let n_recorded = u64::try_from(self.session.progress.n_samples).unwrap_or_default();
        if self.n_played >= n_recorded && matches!(input, Input::Sample(_)) {
            return Flow::Enough;
        }
        if self.n_played.is_multiple_of(LOOK_EVERY) {
            context.progress.set(id, self.n_played as f64 / n_recorded.max(1) as f64);
            self.stopped = context.handles.closing.is_cancelled();
        }
        if self.stopped {
            return Flow::Enough;
        }
        self.n_played += u64::from(matches!(input, Input::Sample(_)));
        self.put(input);
        Flow::More
    }

    fn put(&mut self, input: Input) {
        self.judging.input(input);
        let room = (MAX_LINES + 1).saturating_sub(self.faults.len());
        let view = |t| fault_view(&self.session.name, self.judging.basis(), t);
        self.faults.extend(self.judging.transitions().take(room).map(view));
    }

    fn result(self, recorded: Vec<FaultView>) -> ReplayResultView {
        let n_rejected = u64::try_from(self.session.progress.n_rejected).unwrap_or_default();
        let summary = self.judging.summary(&self.session.name, n_rejected);
        let basis = self.judging.basis().clone();
        let truncated = self.faults.len() > MAX_LINES || recorded.len() > MAX_LINES;
        let (mut faults, mut recorded) = (self.faults, recorded);
        faults.truncate(MAX_LINES);
        recorded.truncate(MAX_LINES);
        let recorded_hash = self.session.verdict_hash.clone();
        let all = compare(&recorded, &faults);
        let same_hash = recorded_hash.as_ref().is_none_or(|hash| *hash == summary.verdict_hash);
        ReplayResultView {
            same: all.iter().all(Compared::is_same) && same_hash,
            differences: differences(&all, &recorded, &faults),
            tally: tally(&all),
            transitions: all.into_iter().map(|one| one.view).collect(),
            faults,
            summary,
            recorded_hash,
            calibration_id: basis.calibration_id,
            settings_id: basis.settings_id,
            truncated,
        }
    }
}

/// The fault lines of what is not the same.
fn differences(
    all: &[Compared],
    recorded: &[FaultView],
    replayed: &[FaultView],
) -> Vec<DifferenceView> {
    let line = |faults: &[FaultView], at: Option<usize>| at.and_then(|at| faults.get(at).cloned());
    let view = |one: &Compared| DifferenceView {
        change: one.view.change.clone(),
        moved_s: one.view.moved_s,
        recorded: line(recorded, one.recorded),
        replayed: line(replayed, one.replayed),
    };
    all.iter().filter(|one| !one.is_same()).map(view).take(MAX_LINES).collect()
}
