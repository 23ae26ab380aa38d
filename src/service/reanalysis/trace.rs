//! The trace of a session, for plots: evaluates the recording again and keeps a limited
//! number of points.

use std::ops::ControlFlow;

use crate::service::playback::play;
use crate::service::replay_settings;
use crate::service::writing::Handles;
use crate::service::{ServiceError, snapshots};
use crate::store::SessionRow;
use crate::wire::asset::CalibrationView;
use crate::wire::service::ReplaySettingsView;
use crate::wire::trace::{ThresholdsView, TracePoint, TraceView};
use offbd_core::engine::Input;
use offbd_core::vocabulary::TimeRange;

/// Limit of the samples to evaluate, which take several seconds of one core. A request for a
/// longer range is refused.
const MAX_EVALUATED: i64 = 2_000_000;

/// Limit of the points of a trace; a range with more points is decimated.
pub const MAX_TRACE_POINTS: u32 = 20_000;

/// The time range, the number of points and the settings of a trace.
#[derive(Clone, Debug)]
pub struct TraceQuery {
    pub range: TimeRange,
    /// Limit of points.
    pub points: u32,
    pub settings: ReplaySettingsView,
}

/// Computes the trace of `session`, with the calibration `learnt` if it is not the recorded
/// one; ends early if the service shuts down.
///
/// # Errors
/// [`ServiceError::TooMany`] if too many samples must be evaluated: those of the range, and
/// those from the last snapshot before it, or from the start of the session, without one.
pub(in crate::service) fn trace(
    handles: &Handles,
    session: &SessionRow,
    query: &TraceQuery,
    learnt: Option<&CalibrationView>,
) -> Result<TraceView, ServiceError> {
    let setup = replay_settings::setup(session, &query.settings, learnt)?;
    let expected = expected_points(session, query, setup.settings.period_s);
    let (first, end) = handles.wait(handles.store.indexes(session, query.range))?;
    let (first, mut judging) = snapshots::engine_before(handles, session, setup, first)?;
    if end - first > MAX_EVALUATED {
        let what = "samples to evaluate for this range";
        let limit = usize::try_from(MAX_EVALUATED).unwrap_or(usize::MAX);
        return Err(ServiceError::TooMany { what, limit });
    }
    let mut decimator = Decimator::new(query.points, expected);
    play(handles, session, first, |input| {
        let is_sample = matches!(input, Input::NewSample(_));
        judging.input(input);
        let point = is_sample.then(|| TracePoint::of(&judging.engine().state())).flatten();
        let Some(point) = point.filter(|point| point.t_s() >= query.range.from_s) else {
            return match handles.closing.is_cancelled() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            };
        };
        if point.t_s() > query.range.to_s || handles.closing.is_cancelled() {
            return ControlFlow::Break(());
        }
        decimator.push(point);
        ControlFlow::Continue(())
    })?;
    let thresholds = ThresholdsView::of(judging.engine());
    Ok(TraceView { thresholds, ..decimator.view() })
}

/// Returns the expected number of points in the range, assuming evenly spaced samples and
/// evidence that is renewed every `period_s`.
fn expected_points(session: &SessionRow, query: &TraceQuery, period_s: f64) -> f64 {
    let progress = session.progress;
    let (first, last) = (progress.first_t_s.unwrap_or(0.0), progress.last_t_s.unwrap_or(0.0));
    let range_s = (query.range.to_s.min(last) - query.range.from_s.max(first)).max(0.0);
    let share = if last > first { range_s / (last - first) } else { 1.0 };
    let n_samples = progress.n_samples as f64 * share;
    if period_s > 0.0 { n_samples.min(range_s / period_s) } else { n_samples }
}

/// Decimates a stream of points of unknown length evenly, independently of their times:
/// keeps every n-th point; when it is full, it drops every other point and doubles n.
struct Decimator {
    points: Vec<TracePoint>,
    limit: usize,
    stride: u64,
    n_seen: u64,
}

impl Decimator {
    /// Keeps at most `limit` points, 1 to [`MAX_TRACE_POINTS`], of about `expected`.
    fn new(limit: u32, expected: f64) -> Self {
        let limit = limit.clamp(1, MAX_TRACE_POINTS);
        let stride = (expected / f64::from(limit)).ceil().max(1.0) as u64;
        Self { points: Vec::new(), limit: limit as usize, stride, n_seen: 0 }
    }

    /// Adds the next point; one that is not later than the last is ignored.
    fn push(&mut self, point: TracePoint) {
        if self.points.last().is_some_and(|last| last.t_s() >= point.t_s()) {
            return;
        }
        let n_seen = self.n_seen;
        self.n_seen += 1;
        if n_seen.is_multiple_of(self.stride) && self.points.len() == self.limit {
            let mut keep = [false, true].into_iter().cycle();
            self.points.retain(|_| keep.next() == Some(false));
            self.stride *= 2;
        }
        if n_seen.is_multiple_of(self.stride) && self.points.len() < self.limit {
            self.points.push(point);
        }
    }

    fn view(&self) -> TraceView {
        let mut view = TraceView { stride: self.stride, ..TraceView::default() };
        self.points.iter().for_each(|point| view.push(point));
        view
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::diagnosis::Evidence;
    use offbd_core::engine::State;
    use offbd_core::vocabulary::SimTime;
    use proptest::prelude::*;

    fn thinned(most: u32, times_s: impl Iterator<Item = f64>) -> TraceView {
        let mut decimator = Decimator::new(most, 0.0);
        for t_s in times_s {
            let at = SimTime::new(t_s);
            let evidence = Evidence { at, ..Evidence::default() };
            let state = State { at, evidence, ..State::default() };
            decimator.push(TracePoint::of(&state).unwrap());
        }
        decimator.view()
    }

    #[test]
    fn a_gap_in_time_does_not_increase_the_number_of_points() {
        let dense = (0..10_000).map(|i| f64::from(i) * 0.01);
        let all = thinned(500, dense.chain([1e9])).t_s;
        assert!((250..=500).contains(&all.len()), "{}", all.len());
    }

    proptest! {
        #[test]
        fn the_points_are_within_the_limit_and_evenly_spread(most in 1..60_u32, n in 1..2000_u32) {
            let TraceView { t_s: kept, stride, .. } = thinned(most, (0..n).map(f64::from));
            prop_assert!(kept.len() <= most as usize);
            prop_assert!(kept.len() >= (n.min(most) as usize).div_ceil(2));
            let steps: Vec<f64> = kept.windows(2).map(|w| w[1] - w[0]).collect();
            prop_assert!(steps.iter().all(|&step| step == stride as f64), "{:?}", kept);
            prop_assert_eq!(stride == 1, kept.len() == n as usize);
        }
    }
}
