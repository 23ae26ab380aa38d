//! The family of motions from which a drive cycle is chosen.
//!
//! Its element is a *doublet* that moves the ball from the middle to one side, to the
//! other, and back to the middle. It starts and ends at rest, without acceleration: p(τ)
//! = C·A·sin²(πτ)·sin(2πτ) for τ from 0 to 1. Doublets are repeated, along one axis after
//! the other or along both at once.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use core::f64::consts::{FRAC_1_SQRT_2, TAU};

use crate::vocabulary::{Axis, PerAxis};

/// The timing of both axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Both axes at once: a ball that stands is then stuck, or both servos are dead.
    AtOnce,
    /// Both axes, y a quarter of a period after x.
    Staggered,
    /// First x, then y.
    InTurn,
}

/// One member of the family: position and acceleration over time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DriveMotion {
    pub order: Order,
    /// Duration of one doublet, s.
    pub period_s: f64,
    /// Number of doublets along each axis.
    pub repeats: u32,
    /// Largest distance from the middle, m; zero along an axis that the rig lacks.
    pub amplitude_m: PerAxis<f64>,
}

/// Durations of a doublet, s. Chosen: in faster ones a servo's lag hides its gain; slower
/// ones need more room than a plate has, or less tilt than the level's error.
const PERIODS_S: [f64; 7] = [1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0];
/// Most doublets along one axis. Chosen.
const MOST_REPEATS: u32 = 4;
/// Fractions of the ball's room, the smallest first. Chosen.
const SHARES: [f64; 5] = [0.25, 0.4, 0.55, 0.7, 0.85];
/// Lag of y in staggered order, as a fraction of a period.
const LAG: f64 = 0.25;

/// 1/max(sin²(πτ)·sin(2πτ)), which is at τ = 1/3.
const PEAK: f64 = 1.539_600_717_839_002;
/// Largest |d²p/dτ²|/(C·A·4π²) = max |sin 2θ − sin(θ)/2|, θ = 2πτ, rounded up.
const PEAK_CURVATURE: f64 = 1.37;

impl DriveMotion {
    /// Returns all members for a ball with `room_m` to each side along each axis that the
    /// rig has, by duration, then by amplitude. With `round` the room along both axes at
    /// once is that of a disc.
    pub(super) fn family(room_m: PerAxis<Option<f64>>, round: bool) -> Vec<Self> {
        let mut all = Vec::new();
        for order in Self::orders(&room_m) {
            let fits = if round && *order != Order::InTurn { FRAC_1_SQRT_2 } else { 1.0 };
            for period_s in PERIODS_S {
                for repeats in 1..=MOST_REPEATS {
                    all.extend(SHARES.map(|share| {
                        let amplitude_m = room_m.map(|m| m.unwrap_or(0.0) * share * fits);
                        Self { order: *order, period_s, repeats, amplitude_m }
                    }));
                }
            }
        }
        // The sort is stable: equal durations stay in the order of their amplitudes.
        all.sort_by(|a, b| a.duration_s().total_cmp(&b.duration_s()));
        all
    }

    /// The orders for the axes that the rig has.
    fn orders(room_m: &PerAxis<Option<f64>>) -> &'static [Order] {
        match (room_m.x, room_m.y) {
            (Some(_), Some(_)) => &[Order::AtOnce, Order::Staggered, Order::InTurn],
            _ => &[Order::AtOnce],
        }
    }

    /// Duration from the first command to the last, s.
    pub(super) fn duration_s(&self) -> f64 {
        let (_, end_s) = self.span_s(Axis::X);
        if self.amplitude_m.y > 0.0 { end_s.max(self.span_s(Axis::Y).1) } else { end_s }
    }

    /// Start and end of the doublets along `axis`, s.
    fn span_s(&self, axis: Axis) -> (f64, f64) {
        let long_s = f64::from(self.repeats) * self.period_s;
        let begin_s = match (axis, self.order) {
            _ if self.amplitude_m.x == 0.0 => 0.0,
            (Axis::X, _) => 0.0,
            (Axis::Y, Order::AtOnce) => 0.0,
            (Axis::Y, Order::Staggered) => LAG * self.period_s,
            (Axis::Y, Order::InTurn) => long_s,
        };
        (begin_s, begin_s + long_s)
    }

    /// The angle θ = 2πτ of the doublet along `axis`; `None` while it does not move.
    fn angle(&self, axis: Axis, t_s: f64) -> Option<f64> {
        let (begin_s, end_s) = self.span_s(axis);
        let moves = self.amplitude_m[axis] > 0.0 && (begin_s..=end_s).contains(&t_s);
        moves.then(|| TAU * (t_s - begin_s) / self.period_s)
    }

    /// The set point along `axis`, m from the middle.
    pub(super) fn position_m(&self, axis: Axis, t_s: f64) -> f64 {
        let Some(angle) = self.angle(axis, t_s) else { return 0.0 };
        PEAK * self.amplitude_m[axis] * (angle / 2.0).sin().powi(2) * angle.sin()
    }

    /// The acceleration of the set point, m/s².
    pub(super) fn acceleration_m_s2(&self, axis: Axis, t_s: f64) -> f64 {
        let Some(angle) = self.angle(axis, t_s) else { return 0.0 };
        let scale = PEAK * self.amplitude_m[axis] * (TAU / self.period_s).powi(2);
        scale * ((2.0 * angle).sin() - angle.sin() / 2.0)
    }

    /// Largest acceleration along `axis`, m/s².
    pub(super) fn peak_m_s2(&self, axis: Axis) -> f64 {
        PEAK * PEAK_CURVATURE * self.amplitude_m[axis] * (TAU / self.period_s).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ROOM: PerAxis<Option<f64>> = PerAxis { x: Some(0.1), y: Some(0.06) };

    proptest! {
        /// The second difference of the position is the acceleration; both stay within
        /// their stated bounds.
        #[test]
        fn validate_the_acceleration_is_that_of_the_path(
            index in 0..DriveMotion::family(ROOM, false).len(), share in 0.0..1.0_f64,
        ) {
            let motion = DriveMotion::family(ROOM, false)[index];
            let (t_s, h) = (share * motion.duration_s(), 1e-4);
            for axis in Axis::ALL {
                let p = |t| motion.position_m(axis, t);
                let curvature = (p(t_s + h) - 2.0 * p(t_s) + p(t_s - h)) / (h * h);
                let peak = motion.peak_m_s2(axis);
                prop_assert!((curvature - motion.acceleration_m_s2(axis, t_s)).abs() < 1e-2 * peak);
                prop_assert!(p(t_s).abs() <= motion.amplitude_m[axis] * (1.0 + 1e-9));
                prop_assert!(curvature.abs() <= peak * 1.01);
            }
        }
    }

    #[test]
    fn every_motion_ends_where_it_began_and_the_family_is_in_order() {
        let family = DriveMotion::family(ROOM, false);
        assert!(family.windows(2).all(|pair| pair[0].duration_s() <= pair[1].duration_s()));
        for motion in family {
            for t_s in [0.0, motion.duration_s()] {
                for axis in Axis::ALL {
                    assert!(motion.position_m(axis, t_s).abs() < 1e-12, "{motion:?}");
                    assert!(motion.acceleration_m_s2(axis, t_s).abs() < 1e-9, "{motion:?}");
                }
            }
        }
    }

    #[test]
    fn an_axis_that_is_not_there_does_not_move_and_takes_no_time() {
        for motion in DriveMotion::family(PerAxis { x: None, y: Some(0.1) }, false) {
            assert_eq!(motion.duration_s(), f64::from(motion.repeats) * motion.period_s);
            assert_eq!(motion.position_m(Axis::X, 0.3), 0.0);
            assert!(motion.position_m(Axis::Y, 0.3) > 0.0);
        }
    }
}
