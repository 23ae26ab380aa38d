//! The stages from the twin to the fault memory, for samples in order.
//!
//! Immutable: settings, geometry, limits. Mutable: twin, windows, monitors.
//! [`Pipeline::judge`] lists the stages.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use alloc::borrow::Cow;
use core::mem;
use serde::{Deserialize, Serialize};

use nalgebra::Vector2;

use super::acceleration_filter::AccelerationFilter;
use super::coverage::Coverage;
use super::edge::Edge;
use super::frame::{self, Moment, Repeats};
use super::monitor::Monitor;
use super::{MonitorState, Reach, Readiness, Rig, Setup, State, Thresholds, Trial};
use crate::diagnosis::{
    AxisEvidence, AxisPrior, DebounceTimes, Evaluator, Evidence, FaultMemory, Finding, GateOutcome,
    InUse, LONGEST_GAP_S, LearntPrior, Limits, OutlierGate, PositionJump, Profile, Qualified,
    Reading, Scatter, SensorLimits, ServoEstimate, ServoFilterBank, Settings, Stillness,
    Surroundings, Test, Transition, TwinPath, UNKNOWN_NOISE_M, bend_m, blur_m,
};
use crate::plant::{LONGEST_SPAN_S, RollingState, Twin};
use crate::vocabulary::{Axis, CLOCK_RESOLUTION_S, FaultCode, PerAxis, Sample, SimTime};

/// Samples that a full window must be long enough for. Chosen: the fit over fewer is
/// mostly noise.
pub(super) const LEAST_SAMPLES: f64 = 8.0;
/// Longest sample period assumed from the first interval, s. Chosen.
const MAX_FIRST_PERIOD_S: f64 = 0.25;
/// Gain of the filter of the sample period, per sample. Chosen: a time constant of 50
/// samples.
const PERIOD_GAIN: f64 = 0.02;
/// Fraction of the window that must be covered before the residual is judged. Chosen.
pub(super) const FULL_WINDOW_SHARE: f64 = 0.8;
/// Least readings in a window whose residual is judged. Chosen.
const LEAST_JUDGED_SAMPLES: f64 = LEAST_SAMPLES / 2.0;
/// Distance of the twin's free path from the ball at which the twin is rebased, m.
/// Chosen: seldom reached, and small enough that positions keep their digits.
const REBASE_M: f64 = 1.0;

const _: () = assert!(LONGEST_GAP_S <= LONGEST_SPAN_S, "the twin computes whatever is not a gap");

/// The state of the stages.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Pipeline {
    settings: Settings,
    twin: Twin,
    evaluator: Evaluator,
    /// Evidence that confirms a fault of each servo, nats.
    confirm_nats: PerAxis<f64>,
    now: Option<SimTime>,
    period_s: Option<f64>,
    gate: OutlierGate,
    acceleration_filter: AccelerationFilter,
    scatter: PerAxis<Scatter>,
    servos: PerAxis<ServoFilterBank>,
    readings: Stillness,
    repeats: Repeats,
    edge: Edge,
    since_jump_s: f64,
    /// The last jump of the readings, if there was one.
    jump: Option<PositionJump>,
    /// Scatter above which readings count as noisy at present, m.
    noisy_m: f64,
    unjudged_s: f64,
    evidence: Evidence,
    monitors: [Monitor; FaultCode::COUNT],
    n_judged: u64,
    /// Whether the next sample is on a clock that was set back.
    clock_set_back: bool,
    /// Other debounce times than those of the settings. What has some is not serialised.
    #[serde(skip)]
    trial: Trial,
}

impl Pipeline {
    pub(super) fn new(setup: &Setup) -> Self {
        let (rig, settings) = (&setup.rig, setup.settings);
        let limits = PerAxis::from_fn(|axis| {
            let learnt = rig.calibration.as_ref().and_then(|c| c.axes[axis].as_ref());
            let gain = setup.twin.axes[axis].gain.abs();
            // A learnt rig without this axis has no readings along it.
            let absent = rig.calibration.is_some() && learnt.is_none();
            Limits::new(settings.profile, learnt, absent, gain * rig.ball.rolling_gravity())
        });
        let sensor = SensorLimits::new(rig.calibration.as_ref().map(|c| &c.sensor));
        let needed_s = |share: f64| {
            let of = |axis: Axis| limits[axis].window_s(share, 1.0 / rig.sample_rate_hz);
            of(Axis::X).max(of(Axis::Y))
        };
        let adapts = settings.profile == Profile::Default && rig.calibration.is_some();
        let settings = if adapts { settings.with_window(needed_s) } else { settings };
        let confirm_nats = PerAxis::from_fn(|axis| {
            let learnt = rig.calibration.as_ref().and_then(|c| c.axes[axis].as_ref());
            settings.confirming_nats(learnt)
        });
        let servo = |axis: Axis| {
            let learnt = rig.calibration.as_ref().and_then(|c| c.axes[axis].as_ref());
            ServoFilterBank::new(AxisPrior {
                noise_m: limits[axis].noise_m.unwrap_or(0.0),
                learnt: learnt.map(|l| LearntPrior {
                    model_error_m_s2: l.model_error_m_s2,
                    offset_spread_m_s2: l.level_spread_rad * l.gain * rig.ball.rolling_gravity(),
                    gain_spread: l.gain_spread,
                }),
                breakaway_m_s2: limits[axis].breakaway_m_s2,
                air_drag_ratio: rig.ball.air_drag_ratio().min(1.0),
                familiar_m_s2: learnt.map_or(f64::INFINITY, |l| l.familiar_m_s2),
                confirm_nats: confirm_nats[axis],
            })
        };
        // The evidence for suspicion scales with the evidence for confirmation.
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
            acceleration_filter: AccelerationFilter::new(settings.window_s),
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
            monitors: Default::default(),
            n_judged: 0,
            clock_set_back: false,
            trial: Trial::default(),
        }
    }

    /// Tries other limits and debounce times.
    pub(super) fn with_trial(self, trial: &Trial) -> Self {
        let factor = *trial.limit_factor();
        let confirm_nats = PerAxis::from_fn(|axis| factor[axis] * self.confirm_nats[axis]);
        let evaluator = self.evaluator.with_factor(factor);
        Self { confirm_nats, evaluator, trial: *trial, ..self }
    }

    /// The settings in use for the monitor of `code`.
    fn settings_of(&self, code: FaultCode) -> Cow<'_, Settings> {
        self.trial.settings(code, &self.settings)
    }

    /// Passes one sample, in order, through all stages.
    pub(super) fn judge(
        &mut self,
        setup: &Setup,
        sample: &Sample,
        memory: &mut FaultMemory,
        transitions: &mut Vec<Transition>,
    ) {
        let Some(moment) = frame::moment(&setup.rig.mapping, sample) else { return };
        let Some(dt) = self.tick(moment.at) else { return };
        self.n_judged += 1;
        let moment = self.without_readings_far_off(moment);
        self.step_twin(&moment);
        let fresh = self.without_repeats(&moment);
        let (refused, outliers) = self.screen(&fresh, dt);
        self.edge.take(&fresh, dt, refused);
        self.watch_readings(&moment, dt, refused, outliers);
        self.follow_servos(&fresh, refused);
        self.unjudged_s += dt;
        // Time stamps in milliseconds must not make a period one sample longer.
        if self.unjudged_s >= self.settings.period_s - CLOCK_RESOLUTION_S {
            let dt = self.unjudged_s.min(self.settings.period_s + dt);
            self.unjudged_s = 0.0;
            self.acceleration_filter.fit();
            self.noisy_m = self.evaluator.noisy_m(self.blur_m().hypot(self.bend_m()));
            let around = self.surroundings(memory);
            self.collect_evidence(&moment, &around);
            let findings = self.evaluator.evaluate(&self.evidence, &self.readings, &around);
            self.remember(&moment, dt, &findings, memory, transitions);
        }
    }

    /// Removes a reading that is too far off the plate to be a ball.
    fn without_readings_far_off(&self, moment: Moment) -> Moment {
        match self.edge.is_far_off(&moment) {
            true => Moment { position: PerAxis::default(), ..moment },
            false => moment,
        }
    }

    /// Removes a reading that only repeats the previous one.
    fn without_repeats(&mut self, moment: &Moment) -> Moment {
        match self.repeats.is_repeat(moment.at, &moment.position) {
            true => Moment { position: PerAxis::default(), ..*moment },
            false => *moment,
        }
    }

    /// Returns the time since the previous sample, s; `None` if no time has passed. After
    /// a gap or a jump of the clock the pipeline restarts.
    fn tick(&mut self, at: SimTime) -> Option<f64> {
        let dt = match self.now {
            Some(_) if mem::take(&mut self.clock_set_back) => {
                self.restart();
                0.0
            }
            Some(now) if at <= now => return None,
            Some(now) if at - now > self.gap_s() => {
                self.restart();
                0.0
            }
            Some(now) => at - now,
            None => 0.0,
        };
        if dt > 0.0 {
            let period = self.period_s.get_or_insert(dt.min(MAX_FIRST_PERIOD_S));
            *period += PERIOD_GAIN * (dt - *period).clamp(-*period, *period);
        }
        self.now = Some(at);
        Some(dt)
    }

    fn gap_s(&self) -> f64 {
        self.settings.gap_after_s(self.period_s.unwrap_or(0.0))
    }

    /// The window needed for the least number of samples, s.
    fn least_window_s(&self) -> f64 {
        LEAST_SAMPLES * self.period_s.unwrap_or(0.0)
    }

    /// The clock is set back before the next sample.
    pub(super) const fn set_clock_back(&mut self) {
        self.clock_set_back = true;
    }

    /// Forgets the motion; the debounce counters are kept.
    fn restart(&mut self) {
        self.twin.restart();
        Axis::ALL.into_iter().for_each(|axis| self.servos[axis].restart());
        self.readings.restart();
        self.edge.restart();
        self.gate.restart();
        self.forget();
    }

    /// Drops all readings.
    fn forget(&mut self) {
        self.acceleration_filter.forget();
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
            let fit = self.acceleration_filter.fits[axis]
                .map(|f| (f.measured.position, f.measured.velocity));
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
                self.acceleration_filter.rebase(axis, t, p, v);
                self.scatter[axis] = Scatter::default();
                self.servos[axis].rebase(t, p, v);
            }
        }
    }

    /// Stage: outlier gate, then the acceleration filter for measured and twin's path.
    /// Returns whether the gate refused the readings (false if there are none), and how
    /// many earlier ones have turned out to be outliers.
    fn screen(&mut self, moment: &Moment, dt: f64) -> (bool, u32) {
        let t = moment.at.seconds();
        let (predicted, gap_s) = (self.twin.motion().position, self.gap_s());
        self.since_jump_s += dt;
        if self.acceleration_filter.stale(t, gap_s) {
            self.gate.restart();
            self.forget();
        }
        if Axis::ALL.iter().all(|&a| moment.position[a].is_none()) {
            return (false, 0);
        }
        // Relative to the path of the twin that it follows, a ball moves in a straight
        // line.
        let off = |axis: Axis| moment.position[axis].map(|p| p - predicted[axis as usize]);
        let (off_m, noise_m) = (PerAxis::from_fn(off), self.gate_noise_m());
        // A rim turns a ball that moves towards it, not one that lies at it.
        let lies = self.edge.rim.filter(|axis| self.readings.axes[*axis].rests());
        let gated = match self.edge.may_turn(moment.at, lies) {
            true => self.gate.take_at_rim(t, off_m, noise_m),
            false => self.gate.take(t, off_m, noise_m),
        };
        match gated {
            GateOutcome::Jumped { jump, by_m } => {
                self.forget();
                self.since_jump_s = 0.0;
                self.jump = Some(jump);
                self.edge.displace(by_m);
            }
            // The window holds an outlier that had been accepted.
            GateOutcome::Accepted { undone: true, .. } => self.forget(),
            GateOutcome::Accepted { .. } | GateOutcome::Refused => {}
        }
        for (i, axis) in Axis::ALL.into_iter().enumerate() {
            if let (true, Some(position)) = (gated.usable(), moment.position[axis]) {
                let least_s = self.least_window_s();
                self.acceleration_filter.push(axis, t, position, predicted[i], least_s);
                self.scatter[axis].take(t, position - predicted[i], self.noisy_m);
            }
        }
        match gated {
            GateOutcome::Accepted { outliers, .. } => (false, outliers),
            other => (!other.usable(), 0),
        }
    }

    /// Standard deviation of readings about their path, for the outlier gate, m.
    fn gate_noise_m(&self) -> f64 {
        let noise_m = match self.repeats.are_expected() {
            true => self.noise_m().hypot(self.blur_m()),
            false => self.noise_m(),
        };
        if self.settings.learnt { noise_m } else { noise_m.max(UNKNOWN_NOISE_M) }
    }

    /// Standard deviation of healthy readings, the larger of both axes, m.
    fn noise_m(&self) -> f64 {
        self.evaluator.noise_m()
    }

    /// Stage: stillness, missing and identical readings.
    fn watch_readings(&mut self, moment: &Moment, dt: f64, refused: bool, outliers: u32) {
        let limits = *self.evaluator.limits();
        let pull_m_s2 = PerAxis::from_fn(|a| moment.command[a].map_or(0.0, |_| self.pull_m_s2(a)));
        let held_m_s2 = PerAxis::from_fn(|a| limits[a].pressing_m_s2());
        let asked_m_s2 = PerAxis::from_fn(|a| {
            let size = pull_m_s2[a].abs();
            if size > held_m_s2[a] { size } else { 0.0 }
        });
        self.edge.take_pull(&pull_m_s2, held_m_s2.x.max(held_m_s2.y), dt);
        self.readings.update(&Reading {
            dt,
            position_m: moment.position,
            asked_m_s2,
            still_m: self.evaluator.still_m(),
            refused,
            // Bounces off the rim look like outliers.
            outliers: if self.edge.clear_s < self.settings.window_s { 0 } else { outliers },
        });
    }

    /// Returns the acceleration that the plate demands of the ball along `axis`, m/s²: the least that
    /// the uncertainty of this session's level allows.
    fn pull_m_s2(&self, axis: Axis) -> f64 {
        self.servos[axis].least_pull_m_s2(self.twin.motion().acceleration[axis as usize])
    }

    /// Stage: evidence against each servo.
    fn follow_servos(&mut self, moment: &Moment, refused: bool) {
        if self.settings.profile == Profile::Textbook {
            return;
        }
        let motion = *self.twin.motion();
        let answers = PerAxis::from_fn(|axis| self.answers(axis));
        for (i, axis) in Axis::ALL.into_iter().enumerate() {
            let servo = &mut self.servos[axis];
            match moment.position[axis] {
                _ if self.edge.at_edge => servo.restart(),
                _ if moment.command[axis].is_none() => servo.pause(),
                Some(_) if !answers[axis] => servo.pause(),
                Some(position) if !refused && !self.gate.suspects_jump() => {
                    let path = TwinPath {
                        position_m: motion.position[i],
                        velocity_m_s: motion.velocity[i],
                        acceleration_m_s2: motion.acceleration[i],
                    };
                    servo.take(moment.at.seconds(), position, &path);
                }
                _ => {}
            }
        }
    }

    /// Whether the ball rests within its breakaway angle.
    fn rests(&self, axis: Axis) -> bool {
        let held_m_s2 = self.evaluator.limits()[axis].pressing_m_s2();
        self.readings.axes[axis].rests() && self.pull_m_s2(axis).abs() < held_m_s2
    }

    /// Whether the ball's motion along `axis` can respond to the servo: not while the
    /// ball rests within its breakaway angle, not while identical readings of a ball that
    /// is asked to move may be frozen, and not while it stands still along both axes.
    fn answers(&self, axis: Axis) -> bool {
        let may_be_dead = self.readings.axes[axis].repeats(self.evaluator.limits()[axis].repeat_s);
        !self.rests(axis) && !may_be_dead && !self.readings.is_held()
    }

    /// Stage: residual, limit and enable condition.
    fn collect_evidence(&mut self, moment: &Moment, around: &Surroundings) {
        let window_s = self.acceleration_filter.window_s(self.least_window_s());
        let see = |axis: Axis| {
            let mut e = self.axis_evidence(moment, axis, window_s);
            let pull_m_s2 = self.pull_m_s2(axis).abs();
            e.enabled =
                self.evaluator.enabled(axis, &e, window_s, pull_m_s2, &self.readings, around);
            let suspicious = self.monitors[FaultCode::servo(axis) as usize].suspicious();
            let answers = self.settings.profile == Profile::Default;
            e.answer = answers.then(|| self.servos[axis].answer(suspicious));
            e
        };
        let fits = &self.acceleration_filter.fits;
        // The scatter about a curve takes a push for noise, that about neighbours a sharp
        // bend; noise raises both.
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

    /// Returns the evidence along `axis` over `window_s`, without the enable condition and the servo's
    /// response.
    fn axis_evidence(&self, moment: &Moment, axis: Axis, window_s: f64) -> AxisEvidence {
        let (fit, servo) = (self.acceleration_filter.fits[axis], &self.servos[axis]);
        let full = fit.filter(|f| {
            moment.position[axis].is_some()
                && f.span_s >= FULL_WINDOW_SHARE * window_s
                && f.n as f64 >= LEAST_JUDGED_SAMPLES
        });
        let session_offset = |residual| self.session_offset(axis, residual);
        let twin = full.map(|f| {
            let residual = f.deviation.acceleration;
            f.measured.acceleration - residual + session_offset(residual)
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
            path_nats: servo.path_nats(),
            path_limit_nats: self.evaluator.limits()[axis].path_nats,
            answer: None,
            identical_s: self.readings.axes[axis].identical_s,
        }
    }

    /// Returns the part of a residual along `axis` that this session's level explains,
    /// m/s²; zero for a rig that is not learnt. At most the whole residual.
    fn session_offset(&self, axis: Axis, residual_m_s2: f64) -> f64 {
        let offset = self.servos[axis].steady_m_s2();
        let explains = self.settings.learnt && offset * residual_m_s2 > 0.0;
        if explains { residual_m_s2.signum() * residual_m_s2.abs().min(offset.abs()) } else { 0.0 }
    }

    /// The blur of a reading, m: how far the ball moves within the uncertainty of the
    /// reading's time.
    fn blur_m(&self) -> f64 {
        let speed =
            |axis: Axis| self.acceleration_filter.fits[axis].map_or(0.0, |f| f.measured.velocity);
        let (x, y) = (speed(Axis::X), speed(Axis::Y));
        let (period_s, held) = (self.period_s.unwrap_or(0.0), self.repeats.are_expected());
        blur_m((x * x + y * y).sqrt(), period_s, held)
    }

    /// The bend of the path between three readings, m, when the ball's acceleration
    /// differs from the twin's by the limit of the residual.
    fn bend_m(&self) -> f64 {
        let off_m_s2 = |axis: Axis| self.evaluator.limits()[axis].at(0.0, 0.0);
        bend_m(off_m_s2(Axis::X).max(off_m_s2(Axis::Y)), self.period_s.unwrap_or(0.0))
    }

    /// Whether the readings have recently jumped farther than a ball can move.
    fn jumped(&self) -> bool {
        self.since_jump_s < self.settings_of(FaultCode::Sensor).jump_lasts_s()
    }

    fn surroundings(&self, memory: &FaultMemory) -> Surroundings {
        Surroundings {
            clear_s: self.edge.clear_s,
            at_edge: self.edge.at_edge,
            rim: self.edge.rim,
            rim_s: self.edge.rim_s,
            off_rim_s: self.edge.off_rim_s.into(),
            over_the_edge: self.edge.at_edge && self.edge.is_open(),
            jumped: self.jumped(),
            noisy_m: self.noisy_m,
            servos_have_passed: Axis::ALL.iter().all(|&axis| {
                let status = memory.record(FaultCode::servo(axis)).status;
                status.completed_this_cycle() && !status.test_failed()
            }),
            has_broken_servo: Axis::ALL.iter().any(|&axis| {
                let code = FaultCode::servo(axis);
                memory.goes_on(code) && memory.record(code).status.failed_this_cycle()
            }),
        }
    }

    /// Stage: debounce and fault memory.
    fn remember(
        &mut self,
        moment: &Moment,
        dt: f64,
        findings: &[Finding; FaultCode::COUNT],
        memory: &mut FaultMemory,
        transitions: &mut Vec<Transition>,
    ) {
        let mut confirmed = [false; FaultCode::COUNT];
        let mut blamed = false;
        for (&code, finding) in FaultCode::ALL.iter().zip(findings) {
            let settings = &*self.trial.settings(code, &self.settings);
            let watch = &mut self.monitors[code as usize];
            let rising = code.axis().and_then(|axis| self.servos[axis].rising_since());
            let share =
                code.axis().map_or(1.0, |a| self.settings.confirm_nats / self.confirm_nats[a]);
            let finding = &Finding { nats: finding.nats.map(|n| share * n), ..*finding };
            let qualified = watch.update(code, finding, moment.at, dt, settings, rising);
            let qualified = match settings.confirms(code, finding.kind) {
                true => qualified,
                false => qualified.min(Qualified::Failed),
            };
            let went_on = memory.goes_on(code);
            watch.apply(code, qualified, settings, &self.evidence, memory, transitions);
            confirmed[code as usize] = !went_on && memory.goes_on(code);
            let failed = match qualified {
                Qualified::Tripped => true,
                // Evidence continues to accumulate until it confirms.
                Qualified::Failed => finding.nats.is_none(),
                Qualified::No | Qualified::Passed => false,
            };
            blamed |= failed && code.axis().is_none();
        }
        for (i, watch) in self.monitors.iter_mut().enumerate() {
            let mut others = FaultCode::ALL.iter().filter(|code| **code as usize != i);
            if others.clone().any(|code| confirmed[*code as usize]) {
                watch.another_confirmed();
            } else if findings[i].test == Test::NotTested
                && others.any(|code| memory.goes_on(*code))
            {
                watch.could_not_judge(dt);
            }
        }
        if blamed {
            // The blamed cause explains the earlier suspicion of the servos.
            for axis in Axis::ALL {
                self.servos[axis].exonerate();
                self.monitors[FaultCode::servo(axis) as usize].exonerate();
            }
        }
    }

    /// Resets the monitor of `code`, as after a clear.
    pub(super) fn reset_monitor(&mut self, code: FaultCode) {
        self.monitors[code as usize] = Monitor::default();
        if let Some(axis) = code.axis() {
            self.servos[axis].exonerate();
        }
    }

    /// Returns the parameters of each servo over this session.
    pub(super) fn servo_estimates(&self) -> PerAxis<Option<ServoEstimate>> {
        PerAxis::from_fn(|axis| self.servos[axis].estimate())
    }

    /// Returns the offset of each servo in this session, and its standard error, m/s².
    pub(super) fn steady_offsets(&self) -> PerAxis<(f64, f64)> {
        PerAxis::from_fn(|axis| {
            let servo = &self.servos[axis];
            (servo.steady_m_s2(), servo.steady_error_m_s2())
        })
    }

    /// Largest evidence against each servo so far, nats, scaled to the evidence that
    /// confirms without a calibration.
    pub(super) fn most_nats(&self) -> PerAxis<f64> {
        PerAxis::from_fn(|axis| self.monitors[FaultCode::servo(axis) as usize].most_nats())
    }

    /// Largest evidence of the path of each axis so far, nats.
    pub(super) fn most_path_nats(&self) -> PerAxis<f64> {
        PerAxis::from_fn(|axis| self.servos[axis].most_path_nats())
    }

    /// The closest approach of each monitor to an alarm by duration of failure, 0 to 1,
    /// and the time for which it could judge, s.
    pub(super) fn nearest(&self) -> [(f64, f64); FaultCode::COUNT] {
        core::array::from_fn(|i| (self.monitors[i].nearest(), self.monitors[i].judged_s()))
    }

    /// Log-likelihood of the readings of each axis under the healthy hypothesis, nats.
    pub(super) fn log_likelihood_nats(&self) -> PerAxis<f64> {
        PerAxis::from_fn(|axis| self.servos[axis].log_likelihood_nats())
    }

    /// The evidence of the last sample.
    pub(super) const fn evidence(&self) -> &Evidence {
        &self.evidence
    }

    /// Time of the last sample judged.
    pub(super) const fn now(&self) -> Option<SimTime> {
        self.now
    }

    /// The values at which the monitor of `code` decides.
    pub(super) fn thresholds(&self, code: FaultCode) -> Thresholds {
        let (confirm, suspect) = (self.settings.confirm_nats, self.settings.suspect_nats);
        let confirm_nats = code.axis().map(|a| self.confirm_nats[a]).filter(|n| n.is_finite());
        let suspect_nats = confirm_nats.map(|nats| nats / confirm * suspect);
        let times = DebounceTimes::of(code, None, false, &self.settings_of(code));
        Thresholds { times, suspect_nats, confirm_nats }
    }

    /// The result that the monitor of `code` can give so far. While a fault of another monitor goes on,
    /// it must have judged for as long again, and for most of that time: "no fault" is not said of a time
    /// that nobody judged.
    fn reach(&self, code: FaultCode) -> Reach {
        let judged_s = self.monitors[code as usize].judged_since_s();
        match InUse::judges(judged_s, DebounceTimes::needed_s(code, &self.settings_of(code))) {
            false => Reach::NotJudged,
            true if !self.settings.confirms(code, None) => Reach::NotLearnt,
            true => Reach::Judged,
        }
    }

    /// Counts how much of this session each monitor could judge.
    pub(super) fn count_use(&self, coverage: &Coverage, memory: &mut FaultMemory) {
        for (&code, watch) in FaultCode::ALL.iter().zip(&self.monitors) {
            let needed_s = DebounceTimes::needed_s(code, &self.settings_of(code));
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
            let (watch, status) = (&self.monitors[i], memory.record(FaultCode::ALL[i]).status);
            let suspect_nats = self.thresholds(FaultCode::ALL[i]).suspect_nats;
            MonitorState {
                counter: watch.counter(),
                nats: suspect_nats.map_or(0.0, |nats| watch.weight() * nats),
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
        let beside_ball = |a: Axis| {
            self.acceleration_filter.fits[a].map_or((0.0, 0.0), |f| {
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
            unjudged: None,
            twin_position_m: PerAxis::from_fn(|a| beside_ball(a).0),
            twin_velocity_m_s: PerAxis::from_fn(|a| beside_ball(a).1),
            plate_angle_rad: self.twin.plate_angle(),
            evidence: self.evidence.clone(),
            monitors,
            fidelity: *self.twin.fidelity(),
        }
    }
}

/// Time between two readings of a sensor that is slower than its log, s; zero otherwise.
fn refresh_s(rig: &Rig) -> f64 {
    rig.calibration.as_ref().map_or(0.0, |c| c.sensor.refresh_s)
}
