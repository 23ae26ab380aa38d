//! The search for the cycle of one rig: the shortest member of the family with the best
//! trials. All in the plate's frame.

use super::motion::DriveMotion;
use super::trial::{Variant, run};
use super::{DriveCycle, FaultVerdict, MonitorVerdict, NoDriveCycle, NotReached, TriedFault};
use crate::diagnosis::{AxisCalibration, Candidate};
use crate::engine::{AxisMapping, Rig, Setup};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::plant::PlateShape;
use crate::vocabulary::{Axis, FaultCode, PerAxis};

/// Highest sample rate of a trial, Hz; a rig that logs faster is judged better. Chosen.
const MAX_TRIED_HZ: f64 = 120.0;
/// Most samples judged in the search; beyond it the best result so far is taken. Chosen:
/// a few seconds of one core.
const MAX_JUDGED: u64 = 3_000_000;
/// Distance between the set points and where the edge may act, m. Chosen.
pub(super) const MARGIN_M: f64 = 0.005;
/// Largest feedforward as a fraction of the servos' limit; the rest is for the
/// correction. Chosen.
pub(super) const COMMANDED: f64 = 0.8;
/// Least peak tilt of a motion, in learnt breakaways: from there on the monitors count
/// the ball as asked to move.
const LEAST_BREAKAWAYS: f64 = 1.5;
/// Fraction of the cycle in which a trial must find a fault. Chosen: a rig is not exactly
/// its twin.
pub(super) const IN_TIME: f64 = 0.85;
/// Penalty of a monitor that does not pass. The penalties are chosen in the order of
/// importance, each larger than all smaller ones together.
const MONITOR_WEIGHT: usize = 10_000;
/// Penalty of a fault that is not found.
const FAULT_WEIGHT: usize = 100;
/// Penalty of a found fault with another cause named beside it.
const BESIDE_WEIGHT: usize = 10;
/// Penalty of a servo that answers half and is not found: the hardest fault, and the
/// least important.
const HALF_WEIGHT: usize = 1;
/// Fractions of the level's spread between sessions that are tried in turn. The spread of
/// a rig with few sessions is assumed large, and may be too large for a small plate.
const SPREADS: [f64; 3] = [1.0, 0.5, 0.25];

/// The results of the trials of one motion.
#[derive(Clone, Debug)]
pub(super) struct TrialResults {
    pub monitors: Vec<MonitorVerdict>,
    pub faults: Vec<FaultVerdict>,
}

impl TrialResults {
    /// The sum of the penalties; zero if everything is found.
    pub(super) fn missing(&self) -> usize {
        let lacking = |m: &&MonitorVerdict| m.passed == Err(NotReached::TooLittleMotion);
        let monitors = self.monitors.iter().filter(lacking).count();
        let weight = |f: &FaultVerdict| match (f.fault, f.after_s, f.beside) {
            (_, Some(_), None) => 0,
            (_, Some(_), Some(_)) => BESIDE_WEIGHT,
            (TriedFault::HalfGain(_), None, _) => HALF_WEIGHT,
            (_, None, _) => FAULT_WEIGHT,
        };
        MONITOR_WEIGHT * monitors + self.faults.iter().map(weight).sum::<usize>()
    }
}

/// The best motion, the fraction of the level's spread that it was tried with, and the
/// results of its trials.
pub(super) struct Best {
    pub motion: DriveMotion,
    pub spread: f64,
    pub found: TrialResults,
}

/// The search for the cycle of one rig; all in the plate's frame.
pub(super) struct Search {
    pub setup: Setup,
}

impl Search {
    pub(super) fn new(rig: &Rig) -> Result<Self, NoDriveCycle> {
        let mut plain = Rig {
            mapping: AxisMapping::default(),
            sample_rate_hz: rig.sample_rate_hz.min(MAX_TRIED_HZ),
            ..rig.clone()
        };
        // The twin of a trial errs exactly as was learnt; on such a rig the path is evidence
        // sooner than on the real one.
        for axis in plain.calibration.iter_mut().flat_map(|c| [&mut c.axes.x, &mut c.axes.y]) {
            *axis = axis.map(|learnt| AxisCalibration { most_path_nats: None, ..learnt });
        }
        let setup = Setup::new(plain, None)?;
        let search = Self { setup };
        let learnt = Axis::ALL.into_iter().any(|axis| search.learnt(axis).is_some());
        if learnt { Ok(search) } else { Err(NoDriveCycle::NotLearnt) }
    }

    pub(super) fn learnt(&self, axis: Axis) -> Option<&AxisCalibration> {
        self.setup.rig.calibration.as_ref()?.axes[axis].as_ref()
    }

    /// Returns the admissible motions, the shortest first.
    pub(super) fn family(&self) -> Result<Vec<DriveMotion>, NoDriveCycle> {
        let rig = &self.setup.rig;
        let room_m = |axis| rig.plate.half_extent_m(axis) - rig.contact_room_m() - MARGIN_M;
        let axes = || Axis::ALL.into_iter().filter(|&axis| self.learnt(axis).is_some());
        if let Some(axis) = axes().find(|&axis| room_m(axis) <= 0.0) {
            return Err(NoDriveCycle::NoRoom { axis, room_m: room_m(axis).max(0.0) });
        }
        let rooms = PerAxis::from_fn(|axis| self.learnt(axis).map(|_| room_m(axis)));
        let round = matches!(rig.plate.shape(), PlateShape::Round { .. });
        let mut family = DriveMotion::family(rooms, round);
        family.retain(|motion| axes().all(|axis| self.serves(motion, axis)));
        if family.is_empty() { Err(NoDriveCycle::TooLittleTilt) } else { Ok(family) }
    }

    /// Whether `motion` is within the servos' limits and overcomes friction.
    fn serves(&self, motion: &DriveMotion, axis: Axis) -> bool {
        let Some(learnt) = self.learnt(axis) else { return true };
        let tilt_rad = self.tilt_rad(motion, axis);
        let most_rad = COMMANDED * self.setup.rig.servo.angle_limit_rad - learnt.level_rad.abs();
        (LEAST_BREAKAWAYS * learnt.breakaway_rad..=most_rad).contains(&tilt_rad)
    }

    /// Largest tilt of `motion` without the level, rad.
    pub(super) fn tilt_rad(&self, motion: &DriveMotion, axis: Axis) -> f64 {
        motion.peak_m_s2(axis) / self.slope_m_s2(axis).abs()
    }

    /// Acceleration along `axis` per radian of its servo, m/s²; signed.
    pub(super) fn slope_m_s2(&self, axis: Axis) -> f64 {
        let gain = self.setup.twin.axes[axis].gain;
        axis.drive_sign() * gain * self.setup.rig.ball.rolling_gravity()
    }

    /// Returns the best of `family`: of equally good ones the one with the largest
    /// spread, then the shortest. `None` if no member keeps a healthy ball on the plate
    /// and its tests from failing.
    pub(super) fn best(&self, family: &[DriveMotion]) -> Option<Best> {
        let mut best: Option<Best> = None;
        let mut n_judged = 0;
        for spread in SPREADS {
            for motion in family {
                let below = best.as_ref().map_or(usize::MAX, |best| best.found.missing());
                if below == 0 || n_judged > MAX_JUDGED {
                    return best;
                }
                if let Some(found) = self.try_out(motion, spread, below, &mut n_judged) {
                    best = Some(Best { motion: *motion, spread, found });
                }
            }
        }
        best
    }

    /// Returns the results of `motion`; `None` if its penalty reaches `below`, or if a
    /// healthy trial fails.
    pub(super) fn try_out(
        &self,
        motion: &DriveMotion,
        spread: f64,
        below: usize,
        n_judged: &mut u64,
    ) -> Option<TrialResults> {
        let cycle = self.cycle(motion, &AxisMapping::default());
        let monitors = self.healthy(&cycle, spread, n_judged)?;
        let mut found = TrialResults { monitors, faults: Vec::new() };
        for fault in TriedFault::of(cycle.axes()) {
            if found.missing() >= below {
                return None;
            }
            found.faults.push(self.faulty(&cycle, fault, spread, n_judged));
        }
        (found.missing() < below).then_some(found)
    }

    /// Returns when each monitor passes in every session; `None` if a test fails or the
    /// ball reaches the edge.
    fn healthy(
        &self,
        cycle: &DriveCycle,
        spread: f64,
        n_judged: &mut u64,
    ) -> Option<Vec<MonitorVerdict>> {
        let mut passed = [Some(0.0_f64); FaultCode::COUNT];
        for variant in Variant::all(spread) {
            let outcome = run(&self.setup, cycle, variant, None);
            *n_judged += outcome.n_judged;
            if outcome.at_edge || outcome.failed {
                return None;
            }
            for (all, this) in passed.iter_mut().zip(outcome.passed_s) {
                *all = all.zip(this).map(|(all, this)| all.max(this));
            }
        }
        let verdict = |(&code, passed_s): (&FaultCode, Option<f64>)| {
            let absent = code.axis().is_some_and(|axis| self.learnt(axis).is_none());
            let why_not = if absent { NotReached::NoSuchAxis } else { NotReached::TooLittleMotion };
            MonitorVerdict { code, passed: passed_s.ok_or(why_not) }
        };
        Some(FaultCode::ALL.iter().zip(passed).map(verdict).collect())
    }

    /// Returns how `fault` is found in the sessions.
    fn faulty(
        &self,
        cycle: &DriveCycle,
        fault: TriedFault,
        spread: f64,
        n_judged: &mut u64,
    ) -> FaultVerdict {
        let mut verdict = FaultVerdict { fault, after_s: Some(0.0), beside: None };
        for variant in Variant::all(spread) {
            let outcome = run(&self.setup, cycle, variant, Some(fault));
            *n_judged += outcome.n_judged;
            let named = outcome.confirmed.and_then(|(at_s, transition)| {
                let rivals = &transition.suspicion.candidates;
                let others = || rivals.iter().map(|c| c.code).filter(|&code| code != fault.code());
                // No motion of the plate tells a ball that stands from servos without power.
                let has_both =
                    Axis::ALL.iter().all(|&a| others().any(|c| c == FaultCode::servo(a)));
                let beside = others().next().filter(|_| !has_both);
                let named = |c: &Candidate| (c.code, c.kind) == (fault.code(), fault.kind());
                let own = transition.code == fault.code() || rivals.iter().any(named);
                let in_time = at_s <= IN_TIME * cycle.duration_s;
                (own && in_time).then_some((at_s, beside))
            });
            verdict.after_s = verdict.after_s.zip(named).map(|(most, (at_s, _))| most.max(at_s));
            verdict.beside = verdict.beside.or(named.and_then(|(_, beside)| beside));
            if verdict.after_s.is_none() {
                return FaultVerdict { beside: None, ..verdict };
            }
        }
        verdict
    }
}
