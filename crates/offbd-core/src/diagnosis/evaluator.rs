//! The monitors: one moment of evidence in, one test per code out.
//!
//! Order matters and is the isolation: readings that cannot be trusted say
//! nothing about the ball, a ball that cannot move says nothing about the
//! servos. A monitor that is out of its depth is *not tested*, never *passed*.

use super::stillness::{AxisStillness, Stillness};
use super::{AxisEvidence, Candidate, Evidence, Limits, Profile, SensorLimits, Settings, Test};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{Axis, FaultCode, FaultKind, PerAxis};

/// The chapter's enable condition: command, rad, or measured acceleration,
/// m/s² (application 3).
const TEXTBOOK_ENABLE_RAD: f64 = 0.08;
const TEXTBOOK_ENABLE_M_S2: f64 = 0.5;

/// Seconds of identical readings, while asked to move, that no living sensor
/// on a rolling ball gives: longer than any refresh seen (0.2 s).
const FROZEN_S: f64 = 0.3;

/// Standard deviations of a reading by which a ball must have gone on, by its
/// last velocity, for identical readings to be frozen.
const MISSED: f64 = 20.0;

/// How fast a ball that nothing drives rolls out, m/s². Assumed: what half a
/// degree of tilt would give it. Without it a drawn rig whose sensor holds its
/// value at rest was called frozen 37 times an hour, with it never.
const ROLLS_OUT_M_S2: f64 = 0.05;

/// A ball at rest seems to move by less than this many noise deviations.
const STILL_FACTOR: f64 = 6.0;

/// Seconds in which a ball asked to move must have begun to.
const PRESSED_S: f64 = 0.3;
/// How far a ball at rest must have been asked to roll, in widths of what counts as
/// still: one that turns round stays within a width for as long as one at rest takes
/// for up to (1 + √2)² = 5.8 of them, and mostly for fewer. More than four would leave
/// a coarse rig's drive cycle without a verdict on its ball.
const TURNING_WIDTHS: f64 = 4.0;

/// Share of samples without a ball that is too many.
const MISSING_SHARE: f64 = 0.5;

/// Scatter over the healthy one that is noise, beside what healthy readings have
/// been seen to scatter by for a while ([`SensorLimits::scatter_m`]).
const NOISY: f64 = 3.5;

/// Share of a cause that reads alike, where nothing else tells the two apart: a
/// ball that stands may do so because its servo is dead, identical readings may be
/// those of a ball that stands. Chosen, not measured: either is rarer.
const SERVO_SHARE: f64 = 0.4;
const STUCK_SHARE: f64 = 0.3;

/// Evidence against both servos at once that speaks for what they share, nats.
const SHARED_NATS: f64 = 9.0;
/// Evidence against both that neither ball nor sensor account for, nats: both
/// have failed, as when their supply does.
const BOTH_NATS: f64 = 30.0;
/// Share of its limit by which the path must bend as well where the weight of evidence
/// alone is not believed. Chosen: an earlier form of the rule found 180, 180 and 179 of 700
/// faults put into servos of real rigs with 0.5, 0.7 and 1.
const BENT_SHARE: f64 = 0.7;
/// Evidence that is not believed, as a share of what makes a servo suspected.
const DOUBTED_SHARE: f64 = 0.99;
/// Speed below which a ball counts as held back, m/s.
const HELD_BACK_M_S: f64 = 0.03;

/// What the monitors look at besides the evidence.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings {
    /// Seconds for which the ball has been clear of the edge.
    pub clear_s: f64,
    /// Whether the ball was last seen at the edge.
    pub at_edge: bool,
    /// The axis across whose rim the ball lies; none in a corner.
    pub rim: Option<Axis>,
    /// Seconds for which it has lain there.
    pub rim_s: f64,
    /// Whether it was last seen at an edge without a rim: it is falling.
    pub over_the_edge: bool,
    /// Whether readings have stepped of late as no ball can.
    pub jumped: bool,
    /// Scatter of the readings that is noise, m.
    pub noisy_m: f64,
}

/// What one monitor says of one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Finding {
    pub test: Test,
    /// Evidence for a fault of this servo, nats; none where it has no say.
    pub nats: Option<f64>,
    /// The ball has left the plate: a test that failed can have no more
    /// evidence, and needs none.
    pub gone: bool,
    pub kind: Option<FaultKind>,
    /// Another cause that reads alike.
    pub rival: Option<Candidate>,
}

impl Finding {
    const NOTHING: Self =
        Self { test: Test::NotTested, nats: None, gone: false, kind: None, rival: None };
    const PASS: Self = Self { test: Test::Prepassed, ..Self::NOTHING };

    /// This finding, or the other where this one is no failure.
    fn or(self, other: Option<Self>) -> Self {
        if self.test == Test::Prefailed { self } else { other.unwrap_or(self) }
    }

    const fn fail(kind: Option<FaultKind>) -> Self {
        Self { test: Test::Prefailed, kind, ..Self::NOTHING }
    }
}

/// The monitors of one rig.
#[derive(Clone, Debug)]
pub struct Evaluator {
    profile: Profile,
    limits: PerAxis<Limits>,
    sensor: SensorLimits,
    /// Evidence that makes each servo suspected, nats: it explains why a ball
    /// stands that was asked to move by it alone.
    suspect_nats: PerAxis<f64>,
    /// Whether that is more than for other rigs, because evidence was found against
    /// the servo while it was healthy: the twin fits badly.
    fits_badly: PerAxis<bool>,
}

impl Evaluator {
    /// The monitors by these limits, with the evidence that [`Settings`] ask for.
    #[must_use]
    pub fn new(profile: Profile, limits: PerAxis<Limits>, sensor: SensorLimits) -> Self {
        let suspect_nats = PerAxis::from_fn(|_| Settings::of(profile).suspect_nats);
        let fits_badly = PerAxis::from_fn(|_| false);
        Self { profile, limits, sensor, suspect_nats, fits_badly }
    }

    /// The same where it takes `suspect_nats` to suspect a servo, nats, times the
    /// `factor` of its axis, ≥ 1.
    #[must_use]
    pub fn with_suspicion(self, suspect_nats: f64, factor: PerAxis<f64>) -> Self {
        let fits_badly = PerAxis::from_fn(|axis| factor[axis] > 1.0);
        let suspect_nats = PerAxis::from_fn(|axis| factor[axis] * suspect_nats);
        Self { suspect_nats, fits_badly, ..self }
    }

    /// The limits in force.
    #[must_use]
    pub const fn limits(&self) -> &PerAxis<Limits> {
        &self.limits
    }

    /// Whether the residual of `axis` may be judged: the enable condition.
    /// `pull_m_s2` is what the plate asks of the ball at least.
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

    /// What every monitor says, in the order of [`FaultCode::ALL`].
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
        let blind = [sensor, stuck].iter().any(|f| f.test == Test::Prefailed);
        let servo = |axis| match blind {
            true => Finding { gone: around.over_the_edge, ..Finding::NOTHING },
            false => self.believed(axis, evidence, servo(axis, evidence, around)),
        };
        [servo(Axis::X), servo(Axis::Y), stuck, sensor]
    }

    /// `finding` with as much of the evidence against the servo of `axis` as is
    /// believed. Where the twin fits badly, evidence creeps up on a healthy servo: the
    /// path has to bend from the twin's as well, but for an offset, which it takes for
    /// the level.
    fn believed(&self, axis: Axis, evidence: &Evidence, finding: Finding) -> Finding {
        let e = &evidence.axes[axis];
        let bent = e.path_share().is_some_and(|share| share >= BENT_SHARE);
        let doubted = self.fits_badly[axis] && e.path_limit_m.is_some() && !bent;
        match doubted && finding.kind != Some(FaultKind::Offset) {
            true => {
                let most = DOUBTED_SHARE * self.suspect_nats[axis];
                Finding { nats: finding.nats.map(|nats| nats.min(most)), ..finding }
            }
            false => finding,
        }
    }

    /// Scatter of the readings that is noise, m, where healthy ones blur by
    /// `blur_m` because of the ball's motion.
    #[must_use]
    pub fn noisy_m(&self, blur_m: f64) -> f64 {
        let noise_m = self.noise_m();
        (NOISY * noise_m.hypot(blur_m)).max(self.sensor.scatter_m)
    }

    /// How far a ball at rest may seem to move, m.
    #[must_use]
    pub fn still_m(&self) -> f64 {
        STILL_FACTOR * self.noise_m()
    }

    /// Standard deviation of healthy readings, the worse of both axes, m.
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
        if readings.unseen_s > 0.0 {
            return Finding::default();
        }
        if around.jumped {
            return Finding::fail(Some(FaultKind::Jump));
        }
        if readings.outliers() >= self.sensor.outliers {
            return Finding::fail(Some(FaultKind::Spikes));
        }
        // A bounce off the rim is no parabola.
        let rolls = around.clear_s >= evidence.window_s;
        if rolls && evidence.scatter_m.is_some_and(|s| s > around.noisy_m) {
            return Finding::fail(Some(FaultKind::Noise));
        }
        self.frozen(readings, around).unwrap_or(Finding::PASS)
    }

    /// Bit-identical readings although the ball is asked to move, did move, or has
    /// always read otherwise, even at rest.
    fn frozen(&self, readings: &Stillness, around: &Surroundings) -> Option<Finding> {
        if around.at_edge {
            return None;
        }
        let axes = &readings.axes;
        let seen = |axis: Axis| axes[axis].seen();
        let dead = |axis: Axis| seen(axis) && self.dead(axis, &axes[axis]);
        let any = |of: &dyn Fn(Axis) -> bool| Axis::ALL.into_iter().any(of);
        let both =
            Axis::ALL.into_iter().filter(|&a| seen(a)).all(|a| axes[a].identical_s >= FROZEN_S);
        if both && any(&dead) {
            let moved = any(&|a| self.missed(a, &axes[a]));
            let stuck = Candidate { code: FaultCode::StuckBall, kind: None, weight: STUCK_SHARE };
            let rival = (!moved).then_some(stuck);
            return Some(Finding { rival, ..Finding::fail(Some(FaultKind::Frozen)) });
        }
        let alone = |axis: Axis| dead(axis) && axes[axis.other()].identical_s < FROZEN_S / 2.0;
        any(&alone).then(|| Finding::fail(Some(FaultKind::Frozen)))
    }

    /// Whether a ball that moved when its readings last changed must have gone on.
    fn missed(&self, axis: Axis, still: &AxisStillness) -> bool {
        let stops_m_s2 = ROLLS_OUT_M_S2.max(self.limits[axis].rolls_out_m_s2);
        still.missed_m(stops_m_s2) > MISSED * self.noise_m()
    }

    /// Whether readings of `axis` have been the same for longer than any that
    /// live are.
    fn dead(&self, axis: Axis, still: &AxisStillness) -> bool {
        let limits = &self.limits[axis];
        let asked = still.pressed_s >= FROZEN_S || self.missed(axis, still);
        let resting = self.rest_repeat_s().is_some_and(|s| still.identical_s >= s);
        resting || asked && still.identical_s >= limits.repeat_s
    }

    /// Time for which readings of a ball at rest may be the same, s: both axes are
    /// one look at it. None if that of an axis that is measured is not known.
    fn rest_repeat_s(&self) -> Option<f64> {
        let measured = Axis::ALL.into_iter().filter(|&a| self.limits[a].noise_m.is_some());
        measured.map(|a| self.limits[a].rest_repeat_s).try_fold(0.0, |most, s| Some(s?.max(most)))
    }

    /// The ball stands still although it is asked to move. Asked along one axis
    /// alone, it may stand because that servo does not answer: evidence gathered
    /// while the ball still rolled says so.
    fn stuck_ball(
        &self,
        evidence: &Evidence,
        readings: &Stillness,
        around: &Surroundings,
    ) -> Finding {
        if around.at_edge || readings.unseen_s > 0.0 {
            return Finding::default();
        }
        let pressed = |axis: Axis| {
            let still = &readings.axes[axis];
            still.pressed_s >= PRESSED_S && still.asked_widths >= TURNING_WIDTHS
        };
        match (pressed(Axis::X), pressed(Axis::Y)) {
            _ if readings.still_s() < PRESSED_S => Finding::PASS,
            (true, true) => Finding::fail(None),
            (false, false) => Finding::default(),
            (true, false) => self.stuck_or_servo(Axis::X, evidence),
            (false, true) => self.stuck_or_servo(Axis::Y, evidence),
        }
    }

    /// A ball that stands though it is asked to move along `axis` alone. The
    /// servo's weight rises with the evidence against it, up to all of it at what
    /// makes it suspected: then it explains why the ball stands.
    fn stuck_or_servo(&self, axis: Axis, evidence: &Evidence) -> Finding {
        let share = (evidence.axes[axis].nats / self.suspect_nats[axis]).max(0.0);
        if share >= 1.0 {
            return Finding::default();
        }
        let weight = SERVO_SHARE + (1.0 - SERVO_SHARE) * share;
        let servo = Candidate { code: FaultCode::servo(axis), kind: Some(FaultKind::Dead), weight };
        Finding { rival: Some(servo), ..Finding::fail(None) }
    }
}

/// What the residual and the weighed explanations say of one servo. Two servos
/// do not fail in the same second: evidence against both speaks for neither,
/// unless nothing else accounts for it.
fn servo(axis: Axis, evidence: &Evidence, around: &Surroundings) -> Finding {
    let (e, other) = (&evidence.axes[axis], &evidence.axes[axis.other()]);
    let nats = if other.nats < BOTH_NATS { (e.nats - other.nats).max(0.0) } else { e.nats };
    let fails = |e: &AxisEvidence| e.violates() || e.is_off_path();
    let test = match fails(e) {
        true if fails(other) && e.nats.min(other.nats) < BOTH_NATS => Test::NotTested,
        true => Test::Prefailed,
        // The rim may hold what a servo would not.
        false if e.enabled && !around.at_edge => Test::Prepassed,
        false => Test::NotTested,
    };
    let kind = e.answer.and_then(|answer| answer.kind());
    Finding { test, nats: Some(nats), gone: around.over_the_edge, kind, rival: None }
}

/// Whether a ball at the rim stays there although it ought to leave. A rim
/// only pushes inward, so all that it can explain is a residual inward: one
/// outward is the servo's, for as long as the readings are alive.
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

/// The chapter's rule: enabled and the residual at least 0.01 m/s².
fn textbook(axis: Axis, evidence: &Evidence) -> Finding {
    let e = &evidence.axes[axis];
    match (e.enabled, e.violates()) {
        (false, _) => Finding::default(),
        (true, true) => Finding::fail(None),
        (true, false) => Finding::PASS,
    }
}

/// The ball hardly moves, and neither servo is answered.
fn held_back(evidence: &Evidence, around: &Surroundings) -> Option<Finding> {
    let PerAxis { x, y } = &evidence.axes;
    let slow = |e: &AxisEvidence| e.velocity_m_s.is_some_and(|v| v.abs() < HELD_BACK_M_S);
    let shared = x.nats.min(y.nats) >= SHARED_NATS && !around.at_edge;
    (shared && slow(x) && slow(y))
        .then(|| Finding { nats: Some(x.nats + y.nats), ..Finding::fail(None) })
}

#[cfg(test)]
mod tests {
    use super::super::stillness::Reading;
    use super::*;

    /// A ball clear of the edge, of whose readings nothing is known.
    const CLEAR: Surroundings = Surroundings {
        clear_s: 1.0,
        at_edge: false,
        rim: None,
        rim_s: 0.0,
        over_the_edge: false,
        jumped: false,
        noisy_m: 1.0,
    };

    /// A ball that lies at the rim at +x while the twin goes by `twin`, m/s².
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

    /// A ball that stands in the middle and is asked to move along x alone, by a
    /// servo that has `nats` against it where `suspect_nats` make it suspected.
    fn standing(nats: f64, suspect_nats: f64) -> Finding {
        let reading = Reading {
            dt: 0.5,
            position_m: PerAxis { x: Some(0.0), y: Some(0.0) },
            asked_m_s2: PerAxis { x: 1.0, y: 0.0 },
            still_m: 1e-3,
            usable: true,
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

    /// A path that bends from the twin's accuses its servo, where the other axis goes by
    /// its own: what both share is another's.
    #[test]
    fn a_path_off_the_twins_accuses_its_servo_alone() {
        let bent = |error_m: f64| AxisEvidence {
            path_error_m: Some(error_m),
            path_limit_m: Some(5e-3),
            ..AxisEvidence::default()
        };
        let test = |x: f64, y: f64| {
            let axes = PerAxis { x: bent(x), y: bent(y) };
            servo(Axis::X, &Evidence { axes, ..Evidence::default() }, &CLEAR).test
        };
        assert_eq!(test(6e-3, 1e-3), Test::Prefailed);
        assert_eq!(test(4e-3, 1e-3), Test::NotTested);
        assert_eq!(test(6e-3, 6e-3), Test::NotTested);
    }

    /// Where the twin fits badly, evidence is believed that a bent path or an offset
    /// goes with, or where no path is judged.
    #[test]
    fn evidence_alone_does_not_accuse_where_the_twin_fits_badly() {
        let wide = Limits::new(Profile::Default, None, false, 7.0);
        let evaluator = |factor: f64| {
            let limits = PerAxis::from_fn(|_| wide);
            Evaluator::new(Profile::Default, limits, SensorLimits::new(None))
                .with_suspicion(10.0, PerAxis::from_fn(|_| factor))
        };
        let nats = |factor: f64, path: Option<(f64, f64)>, kind| {
            let (path_error_m, path_limit_m) = path.unzip();
            let x = AxisEvidence { path_error_m, path_limit_m, ..AxisEvidence::default() };
            let axes = PerAxis { x, y: AxisEvidence::default() };
            let finding = Finding { nats: Some(40.0), kind, ..Finding::NOTHING };
            let evidence = Evidence { axes, ..Evidence::default() };
            evaluator(factor).believed(Axis::X, &evidence, finding).nats.unwrap()
        };
        let (straight, bent) = (Some((1e-3, 5e-3)), Some((4e-3, 5e-3)));
        assert!(nats(1.5, straight, None) < 15.0, "less than makes it suspected");
        assert_eq!(nats(1.5, bent, None), 40.0);
        assert_eq!(nats(1.5, straight, Some(FaultKind::Offset)), 40.0);
        assert_eq!(nats(1.5, None, None), 40.0);
        assert_eq!(nats(1.0, straight, None), 40.0, "the twin fits");
    }

    #[test]
    fn a_servo_that_was_suspected_while_the_ball_rolled_explains_why_it_stands() {
        assert_eq!(standing(0.0, 10.0).test, Test::Prefailed);
        assert_eq!(standing(10.0, 10.0).test, Test::NotTested);
    }

    /// An owner who asks for more evidence has the servo suspected later.
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

    /// Readings that scatter by 2 mm, of a ball that is clear of the edge and
    /// moves `blur_m` within the uncertainty of a reading's time.
    fn scattered(noise_m: f64, clear_s: f64, blur_m: f64) -> Test {
        let mut limit = Limits::new(Profile::Default, None, false, 7.0);
        limit.noise_m = Some(noise_m);
        let evaluator =
            Evaluator::new(Profile::Default, PerAxis::from_fn(|_| limit), SensorLimits::new(None));
        let around = Surroundings { clear_s, noisy_m: evaluator.noisy_m(blur_m), ..CLEAR };
        let evidence = Evidence { scatter_m: Some(2e-3), window_s: 0.5, ..Evidence::default() };
        evaluator.sensor(&evidence, &Stillness::default(), &around).test
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
        assert_eq!(at_the_rim(-0.2, 0.0), Test::NotTested, "within the limit is no pass");
        assert_eq!(at_the_rim(-0.8, 0.5), Test::NotTested, "the readings may be frozen");
    }
}
