//! The lines of a verdict: one per transition and a summary, with a hash that depends only
//! on the recording, not on how it was delivered.

mod kind_words;
mod outcome;
mod sentence;

pub use kind_words::{
    code_title, code_words, fault_title, is_probable, kind_words, status_words, weighed_causes,
};
pub use outcome::{JudgedView, NamedKindView, Outcome};
pub use sentence::sentence;

use data_encoding::HEXLOWER;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use utoipa::ToSchema;

use super::basis::Basis;
use super::words::{AxisWord, CodeWord, CommandWord, KindWord, LineWord, MisfitWord, StatusWord};
use offbd_core::diagnosis::{
    AxisEvidence, Candidate, Evidence, ServoAnswer, Suspicion, Transition,
};
use offbd_core::engine::Misfit;
use offbd_core::vocabulary::{FaultCode, FaultKind, FaultStatus};

/// A transition: a change of a fault's status. If the kind of a fault is determined only
/// after its confirmation, a further line with an unchanged status gives it.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct FaultView {
    /// Always `fault`.
    #[serde(rename = "type")]
    pub line: LineWord,
    /// The session's name.
    pub session: String,
    /// Time of the sample at which the status changed, s on the device's clock.
    pub t_s: f64,
    pub code: CodeWord,
    /// Failure mode; null if the evidence does not determine it.
    pub kind: Option<KindWord>,
    pub status: StatusWord,
    /// ISO 14229 status byte, two hexadecimal digits.
    pub status_byte: String,
    /// Estimated time at which the deviation began, s on the device's clock; null if
    /// unknown.
    pub onset_s: Option<f64>,
    /// Ball axis of a servo fault; null for other codes.
    pub axis: Option<AxisWord>,
    /// Plate angle that the servo turns: `qy` for x, `qx` for y; null for other codes.
    pub command: Option<CommandWord>,
    /// Causes that would explain the evidence equally; empty if there is only one.
    pub candidates: Vec<CandidateView>,
    /// Id of the calibration that was used; null if the rig was not calibrated.
    #[serde(default)]
    pub calibration_id: Option<String>,
    /// Id of the profile, settings and rig description that were used.
    #[serde(default)]
    pub settings_id: String,
    /// The transition and its evidence in one sentence.
    pub summary: String,
    /// The quantities at that time.
    pub evidence: EvidenceView,
}

impl FaultView {
    /// Whether the test of the fault fails: bit 0 of the status byte.
    #[must_use]
    pub fn is_failing(&self) -> bool {
        u8::from_str_radix(&self.status_byte, 16).is_ok_and(|byte| byte & 1 == 1)
    }
}

/// A possible cause and its weight.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct CandidateView {
    pub code: CodeWord,
    /// Failure mode; null for a code without kinds.
    pub kind: Option<KindWord>,
    /// Weight in (0, 1]; the weights of all candidates sum to one. Two servos beside a stuck ball are
    /// one cause, both without power, and each has half of its weight.
    pub weight: f64,
}

/// Returns the weight of `kind` among candidates: 1 if there are none.
#[must_use]
pub fn kind_weight(kind: Option<KindWord>, candidates: &[CandidateView]) -> Option<f64> {
    kind?;
    match candidates {
        [] => Some(1.0),
        _ => candidates.iter().find(|each| each.kind == kind).map(|each| each.weight),
    }
}

/// The quantities of the diagnosis at one time.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct EvidenceView {
    /// Time of the judged sample, s on the device's clock; null without one.
    pub t_s: Option<f64>,
    /// Length of the estimation window that was available, s.
    pub window_s: f64,
    pub x: AxisEvidenceView,
    pub y: AxisEvidenceView,
    /// Time for which no ball has been seen, s.
    pub unseen_s: f64,
    /// Fraction of recent samples without a ball, 0 to 1.
    #[serde(default)]
    pub missing_share: f64,
    /// Time for which the readings have been bit-identical, s.
    pub identical_s: f64,
    /// Time for which the ball has stood still, s.
    pub still_s: f64,
    /// Number of recent outliers, each fading with a time constant of ten seconds.
    pub outliers: u32,
    /// Standard deviation of the readings about their fit, m; null if unknown.
    pub scatter_m: Option<f64>,
    /// Standard deviation of healthy readings, the larger of both axes, m: learnt, or assumed
    /// if the rig is not calibrated.
    #[serde(default)]
    pub healthy_scatter_m: f64,
    /// The jump of the readings that is attributed to the sensor; null if there is none.
    #[serde(default)]
    pub jump: Option<StepView>,
}

/// A jump of the readings that no ball can make.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
pub struct StepView {
    /// Time of the first reading after the jump, s on the device's clock.
    pub t_s: f64,
    /// Size of the jump, m.
    pub size_m: f64,
}

/// The quantities of one axis at one time. A quantity that is unknown is null.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct AxisEvidenceView {
    /// Command of the plate angle that moves the ball along this axis, rad.
    pub command_rad: Option<f64>,
    /// Measured position, from the fit over the window, m.
    pub position_m: Option<f64>,
    /// Measured velocity, from the fit over the window, m/s.
    pub velocity_m_s: Option<f64>,
    /// Measured acceleration over the window, m/s².
    pub measured_m_s2: Option<f64>,
    /// The twin's acceleration through the same filter, m/s².
    pub twin_m_s2: Option<f64>,
    /// Residual: measured minus the twin's acceleration, m/s².
    pub residual_m_s2: Option<f64>,
    /// Limit of the residual, m/s².
    pub limit_m_s2: f64,
    /// Whether the enable condition holds: the residual may be judged.
    pub enabled: bool,
    /// Evidence for a fault of the servo: natural logarithm of the likelihood ratio of a
    /// broken and a healthy servo, nats.
    #[serde(default)]
    pub nats: f64,
    /// Evidence of the path of the last seconds for a fault of the servo, nats, in which the
    /// scale of the twin's error is the session's own; negative if the path speaks for a
    /// healthy servo, null if it cannot be tested.
    #[serde(default)]
    pub path_nats: Option<f64>,
    /// Evidence of the path from which on the servo fails, nats; null if unknown.
    #[serde(default)]
    pub path_limit_nats: Option<f64>,
    /// Recent parameters of the servo; null if the profile does not estimate them.
    #[serde(default)]
    pub answer: Option<AnswerView>,
    /// Time for which the readings along this axis have been bit-identical, s.
    #[serde(default)]
    pub identical_s: f64,
}

/// A servo's recent parameters, relative to the twin, with standard errors.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
pub struct AnswerView {
    /// Acceleration that the command does not explain, m/s².
    pub offset_m_s2: f64,
    /// Standard error of the offset, m/s².
    pub offset_error_m_s2: f64,
    /// Gain relative to the twin: 1 is healthy.
    pub gain: f64,
    /// Standard error of the gain.
    pub gain_error: f64,
    /// Delay in addition to the twin's, s.
    pub delay_s: f64,
    /// Standard error of the delay, s.
    pub delay_error_s: f64,
    /// Normalised likelihoods of the kinds dead, held, reversed, gain, offset and slow, in
    /// this order; they sum to one.
    pub likelihoods: [f64; 6],
}

/// The last line of a verdict.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SummaryView {
    /// Always `summary`.
    #[serde(rename = "type")]
    pub line: LineWord,
    /// The session's name.
    pub session: String,
    /// Number of recorded samples, without duplicates and rejected rows.
    pub samples: u64,
    /// Number of rejected rows.
    pub rejected: u64,
    /// Time from the first to the last sample, s.
    pub duration_s: f64,
    /// Codes confirmed in this session, in the order of confirmation.
    pub faults: Vec<CodeWord>,
    /// Result of the session; null if an earlier version stored the summary without it.
    #[serde(default)]
    pub outcome: Option<Outcome>,
    /// Judged time and result of each monitor; empty if an earlier version stored the summary
    /// without them.
    #[serde(default)]
    pub monitors: Vec<JudgedView>,
    /// Root mean square of the residual along x while it could be judged, m/s²; null if it
    /// never could, or if an earlier version stored the summary without it.
    #[serde(default)]
    pub residual_x_m_s2: Option<f64>,
    /// The same along y.
    #[serde(default)]
    pub residual_y_m_s2: Option<f64>,
    /// SHA-256 of the number of judged samples and of all transitions, hexadecimal; equal
    /// judgements have equal hashes.
    pub verdict_hash: String,
    /// Contradictions between data and asset file; absent if there are none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<WarningView>,
}

/// A contradiction between the data and the asset file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct WarningView {
    pub code: MisfitWord,
    /// The contradiction in one sentence, with its numbers.
    pub message: String,
}

/// Returns the views of `misfits`.
#[must_use]
pub fn warnings(misfits: &[Misfit]) -> Vec<WarningView> {
    let view = |m: &Misfit| WarningView { code: m.into(), message: m.to_string() };
    misfits.iter().map(view).collect()
}

/// Returns the view of a transition.
#[must_use]
pub fn fault_view(session: &str, basis: &Basis, transition: &Transition) -> FaultView {
    let axis = transition.axis();
    FaultView {
        line: LineWord::Fault,
        session: session.to_owned(),
        t_s: transition.at.seconds(),
        code: transition.code.into(),
        kind: transition.suspicion.kind.map(KindWord::from),
        status: transition.status.into(),
        status_byte: transition.byte.to_string(),
        onset_s: transition.suspicion.onset.map(|t| t.seconds()),
        axis: axis.map(AxisWord::from),
        command: axis.map(CommandWord::from),
        candidates: transition.suspicion.candidates.iter().map(candidate_view).collect(),
        calibration_id: basis.calibration_id.clone(),
        settings_id: basis.settings_id.clone(),
        summary: sentence(transition),
        evidence: evidence_view(&transition.evidence),
    }
}

/// Returns the view of a candidate.
#[must_use]
pub fn candidate_view(candidate: &Candidate) -> CandidateView {
    CandidateView {
        code: candidate.code.into(),
        kind: candidate.kind.map(KindWord::from),
        weight: candidate.weight,
    }
}

/// Returns the view of the evidence.
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
        path_nats: axis.path_nats,
        path_limit_nats: axis.path_limit_nats,
        answer: axis.answer.as_ref().map(answer_view),
        identical_s: axis.identical_s,
    }
}

const fn answer_view(answer: &ServoAnswer) -> AnswerView {
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

/// Accumulates a verdict: the confirmed codes, and the hash.
///
/// The hash covers the number of judged samples and every transition (time, code, kind,
/// status, byte, onset), so it differs if anything that matters differs.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Verdict {
    #[serde(with = "hasher_state")]
    hasher: Sha256,
    n_accepted: u64,
    confirmed: Vec<FaultCode>,
    /// The suspicion of each code when its test last failed in this session.
    suspected: [Option<Box<Suspicion>>; FaultCode::COUNT],
    /// The kinds of the confirmed codes, each once, in the order of time.
    named: Vec<NamedKind>,
}

/// A kind that a confirmed code was given.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct NamedKind {
    code: FaultCode,
    kind: FaultKind,
    t_s: f64,
    /// Its largest weight among the candidates.
    weight: Option<f64>,
}

/// The state of a hasher as bytes.
mod hasher_state {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use sha2::Sha256;
    use sha2::digest::common::hazmat::SerializableState;

    pub(super) fn serialize<S: Serializer>(hasher: &Sha256, to: S) -> Result<S::Ok, S::Error> {
        hasher.serialize().as_slice().serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Sha256, D::Error> {
        let state: Vec<u8> = Vec::deserialize(from)?;
        let state = state.as_slice().try_into().map_err(D::Error::custom)?;
        Sha256::deserialize(state).map_err(D::Error::custom)
    }
}

impl Verdict {
    /// Adds the transitions that an input caused; `n_accepted` is
    /// [`Engine::n_accepted`](offbd_core::engine::Engine::n_accepted) after it.
    pub fn take(&mut self, n_accepted: u64, transitions: &[Transition]) {
        self.n_accepted = n_accepted;
        for transition in transitions {
            self.add_to_hash(transition);
            self.note(transition);
        }
    }

    fn add_to_hash(&mut self, transition: &Transition) {
        let time = |t: f64| t.to_bits().to_le_bytes();
        self.hasher.update(time(transition.at.seconds()));
        self.hasher.update([
            transition.code as u8,
            transition.suspicion.kind.map_or(u8::MAX, |k| k as u8),
            transition.status as u8,
            transition.byte.bits(),
        ]);
        self.hasher.update(transition.suspicion.onset.map_or([0xff; 8], |t| time(t.seconds())));
    }

    /// Records what the session has found. A transition of a test that passes again reports
    /// the state of a fault, not a new one.
    fn note(&mut self, transition: &Transition) {
        let Transition { at, code, status, byte, suspicion, .. } = transition;
        if byte.test_failed() {
            self.suspected[*code as usize] = Some(Box::new(suspicion.clone()));
            if *status == FaultStatus::Confirmed && !self.confirmed.contains(code) {
                self.confirmed.push(*code);
            }
            if let (FaultStatus::Confirmed, Some(kind)) = (status, suspicion.kind) {
                self.name(*code, kind, at.seconds(), suspicion.kind_weight());
            }
        } else if *status == FaultStatus::Cleared {
            self.suspected[*code as usize] = None;
        }
    }

    /// Records the kind of a confirmed code. A kind that is named again is surer.
    fn name(&mut self, code: FaultCode, kind: FaultKind, t_s: f64, weight: Option<f64>) {
        match self.named.iter_mut().find(|named| (named.code, named.kind) == (code, kind)) {
            Some(named) if weight > named.weight => named.weight = weight,
            Some(_) => {}
            None => self.named.push(NamedKind { code, kind, t_s, weight }),
        }
    }

    /// Returns the codes confirmed so far, in the order of confirmation.
    #[must_use]
    pub fn confirmed(&self) -> &[FaultCode] {
        &self.confirmed
    }

    /// Whether `code` was confirmed or suspected in this session.
    #[must_use]
    pub fn accuses(&self, code: FaultCode) -> bool {
        self.confirmed.contains(&code) || self.suspected[code as usize].is_some()
    }

    /// Returns the hash of the verdict so far: SHA-256, lower-case hexadecimal.
    #[must_use]
    pub fn hash(&self) -> String {
        let hash = self.hasher.clone().chain_update(self.n_accepted.to_le_bytes());
        HEXLOWER.encode(&hash.finalize())
    }

    /// Returns the summary line of a session, without the monitors' results, the residual and
    /// warnings.
    #[must_use]
    pub fn summary(
        &self,
        session: &str,
        samples: u64,
        rejected: u64,
        duration_s: f64,
    ) -> SummaryView {
        SummaryView {
            line: LineWord::Summary,
            session: session.to_owned(),
            samples,
            rejected,
            duration_s,
            faults: self.confirmed.iter().map(|&code| code.into()).collect(),
            outcome: None,
            monitors: Vec::new(),
            residual_x_m_s2: None,
            residual_y_m_s2: None,
            verdict_hash: self.hash(),
            warnings: Vec::new(),
        }
    }
}
