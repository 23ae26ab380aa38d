//! The search for the cycle of one rig: the shortest member of the family in which
//! the trials go best. All of it in the plate's frame.

use super::motion::Motion;
use super::trial::{Variant, run};
use super::{DriveCycle, FaultVerdict, MonitorVerdict, NoDriveCycle, NotReached, TriedFault};
use crate::diagnosis::{AxisCalibration, Candidate};
use crate::engine::{AxisMapping, Rig, Setup};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::plant::PlateShape;
use crate::vocabulary::{Axis, FaultCode, PerAxis};

/// Most samples of a trial a second: a rig that logs faster is judged the better.
const MAX_TRIED_HZ: f64 = 120.0;
/// Samples that are judged in the search; then the best found so far is taken. A
/// few seconds of one core.
const MAX_JUDGED: u64 = 3_000_000;
/// Room that is left between the set points and where the edge may act, m.
pub(super) const MARGIN_M: f64 = 0.005;
/// Share of the servos' limit that the cycle commands beforehand; the rest is for
/// the correction.
pub(super) const COMMANDED: f64 = 0.8;
/// Tilts of the learnt breakaway that the ball's largest acceleration takes at
/// least: from there on the monitors take it as asked to move.
const LEAST_BREAKAWAYS: f64 = 1.5;
/// Share of the cycle in which a trial must have found a fault: a rig is not quite
/// its twin.
pub(super) const IN_TIME: f64 = 0.85;
/// What is missing where a monitor does not pass; where a fault is not found; where
/// another cause is named beside it; and where a servo that answers half is not found,
/// which is harder than anything else, and worth less of a person's time.
const MONITOR_WEIGHT: usize = 10_000;
const FAULT_WEIGHT: usize = 100;
const BESIDE_WEIGHT: usize = 10;
const HALF_WEIGHT: usize = 1;
/// Shares of the level's spread between sessions that are tried one after the other.
/// What a rig's sessions differ by is assumed large before it has several, and may be
/// more than a small plate can bear.
const SPREADS: [f64; 3] = [1.0, 0.5, 0.25];

/// What the trials of one motion came to.
#[derive(Clone, Debug)]
pub(super) struct Found {
    pub monitors: Vec<MonitorVerdict>,
    pub faults: Vec<FaultVerdict>,
}

impl Found {
    /// How much is missing; zero where everything is found.
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

/// The best motion, the share of the level's spread that it was tried with, and what
/// its trials came to.
pub(super) struct Best {
    pub motion: Motion,
    pub spread: f64,
    pub found: Found,
}

/// The search for the cycle of one rig; all in the plate's frame.
pub(super) struct Search {
    pub setup: Setup,
}

impl Search {
    pub(super) fn new(rig: &Rig) -> Result<Self, NoDriveCycle> {
        let plain = Rig {
            mapping: AxisMapping::default(),
            sample_rate_hz: rig.sample_rate_hz.min(MAX_TRIED_HZ),
            ..rig.clone()
        };
        let setup = Setup::new(plain, None)?;
        let search = Self { setup };
        let learnt = Axis::ALL.into_iter().any(|axis| search.learnt(axis).is_some());
        if learnt { Ok(search) } else { Err(NoDriveCycle::NotLearnt) }
    }

    pub(super) fn learnt(&self, axis: Axis) -> Option<&AxisCalibration> {
        self.setup.rig.calibration.as_ref()?.axes[axis].as_ref()
    }

    /// The motions that may serve, the shortest first.
    pub(super) fn family(&self) -> Result<Vec<Motion>, NoDriveCycle> {
        let rig = &self.setup.rig;
        let room_m = |axis| rig.plate.half_extent_m(axis) - rig.contact_room_m() - MARGIN_M;
        let axes = || Axis::ALL.into_iter().filter(|&axis| self.learnt(axis).is_some());
        if let Some(axis) = axes().find(|&axis| room_m(axis) <= 0.0) {
            return Err(NoDriveCycle::NoRoom { axis, room_m: room_m(axis).max(0.0) });
        }
        let rooms = PerAxis::from_fn(|axis| self.learnt(axis).map(|_| room_m(axis)));
        let round = matches!(rig.plate.shape(), PlateShape::Round { .. });
        let mut family = Motion::family(rooms, round);
        family.retain(|motion| axes().all(|axis| self.serves(motion, axis)));
        if family.is_empty() { Err(NoDriveCycle::TooLittleTilt) } else { Ok(family) }
    }

    /// Whether `motion` is within the servos' limits and beyond friction.
    fn serves(&self, motion: &Motion, axis: Axis) -> bool {
        let Some(learnt) = self.learnt(axis) else { return true };
        let tilt_rad = self.tilt_rad(motion, axis);
        let most_rad = COMMANDED * self.setup.rig.servo.angle_limit_rad - learnt.level_rad.abs();
        (LEAST_BREAKAWAYS * learnt.breakaway_rad..=most_rad).contains(&tilt_rad)
    }

    /// Largest tilt that `motion` takes beside the level, rad.
    pub(super) fn tilt_rad(&self, motion: &Motion, axis: Axis) -> f64 {
        motion.peak_m_s2(axis) / self.slope_m_s2(axis).abs()
    }

    /// Acceleration along `axis` per radian of its servo, m/s²; signed.
    pub(super) fn slope_m_s2(&self, axis: Axis) -> f64 {
        let gain = self.setup.twin.axes[axis].gain;
        axis.drive_sign() * gain * self.setup.rig.ball.rolling_gravity()
    }

    /// The best of `family`: of equally good ones the one that bears most, then the
    /// shortest. None where no member keeps a healthy ball on the plate and its tests
    /// from failing.
    pub(super) fn best(&self, family: &[Motion]) -> Option<Best> {
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

    /// What the trials of `motion` come to; none where they miss as much as
    /// `below`, or a healthy one goes wrong.
    pub(super) fn try_out(
        &self,
        motion: &Motion,
        spread: f64,
        below: usize,
        n_judged: &mut u64,
    ) -> Option<Found> {
        let cycle = self.cycle(motion, &AxisMapping::default());
        let monitors = self.healthy(&cycle, spread, n_judged)?;
        let mut found = Found { monitors, faults: Vec::new() };
        for fault in TriedFault::of(cycle.axes()) {
            if found.missing() >= below {
                return None;
            }
            found.faults.push(self.faulty(&cycle, fault, spread, n_judged));
        }
        (found.missing() < below).then_some(found)
    }

    /// When each monitor passes in every session; none where one goes wrong.
    fn healthy(
        &self,
        cycle: &DriveCycle,
        spread: f64,
        n_judged: &mut u64,
    ) -> Option<Vec<MonitorVerdict>> {
        let mut passed = [Some(0.0_f64); FaultCode::COUNT];
        for variant in Variant::all(spread) {
            let ran = run(&self.setup, cycle, variant, None);
            *n_judged += ran.n_judged;
            if ran.at_edge || ran.failed {
                return None;
            }
            for (all, this) in passed.iter_mut().zip(ran.passed_s) {
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

    /// How `fault` is found in every session.
    fn faulty(
        &self,
        cycle: &DriveCycle,
        fault: TriedFault,
        spread: f64,
        n_judged: &mut u64,
    ) -> FaultVerdict {
        let mut verdict = FaultVerdict { fault, after_s: Some(0.0), beside: None };
        for variant in Variant::all(spread) {
            let ran = run(&self.setup, cycle, variant, Some(fault));
            *n_judged += ran.n_judged;
            let named = ran.confirmed.and_then(|(at_s, transition)| {
                let rivals = &transition.suspicion.candidates;
                let beside = rivals.iter().map(|c| c.code).find(|&code| code != fault.code());
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
