//! How soon each fault would be found if it occurred during the healthy recording.
//!
//! Faults are injected at times spread over the sessions. From there on the engine judges
//! the recorded readings, with their noise, pushes and gaps, plus the effect of the
//! fault: the difference between two twins of which one has the fault. The rig is
//! controlled, so the commands respond to that effect like those of a well damped
//! controller with a bandwidth of [`CONTROL_RAD_S`].

use crate::diagnosis::{Calibration, FaultMemory, Prospects, ServoProspects, Transition};
use crate::engine::frame::{Moment, moment};
use crate::engine::{AxisMapping, Engine, Input, Rig, Setup};
use crate::maths::median;
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::plant::{RollingState, Twin};
use crate::vocabulary::{Axis, FaultCode, FaultStatus, PerAxis, Sample};

/// Times, over all sessions, at which a fault is injected. Chosen.
const ONSETS: usize = 12;
/// Time before the first of them in a session, s. Chosen.
const SETTLING_S: f64 = 5.0;
/// Time after which a fault counts as not found, s. Chosen.
const HORIZON_S: f64 = 10.0;
/// Tried losses of gain as fractions, the smallest first.
const LOSSES: [f64; 8] = [0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0];
/// Tried slips of the horn, degrees, the smallest first.
const SLIPS_DEG: [f64; 8] = [0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0];
/// Bandwidth of the controller that responds to the fault, rad/s: what a loop with 0.2 s
/// of delay, lag and filtering allows with some margin.
const CONTROL_RAD_S: f64 = 2.0;
/// Damping ratio of that controller. Chosen.
const CONTROL_DAMPING: f64 = 0.7;
/// √(2/3): a reading less the mean of its neighbours scatters by √(3/2) of its noise.
const NEIGHBOUR_NOISE: f64 = 0.816_496_580_927_726;

/// A fault that is injected.
#[derive(Clone, Copy)]
enum Fault {
    /// The servo of an axis answers this fraction less.
    Loss(Axis, f64),
    /// The plate is off by this angle about the servo of an axis, rad.
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

/// Returns how soon faults would have been confirmed in `sessions`, from which `rig` was
/// learnt; `None` if the sessions are shorter than 15 s or `rig` is not calibrated.
pub(super) fn prospects(rig: &Rig, sessions: &[Vec<Sample>]) -> Option<Prospects> {
    let learnt = rig.calibration.as_ref()?;
    let plain = Rig { mapping: AxisMapping::default(), ..rig.clone() };
    let setup = Setup::new(plain, None).ok()?;
    let spans: Vec<f64> = sessions.iter().map(|s| usable_s(s)).collect();
    let total: f64 = spans.iter().sum();
    let session = |(samples, &span): (&Vec<Sample>, &f64)| {
        (span > 0.0)
            .then(|| TrialSession::new(rig, samples, span, (ONSETS as f64 * span / total).ceil()))
    };
    let sessions_tried: Vec<TrialSession> =
        sessions.iter().zip(&spans).filter_map(session).collect();
    let trials = Trials::new(rig, &setup, &sessions_tried);
    (!trials.starts.is_empty()).then(|| trials.prospects(learnt))
}

/// Time of a session in which a fault may begin, s.
fn usable_s(samples: &[Sample]) -> f64 {
    let times = || samples.iter().map(|s| s.t_s).filter(|t| t.is_finite());
    let (first, last) =
        (times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max));
    (last - first - SETTLING_S - HORIZON_S).max(0.0)
}

/// One session in the plate frame, and the indices at which faults begin.
struct TrialSession {
    moments: Vec<Moment>,
    onsets: Vec<usize>,
}

impl TrialSession {
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

    /// The noise of a reading, estimated from its neighbours, m.
    fn noise(&self, axis: Axis, i: usize) -> f64 {
        let read = |k: usize| self.moments.get(k).and_then(|m| m.position[axis]);
        let (Some(a), Some(b), Some(c)) = (read(i - 1), read(i), read(i + 1)) else { return 0.0 };
        NEIGHBOUR_NOISE * (b - (a + c) / 2.0)
    }
}

/// Converts a moment to the sample of a device with the plate's own axes.
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

/// The engine and twin at the onset of a fault; nothing was found before.
struct TrialStart<'a> {
    session: &'a TrialSession,
    from: usize,
    engine: Engine,
    twin: Twin,
}

struct Trials<'a> {
    rig: &'a Rig,
    starts: Vec<TrialStart<'a>>,
}

impl<'a> Trials<'a> {
    fn new(rig: &'a Rig, setup: &Setup, sessions_tried: &'a [TrialSession]) -> Self {
        let mut starts = Vec::new();
        for session in sessions_tried {
            let mut engine = Engine::new(setup.clone(), FaultMemory::default());
            let mut twin = Twin::new(setup.twin);
            let mut transitions = Vec::new();
            for (i, m) in session.moments.iter().enumerate() {
                if session.onsets.contains(&i) && !transitions.iter().any(confirms) {
                    let (engine, twin) = (engine.clone(), twin.clone());
                    starts.push(TrialStart { session, from: i, engine, twin });
                }
                transitions.retain(confirms);
                engine.handle(Input::Sample(sample(m)), &mut transitions);
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

    /// Returns the smallest of the ascending `sizes` from which on half of the trials
    /// find the fault at every size; `None` if they do not find the largest.
    fn least(&self, sizes: &[f64], fault: impl Fn(f64) -> Fault) -> Option<f64> {
        let found = |&size: &f64| self.median_s(fault(size)).is_some();
        sizes.iter().rev().copied().take_while(found).last()
    }

    /// Returns the median delay, s; `None` if fewer than half of the trials find the
    /// fault.
    fn median_s(&self, fault: Fault) -> Option<f64> {
        let delay = |start| self.delay_s(start, fault).unwrap_or(f64::INFINITY);
        let mut delays: Vec<f64> = self.starts.iter().map(delay).collect();
        median(&mut delays).filter(|delay| delay.is_finite())
    }

    /// Returns the time from the onset to the confirmation, s; `None` if the ball leaves
    /// the plate or the time is over.
    fn delay_s(&self, start: &TrialStart<'_>, fault: Fault) -> Option<f64> {
        let mut trial = FaultTrial::new(self.rig, start, fault);
        let onset = start.session.moments[start.from].at;
        let mut transitions = Vec::new();
        for i in start.from..start.session.moments.len() {
            let moment = trial.moment(i)?;
            if moment.at - onset > HORIZON_S {
                return None;
            }
            trial.engine.handle(Input::Sample(sample(&moment)), &mut transitions);
            if transitions.drain(..).any(|t| confirms(&t) && t.code == fault.code()) {
                return Some(moment.at - onset);
            }
        }
        None
    }
}

/// A session from the onset of a fault on.
struct FaultTrial<'a> {
    rig: &'a Rig,
    start: &'a TrialStart<'a>,
    fault: Fault,
    engine: Engine,
    healthy: Twin,
    faulty: Twin,
    /// Position (m) and velocity (m/s) of the ball relative to the recording.
    beside: PerAxis<(f64, f64)>,
}

impl<'a> FaultTrial<'a> {
    fn new(rig: &'a Rig, start: &'a TrialStart<'a>, fault: Fault) -> Self {
        let (engine, healthy) = (start.engine.clone(), start.twin.clone());
        let (faulty, beside) = (healthy.clone(), PerAxis::default());
        Self { rig, start, fault, engine, healthy, faulty, beside }
    }

    /// Returns the commands and readings of moment `i`; `None` once the ball is off the
    /// plate.
    fn moment(&mut self, i: usize) -> Option<Moment> {
        let recorded = &self.start.session.moments[i];
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

    /// Advances the ball's distance from the recording to this moment.
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

    /// Where the ball is held, or appears to be.
    fn held(&self) -> PerAxis<Option<f64>> {
        match self.fault {
            Fault::Stuck | Fault::Frozen => self.start.session.moments[self.start.from].position,
            _ => PerAxis::default(),
        }
    }

    /// The command that a controller adds to bring the ball back, rad.
    fn control(&self, axis: Axis) -> f64 {
        let (position_m, velocity_m_s) = self.beside[axis];
        let wanted = CONTROL_RAD_S * CONTROL_RAD_S * position_m
            + 2.0 * CONTROL_DAMPING * CONTROL_RAD_S * velocity_m_s;
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

    /// The sensor's readings at moment `i`.
    fn read(&self, i: usize) -> PerAxis<Option<f64>> {
        let session = self.start.session;
        let (recorded, held) = (session.moments[i].position, self.held());
        PerAxis::from_fn(|axis| match self.fault {
            Fault::Loss(..) | Fault::Slip(..) => recorded[axis].map(|p| p + self.beside[axis].0),
            Fault::Stuck => held[axis].map(|p| p + session.noise(axis, i)),
            Fault::Frozen => held[axis],
            Fault::Unseen => None,
        })
    }
}

fn confirms(transition: &Transition) -> bool {
    transition.status == FaultStatus::Confirmed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::calibrate::calibrate;
    use crate::engine::calibrate::tests::session;

    fn foreseen() -> Prospects {
        let mut rig = Rig::chapter("a");
        let sessions = [session(60.0, 0.03, 1.0)];
        rig.calibration = Some(Box::new(calibrate(&rig, &sessions).unwrap()));
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
        rig.calibration = Some(Box::new(calibrate(&rig, core::slice::from_ref(&session)).unwrap()));
        assert_eq!(prospects(&rig, &[session[..1400].to_vec()]), None);
    }
}
