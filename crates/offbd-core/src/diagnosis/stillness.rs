//! What the readings themselves say: seen or not, repeating, standing still,
//! thrown about.
//!
//! A ball at rest is not a fault and neither are repeated readings; they turn
//! into evidence only while the commands ask the ball to move (*pressed*).

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{Axis, PerAxis};

/// Half-life of the count of outliers and of the share of missing readings, s.
const MEMORY_S: f64 = 2.0;

/// Stillness after which a ball counts as at rest, s.
const RESTING_S: f64 = 0.25;
/// Share of the time after which identical readings are frozen from which on
/// they leave open whether they are alive.
const REPEATED_SHARE: f64 = 0.4;

/// Longest that outliers are counted back, s.
const OUTLIER_MEMORY_S: f64 = 10.0;

/// One sample as this watch sees it.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    /// Seconds since the sample before.
    pub dt: f64,
    pub position_m: PerAxis<Option<f64>>,
    /// Acceleration by which the commands ask the ball to move along each axis,
    /// m/s²; zero where they do not ask for more than what may hold it.
    pub asked_m_s2: PerAxis<f64>,
    /// How far a ball at rest may seem to move, m.
    pub still_m: f64,
    /// Whether the outlier gate let the reading through.
    pub usable: bool,
    /// Outliers that the gate has found since the sample before.
    pub outliers: u32,
}

/// Stillness of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisStillness {
    anchor_m: Option<f64>,
    /// Whether the reading before had left the anchor's surroundings: it takes
    /// two, for among thousands of readings one strays by chance.
    strayed: bool,
    last_m: Option<f64>,
    /// Seconds since the reading left its surroundings.
    pub still_s: f64,
    /// Seconds of those in which the ball was asked to move, in a row.
    pub pressed_s: f64,
    /// How fast a free ball would go by now that was at rest when it was first
    /// asked to move, m/s, and how far it would have come, in widths of what counts
    /// as still.
    asked_m_s: f64,
    pub asked_widths: f64,
    /// Seconds for which every bit has been the same.
    pub identical_s: f64,
    /// Velocity of the ball when the readings last changed, m/s.
    velocity_m_s: f64,
}

/// Memory of the velocity, s: some readings of a camera.
const VELOCITY_MEMORY_S: f64 = 0.1;

impl AxisStillness {
    fn update(&mut self, position_m: f64, asked_m_s2: f64, reading: &Reading) {
        let strays = self.anchor_m.is_none_or(|a| (position_m - a).abs() > reading.still_m);
        let moved = strays && (self.strayed || self.anchor_m.is_none());
        self.strayed = strays;
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
            (self.pressed_s, self.asked_m_s, self.asked_widths) = (0.0, 0.0, 0.0);
        }
        self.repeat(position_m, reading.dt);
    }

    fn repeat(&mut self, position_m: f64, dt: f64) {
        let last_m = self.last_m.replace(position_m);
        if last_m.is_some_and(|l| l.to_bits() == position_m.to_bits()) {
            self.identical_s += dt;
            return;
        }
        let since_s = self.identical_s + dt;
        if let (Some(last_m), true) = (last_m, since_s > 0.0) {
            let gain = 1.0 - (-since_s / VELOCITY_MEMORY_S).exp();
            self.velocity_m_s += gain * ((position_m - last_m) / since_s - self.velocity_m_s);
        }
        self.identical_s = 0.0;
    }

    /// Whether it has been still for long enough to be at rest.
    #[must_use]
    pub const fn rests(&self) -> bool {
        self.still_s > RESTING_S
    }

    /// Whether readings that may be the same for `repeat_s` have been so for long
    /// enough, while the ball was asked to move, to doubt that they are alive.
    #[must_use]
    pub fn repeats(&self, repeat_s: f64) -> bool {
        self.identical_s > REPEATED_SHARE * repeat_s && self.pressed_s > 0.0
    }

    /// Whether this axis has ever been read.
    #[must_use]
    pub const fn seen(&self) -> bool {
        self.last_m.is_some()
    }

    /// How far the ball would have gone since the readings last changed, m, had
    /// friction held it back by `held_m_s2`.
    #[must_use]
    pub fn missed_m(&self, held_m_s2: f64) -> f64 {
        let speed = self.velocity_m_s.abs();
        let rolling_s = self.identical_s.min(speed / held_m_s2);
        (speed - held_m_s2 * rolling_s / 2.0) * rolling_s
    }
}

/// The watch over the readings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stillness {
    pub axes: PerAxis<AxisStillness>,
    /// Seconds since a ball was last seen.
    pub unseen_s: f64,
    /// Share of samples without a ball, over the last seconds, in [0, 1].
    pub missing: f64,
    /// Outliers in the last ten seconds, each fading linearly in weight.
    outliers: f64,
}

impl Stillness {
    /// Takes one sample.
    pub fn update(&mut self, reading: &Reading) {
        let seen = Axis::ALL.iter().any(|&a| reading.position_m[a].is_some());
        self.unseen_s = if seen { 0.0 } else { self.unseen_s + reading.dt };
        let fade = MEMORY_S / (MEMORY_S + reading.dt);
        self.missing = self.missing * fade + if seen { 0.0 } else { 1.0 - fade };
        self.outliers *= OUTLIER_MEMORY_S / (OUTLIER_MEMORY_S + reading.dt);
        self.outliers += f64::from(reading.outliers);
        if !reading.usable {
            return;
        }
        for axis in Axis::ALL {
            if let Some(position_m) = reading.position_m[axis] {
                self.axes[axis].update(position_m, reading.asked_m_s2[axis], reading);
            }
        }
    }

    /// Outliers of late, each fading over ten seconds.
    #[must_use]
    pub const fn outliers(&self) -> f64 {
        self.outliers
    }

    /// Seconds for which the ball has stood still in every direction seen.
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

    /// Seconds for which every reading has been the same to the bit.
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
            usable: true,
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
    fn one_reading_that_strays_is_no_motion_and_two_are() {
        let mut watch = Stillness::default();
        for (i, x) in [0.0, 0.0, 0.01, 0.0, 0.0, 0.01, 0.01].into_iter().enumerate() {
            watch.update(&reading(Some(x), true));
            let wanted = if i < 6 { 0.01 * i as f64 } else { 0.0 };
            assert!((watch.still_s() - wanted).abs() < 1e-9, "{i}: {}", watch.still_s());
        }
    }

    /// A ball that a pull of 0.5 m/s² turns round seems to stand for a while, but
    /// not for as long as one that is held has been asked to roll six widths.
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
    fn a_ball_not_seen_is_counted_in_seconds_and_in_share() {
        let mut watch = Stillness::default();
        for _ in 0..200 {
            watch.update(&reading(None, true));
        }
        assert!((watch.unseen_s - 2.0).abs() < 1e-9);
        // The share seen fades as (1 + dt/memory)⁻ⁿ.
        assert!((watch.missing - (1.0 - 1.005_f64.powi(-200))).abs() < 1e-9);
    }
}
