//! The monitors: evidence of one moment in, one test result per fault code out.
//!
//! The order of the monitors is the isolation: readings that cannot be trusted tell
//! nothing about the ball, and a ball that cannot move tells nothing about the servos. A
//! monitor that cannot judge is *not tested*, never *passed*.

use super::limits::LEAST_REPEAT_S;
use super::stillness::{AxisStillness, Stillness};
use super::{AxisEvidence, Candidate, Evidence, Limits, Profile, SensorLimits, Settings, Test};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{Axis, FaultCode, FaultKind, PerAxis};
use serde::{Deserialize, Serialize};

/// The chapter's enable condition (application 3): least command, rad.
const TEXTBOOK_ENABLE_RAD: f64 = 0.08;
/// The chapter's enable condition (application 3): least measured acceleration, m/s².
const TEXTBOOK_ENABLE_M_S2: f64 = 0.5;

/// Duration of identical readings, s, that no working sensor shows while the ball is
/// asked to move: longer than any refresh seen (0.2 s).
const FROZEN_S: f64 = LEAST_REPEAT_S;

/// Identical readings for less than this, s, show that the readings of an axis are alive.
/// Chosen: half of [`FROZEN_S`].
const LIVE_S: f64 = FROZEN_S / 2.0;

/// Distance, in standard deviations of a reading, by which the ball must have moved on at
/// its last velocity for identical readings to count as frozen. Chosen.
const MISSED_DEVIATIONS: f64 = 20.0;

/// Deceleration of a rolling ball that nothing drives, m/s². Assumed: the effect of half
/// a degree of tilt. Without it the sensor of a simulated rig that holds its value at
/// rest was called frozen 37 times an hour, with it never.
const ROLLS_OUT_M_S2: f64 = 0.05;

/// Apparent motion of a ball at rest, in standard deviations of a reading. Chosen.
const STILL_FACTOR: f64 = 6.0;

/// Time within which a ball that is asked to move must have begun to move, s. Chosen.
const PRESSED_S: f64 = 0.3;
/// Distance that a ball at rest must have been asked to roll, in widths of the still
/// range. A ball that turns round stays within one width for as long as one at rest takes
/// for up to (1 + √2)² = 5.8 widths, and mostly for fewer. With more than four, the drive
/// cycle of a rig with coarse readings would give no result for its ball.
const TURNING_WIDTHS: f64 = 4.0;

/// Fraction of samples without a ball from which on the sensor fails. Chosen: most of
/// them are missing.
const MISSING_SHARE: f64 = 0.5;

/// Ratio of scatter to healthy scatter above which readings count as noisy, if they also
/// exceed the scatter that healthy readings have shown for a while
/// ([`SensorLimits::scatter_m`]). Chosen.
const NOISE_RATIO: f64 = 3.5;

/// Weight of a dead servo as the cause of a ball that stands, as long as nothing
/// distinguishes the two. Chosen, not measured: a dead servo is the rarer cause.
const SERVO_SHARE: f64 = 0.4;
/// Weight of both servos as the cause of a ball that stands although both ask it to move, as by
/// their supply, if the servos have not passed their tests in this session or the ball has got into a
/// corner. Chosen, not measured: a rig without power is as likely as a ball that is held.
const SERVOS_SHARE: f64 = 0.5;
/// Time for which the plate must have pulled a ball off its rims before the ball counts as standing
/// there, s. Chosen: it would have rolled several centimetres.
const OFF_RIM_S: f64 = 1.0;
/// Weight of a stuck ball as the cause of identical readings, as long as nothing
/// distinguishes the two. Chosen, not measured: a stuck ball is the rarer cause.
const STUCK_SHARE: f64 = 0.3;

/// Evidence against both servos at the same time from which on a common cause is blamed,
/// nats. Chosen: below what suspects a single servo (10).
const SHARED_NATS: f64 = 9.0;
/// Evidence against both servos from which on both have failed, as by a common supply, if
/// neither ball nor sensor explain it, nats. Chosen: below the most that is accumulated
/// (40).
const BOTH_NATS: f64 = 30.0;
/// Evidence of the path that must support other evidence against a servo where the twin
/// fits badly, nats. Chosen: it speaks for a fault, however little. Without it, servos of simulated
/// rigs were accused in sessions in which everything fits worse.
const SUPPORTING_NATS: f64 = 1.0;
/// Evidence against a servo that must support that of the path, nats: the path alone also accuses
/// healthy servos. Chosen on 47 simulated rigs with the properties of real ones, watched for 94 h:
/// with 1, 3, 4 and 5 nats there were 41, 11, 3 and 3 false alarms of servos, and 277, 272, 272 and
/// 267 of 522 faults were found.
const PATH_SUPPORT_NATS: f64 = 4.0;
/// Highest evidence against a servo while the recent path contradicts it, as a fraction of the
/// evidence at which the servo is suspected. Chosen: just below 1.
const DOUBTED_SHARE: f64 = 0.99;
/// Speed below which a ball counts as held back, m/s. Chosen on simulated sessions of three rigs, 72
/// with a ball that rolls sluggishly and 144 in which both servos fail: with 0.01 m/s, 52 of the 72
/// balls are blamed first, and in 23 of the 144 sessions the ball is, with 0.03 m/s 55 and 40.
const HELD_BACK_M_S: f64 = 0.01;

/// The circumstances that the monitors consider besides the evidence.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings {
    /// Time for which the ball has been clear of the edge, s.
    pub clear_s: f64,
    /// Whether the ball was last seen at the edge.
    pub at_edge: bool,
    /// The axis whose rim the ball lies at; `None` in a corner, at the rim of a round plate and away
    /// from rims.
    pub rim: Option<Axis>,
    /// Time for which the ball has lain there, s.
    pub rim_s: f64,
    /// Time for which the plate has been taking the ball off every rim that it is at, s.
    pub off_rim_s: f64,
    /// Whether the ball was last seen at an edge without a rim: it is falling.
    pub over_the_edge: bool,
    /// Whether the readings have recently jumped farther than a ball can move.
    pub jumped: bool,
    /// Scatter above which readings count as noisy, m.
    pub noisy_m: f64,
    /// Whether the tests of both servos have had a result in this session, of which the last is a pass.
    pub servos_have_passed: bool,
    /// Whether a fault of a servo that was found in this session goes on.
    pub has_broken_servo: bool,
}

/// The result of one monitor at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Finding {
    pub test: Test,
    /// Evidence for a fault of this servo, nats; `None` for the other monitors and while
    /// the servos cannot be judged.
    pub nats: Option<f64>,
    /// Whether the ball has left the plate: no more evidence can follow, and a failed
    /// test needs none.
    pub gone: bool,
    pub kind: Option<FaultKind>,
    /// Another cause with the same symptoms.
    pub rival: Option<Rival>,
}

/// A part of the rig that explains the same symptoms as a monitor's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RivalPart {
    StuckBall,
    /// A dead servo.
    Servo(Axis),
    /// Both servos, dead by a common cause.
    BothServos,
}

/// Another cause with the same symptoms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rival {
    pub part: RivalPart,
    /// Its weight beside the monitor's own cause, in (0, 1).
    pub weight: f64,
}

impl Rival {
    /// Returns the causes, whose weights sum to that of the rival.
    pub fn candidates(self) -> impl Iterator<Item = Candidate> {
        let dead = Some(FaultKind::Dead);
        let parts = match self.part {
            RivalPart::StuckBall => [Some((FaultCode::StuckBall, None)), None],
            RivalPart::Servo(axis) => [Some((FaultCode::servo(axis), dead)), None],
            RivalPart::BothServos => Axis::ALL.map(|axis| Some((FaultCode::servo(axis), dead))),
        };
        let n = parts.iter().flatten().count() as f64;
        let weighed = move |(code, kind)| Candidate { code, kind, weight: self.weight / n };
        parts.into_iter().flatten().map(weighed)
    }
}

/// A limit of the readings that is learnt from healthy sessions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LearntLimit {
    Repeat,
    Unseen,
    Outliers,
    Scatter,
}

impl LearntLimit {
    /// Returns the limit that readings with a fault of `kind` exceed; `None` if it has none.
    #[must_use]
    pub const fn of(kind: FaultKind) -> Option<Self> {
        match kind {
            FaultKind::Frozen => Some(Self::Repeat),
            FaultKind::Dropout => Some(Self::Unseen),
            FaultKind::Spikes => Some(Self::Outliers),
            FaultKind::Noise => Some(Self::Scatter),
            // A jump is left out of the data; the others are not faults of the readings.
            FaultKind::Jump
            | FaultKind::Dead
            | FaultKind::Held
            | FaultKind::Gain
            | FaultKind::Reversed
            | FaultKind::Offset
            | FaultKind::Slow
            | FaultKind::Intermittent => None,
        }
    }
}

impl Finding {
    const NOTHING: Self =
        Self { test: Test::NotTested, nats: None, gone: false, kind: None, rival: None };
    const PASS: Self = Self { test: Test::Prepassed, ..Self::NOTHING };

    /// Returns this finding if it is a failure, else `other` if there is one.
    fn or(self, other: Option<Self>) -> Self {
        if self.test == Test::Prefailed { self } else { other.unwrap_or(self) }
    }

    const fn fail(kind: Option<FaultKind>) -> Self {
        Self { test: Test::Prefailed, kind, ..Self::NOTHING }
    }
}

/// The monitors of one rig.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Evaluator {
    profile: Profile,
    limits: PerAxis<Limits>,
    sensor: SensorLimits,
    /// Evidence that makes each servo suspected, nats. From there on a dead servo
    /// explains why a ball stands that only this servo asked to move.
    suspect_nats: PerAxis<f64>,
    /// Whether that evidence is raised because some was found against the healthy servo:
    /// the twin fits badly.
    fits_badly: PerAxis<bool>,
}

impl Evaluator {
    /// Builds the monitors with these limits and the evidence that [`Settings`] require.
    #[must_use]
    pub fn new(profile: Profile, limits: PerAxis<Limits>, sensor: SensorLimits) -> Self {
        let suspect_nats = PerAxis::from_fn(|_| Settings::of(profile).suspect_nats);
        let fits_badly = PerAxis::from_fn(|_| false);
        Self { profile, limits, sensor, suspect_nats, fits_badly }
    }

    /// Sets the evidence that makes a servo suspected: `suspect_nats` times the `factor`
    /// of its axis, ≥ 1.
    #[must_use]
    pub fn with_suspicion(self, suspect_nats: f64, factor: PerAxis<f64>) -> Self {
        let fits_badly = PerAxis::from_fn(|axis| factor[axis] > 1.0);
        let suspect_nats = PerAxis::from_fn(|axis| factor[axis] * suspect_nats);
        Self { suspect_nats, fits_badly, ..self }
    }

    /// Multiplies the limits and the evidence of each servo by a factor.
    #[must_use]
    pub fn with_factor(self, factor: PerAxis<f64>) -> Self {
        let limits = PerAxis::from_fn(|axis| self.limits[axis].times(factor[axis]));
        let suspect_nats = PerAxis::from_fn(|axis| factor[axis] * self.suspect_nats[axis]);
        Self { limits, suspect_nats, ..self }
    }

    /// The limits in force.
    #[must_use]
    pub const fn limits(&self) -> &PerAxis<Limits> {
        &self.limits
    }

    /// Whether the residual of `axis` may be judged (the enable condition). `pull_m_s2`
    /// is the least acceleration that the plate demands of the ball, m/s².
    #[must_use]
    pub fn enabled(
        &self,
        axis: Axis,
        e: &AxisEvidence,
        window_s: f64,
        pull_m_s2: f64,
        readings: &Stillness,
        around: &Surroundings,
    ) -> bool {
        let (Some(measured), Some(_), Some(command)) =
            (e.measured_m_s2, e.twin_m_s2, e.command_rad)
        else {
            return false;
        };
        if self.profile == Profile::Textbook {
            return command.abs() >= TEXTBOOK_ENABLE_RAD || measured.abs() >= TEXTBOOK_ENABLE_M_S2;
        }
        let resting = readings.axes[axis].still_s > PRESSED_S
            && pull_m_s2 < self.limits[axis].pressing_m_s2();
        let clear = around.clear_s >= window_s;
        let testable = clear || pinned(axis, e, window_s, readings, around);
        testable && readings.unseen_s == 0.0 && !resting
    }

    /// Returns the findings of all monitors, in the order of [`FaultCode::ALL`].
    #[must_use]
    pub fn evaluate(
        &self,
        evidence: &Evidence,
        readings: &Stillness,
        around: &Surroundings,
    ) -> [Finding; FaultCode::COUNT] {
        if self.profile == Profile::Textbook {
            let servo = |axis| textbook(axis, evidence);
            return [servo(Axis::X), servo(Axis::Y), Finding::default(), Finding::default()];
        }
        let sensor = self.sensor(evidence, readings, around);
        let stuck = match sensor.test {
            Test::Prefailed => Finding::default(),
            _ => self.stuck_ball(evidence, readings, around).or(held_back(evidence, around)),
        };
        // Until the ball has moved, only its own monitor tells what holds it; at an edge the servos' do.
        let has_never_moved = !readings.has_moved && !around.at_edge;
        let blind = has_never_moved || [sensor, stuck].iter().any(|f| f.test == Test::Prefailed);
        let servo = |axis| match blind {
            true => Finding { gone: around.over_the_edge, ..Finding::NOTHING },
            false => self.believed(axis, evidence, servo(axis, evidence, around)),
        };
        [servo(Axis::X), servo(Axis::Y), stuck, sensor]
    }

    /// Returns `finding`, or what remains of it if the twin fits badly and the path
    /// contradicts it: evidence that does not suspect the servo, and no failure.
    fn believed(&self, axis: Axis, evidence: &Evidence, finding: Finding) -> Finding {
        let contradicted = evidence.axes[axis].path_nats.is_some_and(|nats| nats < SUPPORTING_NATS);
        if !(self.fits_badly[axis] && contradicted) {
            return finding;
        }
        let most = DOUBTED_SHARE * self.suspect_nats[axis];
        let test = match finding.test {
            Test::Prefailed => Test::NotTested,
            test => test,
        };
        Finding { test, nats: finding.nats.map(|nats| nats.min(most)), ..finding }
    }

    /// Returns the scatter above which readings count as noisy, m, where healthy ones
    /// blur by `blur_m` because the ball moves.
    #[must_use]
    pub fn noisy_m(&self, blur_m: f64) -> f64 {
        let noise_m = self.noise_m();
        (NOISE_RATIO * noise_m.hypot(blur_m)).max(self.sensor.scatter_m)
    }

    /// Returns how far a ball at rest may seem to move, m.
    #[must_use]
    pub fn still_m(&self) -> f64 {
        STILL_FACTOR * self.noise_m()
    }

    /// Standard deviation of healthy readings, the larger of both axes, m.
    #[must_use]
    pub fn noise_m(&self) -> f64 {
        let of = |axis: Axis| self.limits[axis].noise_m;
        Axis::ALL.into_iter().filter_map(of).fold(0.0, f64::max)
    }

    fn sensor(&self, evidence: &Evidence, readings: &Stillness, around: &Surroundings) -> Finding {
        if readings.unseen_s >= self.sensor.unseen_s || readings.missing >= MISSING_SHARE {
            return match around.at_edge {
                true => Finding::default(),
                false => Finding::fail(Some(FaultKind::Dropout)),
            };
        }
        if readings.unseen_s > 0.0 || !readings.has_positions {
            return Finding::default();
        }
        if around.jumped {
            return Finding::fail(Some(FaultKind::Jump));
        }
        if readings.outliers() >= self.sensor.outliers {
            return Finding::fail(Some(FaultKind::Spikes));
        }
        // The path of a bounce off the rim is not a parabola.
        let rolls = around.clear_s >= evidence.window_s;
        if rolls && evidence.scatter_m.is_some_and(|s| s > around.noisy_m) {
            return Finding::fail(Some(FaultKind::Noise));
        }
        self.frozen(readings, around).unwrap_or(Finding::PASS)
    }

    /// Bit-identical readings although the ball is asked to move or did move, or for
    /// longer than healthy readings of a ball at rest. A rim holds the ball across itself, hardly
    /// along itself.
    fn frozen(&self, readings: &Stillness, around: &Surroundings) -> Option<Finding> {
        let axes = &readings.axes;
        let seen = |axis: Axis| axes[axis].seen();
        let free = |axis: Axis| !around.at_edge || around.rim == Some(axis.other());
        let dead = |axis: Axis| seen(axis) && free(axis) && self.dead(axis, &axes[axis]);
        let any = |of: &dyn Fn(Axis) -> bool| Axis::ALL.into_iter().any(of);
        let both =
            Axis::ALL.into_iter().filter(|&a| seen(a)).all(|a| axes[a].identical_s >= FROZEN_S);
        if both && !around.at_edge && any(&dead) {
            let moved = any(&|a| self.missed(a, &axes[a]));
            let stuck = Rival { part: RivalPart::StuckBall, weight: STUCK_SHARE };
            let rival = (!moved).then_some(stuck);
            return Some(Finding { rival, ..Finding::fail(Some(FaultKind::Frozen)) });
        }
        let alone = |axis: Axis| dead(axis) && axes[axis.other()].identical_s < LIVE_S;
        any(&alone).then(|| Finding::fail(Some(FaultKind::Frozen)))
    }

    /// Whether a ball that moved when its readings last changed must have moved on.
    fn missed(&self, axis: Axis, still: &AxisStillness) -> bool {
        let stops_m_s2 = ROLLS_OUT_M_S2.max(self.limits[axis].rolls_out_m_s2);
        still.missed_m(stops_m_s2) > MISSED_DEVIATIONS * self.noise_m()
    }

    /// Whether readings of `axis` have been identical for longer than those of a working
    /// sensor are.
    fn dead(&self, axis: Axis, still: &AxisStillness) -> bool {
        let limits = &self.limits[axis];
        let asked = still.pressed_s >= FROZEN_S || self.missed(axis, still);
        let resting = self.rest_repeat_s().is_some_and(|s| still.identical_s >= s);
        resting || asked && still.identical_s >= limits.repeat_s
    }

    /// Longest time for which readings of a ball at rest may be identical, s; the longer
    /// of both axes, which are read together. `None` if unknown for a measured axis.
    fn rest_repeat_s(&self) -> Option<f64> {
        let measured = Axis::ALL.into_iter().filter(|&a| self.limits[a].noise_m.is_some());
        measured.map(|a| self.limits[a].rest_repeat_s).try_fold(0.0, |most, s| Some(s?.max(most)))
    }

    /// A ball that stands still although it is asked to move. If it is asked along one
    /// axis only, a dead servo of that axis is a rival cause; evidence from before the
    /// ball stood decides. If it is asked along both axes, both servos without power are a rival
    /// cause, unless they have passed their tests or one is known to be broken. In a corner, or at the rim of a disc, the
    /// ball counts as asked only while the plate pulls it off every rim.
    fn stuck_ball(
        &self,
        evidence: &Evidence,
        readings: &Stillness,
        around: &Surroundings,
    ) -> Finding {
        let pressed = |axis: Axis| {
            let still = &readings.axes[axis];
            still.pressed_s >= PRESSED_S && still.asked_widths >= TURNING_WIDTHS
        };
        if readings.unseen_s > 0.0 || !readings.has_positions {
            return Finding::default();
        }
        if around.at_edge {
            // Of a ball at the rim across one axis, the servo of this axis is blamed: see `pinned`.
            let cornered = around.rim.is_none() && !around.has_broken_servo;
            let leaves = around.off_rim_s >= OFF_RIM_S && Axis::ALL.into_iter().all(pressed);
            let stands = readings.still_s() >= PRESSED_S;
            let alive = Axis::ALL.into_iter().any(|a| !self.dead(a, &readings.axes[a]));
            return match cornered && leaves && stands && alive {
                true => stuck_or_servos(),
                false => Finding::default(),
            };
        }
        match (pressed(Axis::X), pressed(Axis::Y)) {
            _ if readings.still_s() < PRESSED_S => Finding::PASS,
            (true, true) if around.servos_have_passed || around.has_broken_servo => {
                Finding::fail(None)
            }
            (true, true) => stuck_or_servos(),
            (false, false) => Finding::default(),
            (true, false) => self.stuck_or_servo(Axis::X, evidence),
            (false, true) => self.stuck_or_servo(Axis::Y, evidence),
        }
    }

    /// A ball that stands although it is asked to move along `axis` only. The weight of
    /// the servo as the cause rises linearly with the evidence against it. From the
    /// evidence on that makes it suspected, the servo alone explains why the ball stands.
    fn stuck_or_servo(&self, axis: Axis, evidence: &Evidence) -> Finding {
        let share = (evidence.axes[axis].nats / self.suspect_nats[axis]).max(0.0);
        if share >= 1.0 {
            return Finding::default();
        }
        let weight = SERVO_SHARE + (1.0 - SERVO_SHARE) * share;
        let servo = Rival { part: RivalPart::Servo(axis), weight };
        Finding { rival: Some(servo), ..Finding::fail(None) }
    }
}

/// The finding for one servo, from its residual, path and evidence. Two servos do not
/// fail in the same second: evidence against both counts against neither, unless there is
/// too much of it for any other cause.
fn servo(axis: Axis, evidence: &Evidence, around: &Surroundings) -> Finding {
    let (e, other) = (&evidence.axes[axis], &evidence.axes[axis.other()]);
    let nats = if other.nats < BOTH_NATS { (e.nats - other.nats).max(0.0) } else { e.nats };
    let off_path = |e: &AxisEvidence| e.is_off_path() && e.nats >= PATH_SUPPORT_NATS;
    let fails = |e: &AxisEvidence| e.violates() || off_path(e);
    let test = match fails(e) {
        true if fails(other) && e.nats.min(other.nats) < BOTH_NATS => Test::NotTested,
        true => Test::Prefailed,
        // At the rim, agreement proves nothing: the rim may hold the ball.
        false if e.enabled && !around.at_edge => Test::Prepassed,
        false => Test::NotTested,
    };
    let kind = e.answer.and_then(|answer| answer.kind());
    Finding { test, nats: Some(nats), kind, gone: around.over_the_edge, ..Finding::NOTHING }
}

/// Whether a ball at the rim stays there although it should leave. A rim only pushes
/// inward, so it can only explain an inward residual; an outward one is due to the servo,
/// as long as the readings are alive.
fn pinned(
    axis: Axis,
    e: &AxisEvidence,
    window_s: f64,
    readings: &Stillness,
    around: &Surroundings,
) -> bool {
    let outward =
        e.residual_m_s2().zip(e.position_m).is_some_and(|(residual, at)| residual * at > 0.0);
    let alive = readings.axes[axis].identical_s < FROZEN_S;
    around.rim == Some(axis) && around.rim_s >= window_s && outward && alive
}

/// A ball that stands although both servos ask it to move.
fn stuck_or_servos() -> Finding {
    let servos = Rival { part: RivalPart::BothServos, weight: SERVOS_SHARE };
    Finding { rival: Some(servos), ..Finding::fail(None) }
}

/// The chapter's rule: enabled, and a residual of at least 0.01 m/s².
fn textbook(axis: Axis, evidence: &Evidence) -> Finding {
    let e = &evidence.axes[axis];
    match (e.enabled, e.violates()) {
        (false, _) => Finding::default(),
        (true, true) => Finding::fail(None),
        (true, false) => Finding::PASS,
    }
}

/// The ball hardly moves and answers neither servo, of which none is known to be broken.
fn held_back(evidence: &Evidence, around: &Surroundings) -> Option<Finding> {
    let PerAxis { x, y } = &evidence.axes;
    let slow = |e: &AxisEvidence| e.velocity_m_s.is_some_and(|v| v.abs() < HELD_BACK_M_S);
    let shared = x.nats.min(y.nats) >= SHARED_NATS;
    (shared && !around.at_edge && !around.has_broken_servo && slow(x) && slow(y))
        .then(|| Finding { nats: Some(x.nats + y.nats), ..Finding::fail(None) })
}

#[cfg(test)]
mod tests {
    use super::super::stillness::Reading;
    use super::*;

    /// A ball clear of the edge, with unlimited scatter.
    const CLEAR: Surroundings = Surroundings {
        clear_s: 1.0,
        at_edge: false,
        rim: None,
        rim_s: 0.0,
        off_rim_s: 0.0,
        over_the_edge: false,
        jumped: false,
        noisy_m: 1.0,
        servos_have_passed: true,
        has_broken_servo: false,
    };

    /// The result for a ball at the rim at +x while the twin accelerates by `twin`, m/s².
    fn at_the_rim(twin: f64, identical_s: f64) -> Test {
        let evaluator = Evaluator::new(
            Profile::Default,
            PerAxis::from_fn(|_| Limits::new(Profile::Default, None, false, 7.0)),
            SensorLimits::new(None),
        );
        let mut readings = Stillness::default();
        readings.axes.x.identical_s = identical_s;
        let around =
            Surroundings { clear_s: 0.0, at_edge: true, rim: Some(Axis::X), rim_s: 1.0, ..CLEAR };
        let mut x = AxisEvidence {
            command_rad: Some(0.1),
            position_m: Some(0.17),
            measured_m_s2: Some(0.0),
            twin_m_s2: Some(twin),
            limit_m_s2: 0.3,
            ..AxisEvidence::default()
        };
        x.enabled = evaluator.enabled(Axis::X, &x, 0.5, twin.abs(), &readings, &around);
        let evidence =
            Evidence { axes: PerAxis { x, y: AxisEvidence::default() }, ..Evidence::default() };
        servo(Axis::X, &evidence, &around).test
    }

    /// A ball that stands in the middle and is asked to move along x only, by a servo
    /// with evidence `nats` against it, which is suspected from `suspect_nats` on.
    fn standing(nats: f64, suspect_nats: f64) -> Finding {
        let reading = Reading {
            dt: 0.5,
            position_m: PerAxis { x: Some(0.0), y: Some(0.0) },
            asked_m_s2: PerAxis { x: 1.0, y: 0.0 },
            still_m: 1e-3,
            refused: false,
            outliers: 0,
        };
        let mut readings = Stillness::default();
        (0..3).for_each(|_| readings.update(&reading));
        let x = AxisEvidence { nats, ..AxisEvidence::default() };
        let evidence =
            Evidence { axes: PerAxis { x, y: AxisEvidence::default() }, ..Evidence::default() };
        let wide = Limits::new(Profile::Default, None, false, 7.0);
        let evaluator =
            Evaluator::new(Profile::Default, PerAxis::from_fn(|_| wide), SensorLimits::new(None));
        let evaluator = evaluator.with_suspicion(suspect_nats, PerAxis::from_fn(|_| 1.0));
        evaluator.stuck_ball(&evidence, &readings, &CLEAR)
    }

    /// A ball that stands although both servos ask it to move is stuck, if they have passed their tests;
    /// else, and in a corner that the plate takes it out of, it may be the servos.
    #[test]
    fn a_ball_that_stands_may_be_due_to_both_servos() {
        let found = |off_rim_s: f64, around: Surroundings, frozen: bool| {
            let around = Surroundings { off_rim_s, ..around };
            let mut readings = Stillness::default();
            for i in 0..8 {
                let position_m = if frozen { 0.0 } else { 1e-6 * f64::from(i) };
                readings.update(&Reading {
                    dt: 0.5,
                    position_m: PerAxis { x: Some(position_m), y: Some(position_m) },
                    asked_m_s2: PerAxis { x: 1.0, y: 1.0 },
                    still_m: 1e-3,
                    refused: false,
                    outliers: 0,
                });
            }
            let wide = PerAxis::from_fn(|_| Limits::new(Profile::Default, None, false, 7.0));
            let evaluator = Evaluator::new(Profile::Default, wide, SensorLimits::new(None));
            let found = evaluator.stuck_ball(&Evidence::default(), &readings, &around);
            (found.test, found.rival.map(|rival| rival.part))
        };
        let stands = |off_rim_s: f64, around: Surroundings| found(off_rim_s, around, false);
        let both = (Test::Prefailed, Some(RivalPart::BothServos));
        let nothing = (Test::NotTested, None);
        assert_eq!(stands(0.0, CLEAR), (Test::Prefailed, None));
        assert_eq!(stands(0.0, Surroundings { servos_have_passed: false, ..CLEAR }), both);
        let corner = Surroundings { clear_s: 0.0, at_edge: true, ..CLEAR };
        assert_eq!(stands(1.1, corner), both);
        assert_eq!(stands(0.9, corner), nothing, "the rims may have held it until now");
        assert_eq!(stands(1.1, Surroundings { rim: Some(Axis::X), ..corner }), nothing);
        assert_eq!(found(1.1, corner, true), nothing, "the readings may be frozen");
        assert_eq!(stands(1.1, Surroundings { has_broken_servo: true, ..corner }), nothing);
        let broken = Surroundings { servos_have_passed: false, has_broken_servo: true, ..CLEAR };
        assert_eq!(stands(0.0, broken), (Test::Prefailed, None), "that servo is known");
    }

    /// A ball that rolls on, or whose servo is known to be broken, is not held back.
    #[test]
    fn a_ball_that_hardly_moves_is_held_back() {
        let held = |velocity_m_s: f64, has_broken_servo: bool| {
            let e = AxisEvidence {
                velocity_m_s: Some(velocity_m_s),
                nats: SHARED_NATS,
                ..AxisEvidence::default()
            };
            let axes = PerAxis { x: e, y: e };
            let around = Surroundings { has_broken_servo, ..CLEAR };
            held_back(&Evidence { axes, ..Evidence::default() }, &around).is_some()
        };
        assert!(held(0.005, false));
        assert!(!held(0.02, false), "it rolls");
        assert!(!held(0.005, true), "the servo explains it");
    }

    /// A path that deviates from the twin's accuses its servo if other evidence supports it and
    /// the other axis agrees with the twin; a deviation of both has a common cause.
    #[test]
    fn a_path_off_the_twins_accuses_its_servo_alone() {
        let bent = |path_nats: f64, nats: f64| AxisEvidence {
            path_nats: Some(path_nats),
            path_limit_nats: Some(5.0),
            nats,
            ..AxisEvidence::default()
        };
        let test = |x: f64, y: f64, nats: f64| {
            let axes = PerAxis { x: bent(x, nats), y: bent(y, nats) };
            servo(Axis::X, &Evidence { axes, ..Evidence::default() }, &CLEAR).test
        };
        assert_eq!(test(6.0, 1.0, PATH_SUPPORT_NATS), Test::Prefailed);
        assert_eq!(test(6.0, 1.0, PATH_SUPPORT_NATS - 0.1), Test::NotTested);
        assert_eq!(test(4.0, 1.0, PATH_SUPPORT_NATS), Test::NotTested);
        assert_eq!(test(6.0, 6.0, PATH_SUPPORT_NATS), Test::NotTested);
    }

    /// Where the twin fits badly, what is found against a servo counts unless the path says
    /// that the servo is healthy.
    #[test]
    fn evidence_alone_does_not_accuse_where_the_twin_fits_badly() {
        let wide = Limits::new(Profile::Default, None, false, 7.0);
        let believed = |factor: f64, path_nats: Option<f64>| {
            let limits = PerAxis::from_fn(|_| wide);
            let evaluator = Evaluator::new(Profile::Default, limits, SensorLimits::new(None))
                .with_suspicion(10.0, PerAxis::from_fn(|_| factor));
            let x = AxisEvidence { path_nats, ..AxisEvidence::default() };
            let axes = PerAxis { x, y: AxisEvidence::default() };
            let finding = Finding { nats: Some(40.0), ..Finding::fail(None) };
            let evidence = Evidence { axes, ..Evidence::default() };
            let believed = evaluator.believed(Axis::X, &evidence, finding);
            (believed.test, believed.nats.unwrap())
        };
        assert_eq!(believed(1.5, None), (Test::Prefailed, 40.0));
        assert_eq!(believed(1.5, Some(SUPPORTING_NATS)), (Test::Prefailed, 40.0));
        assert_eq!(believed(1.0, Some(-3.0)), (Test::Prefailed, 40.0), "the twin fits");
        let (test, nats) = believed(1.5, Some(-3.0));
        assert_eq!(test, Test::NotTested);
        assert!(nats < 15.0, "less than makes it suspected: {nats}");
    }

    #[test]
    fn a_servo_that_was_suspected_while_the_ball_rolled_explains_why_it_stands() {
        assert_eq!(standing(0.0, 10.0).test, Test::Prefailed);
        assert_eq!(standing(10.0, 10.0).test, Test::NotTested);
    }

    /// The finding of the sensor while the readings of x stay the same, those of y change, and the ball,
    /// at the rim of one axis, is asked to move.
    fn repeating_at(rim: Axis) -> Finding {
        let mut readings = Stillness::default();
        for i in 0..500 {
            let y = if i % 2 == 0 { 0.10 } else { 0.101 };
            readings.update(&Reading {
                dt: 0.01,
                position_m: PerAxis { x: Some(0.0), y: Some(y) },
                asked_m_s2: PerAxis { x: 1.0, y: 1.0 },
                still_m: 2e-3,
                refused: false,
                outliers: 0,
            });
        }
        let wide = Limits::new(Profile::Default, None, false, 7.0);
        let evaluator =
            Evaluator::new(Profile::Default, PerAxis::from_fn(|_| wide), SensorLimits::new(None));
        let around = Surroundings { clear_s: 0.0, at_edge: true, rim: Some(rim), ..CLEAR };
        evaluator.sensor(&Evidence::default(), &readings, &around)
    }

    #[test]
    fn readings_along_a_rim_may_freeze_and_those_across_it_may_rest() {
        let along = repeating_at(Axis::Y);
        assert_eq!((along.test, along.kind), (Test::Prefailed, Some(FaultKind::Frozen)));
        assert_eq!(repeating_at(Axis::X).test, Test::Prepassed);
    }

    /// If the owner requires more evidence, the servo is suspected later.
    #[test]
    fn a_rival_weighs_by_the_evidence_that_is_asked_for() {
        let weight = |nats, suspect| standing(nats, suspect).rival.map_or(1.0, |r| r.weight);
        let found = [(0.0, 10.0), (5.0, 10.0), (5.0, 20.0), (10.0, 20.0), (20.0, 20.0)];
        let wanted = [0.4, 0.7, 0.55, 0.7, 1.0];
        for ((nats, suspect), wanted) in found.into_iter().zip(wanted) {
            let found = weight(nats, suspect);
            assert!((found - wanted).abs() < 1e-12, "{nats} of {suspect}: {found}");
        }
    }

    /// The result for readings that scatter by 2 mm, of a ball clear of the edge that
    /// moves by `blur_m` within the uncertainty of a reading's time.
    fn scattered(noise_m: f64, clear_s: f64, blur_m: f64) -> Test {
        let mut limit = Limits::new(Profile::Default, None, false, 7.0);
        limit.noise_m = Some(noise_m);
        let evaluator =
            Evaluator::new(Profile::Default, PerAxis::from_fn(|_| limit), SensorLimits::new(None));
        let around = Surroundings { clear_s, noisy_m: evaluator.noisy_m(blur_m), ..CLEAR };
        let evidence = Evidence { scatter_m: Some(2e-3), window_s: 0.5, ..Evidence::default() };
        let mut readings = Stillness::default();
        readings.has_positions = true;
        evaluator.sensor(&evidence, &readings, &around).test
    }

    #[test]
    fn scatter_is_noise_where_neither_rim_nor_motion_makes_it() {
        assert_eq!(scattered(3e-4, 1.0, 0.0), Test::Prefailed);
        assert_eq!(scattered(6e-4, 1.0, 0.0), Test::Prepassed, "it was so when healthy");
        assert_eq!(scattered(3e-4, 0.4, 0.0), Test::Prepassed, "it has bounced off the rim");
        assert_eq!(scattered(3e-4, 1.0, 6e-4), Test::Prepassed, "it is fast");
    }

    #[test]
    fn a_rim_explains_a_push_inward_and_nothing_else() {
        assert_eq!(at_the_rim(-0.8, 0.0), Test::Prefailed, "it ought to leave and stays");
        assert_eq!(at_the_rim(0.8, 0.0), Test::NotTested, "the rim holds it");
        assert_eq!(at_the_rim(-0.2, 0.0), Test::NotTested, "within the limit is not a pass");
        assert_eq!(at_the_rim(-0.8, 0.5), Test::NotTested, "the readings may be frozen");
    }
}
