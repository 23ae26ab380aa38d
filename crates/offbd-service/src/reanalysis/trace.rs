//! The trace of a session, for plots: evaluates the recording again and keeps a limited
//! number of points, or passes on all of them in blocks.

use std::ops::ControlFlow;

use tokio::sync::mpsc;

use super::evaluation::Evaluation;
use crate::ServiceError;
use crate::writing::Handles;
use offbd_core::vocabulary::TimeRange;
use offbd_store::SessionRow;
use offbd_wire::asset::CalibrationView;
use offbd_wire::service::ReplaySettingsView;
use offbd_wire::trace::{TracePoint, TraceView};

/// Limit of the points of a trace; a range with more points is decimated.
pub const MAX_TRACE_POINTS: u32 = 20_000;

/// Points of a block of a trace that is not decimated.
const BLOCK_POINTS: usize = 8192;

/// The time range, the number of points and the settings of a trace.
#[derive(Clone, Debug)]
pub struct TraceQuery {
    pub range: TimeRange,
    /// Limit of points.
    pub points: u32,
    pub settings: ReplaySettingsView,
}

/// A block of a trace, or why there are no more.
pub(crate) type TraceBlock = Result<TraceView, ServiceError>;

/// Computes the trace of `session`, with the calibration `learnt` if it is not the recorded
/// one.
///
/// # Errors
/// Those of [`Evaluation::begin`] and [`Evaluation::run`].
pub(crate) fn trace(
    handles: &Handles,
    session: &SessionRow,
    query: &TraceQuery,
    learnt: Option<&CalibrationView>,
) -> Result<TraceView, ServiceError> {
    let (range, settings) = (query.range, &query.settings);
    let evaluation = Evaluation::begin(handles, session, range, settings, learnt)?;
    let thresholds = evaluation.thresholds();
    let expected = expected_points(session, query, evaluation.period_s());
    let mut decimator = Decimator::new(query.points, expected);
    evaluation.run(handles, session, |point| {
        decimator.push(point);
        ControlFlow::Continue(())
    })?;
    Ok(TraceView { thresholds, ..decimator.view() })
}

/// Sends every point of `evaluation` to `blocks`, in blocks, until nobody reads them; the last
/// message is the error if the evaluation fails. Waits for the reader.
pub(crate) fn send_blocks(
    evaluation: Evaluation,
    handles: &Handles,
    session: &SessionRow,
    blocks: &mpsc::Sender<TraceBlock>,
) {
    let mut block = TraceView::default();
    let done = evaluation.run(handles, session, |point| {
        block.push(&point);
        if block.t_s.len() < BLOCK_POINTS {
            return ControlFlow::Continue(());
        }
        match blocks.blocking_send(Ok(std::mem::take(&mut block))) {
            Ok(()) => ControlFlow::Continue(()),
            Err(_) => ControlFlow::Break(()),
        }
    });
    // Without a reader there is nobody to tell.
    let _ = blocks.blocking_send(done.map(|()| block));
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

    /// Adds the next point.
    fn push(&mut self, point: TracePoint) {
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
