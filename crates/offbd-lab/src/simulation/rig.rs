//! The simulated rig in motion.
//!
//! It goes from event to event (the sensor looks; the device reads it, commands
//! and logs a row); between two events the plant advances in steps of at most
//! 1 ms, each a row of stages: faults in force → servos → ball → truth.

use nalgebra::Vector2;

use super::ball::{BallState, Table};
use super::controller::{Controller, Wanted};
use super::disturbance::{DisturbanceState, Disturbances};
use super::fault::{BallFault, Fault, FaultEffect, SensorFault, ServoFault};
use super::model::RigModel;
use super::noise::{Noise, Purpose};
use super::reference::{Reference, ReferenceState};
use super::sensor::{Reading, Sensor};
use super::servo::{PlateAngle, SimulatedServo};
use super::truth::{FaultTruth, Truth, Watch};
use offbd_core::plant::{RollingState, Tilt};
use offbd_core::vocabulary::{Axis, FaultCode, Invalid, PerAxis, Sample};

/// Longest step of the plant, s: a fiftieth of the fastest servo lag.
const STEP_S: f64 = 1e-3;
/// The log's jitter is cut here, as a share of the period, so that its times
/// never go back.
const MAX_JITTER: f64 = 0.4;
/// The log's resolutions, as a device prints them: 0.1 ms, 10 µrad, 10 µm.
const LOGGED_PER_S: f64 = 1e4;
const LOGGED_PER_RAD: f64 = 1e5;
const LOGGED_PER_M: f64 = 1e5;

/// The faults in force at one moment.
#[derive(Clone, Copy, Debug, Default)]
struct InForce {
    servos: PerAxis<Option<ServoFault>>,
    ball: Option<BallFault>,
    sensor: Option<SensorFault>,
}

/// What happens next.
#[derive(Clone, Copy)]
enum Event {
    Look,
    Row,
}

/// When things happen next, s.
#[derive(Clone, Debug)]
struct Schedule {
    n_looks: u64,
    n_rows: u64,
    next_row_s: f64,
    clock: Noise,
}

/// A simulated rig; advances by [`next_sample`](Self::next_sample) alone.
#[derive(Clone, Debug)]
pub struct SimulatedRig {
    model: RigModel,
    table: Table,
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
    faults: Vec<Watch>,
}

impl SimulatedRig {
    /// A rig with its ball somewhere near the centre, at rest, at time zero.
    ///
    /// # Errors
    /// [`Invalid`] naming the element of the model that cannot be.
    pub fn new(
        model: RigModel,
        reference: Reference,
        disturbances: Disturbances,
        seed: u64,
    ) -> Result<Self, Invalid> {
        model.check()?;
        let table = Table::new(model.rig.ball, model.rig.plate, model.surface);
        let limit = model.controller.limit_rad;
        let servo = |axis: Axis, purpose| {
            SimulatedServo::new(model.servos[axis], limit, Noise::new(seed, purpose))
        };
        let servos =
            PerAxis { x: servo(Axis::X, Purpose::ServoX)?, y: servo(Axis::Y, Purpose::ServoY)? };
        let reach = table.reach();
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
            table,
            model,
        })
    }

    /// Adds a fault; it counts from its onset on, at once if that has passed.
    pub fn inject(&mut self, fault: Fault) {
        self.faults.push(Watch::new(fault));
    }

    /// Ends every fault of `code` now, those still to come included.
    pub fn repair(&mut self, code: FaultCode) {
        let now_s = self.now_s;
        let of_code = |w: &&mut Watch| w.fault().effect.code() == code;
        self.faults.iter_mut().filter(of_code).for_each(|w| w.end(now_s));
    }

    /// Pushes the ball: an acceleration of the free ball, m/s², for `seconds`.
    pub fn push(&mut self, acceleration: Vector2<f64>, seconds: f64) {
        self.disturbances.push(acceleration, self.now_s + seconds);
    }

    /// All faults injected so far, with their first chances.
    pub fn faults(&self) -> impl Iterator<Item = &FaultTruth> {
        self.faults.iter().map(Watch::truth)
    }

    /// What is really the case.
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

    /// The next row of the device's log. Rows are numbered from 1; their times
    /// rise strictly.
    pub fn next_sample(&mut self) -> Sample {
        self.next_row(Self::control)
    }

    /// The same where `device` commands in place of the rig's own controller: it is
    /// shown the row with its reading and the commands of the row before.
    pub fn next_sample_by(
        &mut self,
        device: impl FnOnce(&Sample) -> PerAxis<Option<f64>>,
    ) -> Sample {
        self.next_row(|rig| {
            let commands = device(&rig.log());
            rig.controller.command(commands);
            rig.pass_on();
        })
    }

    fn next_row(&mut self, control: impl FnOnce(&mut Self)) -> Sample {
        loop {
            let (event, at_s) = self.schedule.next(&self.model);
            self.advance_to(at_s);
            match event {
                Event::Look => self.look(),
                Event::Row => return self.row(control),
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
        // The rate of a lag jumps with its command: the ball feels that too.
        let acceleration = (end.rate - start.rate) / h;
        let tilts = [start, middle, end].map(|tilt| Tilt { acceleration, ..tilt });
        self.ball = self.table.advance(&self.ball, tilts.each_ref(), push, faults.ball, h);
        self.now_s += h;
        self.watch();
    }

    fn faults_in_force(&self) -> InForce {
        let mut in_force = InForce::default();
        for fault in self.faults.iter().map(Watch::fault).filter(|f| f.active(self.now_s)) {
            match fault.effect {
                FaultEffect::Servo(axis, effect) => in_force.servos[axis] = Some(effect),
                FaultEffect::Ball(effect) => in_force.ball = Some(effect),
                FaultEffect::Sensor(effect) => in_force.sensor = Some(effect),
            }
        }
        in_force
    }

    fn turn_plate(&mut self, at_s: f64, h: f64, faults: &InForce) -> Tilt {
        for axis in Axis::ALL {
            self.plate[axis] = self.servos[axis].advance(at_s, h, faults.servos[axis]);
            self.healthy_rad[axis] = self.healthy_servos[axis].advance(at_s, h, None).angle;
        }
        self.tilt()
    }

    /// The plate's tilt about (x, y): the servo of axis x turns it about y. A beam
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

    /// What of a push moves the ball: a beam guides it along x.
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

    /// One turn of the device's loop.
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
            Wanted { position: wanted[i], acceleration: ahead[i] }
        });
        self.controller.update(wanted, self.reading);
        self.pass_on();
    }

    /// The servos take the commands in force.
    fn pass_on(&mut self) {
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

    /// The next event and its time; at one moment a look comes before a row.
    fn next(&mut self, model: &RigModel) -> (Event, f64) {
        let look_s = model.sensor.refresh.look_s(self.n_looks);
        if look_s <= self.next_row_s {
            self.n_looks += 1;
            return (Event::Look, look_s);
        }
        let row_s = self.next_row_s;
        self.n_rows += 1;
        let jitter = (self.clock.normal() * model.sensor.jitter).clamp(-MAX_JITTER, MAX_JITTER);
        self.next_row_s = (self.n_rows as f64 + jitter) / model.rig.sample_rate_hz;
        (Event::Row, row_s)
    }
}

/// The ball at rest within a fifth of its reach of the centre.
fn start(reach: Vector2<f64>, seed: u64, one_axis: bool) -> BallState {
    let mut noise = Noise::new(seed, Purpose::Start);
    let mut share = || noise.uniform(-0.2, 0.2);
    let mut position = Vector2::new(share(), share()).component_mul(&reach);
    if one_axis {
        position.y = 0.0;
    }
    BallState { rolling: RollingState { position, ..RollingState::default() }, lost: false }
}

fn logged(value: f64, per_unit: f64) -> f64 {
    // Adding zero turns −0 into 0.
    (value * per_unit).round() / per_unit + 0.0
}

#[cfg(test)]
mod real_tests;
#[cfg(test)]
mod tests;
