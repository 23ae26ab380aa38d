//! The lines of a verdict: faults as they change, a summary, and a hash that
//! is the same for the same recording however it was delivered.

mod outcome;
mod sentence;

pub use outcome::{JudgedView, Outcome};
pub use sentence::sentence;

use data_encoding::HEXLOWER;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use utoipa::ToSchema;

use super::basis::Basis;
use offbd_core::diagnosis::{Answer, AxisEvidence, Candidate, Evidence, Suspicion, Transition};
use offbd_core::engine::{Admission, Misfit, Output};
use offbd_core::vocabulary::{FaultCode, FaultStatus};

/// A change of a fault's status; or its kind, where that shows only after the
/// confirmation: the status is then the same as before.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct FaultView {
    /// Always `fault`.
    #[serde(rename = "type")]
    pub line: String,
    /// The session's name.
    pub session: String,
    /// The sample at which the status changed, s on the device's clock.
    pub t_s: f64,
    /// `x_servo`, `y_servo`, `stuck_ball` or `sensor`.
    pub code: String,
    /// `dead`, `held`, `gain`, …; null where the evidence does not say.
    pub kind: Option<String>,
    /// `pending`, `confirmed`, `healed` or `cleared`.
    pub status: String,
    /// ISO 14229 status byte, two hexadecimal digits.
    pub status_byte: String,
    /// When the deviation began, as far as the evidence says.
    pub onset_s: Option<f64>,
    /// Ball axis of a servo fault.
    pub axis: Option<String>,
    /// Plate angle that the servo turns: `qy` for x, `qx` for y.
    pub command: Option<String>,
    /// Causes that read alike; empty where only one does.
    pub candidates: Vec<CandidateView>,
    /// Of the calibration that judged; null on a rig not learnt.
    #[serde(default)]
    pub calibration_id: Option<String>,
    /// Of the profile, the settings and the rig's description that judged.
    #[serde(default)]
    pub settings_id: String,
    /// The numbers at that moment, in one sentence and one by one.
    pub summary: String,
    pub evidence: EvidenceView,
}

/// One possible cause.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct CandidateView {
    pub code: String,
    pub kind: Option<String>,
    /// In (0, 1]; the weights sum to one.
    pub weight: f64,
}

/// The numbers at one moment.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct EvidenceView {
    pub t_s: Option<f64>,
    /// Estimation window that was available, s.
    pub window_s: f64,
    pub x: AxisEvidenceView,
    pub y: AxisEvidenceView,
    /// Seconds without a ball seen.
    pub unseen_s: f64,
    /// Share of the samples of the last seconds without a ball, 0 to 1.
    #[serde(default)]
    pub missing_share: f64,
    /// Seconds of bit-identical readings.
    pub identical_s: f64,
    /// Seconds for which the ball has stood still.
    pub still_s: f64,
    /// Lone readings set aside in the last ten seconds.
    pub outliers: u32,
    /// Standard deviation of the readings about their fit, m.
    pub scatter_m: Option<f64>,
    /// The same of healthy readings, the worse of both axes, m: learnt, or
    /// assumed on a rig that is not.
    #[serde(default)]
    pub healthy_scatter_m: f64,
    /// The step of the readings that the sensor is blamed for, if one is.
    #[serde(default)]
    pub jump: Option<StepView>,
}

/// A step of the readings that no ball can make.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
pub struct StepView {
    /// The first reading beyond it, s on the device's clock.
    pub t_s: f64,
    /// How far the readings went, m.
    pub size_m: f64,
}

/// One axis at one moment.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct AxisEvidenceView {
    pub command_rad: Option<f64>,
    pub position_m: Option<f64>,
    pub velocity_m_s: Option<f64>,
    /// Measured acceleration over the window, m/s².
    pub measured_m_s2: Option<f64>,
    /// The twin's through the same filter, m/s².
    pub twin_m_s2: Option<f64>,
    /// Measured − twin, m/s².
    pub residual_m_s2: Option<f64>,
    pub limit_m_s2: f64,
    /// Whether the enable condition (the gate) holds.
    pub enabled: bool,
    /// Evidence for a fault of the servo: logarithm of how much likelier the
    /// motion is if it is broken, nats.
    #[serde(default)]
    pub nats: f64,
    /// How far the path of the last two seconds bends from the twin's, root mean
    /// square, m; none where that is not testable.
    #[serde(default)]
    pub path_error_m: Option<f64>,
    /// The most that it bends on the healthy rig, m; none where that is not known.
    #[serde(default)]
    pub path_limit_m: Option<f64>,
    /// How the servo has answered its command of late; none where the profile
    /// does not ask.
    #[serde(default)]
    pub answer: Option<AnswerView>,
    /// Seconds for which the readings along this axis have been bit-identical.
    #[serde(default)]
    pub identical_s: f64,
}

/// A servo's effective parameters against the twin's, with standard errors.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
pub struct AnswerView {
    /// Acceleration that no command explains, m/s².
    pub offset_m_s2: f64,
    pub offset_error_m_s2: f64,
    /// Share of the command that the ball answers; 1 is healthy.
    pub gain: f64,
    pub gain_error: f64,
    /// Delay beyond the twin's, s.
    pub delay_s: f64,
    pub delay_error_s: f64,
    /// Likelihoods of the kinds of fault that answer like this: dead, held,
    /// reversed, gain, offset, slow; they sum to one.
    pub likelihoods: [f64; 6],
}

/// The last line of a verdict.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SummaryView {
    /// Always `summary`.
    #[serde(rename = "type")]
    pub line: String,
    pub session: String,
    /// Samples taken, duplicates and rejected ones not counted.
    pub samples: u64,
    pub rejected: u64,
    /// From the first to the last sample, s.
    pub duration_s: f64,
    /// Codes confirmed in this session, in the order of confirmation.
    pub faults: Vec<String>,
    /// What the session came to; null in a record of before it was said.
    #[serde(default)]
    pub outcome: Option<Outcome>,
    /// For each monitor how much it judged and what it came to; none in a record
    /// of before it was said.
    #[serde(default)]
    pub monitors: Vec<JudgedView>,
    pub verdict_hash: String,
    /// What in the data and the asset file cannot be of one rig; left out where
    /// everything fits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<WarningView>,
}

/// Something in which the data and the asset file do not fit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct WarningView {
    /// `rate`, `positions`, `commands`, `no_readings`, `no_commands`, `no_axis` or
    /// `short`: no fault found means nothing then. `commands_held`, `one_axis`,
    /// `swapped` or `wrong_sign`.
    pub code: String,
    /// The same in a sentence, with its numbers.
    pub message: String,
}

/// The views of what does not fit.
#[must_use]
pub fn warnings(misfits: &[Misfit]) -> Vec<WarningView> {
    let view = |m: &Misfit| WarningView { code: m.as_str().to_owned(), message: m.to_string() };
    misfits.iter().map(view).collect()
}

/// The view of the transition of a status byte.
#[must_use]
pub fn fault_view(session: &str, basis: &Basis, transition: &Transition) -> FaultView {
    let axis = transition.axis();
    FaultView {
        line: "fault".to_owned(),
        session: session.to_owned(),
        t_s: transition.at.seconds(),
        code: transition.code.to_string(),
        kind: transition.suspicion.kind.map(|k| k.to_string()),
        status: transition.status.to_string(),
        status_byte: transition.byte.to_string(),
        onset_s: transition.suspicion.onset.map(|t| t.seconds()),
        axis: axis.map(|a| a.as_str().to_owned()),
        command: axis.map(|a| a.command().to_owned()),
        candidates: transition.suspicion.candidates.iter().map(candidate_view).collect(),
        calibration_id: basis.calibration_id.clone(),
        settings_id: basis.settings_id.clone(),
        summary: sentence(transition),
        evidence: evidence_view(&transition.evidence),
    }
}

/// The view of a candidate.
#[must_use]
pub fn candidate_view(candidate: &Candidate) -> CandidateView {
    CandidateView {
        code: candidate.code.to_string(),
        kind: candidate.kind.map(|k| k.to_string()),
        weight: candidate.weight,
    }
}

/// The view of the numbers at one moment.
#[must_use]
pub fn evidence_view(evidence: &Evidence) -> EvidenceView {
    EvidenceView {
        t_s: evidence.at.map(|t| t.seconds()),
        window_s: evidence.window_s,
        x: axis_evidence_view(&evidence.axes.x),
        y: axis_evidence_view(&evidence.axes.y),
        unseen_s: evidence.unseen_s,
        missing_share: evidence.missing_share,
        identical_s: evidence.identical_s,
        still_s: evidence.still_s,
        outliers: evidence.outliers,
        scatter_m: evidence.scatter_m,
        healthy_scatter_m: evidence.healthy_scatter_m,
        jump: evidence.jump.map(|step| StepView { t_s: step.at_s, size_m: step.size_m }),
    }
}

fn axis_evidence_view(axis: &AxisEvidence) -> AxisEvidenceView {
    AxisEvidenceView {
        command_rad: axis.command_rad,
        position_m: axis.position_m,
        velocity_m_s: axis.velocity_m_s,
        measured_m_s2: axis.measured_m_s2,
        twin_m_s2: axis.twin_m_s2,
        residual_m_s2: axis.residual_m_s2(),
        limit_m_s2: axis.limit_m_s2,
        enabled: axis.enabled,
        nats: axis.nats,
        path_error_m: axis.path_error_m,
        path_limit_m: axis.path_limit_m,
        answer: axis.answer.as_ref().map(answer_view),
        identical_s: axis.identical_s,
    }
}

const fn answer_view(answer: &Answer) -> AnswerView {
    AnswerView {
        offset_m_s2: answer.offset_m_s2,
        offset_error_m_s2: answer.offset_error_m_s2,
        gain: answer.gain,
        gain_error: answer.gain_error,
        delay_s: answer.delay_s,
        delay_error_s: answer.delay_error_s,
        likelihoods: answer.likelihoods,
    }
}

/// A verdict as it grows: which codes were confirmed, and the hash.
///
/// The hash covers how many samples were judged and every transition that they
/// caused (time, code, kind, status, byte, onset), so it tells two verdicts
/// apart where anything that matters differs.
#[derive(Clone, Debug, Default)]
pub struct Verdict {
    hash: Sha256,
    n_accepted: u64,
    confirmed: Vec<FaultCode>,
    /// What was suspected when each test failed last in this session.
    suspected: [Option<Suspicion>; FaultCode::COUNT],
}

impl Verdict {
    /// Takes note of one output of the engine.
    pub fn take(&mut self, output: &Output) {
        let transition = match output {
            Output::Admitted(Admission::Accepted) => {
                self.n_accepted += 1;
                return;
            }
            Output::Admitted(_) => return,
            Output::Transition(transition) => transition,
        };
        let time = |t: f64| t.to_bits().to_le_bytes();
        self.hash.update(time(transition.at.seconds()));
        self.hash.update([
            transition.code as u8,
            transition.suspicion.kind.map_or(u8::MAX, |k| k as u8),
            transition.status as u8,
            transition.byte.bits(),
        ]);
        self.hash.update(transition.suspicion.onset.map_or([0xff; 8], |t| time(t.seconds())));
        self.note(transition);
    }

    /// A test that passes again says how a fault stands, not that there is one.
    fn note(&mut self, transition: &Transition) {
        let Transition { code, status, byte, suspicion, .. } = transition;
        if byte.test_failed() {
            self.suspected[*code as usize] = Some(suspicion.clone());
            if *status == FaultStatus::Confirmed && !self.confirmed.contains(code) {
                self.confirmed.push(*code);
            }
        } else if *status == FaultStatus::Cleared {
            self.suspected[*code as usize] = None;
        }
    }

    /// Codes confirmed so far, in the order of confirmation.
    #[must_use]
    pub fn confirmed(&self) -> &[FaultCode] {
        &self.confirmed
    }

    /// Lower-case hexadecimal SHA-256 of the verdict so far.
    #[must_use]
    pub fn hash(&self) -> String {
        let hash = self.hash.clone().chain_update(self.n_accepted.to_le_bytes());
        HEXLOWER.encode(&hash.finalize())
    }

    /// The summary line of a session.
    #[must_use]
    pub fn summary(
        &self,
        session: &str,
        samples: u64,
        rejected: u64,
        duration_s: f64,
    ) -> SummaryView {
        SummaryView {
            line: "summary".to_owned(),
            session: session.to_owned(),
            samples,
            rejected,
            duration_s,
            faults: self.confirmed.iter().map(ToString::to_string).collect(),
            outcome: None,
            monitors: Vec::new(),
            verdict_hash: self.hash(),
            warnings: Vec::new(),
        }
    }
}
