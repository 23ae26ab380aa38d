//! The simulation of a rig.
//!
//! It advances from event to event (the sensor takes a reading; the device reads it,
//! commands and logs a row). Between two events the plant advances in steps of at most
//! 1 ms, each in stages: active faults → servos → ball → truth.

use nalgebra::Vector2;

use super::ball::{BallOnPlate, BallState};
use super::controller::{Controller, PidGains, Setpoint};
use super::disturbance::{DisturbanceState, Disturbances};
use super::fault::{BallFault, Fault, FaultEffect, Reading, SensorFault, ServoFault};
use super::model::RigModel;
use super::noise::{Noise, Purpose};
use super::reference::{Reference, ReferenceState};
use super::sensor::Sensor;
use super::servo::{PlateAngle, SimulatedServo};
use super::truth::{FaultObserver, FaultTruth, Truth};
use offbd_core::plant::{RollingState, Tilt};
use offbd_core::vocabulary::{Axis, FaultCode, Invalid, PerAxis, Sample};

/// Longest step of the plant, s. Chosen: a fiftieth of the fastest servo lag of the
/// presets.
const STEP_S: f64 = 1e-3;
/// Limit of the log's jitter as a share of its period. Chosen below one half, so that the
/// times never decrease.
const MAX_JITTER: f64 = 0.4;
/// Resolution of the log's times, per s: 0.1 ms, as a device prints them.
const LOGGED_PER_S: f64 = 1e4;
/// Resolution of the log's angles, per rad: 10 µrad, likewise.
const LOGGED_PER_RAD: f64 = 1e5;
/// Resolution of the log's positions, per m: 10 µm, likewise.
const LOGGED_PER_M: f64 = 1e5;

/// The faults active at one time.
#[derive(Clone, Copy, Debug, Default)]
struct ActiveFaults {
    servos: PerAxis<Option<ServoFault>>,
    ball: Option<BallFault>,
    sensor: Option<SensorFault>,
}

/// An event of the simulation.
#[derive(Clone, Copy)]
enum ScheduledEvent {
    /// The sensor takes a reading.
    Look,
    /// The device logs a row.
    Row,
}

/// The times of the next events.
#[derive(Clone, Debug)]
struct Schedule {
    n_looks: u64,
    n_rows: u64,
    next_row_s: f64,
    clock: Noise,
}

/// A simulated rig. Time advances with [`next_sample`](Self::next_sample) and
/// [`next_sample_by`](Self::next_sample_by).
#[derive(Clone, Debug)]
pub struct SimulatedRig {
    model: RigModel,
    ball_on_plate: BallOnPlate,
    now_s: f64,
    schedule: Schedule,
    servos: PerAxis<SimulatedServo>,
    healthy_servos: PerAxis<SimulatedServo>,
    plate: PerAxis<PlateAngle>,
    healthy_rad: PerAxis<f64>,
    ball: BallState,
    sensor: Sensor,
    reading: Reading,
    controller: Controller,
    reference: ReferenceState,
    disturbances: DisturbanceState,
    faults: Vec<FaultObserver>,
}

impl SimulatedRig {
    /// Creates a rig at time zero, with its ball at rest at a random position near the
    /// centre.
    ///
    /// # Errors
    /// [`Invalid`] naming the element of the model that is out of range.
    pub fn new(
        model: RigModel,
        reference: Reference,
        disturbances: Disturbances,
        seed: u64,
    ) -> Result<Self, Invalid> {
        model.check()?;
        let ball_on_plate = BallOnPlate::new(model.rig.ball, model.rig.plate, model.surface);
        let limit = model.controller.limit_rad;
        let servo = |axis: Axis, purpose| {
            SimulatedServo::new(model.servos[axis], limit, Noise::new(seed, purpose))
        };
        let servos =
            PerAxis { x: servo(Axis::X, Purpose::ServoX)?, y: servo(Axis::Y, Purpose::ServoY)? };
        let reach = ball_on_plate.reach();
        let level = |axis: Axis| model.servos[axis].level_rad;
        Ok(Self {
            now_s: 0.0,
            schedule: Schedule::new(seed),
            healthy_servos: servos.clone(),
            servos,
            plate: PerAxis::from_fn(|a| PlateAngle { angle: level(a), ..PlateAngle::default() }),
            healthy_rad: PerAxis::from_fn(level),
            ball: start(reach, seed, model.one_axis),
            sensor: Sensor::new(model.sensor, reach, seed),
            reading: Reading::default(),
            controller: Controller::new(
                model.controller,
                &model.rig.ball,
                1.0 / model.rig.sample_rate_hz,
            ),
            reference: ReferenceState::new(reference, reach, seed),
            disturbances: DisturbanceState::new(disturbances, &model.rig.ball, seed),
            faults: Vec::new(),
            ball_on_plate,
            model,
        })
    }

    /// Adds a fault; it acts from its onset on, at once if that has passed.
    pub fn inject(&mut self, fault: Fault) {
        self.faults.push(FaultObserver::new(fault));
    }

    /// Ends every fault of `code` now, including those that have not begun.
    pub fn repair(&mut self, code: FaultCode) {
        let now_s = self.now_s;
        let of_code = |w: &&mut FaultObserver| w.fault().effect.code() == code;
        self.faults.iter_mut().filter(of_code).for_each(|w| w.end(now_s));
    }

    /// Uses other gains of the rig's controller from its next command on.
    ///
    /// # Errors
    /// [`Invalid`] naming the gain that is out of range.
    pub fn tune(&mut self, gains: PidGains) -> Result<(), Invalid> {
        gains.check()?;
        self.controller.tune(gains);
        Ok(())
    }

    /// Pushes the ball with an acceleration of the free ball, m/s², for `seconds`.
    pub fn push(&mut self, acceleration: Vector2<f64>, seconds: f64) {
        self.disturbances.push(acceleration, self.now_s + seconds);
    }

    /// Returns all faults injected so far, with the first time each was detectable.
    pub fn faults(&self) -> impl Iterator<Item = &FaultTruth> {
        self.faults.iter().map(FaultObserver::truth)
    }

    /// Returns the true state of the rig.
    #[must_use]
    pub fn truth(&self) -> Truth {
        Truth {
            t_s: self.now_s,
            position: self.ball.rolling.position,
            velocity: self.ball.rolling.velocity,
            lost: self.ball.lost,
            plate_rad: self.plate.map(|p| p.angle),
            healthy_rad: self.healthy_rad,
        }
    }

    /// Returns the samples of the next `seconds`.
    pub fn record(&mut self, seconds: f64) -> Vec<Sample> {
        let end_s = self.truth().t_s + seconds;
        core::iter::from_fn(|| Some(self.next_sample())).take_while(|s| s.t_s <= end_s).collect()
    }

    /// Returns the next row of the device's log. Rows are numbered from 1; their times
    /// increase strictly.
    pub fn next_sample(&mut self) -> Sample {
        self.next_row(Self::control)
    }

    /// Like [`next_sample`](Self::next_sample), but `device` commands instead of the
    /// rig's own controller: it receives the row with its reading and the commands of the
    /// previous row.
    pub fn next_sample_by(
        &mut self,
        device: impl FnOnce(&Sample) -> PerAxis<Option<f64>>,
    ) -> Sample {
        self.next_row(|rig| {
            let commands = device(&rig.log());
            rig.controller.command(commands);
            rig.send_commands();
        })
    }

    fn next_row(&mut self, control: impl FnOnce(&mut Self)) -> Sample {
        loop {
            let (event, at_s) = self.schedule.next(&self.model);
            self.advance_to(at_s);
            match event {
                ScheduledEvent::Look => self.look(),
                ScheduledEvent::Row => return self.row(control),
            }
        }
    }

    fn advance_to(&mut self, until_s: f64) {
        let span = until_s - self.now_s;
        let n = (span / STEP_S - 1e-6).ceil().max(1.0);
        if span > 0.0 {
            (0..n as u32).for_each(|_| self.step(span / n));
            self.now_s = until_s;
        }
    }

    fn step(&mut self, h: f64) {
        let faults = self.faults_in_force();
        let start = self.tilt();
        let middle = self.turn_plate(self.now_s, h / 2.0, &faults);
        let end = self.turn_plate(self.now_s + h / 2.0, h / 2.0, &faults);
        let push = self.disturbances.at(self.now_s);
        let push = self.on_the_beam(push);
        // The rate of a lag jumps with its command: this acceleration acts on the ball too.
        let acceleration = (end.rate - start.rate) / h;
        let tilts = [start, middle, end].map(|tilt| Tilt { acceleration, ..tilt });
        self.ball = self.ball_on_plate.advance(&self.ball, tilts.each_ref(), push, faults.ball, h);
        self.now_s += h;
        self.watch();
    }

    fn faults_in_force(&self) -> ActiveFaults {
        let mut in_force = ActiveFaults::default();
        for fault in self.faults.iter().map(FaultObserver::fault).filter(|f| f.active(self.now_s)) {
            match fault.effect {
                FaultEffect::Servo(axis, effect) => in_force.servos[axis] = Some(effect),
                FaultEffect::Ball(effect) => in_force.ball = Some(effect),
                FaultEffect::Sensor(effect) => in_force.sensor = Some(effect),
            }
        }
        in_force
    }

    fn turn_plate(&mut self, at_s: f64, h: f64, faults: &ActiveFaults) -> Tilt {
        for axis in Axis::ALL {
            self.plate[axis] = self.servos[axis].advance(at_s, h, faults.servos[axis]);
            self.healthy_rad[axis] = self.healthy_servos[axis].advance(at_s, h, None).angle;
        }
        self.tilt()
    }

    /// Returns the plate's tilt about (x, y): the servo of axis x turns it about y. A beam
    /// turns about y only.
    fn tilt(&self) -> Tilt {
        let (x, y) =
            (self.plate.x, if self.model.one_axis { PlateAngle::default() } else { self.plate.y });
        Tilt {
            angle: Vector2::new(y.angle, x.angle),
            rate: Vector2::new(y.rate, x.rate),
            acceleration: Vector2::new(y.acceleration, x.acceleration),
        }
    }

    /// Returns the component of a push that moves the ball: a beam guides it along x.
    fn on_the_beam(&self, push: Vector2<f64>) -> Vector2<f64> {
        if self.model.one_axis { Vector2::new(push.x, 0.0) } else { push }
    }

    fn watch(&mut self) {
        let truth = self.truth();
        for watch in &mut self.faults {
            watch.observe(&truth, &self.reading, &self.model);
        }
    }

    fn look(&mut self) {
        let fault = self.faults_in_force().sensor;
        let ball = (!self.ball.lost).then_some(self.ball.rolling.position);
        self.sensor.look(self.now_s, ball, fault);
    }

    /// Runs the device's loop once; returns the row that it logs.
    fn row(&mut self, control: impl FnOnce(&mut Self)) -> Sample {
        if self.model.sensor.refresh.with_row(self.schedule.n_rows) {
            self.look();
        }
        self.reading = self.sensor.reading(self.now_s);
        self.reading.y = self.reading.y.filter(|_| !self.model.one_axis);
        control(self);
        self.log()
    }

    fn control(&mut self) {
        let wanted = self.reference.at(self.now_s);
        let ahead = self.reference.acceleration(wanted);
        let wanted = PerAxis::from_fn(|axis| {
            let i = axis as usize;
            Setpoint { position: wanted[i], acceleration: ahead[i] }
        });
        self.controller.update(wanted, self.reading);
        self.send_commands();
    }

    /// Sends the current commands to the servos.
    fn send_commands(&mut self) {
        let commands = self.controller.commands();
        for axis in Axis::ALL {
            self.servos[axis].command(self.now_s, commands[axis]);
            self.healthy_servos[axis].command(self.now_s, commands[axis]);
        }
    }

    fn log(&self) -> Sample {
        let commands = self.controller.commands();
        let metres = |m: Option<f64>| m.map(|m| logged(m, LOGGED_PER_M));
        Sample {
            seq: Some(self.schedule.n_rows),
            t_s: logged(self.now_s, LOGGED_PER_S),
            cmd_qx_rad: (!self.model.one_axis).then(|| logged(commands.y, LOGGED_PER_RAD)),
            cmd_qy_rad: Some(logged(commands.x, LOGGED_PER_RAD)),
            x_m: metres(self.reading.x),
            y_m: metres(self.reading.y),
        }
    }
}

impl Schedule {
    fn new(seed: u64) -> Self {
        let clock = Noise::new(seed, Purpose::Clock);
        Self { n_looks: 0, n_rows: 0, next_row_s: 0.0, clock }
    }

    /// Returns the next event and its time, s; at the same time a reading comes before a
    /// row.
    fn next(&mut self, model: &RigModel) -> (ScheduledEvent, f64) {
        let look_s = model.sensor.refresh.look_s(self.n_looks);
        if look_s <= self.next_row_s {
            self.n_looks += 1;
            return (ScheduledEvent::Look, look_s);
        }
        let row_s = self.next_row_s;
        self.n_rows += 1;
        let jitter = (self.clock.normal() * model.sensor.jitter).clamp(-MAX_JITTER, MAX_JITTER);
        self.next_row_s = (self.n_rows as f64 + jitter) / model.rig.sample_rate_hz;
        (ScheduledEvent::Row, row_s)
    }
}

/// Returns the ball at rest, within a fifth of its reach from the centre.
fn start(reach: Vector2<f64>, seed: u64, one_axis: bool) -> BallState {
    let mut noise = Noise::new(seed, Purpose::Start);
    let mut share = || noise.uniform(-0.2, 0.2);
    let mut position = Vector2::new(share(), share()).component_mul(&reach);
    if one_axis {
        position.y = 0.0;
    }
    BallState { rolling: RollingState { position, ..RollingState::default() }, lost: false }
}

/// Rounds a value to the resolution of the log.
fn logged(value: f64, per_unit: f64) -> f64 {
    // Adding zero turns −0 into 0.
    (value * per_unit).round() / per_unit + 0.0
}

#[cfg(test)]
mod real_tests;
#[cfg(test)]
mod tests;
