//! The outlier gate: whether a ball can be where a reading says.
//!
//! A single reading far off the path is refused. Readings that persist on another path
//! are accepted. Where the two paths meet, the ball was pushed; where they do not, the
//! readings have jumped farther than a ball can move.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use crate::vocabulary::PerAxis;

/// Largest change of a ball's velocity between two readings, m/s: by a push by hand.
/// Chosen; gravity adds less than 0.1 m/s even at 30 Hz.
const HARDEST_PUSH_M_S: f64 = 0.7;

/// Time constant of the velocity of the track, s: two or three readings of a camera.
/// Chosen.
const TRACK_MEMORY_S: f64 = 0.06;

/// Deviation that is always allowed, in standard deviations of the noise. Chosen.
const ALLOWED_DEVIATIONS: f64 = 8.0;

/// Noise assumed for a rig that is not learnt, m: ultrasonic sensors scatter by 8 to 15
/// mm, cameras by up to 2.
pub const UNKNOWN_NOISE_M: f64 = 5e-3;

/// Least distance between the old and the new path that counts as a jump, beyond the
/// noise, m. Chosen: the error of a path whose velocity comes from a few readings.
const LEAST_JUMP_M: f64 = 0.012;

/// Acceleration by which a hand may move the ball between two readings, m/s². Chosen.
const SHOVE_M_S2: f64 = 2.0;

/// Number of consecutive readings that make a new path credible. Chosen.
const BELIEVED_AFTER: u32 = 4;
/// Duration of consecutive readings that makes a new path credible, s. Chosen.
const BELIEVED_AFTER_S: f64 = 0.12;

/// A jump of the readings, farther than a ball can move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PositionJump {
    /// Time of the first reading after the jump, s on the device's clock.
    pub at_s: f64,
    /// Distance of the jump, m.
    pub size_m: f64,
}

/// The gate's decision on a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GateOutcome {
    /// Accepted as a position of the ball. `outliers` counts earlier readings that have
    /// turned out to be outliers because the path returned; `undone` tells that one of
    /// them had been accepted.
    Accepted { outliers: u32, undone: bool },
    /// Refused: an outlier, or the first of a new path.
    Refused,
    /// Accepted on a path that does not meet the old one: readings are now off by `by_m`, or the
    /// ball was moved.
    Jumped { jump: PositionJump, by_m: Vector2<f64> },
}

impl GateOutcome {
    /// Whether the reading may be used.
    #[must_use]
    pub const fn usable(self) -> bool {
        !matches!(self, Self::Refused)
    }
}

/// A path off the track, on which readings persist.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct NewPath {
    since_s: f64,
    first_m: Vector2<f64>,
    at_s: f64,
    position_m: Vector2<f64>,
    n: u32,
    /// Readings that differ from their predecessor: a sensor that is slower than its log
    /// repeats its outliers, too.
    distinct: u32,
    /// Whether a rim may have turned the ball where this path begins.
    turned: bool,
}

impl NewPath {
    fn velocity_m_s(&self) -> Vector2<f64> {
        (self.position_m - self.first_m) / (self.at_s - self.since_s)
    }

    fn start(t_s: f64, position_m: Vector2<f64>, turned: bool) -> Self {
        let (since_s, first_m, at_s) = (t_s, position_m, t_s);
        Self { since_s, first_m, at_s, position_m, n: 1, distinct: 1, turned }
    }

    fn with(self, t_s: f64, position_m: Vector2<f64>) -> Self {
        let distinct = self.distinct + u32::from(position_m != self.position_m);
        Self { at_s: t_s, position_m, n: self.n + 1, distinct, ..self }
    }
}

/// The last position and the velocity of the ball.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Track {
    at_s: f64,
    position_m: Vector2<f64>,
    velocity_m_s: Vector2<f64>,
    /// Number of readings on the track. One of few readings may itself consist of
    /// outliers.
    n: u32,
}

impl Track {
    fn start(at_s: f64, position_m: Vector2<f64>, n: u32) -> Self {
        Self { at_s, position_m, velocity_m_s: Vector2::zeros(), n }
    }

    /// Vector from the predicted position to a reading, m.
    fn off(&self, t_s: f64, position_m: Vector2<f64>) -> Vector2<f64> {
        position_m - self.position_m - self.velocity_m_s * (t_s - self.at_s)
    }

    /// Largest component of that vector, m.
    fn off_m(&self, t_s: f64, position_m: Vector2<f64>) -> f64 {
        self.off(t_s, position_m).amax()
    }

    fn shifted(mut self, t_s: f64, position_m: Vector2<f64>, velocity_m_s: Vector2<f64>) -> Self {
        self.position_m += position_m + velocity_m_s * (self.at_s - t_s);
        self.velocity_m_s += velocity_m_s;
        self
    }

    fn followed_by(&self, t_s: f64, position_m: Vector2<f64>) -> Self {
        let dt = t_s - self.at_s;
        if dt <= 0.0 {
            return Self { at_s: t_s, position_m, ..*self };
        }
        let now = (position_m - self.position_m) / dt;
        let gain = 1.0 - (-dt / TRACK_MEMORY_S).exp();
        let velocity_m_s = self.velocity_m_s + gain * (now - self.velocity_m_s);
        Self { at_s: t_s, position_m, velocity_m_s, n: self.n.saturating_add(1) }
    }
}

/// An accepted reading far off the track: after a push the ball moves away from the
/// track, after a jump the readings stay beside it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct SuspectedJump {
    before: Track,
    at_s: f64,
    off_m: Vector2<f64>,
}

impl SuspectedJump {
    /// Whether the readings have returned to the earlier track.
    fn was_outlier(&self, t_s: f64, position_m: Vector2<f64>) -> bool {
        self.share(t_s, position_m).abs() < JUMP_SHARE
    }

    /// Distance of a reading from the earlier track, as a fraction of the first one's.
    fn share(&self, t_s: f64, position_m: Vector2<f64>) -> f64 {
        let k = self.off_m.iamax();
        self.before.off(t_s, position_m)[k] / self.off_m[k]
    }

    /// Whether a reading at `t_s` is as far off the earlier track as the first one, and
    /// not as far as a push would have moved the ball since.
    fn is_jump(&self, t_s: f64, position_m: Vector2<f64>) -> bool {
        let share = self.share(t_s, position_m);
        let carried = (t_s - self.at_s) / (self.at_s - self.before.at_s);
        let least = carried.min(1.0) * JUMP_SHARE;
        let aside =
            (self.before.off(t_s, position_m) - self.off_m * share).amax() / self.off_m.amax();
        (1.0 - JUMP_SHARE..1.0 + least).contains(&share) && aside < JUMP_SHARE
    }
}

/// Time, s, over which the change of velocity is compared with a jump: a jump that is
/// shorter than the distance made by that change in this time is a ball moved by hand.
/// Chosen.
const BEND_S: f64 = 0.2;
/// Relative tolerance of the distance at which later readings stay after a jump. Chosen.
const JUMP_SHARE: f64 = 0.4;

/// The gate. Both axes are read together and judged together.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct OutlierGate {
    track: Option<Track>,
    /// The track before its last reading if that reading was far off: if the next one
    /// returns to this track, the last one was an outlier.
    before: Option<Track>,
    /// Outliers not yet reported.
    outliers: u32,
    new_path: Option<NewPath>,
    /// The last accepted reading that was far off the track.
    suspect: Option<SuspectedJump>,
}

impl OutlierGate {
    /// Judges the reading `position_m` at `t_s` of a sensor with noise `noise_m`. An axis
    /// without a reading counts as unmoved.
    pub fn take(
        &mut self,
        t_s: f64,
        position_m: PerAxis<Option<f64>>,
        noise_m: f64,
    ) -> GateOutcome {
        self.judge(t_s, position_m, noise_m, false)
    }

    /// Like [`take`](Self::take), where a rim may have turned the ball: readings that
    /// leave the track there have not jumped.
    pub fn take_at_rim(
        &mut self,
        t_s: f64,
        position_m: PerAxis<Option<f64>>,
        noise_m: f64,
    ) -> GateOutcome {
        // The rim may have made what looked like a jump.
        self.suspect = None;
        let gated = self.judge(t_s, position_m, noise_m, true);
        // After a bounce the track is a new one.
        if let Some(track) = &mut self.track {
            track.n = 1;
        }
        gated
    }

    fn judge(
        &mut self,
        t_s: f64,
        position_m: PerAxis<Option<f64>>,
        noise_m: f64,
        may_turn: bool,
    ) -> GateOutcome {
        let held = self.track.map_or(Vector2::zeros(), |t| t.position_m);
        let position_m =
            Vector2::new(position_m.x.unwrap_or(held.x), position_m.y.unwrap_or(held.y));
        let reach = |from_s: f64| ALLOWED_DEVIATIONS * noise_m + HARDEST_PUSH_M_S * (t_s - from_s);
        let Some(track) = self.track else {
            return self.begin(t_s, position_m, reach);
        };
        let off_m = track.off_m(t_s, position_m);
        // The longer the old path is not read, the farther the ball may have moved;
        // readings that persist on a new path still indicate a jump.
        let stays = |e: &NewPath| {
            let away_m = (position_m - e.position_m).amax();
            away_m <= reach(e.at_s) && away_m < off_m
        };
        let staying = self.new_path.filter(stays);
        if staying.is_none() && off_m <= reach(track.at_s) {
            let suspect = self.suspect.filter(|l| l.was_outlier(t_s, position_m));
            let jump_m = ALLOWED_DEVIATIONS * noise_m + LEAST_JUMP_M;
            // A return to the earlier track is not a jump off the last reading.
            let falls_back = |before: &Track| {
                off_m > jump_m && before.off_m(t_s, position_m) < JUMP_SHARE * off_m
            };
            let before = self.before.take().filter(falls_back);
            if let Some(before) = suspect.map(|l| l.before).or(before) {
                return self.undo(&before, t_s, position_m);
            }
            let doubtful = off_m > reach(track.at_s).min(jump_m) / 2.0;
            self.before = doubtful.then_some(track);
            if let Some(left) = self.left(&track, t_s, position_m, noise_m, may_turn) {
                self.follow(Track::start(t_s, position_m, BELIEVED_AFTER));
                return jumped(left.at_s, left.off_m);
            }
            return self.accept(track.followed_by(t_s, position_m));
        }
        if let Some(before) = self.before.take()
            && before.off_m(t_s, position_m) <= reach(before.at_s)
        {
            return self.undo(&before, t_s, position_m);
        }
        self.refuse(t_s, position_m, staying, &track, noise_m, may_turn)
    }

    /// Whether the last readings may have jumped; later ones decide.
    #[must_use]
    pub const fn suspects_jump(&self) -> bool {
        self.suspect.is_some()
    }

    /// Returns the jump that was suspected if accepted readings have stayed beside the track that
    /// they left.
    fn left(
        &mut self,
        track: &Track,
        t_s: f64,
        position_m: Vector2<f64>,
        noise_m: f64,
        may_turn: bool,
    ) -> Option<SuspectedJump> {
        if let Some(suspect) = self.suspect {
            let stays = suspect.is_jump(t_s, position_m);
            let long = t_s - suspect.at_s >= BELIEVED_AFTER_S;
            if long || !stays {
                self.suspect = None;
            }
            return (stays && long).then_some(suspect);
        }
        let off_m = track.off(t_s, position_m);
        let unseen_s = t_s - track.at_s;
        let allowed_m =
            ALLOWED_DEVIATIONS * noise_m + LEAST_JUMP_M + SHOVE_M_S2 / 8.0 * unseen_s * unseen_s;
        if off_m.amax() > allowed_m && !may_turn && track.n >= BELIEVED_AFTER {
            self.suspect = Some(SuspectedJump { before: *track, at_s: t_s, off_m });
        }
        None
    }

    /// Adds the straight line through (`t_s`, `position_m`) with slope `velocity_m_s` to
    /// all stored positions.
    pub fn shift(&mut self, t_s: f64, position_m: Vector2<f64>, velocity_m_s: Vector2<f64>) {
        let shifted = |track: Track| track.shifted(t_s, position_m, velocity_m_s);
        self.track = self.track.map(shifted);
        self.before = self.before.map(shifted);
        if let Some(suspect) = &mut self.suspect {
            suspect.before = shifted(suspect.before);
        }
        if let Some(there) = &mut self.new_path {
            there.first_m += position_m + velocity_m_s * (there.since_s - t_s);
            there.position_m += position_m + velocity_m_s * (there.at_s - t_s);
        }
    }

    /// Takes a reading without a track: refused until the next one agrees with it, since
    /// it may be an outlier, or until a few have not, since the ball may be faster than a
    /// push makes it.
    fn begin(
        &mut self,
        t_s: f64,
        position_m: Vector2<f64>,
        reach: impl Fn(f64) -> f64,
    ) -> GateOutcome {
        let before = self.new_path.take();
        let n = before.map_or(1, |e| e.n + 1);
        let agrees = |e: NewPath| (position_m - e.position_m).amax() <= reach(e.at_s);
        let start = Track::start(t_s, position_m, n);
        match before {
            Some(e) if agrees(e) => return self.accept(start),
            Some(e) if n >= BELIEVED_AFTER => {
                let velocity_m_s = (position_m - e.position_m) / (t_s - e.at_s);
                return self.accept(Track { velocity_m_s, ..start });
            }
            _ => {}
        }
        self.new_path = Some(NewPath { n, ..NewPath::start(t_s, position_m, false) });
        GateOutcome::Refused
    }

    /// Takes a reading off the track: refused until enough of them have persisted.
    fn refuse(
        &mut self,
        t_s: f64,
        position_m: Vector2<f64>,
        staying: Option<NewPath>,
        track: &Track,
        noise_m: f64,
        may_turn: bool,
    ) -> GateOutcome {
        let there = match staying {
            Some(e) => e.with(t_s, position_m),
            None => {
                self.outliers += self.new_path.map_or(0, |e| e.distinct);
                NewPath::start(t_s, position_m, may_turn)
            }
        };
        let (n, since_s) = (there.n, there.since_s);
        if n < BELIEVED_AFTER || t_s - since_s < BELIEVED_AFTER_S {
            self.new_path = Some(there);
            return GateOutcome::Refused;
        }
        self.new_path = None;
        let accepted = self.accept(Track::start(t_s, position_m, n));
        let unseen_s = there.since_s - track.at_s;
        let bent_m = SHOVE_M_S2 * unseen_s * unseen_s;
        let jump_m = jump_m(track, &there);
        let apart = jump_m.amax() > ALLOWED_DEVIATIONS * noise_m + LEAST_JUMP_M + bent_m;
        let bent_m_s = (there.velocity_m_s() - track.velocity_m_s).amax();
        let straight = bent_m_s * BEND_S < jump_m.amax();
        let stepped = apart && straight && !there.turned && track.n >= BELIEVED_AFTER;
        if stepped { jumped(there.since_s, jump_m) } else { accepted }
    }

    /// Forgets the track, as after a gap.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// Returns to the track `before` the last reading, which was an outlier.
    fn undo(&mut self, before: &Track, t_s: f64, position_m: Vector2<f64>) -> GateOutcome {
        self.suspect = None;
        self.outliers += 1;
        let outliers = self.follow(before.followed_by(t_s, position_m));
        GateOutcome::Accepted { outliers, undone: true }
    }

    fn accept(&mut self, track: Track) -> GateOutcome {
        GateOutcome::Accepted { outliers: self.follow(track), undone: false }
    }

    /// Continues along `track`; returns the outliers not yet reported.
    fn follow(&mut self, track: Track) -> u32 {
        let outliers = self.outliers + self.new_path.map_or(0, |e| e.distinct);
        (self.track, self.outliers, self.new_path) = (Some(track), 0, None);
        outliers
    }
}

fn jumped(at_s: f64, by_m: Vector2<f64>) -> GateOutcome {
    GateOutcome::Jumped { jump: PositionJump { at_s, size_m: by_m.norm() }, by_m }
}

/// Least distance between the extrapolated old path and the new path extrapolated back,
/// over the time between them, per axis: zero for a push.
fn jump_m(track: &Track, there: &NewPath) -> Vector2<f64> {
    let velocity = (there.position_m - there.first_m) / (there.at_s - there.since_s);
    let between_s = there.since_s - track.at_s;
    let early = there.first_m - velocity * between_s - track.position_m;
    let late = there.first_m - (track.position_m + track.velocity_m_s * between_s);
    let apart = |e: f64, l: f64| if e * l <= 0.0 { 0.0 } else { e.abs().min(l.abs()) };
    early.zip_map(&late, apart)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn along_x(x: f64) -> PerAxis<Option<f64>> {
        PerAxis { x: Some(x), y: None }
    }

    /// After a gap the ball may have rolled to where an outlier lies; it has not if the
    /// next reading is back on the path.
    #[test]
    fn the_return_from_an_outlier_is_not_a_step() {
        let mut gate = OutlierGate::default();
        let mut take = |t: f64, x: f64| gate.take(t, along_x(x), 1e-3);
        for (t, x) in [(0.0, 0.02), (0.08, 0.02), (0.16, 0.02), (0.24, 0.02), (0.32, 0.02)] {
            take(t, x);
        }
        assert!(take(0.56, -0.015).usable());
        assert_eq!(take(0.64, 0.021), GateOutcome::Accepted { outliers: 1, undone: true });
        for i in 1..20 {
            let gated = take(0.64 + 0.08 * f64::from(i), 0.021);
            assert!(!matches!(gated, GateOutcome::Jumped { .. }), "{i}: {gated:?}");
        }
    }

    /// The same jump where a rim may have turned the ball does not count.
    #[test]
    fn what_leaves_its_path_at_a_rim_has_not_stepped() {
        let jumped = |is_at_rim: bool| {
            let mut gate = resting(0.1);
            let take = |i: i32| match is_at_rim && i == 0 {
                true => gate.take_at_rim(f64::from(i) * 0.1, along_x(0.05), 1e-3),
                false => gate.take(f64::from(i) * 0.1, along_x(0.05), 1e-3),
            };
            (0..10).map(take).any(|gated| matches!(gated, GateOutcome::Jumped { .. }))
        };
        assert!(jumped(false));
        assert!(!jumped(true));
    }

    /// A gate that has seen a ball at rest at 0 until one period before t = 0.
    fn resting(period_s: f64) -> OutlierGate {
        let mut gate = OutlierGate::default();
        for i in -5..0 {
            gate.take(f64::from(i) * period_s, along_x(0.0), 1e-3);
        }
        gate
    }

    #[test]
    fn lone_readings_are_refused_and_steps_believed_later() {
        let mut gate = resting(0.02);
        let mut take = |i: u32, x: f64| gate.take(f64::from(i) * 0.02, along_x(x), 1e-3);
        assert_eq!(take(0, 0.0), GateOutcome::Accepted { outliers: 0, undone: false });
        assert_eq!(take(1, 0.1), GateOutcome::Refused);
        assert_eq!(take(2, 0.001), GateOutcome::Accepted { outliers: 1, undone: false });
        for i in 3..9 {
            assert_eq!(take(i, 0.2), GateOutcome::Refused, "{i}");
        }
        let GateOutcome::Jumped { jump, .. } = take(9, 0.2) else { panic!("it has stayed there") };
        assert!((jump.at_s - 0.06).abs() < 1e-12 && (jump.size_m - 0.2).abs() < 2e-3, "{jump:?}");
        assert_eq!(take(10, 0.2), GateOutcome::Accepted { outliers: 0, undone: false });
    }

    /// Within reach of a push, but the next reading is back on the old path.
    #[test]
    fn an_outlier_that_was_accepted_is_undone() {
        let mut gate = resting(0.05);
        let mut take = |i: u32, x: f64| gate.take(f64::from(i) * 0.05, along_x(x), 1e-3);
        assert_eq!(take(0, 0.04), GateOutcome::Accepted { outliers: 0, undone: false });
        assert_eq!(take(1, 0.0), GateOutcome::Accepted { outliers: 1, undone: true });
    }

    /// After a gap the first reading may be an outlier.
    #[test]
    fn readings_that_leave_a_first_outlier_do_not_step() {
        let mut gate = OutlierGate::default();
        gate.take(0.0, along_x(0.1), 1e-3);
        for i in 1..100 {
            let gated = gate.take(f64::from(i) * 0.02, along_x(0.0), 1e-3);
            assert!(!matches!(gated, GateOutcome::Jumped { .. }), "{i}");
        }
    }

    /// That first reading is not used either: judging would start from it.
    #[test]
    fn the_first_reading_waits_for_one_that_agrees() {
        let mut gate = OutlierGate::default();
        let mut take = |t: f64, x: f64| gate.take(t, along_x(x), 1e-3).usable();
        let readings = [(0.0, 0.1), (0.02, 0.0), (0.04, 0.001)];
        assert_eq!(readings.map(|(t, x)| take(t, x)), [false, false, true]);
    }

    /// A ball that rolls faster than a push could make it.
    #[test]
    fn a_fast_ball_is_followed_within_a_few_readings() {
        let mut gate = OutlierGate::default();
        let mut take = |i: u32| {
            let t = f64::from(i) * 0.02;
            gate.take(t, along_x(1.5 * t), 1e-3).usable()
        };
        assert_eq!([0, 1, 2, 3].map(&mut take), [false, false, false, true]);
        assert!((4..50).all(take), "its velocity is known");
    }

    /// What looked like a jump just before a ball may have met the rim is none.
    #[test]
    fn a_jump_is_not_suspected_any_more_at_a_rim() {
        let jumped = |at_rim: u32| {
            let mut gate = resting(0.1);
            let take = |i: u32| match i == at_rim {
                true => gate.take_at_rim(f64::from(i) * 0.1, along_x(0.03), 1e-3),
                false => gate.take(f64::from(i) * 0.1, along_x(0.03), 1e-3),
            };
            (0..10).map(take).any(|gated| matches!(gated, GateOutcome::Jumped { .. }))
        };
        assert!(jumped(10), "never at the rim");
        assert!(!jumped(1));
    }

    #[test]
    fn an_outlier_that_is_repeated_is_one() {
        let mut gate = OutlierGate::default();
        let mut outliers = 0;
        for i in 0..100 {
            let x = if i / 3 == 10 { 0.1 } else { 0.0 };
            if let GateOutcome::Accepted { outliers: n, .. } =
                gate.take(f64::from(i) * 0.01, along_x(x), 1e-3)
            {
                outliers += n;
            }
        }
        assert_eq!(outliers, 1);
    }

    #[test]
    fn a_hard_push_is_not_a_step() {
        let mut gate = OutlierGate::default();
        for i in 0..100 {
            let t = f64::from(i) * 0.01;
            // From rest to 1.2 m/s between two readings.
            let gated = gate.take(t, along_x(1.2 * (t - 0.504).max(0.0)), 1e-4);
            assert!(!matches!(gated, GateOutcome::Jumped { .. }), "{t}");
        }
    }
}
