//! The stages from the twin to the fault memory, for samples in order.
//!
//! Immutable: settings, geometry, limits. Mutable: twin, windows, watches.
//! [`Pipeline::judge`] reads as the list of its stages.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use nalgebra::Vector2;

use super::coverage::Coverage;
use super::edge::Edge;
use super::frame::{self, Moment, Repeats};
use super::look::Look;
use super::watch::Watch;
use super::{MonitorState, Output, Reach, Readiness, Rig, Setup, State};
use crate::diagnosis::{
    AxisEvidence, AxisNature, Course, Evaluator, Evidence, FaultMemory, Finding, Gated, InUse,
    LearntNature, Limits, OutlierGate, Pace, Profile, Qualified, Reading, Scatter, SensorLimits,
    Servo, ServoEstimate, Settings, Step, Stillness, Surroundings, Test, UNKNOWN_NOISE_M, bend_m,
    blur_m,
};
use crate::plant::{LONGEST_SPAN_S, RollingState, Twin};
use crate::vocabulary::{Axis, FaultCode, PerAxis, Sample, SimTime};

/// Samples that a window holds at least: a filter over fewer is all noise.
pub(super) const LEAST_SAMPLES: f64 = 8.0;
/// Longest period assumed before a second one has been seen, s.
const LONGEST_FIRST_PERIOD_S: f64 = 0.25;
/// How fast the period is followed, share per sample.
const PERIOD_GAIN: f64 = 0.02;
/// Share of the window that must be covered before it is judged.
pub(super) const FULL_WINDOW: f64 = 0.8;
/// Distance of the twin's free path from the ball at which it is re-anchored, m.
const REBASE_M: f64 = 1.0;

/// The stages' state.
#[derive(Clone, Debug)]
pub(super) struct Pipeline {
    settings: Settings,
    twin: Twin,
    evaluator: Evaluator,
    /// Evidence that confirms a fault of each servo, nats.
    confirm_nats: PerAxis<f64>,
    now: Option<SimTime>,
    period_s: Option<f64>,
    gate: OutlierGate,
    look: Look,
    scatter: PerAxis<Scatter>,
    servos: PerAxis<Servo>,
    readings: Stillness,
    repeats: Repeats,
    edge: Edge,
    since_jump_s: f64,
    /// The last step of the readings, if there was one.
    jump: Option<Step>,
    /// Scatter of the readings that is noise now, m.
    noisy_m: f64,
    unjudged_s: f64,
    evidence: Evidence,
    watches: [Watch; FaultCode::COUNT],
    n_judged: u64,
}

impl Pipeline {
    pub(super) fn new(setup: &Setup) -> Self {
        let (rig, settings) = (&setup.rig, setup.settings);
        let limits = PerAxis::from_fn(|axis| {
            let learnt = rig.calibration.as_ref().and_then(|c| c.axes[axis].as_ref());
            let gain = setup.twin.axes[axis].gain.abs();
            // A rig that is learnt but for this axis has no readings along it.
            let absent = rig.calibration.is_some() && learnt.is_none();
            Limits::new(settings.profile, learnt, absent, gain * rig.ball.rolling_gravity())
        });
        let sensor = SensorLimits::new(rig.calibration.as_ref().map(|c| &c.sensor));
        let needed_s = |share: f64| {
            let of = |axis: Axis| limits[axis].window_s(share, 1.0 / rig.sample_rate_hz);
            of(Axis::X).max(of(Axis::Y))
        };
        let adapts = settings.profile == Profile::Default && rig.calibration.is_some();
        let settings = if adapts { settings.through(needed_s) } else { settings };
        let confirm_nats = PerAxis::from_fn(|axis| {
            let learnt = rig.calibration.as_ref().and_then(|c| c.axes[axis].as_ref());
            settings.confirming_nats(learnt)
        });
        let servo = |axis: Axis| {
            let learnt = rig.calibration.as_ref().and_then(|c| c.axes[axis].as_ref());
            Servo::new(AxisNature {
                noise_m: limits[axis].noise_m.unwrap_or(0.0),
                learnt: learnt.map(|l| LearntNature {
                    model_error_m_s2: l.model_error_m_s2,
                    offset_spread_m_s2: l.level_spread_rad * l.gain * rig.ball.rolling_gravity(),
                    gain_spread: l.gain_spread,
                }),
                breakaway_m_s2: limits[axis].breakaway_m_s2,
                sail_share: rig.ball.sail_share().min(1.0),
                familiar_m_s2: learnt.map_or(f64::INFINITY, |l| l.familiar_m_s2),
            })
        };
        // What makes each servo suspected goes with what confirms its fault.
        let factor = PerAxis::from_fn(|a| confirm_nats[a] / settings.confirm_nats);
        Self {
            settings,
            twin: Twin::new(setup.twin),
            confirm_nats,
            evaluator: Evaluator::new(settings.profile, limits, sensor)
                .with_suspicion(settings.suspect_nats, factor),
            now: None,
            period_s: None,
            gate: OutlierGate::default(),
            look: Look::new(settings.window_s),
            scatter: PerAxis::default(),
            servos: PerAxis::from_fn(servo),
            readings: Stillness::default(),
            repeats: Repeats::new(refresh_s(rig)),
            edge: Edge::new(rig),
            since_jump_s: f64::INFINITY,
            jump: None,
            noisy_m: 0.0,
            unjudged_s: f64::INFINITY,
            evidence: Evidence::default(),
            watches: Default::default(),
            n_judged: 0,
        }
    }

    /// Takes one sample, in order, through every stage.
    pub(super) fn judge(
        &mut self,
        setup: &Setup,
        sample: &Sample,
        memory: &mut FaultMemory,
        outputs: &mut Vec<Output>,
    ) {
        let Some(moment) = frame::moment(&setup.rig.mapping, sample) else { return };
        let Some(dt) = self.tick(moment.at) else { return };
        self.n_judged += 1;
        let moment = self.without_readings_far_off(moment);
        self.step_twin(&moment);
        let fresh = self.without_repeats(&moment);
        let (usable, outliers) = self.estimate(&fresh, dt);
        self.edge.take(&fresh, dt, usable);
        self.watch_readings(&moment, dt, usable, outliers);
        self.follow_servos(&fresh, usable);
        self.unjudged_s += dt;
        // Time stamps in milliseconds must not make a period a sample longer.
        if self.unjudged_s >= self.settings.period_s - 1e-3 {
            let dt = self.unjudged_s.min(self.settings.period_s + dt);
            self.unjudged_s = 0.0;
            self.look.fit();
            self.noisy_m = self.evaluator.noisy_m(self.blur_m().hypot(self.bend_m()));
            self.collect_evidence(&moment);
            let around = self.surroundings();
            let findings = self.evaluator.evaluate(&self.evidence, &self.readings, &around);
            self.remember(&moment, dt, &findings, memory, outputs);
        }
    }

    /// The moment without its reading where no ball can be.
    fn without_readings_far_off(&self, moment: Moment) -> Moment {
        match self.edge.is_far_off(&moment) {
            true => Moment { position: PerAxis::default(), ..moment },
            false => moment,
        }
    }

    /// The moment without its reading where that is the one before.
    fn without_repeats(&mut self, moment: &Moment) -> Moment {
        match self.repeats.is_repeat(moment.at, &moment.position) {
            true => Moment { position: PerAxis::default(), ..*moment },
            false => *moment,
        }
    }

    /// Seconds since the sample before; none if no time has passed. A gap, and
    /// a clock that went on elsewhere, start afresh.
    fn tick(&mut self, at: SimTime) -> Option<f64> {
        let dt = match self.now {
            Some(now) if at <= now => return None,
            Some(now) if at - now > self.gap_s() => {
                self.restart();
                0.0
            }
            Some(now) => at - now,
            None => 0.0,
        };
        if dt > 0.0 {
            let period = self.period_s.get_or_insert(dt.min(LONGEST_FIRST_PERIOD_S));
            *period += PERIOD_GAIN * (dt - *period).clamp(-*period, *period);
        }
        self.now = Some(at);
        Some(dt)
    }

    fn gap_s(&self) -> f64 {
        self.settings.gap_after_s(self.period_s.unwrap_or(0.0)).min(LONGEST_SPAN_S)
    }

    /// The window that the least readings take, s.
    fn least_window_s(&self) -> f64 {
        LEAST_SAMPLES * self.period_s.unwrap_or(0.0)
    }

    /// Forgets the past motion; what the debounce has gathered stays.
    fn restart(&mut self) {
        self.twin.restart();
        Axis::ALL.into_iter().for_each(|axis| self.servos[axis].restart());
        self.readings = Stillness::default();
        self.edge.restart();
        self.gate.restart();
        self.forget();
    }

    /// Forgets every reading.
    fn forget(&mut self) {
        self.look.forget();
        self.scatter = PerAxis::default();
        self.pause_servos();
    }

    fn pause_servos(&mut self) {
        for axis in Axis::ALL {
            self.servos[axis].pause();
        }
    }

    /// Stage: the twin follows the commands, in lockstep.
    fn step_twin(&mut self, moment: &Moment) {
        let of = |axis: Axis| {
            let fit = self.look.fits[axis].map(|f| (f.measured.position, f.measured.velocity));
            fit.unwrap_or((moment.position[axis].unwrap_or(0.0), 0.0))
        };
        let (x, y) = (of(Axis::X), of(Axis::Y));
        let observed = RollingState {
            position: Vector2::new(x.0, y.0),
            velocity: Vector2::new(x.1, y.1),
            spin: 0.0,
        };
        self.twin.advance(moment.at, moment.command, &observed);
        let away = self.twin.motion().position - observed.position;
        if away.amax() > REBASE_M {
            let shift = self.twin.rebase(observed.position, observed.velocity);
            self.gate.shift(moment.at.seconds(), shift.position, shift.velocity);
            for (i, axis) in Axis::ALL.into_iter().enumerate() {
                let (t, p, v) = (moment.at.seconds(), shift.position[i], shift.velocity[i]);
                self.look.rebase(axis, t, p, v);
                self.scatter[axis] = Scatter::default();
                self.servos[axis].rebase(t, p, v);
            }
        }
    }

    /// Stage: outlier gate, then measured and twin's path through one filter.
    /// Returns whether the readings are usable and how many earlier ones have
    /// turned out to be outliers.
    fn estimate(&mut self, moment: &Moment, dt: f64) -> (bool, u32) {
        let t = moment.at.seconds();
        let (predicted, gap_s) = (self.twin.motion().position, self.gap_s());
        self.since_jump_s += dt;
        if self.look.stale(t, gap_s) {
            self.gate.restart();
            self.forget();
        }
        if Axis::ALL.iter().all(|&a| moment.position[a].is_none()) {
            return (true, 0);
        }
        // Off the twin's path, a ball that obeys it goes straight.
        let off = |axis: Axis| moment.position[axis].map(|p| p - predicted[axis as usize]);
        let (off_m, noise_m) = (PerAxis::from_fn(off), self.gate_noise_m());
        let gated = match self.edge.may_have_bounced(moment.at) {
            true => self.gate.take_at_rim(t, off_m, noise_m),
            false => self.gate.take(t, off_m, noise_m),
        };
        match gated {
            Gated::Stepped(step) => {
                self.forget();
                self.since_jump_s = 0.0;
                self.jump = Some(step);
            }
            // The window holds a reading that should not be in it.
            Gated::Accepted { undone: true, .. } => self.forget(),
            Gated::Accepted { .. } | Gated::Refused => {}
        }
        for (i, axis) in Axis::ALL.into_iter().enumerate() {
            if let (true, Some(position)) = (gated.usable(), moment.position[axis]) {
                let least_s = self.least_window_s();
                self.look.push(axis, t, position, predicted[i], least_s);
                self.scatter[axis].take(t, position - predicted[i], self.noisy_m);
            }
        }
        match gated {
            Gated::Accepted { outliers, .. } => (true, outliers),
            other => (other.usable(), 0),
        }
    }

    /// Standard deviation by which the readings may leave their path, m.
    fn gate_noise_m(&self) -> f64 {
        let noise_m = match self.repeats.are_expected() {
            true => self.noise_m().hypot(self.blur_m()),
            false => self.noise_m(),
        };
        if self.settings.learnt { noise_m } else { noise_m.max(UNKNOWN_NOISE_M) }
    }

    /// Standard deviation of healthy readings, the worse of both axes, m.
    fn noise_m(&self) -> f64 {
        self.evaluator.noise_m()
    }

    /// Stage: stillness, missing and identical readings.
    fn watch_readings(&mut self, moment: &Moment, dt: f64, usable: bool, outliers: u32) {
        let limits = *self.evaluator.limits();
        let asked_m_s2 = PerAxis::from_fn(|a| {
            let pull_m_s2 = moment.command[a].map_or(0.0, |_| self.pull_m_s2(a));
            if pull_m_s2 > limits[a].pressing_m_s2() { pull_m_s2 } else { 0.0 }
        });
        self.readings.update(&Reading {
            dt,
            position_m: moment.position,
            asked_m_s2,
            still_m: self.evaluator.still_m(),
            usable,
            // Bounces off the rim look like outliers.
            outliers: if self.edge.clear_s < self.settings.window_s { 0 } else { outliers },
        });
    }

    /// Acceleration that the plate asks of the ball along `axis` at least, m/s²,
    /// for all that is known of this session's level.
    fn pull_m_s2(&self, axis: Axis) -> f64 {
        self.servos[axis].least_pull_m_s2(self.twin.motion().acceleration[axis as usize])
    }

    /// Stage: what the ball's answer says of each servo.
    fn follow_servos(&mut self, moment: &Moment, usable: bool) {
        if self.settings.profile == Profile::Textbook {
            return;
        }
        let motion = *self.twin.motion();
        let answers = PerAxis::from_fn(|axis| self.answers(axis));
        for (i, axis) in Axis::ALL.into_iter().enumerate() {
            let servo = &mut self.servos[axis];
            match moment.position[axis] {
                _ if self.edge.at_edge || moment.command[axis].is_none() => servo.pause(),
                Some(_) if !answers[axis] => servo.pause(),
                Some(position) if usable && !self.gate.doubts() => {
                    let course = Course {
                        position_m: motion.position[i],
                        velocity_m_s: motion.velocity[i],
                        acceleration_m_s2: motion.acceleration[i],
                    };
                    servo.take(moment.at.seconds(), position, &course);
                }
                _ => {}
            }
        }
    }

    /// Whether the ball rests within its breakaway angle.
    fn rests(&self, axis: Axis) -> bool {
        let held_m_s2 = self.evaluator.limits()[axis].pressing_m_s2();
        self.readings.axes[axis].rests() && self.pull_m_s2(axis) < held_m_s2
    }

    /// Whether the ball's motion along `axis` can answer its servo: not while it
    /// rests within its breakaway angle, nor while readings that repeat themselves
    /// although the ball is asked to move leave open whether they are alive, nor
    /// while it stands still in every direction.
    fn answers(&self, axis: Axis) -> bool {
        let may_be_dead = self.readings.axes[axis].repeats(self.evaluator.limits()[axis].repeat_s);
        !self.rests(axis) && !may_be_dead && !self.readings.is_held()
    }

    /// Stage: residual, limit and gate of this moment.
    fn collect_evidence(&mut self, moment: &Moment) {
        let around = self.surroundings();
        let window_s = self.look.window_s(self.least_window_s());
        let see = |axis: Axis| {
            let mut e = self.axis_evidence(moment, axis, window_s);
            let pull_m_s2 = self.pull_m_s2(axis);
            e.enabled =
                self.evaluator.enabled(axis, &e, window_s, pull_m_s2, &self.readings, &around);
            e
        };
        let fits = &self.look.fits;
        // A curve over a window takes a push for noise, three readings in a
        // row a sharp bend; noise shows in both.
        let scatter = |axis: Axis| {
            let (curve, close) = (fits[axis]?.scatter, self.scatter[axis].deviation_m());
            Some(close.map_or(curve, |c| c.min(curve)))
        };
        self.evidence = Evidence {
            at: Some(moment.at),
            window_s,
            axes: PerAxis::from_fn(see),
            unseen_s: self.readings.unseen_s,
            missing_share: self.readings.missing,
            identical_s: self.readings.identical_s(),
            still_s: self.readings.still_s(),
            outliers: self.readings.outliers().round() as u32,
            scatter_m: Axis::ALL.into_iter().filter_map(scatter).reduce(f64::max),
            healthy_scatter_m: self.noise_m(),
            jump: self.jump.filter(|_| self.jumped()),
        };
    }

    /// What is seen of `axis` over `window_s`, the gate aside.
    fn axis_evidence(&self, moment: &Moment, axis: Axis, window_s: f64) -> AxisEvidence {
        let (fit, servo) = (self.look.fits[axis], &self.servos[axis]);
        let full = fit.filter(|f| {
            moment.position[axis].is_some()
                && f.span_s >= FULL_WINDOW * window_s
                && f.n as f64 >= LEAST_SAMPLES / 2.0
        });
        let of_session = |residual| self.of_session(axis, residual);
        let twin = full.map(|f| {
            let residual = f.deviation.acceleration;
            f.measured.acceleration - residual + of_session(residual)
        });
        let error = full.map_or(0.0, |f| f.acceleration_error);
        AxisEvidence {
            command_rad: moment.command[axis],
            position_m: fit.map(|f| f.measured.position),
            velocity_m_s: fit.map(|f| f.measured.velocity),
            measured_m_s2: full.map(|f| f.measured.acceleration),
            twin_m_s2: twin,
            limit_m_s2: self.evaluator.limits()[axis].at(twin.unwrap_or(0.0), error),
            enabled: false,
            nats: servo.nats(),
            path_error_m: servo.path_error_m(),
            path_limit_m: self.evaluator.limits()[axis].path_m,
            answer: (self.settings.profile == Profile::Default).then(|| servo.answer()),
            identical_s: self.readings.axes[axis].identical_s,
        }
    }

    /// How much of a residual along `axis` is this session's level, m/s²: none where
    /// the rig is not learnt. A level that is not known well explains no less than
    /// the rig's own.
    fn of_session(&self, axis: Axis, residual_m_s2: f64) -> f64 {
        let offset = self.servos[axis].steady_m_s2();
        let explains = self.settings.learnt && offset * residual_m_s2 > 0.0;
        if explains { residual_m_s2.signum() * residual_m_s2.abs().min(offset.abs()) } else { 0.0 }
    }

    /// By how much a reading blurs, m: as far as the ball moves within the
    /// uncertainty of its time.
    fn blur_m(&self) -> f64 {
        let speed = |axis: Axis| self.look.fits[axis].map_or(0.0, |f| f.measured.velocity);
        let (x, y) = (speed(Axis::X), speed(Axis::Y));
        let (period_s, held) = (self.period_s.unwrap_or(0.0), self.repeats.are_expected());
        blur_m((x * x + y * y).sqrt(), period_s, held)
    }

    /// By how much the path may bend between three readings, m, where the ball's
    /// acceleration is off the twin's by as much as no servo is blamed for.
    fn bend_m(&self) -> f64 {
        let off_m_s2 = |axis: Axis| self.evaluator.limits()[axis].at(0.0, 0.0);
        bend_m(off_m_s2(Axis::X).max(off_m_s2(Axis::Y)), self.period_s.unwrap_or(0.0))
    }

    /// Whether readings have stepped of late as no ball can.
    fn jumped(&self) -> bool {
        self.since_jump_s < self.settings.jump_lasts_s()
    }

    fn surroundings(&self) -> Surroundings {
        Surroundings {
            clear_s: self.edge.clear_s,
            at_edge: self.edge.at_edge,
            rim: self.edge.rim,
            rim_s: self.edge.rim_s,
            over_the_edge: self.edge.at_edge && self.edge.is_open(),
            jumped: self.jumped(),
            noisy_m: self.noisy_m,
        }
    }

    /// Stage: debounce and fault memory.
    fn remember(
        &mut self,
        moment: &Moment,
        dt: f64,
        findings: &[Finding; FaultCode::COUNT],
        memory: &mut FaultMemory,
        outputs: &mut Vec<Output>,
    ) {
        let mut blamed = false;
        for (&code, finding) in FaultCode::ALL.iter().zip(findings) {
            let watch = &mut self.watches[code as usize];
            let rising = code.axis().and_then(|axis| self.servos[axis].rising_since());
            let share =
                code.axis().map_or(1.0, |a| self.settings.confirm_nats / self.confirm_nats[a]);
            let finding = &Finding { nats: finding.nats.map(|n| share * n), ..*finding };
            let qualified = watch.update(code, finding, moment.at, dt, &self.settings, rising);
            let qualified = match self.settings.confirms(code, finding.kind) {
                true => qualified,
                false => qualified.min(Qualified::Failed),
            };
            watch.apply(code, qualified, &self.settings, &self.evidence, memory, outputs);
            let failed = match qualified {
                Qualified::Tripped => true,
                // What is weighed goes on being weighed until it is sure.
                Qualified::Failed => finding.nats.is_none(),
                Qualified::No | Qualified::Passed => false,
            };
            blamed |= failed && code.axis().is_none();
        }
        if blamed {
            // What the servos were suspected of before is accounted for.
            for axis in Axis::ALL {
                self.servos[axis].exonerate();
                self.watches[FaultCode::servo(axis) as usize].exonerate();
            }
        }
    }

    /// Starts the monitor of `code` again, as after a clear.
    pub(super) fn reset_monitor(&mut self, code: FaultCode) {
        self.watches[code as usize] = Watch::default();
        if let Some(axis) = code.axis() {
            self.servos[axis].exonerate();
        }
    }

    /// How each servo has answered over this session.
    pub(super) fn servo_estimates(&self) -> PerAxis<Option<ServoEstimate>> {
        PerAxis::from_fn(|axis| self.servos[axis].estimate())
    }

    /// Most evidence against each servo so far, nats, against what confirms a fault
    /// of any.
    pub(super) fn most_nats(&self) -> PerAxis<f64> {
        PerAxis::from_fn(|axis| self.watches[FaultCode::servo(axis) as usize].most_nats())
    }

    /// The most that the path of each axis has bent from the twin's, m.
    pub(super) fn most_path_error_m(&self) -> PerAxis<f64> {
        PerAxis::from_fn(|axis| self.servos[axis].most_path_error_m())
    }

    /// The nearest that each monitor has come to an alarm by the time of its
    /// failures, 0 to 1, and the seconds that it could judge.
    pub(super) fn nearest(&self) -> [(f64, f64); FaultCode::COUNT] {
        core::array::from_fn(|i| (self.watches[i].nearest(), self.watches[i].judged_s()))
    }

    /// How well the healthy explanation has foretold the readings of each axis, nats.
    pub(super) fn foretold_nats(&self) -> PerAxis<f64> {
        PerAxis::from_fn(|axis| self.servos[axis].foretold_nats())
    }

    /// The evidence of the last sample.
    pub(super) const fn evidence(&self) -> &Evidence {
        &self.evidence
    }

    /// Time of the last sample judged.
    pub(super) const fn now(&self) -> Option<SimTime> {
        self.now
    }

    /// How far the monitor of `code` has got.
    fn reach(&self, code: FaultCode) -> Reach {
        let judged_s = self.watches[code as usize].judged_s();
        match InUse::judges(judged_s, Pace::needed_s(code, &self.settings)) {
            false => Reach::NotJudged,
            true if !self.settings.confirms(code, None) => Reach::NotLearnt,
            true => Reach::Judged,
        }
    }

    /// Takes note of how much of this session each monitor could judge.
    pub(super) fn count_use(&self, coverage: &Coverage, memory: &mut FaultMemory) {
        for (&code, watch) in FaultCode::ALL.iter().zip(&self.watches) {
            let needed_s = Pace::needed_s(code, &self.settings);
            memory.count_use(code, coverage.data_s(code), watch.judged_s(), needed_s);
        }
    }

    pub(super) fn state(
        &self,
        memory: &FaultMemory,
        coverage: &Coverage,
        n_waiting: usize,
    ) -> State {
        let monitors = core::array::from_fn(|i| {
            let (watch, status) = (&self.watches[i], memory.record(FaultCode::ALL[i]).status);
            MonitorState {
                counter: watch.counter(),
                readiness: Readiness {
                    enabled: watch.test() != Test::NotTested,
                    complete_this_cycle: status.completed_this_cycle(),
                    complete_since_clear: status.completed_since_clear(),
                },
                judged_s: watch.judged_s(),
                judged_share: coverage.share(watch.judged_s()),
                reach: self.reach(FaultCode::ALL[i]),
            }
        });
        let ghost = |a: Axis| {
            self.look.fits[a].map_or((0.0, 0.0), |f| {
                let (residual, span) = (f.deviation.acceleration, f.span_s);
                (
                    f.measured.position - residual * span * span / 2.0,
                    f.measured.velocity - residual * span,
                )
            })
        };
        State {
            at: self.now,
            n_judged: self.n_judged,
            n_waiting,
            twin_position_m: PerAxis::from_fn(|a| ghost(a).0),
            twin_velocity_m_s: PerAxis::from_fn(|a| ghost(a).1),
            plate_angle_rad: self.twin.plate_angle(),
            evidence: self.evidence.clone(),
            monitors,
            fidelity: *self.twin.fidelity(),
        }
    }
}

/// Time between two readings of a sensor that is logged faster than it reads, s.
fn refresh_s(rig: &Rig) -> f64 {
    rig.calibration.as_ref().map_or(0.0, |c| c.sensor.refresh_s)
}
