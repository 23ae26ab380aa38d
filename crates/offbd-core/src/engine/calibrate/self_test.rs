//! Judges a healthy session by what was learnt: the likelihood of its readings, and how
//! close each monitor came to an alarm.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use alloc::collections::VecDeque;

use crate::diagnosis::{Evidence, FaultMemory, Transition};
use crate::engine::{Engine, Input, Setup};
use crate::vocabulary::{Axis, FaultCode, FaultKind, FaultStatus, PerAxis, Sample};

/// Factor on the times that confirm a fault, for the tests: no healthy session may fail
/// for longer than this fraction. Chosen.
pub(super) const PATIENCE: f64 = 0.6;
/// Time for which scatter must persist to count, s. Chosen.
const LASTING_S: f64 = 0.2;

/// The result of one session.
pub(super) struct SelfTest {
    /// Number of the session among those given, from 1 on.
    pub(super) session: usize,
    /// The first confirmed fault.
    pub(super) alarm: Option<Accusation>,
    /// Largest evidence against each servo, nats, and its time, s.
    pub(super) most_nats: PerAxis<(f64, f64)>,
    /// Largest evidence of the path of each axis, nats.
    pub(super) most_path_nats: PerAxis<f64>,
    pub(super) most_outliers: f64,
    /// Largest scatter that persisted, m.
    pub(super) most_scatter_m: f64,
    /// The closest approach of each monitor to an alarm by duration of failure, 0 to 1,
    /// and the time for which it could judge, s.
    pub(super) nearest: [(f64, f64); FaultCode::COUNT],
    /// Log-likelihood of the readings of each axis, nats.
    pub(super) log_likelihood_nats: PerAxis<f64>,
}

/// A fault that a healthy session was accused of.
#[derive(Clone, Copy)]
pub(super) struct Accusation {
    pub(super) at_s: f64,
    pub(super) code: FaultCode,
    pub(super) kind: Option<FaultKind>,
    pub(super) still_s: f64,
    pub(super) unseen_s: f64,
    /// Time of the jump of the readings that the sensor is blamed for, s.
    pub(super) jump_s: Option<f64>,
}

/// Judges `samples`, session number `session`, with `setup`.
pub(super) fn judge(setup: &Setup, session: usize, samples: &[Sample]) -> SelfTest {
    let mut engine = Engine::new(setup.clone(), FaultMemory::default());
    let (mut transitions, mut alarm, mut most_outliers) = (Vec::new(), None, 0.0_f64);
    let (mut scatter, mut nats) = (SustainedMaximum::default(), PerAxis::<(f64, f64)>::default());
    for &sample in samples {
        engine.handle(Input::Sample(sample), &mut transitions);
        let seen = engine.evidence();
        most_outliers = most_outliers.max(f64::from(seen.outliers));
        scatter.take(sample.t_s, seen.scatter_m.unwrap_or(0.0));
        let reached = engine.most_nats();
        for axis in Axis::ALL {
            if reached[axis] > nats[axis].0 {
                nats[axis] = (reached[axis], sample.t_s);
            }
        }
        alarm = alarm.or_else(|| transitions.iter().find_map(confirmed));
        transitions.clear();
    }
    SelfTest {
        session,
        alarm,
        most_nats: nats,
        most_path_nats: engine.most_path_nats(),
        most_outliers,
        most_scatter_m: scatter.most,
        nearest: engine.nearest(),
        log_likelihood_nats: engine.log_likelihood_nats(),
    }
}

fn confirmed(t: &Transition) -> Option<Accusation> {
    let Evidence { still_s, unseen_s, jump, .. } = t.evidence;
    let (at_s, code, kind) = (t.at.seconds(), t.code, t.suspicion.kind);
    let jumped = jump.filter(|_| kind == Some(FaultKind::Jump));
    let jump_s = jumped.map(|jump| jump.at_s);
    let alarm = Accusation { at_s, code, kind, still_s, unseen_s, jump_s };
    (t.status == FaultStatus::Confirmed).then_some(alarm)
}

/// The largest value that a quantity has exceeded for [`LASTING_S`].
#[derive(Default)]
struct SustainedMaximum {
    /// The values that no later one has undercut, with their times, s.
    low: VecDeque<(f64, f64)>,
    since_s: Option<f64>,
    most: f64,
}

impl SustainedMaximum {
    fn take(&mut self, t_s: f64, value: f64) {
        while self.low.back().is_some_and(|&(_, v)| v >= value) {
            self.low.pop_back();
        }
        self.low.push_back((t_s, value));
        while self.low.len() > 1 && self.low[0].0 <= t_s - LASTING_S {
            self.low.pop_front();
        }
        if t_s - *self.since_s.get_or_insert(t_s) >= LASTING_S {
            self.most = self.most.max(self.low[0].1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_lasts_counts() {
        let mut lasting = SustainedMaximum::default();
        for i in 0..200 {
            // A peak of 0.1 s, a plateau of 0.3 s.
            let value = match i {
                50..60 => 9.0,
                100..130 => 3.0,
                _ => 1.0,
            };
            lasting.take(f64::from(i) * 0.01, value);
        }
        assert_eq!(lasting.most, 3.0);
    }
}
