//! Draws a rig of [`Variety::Real`](super::Variety::Real), one part after the other, from
//! the [ranges](super::ranges).

use super::super::ball::Surface;
use super::super::controller::ControllerModel;
use super::super::model::{RigModel, SessionSpread};
use super::super::noise::Noise;
use super::super::refresh::Refresh;
use super::super::sensor::SensorModel;
use super::super::servo::ServoTruth;
use super::ranges::{self, KINDS, RigKind, by_factor, even};
use offbd_core::engine::{Rig, ServoSpec};
use offbd_core::plant::{Ball, Plate, PlateShape};
use offbd_core::vocabulary::{Axis, Invalid, PerAxis};

/// Draws a rig from `noise`; its name consists of its kind and `seed`.
pub(super) fn rig(seed: u64, noise: &mut Noise) -> Result<RigModel, Invalid> {
    let kind = kind(noise);
    let light = noise.happens(kind.light);
    let limit_rad = even(noise, &kind.limit_rad);
    let looks_hz = by_factor(noise, &kind.looks_hz);
    let (refresh, sample_rate_hz) = refresh(looks_hz, noise);
    let rig = Rig {
        sample_rate_hz,
        ball: ball(light, noise)?,
        plate: plate(kind, noise)?,
        servo: ServoSpec { angle_limit_rad: limit_rad, ..ServoSpec::default() },
        ..Rig::chapter(&format!("{}-{seed}", kind.word))
    };
    let servos = servos(limit_rad, noise);
    let surface = surface(light, noise);
    let sensor = sensor(kind, &rig, refresh, noise);
    let controller = controller(limit_rad, looks_hz, &servos.x, sensor.latency_s, noise);
    let spread = spread(limit_rad, noise);
    let rig = with_origin(rig, &sensor, noise);
    let model =
        RigModel { rig, servos, surface, sensor, controller, one_axis: kind.one_axis, spread };
    Ok(if kind.one_axis { model.along_x() } else { model })
}

fn kind(noise: &mut Noise) -> &'static RigKind {
    let mut left = noise.uniform(0.0, 1.0);
    let drawn = KINDS.iter().find(|kind| {
        left -= kind.share;
        left < 0.0
    });
    drawn.unwrap_or(&KINDS[0])
}

fn ball(light: bool, noise: &mut Noise) -> Result<Ball, Invalid> {
    let radius_m = even(noise, &ranges::HEAVY_RADIUS_M);
    if light {
        return Ball::new(ranges::LIGHT_RADIUS_M, ranges::LIGHT_MASS_KG, 2.0 / 3.0);
    }
    let volume_m3 = 4.0 / 3.0 * std::f64::consts::PI * radius_m.powi(3);
    Ball::new(radius_m, volume_m3 * ranges::STEEL_KG_M3, 0.4)
}

fn plate(kind: &RigKind, noise: &mut Noise) -> Result<Plate, Invalid> {
    let length_m = even(noise, &kind.length_m);
    let width_m = length_m * even(noise, &kind.width_share);
    Plate::new(PlateShape::Rectangle { length_m, width_m }, 0.01, true)
}

fn servos(limit_rad: f64, noise: &mut Noise) -> PerAxis<ServoTruth> {
    let level_rad = ranges::LEVEL_RAD.min(limit_rad * ranges::LEVEL_OF_LIMIT);
    let both = ServoTruth {
        dead_time_s: even(noise, &ranges::DEAD_TIME_S),
        lag_s: even(noise, &ranges::LAG_S),
        rate_limit_rad_s: even(noise, &ranges::SERVO_RATE_RAD_S),
        play_rad: even(noise, &ranges::PLAY_RAD),
        gain: even(noise, &ranges::GAIN),
        level_rad: 0.0,
    };
    // The gains of both linkages agree within 5 %; chosen.
    PerAxis::from_fn(|_| ServoTruth {
        gain: both.gain * noise.uniform(0.95, 1.05),
        level_rad: noise.uniform(-level_rad, level_rad),
        ..both
    })
}

fn surface(light: bool, noise: &mut Noise) -> Surface {
    let breakaway = if light { ranges::LIGHT_BREAKAWAY_RAD } else { ranges::HEAVY_BREAKAWAY_RAD };
    let breakaway_rad = by_factor(noise, &breakaway);
    Surface {
        breakaway_rad,
        rolling_rad: breakaway_rad * even(noise, &ranges::DRAG_SHARE),
        restitution: even(noise, &ranges::RESTITUTION),
    }
}

fn sensor(kind: &RigKind, rig: &Rig, refresh: Refresh, noise: &mut Noise) -> SensorModel {
    let noise_m = by_factor(noise, &kind.noise_m);
    let quantum_m = by_factor(noise, &kind.quantum_m);
    SensorModel {
        refresh,
        latency_s: even(noise, &kind.latency_s),
        noise_m,
        quantum_m,
        dead_band_m: dead_band(noise_m + quantum_m, noise),
        origin_m: origin(kind, rig, noise),
        missing: even(noise, &ranges::MISSING),
        outliers: even(noise, &ranges::OUTLIERS),
        jitter: even(noise, &ranges::JITTER),
    }
}

/// Draws how a sensor with `looks_hz` readings per second relates to its log, and the
/// log's rate, Hz.
fn refresh(looks_hz: f64, noise: &mut Noise) -> (Refresh, f64) {
    let kind = noise.uniform(0.0, 1.0);
    let most = (ranges::FASTEST_LOG_HZ / looks_hz).max(1.0);
    let hold_rows = even(noise, &ranges::HOLD_ROWS).round().min(most.floor());
    let rows_per_look = even(noise, &ranges::ROWS_PER_LOOK).min(most);
    if kind < ranges::IN_STEP {
        (Refresh::Rows(hold_rows as u32), looks_hz * hold_rows)
    } else if kind < ranges::IN_STEP + ranges::OUT_OF_STEP {
        (Refresh::Hz(looks_hz), looks_hz * rows_per_look)
    } else {
        (Refresh::Rows(1), looks_hz)
    }
}

fn dead_band(scatter_m: f64, noise: &mut Noise) -> f64 {
    let deviations = even(noise, &ranges::DEAD_BAND_DEVIATIONS);
    let band_m = (scatter_m * deviations).min(ranges::WIDEST_DEAD_BAND_M);
    if noise.happens(ranges::STEADIED) { band_m } else { 0.0 }
}

fn origin(kind: &RigKind, rig: &Rig, noise: &mut Noise) -> PerAxis<f64> {
    let off = noise.happens(ranges::OFF_CENTRE);
    PerAxis::from_fn(|axis: Axis| {
        let share = even(noise, &ranges::ORIGIN_SHARE);
        let measured = off && !(kind.one_axis && axis == Axis::Y);
        if measured { share * 2.0 * rig.plate.half_extent_m(axis) } else { 0.0 }
    })
}

/// Returns the rig as its owner describes it, with the reading at the plate's centre
/// measured by hand.
fn with_origin(mut rig: Rig, sensor: &SensorModel, noise: &mut Noise) -> Rig {
    rig.mapping.origin_m = sensor.origin_m.map(|origin_m| {
        let measured_m = origin_m + even(noise, &ranges::ORIGIN_ERROR_M);
        if origin_m == 0.0 { 0.0 } else { measured_m }
    });
    rig
}

/// Draws a controller. Builders tune the loop to its delays: those of the servo, the
/// sensor, the derivative's filter, and one period of the sensor.
fn controller(
    limit_rad: f64,
    looks_hz: f64,
    servo: &ServoTruth,
    latency_s: f64,
    noise: &mut Noise,
) -> ControllerModel {
    let derivative_filter_s = even(noise, &ranges::DERIVATIVE_FILTER_S);
    let servo_s = servo.dead_time_s + servo.lag_s;
    let delay_s = servo_s + latency_s + derivative_filter_s + 1.0 / looks_hz;
    ControllerModel {
        bandwidth_rad_s: even(noise, &ranges::LOOP_SHARE) / delay_s,
        damping: even(noise, &ranges::DAMPING),
        integral: even(noise, &ranges::INTEGRAL),
        derivative_filter_s,
        limit_rad,
        feedforward: even(noise, &ranges::FEEDFORWARD),
        turn_per_period_rad: ranges::TURN_PER_PERIOD_RAD,
        resolution_rad: resolution(noise),
    }
}

fn resolution(noise: &mut Noise) -> f64 {
    let kind = noise.uniform(0.0, 1.0);
    if kind < ranges::WHOLE_DEGREES {
        1.0_f64.to_radians()
    } else if kind < ranges::WHOLE_DEGREES + ranges::HALF_DEGREES {
        0.5_f64.to_radians()
    } else {
        0.0
    }
}

fn spread(limit_rad: f64, noise: &mut Noise) -> SessionSpread {
    let most = ranges::LEVEL_SPREAD_RAD.min(limit_rad * ranges::LEVEL_SPREAD_OF_LIMIT);
    SessionSpread { level_rad: noise.uniform(0.0, most), gain: even(noise, &ranges::GAIN_SPREAD) }
}
