//! The outlier gate: is this reading where a ball can be?
//!
//! A lone reading far off is refused. When readings stay on another path they
//! are believed. Where the two paths meet, the ball was pushed; where they do
//! not, the readings stepped, as no ball can.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use nalgebra::Vector2;

use crate::vocabulary::PerAxis;

/// Most by which a ball's velocity changes between two readings, m/s: a push
/// by hand. Gravity adds less than 0.1 m/s even at 30 Hz.
const PUSH_M_S: f64 = 0.7;

/// Memory of the velocity, s: two or three readings of a camera.
const VELOCITY_MEMORY_S: f64 = 0.06;

/// Standard deviations of the noise that are always allowed.
const NOISE_FACTOR: f64 = 8.0;

/// Noise that readings of a rig that is not learnt may have, m. Assumed: ultrasonic
/// sensors scatter by 8 to 15 mm, cameras by up to 2.
pub const UNKNOWN_NOISE_M: f64 = 5e-3;

/// Distance between the old and the new path that is a step, m, beyond noise:
/// what the velocity found from a few readings may be off by.
const STEP_M: f64 = 0.012;

/// What a hand gives a ball while nobody looks, m/s².
const SHOVE_M_S2: f64 = 2.0;

/// Readings in a row, and seconds, that make a new place believable.
const BELIEVED_AFTER: u32 = 4;
const BELIEVED_AFTER_S: f64 = 0.12;

/// A step of the readings that no ball can make.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Step {
    /// The first reading beyond it, s on the device's clock.
    pub at_s: f64,
    /// How far the readings went, m.
    pub size_m: f64,
}

/// What became of a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gated {
    /// Where a ball can be; and how many readings before it were outliers, as
    /// is known now that they have not stayed where they were. Undone: one of
    /// them had been accepted.
    Accepted { outliers: u32, undone: bool },
    /// Not to be used: an outlier, or the first of a new path.
    Refused,
    /// Accepted after all, on a path that does not meet the old one.
    Stepped(Step),
}

impl Gated {
    /// Whether the reading may be used.
    #[must_use]
    pub const fn usable(self) -> bool {
        !matches!(self, Self::Refused)
    }
}

/// A place off the path where readings have stayed.
#[derive(Clone, Copy, Debug)]
struct Elsewhere {
    since_s: f64,
    first_m: Vector2<f64>,
    at_s: f64,
    position_m: Vector2<f64>,
    n: u32,
    /// Those that differ from the one before: a sensor that is logged faster
    /// than it reads repeats itself, outliers and all.
    distinct: u32,
    /// Whether something may have turned the ball where they began.
    turned: bool,
}

impl Elsewhere {
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

/// Where the ball was and how it moved.
#[derive(Clone, Copy, Debug)]
struct Track {
    at_s: f64,
    position_m: Vector2<f64>,
    velocity_m_s: Vector2<f64>,
    /// Readings that make it. A path of few may be outliers itself.
    n: u32,
}

impl Track {
    fn start(at_s: f64, position_m: Vector2<f64>, n: u32) -> Self {
        Self { at_s, position_m, velocity_m_s: Vector2::zeros(), n }
    }

    /// From where the ball is expected to a reading, m.
    fn off(&self, t_s: f64, position_m: Vector2<f64>) -> Vector2<f64> {
        position_m - self.position_m - self.velocity_m_s * (t_s - self.at_s)
    }

    /// The larger part of that, m.
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
        let gain = 1.0 - (-dt / VELOCITY_MEMORY_S).exp();
        let velocity_m_s = self.velocity_m_s + gain * (now - self.velocity_m_s);
        Self { at_s: t_s, position_m, velocity_m_s, n: self.n.saturating_add(1) }
    }
}

/// A reading that was accepted far off the track: by a push, after which the
/// ball goes on elsewhere, or by a step of the readings, after which it goes on
/// beside.
#[derive(Clone, Copy, Debug)]
struct Leap {
    before: Track,
    at_s: f64,
    off_m: Vector2<f64>,
}

impl Leap {
    /// Whether the readings are back on the track before.
    fn was_outlier(&self, t_s: f64, position_m: Vector2<f64>) -> bool {
        self.share(t_s, position_m).abs() < STEP_SHARE
    }

    /// How far a reading is off the track before, as a share of the first one.
    fn share(&self, t_s: f64, position_m: Vector2<f64>) -> f64 {
        let k = self.off_m.iamax();
        self.before.off(t_s, position_m)[k] / self.off_m[k]
    }

    /// Whether a reading at `t_s` is as far off the track before as the first one
    /// was, and not as far as a push would have carried it since.
    fn is_step(&self, t_s: f64, position_m: Vector2<f64>) -> bool {
        let share = self.share(t_s, position_m);
        let carried = (t_s - self.at_s) / (self.at_s - self.before.at_s);
        let least = carried.min(1.0) * STEP_SHARE;
        let aside =
            (self.before.off(t_s, position_m) - self.off_m * share).amax() / self.off_m.amax();
        (1.0 - STEP_SHARE..1.0 + least).contains(&share) && aside < STEP_SHARE
    }
}

/// A step that is shorter than the change of velocity beside it makes in this
/// time, s, is a ball that a hand puts elsewhere, or takes the place of the hand.
const BENT_S: f64 = 0.2;
/// Share of a step by which later readings may be off it.
const STEP_SHARE: f64 = 0.4;

/// The gate. Both axes come from one look at the ball and are judged as one.
#[derive(Clone, Copy, Debug, Default)]
pub struct OutlierGate {
    track: Option<Track>,
    /// The track before its last reading, where that one was far off: if the
    /// next falls back to it, that one was an outlier.
    before: Option<Track>,
    /// Outliers not yet told.
    outliers: u32,
    elsewhere: Option<Elsewhere>,
    /// The last reading that was far off the track and yet accepted.
    leap: Option<Leap>,
}

impl OutlierGate {
    /// Judges the reading `position_m` at `t_s` on a sensor with `noise_m`. An
    /// axis without a reading counts as unmoved.
    pub fn take(&mut self, t_s: f64, position_m: PerAxis<Option<f64>>, noise_m: f64) -> Gated {
        self.judge(t_s, position_m, noise_m, false)
    }

    /// [`take`](Self::take) where a rim may have turned the ball: readings that
    /// leave its path are no step.
    pub fn take_at_rim(
        &mut self,
        t_s: f64,
        position_m: PerAxis<Option<f64>>,
        noise_m: f64,
    ) -> Gated {
        self.judge(t_s, position_m, noise_m, true)
    }

    fn judge(
        &mut self,
        t_s: f64,
        position_m: PerAxis<Option<f64>>,
        noise_m: f64,
        may_turn: bool,
    ) -> Gated {
        let held = self.track.map_or(Vector2::zeros(), |t| t.position_m);
        let position_m =
            Vector2::new(position_m.x.unwrap_or(held.x), position_m.y.unwrap_or(held.y));
        let reach = |from_s: f64| NOISE_FACTOR * noise_m + PUSH_M_S * (t_s - from_s);
        let Some(track) = self.track else {
            return self.begin(t_s, position_m, reach);
        };
        let off_m = track.off_m(t_s, position_m);
        // The longer the old place has not been read, the farther the ball may
        // have come; readings that stay at a new one still speak for a step.
        let stays = |e: &Elsewhere| {
            let away_m = (position_m - e.position_m).amax();
            away_m <= reach(e.at_s) && away_m < off_m
        };
        let staying = self.elsewhere.filter(stays);
        if staying.is_none() && off_m <= reach(track.at_s) {
            let leap = self.leap.filter(|l| l.was_outlier(t_s, position_m));
            let step_m = NOISE_FACTOR * noise_m + STEP_M;
            // What falls back to the track before is no step off the last reading.
            let falls_back = |before: &Track| {
                off_m > step_m && before.off_m(t_s, position_m) < STEP_SHARE * off_m
            };
            let before = self.before.take().filter(falls_back);
            if let Some(before) = leap.map(|l| l.before).or(before) {
                return self.undo(&before, t_s, position_m);
            }
            let doubtful = off_m > reach(track.at_s).min(step_m) / 2.0;
            self.before = doubtful.then_some(track);
            if let Some(step) = self.stepped(&track, t_s, position_m, noise_m, may_turn) {
                self.follow(Track::start(t_s, position_m, BELIEVED_AFTER));
                return Gated::Stepped(step);
            }
            let next = track.followed_by(t_s, position_m);
            // A path that was turned is new.
            return self.accept(if may_turn { Track { n: 1, ..next } } else { next });
        }
        if let Some(before) = self.before.take()
            && before.off_m(t_s, position_m) <= reach(before.at_s)
        {
            return self.undo(&before, t_s, position_m);
        }
        self.refuse(t_s, position_m, staying, &track, noise_m, may_turn)
    }

    /// Whether the last readings may have stepped: later ones will tell.
    #[must_use]
    pub const fn doubts(&self) -> bool {
        self.leap.is_some()
    }

    /// The step, if accepted readings have stayed beside the track that they left.
    fn stepped(
        &mut self,
        track: &Track,
        t_s: f64,
        position_m: Vector2<f64>,
        noise_m: f64,
        may_turn: bool,
    ) -> Option<Step> {
        if let Some(leap) = self.leap {
            let stays = leap.is_step(t_s, position_m);
            let long = t_s - leap.at_s >= BELIEVED_AFTER_S;
            if long || !stays {
                self.leap = None;
            }
            let step = Step { at_s: leap.at_s, size_m: leap.off_m.norm() };
            return (stays && long).then_some(step);
        }
        let off_m = track.off(t_s, position_m);
        let unseen_s = t_s - track.at_s;
        let allowed_m = NOISE_FACTOR * noise_m + STEP_M + SHOVE_M_S2 / 8.0 * unseen_s * unseen_s;
        if off_m.amax() > allowed_m && !may_turn && track.n >= BELIEVED_AFTER {
            self.leap = Some(Leap { before: *track, at_s: t_s, off_m });
        }
        None
    }

    /// Adds the straight line through (`t_s`, `position_m`) with slope
    /// `velocity_m_s` to all that is remembered.
    pub fn shift(&mut self, t_s: f64, position_m: Vector2<f64>, velocity_m_s: Vector2<f64>) {
        let shifted = |track: Track| track.shifted(t_s, position_m, velocity_m_s);
        self.track = self.track.map(shifted);
        self.before = self.before.map(shifted);
        if let Some(leap) = &mut self.leap {
            leap.before = shifted(leap.before);
        }
        if let Some(there) = &mut self.elsewhere {
            there.first_m += position_m + velocity_m_s * (there.since_s - t_s);
            there.position_m += position_m + velocity_m_s * (there.at_s - t_s);
        }
    }

    /// A reading where there is no track yet: refused until the next one agrees,
    /// for it may be an outlier, or until a few have not, for the ball may be
    /// faster than a push.
    fn begin(&mut self, t_s: f64, position_m: Vector2<f64>, reach: impl Fn(f64) -> f64) -> Gated {
        let before = self.elsewhere.take();
        let n = before.map_or(1, |e| e.n + 1);
        let agrees = |e: Elsewhere| (position_m - e.position_m).amax() <= reach(e.at_s);
        if n >= BELIEVED_AFTER || before.is_some_and(agrees) {
            return self.accept(Track::start(t_s, position_m, n));
        }
        self.elsewhere = Some(Elsewhere { n, ..Elsewhere::start(t_s, position_m, false) });
        Gated::Refused
    }

    /// A reading off the track: refused, until enough of them have stayed.
    fn refuse(
        &mut self,
        t_s: f64,
        position_m: Vector2<f64>,
        staying: Option<Elsewhere>,
        track: &Track,
        noise_m: f64,
        may_turn: bool,
    ) -> Gated {
        let there = match staying {
            Some(e) => e.with(t_s, position_m),
            None => {
                self.outliers += self.elsewhere.map_or(0, |e| e.distinct);
                Elsewhere::start(t_s, position_m, may_turn)
            }
        };
        let (n, since_s) = (there.n, there.since_s);
        if n < BELIEVED_AFTER || t_s - since_s < BELIEVED_AFTER_S {
            self.elsewhere = Some(there);
            return Gated::Refused;
        }
        self.elsewhere = None;
        let accepted = self.accept(Track::start(t_s, position_m, n));
        let unseen_s = there.since_s - track.at_s;
        let bent_m = SHOVE_M_S2 * unseen_s * unseen_s;
        let step_m = step_m(track, &there);
        let apart = step_m.amax() > NOISE_FACTOR * noise_m + STEP_M + bent_m;
        let bent_m_s = (there.velocity_m_s() - track.velocity_m_s).amax();
        let straight = bent_m_s * BENT_S < step_m.amax();
        let stepped = apart && straight && !there.turned && track.n >= BELIEVED_AFTER;
        let step = Step { at_s: there.since_s, size_m: step_m.norm() };
        if stepped { Gated::Stepped(step) } else { accepted }
    }

    /// Forgets where the ball was, as after a gap.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// Goes back to the track `before` the last reading, which was an outlier.
    fn undo(&mut self, before: &Track, t_s: f64, position_m: Vector2<f64>) -> Gated {
        self.leap = None;
        self.outliers += 1;
        let outliers = self.follow(before.followed_by(t_s, position_m));
        Gated::Accepted { outliers, undone: true }
    }

    fn accept(&mut self, track: Track) -> Gated {
        Gated::Accepted { outliers: self.follow(track), undone: false }
    }

    /// Goes on along `track`; returns the outliers not yet told.
    fn follow(&mut self, track: Track) -> u32 {
        let outliers = self.outliers + self.elsewhere.map_or(0, |e| e.distinct);
        (self.track, self.outliers, self.elsewhere) = (Some(track), 0, None);
        outliers
    }
}

/// Least distance between the old path, carried on, and the new one, carried
/// back, over the time between them, along each axis: zero for a push.
fn step_m(track: &Track, there: &Elsewhere) -> Vector2<f64> {
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

    /// Where a long gap before an outlier leaves open whether the ball has rolled
    /// there, it has not if the next reading is back on the path.
    #[test]
    fn the_return_from_an_outlier_is_no_step() {
        let mut gate = OutlierGate::default();
        let mut take = |t: f64, x: f64| gate.take(t, along_x(x), 1e-3);
        for (t, x) in [(0.0, 0.02), (0.08, 0.02), (0.16, 0.02), (0.24, 0.02), (0.32, 0.02)] {
            take(t, x);
        }
        assert!(take(0.56, -0.015).usable());
        assert_eq!(take(0.64, 0.021), Gated::Accepted { outliers: 1, undone: true });
        for i in 1..20 {
            let gated = take(0.64 + 0.08 * f64::from(i), 0.021);
            assert!(!matches!(gated, Gated::Stepped(_)), "{i}: {gated:?}");
        }
    }

    /// The same change of place, where a rim may have turned the ball, is none.
    #[test]
    fn what_leaves_its_path_at_a_rim_has_not_stepped() {
        let stepped = |is_at_rim: bool| {
            let mut gate = resting(0.1);
            let take = |i: i32| match is_at_rim && i == 0 {
                true => gate.take_at_rim(f64::from(i) * 0.1, along_x(0.05), 1e-3),
                false => gate.take(f64::from(i) * 0.1, along_x(0.05), 1e-3),
            };
            (0..10).map(take).any(|gated| matches!(gated, Gated::Stepped(_)))
        };
        assert!(stepped(false));
        assert!(!stepped(true));
    }

    /// A gate that has seen a ball at rest at 0 until a period before t = 0.
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
        assert_eq!(take(0, 0.0), Gated::Accepted { outliers: 0, undone: false });
        assert_eq!(take(1, 0.1), Gated::Refused);
        assert_eq!(take(2, 0.001), Gated::Accepted { outliers: 1, undone: false });
        for i in 3..9 {
            assert_eq!(take(i, 0.2), Gated::Refused, "{i}");
        }
        let Gated::Stepped(step) = take(9, 0.2) else { panic!("it has stayed there") };
        assert!((step.at_s - 0.06).abs() < 1e-12 && (step.size_m - 0.2).abs() < 2e-3, "{step:?}");
        assert_eq!(take(10, 0.2), Gated::Accepted { outliers: 0, undone: false });
    }

    /// Within reach of a push, but the next reading is back on the old path.
    #[test]
    fn an_outlier_that_was_accepted_is_undone() {
        let mut gate = resting(0.05);
        let mut take = |i: u32, x: f64| gate.take(f64::from(i) * 0.05, along_x(x), 1e-3);
        assert_eq!(take(0, 0.04), Gated::Accepted { outliers: 0, undone: false });
        assert_eq!(take(1, 0.0), Gated::Accepted { outliers: 1, undone: true });
    }

    /// After a gap nothing says that the first reading was a good one.
    #[test]
    fn readings_that_leave_a_first_outlier_do_not_step() {
        let mut gate = OutlierGate::default();
        gate.take(0.0, along_x(0.1), 1e-3);
        for i in 1..100 {
            let gated = gate.take(f64::from(i) * 0.02, along_x(0.0), 1e-3);
            assert!(!matches!(gated, Gated::Stepped(_)), "{i}");
        }
    }

    /// Neither is that reading used: what is judged would start from it.
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
    }

    #[test]
    fn an_outlier_that_is_repeated_is_one() {
        let mut gate = OutlierGate::default();
        let mut outliers = 0;
        for i in 0..100 {
            let x = if i / 3 == 10 { 0.1 } else { 0.0 };
            if let Gated::Accepted { outliers: n, .. } =
                gate.take(f64::from(i) * 0.01, along_x(x), 1e-3)
            {
                outliers += n;
            }
        }
        assert_eq!(outliers, 1);
    }

    #[test]
    fn a_hard_push_is_no_step() {
        let mut gate = OutlierGate::default();
        for i in 0..100 {
            let t = f64::from(i) * 0.01;
            // From rest to 1.2 m/s at once, between two readings.
            let gated = gate.take(t, along_x(1.2 * (t - 0.504).max(0.0)), 1e-4);
            assert!(!matches!(gated, Gated::Stepped(_)), "{t}");
        }
    }
}
