//! The ranges from which [`Variety::Real`](super::Variety::Real) draws. Sources:
//! recordings of eight real rigs, data sheets, and published descriptions by builders.

use std::f64::consts::PI;
use std::ops::RangeInclusive;

use super::super::noise::Noise;

/// A closed interval.
pub(super) type ValueRange = RangeInclusive<f64>;

/// Draws from `span` with a uniform distribution.
pub(super) fn even(noise: &mut Noise, span: &ValueRange) -> f64 {
    noise.uniform(*span.start(), *span.end())
}

/// Draws from `span` with a log-uniform distribution.
pub(super) fn by_factor(noise: &mut Noise, span: &ValueRange) -> f64 {
    noise.uniform(span.start().ln(), span.end().ln()).exp()
}

/// A kind of rig: its sensor and its size.
#[derive(Debug)]
pub(super) struct RigKind {
    pub word: &'static str,
    /// Share of the rigs drawn; all shares sum to one.
    pub share: f64,
    /// Ball and beam.
    pub one_axis: bool,
    /// Readings per second; the log has at least as many rows.
    pub looks_hz: ValueRange,
    /// Standard deviation of a reading, m.
    pub noise_m: ValueRange,
    /// Quantisation step: pixel or count, m.
    pub quantum_m: ValueRange,
    /// Delay of a reading, s.
    pub latency_s: ValueRange,
    /// Length of the plate along x, m.
    pub length_m: ValueRange,
    /// Width of the plate as a share of its length.
    pub width_share: ValueRange,
    /// Share of ping-pong balls; the others are of steel.
    pub light: f64,
    /// Limit of the command's magnitude, rad.
    pub limit_rad: ValueRange,
}

/// The kinds of rigs. Cameras have 5 to 60 Hz; ultrasonic sensors about 10 Hz and 8 to
/// 15 mm of noise; resistive panels the 50 to 150 Hz of their loop and up to some tenths
/// of a millimetre. Half a pixel to three pixels of a camera are 0.2 to 2 mm on a plate.
pub(super) const KINDS: [RigKind; 4] = [
    RigKind {
        word: "camera",
        share: 0.45,
        one_axis: false,
        looks_hz: 5.0..=60.0,
        noise_m: 2e-4..=2e-3,
        quantum_m: 2e-4..=1.5e-3,
        latency_s: 0.015..=0.08,
        length_m: 0.25..=0.45,
        width_share: 0.7..=1.0,
        light: 0.7,
        limit_rad: 0.14..=0.3,
    },
    RigKind {
        word: "panel",
        share: 0.25,
        one_axis: false,
        looks_hz: 50.0..=150.0,
        noise_m: 3e-5..=5e-4,
        quantum_m: 2e-5..=3e-4,
        latency_s: 0.002..=0.01,
        length_m: 0.16..=0.36,
        width_share: 0.6..=0.8,
        light: 0.0,
        limit_rad: 0.1..=0.2,
    },
    RigKind {
        word: "beam",
        share: 0.15,
        one_axis: true,
        looks_hz: 10.0..=60.0,
        noise_m: 5e-4..=4e-3,
        quantum_m: 2e-4..=2e-3,
        latency_s: 0.01..=0.06,
        length_m: 0.3..=0.8,
        width_share: 0.15..=0.2,
        light: 0.5,
        limit_rad: 0.14..=0.3,
    },
    RigKind {
        word: "ultrasound",
        share: 0.15,
        one_axis: true,
        looks_hz: 8.0..=15.0,
        noise_m: 8e-3..=1.5e-2,
        quantum_m: 1e-3..=1e-2,
        latency_s: 0.01..=0.03,
        length_m: 0.5..=1.0,
        width_share: 0.1..=0.15,
        light: 0.5,
        limit_rad: 0.14..=0.3,
    },
];

/// Share of the logs that repeat each reading for a whole number of rows; chosen.
pub(super) const IN_STEP: f64 = 0.3;
/// Number of rows with the same reading in such a log; observed on one real camera: 3.
pub(super) const HOLD_ROWS: ValueRange = 2.0..=4.0;
/// Share of the logs that are faster than their sensor and not synchronised with it;
/// chosen.
pub(super) const OUT_OF_STEP: f64 = 0.2;
/// Log rate over sensor rate in such a log; observed: a panel of 60 Hz and a log of
/// 120 Hz.
pub(super) const ROWS_PER_LOOK: ValueRange = 1.1..=3.0;
/// Highest log rate drawn, rows per second; chosen.
pub(super) const FASTEST_LOG_HZ: f64 = 200.0;
/// Share of the sensors with a dead band; chosen.
pub(super) const STEADIED: f64 = 0.3;
/// Width of a dead band in sums of quantisation step and standard deviation of the noise.
/// Chosen: healthy readings then repeat for 0.2 to 1.8 s, ultrasonic ones for 6.6 s.
pub(super) const DEAD_BAND_DEVIATIONS: ValueRange = 1.0..=3.0;
/// Upper limit of a dead band, m; chosen: with a wider one no controller could hold a
/// ball.
pub(super) const WIDEST_DEAD_BAND_M: f64 = 0.02;
/// Share of readings without a ball.
pub(super) const MISSING: ValueRange = 0.0..=0.01;
/// Share of readings that are outliers.
pub(super) const OUTLIERS: ValueRange = 0.0..=1e-3;
/// Standard deviation of the log's period as a share of it.
pub(super) const JITTER: ValueRange = 0.0..=0.15;
/// Share of the rigs whose origin is off centre; chosen.
pub(super) const OFF_CENTRE: f64 = 0.5;
/// Offset of the origin as a share of the plate's sides; chosen: a corner of the image is
/// taken for a corner of the plate.
pub(super) const ORIGIN_SHARE: ValueRange = -0.06..=0.06;
/// Error of the owner's measurement of the origin, by hand, m.
pub(super) const ORIGIN_ERROR_M: ValueRange = -0.003..=0.003;

/// Time from command to first movement, s. Together with [`LAG_S`]: the 80 to 300 ms from
/// command to acceleration observed on real rigs, less the sensor's part.
pub(super) const DEAD_TIME_S: ValueRange = 0.02..=0.1;
/// Lag of a servo, s.
pub(super) const LAG_S: ValueRange = 0.03..=0.12;
/// Rate limit of a servo, rad/s: a hobby servo under load turns 60° in 0.1 to 0.25 s.
pub(super) const SERVO_RATE_RAD_S: ValueRange = 4.0..=10.0;
/// Plate angle per command; calibrations of rigs with many sessions gave 0.46 to 1.05.
pub(super) const GAIN: ValueRange = 0.6..=1.15;
/// Play of the linkage, rad: up to 0.3°.
pub(super) const PLAY_RAD: ValueRange = 0.0..=0.005;
/// Share of the servos with a resolution of 1°; chosen.
pub(super) const WHOLE_DEGREES: f64 = 0.4;
/// Share of the servos with a resolution of 0.5°; chosen. The others are continuous.
pub(super) const HALF_DEGREES: f64 = 0.2;

/// Limit of the mean level of a rig, rad: 1°; chosen.
pub(super) const LEVEL_RAD: f64 = PI / 180.0;
/// The same as a share of the command's limit. Chosen so that the controller keeps most of
/// its range.
pub(super) const LEVEL_OF_LIMIT: f64 = 1.0 / 8.0;
/// Largest standard deviation of the level between sessions, rad; observed on one real
/// rig: 1.1°, −0.6° to 3.6° within a day.
pub(super) const LEVEL_SPREAD_RAD: f64 = 1.1 * PI / 180.0;
/// The same as a share of the command's limit; chosen.
pub(super) const LEVEL_SPREAD_OF_LIMIT: f64 = 1.0 / 12.0;
/// Standard deviation of the gain between sessions as a share of it.
pub(super) const GAIN_SPREAD: ValueRange = 0.0..=0.03;

/// Breakaway tilt of a ping-pong ball, rad: 0.3° to 2°.
pub(super) const LIGHT_BREAKAWAY_RAD: ValueRange = 0.3 * PI / 180.0..=2.0 * PI / 180.0;
/// Breakaway tilt of a steel ball, rad: 0.1° to 0.7°.
pub(super) const HEAVY_BREAKAWAY_RAD: ValueRange = 0.1 * PI / 180.0..=0.7 * PI / 180.0;
/// Rolling resistance as a share of the breakaway tilt.
pub(super) const DRAG_SHARE: ValueRange = 0.1..=0.6;
/// Coefficient of restitution of the rim.
pub(super) const RESTITUTION: ValueRange = 0.2..=0.7;
/// Radius of a ping-pong ball, m: 40 mm in diameter.
pub(super) const LIGHT_RADIUS_M: f64 = 0.02;
/// Mass of a ping-pong ball, kg: 2.7 g.
pub(super) const LIGHT_MASS_KG: f64 = 0.0027;
/// Radius of a steel ball, m.
pub(super) const HEAVY_RADIUS_M: ValueRange = 0.0075..=0.02;
/// Density of steel, kg/m³.
pub(super) const STEEL_KG_M3: f64 = 7800.0;

/// Bandwidth of the loop times the sum of its delays. Chosen: from slow to aggressive
/// tuning. The crossover is at twice the bandwidth, where even the aggressive loop keeps a
/// phase margin of some 35°.
pub(super) const LOOP_SHARE: ValueRange = 0.2..=0.32;
/// Upper limit of the bandwidth times the period of the log, rad; chosen: that of the
/// slowest loops.
pub(super) const TURN_PER_PERIOD_RAD: f64 = 0.25;
/// Feedforward: share of the reference acceleration, on circles and Lissajous figures;
/// chosen.
pub(super) const FEEDFORWARD: ValueRange = 0.6..=1.0;
/// Damping ratio of the closed loop.
pub(super) const DAMPING: ValueRange = 0.8..=1.2;
/// Rate of the integral action as a share of the bandwidth. Chosen so that it compensates
/// the level within 10 to 40 s.
pub(super) const INTEGRAL: ValueRange = 0.15..=0.35;
/// Time constant of the derivative's filter, s; chosen. Without a filter, the commands
/// take on the noise of the readings.
pub(super) const DERIVATIVE_FILTER_S: ValueRange = 0.0..=0.1;

#[cfg(test)]
pub(super) use tests::outside;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::{Refresh, RigModel};
    use offbd_core::vocabulary::Axis;

    /// Returns the properties of `model` that are outside the range of its kind, as
    /// documented, independently of the code that draws them.
    pub(crate) fn outside(model: &RigModel) -> Vec<&'static str> {
        let word = model.rig.name.split('-').next().unwrap();
        let kind = KINDS.iter().find(|kind| kind.word == word).unwrap();
        let (sensor, surface) = (&model.sensor, &model.surface);
        let (controller, limit) = (&model.controller, model.rig.servo.angle_limit_rad);
        let log_hz = model.rig.sample_rate_hz;
        let looks_hz = match sensor.refresh {
            Refresh::Rows(n) => log_hz / f64::from(n),
            Refresh::Hz(hz) => hz,
        };
        let light = model.rig.ball.mass_kg() == LIGHT_MASS_KG;
        let breakaway = if light { LIGHT_BREAKAWAY_RAD } else { HEAVY_BREAKAWAY_RAD };
        let band = sensor.dead_band_m / (sensor.noise_m + sensor.quantum_m);
        let mut checks = vec![
            ("one axis", model.one_axis == kind.one_axis),
            ("rate", has(&kind.looks_hz, looks_hz) && looks_hz <= log_hz * (1.0 + 1e-12)),
            ("log", log_hz <= FASTEST_LOG_HZ * (1.0 + 1e-12)),
            ("noise", has(&kind.noise_m, sensor.noise_m)),
            ("quantum", has(&kind.quantum_m, sensor.quantum_m)),
            ("latency", has(&kind.latency_s, sensor.latency_s)),
            ("dead band", band <= 3.0 && sensor.dead_band_m <= 0.02),
            ("missing", has(&MISSING, sensor.missing)),
            ("outliers", has(&OUTLIERS, sensor.outliers)),
            ("jitter", has(&JITTER, sensor.jitter)),
            ("limit", has(&kind.limit_rad, limit) && controller.limit_rad == limit),
            ("breakaway", has(&breakaway, surface.breakaway_rad)),
            ("drag", has(&DRAG_SHARE, surface.rolling_rad / surface.breakaway_rad)),
            ("restitution", has(&RESTITUTION, surface.restitution)),
            ("damping", has(&DAMPING, controller.damping)),
            ("integral", has(&INTEGRAL, controller.integral)),
            ("filter", has(&DERIVATIVE_FILTER_S, controller.derivative_filter_s)),
            ("resolution", [0, 50, 100].contains(&hundredths_deg(controller.resolution_rad))),
            ("gain spread", has(&GAIN_SPREAD, model.spread.gain)),
            ("level spread", (0.0..=1.1 * PI / 180.0).contains(&model.spread.level_rad)),
        ];
        for axis in Axis::ALL {
            let servo = &model.servos[axis];
            let origin = sensor.origin_m[axis] / (2.0 * model.rig.plate.half_extent_m(axis));
            checks.extend([
                ("gain", (0.95 * 0.6..=1.05 * 1.15).contains(&servo.gain)),
                ("level", servo.level_rad.abs() <= PI / 180.0),
                ("dead time", has(&DEAD_TIME_S, servo.dead_time_s)),
                ("lag", has(&LAG_S, servo.lag_s)),
                ("play", has(&PLAY_RAD, servo.play_rad)),
                ("servo rate", has(&SERVO_RATE_RAD_S, servo.rate_limit_rad_s)),
                ("origin", has(&ORIGIN_SHARE, origin)),
            ]);
        }
        checks.into_iter().filter(|(_, within)| !within).map(|(name, _)| name).collect()
    }

    /// Returns whether `value` is in `span`, up to the rounding error of a product.
    fn has(span: &ValueRange, value: f64) -> bool {
        let slack = 1e-12 * span.start().abs().max(span.end().abs());
        (span.start() - slack..=span.end() + slack).contains(&value)
    }

    fn hundredths_deg(angle_rad: f64) -> i64 {
        (angle_rad.to_degrees() * 100.0).round() as i64
    }

    #[test]
    fn the_shares_of_all_kinds_make_one() {
        let sum: f64 = KINDS.iter().map(|kind| kind.share).sum();
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
    }
}
