//! The evidence over time and the fault reports that the engines give for a session.

use crate::simulation::Fault;
use offbd_core::diagnosis::{Evidence, FaultMemory, Transition};
use offbd_core::engine::{Engine, Input, Setup};
use offbd_core::vocabulary::{FaultCode, PerAxis, Sample};

/// The evidence of one axis at one judged time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AxisMoment {
    /// Residual, measured − twin, m/s²; `None` while the axis is not enabled.
    pub(super) residual_m_s2: Option<f64>,
    /// Evidence for a fault of the servo, nats.
    pub(super) nats: f64,
}

/// The evidence of both axes at one judged time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    pub(super) t_s: f64,
    pub(super) axes: PerAxis<AxisMoment>,
}

/// A fault reported as pending or confirmed.
#[derive(Clone, Copy, Debug)]
pub(super) struct FaultReport {
    pub(super) t_s: f64,
    pub(super) code: FaultCode,
    pub(super) confirmed: bool,
}

/// The results of the engines for one session.
#[derive(Clone, Debug, Default)]
pub(super) struct Trace {
    /// Evidence with the profile `default`.
    pub(super) judged: Vec<Moment>,
    /// Evidence with the profile `textbook`.
    pub(super) textbook: Vec<Moment>,
    /// Fault reports with the profile `default`.
    pub(super) verdicts: Vec<FaultReport>,
    pub(super) fault: Option<&'static str>,
    pub(super) onset_s: Option<f64>,
    pub(super) chance_s: Option<f64>,
    pub(super) seconds: f64,
}

/// Runs an engine of each profile, `default` and `textbook`, over `samples`.
pub(super) fn follow(setups: &[Setup; 2], samples: &[Sample]) -> Trace {
    let (judged, transitions) = judge(&setups[0], samples);
    let verdicts = transitions.iter().filter(|t| t.byte.test_failed()).map(|t| FaultReport {
        t_s: t.at.seconds(),
        code: t.code,
        confirmed: t.byte.confirmed(),
    });
    let verdicts = verdicts.collect();
    Trace { judged, verdicts, textbook: judge(&setups[1], samples).0, ..Trace::default() }
}

fn judge(setup: &Setup, samples: &[Sample]) -> (Vec<Moment>, Vec<Transition>) {
    let mut engine = Engine::new(setup.clone(), FaultMemory::default());
    let (mut moments, mut transitions) = (Vec::<Moment>::new(), Vec::new());
    for sample in samples {
        engine.handle(Input::Sample(*sample), &mut transitions);
        let next = moment(&engine.state().evidence);
        moments.extend(next.filter(|m| moments.last().is_none_or(|last| m.t_s > last.t_s)));
    }
    (moments, transitions)
}

fn moment(evidence: &Evidence) -> Option<Moment> {
    let axes = PerAxis::from_fn(|axis| {
        let e = &evidence.axes[axis];
        let residual_m_s2 = if e.enabled { e.residual_m_s2() } else { None };
        AxisMoment { residual_m_s2, nats: e.nats }
    });
    Some(Moment { t_s: evidence.at?.seconds(), axes })
}

/// Returns the code of a fault in the syntax of the command line, without onset.
pub(super) fn code_of(fault: &str) -> Option<FaultCode> {
    let fault: Fault = format!("{fault}@0").parse().ok()?;
    Some(fault.effect.code())
}
