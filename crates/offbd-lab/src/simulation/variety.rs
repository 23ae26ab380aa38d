//! Random rigs, each drawn from one seed.

mod ranges;
mod real;

use std::fmt;
use std::str::FromStr;

use super::model::RigModel;
use super::noise::{Noise, Purpose};
use super::presets::Preset;
use super::servo::ServoTruth;
use offbd_core::vocabulary::{Axis, Invalid, PerAxis, UnknownWord};

/// The population from which rigs are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Variety {
    /// The presets with random parameters; a rig is the same in every session.
    Presets,
    /// Properties observed on real rigs: slow and noisy sensors that repeat and hold their
    /// readings, servos with whole degrees, ball and beam, origins off centre, stiction up
    /// to 2°, and levels and gains that differ between sessions.
    #[default]
    Real,
}

impl Variety {
    pub const ALL: [Self; 2] = [Self::Presets, Self::Real];

    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Presets => "presets",
            Self::Real => "real",
        }
    }

    /// Returns the rig that `seed` draws.
    ///
    /// # Errors
    /// [`Invalid`] if its numbers are out of range; those of both populations are not.
    pub fn rig(self, seed: u64) -> Result<RigModel, Invalid> {
        match self {
            Self::Presets => RigModel::varied(seed),
            Self::Real => real::rig(seed, &mut Noise::new(seed, Purpose::RealVariety)),
        }
    }
}

impl fmt::Display for Variety {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl FromStr for Variety {
    type Err = UnknownWord;
    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        Self::ALL.into_iter().find(|v| v.as_str() == word).ok_or_else(|| UnknownWord {
            word: word.to_owned(),
            expected: "presets, real".to_owned(),
        })
    }
}

/// Log rates by preset, Hz, typical of cameras and touch panels.
const RATES_HZ: [[f64; 3]; 3] = [[50.0, 100.0, 200.0], [20.0, 30.0, 60.0], [100.0, 120.0, 150.0]];

/// Bandwidth of the loop times the sum of its delays; about that of the presets.
const LOOP_SHARE: f64 = 0.25;

impl RigModel {
    /// Returns a preset with parameters that `seed` draws: gains from 0.8 to 1.2, plates up
    /// to 1.4° off level, 60 to 240 ms from command to motion, play up to 0.3°, stiction up
    /// to 0.7°, half to twice the preset's noise.
    ///
    /// # Errors
    /// [`Invalid`] if the preset's numbers are out of range; they are not.
    pub fn varied(seed: u64) -> Result<Self, Invalid> {
        let preset = Preset::ALL[(seed % Preset::ALL.len() as u64) as usize];
        let mut model = preset.model()?;
        let mut noise = Noise::new(seed, Purpose::Variety);
        let mut between = |low: f64, high: f64| noise.uniform(low, high);
        let (dead_time_s, lag_s) = (between(0.02, 0.12), between(0.04, 0.12));
        let play_rad = between(0.0, 0.005);
        model.servos = PerAxis::from_fn(|axis: Axis| ServoTruth {
            dead_time_s,
            lag_s,
            play_rad,
            gain: between(0.8, 1.2),
            level_rad: between(-0.025, 0.025),
            ..model.servos[axis]
        });
        model.surface.breakaway_rad = between(0.002, 0.012);
        model.surface.rolling_rad = model.surface.breakaway_rad * between(0.1, 0.5);
        model.surface.restitution = between(0.2, 0.7);
        let scale = between(0.5, 2.0);
        model.sensor.noise_m *= scale;
        model.sensor.quantum_m *= scale;
        model.sensor.jitter = between(0.0, 0.15);
        let rates = RATES_HZ[preset as usize];
        model.rig.sample_rate_hz = rates[(between(0.0, 3.0) as usize).min(2)];
        // Builders tune the loop to its delays: in the presets, the bandwidth times the
        // delay is about a quarter.
        let period_s = 1.0 / model.rig.sample_rate_hz;
        let delay_s = dead_time_s + lag_s + model.sensor.latency_s + 1.5 * period_s;
        model.controller.bandwidth_rad_s = LOOP_SHARE / delay_s;
        model.rig.name = format!("{preset}-{seed}");
        Ok(model)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::Refresh;
    use proptest::prelude::*;

    #[test]
    fn every_rig_can_be_and_no_two_are_alike() {
        let rigs: Vec<RigModel> = (0..60).map(|seed| RigModel::varied(seed).unwrap()).collect();
        rigs.iter().for_each(|rig| rig.check().unwrap());
        assert!(rigs.windows(2).all(|pair| pair[0].servos != pair[1].servos));
        assert_eq!(rigs[7], RigModel::varied(7).unwrap());
    }

    fn real(seed: u64) -> RigModel {
        Variety::Real.rig(seed).unwrap()
    }

    #[test]
    fn equal_seeds_draw_equal_rigs_and_others_do_not() {
        for variety in Variety::ALL {
            assert_eq!(variety.rig(7).unwrap(), variety.rig(7).unwrap());
            assert_ne!(variety.rig(7).unwrap().servos, variety.rig(8).unwrap().servos);
            assert_eq!(variety.as_str().parse(), Ok(variety));
        }
    }

    #[test]
    fn sixty_real_rigs_have_every_property_of_real_rigs() {
        let rigs: Vec<RigModel> = (0..60).map(real).collect();
        let some = |of: &dyn Fn(&RigModel) -> bool| rigs.iter().filter(|rig| of(rig)).count();
        let shares = [
            some(&|rig| rig.one_axis),
            some(&|rig| matches!(rig.sensor.refresh, Refresh::Rows(2..))),
            some(&|rig| matches!(rig.sensor.refresh, Refresh::Hz(_))),
            some(&|rig| rig.sensor.dead_band_m > 0.0),
            some(&|rig| rig.sensor.noise_m >= 8e-3),
            some(&|rig| rig.sensor.origin_m != PerAxis::default()),
            some(&|rig| rig.controller.resolution_rad.to_degrees() > 0.9),
            some(&|rig| rig.surface.breakaway_rad > 0.015),
            some(&|rig| rig.spread.level_rad > 0.01),
            some(&|rig| rig.rig.sample_rate_hz < 15.0),
        ];
        // Ten per cent are six of sixty; a half, thirty.
        assert!(shares.iter().all(|n| (3..=45).contains(n)), "{shares:?}");
    }

    proptest! {
        #[test]
        fn every_real_rig_is_within_its_ranges(seed in any::<u64>()) {
            let rig = real(seed);
            prop_assert!(rig.check().is_ok());
            prop_assert_eq!(ranges::outside(&rig), Vec::<&str>::new());
        }
    }
}
