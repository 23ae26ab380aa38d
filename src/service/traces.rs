//! A session's trace: the recording is judged again, and what the pictures
//! need is kept of it. Nothing is stored and nothing changes.

use super::handles::Handles;
use super::playback::{Flow, play};
use super::{Service, ServiceError, replays, views};
use crate::judging::Judging;
use crate::store::SessionRow;
use crate::wire::service::ReplaySettingsView;
use crate::wire::trace::{TracePoint, TraceView};
use offbd_core::engine::Input;

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
        let handles = self.inner.handles.clone();
        let made = tokio::task::spawn_blocking(move || {
            let trace = trace(&handles, &session, &query);
            drop(permit);
            trace
        });
        let failed = ServiceError::Unavailable { what: "judging the recording has failed" };
        made.await.unwrap_or(Err(failed))
    }
}

fn trace(
    handles: &Handles,
    session: &SessionRow,
    query: &TraceQuery,
) -> Result<TraceView, ServiceError> {
    let setup = replays::setup(session, &query.settings, None)?;
    let mut judging = Judging::new(setup, views::memory(&session.baseline)?);
    let mut thinned = Thinned::new(query.points, expected(session, query));
    play(handles, &session.id, |input| {
        let is_sample = matches!(input, Input::Sample(_));
        judging.input(input);
        let point = is_sample.then(|| TracePoint::of(&judging.engine().state())).flatten();
        let Some(point) = point.filter(|point| point.t_s() >= query.from_s) else {
            return if handles.closing.is_cancelled() { Flow::Enough } else { Flow::More };
        };
        if point.t_s() > query.to_s || handles.closing.is_cancelled() {
            return Flow::Enough;
        }
        thinned.take(point);
        Flow::More
    })?;
    Ok(thinned.view())
}

/// Moments of the stretch, if they lie evenly in the session.
fn expected(session: &SessionRow, query: &TraceQuery) -> f64 {
    let progress = session.progress;
    let (first, last) = (progress.first_t_s.unwrap_or(0.0), progress.last_t_s.unwrap_or(0.0));
    let wanted_s = (query.to_s.min(last) - query.from_s.max(first)).max(0.0);
    let share = if last > first { wanted_s / (last - first) } else { 1.0 };
    progress.n_samples as f64 * share
}

/// Moments thinned out evenly as they come, however many there will be and
/// however they lie in time: when there is no more room every other one goes,
/// and from then on every other one is taken.
struct Thinned {
    points: Vec<TracePoint>,
    most: usize,
    stride: u64,
    n_seen: u64,
}

impl Thinned {
    /// At most `most` moments, 1 to [`MAX_TRACE_POINTS`], of about `expected`.
    fn new(most: u32, expected: f64) -> Self {
        let most = most.clamp(1, MAX_TRACE_POINTS);
        let stride = (expected / f64::from(most)).ceil().max(1.0) as u64;
        Self { points: Vec::new(), most: most as usize, stride, n_seen: 0 }
    }

    /// Takes the next moment; one that is no later than the last is left out.
    fn take(&mut self, point: TracePoint) {
        if self.points.last().is_some_and(|last| last.t_s() >= point.t_s()) {
            return;
        }
        let n_seen = self.n_seen;
        self.n_seen += 1;
        if n_seen.is_multiple_of(self.stride) && self.points.len() == self.most {
            let mut keep = [false, true].into_iter().cycle();
            self.points.retain(|_| keep.next() == Some(false));
            self.stride *= 2;
        }
        if n_seen.is_multiple_of(self.stride) && self.points.len() < self.most {
            self.points.push(point);
        }
    }

    fn view(&self) -> TraceView {
        let mut view = TraceView::default();
        self.points.iter().for_each(|point| view.push(point));
        view
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::engine::State;
    use offbd_core::vocabulary::SimTime;
    use proptest::prelude::*;

    fn thinned(most: u32, times_s: impl Iterator<Item = f64>) -> Vec<f64> {
        let mut thinned = Thinned::new(most, 0.0);
        for t_s in times_s {
            let state = State { at: SimTime::new(t_s), ..State::default() };
            thinned.take(TracePoint::of(&state).unwrap());
        }
        thinned.view().t_s
    }

    #[test]
    fn a_gap_makes_no_more_of_them() {
        let dense = (0..10_000).map(|i| f64::from(i) * 0.01);
        let all = thinned(500, dense.chain([1e9]));
        assert!((250..=500).contains(&all.len()), "{}", all.len());
    }

    proptest! {
        #[test]
        fn they_are_as_many_as_wanted_and_evenly_spread(most in 1..60_u32, n in 1..2000_u32) {
            let kept = thinned(most, (0..n).map(f64::from));
            prop_assert!(kept.len() <= most as usize);
            prop_assert!(kept.len() >= (n.min(most) as usize).div_ceil(2));
            let steps: Vec<f64> = kept.windows(2).map(|w| w[1] - w[0]).collect();
            prop_assert!(steps.windows(2).all(|w| w[0] == w[1]), "{:?}", kept);
        }
    }
}
