//! Cross-validation of a calibration: each session is judged, with shorter times than
//! later, by what was learnt from the others. Where that alarms, the rig varies more than
//! the others showed: the limit concerned is widened until there is no alarm, or the
//! calibration is refused. A moment in which the readings jump, or the ball stands where no
//! friction holds it, is left out instead.

use super::data::Data;
use super::self_test::{Accusation, PATIENCE, SelfTest, judge};
use super::widening::{STOOD_S, Widening};
use super::{CannotCalibrate, GoOn, certificate, check, learn_untested};
use crate::diagnosis::{AxisCalibration, Calibration, LeftOut, Settings};
use crate::engine::{Rig, Setup};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{Axis, FaultCode, Sample};

/// Most groups of sessions (folds); each costs a calibration. Chosen.
const MOST_GROUPS: usize = 4;
/// Most rounds of widening. Chosen.
const MOST_WIDENINGS: usize = 40;
/// Duration from which on a session is judged by itself if its halves cannot be learnt,
/// s. Chosen.
const LONG_S: f64 = 60.0;
/// Largest scatter that is taken over from the tests, m: more is not noise but motion
/// that the fit does not follow. Chosen.
const MOST_SCATTER_M: f64 = 1e-3;

/// Returns `learnt`, widened until no session of `data` gives an alarm, each judged by
/// what was learnt from the others; of a single session, each half by what was learnt from
/// the other. `None` if moments of `data` were left out: then `learnt` is out of date.
///
/// # Errors
/// [`CannotCalibrate::Untested`] if there is too little to judge by,
/// [`CannotCalibrate::Contradictory`] or [`CannotCalibrate::Sticks`] if too much is left out, and
/// [`CannotCalibrate::AccusesItself`] if nothing that can be widened helps.
pub(super) fn prove(
    rig: &Rig,
    learnt: Calibration,
    data: &mut Data,
    go_on: GoOn<'_>,
) -> Result<Option<Calibration>, CannotCalibrate> {
    let mut folds = folds(rig, &learnt, &data.sessions, go_on)?;
    let mut widening = Widening::default();
    let mut tests: Vec<SelfTest> = Vec::new();
    let mut contradicted = false;
    for round in 0..MOST_WIDENINGS {
        check(go_on)?;
        tests = folds.iter().flat_map(|fold| fold.tests(rig, &widening)).collect();
        if leave_out_jumps(data, &mut folds, &tests)? {
            contradicted = true;
            continue;
        }
        if contradicted {
            return Ok(None);
        }
        let asked = tests.iter().filter(|test| widening.widen(test)).count();
        if asked == 0 {
            let quiet = round == 0 && data.left_out.is_empty();
            return Ok(Some(with_most(widening.of(&learnt), &tests, quiet)));
        }
        if widening.is_beyond(&learnt) {
            // No friction holds a ball so firmly.
            if !leave_out_stops(data, &mut folds, &tests)? {
                break;
            }
            (contradicted, widening) = (true, Widening::default());
        }
    }
    if contradicted { Ok(None) } else { Err(accusation(&tests)) }
}

/// Leaves out the moments in which `tests` found that readings jump, of `data` and of
/// `folds`. Returns whether there was any.
fn leave_out_jumps(
    data: &mut Data,
    folds: &mut [Fold],
    tests: &[SelfTest],
) -> Result<bool, CannotCalibrate> {
    leave_out(folds, tests, |session, alarm| match alarm.jump_s {
        Some(jump_s) => data.leave_out_jump(session, jump_s, alarm.at_s),
        None => Ok(None),
    })
}

/// Leaves out the moments in which `tests` found that the ball stands, of `data` and of `folds`.
/// Returns whether there was any.
fn leave_out_stops(
    data: &mut Data,
    folds: &mut [Fold],
    tests: &[SelfTest],
) -> Result<bool, CannotCalibrate> {
    leave_out(folds, tests, |session, alarm| {
        if alarm.code != FaultCode::StuckBall || alarm.still_s < STOOD_S {
            return Ok(None);
        }
        data.leave_out_stop(session, alarm.at_s - alarm.still_s, alarm.at_s)
    })
}

/// Leaves out what `moment` returns for the alarms of `tests`, of `folds`. Returns whether there was
/// any.
fn leave_out(
    folds: &mut [Fold],
    tests: &[SelfTest],
    mut moment: impl FnMut(usize, &Accusation) -> Result<Option<LeftOut>, CannotCalibrate>,
) -> Result<bool, CannotCalibrate> {
    let mut any = false;
    for (session, alarm) in tests.iter().filter_map(|t| Some((t.session, t.alarm.as_ref()?))) {
        let Some(moment) = moment(session, alarm)? else { continue };
        any = true;
        let of_session = |(judged, _): &&mut (usize, Vec<Sample>)| *judged == session;
        for (_, samples) in folds.iter_mut().flat_map(|f| &mut f.judged).filter(of_session) {
            samples.retain(|s| !moment.contains(s.t_s));
        }
    }
    Ok(any)
}

/// Returns `learnt` with the largest values seen in the tests, and its certificate. `quiet` says
/// whether the tests gave no alarm from the first on.
fn with_most(mut learnt: Calibration, tests: &[SelfTest], quiet: bool) -> Calibration {
    for axis in Axis::ALL {
        let most_nats = tests.iter().map(|t| t.most_nats[axis].0).fold(0.0, f64::max);
        let most_path_nats = tests.iter().map(|t| t.most_path_nats[axis]).reduce(f64::max);
        let with = |a| AxisCalibration { most_nats, most_path_nats, ..a };
        learnt.axes[axis] = learnt.axes[axis].map(with);
    }
    let most = |of: fn(&SelfTest) -> f64| tests.iter().map(of).fold(0.0, f64::max);
    let scatter_m = most(|t| t.most_scatter_m).min(MOST_SCATTER_M);
    let sensor = &mut learnt.sensor;
    sensor.most_outliers = sensor.most_outliers.max(most(|t| t.most_outliers));
    sensor.most_scatter_m = sensor.most_scatter_m.max(scatter_m);
    learnt.certificate = Some(certificate::of(&learnt, tests, quiet));
    learnt
}

/// The accusation of the first test with an alarm; without one, of the servo with the
/// largest evidence against it.
fn accusation(tests: &[SelfTest]) -> CannotCalibrate {
    let alarmed = tests.iter().find_map(|t| Some((t.session, t.alarm?)));
    if let Some((session, alarm)) = alarmed {
        let (code, kind, at_s) = (alarm.code, alarm.kind, alarm.at_s);
        return CannotCalibrate::AccusesItself { session, code, kind, at_s };
    }
    let servo = |t: &SelfTest, axis: Axis| (t.session, FaultCode::servo(axis), t.most_nats[axis]);
    let (session, code, (_, at_s)) = tests
        .iter()
        .flat_map(|t| Axis::ALL.map(|axis| servo(t, axis)))
        .max_by(|(.., a), (.., b)| a.0.total_cmp(&b.0))
        .expect("every fold has judged a session");
    CannotCalibrate::AccusesItself { session, code, kind: None, at_s }
}

/// Sessions to be judged, and what was learnt from the others.
struct Fold {
    taught: Calibration,
    judged: Vec<(usize, Vec<Sample>)>,
}

impl Fold {
    fn tests(&self, rig: &Rig, widening: &Widening) -> Vec<SelfTest> {
        let rig = Rig { calibration: Some(Box::new(widening.of(&self.taught))), ..rig.clone() };
        let Ok(mut setup) = Setup::new(rig, None) else { return Vec::new() };
        setup.settings = impatient(&setup.settings);
        self.judged.iter().map(|(session, samples)| judge(&setup, *session, samples)).collect()
    }
}

/// Returns `settings` with shorter times, and without alarms by evidence, which is only
/// measured.
fn impatient(settings: &Settings) -> Settings {
    Settings {
        fail_s: PATIENCE * settings.fail_s,
        confirm_s: PATIENCE * settings.confirm_s,
        readings_fail_s: PATIENCE * settings.readings_fail_s,
        noise_fail_s: PATIENCE * settings.noise_fail_s,
        readings_confirm_s: PATIENCE * settings.readings_confirm_s,
        suspect_nats: f64::MAX,
        confirm_nats: f64::MAX,
        ..*settings
    }
}

fn folds(
    rig: &Rig,
    learnt: &Calibration,
    sessions: &[Vec<Sample>],
    go_on: GoOn<'_>,
) -> Result<Vec<Fold>, CannotCalibrate> {
    if let [session] = sessions {
        return halves(rig, session, go_on).or_else(|reason| {
            match learnt.duration_s >= LONG_S && reason != CannotCalibrate::Stopped {
                // Long enough to be judged by what was learnt from itself.
                true => {
                    Ok(vec![Fold { taught: learnt.clone(), judged: vec![(1, session.clone())] }])
                }
                false => Err(reason),
            }
        });
    }
    let n_groups = sessions.len().min(MOST_GROUPS);
    let fold = |group: usize| {
        let of_group = |i: &usize| i % n_groups == group;
        let (judged, teaching): (Vec<usize>, Vec<usize>) = (0..sessions.len()).partition(of_group);
        let teaching: Vec<Vec<Sample>> = teaching.iter().map(|&i| sessions[i].clone()).collect();
        let judged = judged.iter().map(|&i| (i + 1, sessions[i].clone())).collect();
        fold_of(rig, "one group of sessions", &teaching, judged, go_on)
    };
    (0..n_groups).map(fold).collect()
}

/// Each half of a session, to be judged by what was learnt from the other.
fn halves(rig: &Rig, session: &[Sample], go_on: GoOn<'_>) -> Result<Vec<Fold>, CannotCalibrate> {
    let (first, second) = session.split_at(session.len() / 2);
    let fold = |teaching: &[Sample], judged: &[Sample]| {
        let judged = vec![(1, judged.to_vec())];
        fold_of(rig, "half of the recording", &[teaching.to_vec()], judged, go_on)
    };
    Ok(vec![fold(first, second)?, fold(second, first)?])
}

fn fold_of(
    rig: &Rig,
    what: &'static str,
    teaching: &[Vec<Sample>],
    judged: Vec<(usize, Vec<Sample>)>,
    go_on: GoOn<'_>,
) -> Result<Fold, CannotCalibrate> {
    match learn_untested(rig, teaching, go_on) {
        Ok(taught) => Ok(Fold { taught, judged }),
        Err(CannotCalibrate::Stopped) => Err(CannotCalibrate::Stopped),
        Err(reason) => Err(CannotCalibrate::Untested { what, reason: Box::new(reason) }),
    }
}
