//! Describes a transition and its evidence in one sentence, whose form depends on the kind.

use super::kind_words::{
    code_title, code_words, fault_title, is_probable, status_words, weighed_causes,
};
use super::outcome::is_ambiguous;
use crate::fault_kind::{Finding, answered_share, kind_text};
use offbd_core::diagnosis::{
    AxisEvidence, Candidate, Evidence, Profile, Settings, Suspicion, Transition,
};
use offbd_core::vocabulary::{Axis, FaultCode, FaultKind, FaultStatus};

/// Describes a transition in one sentence.
#[must_use]
pub fn sentence(transition: &Transition) -> String {
    let Transition { code, status, byte, suspicion, .. } = transition;
    let name = fault_title(code_title(*code), suspicion.kind, weight(suspicion));
    match status {
        FaultStatus::Cleared => format!("{name} cleared"),
        FaultStatus::Healed => format!("{name} healed: enough good sessions followed"),
        status if !byte.test_failed() => {
            let since = transition.at.seconds();
            format!(
                "{name} passes its test again since {since:.2} s; it was {}",
                status_words(*status)
            )
        }
        FaultStatus::Pending | FaultStatus::Confirmed => {
            let onset = suspicion.onset.map(|t| format!(" since {:.2} s", t.seconds()));
            let since = onset.unwrap_or_default();
            let (undecided, findings) = (undecided(suspicion), findings(transition));
            format!(
                "{name} {}{since}: {undecided}{findings}{}",
                status_words(*status),
                deciding_motion(transition)
            )
        }
    }
}

/// The weight of the kind; 1 if the candidates do not tell.
fn weight(suspicion: &Suspicion) -> f64 {
    suspicion.kind_weight().unwrap_or(1.0)
}

/// Describes what the evidence does not decide: candidates in different parts of the rig, or
/// kinds of one part. Empty if there is nothing.
fn undecided(suspicion: &Suspicion) -> String {
    let candidates = &suspicion.candidates;
    let causes: Vec<_> = candidates.iter().map(|c| (c.code, c.kind, c.weight)).collect();
    let weighed = |c: &Candidate| Some(format!("{} {:.0} %", c.kind?, 100.0 * c.weight));
    let kinds = || candidates.iter().filter_map(weighed);
    match (is_ambiguous(suspicion), suspicion.kind) {
        (true, _) => {
            format!("cannot tell {}; ", weighed_causes(&causes, code_words).join(" from "))
        }
        (false, None) if candidates.len() > 1 => {
            format!("cannot tell which kind: {}; ", kinds().collect::<Vec<_>>().join(", "))
        }
        (false, _) => String::new(),
    }
}

/// Describes a motion that would decide between the candidates. Empty if they are all in one
/// part of the rig.
fn deciding_motion(transition: &Transition) -> String {
    let suspicion = &transition.suspicion;
    if !is_ambiguous(suspicion) {
        return String::new();
    }
    let by_hand = "a push by hand would decide";
    let mut servos = suspicion.candidates.iter().filter_map(|c| c.code.axis());
    let motion = match (servos.next().map(Axis::other), servos.next()) {
        (Some(_), Some(_)) => {
            format!("{by_hand}: if the ball then rolls, look whether both servos have power")
        }
        // The other servo moves the ball unless it is stuck.
        (Some(axis), None) if transition.evidence.axes[axis].command_rad.is_some() => format!(
            "tilting by {} would decide, as the drive cycle does: a ball that then rolls along {} \
             is not stuck",
            axis.command(),
            axis.as_str()
        ),
        (Some(_), None) => format!("{by_hand}: a ball that then rolls is not stuck"),
        (None, _) => "moving the ball by hand would decide: readings that then stay the same are \
                      frozen"
            .to_owned(),
    };
    format!("; {motion}")
}

fn findings(transition: &Transition) -> String {
    let (evidence, suspicion) = (&transition.evidence, &transition.suspicion);
    let kind = suspicion.kind;
    match transition.code.axis() {
        Some(axis) => servo(axis, suspicion, evidence),
        None if transition.code == FaultCode::StuckBall => stuck_ball(evidence),
        None => sensor(kind, evidence),
    }
}

/// Shortest time of stillness that is mentioned, s: what the monitor `stuck_ball` requires.
const LEAST_REPORTED_STILL_S: f64 = 0.3;

fn stuck_ball(evidence: &Evidence) -> String {
    if evidence.still_s < LEAST_REPORTED_STILL_S {
        let nats = evidence.axes.x.nats + evidence.axes.y.nats;
        return format!(
            "the ball hardly moves although the plate asks it to along both axes (evidence \
             {nats:.0} nats)"
        );
    }
    format!(
        "the ball has stood still for {:.1} s while the plate asks it to move",
        evidence.still_s
    )
}

fn sensor(kind: Option<FaultKind>, evidence: &Evidence) -> String {
    let finding = match kind.map(|kind| kind_text(kind).finding) {
        Some(Finding::Readings(of)) => of(evidence),
        Some(Finding::Servo(_)) | None => None,
    };
    // Without a kind, or without a number that the kind needs.
    finding.unwrap_or_else(|| all_readings(evidence))
}

/// All quantities of the readings, if no kind tells which of them matters.
fn all_readings(evidence: &Evidence) -> String {
    let scatter = evidence.scatter_m.map_or("unknown".to_owned(), |s| format!("{:.2} mm", s * 1e3));
    format!(
        "no ball seen for {:.1} s, readings unchanged for {:.1} s, {} outliers in 10 s, scatter \
         {scatter}",
        evidence.unseen_s, evidence.identical_s, evidence.outliers,
    )
}

fn servo(axis: Axis, suspicion: &Suspicion, evidence: &Evidence) -> String {
    let e = &evidence.axes[axis];
    let finding = suspicion.kind.map(|kind| kind_text(kind).finding);
    let answer = e.answer.and_then(|answer| match finding {
        Some(Finding::Servo(of)) => of(axis, &answer),
        Some(Finding::Readings(_)) | None => answered_share(axis, &answer),
    });
    // The cause is as likely as the kind; without a kind the number is what was measured.
    let probably = if is_probable(weight(suspicion)) { "probably " } else { "" };
    let along = axis.as_str();
    let answer = answer.map(|words| format!("the {along} servo {probably}{words}; "));
    let shared = shared_cause(axis, evidence);
    format!("{}{}{shared}", answer.unwrap_or_default(), accelerated(axis, e))
}

/// Names what both servos may have in common if there is evidence against both. Empty if there is not.
fn shared_cause(axis: Axis, evidence: &Evidence) -> String {
    let suspect_nats = Settings::of(Profile::Default).suspect_nats;
    let suspected = |axis: Axis| evidence.axes[axis].nats >= suspect_nats;
    if !Axis::ALL.into_iter().all(suspected) {
        return String::new();
    }
    let other = axis.other().as_str();
    format!("; the {other} servo deviates, too: measure their supply")
}

fn accelerated(axis: Axis, e: &AxisEvidence) -> String {
    // A residual within its limit is not the cause of the fault.
    let ground = match (e.violates(), e.path_nats.zip(e.path_limit_nats)) {
        (true, _) => format!("limit {:.2}", e.limit_m_s2),
        (false, Some((nats, limit))) if e.is_off_path() => {
            format!("its path is evidence of {nats:.0} nats, limit {limit:.0} nats")
        }
        (false, _) => format!("evidence {:.0} nats", e.nats),
    };
    let along = axis.as_str();
    match (e.measured_m_s2, e.twin_m_s2) {
        (Some(measured), Some(twin)) => format!(
            "acceleration along {along}: measured {measured:.2} m/s², expected {twin:.2} m/s² \
             ({ground})"
        ),
        _ => format!("the acceleration along {along} cannot be tested now ({ground})"),
    }
}

#[cfg(test)]
mod tests;
