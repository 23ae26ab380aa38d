//! Learns the parameters of a rig from healthy sessions.
//!
//! In windows of about a second the measured path of one axis is fitted by `x₀ + v₀ t +
//! k·z(t) + b t²/2 + c·r(t)`, where z is the twin's path under the recorded commands and
//! r the effect of rolling resistance. k (gain), b (level) and c (resistance) belong to
//! the rig, x₀ and v₀ to the window. Dead time and lag are searched for. The worst fifth
//! of the windows is dropped (least trimmed squares, Rousseeuw 1984), so that pushes by
//! hand do not count. Fitting the path instead of its second difference explains 94–98 %
//! of the variance of real recordings where differences explain 10–60 %.

mod certificate;
mod commanded;
mod data;
mod fit;
mod likelihood;
mod proof;
mod prospects;
mod recording;
mod search;
mod self_test;
mod sessions;
mod spread;
mod widening;

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use data::{Data, MOST_LEFT_OUT};
use fit::{AxisFit, Fitter, SessionFit};
use prospects::prospects;
pub(super) use recording::MOVING_M;
use recording::{Recording, Stretch};
use search::{Found, search};
use sessions::{Estimate, Population, combined, session_spread};
use spread::{healthy_spread, level_at_rest};

use super::{Misfit, Plausibility, Rig};
use crate::diagnosis::{
    AxisCalibration, Calibration, CalibrationOrigin, LeftOut, Prospects, SensorCalibration,
    SessionEstimate,
};
use crate::vocabulary::{Axis, FaultCode, FaultKind, PerAxis, Sample};

/// Lengths of a window, s, the preferred first: a ball that sticks every other second
/// offers only short stretches of motion. Chosen.
pub(super) const WINDOWS_S: [f64; 2] = [1.2, 0.6];
/// Least time that all sessions last together, s. Chosen: half of the minute that people are asked to
/// record. Less does not show how the rig varies, and its healthy variation would count as faults.
const LEAST_S: f64 = 30.0;
/// Least number of windows with a moving ball. Chosen.
const LEAST_WINDOWS: usize = 6;
/// Largest relative standard error of the gain. Chosen.
const WORST_GAIN_ERROR: f64 = 0.2;
/// Least fraction of the paths' variance that the fit must explain. Chosen.
const LEAST_EXPLAINED: f64 = 0.5;
/// Standard deviation of commands that move a ball, rad: 0.3°. With less, unexplained
/// motion was not commanded. Chosen.
pub(super) const MOVING_RAD: f64 = 0.005;

/// Spread of levels from session to session, rad. The population counts as one session,
/// since levels differ more between rigs than gains do.
const LEVELS: Population =
    Population { deviation: AxisCalibration::POPULATION_LEVEL_SPREAD_RAD, n_sessions: 1.0 };
/// Spread of gains from session to session, as a fraction.
const GAINS: Population =
    Population { deviation: AxisCalibration::POPULATION_GAIN_SPREAD, n_sessions: 2.0 };

/// Why a rig cannot be learnt.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CannotCalibrate {
    #[error("session {session}: {misfit}")]
    Implausible { session: usize, misfit: Misfit },
    #[error("no axis has both commands and positions: nothing to calibrate from")]
    NoAxis,
    #[error(
        "the recordings last {seconds:.0} s together, and at least {LEAST_S:.0} s are needed: add \
         {more:.0} s or more with the ball rolling, also in further recordings",
        more = LEAST_S - seconds
    )]
    TooBrief { seconds: f64 },
    #[error(
        "{axis}: only {n_windows} stretches of motion of {length} s are usable, {LEAST_WINDOWS} are needed; \
         record at least a minute with the ball rolling about the middle of the plate",
        axis = axis.as_str(), length = WINDOWS_S[1]
    )]
    TooShort { axis: Axis, n_windows: usize },
    #[error(
        "{axis}: the commands of {command} move too little to tell the gain ({known}, \
         ±20 % is needed); record steps or circles of a few degrees",
        axis = axis.as_str(), command = axis.command(), known = known(*percent)
    )]
    TooLittleExcitation { axis: Axis, percent: f64 },
    #[error(
        "{axis}: the ball moves against the command of {command} (gain {gain:.2}); \
         set the sign or the swap of the axes in the asset file",
        axis = axis.as_str(), command = axis.command()
    )]
    Reversed { axis: Axis, gain: f64 },
    #[error(
        "{axis}: the command of {command} explains only {percent:.0} % of the ball's motion, and neither the \
         other axis nor the opposite sign clearly does: noise, drag, stiction or a push by hand; \
         check the sensor, and that the recording is healthy",
        axis = axis.as_str(), command = axis.command()
    )]
    Unexplained { axis: Axis, percent: f64 },
    #[error(
        "there is too little data to test the calibration: none can be made from {what} alone \
         ({reason}); record twice as long, or several sessions"
    )]
    Untested { what: &'static str, reason: Box<CannotCalibrate> },
    #[error(
        "session {session}: {n} moments, {percent:.1} % of it, contradict the rest, the first at \
         {from_s:.2} s: {reason}; more than {most:.0} % of a session is not left out, since then the \
         sensor does so all day: mend it, or leave this session out",
        from_s = first.from_s, reason = first.reason, most = 100.0 * MOST_LEFT_OUT
    )]
    Contradictory { session: usize, percent: f64, n: usize, first: LeftOut },
    #[error(
        "session {session}: the ball stood {n} times where the plate would have moved it, the first \
         time at {from_s:.2} s: it sticks; clean ball and plate, or leave this session out"
    )]
    Sticks { session: usize, n: usize, from_s: f64 },
    #[error(
        "judged by a calibration from the other data, session {session} would report {code} at {at_s:.2} s{of_kind}; \
         leave it out if the rig was not healthy then, or record more sessions",
        code = code.as_str(), of_kind = kind.map_or(String::new(), |k| format!(" ({})", k.as_str()))
    )]
    AccusesItself { session: usize, code: FaultCode, kind: Option<FaultKind>, at_s: f64 },
    #[error(
        "the calibration would be blind: a servo that stopped answering during these recordings would mostly \
         not be found within 10 s, along either axis; record at least a minute in which the commands \
         keep the ball rolling along both axes, such as circles or figures, and not a ball that mostly rests"
    )]
    Blind,
    #[error("it was stopped before its end")]
    Stopped,
}

/// Learns gain, dead time, lag, level, noise and breakaway of each axis from healthy
/// `sessions` of `rig`. The [`origin`](Calibration::origin) is left empty, for the
/// caller to state.
///
/// An axis without commands or without positions is left out.
///
/// # Errors
/// [`CannotCalibrate`], which says what is missing.
pub fn calibrate(rig: &Rig, sessions: &[Vec<Sample>]) -> Result<Calibration, CannotCalibrate> {
    learn(rig, sessions, &|| true).map(|(learnt, _)| learnt)
}

/// Whether a calibration goes on; asked before each of its steps.
type GoOn<'a> = &'a dyn Fn() -> bool;

/// # Errors
/// [`CannotCalibrate::Stopped`] unless it goes on.
fn check(go_on: GoOn<'_>) -> Result<(), CannotCalibrate> {
    if go_on() { Ok(()) } else { Err(CannotCalibrate::Stopped) }
}

/// Like [`calibrate`]; also returns the sessions without what was left out.
fn learn(
    rig: &Rig,
    sessions: &[Vec<Sample>],
    go_on: GoOn<'_>,
) -> Result<(Calibration, Vec<Vec<Sample>>), CannotCalibrate> {
    check_fit(rig, sessions)?;
    let n_samples = sessions.iter().map(|s| s.len() as u64).sum();
    let mut data = Data::new(sessions);
    // The last sample of a recording comes a period before its end.
    let seconds = data.duration_s().round();
    if seconds < LEAST_S {
        return Err(CannotCalibrate::TooBrief { seconds });
    }
    // Ends, since each round but the last leaves out more.
    loop {
        let taught = learn_untested(rig, &data.sessions, go_on)
            .map_err(|reason| with_cause(rig, sessions, reason))?;
        if let Some(proven) = proof::prove(rig, taught, &mut data, go_on)? {
            let Data { sessions, left_out, .. } = data;
            return Ok((Calibration { n_samples, left_out, ..proven }, sessions));
        }
    }
}

/// Checks that the sessions fit the description of `rig`.
///
/// # Errors
/// The first contradiction between a session and the description of `rig`.
fn check_fit(rig: &Rig, sessions: &[Vec<Sample>]) -> Result<(), CannotCalibrate> {
    misfit(rig, sessions, Misfit::prevents_learning).map_or(Ok(()), Err)
}

/// Returns the first misfit that is `wanted`.
fn misfit(
    rig: &Rig,
    sessions: &[Vec<Sample>],
    wanted: impl Fn(Misfit) -> bool,
) -> Option<CannotCalibrate> {
    // An earlier calibration must not hide a misfit.
    let rig = Rig { calibration: None, ..rig.clone() };
    sessions.iter().zip(1..).find_map(|(samples, session)| {
        let found = Plausibility::of(&rig, samples).misfits().into_iter().find(|m| wanted(*m))?;
        Some(CannotCalibrate::Implausible { session, misfit: found })
    })
}

/// Returns the cause of `reason` if it is known (such as swapped axes or a wrong sign), else
/// `reason`.
fn with_cause(rig: &Rig, sessions: &[Vec<Sample>], reason: CannotCalibrate) -> CannotCalibrate {
    match reason {
        CannotCalibrate::NoAxis
        | CannotCalibrate::Unexplained { .. }
        | CannotCalibrate::TooLittleExcitation { .. }
        | CannotCalibrate::TooShort { .. } => {
            misfit(rig, sessions, Misfit::hinders_learning).unwrap_or(reason)
        }
        other => other,
    }
}

/// How well a gain would be known, in words.
fn known(percent: f64) -> String {
    match percent.is_finite() {
        true => format!("it would be known to ±{percent:.0} %"),
        false => "nothing is known of it".to_owned(),
    }
}

/// Learns from `sessions` of `rig` without testing the result.
fn learn_untested(
    rig: &Rig,
    sessions: &[Vec<Sample>],
    go_on: GoOn<'_>,
) -> Result<Calibration, CannotCalibrate> {
    let recordings: Vec<Recording> = sessions.iter().map(|s| Recording::new(rig, s)).collect();
    let learn = |axis: Axis| {
        check(go_on)?;
        let present = recordings.iter().any(|r| r.has(axis));
        present.then(|| learn_axis(rig, &recordings, axis)).transpose()
    };
    let learnt = PerAxis { x: learn(Axis::X)?, y: learn(Axis::Y)? };
    if learnt.x.is_none() && learnt.y.is_none() {
        return Err(CannotCalibrate::NoAxis);
    }
    let axes = PerAxis::from_fn(|axis| learnt[axis].as_ref().map(|l| l.calibration));
    let of_session =
        |i: usize| PerAxis::from_fn(|axis| learnt[axis].as_ref().and_then(|l| l.sessions[i]));
    let refresh_s = recordings.iter().map(|r| r.refresh_s).fold(0.0, f64::max);
    let learnt = Calibration {
        axes,
        sensor: SensorCalibration { refresh_s, ..SensorCalibration::default() },
        sessions: (0..recordings.len()).map(of_session).collect(),
        origin: CalibrationOrigin::default(),
        n_samples: 0,
        duration_s: recordings.iter().map(Recording::duration_s).sum(),
        certificate: None,
        prospects: None,
        left_out: Vec::new(),
    };
    Ok(likelihood::with_model_errors(rig, learnt, sessions))
}

/// Like [`calibrate`], and also computes [`Calibration::prospects`].
///
/// # Errors
/// As for [`calibrate`].
pub fn calibrate_with_prospects(
    rig: &Rig,
    sessions: &[Vec<Sample>],
) -> Result<Calibration, CannotCalibrate> {
    calibrate_with_prospects_while(rig, sessions, &|| true)
}

/// Like [`calibrate_with_prospects`], but asks `go_on` before each step, some ten in all, and
/// stops once it returns false. It may also wait.
///
/// # Errors
/// As for [`calibrate`], and [`CannotCalibrate::Stopped`].
pub fn calibrate_with_prospects_while(
    rig: &Rig,
    sessions: &[Vec<Sample>],
    go_on: &dyn Fn() -> bool,
) -> Result<Calibration, CannotCalibrate> {
    let (mut calibration, sessions) = learn(rig, sessions, go_on)?;
    check(go_on)?;
    let learnt = Rig { calibration: Some(Box::new(calibration.clone())), ..rig.clone() };
    calibration.prospects = prospects(&learnt, &sessions);
    if calibration.prospects.as_ref().is_some_and(Prospects::are_blind) {
        return Err(CannotCalibrate::Blind);
    }
    Ok(calibration)
}

/// The learnt parameters of one axis, and the estimates of each session.
struct LearntAxis {
    calibration: AxisCalibration,
    sessions: Vec<Option<SessionEstimate>>,
}

/// Learns from long windows, or from short ones if there are too few.
fn learn_axis(
    rig: &Rig,
    recordings: &[Recording],
    axis: Axis,
) -> Result<LearntAxis, CannotCalibrate> {
    let [long_s, short_s] = WINDOWS_S;
    learn_in_windows(rig, recordings, axis, long_s)
        .or_else(|_| learn_in_windows(rig, recordings, axis, short_s))
}

fn learn_in_windows(
    rig: &Rig,
    recordings: &[Recording],
    axis: Axis,
    window_s: f64,
) -> Result<LearntAxis, CannotCalibrate> {
    let stretches: Vec<Vec<Stretch>> =
        recordings.iter().map(|r| r.stretches(axis, window_s)).collect();
    let fitter = Fitter { rig, recordings, stretches, axis };
    let n_windows = fitter.n_windows();
    if n_windows < LEAST_WINDOWS {
        return Err(CannotCalibrate::TooShort { axis, n_windows });
    }
    let still = CannotCalibrate::TooLittleExcitation { axis, percent: f64::INFINITY };
    let Found { dead_time_s, lag_s, fit: found } = search(&fitter).ok_or(still)?;
    let swings = recordings.iter().any(|r| r.swing_rad(axis) > MOVING_RAD);
    check_explained(axis, &found, swings)?;
    let slope = found.gain * axis.drive_sign() * rig.ball.rolling_gravity();
    let levels = levels(recordings, axis, dead_time_s + lag_s, slope, &found);
    let known: Vec<Estimate> = levels.iter().flatten().copied().collect();
    let level =
        session_spread(&known, &LEVELS).ok_or(CannotCalibrate::TooShort { axis, n_windows })?;
    let healthy = {
        let (gain, resistance) = (found.gain, found.resistance_m_s2);
        let levels: Vec<f64> = levels.iter().map(|l| l.map_or(level.mean, |l| l.value)).collect();
        healthy_spread(&fitter, dead_time_s, lag_s, gain, &levels, resistance)
    };
    let calibration = AxisCalibration {
        gain: found.gain,
        dead_time_s,
        lag_s,
        level_rad: level.mean,
        level_spread_rad: level.deviation,
        gain_spread: gain_spread(&found),
        resistance_m_s2: found.resistance_m_s2,
        noise_m: healthy.noise_m.max(1e-5),
        breakaway_rad: healthy.breakaway_rad,
        longest_repeat_s: healthy.longest_repeat_s,
        rest_s: healthy.rest_s,
        residual_m_s2: healthy.residual_m_s2.max(1e-4),
        model_error_m_s2: AxisCalibration::assumed_model_error_m_s2(healthy.residual_m_s2),
        familiar_m_s2: healthy.familiar_m_s2,
        most_nats: 0.0,
        most_path_nats: None,
    };
    Ok(LearntAxis { calibration, sessions: by_session(&levels, &found) })
}

/// Checks that the command of `axis` explains the ball's motion, with a gain that is
/// known well enough. `swings` tells whether the command moves.
fn check_explained(axis: Axis, found: &AxisFit, swings: bool) -> Result<(), CannotCalibrate> {
    let error = found.gain_error / found.gain.abs();
    let unexplained = found.share.is_nan() || found.share < LEAST_EXPLAINED;
    let percent = 100.0 * found.share.max(0.0);
    if unexplained && swings {
        return Err(CannotCalibrate::Unexplained { axis, percent });
    }
    if error.is_nan() || error > WORST_GAIN_ERROR {
        return Err(CannotCalibrate::TooLittleExcitation { axis, percent: 100.0 * error });
    }
    if found.gain <= 0.0 {
        return Err(CannotCalibrate::Reversed { axis, gain: found.gain });
    }
    if unexplained {
        return Err(CannotCalibrate::Unexplained { axis, percent });
    }
    Ok(())
}

/// Returns the level of each session, rad, from the ball's motion and from where it
/// rested. One radian accelerates the ball by `slope` m/s².
fn levels(
    recordings: &[Recording],
    axis: Axis,
    delay_s: f64,
    slope: f64,
    found: &AxisFit,
) -> Vec<Option<Estimate>> {
    let in_motion = |s: &SessionFit| Estimate {
        value: s.offset_m_s2 / slope,
        error: (s.offset_error_m_s2 / slope).abs(),
    };
    let level = |(s, recording): (&Option<SessionFit>, &Recording)| {
        combined(s.as_ref().map(in_motion), level_at_rest(recording, axis, delay_s))
    };
    found.sessions.iter().zip(recordings).map(level).collect()
}

/// Standard deviation of the gain from session to session, as a fraction.
fn gain_spread(found: &AxisFit) -> f64 {
    let share = |s: &SessionFit| Estimate {
        value: s.gain / found.gain,
        error: (s.gain_error / found.gain).abs(),
    };
    let gains: Vec<Estimate> = found.sessions.iter().flatten().map(share).collect();
    session_spread(&gains, &GAINS).map_or(GAINS.deviation, |g| g.deviation)
}

/// Returns the estimates of each session; `None` if it has no level.
fn by_session(levels: &[Option<Estimate>], found: &AxisFit) -> Vec<Option<SessionEstimate>> {
    let estimate = |(level, fit): (&Option<Estimate>, &Option<SessionFit>)| {
        let level = (*level)?;
        let gain = fit.map(|f| (f.gain, f.gain_error));
        Some(SessionEstimate { level_rad: level.value, level_error_rad: level.error, gain })
    };
    levels.iter().zip(&found.sessions).map(estimate).collect()
}

#[cfg(test)]
mod refusal_tests;

#[cfg(test)]
pub(in crate::engine) mod tests {
    use super::fit::without_line;
    use super::*;
    use crate::diagnosis::Profile;
    use crate::plant::{RollingState, ServoModel, Twin, TwinAxis, TwinModel};
    use crate::vocabulary::SimTime;

    /// A session of a rig with known gain, dead time, lag and level under a sum of sines,
    /// simulated by the twin: the ball never rests and never leaves the plate.
    pub(in crate::engine) fn session(seconds: f64, amplitude: f64, gain: f64) -> Vec<Sample> {
        let rig = Rig::chapter("a");
        let servo = ServoModel::new(0.2, 0.05, 100.0).unwrap();
        let axis = TwinAxis { gain, level_rad: 0.01, ..TwinAxis::new(servo, 0.06) };
        let mut twin = Twin::new(TwinModel::new(rig.ladder(Profile::Default), axis));
        let times: Vec<f64> = (0..(seconds / 0.01) as u32).map(|i| f64::from(i) * 0.01).collect();
        // The level is compensated, as by a controller.
        let command = |w: f64, t: f64| -0.01 + amplitude * ((w * t).cos() + (2.7 * w * t).sin());
        let (mut commands, mut paths) = (Vec::new(), [Vec::new(), Vec::new()]);
        for &t in &times {
            let now = PerAxis { x: Some(command(3.0, t)), y: Some(command(3.5, t)) };
            twin.advance(SimTime::new(t).unwrap(), now, &RollingState::default());
            commands.push(now);
            paths[0].push(twin.motion().position.x);
            paths[1].push(twin.motion().position.y);
        }
        let [x, y] = paths.map(|path| without_line(&times, path));
        // Readings are rounded to tenths of a millimetre.
        let read = |position: f64| Some((position * 1e4).round() * 1e-4);
        (0..times.len())
            .map(|i| Sample {
                seq: None,
                t_s: times[i],
                cmd_qx_rad: commands[i].y,
                cmd_qy_rad: commands[i].x,
                x_m: read(x[i]),
                y_m: read(y[i]),
            })
            .collect()
    }

    #[test]
    fn validate_that_what_was_put_in_is_learnt() {
        let rig = Rig::chapter("a");
        let learnt = calibrate(&rig, &[session(60.0, 0.03, 0.85)]).unwrap();
        for axis in Axis::ALL {
            let found = learnt.axes[axis].unwrap();
            assert!((found.gain - 0.85).abs() < 0.01, "{axis:?} {found:?}");
            assert!((found.level_rad - 0.01).abs() < 1e-3, "{axis:?} {found:?}");
            let delay = found.dead_time_s + found.lag_s;
            assert!((delay - 0.11).abs() < 0.01, "{axis:?} {found:?}");
            assert!(found.noise_m < 1e-4, "{axis:?} {found:?}");
        }
    }

    #[test]
    fn refusals_say_what_is_missing() {
        let rig = Rig::chapter("a");
        let refused = |s: Vec<Sample>| calibrate(&rig, &[s]).unwrap_err();
        assert_eq!(refused(session(20.0, 0.03, 1.0)), CannotCalibrate::TooBrief { seconds: 20.0 });
        let mut mostly_blind = session(40.0, 0.03, 1.0);
        for s in &mut mostly_blind[500..] {
            (s.x_m, s.y_m) = (None, None);
        }
        assert!(matches!(refused(mostly_blind), CannotCalibrate::TooShort { .. }));
        assert!(matches!(refused(session(60.0, 0.03, -1.0)), CannotCalibrate::Reversed { .. }));
        let mut blind = session(60.0, 0.03, 1.0);
        for s in &mut blind {
            (s.x_m, s.cmd_qx_rad) = (None, None);
        }
        assert_eq!(refused(blind), CannotCalibrate::NoAxis);
    }

    /// A ball at rest is read with less noise than a rolling one, and its twin makes no
    /// error.
    #[test]
    fn a_ball_at_rest_makes_no_rig_look_better() {
        let rig = Rig::chapter("a");
        let rolling = session(60.0, 0.03, 0.85);
        let mut with_rest = rolling.clone();
        let last = *rolling.last().unwrap();
        let later = |i: u32| Sample { t_s: last.t_s + 0.01 * f64::from(i), ..last };
        with_rest.extend((1..9000).map(later));
        let learnt = |s: Vec<Sample>| calibrate(&rig, &[s]).unwrap().axes.x.unwrap();
        let (rolling, with_rest) = (learnt(rolling), learnt(with_rest));
        assert!((with_rest.noise_m / rolling.noise_m - 1.0).abs() < 0.05, "{with_rest:?}");
        assert!(
            (with_rest.residual_m_s2 / rolling.residual_m_s2 - 1.0).abs() < 0.2,
            "{with_rest:?}"
        );
    }

    #[test]
    fn a_calibration_that_is_stopped_takes_no_further_step() {
        let (rig, recording) = (Rig::chapter("a"), [session(60.0, 0.03, 0.85)]);
        let asked = core::cell::Cell::new(0);
        let stopped_at = |last: u32| {
            asked.set(0);
            let go_on = || {
                asked.set(asked.get() + 1);
                asked.get() < last
            };
            calibrate_with_prospects_while(&rig, &recording, &go_on)
        };
        let whole = stopped_at(u32::MAX).unwrap();
        assert_eq!(whole, calibrate_with_prospects(&rig, &recording).unwrap());
        let n_steps = asked.get();
        assert!(n_steps >= 8, "{n_steps}");
        for last in [1, 2, 4, n_steps] {
            assert_eq!(stopped_at(last), Err(CannotCalibrate::Stopped));
            assert_eq!(asked.get(), last);
        }
    }

    #[test]
    fn an_axis_without_readings_is_left_out() {
        let mut one_sided = session(60.0, 0.03, 1.0);
        one_sided.iter_mut().for_each(|s| s.y_m = None);
        let learnt = calibrate(&Rig::chapter("a"), &[one_sided]).unwrap();
        assert!(learnt.axes.x.is_some() && learnt.axes.y.is_none());
    }
}
