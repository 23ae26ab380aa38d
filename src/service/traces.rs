//! A session's trace: the recording is judged again, and what the pictures
//! need is kept of it. Nothing is stored and nothing changes.

use super::playback::{Flow, play};
use super::{Service, ServiceError, jobs, replays, views};
use crate::store::SessionRow;
use crate::wire::service::ReplaySettingsView;
use crate::wire::trace::{TracePoint, TraceView};
use offbd_core::engine::{Engine, Input, Output};

/// Samples that are judged for one trace; a session with more before the end
/// of the stretch is refused. Some seconds of one core.
const MAX_JUDGED: i64 = 2_000_000;

/// Traces that are made at a time; the next is told to come again.
pub(super) const MAX_AT_ONCE: usize = 2;

/// Moments of a trace; a longer stretch is thinned out.
pub const MAX_TRACE_POINTS: u32 = 20_000;

/// Which stretch of a session, and judged how.
#[derive(Clone, Debug)]
pub struct TraceQuery {
    /// s on the device's clock.
    pub from_s: f64,
    pub to_s: f64,
    /// Moments wanted at most.
    pub points: u32,
    pub settings: ReplaySettingsView,
}

impl Service {
    /// The trace of a session.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`]; [`ServiceError::Invalid`] for settings
    /// that cannot be; [`ServiceError::TooMany`] for a session too long;
    /// [`ServiceError::Busy`].
    pub async fn trace(&self, id: &str, query: TraceQuery) -> Result<TraceView, ServiceError> {
        let session = self.session_row(id).await?;
        if session.progress.n_samples > MAX_JUDGED {
            let limit = usize::try_from(MAX_JUDGED).unwrap_or(usize::MAX);
            return Err(ServiceError::TooMany { what: "samples in a session to draw", limit });
        }
        let busy = |_| ServiceError::Busy { what: "too many traces are being made" };
        let permit = self.inner.traces.clone().try_acquire_owned().map_err(busy)?;
        let bench = self.inner.bench.clone();
        let made = tokio::task::spawn_blocking(move || {
            let trace = trace(&bench, &session, &query);
            drop(permit);
            trace
        });
        let failed = ServiceError::Unavailable { what: "judging the recording has failed" };
        made.await.unwrap_or(Err(failed))
    }
}

fn trace(
    bench: &jobs::Bench,
    session: &SessionRow,
    query: &TraceQuery,
) -> Result<TraceView, ServiceError> {
    let setup = replays::setup(session, &query.settings, None)?;
    let mut engine = Engine::new(setup, views::memory(&session.baseline)?);
    let (mut trace, mut outputs) = (TraceView::default(), Vec::<Output>::new());
    let stride = stride(session, query);
    let mut n_seen = 0_u64;
    play(&bench.store, &bench.runtime, &session.id, |input| {
        let is_sample = matches!(input, Input::Sample(_));
        outputs.clear();
        engine.handle(input, &mut outputs);
        let point = is_sample.then(|| TracePoint::of(&engine.state())).flatten();
        let Some(point) = point.filter(|point| point.t_s() >= query.from_s) else {
            return if bench.closing.is_cancelled() { Flow::Enough } else { Flow::More };
        };
        if point.t_s() > query.to_s || bench.closing.is_cancelled() {
            return Flow::Enough;
        }
        if n_seen.is_multiple_of(stride) && trace.t_s.last().is_none_or(|t| *t < point.t_s()) {
            trace.push(&point);
        }
        n_seen += 1;
        Flow::More
    })?;
    Ok(trace)
}

/// Every how many samples one is drawn.
fn stride(session: &SessionRow, query: &TraceQuery) -> u64 {
    let progress = session.progress;
    let (first, last) = (progress.first_t_s.unwrap_or(0.0), progress.last_t_s.unwrap_or(0.0));
    let wanted_s = (query.to_s.min(last) - query.from_s.max(first)).max(0.0);
    let share = if last > first { wanted_s / (last - first) } else { 1.0 };
    let n = progress.n_samples as f64 * share;
    (n / f64::from(query.points.clamp(1, MAX_TRACE_POINTS))).ceil().max(1.0) as u64
}
