//! The ranges from which [`Variety::Real`](super::Variety::Real) draws, and where
//! they come from: recordings of eight real rigs, data sheets, and what people
//! write of their own.

use std::f64::consts::PI;
use std::ops::RangeInclusive;

use super::super::noise::Noise;

/// Numbers from one to another, both included.
pub(super) type Span = RangeInclusive<f64>;

/// One of `span`, each as likely as the other.
pub(super) fn even(noise: &mut Noise, span: &Span) -> f64 {
    noise.uniform(*span.start(), *span.end())
}

/// One of `span`, each factor as likely as the other.
pub(super) fn by_factor(noise: &mut Noise, span: &Span) -> f64 {
    noise.uniform(span.start().ln(), span.end().ln()).exp()
}

/// A kind of rig: how it looks at its ball, and how large it is.
#[derive(Debug)]
pub(super) struct Kind {
    pub word: &'static str,
    /// Share of the rigs that are drawn; all shares make one.
    pub share: f64,
    /// Ball and beam.
    pub one_axis: bool,
    /// Looks per second; the log has as many rows or more.
    pub looks_hz: Span,
    /// Standard deviation of a reading, m.
    pub noise_m: Span,
    /// Pixel or count, m.
    pub quantum_m: Span,
    /// From a look to its reading, s.
    pub latency_s: Span,
    /// Along x, m; the width is this share of it.
    pub length_m: Span,
    pub width_share: Span,
    /// Share of ping-pong balls; the others are of steel.
    pub light: f64,
    /// Largest command, rad.
    pub limit_rad: Span,
}

/// Cameras look at 5 to 60 Hz, ultrasound at about ten with 8 to 15 mm of noise,
/// resistive panels at their loop's 50 to 150 Hz with up to some tenths of a
/// millimetre. Half a pixel to three of a camera on a plate is 0.2 to 2 mm.
pub(super) const KINDS: [Kind; 4] = [
    Kind {
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
    Kind {
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
    Kind {
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
    Kind {
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

/// Share of the logs that hold each reading for two to four rows (as one real camera
/// did for three), and of those that are faster than their sensor by a factor and
/// in no step with it (as a panel of 60 Hz under a log of 120).
pub(super) const IN_STEP: f64 = 0.3;
pub(super) const HOLD_ROWS: Span = 2.0..=4.0;
pub(super) const OUT_OF_STEP: f64 = 0.2;
pub(super) const ROWS_PER_LOOK: Span = 1.1..=3.0;
/// Fastest log that is drawn, rows per second.
pub(super) const FASTEST_LOG_HZ: f64 = 200.0;
/// Share of the sensors with a dead band, which is so many of their steps and
/// standard deviations of noise, and no wider than a limit, m: beyond that nobody
/// could hold a ball by it. Healthy readings stand for 0.2 to 1.8 s, those of
/// ultrasound for 6.6 s.
pub(super) const STEADIED: f64 = 0.3;
pub(super) const DEAD_BAND_DEVIATIONS: Span = 1.0..=3.0;
pub(super) const WIDEST_DEAD_BAND_M: f64 = 0.02;
/// Share of the readings in which no ball is seen, and of those far off.
pub(super) const MISSING: Span = 0.0..=0.01;
pub(super) const OUTLIERS: Span = 0.0..=1e-3;
/// Standard deviation of the log's period, as a share of it.
pub(super) const JITTER: Span = 0.0..=0.15;
/// Share of the rigs whose origin is off centre, and by how much of the plate's
/// sides: a corner of the picture taken for the plate's.
pub(super) const OFF_CENTRE: f64 = 0.5;
pub(super) const ORIGIN_SHARE: Span = -0.06..=0.06;
/// By how much their owners measure it wrong, by hand, m.
pub(super) const ORIGIN_ERROR_M: Span = -0.003..=0.003;

/// Command to first movement, and lag, s: together the 80 to 300 ms of real rigs
/// from command to acceleration, less the sensor's part.
pub(super) const DEAD_TIME_S: Span = 0.02..=0.1;
pub(super) const LAG_S: Span = 0.03..=0.12;
/// A hobby servo under load: 60° in 0.1 to 0.25 s.
pub(super) const SERVO_RATE_RAD_S: Span = 4.0..=10.0;
/// Plate angle per command; 0.46 to 1.05 where a rig was learnt from many sessions.
pub(super) const GAIN: Span = 0.6..=1.15;
/// Play of the linkage, rad: up to 0.3°.
pub(super) const PLAY_RAD: Span = 0.0..=0.005;
/// Shares of the servos that take whole degrees, and halves; the others take anything.
pub(super) const WHOLE_DEGREES: f64 = 0.4;
pub(super) const HALF_DEGREES: f64 = 0.2;

/// Mean level of a rig, rad: up to 1°, and no more of the largest command than a
/// controller can spare.
pub(super) const LEVEL_RAD: f64 = PI / 180.0;
pub(super) const LEVEL_OF_LIMIT: f64 = 1.0 / 8.0;
/// Largest standard deviation of the level between sessions, rad, and as a share of
/// the largest command: one real rig had −0.6° to 3.6° within a day, 1.1°.
pub(super) const LEVEL_SPREAD_RAD: f64 = 1.1 * PI / 180.0;
pub(super) const LEVEL_SPREAD_OF_LIMIT: f64 = 1.0 / 12.0;
/// Standard deviation of the gain between sessions, as a share of it.
pub(super) const GAIN_SPREAD: Span = 0.0..=0.03;

/// Breakaway tilt, rad: of a ping-pong ball 0.3° to 2°, of a steel ball to 0.7°.
pub(super) const LIGHT_BREAKAWAY_RAD: Span = 0.3 * PI / 180.0..=2.0 * PI / 180.0;
pub(super) const HEAVY_BREAKAWAY_RAD: Span = 0.1 * PI / 180.0..=0.7 * PI / 180.0;
/// Drag of the rolling ball as a share of the breakaway tilt.
pub(super) const DRAG_SHARE: Span = 0.1..=0.6;
/// Speed after over speed before the rim.
pub(super) const RESTITUTION: Span = 0.2..=0.7;
/// A ping-pong ball, and balls of steel: m, kg/m³.
pub(super) const LIGHT_RADIUS_M: f64 = 0.02;
pub(super) const LIGHT_MASS_KG: f64 = 0.0027;
pub(super) const HEAVY_RADIUS_M: Span = 0.0075..=0.02;
pub(super) const STEEL_KG_M3: f64 = 7800.0;

/// Bandwidth of the loop times all its delays: tuned lazily to eagerly. It crosses
/// over at twice the bandwidth, where even the eager one keeps some 35° of phase.
/// A fourth of a radian per look is what the slowest loops come to.
pub(super) const LOOP_SHARE: Span = 0.2..=0.32;
pub(super) const TURN_PER_PERIOD_RAD: f64 = 0.25;
/// Share of the wanted acceleration that is commanded ahead, on circles and the like.
pub(super) const FEEDFORWARD: Span = 0.6..=1.0;
pub(super) const DAMPING: Span = 0.8..=1.2;
/// Integral action, share of the bandwidth. It balances the level, in ten seconds to
/// forty.
pub(super) const INTEGRAL: Span = 0.15..=0.35;
/// Filter of the derivative, s. Without one it makes the commands as noisy as the
/// readings are.
pub(super) const DERIVATIVE_FILTER_S: Span = 0.0..=0.1;

#[cfg(test)]
pub(super) use tests::outside;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::{Refresh, RigModel};
    use offbd_core::vocabulary::Axis;

    /// What of `model` is outside of what its kind may have: written from the
    /// documentation, not from the drawing.
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

    /// Whether `value` is in `span`, but for what a product rounds.
    fn has(span: &Span, value: f64) -> bool {
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
