//! Rigs like those that people build, no two alike: a preset whose numbers are
//! drawn anew within the ranges seen on real rigs.

use super::model::RigModel;
use super::noise::{Noise, Purpose};
use super::presets::Preset;
use super::servo::ServoTruth;
use crate::vocabulary::{Axis, Invalid, PerAxis};

/// Log rates of cameras and touch panels, Hz, by preset.
const RATES_HZ: [[f64; 3]; 3] = [[50.0, 100.0, 200.0], [20.0, 30.0, 60.0], [100.0, 120.0, 150.0]];

/// Bandwidth of the loop times all its delays.
const LOOP_SHARE: f64 = 0.25;

impl RigModel {
    /// The rig that `seed` draws: gains from 0.8 to 1.2, plates up to 1.4° off
    /// level, 60 to 240 ms from command to motion, play up to 0.3°, a ball that
    /// stands at up to 0.7°, half to twice the preset's noise.
    ///
    /// # Errors
    /// [`Invalid`] if the preset's numbers cannot be; they can.
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
        // Whoever builds a rig tunes its loop to its delays: the presets' loops
        // are all about a quarter of them.
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

    #[test]
    fn every_rig_can_be_and_no_two_are_alike() {
        let rigs: Vec<RigModel> = (0..60).map(|seed| RigModel::varied(seed).unwrap()).collect();
        rigs.iter().for_each(|rig| rig.check().unwrap());
        assert!(rigs.windows(2).all(|pair| pair[0].servos != pair[1].servos));
        assert_eq!(rigs[7], RigModel::varied(7).unwrap());
    }
}
