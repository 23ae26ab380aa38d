//! The sensor: the times of its readings, its errors, and its faults.

use std::collections::VecDeque;

use std::ops::RangeInclusive;

use nalgebra::Vector2;

use super::fault::{Reading, SensorFault, SensorLook};
use super::noise::{Noise, Purpose};
use super::refresh::Refresh;
use super::steps::{rounded, step_in};
use offbd_core::vocabulary::{Axis, Invalid, PerAxis, in_range};

/// The properties of the sensor and of the device's log; immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorModel {
    pub refresh: Refresh,
    /// Delay of a reading, s.
    pub latency_s: f64,
    /// Standard deviation of a reading, m.
    pub noise_m: f64,
    /// Quantisation step of the readings (a pixel, a count), m; 0: the resolution of the
    /// log.
    pub quantum_m: f64,
    /// Dead band, m: a reading that differs from the last by no more than this along both
    /// axes repeats it; 0: none. Some trackers hold a ball at rest in this way.
    pub dead_band_m: f64,
    /// Reading of a ball at the plate's centre, m.
    pub origin_m: PerAxis<f64>,
    /// Share of readings without a ball.
    pub missing: f64,
    /// Share of single readings that are outliers.
    pub outliers: f64,
    /// Standard deviation of the log's period as a share of it.
    pub jitter: f64,
}

impl SensorModel {
    /// Range of noise, dead band and quantisation step, m; chosen: at most the size of a
    /// large plate.
    pub const LENGTH_M: RangeInclusive<f64> = 0.0..=1.0;
    /// Range of the reading of a ball at the plate's centre, m; chosen likewise.
    pub const ORIGIN_M: RangeInclusive<f64> = -1.0..=1.0;

    pub(super) fn check(&self) -> Result<(), Invalid> {
        self.refresh.check()?;
        in_range("/sensor/latency_s", self.latency_s, 0.0..=1.0)?;
        in_range("/sensor/noise_m", self.noise_m, Self::LENGTH_M)?;
        step_in("/sensor/quantum_m", self.quantum_m, *Self::LENGTH_M.end())?;
        in_range("/sensor/dead_band_m", self.dead_band_m, Self::LENGTH_M)?;
        in_range("/sensor/origin_m", self.origin_m.x, Self::ORIGIN_M)?;
        in_range("/sensor/origin_m", self.origin_m.y, Self::ORIGIN_M)?;
        in_range("/sensor/missing", self.missing, 0.0..=1.0)?;
        in_range("/sensor/outliers", self.outliers, 0.0..=1.0)?;
        in_range("/sensor/jitter", self.jitter, 0.0..=1.0)?;
        Ok(())
    }

    /// Returns the standard deviation that a noise fault multiplies, m: at least that of
    /// the quantisation, q/√12, and 0.1 mm, so that a noiseless sensor can become noisy
    /// too.
    fn noise_floor_m(&self) -> f64 {
        self.noise_m.max(self.quantum_m / 12.0_f64.sqrt()).max(1e-4)
    }
}

/// Range of the distance of a spike or outlier as a share of the reach; chosen.
const OUTLIER_SHARE: [f64; 2] = [0.2, 0.9];

/// A sensor with its state.
#[derive(Clone, Debug)]
pub(super) struct Sensor {
    model: SensorModel,
    reach: Vector2<f64>,
    noise: Noise,
    fault_noise: Noise,
    on_the_way: VecDeque<(f64, Reading)>,
    latest: Reading,
    last_seen: Reading,
    /// The reading that the dead band repeats.
    held: Reading,
}

impl Sensor {
    pub(super) fn new(model: SensorModel, reach: Vector2<f64>, seed: u64) -> Self {
        Self {
            model,
            reach,
            noise: Noise::new(seed, Purpose::Sensor),
            fault_noise: Noise::new(seed, Purpose::SensorFault),
            on_the_way: VecDeque::new(),
            latest: Reading::default(),
            last_seen: Reading::default(),
            held: Reading::default(),
        }
    }

    /// Takes a reading of the ball's position at `at_s`; `None`: the ball is lost.
    pub(super) fn look(
        &mut self,
        at_s: f64,
        ball: Option<Vector2<f64>>,
        fault: Option<SensorFault>,
    ) {
        let healthy = self.measure(ball);
        let healthy = self.with_dead_band(healthy);
        let reading = self.with_fault(healthy, fault);
        if reading.x.is_some() || reading.y.is_some() {
            self.last_seen = reading;
        }
        self.on_the_way.push_back((at_s + self.model.latency_s, reading));
    }

    /// Returns the latest reading that has arrived by `at_s`.
    pub(super) fn reading(&mut self, at_s: f64) -> Reading {
        while self.on_the_way.front().is_some_and(|&(ready, _)| ready <= at_s) {
            if let Some((_, reading)) = self.on_the_way.pop_front() {
                self.latest = reading;
            }
        }
        self.latest
    }

    /// Returns a reading with noise, outliers and quantisation. Draws the same number of
    /// random numbers whether or not there is a ball.
    fn measure(&mut self, ball: Option<Vector2<f64>>) -> Reading {
        let noise = PerAxis::from_fn(|_| self.noise.normal() * self.model.noise_m);
        let missing = self.noise.happens(self.model.missing);
        let outlier = self.noise.happens(self.model.outliers);
        let far = PerAxis::from_fn(|_| outlier_share(&mut self.noise));
        let Some(ball) = ball.filter(|_| !missing) else { return Reading::default() };
        let far = if outlier { far } else { PerAxis::default() };
        PerAxis::from_fn(|axis| {
            let i = axis as usize;
            let origin = self.model.origin_m[axis];
            Some(ball[i] + noise[axis] + far[axis] * self.reach[i] + origin)
        })
        .map(|r| r.map(|m| self.quantise(m)))
    }

    /// Applies the dead band to a reading.
    fn with_dead_band(&mut self, reading: Reading) -> Reading {
        let within = |axis: Axis| match (reading[axis], self.held[axis]) {
            (Some(new), Some(held)) => (new - held).abs() <= self.model.dead_band_m,
            _ => false,
        };
        if self.model.dead_band_m > 0.0 && Axis::ALL.into_iter().all(within) {
            return self.held;
        }
        if reading.x.is_some() {
            self.held = reading;
        }
        reading
    }

    /// Applies a fault to a reading. Draws the same number of random numbers whatever the
    /// fault.
    fn with_fault(&mut self, healthy: Reading, fault: Option<SensorFault>) -> Reading {
        let chance = self.fault_noise.uniform(0.0, 1.0);
        let noise = PerAxis::from_fn(|_| self.fault_noise.normal());
        let far = PerAxis::from_fn(|_| outlier_share(&mut self.fault_noise));
        let floor = self.model.noise_floor_m();
        let look = SensorLook {
            healthy,
            last: self.last_seen,
            chance,
            noise_m: noise.map(|n| n * floor),
            far_m: PerAxis::from_fn(|a| far[a] * self.reach[a as usize]),
            quantum_m: self.model.quantum_m,
        };
        fault.map_or(healthy, |fault| fault.read(&look))
    }

    fn quantise(&self, metres: f64) -> f64 {
        rounded(metres, self.model.quantum_m)
    }
}

fn outlier_share(noise: &mut Noise) -> f64 {
    noise.sign() * noise.uniform(OUTLIER_SHARE[0], OUTLIER_SHARE[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    const PANEL: SensorModel = SensorModel {
        refresh: Refresh::Rows(1),
        latency_s: 0.0,
        noise_m: 1e-3,
        quantum_m: 1e-4,
        dead_band_m: 0.0,
        origin_m: PerAxis { x: 0.0, y: 0.0 },
        missing: 0.0,
        outliers: 0.0,
        jitter: 0.0,
    };

    /// Returns a thousand readings of a ball that rolls along x by 1 mm per reading.
    fn readings(fault: Option<SensorFault>) -> Vec<Reading> {
        let mut sensor = Sensor::new(PANEL, Vector2::new(0.2, 0.1), 7);
        (0..1000)
            .map(|i| {
                let ball = Vector2::new(f64::from(i) * 1e-3, 0.0);
                sensor.look(f64::from(i), Some(ball), fault.filter(|_| i >= 10));
                sensor.reading(f64::from(i))
            })
            .collect()
    }

    fn scatter_y(readings: &[Reading]) -> f64 {
        let square: f64 = readings.iter().map(|r| r.y.unwrap().powi(2)).sum();
        (square / readings.len() as f64).sqrt()
    }

    /// Bounds of ±10 % are over four standard errors, 1/√2000 each.
    #[test]
    fn noise_is_what_it_says_and_a_noisy_sensor_has_that_many_times_more() {
        assert!((scatter_y(&readings(None)) / 1e-3 - 1.0).abs() < 0.1);
        let noisy = scatter_y(&readings(Some(SensorFault::Noise(10.0)))[10..]);
        assert!((noisy / (1e-3 * 101.0_f64.sqrt()) - 1.0).abs() < 0.1, "{noisy}");
    }

    #[test]
    fn frozen_readings_repeat_to_the_bit() {
        let frozen = readings(Some(SensorFault::Freeze));
        assert!(frozen[10..].iter().all(|r| *r == frozen[9]));
        let one = readings(Some(SensorFault::FreezeAxis(Axis::X)));
        assert!(one[10..].iter().all(|r| r.x == one[9].x));
        assert!(one[10..].windows(2).filter(|w| w[0].y == w[1].y).count() < 100);
    }

    #[test]
    fn dropout_spikes_and_jump_leave_their_marks() {
        let healthy = readings(None);
        let seen = |fault| readings(Some(fault))[10..].iter().filter(|r| r.x.is_some()).count();
        assert_eq!(seen(SensorFault::Dropout(1.0)), 0);
        let jumped = readings(Some(SensorFault::Jump(Vector2::new(0.03, 0.0))));
        assert!((jumped[500].x.unwrap() - healthy[500].x.unwrap() - 0.03).abs() < 1e-12);
        let spiky = readings(Some(SensorFault::Spikes(0.2)));
        let far = |r: &&Reading| r.y.unwrap().abs() > 0.015;
        let n = spiky[10..].iter().filter(far).count();
        assert!((150..250).contains(&n), "{n} of 990 readings are spikes");
    }

    #[test]
    fn a_reading_arrives_after_its_latency() {
        let model = SensorModel { latency_s: 0.03, noise_m: 0.0, ..PANEL };
        let mut sensor = Sensor::new(model, Vector2::new(0.2, 0.1), 7);
        sensor.look(1.0, Some(Vector2::new(0.05, 0.0)), None);
        assert_eq!(sensor.reading(1.02).x, None);
        assert!((sensor.reading(1.03).x.unwrap() - 0.05).abs() < 1e-12);
    }

    #[test]
    fn the_origin_is_added_to_every_reading() {
        let origin_m = PerAxis { x: 0.02, y: -0.01 };
        let mut off = Sensor::new(SensorModel { origin_m, ..PANEL }, Vector2::new(0.2, 0.1), 7);
        off.look(0.0, Some(Vector2::zeros()), None);
        let (reading, centred) = (off.reading(0.0), readings(None)[0]);
        assert!((reading.x.unwrap() - centred.x.unwrap() - 0.02).abs() < 1e-12);
        assert!((reading.y.unwrap() - centred.y.unwrap() + 0.01).abs() < 1e-12);
    }

    #[test]
    fn a_dead_band_holds_a_ball_at_rest_and_lets_go_of_one_that_rolls() {
        let model = SensorModel { noise_m: 2e-4, dead_band_m: 2e-3, ..PANEL };
        let mut sensor = Sensor::new(model, Vector2::new(0.2, 0.1), 7);
        let mut run = |speed: f64| -> Vec<Reading> {
            let look = |i: u32| {
                let at_s = f64::from(i);
                sensor.look(at_s, Some(Vector2::new(at_s * speed, 0.0)), None);
                sensor.reading(at_s)
            };
            (0..100).map(look).collect()
        };
        let resting = run(0.0);
        assert!(resting.iter().all(|r| *r == resting[0]));
        let rolling = run(1e-3);
        let new = rolling.windows(2).filter(|w| w[0] != w[1]).count();
        // 99 mm in steps of just over 2 mm, apart from noise.
        assert!((30..=50).contains(&new), "{new} new readings");
        let lag = |(i, r): (usize, &Reading)| (r.x.unwrap() - i as f64 * 1e-3).abs();
        assert!(rolling.iter().enumerate().map(lag).all(|m| m < 3.5e-3));
    }

    #[test]
    fn what_no_sensor_can_be_is_refused_by_name() {
        let tiny = SensorModel { quantum_m: 5e-324, ..PANEL };
        let never = SensorModel { refresh: Refresh::Rows(0), ..PANEL };
        let slow = SensorModel { refresh: Refresh::Hz(f64::NAN), ..PANEL };
        let away = SensorModel { origin_m: PerAxis { x: 0.0, y: 2.0 }, ..PANEL };
        let named = [tiny, never, slow, away].map(|model| model.check().unwrap_err().element);
        let wanted = ["quantum_m", "hold_rows", "refresh_hz", "origin_m"];
        assert_eq!(named, wanted.map(|name| format!("/sensor/{name}")));
    }
}
