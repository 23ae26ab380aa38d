//! The replay job: evaluates a recorded session again.

use std::ops::ControlFlow;

use tokio_util::sync::CancellationToken;

use super::CANCELLED;
use super::context::JobContext;
use crate::background::Priority;
use crate::job::{JobProgress, RunningJob};
use crate::playback::play_in_background;
use crate::replay_settings::{calibration, setup};
use crate::{ServiceError, views};
use offbd_core::engine::Input;
use offbd_store::{ReplayRow, SessionRow, Write};
use offbd_wire::difference::{ComparedTransition, compare, count_changes};
use offbd_wire::judging::Judging;
use offbd_wire::service::{DifferenceView, ReplayResultView, ReplaySettingsView};
use offbd_wire::verdict::{FaultView, fault_view};
use offbd_wire::words::JobState;

/// Limit of fault lines, and of differences, in a result, which is marked as truncated if
/// there are more.
const MAX_LINES: usize = 10_000;

/// Samples between two checks whether the replay is cancelled.
const CHECK_EVERY: u64 = 1024;

/// Runs a replay to completion, with this `priority`, or until it is cancelled; leaves it
/// unfinished if the service shuts down.
pub(super) async fn run(
    context: &JobContext,
    running: &RunningJob,
    priority: Priority,
) -> Result<(), ServiceError> {
    let id = running.job.id();
    let Some(mut row) = context.handles.store.replay(id).await? else { return Ok(()) };
    let Some(session) = context.handles.store.session(&row.session).await? else { return Ok(()) };
    row.state = JobState::Running.to_string();
    context.handles.write(&session.asset, vec![Write::PutReplay(row.clone())]).await?;
    let (worker, job, cancelled) = (context.clone(), row.clone(), running.cancelled.clone());
    let judge = move || judge(&worker, &job, &cancelled, priority);
    let judged = tokio::task::spawn_blocking(judge).await;
    let failed = ServiceError::Unavailable { what: "evaluating the recording failed" };
    match judged.unwrap_or(Err(failed)) {
        Ok(None) if context.handles.closing.is_cancelled() => return Ok(()),
        Ok(None) => cancel(&mut row),
        Ok(Some(result)) => {
            row.state = JobState::Done.to_string();
            row.result = Some(views::to_json(&result)?);
        }
        Err(error) => {
            row.state = JobState::Failed.to_string();
            row.error = Some(error.to_string());
        }
    }
    finish(context, &session.asset, row).await
}

/// Stores that the replay `row` of `asset`, which waited, is cancelled.
pub(crate) async fn cancel_waiting(
    context: &JobContext,
    asset: &str,
    mut row: ReplayRow,
) -> Result<(), ServiceError> {
    cancel(&mut row);
    finish(context, asset, row).await
}

fn cancel(row: &mut ReplayRow) {
    row.state = JobState::Failed.to_string();
    row.error = Some(CANCELLED.to_owned());
}

/// Stores the outcome of the replay `row`.
async fn finish(context: &JobContext, asset: &str, mut row: ReplayRow) -> Result<(), ServiceError> {
    row.finished_at = Some(context.handles.clock.now());
    context.handles.write(asset, vec![Write::PutReplay(row)]).await
}

/// Evaluates the session; returns `None` if it is cancelled before the end.
fn judge(
    context: &JobContext,
    row: &ReplayRow,
    cancelled: &CancellationToken,
    priority: Priority,
) -> Result<Option<ReplayResultView>, ServiceError> {
    let session = context.handles.wait(context.handles.store.session(&row.session))?;
    let session =
        session.ok_or_else(|| ServiceError::UnknownSession { id: row.session.clone() })?;
    let recorded = recorded(context, &session)?;
    let settings: ReplaySettingsView = views::from_json(&row.settings)?;
    let learnt =
        context.handles.wait(calibration(&context.handles.store, &session.asset, &settings))?;
    let setup = setup(&session, &settings, learnt.as_ref())?;
    let mut replay = ReplayRun {
        judging: Judging::new(setup, views::memory(&session.baseline)?),
        session: &session,
        faults: Vec::new(),
        n_played: 0,
        stopped: false,
    };
    play_in_background(&context.handles, &session, priority, |input| {
        replay.take(&context.progress, &row.id, cancelled, input)
    })?;
    if replay.stopped {
        return Ok(None);
    }
    if !session.is_open() {
        replay.put(Input::End);
    }
    Ok(Some(replay.result(recorded)))
}

/// Returns the recorded transitions of the session.
fn recorded(context: &JobContext, session: &SessionRow) -> Result<Vec<FaultView>, ServiceError> {
    let limit = u32::try_from(MAX_LINES + 1).unwrap_or(u32::MAX);
    let rows = context.handles.wait(context.handles.store.transitions(&session.id, 0, limit))?;
    rows.iter().map(|row| views::from_json(&row.document)).collect()
}

/// The state of a replay.
struct ReplayRun<'a> {
    judging: Judging,
    session: &'a SessionRow,
    faults: Vec<FaultView>,
    n_played: u64,
    stopped: bool,
}

impl ReplayRun<'_> {
    fn take(
        &mut self,
        progress: &JobProgress,
        id: &str,
        cancelled: &CancellationToken,
        input: Input,
    ) -> ControlFlow<()> {
        let n_recorded = u64::try_from(self.session.progress.n_samples).unwrap_or_default();
        if self.n_played >= n_recorded && matches!(input, Input::NewSample(_)) {
            return ControlFlow::Break(());
        }
        if self.n_played.is_multiple_of(CHECK_EVERY) {
            progress.set(id, self.n_played as f64 / n_recorded.max(1) as f64);
            self.stopped = cancelled.is_cancelled();
        }
        if self.stopped {
            return ControlFlow::Break(());
        }
        self.n_played += u64::from(matches!(input, Input::NewSample(_)));
        self.put(input);
        ControlFlow::Continue(())
    }

    fn put(&mut self, input: Input) {
        self.judging.input(input);
        let room = (MAX_LINES + 1).saturating_sub(self.faults.len());
        let view = |t| fault_view(&self.session.name, self.judging.basis(), t);
        self.faults.extend(self.judging.transitions().iter().take(room).map(view));
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
            same: all.iter().all(ComparedTransition::is_same) && same_hash,
            differences: differences(&all, &recorded, &faults),
            tally: count_changes(&all),
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

/// Returns the transitions that differ, with their fault lines.
fn differences(
    all: &[ComparedTransition],
    recorded: &[FaultView],
    replayed: &[FaultView],
) -> Vec<DifferenceView> {
    let line = |faults: &[FaultView], at: Option<usize>| at.and_then(|at| faults.get(at).cloned());
    let view = |one: &ComparedTransition| DifferenceView {
        change: one.view.change,
        moved_s: one.view.moved_s,
        recorded: line(recorded, one.recorded),
        replayed: line(replayed, one.replayed),
    };
    all.iter().filter(|one| !one.is_same()).map(view).take(MAX_LINES).collect()
}
