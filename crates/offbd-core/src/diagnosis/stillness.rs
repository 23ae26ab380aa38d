//! Properties of the readings themselves: missing, identical, standing still, outliers.
//!
//! Neither a ball at rest nor identical readings are faults; they count as evidence only
//! while the commands ask the ball to move (*pressed*).

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{Axis, PerAxis};
use serde::{Deserialize, Serialize};

/// Time constant of the fraction of missing readings, s. Chosen.
const MISSING_MEMORY_S: f64 = 2.0;

/// Time of stillness from which on a ball counts as at rest, s. Chosen.
const RESTING_S: f64 = 0.25;
/// Fraction of the time that makes identical readings frozen from which on it is
/// uncertain whether they are alive. Chosen.
const REPEATED_SHARE: f64 = 0.4;

/// Time for which a hand may still move the ball that it sets down, s. Chosen: as long as no evidence
/// against a servo is accumulated.
const HAND_S: f32 = 1.0;

/// Time constant of the count of recent outliers, s. Chosen.
const OUTLIER_MEMORY_S: f64 = 10.0;

/// One sample as input of [`Stillness`].
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    /// Time since the previous sample, s.
    pub dt: f64,
    pub position_m: PerAxis<Option<f64>>,
    /// Acceleration that the commands demand of the ball along each axis, m/s²; zero
    /// while it is below what may hold the ball.
    pub asked_m_s2: PerAxis<f64>,
    /// Range within which a ball at rest may seem to move, m.
    pub still_m: f64,
    /// Whether the outlier gate refused the reading; false if there is none.
    pub refused: bool,
    /// Outliers found by the gate since the previous sample.
    pub outliers: u32,
}

/// Stillness of the readings along one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AxisStillness {
    anchor_m: Option<f64>,
    /// Whether the previous reading had left the still range: two are needed, since among
    /// thousands of readings single ones stray by chance.
    strayed: bool,
    last_m: Option<f64>,
    /// Time since the reading left the still range, s.
    pub still_s: f64,
    /// Part of that time, up to now, for which the ball has been asked to move without a
    /// break, s.
    pub pressed_s: f64,
    /// Speed that a free ball would have reached since it was first asked to move from
    /// rest, m/s.
    asked_m_s: f64,
    /// Distance that it would have covered, in widths of the still range.
    pub asked_widths: f64,
    /// Time for which the readings have been bit-identical, s.
    pub identical_s: f64,
    /// Velocity of the ball when the readings last changed, m/s.
    velocity_m_s: f64,
}

/// Time constant of the velocity, s: some readings of a camera. Chosen.
const VELOCITY_MEMORY_S: f64 = 0.1;

/// Returns how much a reading that has changed after `since_s` moves the velocity.
fn velocity_gain(since_s: f64) -> f64 {
    1.0 - (-since_s / VELOCITY_MEMORY_S).exp()
}

impl AxisStillness {
    /// `gain` is that of the velocity after one reading. Returns whether the ball has just left its
    /// place; false for the first reading.
    fn update(&mut self, position_m: f64, asked_m_s2: f64, reading: &Reading, gain: f64) -> bool {
        let is_first = self.anchor_m.is_none();
        let strays = self.anchor_m.is_none_or(|a| (position_m - a).abs() > reading.still_m);
        let moved = strays && (self.strayed || self.anchor_m.is_none());
        self.strayed = strays && !is_first;
        if moved {
            self.anchor_m = Some(position_m);
            self.still_s = 0.0;
        } else {
            self.still_s += reading.dt;
        }
        if asked_m_s2 > 0.0 && !moved {
            self.pressed_s += reading.dt;
            self.asked_m_s += asked_m_s2 * reading.dt;
            self.asked_widths += self.asked_m_s * reading.dt / reading.still_m;
        } else {
            self.release();
        }
        self.repeat(position_m, reading.dt, gain);
        moved && !is_first
    }

    /// The ball is not asked to move, or it does.
    const fn release(&mut self) {
        (self.pressed_s, self.asked_m_s, self.asked_widths) = (0.0, 0.0, 0.0);
    }

    fn repeat(&mut self, position_m: f64, dt: f64, gain: f64) {
        let last_m = self.last_m.replace(position_m);
        if last_m.is_some_and(|l| l.to_bits() == position_m.to_bits()) {
            self.identical_s += dt;
            return;
        }
        let since_s = self.identical_s + dt;
        if let (Some(last_m), true) = (last_m, since_s > 0.0) {
            let gain = if self.identical_s == 0.0 { gain } else { velocity_gain(since_s) };
            self.velocity_m_s += gain * ((position_m - last_m) / since_s - self.velocity_m_s);
        }
        self.identical_s = 0.0;
    }

    /// Whether the ball has been still for long enough to count as at rest.
    #[must_use]
    pub const fn rests(&self) -> bool {
        self.still_s > RESTING_S
    }

    /// Whether readings have been identical for long enough, while the ball was asked to
    /// move, that they may not be alive; `repeat_s` is the time that makes them frozen.
    #[must_use]
    pub fn repeats(&self, repeat_s: f64) -> bool {
        self.identical_s > REPEATED_SHARE * repeat_s && self.pressed_s > 0.0
    }

    /// Whether this axis has ever been read.
    #[must_use]
    pub const fn seen(&self) -> bool {
        self.last_m.is_some()
    }

    /// Returns how far the ball would have rolled since the readings last changed, m, if
    /// friction decelerated it by `held_m_s2`.
    #[must_use]
    pub fn missed_m(&self, held_m_s2: f64) -> f64 {
        let speed = self.velocity_m_s.abs();
        let rolling_s = self.identical_s.min(speed / held_m_s2);
        (speed - held_m_s2 * rolling_s / 2.0) * rolling_s
    }
}

/// The properties of the readings of one rig.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stillness {
    pub axes: PerAxis<AxisStillness>,
    /// Whether a ball has been seen in this session.
    pub has_positions: bool,
    /// Whether the ball has moved in this session, after the time in which a hand sets it down.
    pub has_moved: bool,
    /// Time since the first reading of this session without gaps and refused readings, s.
    read_s: f32,
    /// Time since a ball was last seen, s; before the first one, only the time for which one was
    /// asked to move.
    pub unseen_s: f64,
    /// Fraction of recent samples without a ball, in [0, 1].
    pub missing: f64,
    /// Recent outliers, each fading with a time constant of ten seconds.
    outliers: f64,
}

impl Stillness {
    /// Forgets the readings.
    pub fn restart(&mut self) {
        let Self { has_positions, read_s, has_moved, .. } = *self;
        *self = Self { has_positions, read_s, has_moved, ..Self::default() };
    }

    /// Takes one sample.
    pub fn update(&mut self, reading: &Reading) {
        let seen = Axis::ALL.iter().any(|&a| reading.position_m[a].is_some());
        // A session may begin before the ball is set down; commands that ask it to move say that it
        // should be there.
        let asked = Axis::ALL.iter().any(|&a| reading.asked_m_s2[a] > 0.0);
        self.has_positions |= seen;
        if asked || self.has_positions {
            self.unseen_s = if seen { 0.0 } else { self.unseen_s + reading.dt };
            let fade = MISSING_MEMORY_S / (MISSING_MEMORY_S + reading.dt);
            self.missing = self.missing * fade + if seen { 0.0 } else { 1.0 - fade };
        }
        self.outliers *= OUTLIER_MEMORY_S / (OUTLIER_MEMORY_S + reading.dt);
        self.outliers += f64::from(reading.outliers);
        if reading.refused {
            return;
        }
        let gain = velocity_gain(reading.dt);
        self.read_s += if self.has_positions { reading.dt as f32 } else { 0.0 };
        for axis in Axis::ALL {
            if let Some(position_m) = reading.position_m[axis] {
                let asked_m_s2 = reading.asked_m_s2[axis];
                let moved = self.axes[axis].update(position_m, asked_m_s2, reading, gain);
                self.has_moved |= moved && self.read_s >= HAND_S;
            } else if reading.asked_m_s2[axis] == 0.0 {
                self.axes[axis].release();
            }
        }
    }

    /// Returns the number of recent outliers, each fading with a time constant of ten
    /// seconds.
    #[must_use]
    pub const fn outliers(&self) -> f64 {
        self.outliers
    }

    /// Time for which the ball has stood still along every measured axis, s.
    #[must_use]
    pub fn still_s(&self) -> f64 {
        self.least(|a| a.still_s)
    }

    /// Whether the ball stands although it is asked to move.
    #[must_use]
    pub fn is_held(&self) -> bool {
        let pressed = Axis::ALL.into_iter().any(|a| self.axes[a].pressed_s > 0.0);
        pressed && self.still_s() > RESTING_S
    }

    /// Time for which the readings of every axis have been bit-identical, s.
    #[must_use]
    pub fn identical_s(&self) -> f64 {
        self.least(|a| a.identical_s)
    }

    fn least(&self, of: impl Fn(&AxisStillness) -> f64) -> f64 {
        Axis::ALL
            .iter()
            .map(|&a| &self.axes[a])
            .filter(|a| a.last_m.is_some())
            .map(of)
            .reduce(f64::min)
            .unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(x: Option<f64>, pressed: bool) -> Reading {
        Reading {
            dt: 0.01,
            position_m: PerAxis { x, y: None },
            asked_m_s2: PerAxis { x: if pressed { 1.0 } else { 0.0 }, y: 0.0 },
            still_m: 0.002,
            refused: false,
            outliers: 0,
        }
    }

    #[test]
    fn rest_is_told_from_being_held_against_the_command() {
        let mut watch = Stillness::default();
        for i in 0..100 {
            let noise = if i % 2 == 0 { 0.0 } else { 1e-3 };
            watch.update(&reading(Some(noise), i >= 50));
        }
        assert!((watch.still_s() - 0.99).abs() < 1e-9);
        assert!((watch.axes.x.pressed_s - 0.50).abs() < 1e-9);
        assert_eq!(watch.identical_s(), 0.0);
    }

    #[test]
    fn one_reading_that_strays_is_not_motion_and_two_are() {
        let mut watch = Stillness::default();
        for (i, x) in [0.0, 0.0, 0.01, 0.0, 0.0, 0.01, 0.01].into_iter().enumerate() {
            watch.update(&reading(Some(x), true));
            let wanted = if i < 6 { 0.01 * i as f64 } else { 0.0 };
            assert!((watch.still_s() - wanted).abs() < 1e-9, "{i}: {}", watch.still_s());
        }
    }

    /// A ball that an acceleration of 0.5 m/s² turns round seems to stand for a while,
    /// but not for as long as a held ball that has been asked to roll six widths.
    #[test]
    fn a_ball_that_turns_round_is_not_held() {
        let mut watch = Stillness::default();
        let mut most_widths = 0.0_f64;
        for i in -100..100 {
            let t = 0.01 * f64::from(i);
            watch.update(&reading(Some(0.25 * t * t), true));
            most_widths = most_widths.max(watch.axes.x.asked_widths / 2.0);
        }
        assert!((1.0..6.5).contains(&most_widths), "{most_widths}");
    }

    #[test]
    fn a_ball_has_moved_if_it_does_after_the_hand() {
        let mut watch = Stillness::default();
        let mut take = |n: u32, x: f64| {
            (0..n).for_each(|_| watch.update(&reading(Some(x), true)));
            watch.has_moved
        };
        assert!(!take(1, 0.05));
        assert!(!take(90, 0.0), "a hand sets it down");
        assert!(!take(20, 0.001), "it is noise");
        assert!(take(2, 0.01));
        assert!(take(100, 0.01), "it has moved before");
        watch.restart();
        assert!(watch.has_moved, "a gap in the readings does not change it");
    }

    /// Also not after a gap, when the hand has long gone.
    #[test]
    fn one_stray_reading_is_not_a_motion() {
        let mut watch = Stillness::default();
        (0..200).for_each(|_| watch.update(&reading(Some(0.0), true)));
        watch.restart();
        for x in [0.0, 0.05, 0.0, 0.0] {
            watch.update(&reading(Some(x), true));
        }
        assert!(!watch.has_moved);
    }

    #[test]
    fn an_axis_that_is_neither_read_nor_asked_to_move_is_not_pressed() {
        let mut watch = Stillness::default();
        let both = |y, asked| Reading {
            position_m: PerAxis { x: Some(0.0), y },
            asked_m_s2: PerAxis { x: 1.0, y: asked },
            ..reading(None, true)
        };
        (0..100).for_each(|_| watch.update(&both(Some(0.0), 1.0)));
        let pressed_s = watch.axes.y.pressed_s;
        assert!(pressed_s > 0.9, "{pressed_s}");
        watch.update(&both(None, 1.0));
        assert_eq!(watch.axes.y.pressed_s, pressed_s, "a reading is missing");
        watch.update(&both(None, 0.0));
        assert_eq!((watch.axes.y.pressed_s, watch.axes.y.asked_widths), (0.0, 0.0));
        assert!(watch.axes.x.pressed_s > pressed_s);
    }

    #[test]
    fn a_ball_not_seen_is_counted_in_seconds_and_in_share() {
        let mut watch = Stillness::default();
        for _ in 0..300 {
            watch.update(&reading(None, false));
        }
        assert_eq!((watch.unseen_s, watch.missing), (0.0, 0.0), "nobody asks for a ball yet");
        for _ in 0..200 {
            watch.update(&reading(None, true));
        }
        assert!((watch.unseen_s - 2.0).abs() < 1e-9);
        // The fraction seen fades as (1 + dt/memory)⁻ⁿ.
        assert!((watch.missing - (1.0 - 1.005_f64.powi(-200))).abs() < 1e-9);
        watch.update(&reading(Some(0.1), false));
        watch.update(&reading(None, false));
        assert!(watch.unseen_s > 0.0, "a ball that was there is missing, whatever is asked");
    }
}
