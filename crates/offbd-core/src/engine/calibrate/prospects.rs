//! How soon a fault would be found: had it come during the healthy recording.
//!
//! At moments spread over the sessions a fault is put in, and the engine judges
//! on from there what would have been read: the recorded readings, with their
//! noise, pushes and gaps, and what the fault adds to them. That is how far two
//! twins part of which one has the fault. Somebody controls the ball, so the
//! commands answer what the fault adds, as those of a controller of
//! [`CONTROL_RAD_S`] that is well damped.

use crate::diagnosis::{Calibration, FaultMemory, Prospects, ServoProspects};
use crate::engine::frame::{Moment, moment};
use crate::engine::{AxisMapping, Engine, Input, Output, Rig, Setup};
use crate::maths::median;
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::plant::{RollingState, Twin};
use crate::vocabulary::{Axis, FaultCode, FaultStatus, PerAxis, Sample};

/// Moments, over all sessions, at which a fault is put in.
const ONSETS: usize = 12;
/// Seconds of a session before the first of them.
const SETTLING_S: f64 = 5.0;
/// Seconds after which a fault counts as not found.
const HORIZON_S: f64 = 10.0;
/// Shares of the gain that may be lost, the smallest first.
const LOSSES: [f64; 8] = [0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0];
/// Angles, degrees, that a horn may slip by, the smallest first.
const SLIPS_DEG: [f64; 8] = [0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0];
/// Bandwidth of the control that answers what a fault adds, rad/s: as fast as a
/// loop with 0.2 s of delay, lag and filtering allows with some margin.
const CONTROL_RAD_S: f64 = 2.0;
/// Its damping ratio.
const DAMPING: f64 = 0.7;
/// A reading less the mean of its neighbours scatters by √(3/2) of one's noise.
const OF_NEIGHBOURS: f64 = 0.816_496_580_927_726;

/// What a fault does to the readings.
#[derive(Clone, Copy)]
enum Fault {
    /// The servo of an axis answers this share less.
    Loss(Axis, f64),
    /// The plate is off by this angle about the axis' servo, rad.
    Slip(Axis, f64),
    Stuck,
    Frozen,
    Unseen,
}

impl Fault {
    const fn code(self) -> FaultCode {
        match self {
            Self::Loss(axis, _) | Self::Slip(axis, _) => FaultCode::servo(axis),
            Self::Stuck => FaultCode::StuckBall,
            Self::Frozen | Self::Unseen => FaultCode::Sensor,
        }
    }
}

/// How soon faults would have been confirmed in `sessions` of `rig`, which they
/// calibrated; none where the sessions are shorter than 15 s or `rig` is not
/// calibrated.
pub(super) fn prospects(rig: &Rig, sessions: &[Vec<Sample>]) -> Option<Prospects> {
    let learnt = rig.calibration.as_ref()?;
    let plain = Rig { mapping: AxisMapping::default(), ..rig.clone() };
    let setup = Setup::new(plain, None).ok()?;
    let spans: Vec<f64> = sessions.iter().map(|s| usable_s(s)).collect();
    let total: f64 = spans.iter().sum();
    let course = |(samples, &span): (&Vec<Sample>, &f64)| {
        (span > 0.0).then(|| Course::new(rig, samples, span, (ONSETS as f64 * span / total).ceil()))
    };
    let courses: Vec<Course> = sessions.iter().zip(&spans).filter_map(course).collect();
    let trials = Trials::new(rig, &setup, &courses);
    (!trials.starts.is_empty()).then(|| trials.prospects(learnt))
}

/// Seconds of a session in which a fault may be put.
fn usable_s(samples: &[Sample]) -> f64 {
    let times = || samples.iter().map(|s| s.t_s).filter(|t| t.is_finite());
    let (first, last) =
        (times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max));
    (last - first - SETTLING_S - HORIZON_S).max(0.0)
}

/// One session in the plate frame, and where the faults are put in.
struct Course {
    moments: Vec<Moment>,
    onsets: Vec<usize>,
}

impl Course {
    fn new(rig: &Rig, samples: &[Sample], span_s: f64, n: f64) -> Self {
        let mut moments: Vec<Moment> =
            samples.iter().filter_map(|s| moment(&rig.mapping, s)).collect();
        moments.sort_by_key(|m| m.at);
        moments.dedup_by_key(|m| m.at);
        let at = |k: usize| SETTLING_S + span_s * (k as f64 + 0.5) / n;
        let index = |k: usize| moments.partition_point(|m| m.at - moments[0].at < at(k));
        let onsets = (0..n as usize).map(index).filter(|&i| i > 0 && i < moments.len()).collect();
        Self { moments, onsets }
    }

    /// The noise of a reading, as its neighbours show it, m.
    fn noise(&self, axis: Axis, i: usize) -> f64 {
        let read = |k: usize| self.moments.get(k).and_then(|m| m.position[axis]);
        let (Some(a), Some(b), Some(c)) = (read(i - 1), read(i), read(i + 1)) else { return 0.0 };
        OF_NEIGHBOURS * (b - (a + c) / 2.0)
    }
}

/// A moment as a device with the plate's own axes would send it.
fn sample(moment: &Moment) -> Sample {
    Sample {
        seq: None,
        t_s: moment.at.seconds(),
        cmd_qx_rad: moment.command.y,
        cmd_qy_rad: moment.command.x,
        x_m: moment.position.x,
        y_m: moment.position.y,
    }
}

/// A session judged up to here, in which nothing was found.
struct Start<'a> {
    course: &'a Course,
    from: usize,
    engine: Engine,
    twin: Twin,
}

struct Trials<'a> {
    rig: &'a Rig,
    starts: Vec<Start<'a>>,
}

impl<'a> Trials<'a> {
    fn new(rig: &'a Rig, setup: &Setup, courses: &'a [Course]) -> Self {
        let mut starts = Vec::new();
        for course in courses {
            let mut engine = Engine::new(setup.clone(), FaultMemory::default());
            let mut twin = Twin::new(setup.twin);
            let mut outputs = Vec::new();
            for (i, m) in course.moments.iter().enumerate() {
                if course.onsets.contains(&i) && !outputs.iter().any(|o| confirmed(o).is_some()) {
                    let (engine, twin) = (engine.clone(), twin.clone());
                    starts.push(Start { course, from: i, engine, twin });
                }
                outputs.retain(|o| confirmed(o).is_some());
                engine.handle(Input::Sample(sample(m)), &mut outputs);
                twin.advance(m.at, m.command, &RollingState::default());
            }
        }
        Self { rig, starts }
    }

    fn prospects(&self, learnt: &Calibration) -> Prospects {
        let servo = |axis: Axis| ServoProspects {
            dead_s: self.median_s(Fault::Loss(axis, 1.0)),
            half_gain_s: self.median_s(Fault::Loss(axis, 0.5)),
            offset_1deg_s: self.median_s(Fault::Slip(axis, 1_f64.to_radians())),
            least_gain_loss: self.least(&LOSSES, |loss| Fault::Loss(axis, loss)),
            least_offset_rad: self
                .least(&SLIPS_DEG, |deg| Fault::Slip(axis, deg.to_radians()))
                .map(f64::to_radians),
        };
        Prospects {
            n_trials: self.starts.len(),
            servos: PerAxis::from_fn(|axis| learnt.axes[axis].map(|_| servo(axis))),
            stuck_s: self.median_s(Fault::Stuck),
            frozen_s: self.median_s(Fault::Frozen),
            unseen_s: self.median_s(Fault::Unseen),
        }
    }

    /// The smallest of `sizes`, in rising order, from which on half of the trials
    /// find every one; none where they do not find the largest.
    fn least(&self, sizes: &[f64], fault: impl Fn(f64) -> Fault) -> Option<f64> {
        let found = |&size: &f64| self.median_s(fault(size)).is_some();
        sizes.iter().rev().copied().take_while(found).last()
    }

    /// Seconds within which half of the trials find it; none where fewer do.
    fn median_s(&self, fault: Fault) -> Option<f64> {
        let delay = |start| self.delay_s(start, fault).unwrap_or(f64::INFINITY);
        let mut delays: Vec<f64> = self.starts.iter().map(delay).collect();
        median(&mut delays).filter(|delay| delay.is_finite())
    }

    /// Seconds from the onset to the confirmation; none if the ball leaves the
    /// plate or the time is up before.
    fn delay_s(&self, start: &Start<'_>, fault: Fault) -> Option<f64> {
        let mut trial = Trial::new(self.rig, start, fault);
        let onset = start.course.moments[start.from].at;
        let mut outputs = Vec::new();
        for i in start.from..start.course.moments.len() {
            let moment = trial.moment(i)?;
            if moment.at - onset > HORIZON_S {
                return None;
            }
            trial.engine.handle(Input::Sample(sample(&moment)), &mut outputs);
            if outputs.drain(..).any(|o| confirmed(&o) == Some(fault.code())) {
                return Some(moment.at - onset);
            }
        }
        None
    }
}

/// A session from the onset of a fault on.
struct Trial<'a> {
    rig: &'a Rig,
    start: &'a Start<'a>,
    fault: Fault,
    engine: Engine,
    healthy: Twin,
    faulty: Twin,
    /// What the ball is beside its recorded place: m, m/s.
    beside: PerAxis<(f64, f64)>,
}

impl<'a> Trial<'a> {
    fn new(rig: &'a Rig, start: &'a Start<'a>, fault: Fault) -> Self {
        let (engine, healthy) = (start.engine.clone(), start.twin.clone());
        let (faulty, beside) = (healthy.clone(), PerAxis::default());
        Self { rig, start, fault, engine, healthy, faulty, beside }
    }

    /// What is commanded and read at moment `i`; none once the ball is off the
    /// plate.
    fn moment(&mut self, i: usize) -> Option<Moment> {
        let recorded = &self.start.course.moments[i];
        let mut moment = *recorded;
        for axis in Axis::ALL {
            let limit = self.rig.servo.angle_limit_rad;
            let answer = self.control(axis);
            moment.command[axis] =
                recorded.command[axis].map(|c| (c + answer).clamp(-limit, limit));
        }
        self.part(recorded, &moment);
        moment.position = self.read(i);
        let (x, y) = (moment.position.x.unwrap_or(0.0), moment.position.y.unwrap_or(0.0));
        (self.rig.plate.edge_distance_m(x, y) > 0.0).then_some(moment)
    }

    /// Carries the ball's distance from its recorded place on to this moment.
    fn part(&mut self, recorded: &Moment, moment: &Moment) {
        let (still, answered) = (RollingState::default(), self.answered(moment));
        self.healthy.advance(moment.at, recorded.command, &still);
        self.faulty.advance(moment.at, answered, &still);
        let (healthy, faulty) = (self.healthy.motion(), self.faulty.motion());
        let position = faulty.position - healthy.position;
        let velocity = faulty.velocity - healthy.velocity;
        let held = self.held();
        self.beside = PerAxis::from_fn(|axis| match (held[axis], recorded.position[axis]) {
            (Some(at), Some(was)) => (at - was, 0.0),
            _ => (position[axis as usize], velocity[axis as usize]),
        });
    }

    /// Where the ball is, or seems to be, held.
    fn held(&self) -> PerAxis<Option<f64>> {
        match self.fault {
            Fault::Stuck | Fault::Frozen => self.start.course.moments[self.start.from].position,
            _ => PerAxis::default(),
        }
    }

    /// What a controller adds to the command to bring the ball back, rad.
    fn control(&self, axis: Axis) -> f64 {
        let (position_m, velocity_m_s) = self.beside[axis];
        let wanted = CONTROL_RAD_S * CONTROL_RAD_S * position_m
            + 2.0 * DAMPING * CONTROL_RAD_S * velocity_m_s;
        -wanted / (axis.drive_sign() * self.rig.ball.rolling_gravity())
    }

    /// The commands as the faulty servos follow them.
    fn answered(&self, moment: &Moment) -> PerAxis<Option<f64>> {
        let mut commands = moment.command;
        match self.fault {
            Fault::Loss(axis, share) => commands[axis] = commands[axis].map(|c| (1.0 - share) * c),
            Fault::Slip(axis, angle) => commands[axis] = commands[axis].map(|c| c + angle),
            Fault::Stuck | Fault::Frozen | Fault::Unseen => {}
        }
        commands
    }

    /// What the sensor reads at moment `i`.
    fn read(&self, i: usize) -> PerAxis<Option<f64>> {
        let course = self.start.course;
        let (recorded, held) = (course.moments[i].position, self.held());
        PerAxis::from_fn(|axis| match self.fault {
            Fault::Loss(..) | Fault::Slip(..) => recorded[axis].map(|p| p + self.beside[axis].0),
            Fault::Stuck => held[axis].map(|p| p + course.noise(axis, i)),
            Fault::Frozen => held[axis],
            Fault::Unseen => None,
        })
    }
}

/// The code that `output` confirms.
fn confirmed(output: &Output) -> Option<FaultCode> {
    match output {
        Output::Transition(t) if t.status == FaultStatus::Confirmed => Some(t.code),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::calibrate::calibrate;
    use crate::engine::calibrate::tests::session;

    fn foreseen() -> Prospects {
        let mut rig = Rig::chapter("a");
        let sessions = [session(60.0, 0.03, 1.0)];
        rig.calibration = Some(calibrate(&rig, &sessions, "", "").unwrap());
        prospects(&rig, &sessions).unwrap()
    }

    #[test]
    fn what_is_plain_is_found_and_soon() {
        let Prospects { n_trials, servos, unseen_s, .. } = foreseen();
        assert_eq!(n_trials, ONSETS);
        for axis in Axis::ALL {
            let servo = servos[axis].unwrap();
            let (dead_s, half_s) = (servo.dead_s.unwrap(), servo.half_gain_s.unwrap());
            assert!(dead_s < half_s && dead_s < 2.0, "{axis:?} {servo:?}");
            assert!(servo.least_gain_loss.unwrap() <= 0.5, "{axis:?} {servo:?}");
        }
        assert!((0.5..1.5).contains(&unseen_s.unwrap()));
    }

    #[test]
    fn too_short_or_not_learnt_foresees_nothing() {
        let mut rig = Rig::chapter("a");
        let session = session(60.0, 0.03, 1.0);
        assert_eq!(prospects(&rig, core::slice::from_ref(&session)), None);
        rig.calibration = Some(calibrate(&rig, core::slice::from_ref(&session), "", "").unwrap());
        assert_eq!(prospects(&rig, &[session[..1400].to_vec()]), None);
    }
}
