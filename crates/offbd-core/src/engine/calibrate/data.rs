//! The sessions to learn from, without moments that contradict the rest.
//!
//! A sensor that reads elsewhere for a moment, or a ball that a hand sets down elsewhere,
//! is not noise: a wider noise would hide faults in all of the other readings.
//! Such a moment is left out and named; what remains decides.

#[cfg(not(feature = "std"))]
use crate::no_std::*;

use super::{CannotCalibrate, MOVING_M};
use crate::diagnosis::{Contradiction, LeftOut, Settings};
use crate::vocabulary::Sample;

/// Time at the start of a session that counts for nothing, s: a hand lets the ball go.
/// Chosen.
const LETTING_GO_S: f64 = 1.0;
/// Share of a session that the time to let go may be at most. Chosen: a session of a few
/// seconds keeps most of them.
const LETTING_GO_SHARE: f64 = 0.1;
/// Largest share of a session that may be left out, besides its first second. Chosen: of 98
/// calibrations of simulated rigs two leave out a moment; readings that jump for a
/// twentieth of the time do so all day, and what was learnt without them would promise a
/// sensor that the rig does not have.
pub(super) const MOST_LEFT_OUT: f64 = 0.05;
/// Time between two contradictions below which all of it is left out, s. Chosen: it tells
/// less than the two cost, and its readings may be of neither path.
const APART_S: f64 = 2.0;
/// Time for which readings that repeat each other before a jump count as held, s: that of
/// a few frames of a camera. Chosen.
const HELD_S: f64 = 0.1;

/// The sessions of a rig that are learnt from.
pub(super) struct Data {
    pub(super) sessions: Vec<Vec<Sample>>,
    pub(super) left_out: Vec<LeftOut>,
    /// Of each session as it was given, s.
    durations_s: Vec<f64>,
}

impl Data {
    pub(super) fn new(sessions: &[Vec<Sample>]) -> Self {
        let duration_s = |s: &Vec<Sample>| span_s(s).map_or(0.0, |(from, to)| to - from);
        let durations_s = sessions.iter().map(duration_s).collect();
        let sessions = sessions.iter().map(|session| released(session)).collect();
        Self { sessions, left_out: Vec::new(), durations_s }
    }

    /// How long the sessions last together, s.
    pub(super) fn duration_s(&self) -> f64 {
        self.durations_s.iter().sum()
    }

    /// Leaves out the moment around a jump of the readings at `jump_s` that is certain at
    /// `certain_s` in session number `session`. Returns what is left out there;
    /// `None` if no sample is in it.
    ///
    /// # Errors
    /// [`CannotCalibrate::Contradictory`] if that is too much of it.
    pub(super) fn leave_out_jump(
        &mut self,
        session: usize,
        jump_s: f64,
        certain_s: f64,
    ) -> Result<Option<LeftOut>, CannotCalibrate> {
        let samples = &mut self.sessions[session - 1];
        let held_s = held_since_s(samples, jump_s).filter(|since| jump_s - since >= HELD_S);
        let from_s = held_s.unwrap_or(jump_s);
        let reason = held_s.map_or(Contradiction::Jumped, |_| Contradiction::Held);
        // Both sides of it are judged apart only if it is a gap.
        let to_s = certain_s.max(from_s + gap_s(samples));
        self.leave_out(LeftOut { session, from_s, to_s, reason })
    }

    /// Leaves out the time for which the ball of session number `session` had stood since
    /// `since_s` when that was certain, at `certain_s`, until it moves on. Returns what is left out
    /// there; `None` if no sample is in it.
    ///
    /// # Errors
    /// [`CannotCalibrate::Sticks`] if it has stood before.
    pub(super) fn leave_out_stop(
        &mut self,
        session: usize,
        since_s: f64,
        certain_s: f64,
    ) -> Result<Option<LeftOut>, CannotCalibrate> {
        let to_s = moves_on_s(&self.sessions[session - 1], certain_s);
        self.leave_out(LeftOut { session, from_s: since_s, to_s, reason: Contradiction::Stood })
    }

    /// Leaves out a moment, together with those next to it.
    fn leave_out(&mut self, mut moment: LeftOut) -> Result<Option<LeftOut>, CannotCalibrate> {
        let session = moment.session;
        let samples = &mut self.sessions[session - 1];
        let near = |other: &LeftOut| {
            other.session == session
                && other.from_s <= moment.to_s + APART_S
                && moment.from_s <= other.to_s + APART_S
        };
        let (joined, mut apart): (Vec<LeftOut>, Vec<LeftOut>) =
            self.left_out.iter().partition(|other| near(other));
        for other in joined {
            moment = LeftOut {
                from_s: moment.from_s.min(other.from_s),
                to_s: moment.to_s.max(other.to_s),
                reason: if other.from_s < moment.from_s { other.reason } else { moment.reason },
                ..moment
            };
        }
        let n = samples.len();
        samples.retain(|s| !moment.contains(s.t_s));
        if samples.len() == n {
            return Ok(None);
        }
        apart.push(moment);
        apart.sort_by(|a, b| a.session.cmp(&b.session).then(a.from_s.total_cmp(&b.from_s)));
        self.left_out = apart;
        self.check_left_out(session).map(|()| Some(moment))
    }

    /// Checks that not too much is left out of `session`: one stop, since a hand holds the ball once
    /// and friction again and again, and a small share of the rest.
    fn check_left_out(&self, session: usize) -> Result<(), CannotCalibrate> {
        let is_stop = |m: &&LeftOut| m.reason == Contradiction::Stood;
        let mut stops = self.left_out.iter().filter(|m| m.session == session).filter(is_stop);
        if let (Some(first), n @ 1..) = (stops.next(), stops.count()) {
            return Err(CannotCalibrate::Sticks { session, n: n + 1, from_s: first.from_s });
        }
        let of_session = || self.left_out.iter().filter(|m| m.session == session && !is_stop(m));
        let left_out_s: f64 = of_session().map(|m| m.to_s - m.from_s).sum();
        let share = left_out_s / self.durations_s[session - 1];
        match of_session().next() {
            Some(&first) if share > MOST_LEFT_OUT => Err(CannotCalibrate::Contradictory {
                session,
                percent: 100.0 * share,
                n: of_session().count(),
                first,
            }),
            _ => Ok(()),
        }
    }
}

/// First and last time of a session, s; `None` if it has none.
fn span_s(session: &[Sample]) -> Option<(f64, f64)> {
    let times = || session.iter().map(|s| s.t_s).filter(|t| t.is_finite());
    times().reduce(f64::min).zip(times().reduce(f64::max))
}

/// Returns `session` without the time in which a hand lets the ball go.
fn released(session: &[Sample]) -> Vec<Sample> {
    let Some((from, to)) = span_s(session) else { return session.to_vec() };
    let free_s = from + LETTING_GO_S.min(LETTING_GO_SHARE * (to - from));
    session.iter().filter(|s| s.t_s >= free_s).copied().collect()
}

/// Returns since when the readings before `jump_s` repeat each other or are missing, s.
fn held_since_s(samples: &[Sample], jump_s: f64) -> Option<f64> {
    let mut before = samples.iter().rev().skip_while(|s| s.t_s >= jump_s);
    let last = before.by_ref().find(|s| s.x_m.is_some() || s.y_m.is_some())?;
    let missing = |s: &Sample| s.x_m.is_none() && s.y_m.is_none();
    let held = before.take_while(|s| missing(s) || (s.x_m, s.y_m) == (last.x_m, last.y_m));
    Some(held.last().unwrap_or(last).t_s)
}

/// Returns when the ball that stands at `certain_s` has moved on, s; the end if it never does.
fn moves_on_s(samples: &[Sample], certain_s: f64) -> f64 {
    let position = |s: &Sample| [s.x_m, s.y_m];
    let is_seen = |s: &&Sample| position(s) != [None, None];
    let mut after = samples.iter().skip_while(|s| s.t_s < certain_s).filter(is_seen);
    let Some(there) = after.next() else { return certain_s };
    let has_moved = |s: &&Sample| {
        let both = position(s).into_iter().zip(position(there));
        let mut moved = both.filter_map(|(to, from)| Some((to? - from?).abs()));
        moved.any(|moved_m| moved_m > MOVING_M)
    };
    let end = samples.last().unwrap_or(there);
    after.find(has_moved).unwrap_or(end).t_s
}

/// Time without a sample of `samples` that is a gap to the engine, s.
fn gap_s(samples: &[Sample]) -> f64 {
    let period_s = span_s(samples).map_or(0.0, |(from, to)| (to - from) / samples.len() as f64);
    Settings::default().gap_after_s(period_s) + period_s
}

#[cfg(test)]
mod tests {
    use super::super::tests::session;
    use super::super::{CannotCalibrate, calibrate_with_prospects};
    use super::*;
    use crate::diagnosis::{Calibration, Prospects};
    use crate::engine::Rig;
    use crate::vocabulary::Axis;

    /// Time at which the readings go wrong, s.
    const AT_S: f64 = 30.0;

    fn learnt(change: impl Fn(usize, &mut Sample)) -> Result<Calibration, CannotCalibrate> {
        let mut sessions = [0.85, 0.86, 0.84].map(|gain| session(60.0, 0.03, gain));
        sessions[2].iter_mut().enumerate().for_each(|(i, s)| change(i, s));
        calibrate_with_prospects(&Rig::chapter("a"), &sessions)
    }

    /// A panel that loses contact reads its corner.
    fn lose_contact(s: &mut Sample) {
        (s.x_m, s.y_m) = (Some(-0.17), Some(-0.1));
    }

    fn assert_alike(found: &Calibration, without: &Calibration) {
        for axis in Axis::ALL {
            let noise = |c: &Calibration| c.axes[axis].unwrap().noise_m;
            assert!((noise(found) / noise(without) - 1.0).abs() < 0.1, "{:?}", found.axes[axis]);
            let dead = |c: &Calibration| c.prospects.unwrap().servos[axis].unwrap().dead_s;
            let [found, without] = [found, without].map(|c| dead(c).unwrap());
            assert!((found / without - 1.0).abs() < 0.2, "{found} s, {without} s");
        }
        let Prospects { n_trials, .. } = found.prospects.unwrap();
        assert!(n_trials + 1 >= without.prospects.unwrap().n_trials, "{n_trials}");
    }

    #[test]
    fn a_moment_without_contact_is_left_out_and_named() {
        let found = learnt(|_, s| {
            if (AT_S..AT_S + 0.24).contains(&s.t_s) {
                lose_contact(s);
            }
        });
        let (found, without) = (found.unwrap(), learnt(|_, _| {}).unwrap());
        assert_alike(&found, &without);
        assert_eq!(without.left_out, []);
        let [moment] = found.left_out[..] else { panic!("{:?}", found.left_out) };
        assert_eq!((moment.session, moment.reason), (3, Contradiction::Jumped));
        assert!((moment.from_s - AT_S).abs() < 0.05 && moment.to_s < AT_S + 1.0, "{moment:?}");
    }

    #[test]
    fn a_ball_that_is_set_down_elsewhere_is_left_out() {
        let found = learnt(|_, s| {
            if s.t_s >= AT_S {
                s.x_m = s.x_m.map(|x| x + 0.048);
            }
        });
        let found = found.unwrap();
        assert_alike(&found, &learnt(|_, _| {}).unwrap());
        assert_eq!(found.left_out.len(), 1, "{:?}", found.left_out);
    }

    #[test]
    fn readings_that_are_held_are_left_out_from_their_start() {
        let healthy = session(60.0, 0.03, 0.84);
        let found = learnt(|i, s| {
            if (AT_S..AT_S + 0.6).contains(&s.t_s) {
                let held = &healthy[i - ((s.t_s - AT_S) / 0.01).round() as usize];
                (s.x_m, s.y_m) = (held.x_m, held.y_m);
            }
        });
        let found = found.unwrap();
        for moment in &found.left_out {
            assert_eq!(moment.reason, Contradiction::Held);
            assert!((moment.from_s - AT_S).abs() < 0.05, "{moment:?}");
        }
        assert_alike(&found, &learnt(|_, _| {}).unwrap());
    }

    #[test]
    fn readings_that_jump_every_few_seconds_are_refused_with_their_share() {
        let error = learnt(|_, s| {
            if s.t_s > 2.0 && s.t_s.rem_euclid(4.0) < 0.24 {
                lose_contact(s);
            }
        });
        let error = error.unwrap_err();
        assert!(matches!(error, CannotCalibrate::Contradictory { .. }), "{error}");
        let words = error.to_string();
        assert!(
            words.starts_with("session 3: ") && words.contains("contradict the rest"),
            "{words}"
        );
    }

    /// Returns what is learnt if a hand holds the ball of the third session for 3 s from each of
    /// `starts` on, s, while its controller tilts the plate; the ball rolls on from there.
    fn held_by_a_hand(starts: &'static [f64]) -> Result<Calibration, CannotCalibrate> {
        let healthy = session(60.0, 0.03, 0.84);
        let index = |t_s: f64| (t_s / 0.01).round() as usize;
        let moved = |of: fn(&Sample) -> Option<f64>, t_s: f64| {
            let at = |t_s: f64| of(&healthy[index(t_s)]).unwrap();
            let lost = starts.iter().filter(|from| t_s > **from);
            let rolled =
                at(t_s) - lost.map(|from| at(t_s.min(from + 3.0)) - at(*from)).sum::<f64>();
            // The readings of a ball at rest differ in their last digit.
            rolled + 1e-4 * (index(t_s) / 3 % 2) as f64
        };
        learnt(|_, s| {
            s.x_m = Some(moved(|s| s.x_m, s.t_s));
            s.y_m = Some(moved(|s| s.y_m, s.t_s));
            if starts.iter().any(|from| (*from..from + 3.0).contains(&s.t_s)) {
                (s.cmd_qx_rad, s.cmd_qy_rad) = (Some(0.1), Some(0.1));
            }
        })
    }

    #[test]
    fn the_time_for_which_a_hand_holds_the_ball_is_left_out() {
        let found = held_by_a_hand(&[AT_S]).unwrap();
        let [moment] = found.left_out[..] else { panic!("{:?}", found.left_out) };
        assert_eq!((moment.session, moment.reason), (3, Contradiction::Stood));
        assert!((moment.from_s - AT_S).abs() < 0.5, "{moment:?}");
        assert!((moment.to_s - AT_S - 3.0).abs() < 0.5, "{moment:?}");
        assert_alike(&found, &learnt(|_, _| {}).unwrap());
    }

    #[test]
    fn a_ball_that_stands_again_and_again_is_refused_since_it_sticks() {
        let error = held_by_a_hand(&[15.0, 30.0, 45.0]).unwrap_err();
        assert!(matches!(error, CannotCalibrate::Sticks { session: 3, .. }), "{error}");
    }

    /// For the first second a hand holds the ball.
    #[test]
    fn the_hand_that_lets_the_ball_go_counts_for_nothing() {
        let healthy = session(60.0, 0.03, 0.84);
        let n_held = 100;
        let held = learnt(|_, s| {
            if s.t_s < LETTING_GO_S {
                (s.x_m, s.y_m) = (healthy[n_held].x_m, healthy[n_held].y_m);
            }
        });
        assert_eq!(held.unwrap().axes, learnt(|_, _| {}).unwrap().axes);
    }
}
