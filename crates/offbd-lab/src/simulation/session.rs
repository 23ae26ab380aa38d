//! Variation between the sessions of one rig: it stands at another place, its linkage was
//! remounted, its power supply is another.

use super::model::RigModel;
use super::noise::{Noise, Purpose};
use offbd_core::vocabulary::{Axis, PerAxis};

/// Limit of a session's deviation from its rig, in standard deviations. Chosen so that a
/// controller can balance the ball in every session.
const FARTHEST: f64 = 3.0;

impl RigModel {
    /// Returns this rig in the session of `seed`: levels and gains are drawn around its
    /// own from a normal distribution, clamped at three standard deviations.
    #[must_use]
    pub fn of_session(&self, seed: u64) -> Self {
        let mut noise = Noise::new(seed, Purpose::Session);
        let mut normal = || noise.normal().clamp(-FARTHEST, FARTHEST);
        let (levels, gains) = (PerAxis::from_fn(|_| normal()), PerAxis::from_fn(|_| normal()));
        let mut model = self.clone();
        for axis in Axis::ALL {
            let servo = &mut model.servos[axis];
            servo.level_rad += self.spread.level_rad * levels[axis];
            servo.gain *= 1.0 + self.spread.gain * gains[axis];
        }
        if self.one_axis { model.along_x() } else { model }
    }

    /// Returns the same rig with one axis: a beam along x, whose level along y is zero.
    #[must_use]
    pub fn along_x(mut self) -> Self {
        self.one_axis = true;
        self.servos.y.level_rad = 0.0;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::SessionSpread;
    use super::*;
    use crate::simulation::Preset;
    use proptest::prelude::*;

    fn scattered(level_rad: f64, gain: f64) -> RigModel {
        let spread = SessionSpread { level_rad, gain };
        RigModel { spread, ..Preset::Chapter.model().unwrap() }
    }

    /// Returns the standard deviation of `of` over 600 sessions about the rig's own value.
    fn scatter(rig: &RigModel, of: impl Fn(&RigModel) -> f64) -> f64 {
        let squares = (0..600).map(|seed| (of(&rig.of_session(seed)) - of(rig)).powi(2));
        (squares.sum::<f64>() / 600.0).sqrt()
    }

    #[test]
    fn a_rig_without_spread_is_the_same_to_the_bit() {
        for preset in Preset::ALL {
            let rig = preset.model().unwrap();
            assert_eq!(rig.of_session(7), rig);
        }
    }

    #[test]
    fn a_beam_has_no_level_across() {
        let beam = scattered(0.02, 0.02).along_x();
        let session = beam.of_session(3);
        assert_eq!(session.servos.y.level_rad, 0.0);
        assert_ne!(session.servos.x.level_rad, beam.servos.x.level_rad);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        /// The standard error of a standard deviation from 600 values is 2.9 %; clamping at
        /// three deviations reduces it by 0.7 %. A tenth is more than three standard errors.
        #[test]
        fn levels_and_gains_scatter_as_much_as_is_said(
            level_rad in 0.001..0.1_f64,
            gain in 0.001..0.3_f64,
        ) {
            let rig = scattered(level_rad, gain);
            for axis in Axis::ALL {
                let level = scatter(&rig, |rig| rig.servos[axis].level_rad);
                prop_assert!((level / level_rad - 1.0).abs() < 0.1, "{level} rad, not {level_rad}");
                let share = scatter(&rig, |rig| rig.servos[axis].gain) / rig.servos[axis].gain;
                prop_assert!((share / gain - 1.0).abs() < 0.1, "{share}, not {gain}");
            }
        }
    }

    /// Of 8000 normal numbers 22 are beyond three deviations.
    #[test]
    fn no_session_is_beyond_three_deviations() {
        let rig = scattered(0.02, 0.05);
        for session in (0..2000).map(|seed| rig.of_session(seed)) {
            for axis in Axis::ALL {
                let level = session.servos[axis].level_rad - rig.servos[axis].level_rad;
                assert!(level.abs() <= 3.0 * 0.02 + 1e-12, "{level} rad");
                let gain = session.servos[axis].gain / rig.servos[axis].gain - 1.0;
                assert!(gain.abs() <= 3.0 * 0.05 + 1e-12, "{gain}");
            }
        }
    }
}
