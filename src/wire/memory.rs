//! The fault memory as it is stored and served.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::verdict::{
    AnswerView, AxisEvidenceView, CandidateView, EvidenceView, candidate_view, evidence_view,
};
use crate::diagnosis::{
    Answer, AxisEvidence, Candidate, Evidence, FaultMemory, FaultRecord, StatusByte, Suspicion,
};
use crate::vocabulary::{FaultCode, FaultKind, PerAxis, SimTime, UnknownWord};

/// The fault memory of one rig, one record per code.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct MemoryView {
    pub records: Vec<FaultRecordView>,
}

/// What is remembered of one code.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct FaultRecordView {
    pub code: String,
    pub kind: Option<String>,
    /// `pending`, `confirmed`, `healed` or `cleared`.
    pub status: String,
    /// ISO 14229 status byte, two hexadecimal digits.
    pub status_byte: String,
    pub axis: Option<String>,
    pub command: Option<String>,
    pub onset_s: Option<f64>,
    pub candidates: Vec<CandidateView>,
    /// Times the test failed anew since the last clear.
    pub occurrences: u32,
    /// Whether the current occurrence has been acknowledged.
    pub acknowledged: bool,
    /// Operation cycles that counted as a trip.
    pub trips: u8,
    pub tripped_this_cycle: bool,
    /// Good operation cycles in a row.
    pub good_cycles: u8,
    pub healed: bool,
    /// The first failure of the current occurrence.
    pub freeze_frame: Option<EvidenceView>,
}

/// The view of a fault memory.
#[must_use]
pub fn view(memory: &FaultMemory) -> MemoryView {
    let records =
        FaultCode::ALL.iter().map(|&code| record_view(code, memory.record(code))).collect();
    MemoryView { records }
}

/// The view of one record.
#[must_use]
pub fn record_view(code: FaultCode, record: &FaultRecord) -> FaultRecordView {
    let suspicion = record.suspicion.as_ref();
    FaultRecordView {
        code: code.to_string(),
        kind: record.kind().map(|k| k.to_string()),
        status: record.word().to_string(),
        status_byte: record.status.to_string(),
        axis: code.axis().map(|a| a.as_str().to_owned()),
        command: code.axis().map(|a| a.command().to_owned()),
        onset_s: suspicion.and_then(|s| s.onset).map(SimTime::seconds),
        candidates: suspicion
            .map(|s| s.candidates.iter().map(candidate_view).collect())
            .unwrap_or_default(),
        occurrences: record.occurrences,
        acknowledged: record.acknowledged,
        trips: record.trips,
        tripped_this_cycle: record.tripped_this_cycle,
        good_cycles: record.good_cycles,
        healed: record.healed,
        freeze_frame: record.freeze_frame.as_ref().map(evidence_view),
    }
}

/// Why a stored fault memory cannot be read back.
#[derive(Debug, thiserror::Error)]
pub enum MemoryError {
    #[error(transparent)]
    Word(#[from] UnknownWord),
    #[error("`{0}` is not a status byte")]
    StatusByte(String),
}

/// The fault memory of a view.
///
/// # Errors
/// [`MemoryError`] where a word is unknown or a status byte is no byte.
pub fn memory(view: &MemoryView) -> Result<FaultMemory, MemoryError> {
    view.records.iter().try_fold(FaultMemory::default(), |memory, record| {
        Ok(memory.with(record.code.parse()?, fault_record(record)?))
    })
}

fn fault_record(view: &FaultRecordView) -> Result<FaultRecord, MemoryError> {
    let bits = u8::from_str_radix(&view.status_byte, 16)
        .map_err(|_| MemoryError::StatusByte(view.status_byte.clone()))?;
    let suspicion = Suspicion {
        onset: view.onset_s.and_then(SimTime::new),
        kind: kind(view.kind.as_deref())?,
        candidates: view.candidates.iter().map(candidate).collect::<Result<_, _>>()?,
    };
    Ok(FaultRecord {
        status: StatusByte::from_bits(bits),
        trips: view.trips,
        tripped_this_cycle: view.tripped_this_cycle,
        good_cycles: view.good_cycles,
        healed: view.healed,
        occurrences: view.occurrences,
        acknowledged: view.acknowledged,
        suspicion: (suspicion != Suspicion::default()).then_some(suspicion),
        freeze_frame: view.freeze_frame.as_ref().map(evidence),
    })
}

fn kind(word: Option<&str>) -> Result<Option<FaultKind>, UnknownWord> {
    word.map(str::parse).transpose()
}

fn candidate(view: &CandidateView) -> Result<Candidate, UnknownWord> {
    Ok(Candidate {
        code: view.code.parse()?,
        kind: kind(view.kind.as_deref())?,
        weight: view.weight,
    })
}

fn evidence(view: &EvidenceView) -> Evidence {
    Evidence {
        at: view.t_s.and_then(SimTime::new),
        window_s: view.window_s,
        axes: PerAxis { x: axis_evidence(&view.x), y: axis_evidence(&view.y) },
        unseen_s: view.unseen_s,
        identical_s: view.identical_s,
        still_s: view.still_s,
        outliers: view.outliers,
        scatter_m: view.scatter_m,
    }
}

fn axis_evidence(view: &AxisEvidenceView) -> AxisEvidence {
    AxisEvidence {
        command_rad: view.command_rad,
        position_m: view.position_m,
        velocity_m_s: view.velocity_m_s,
        measured_m_s2: view.measured_m_s2,
        twin_m_s2: view.twin_m_s2,
        limit_m_s2: view.limit_m_s2,
        enabled: view.enabled,
        nats: view.nats,
        answer: view.answer.as_ref().map(answer),
    }
}

const fn answer(view: &AnswerView) -> Answer {
    Answer {
        offset_m_s2: view.offset_m_s2,
        offset_error_m_s2: view.offset_error_m_s2,
        gain: view.gain,
        gain_error: view.gain_error,
        delay_s: view.delay_s,
        delay_error_s: view.delay_error_s,
        likelihoods: view.likelihoods,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_memory_survives_the_round_trip() {
        let frame = Evidence {
            at: SimTime::new(1.5),
            window_s: 0.5,
            axes: PerAxis {
                x: AxisEvidence {
                    measured_m_s2: Some(-0.1),
                    limit_m_s2: 0.2,
                    ..AxisEvidence::default()
                },
                y: AxisEvidence {
                    enabled: true,
                    twin_m_s2: Some(0.3),
                    nats: 12.5,
                    answer: Some(Answer { gain: 0.5, gain_error: 0.1, ..Answer::default() }),
                    ..AxisEvidence::default()
                },
            },
            outliers: 3,
            ..Evidence::default()
        };
        let suspicion = Suspicion {
            onset: SimTime::new(1.25),
            kind: Some(FaultKind::Dead),
            candidates: vec![Candidate { code: FaultCode::StuckBall, kind: None, weight: 0.5 }],
        };
        let mut before = FaultMemory::default();
        before.failed(FaultCode::YServo, &suspicion, &frame);
        before.acknowledge(FaultCode::YServo);
        let json = serde_json::to_string(&view(&before)).unwrap();
        let after = memory(&serde_json::from_str(&json).unwrap()).unwrap();
        assert_eq!(after, before);
    }
}
