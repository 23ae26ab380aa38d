//! What the engines leave of a session: the evidence, moment by moment, and the
//! verdict.

use crate::simulation::Fault;
use offbd_core::diagnosis::{Evidence, FaultMemory, Transition};
use offbd_core::engine::{Engine, Input, Output, Setup};
use offbd_core::vocabulary::{FaultCode, PerAxis, Sample};

/// One axis at one judged moment.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AxisMoment {
    /// Measured − twin, m/s²; none while it may not be judged.
    pub(super) residual_m_s2: Option<f64>,
    /// Evidence for a fault of the servo, nats.
    pub(super) nats: f64,
}

/// A judged moment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    pub(super) t_s: f64,
    pub(super) axes: PerAxis<AxisMoment>,
}

/// A code that was pending or confirmed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Verdict {
    pub(super) t_s: f64,
    pub(super) code: FaultCode,
    pub(super) confirmed: bool,
}

/// A session as the engines saw it.
#[derive(Clone, Debug, Default)]
pub(super) struct Trace {
    /// By profile default.
    pub(super) judged: Vec<Moment>,
    /// By profile textbook.
    pub(super) textbook: Vec<Moment>,
    /// By profile default.
    pub(super) verdicts: Vec<Verdict>,
    pub(super) fault: Option<&'static str>,
    pub(super) onset_s: Option<f64>,
    pub(super) chance_s: Option<f64>,
    pub(super) seconds: f64,
}

/// Runs an engine of each profile, default and textbook, over `samples`.
pub(super) fn follow(setups: &[Setup; 2], samples: &[Sample]) -> Trace {
    let (judged, transitions) = judge(&setups[0], samples);
    let verdicts = transitions.iter().filter(|t| t.byte.test_failed()).map(|t| Verdict {
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
    let mut outputs = Vec::new();
    for sample in samples {
        engine.handle(Input::Sample(*sample), &mut outputs);
        transitions.extend(outputs.drain(..).filter_map(transition));
        let next = moment(&engine.state().evidence);
        moments.extend(next.filter(|m| moments.last().is_none_or(|last| m.t_s > last.t_s)));
    }
    (moments, transitions)
}

fn transition(output: Output) -> Option<Transition> {
    match output {
        Output::Transition(transition) => Some(*transition),
        Output::Admitted(_) => None,
    }
}

fn moment(evidence: &Evidence) -> Option<Moment> {
    let axes = PerAxis::from_fn(|axis| {
        let e = &evidence.axes[axis];
        let residual_m_s2 = if e.enabled { e.residual_m_s2() } else { None };
        AxisMoment { residual_m_s2, nats: e.nats }
    });
    Some(Moment { t_s: evidence.at?.seconds(), axes })
}

/// The code that a fault in words belongs to.
pub(super) fn code_of(fault: &str) -> Option<FaultCode> {
    let fault: Fault = format!("{fault}@0").parse().ok()?;
    Some(fault.effect.code())
}
