//! The fault memory as it is stored and served.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::verdict::{
    AnswerView, AxisEvidenceView, CandidateView, EvidenceView, candidate_view, evidence_view,
};
use offbd_core::diagnosis::{
    Answer, AxisEvidence, Candidate, Evidence, FaultMemory, FaultRecord, InUse, MemoryRules,
    StatusByte, Step, Suspicion,
};
use offbd_core::vocabulary::{FaultCode, FaultKind, PerAxis, SimTime, UnknownWord};

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
    #[serde(default)]
    pub status_bits: StatusBitsView,
    pub axis: Option<String>,
    pub command: Option<String>,
    /// When the deviation began that failed the test last, s on the clock of
    /// the last occurrence's session.
    pub onset_s: Option<f64>,
    pub candidates: Vec<CandidateView>,
    /// Times the test failed anew since the last clear.
    pub occurrences: u32,
    /// Onset of the first of them, s on the clock of its session.
    #[serde(default)]
    pub first_onset_s: Option<f64>,
    /// Onset of the last of them, s on the clock of its session.
    #[serde(default)]
    pub last_onset_s: Option<f64>,
    /// Operation cycles (sessions) with a failure since the last clear.
    #[serde(default)]
    pub failed_cycles: u32,
    /// Whether the current occurrence has been acknowledged.
    pub acknowledged: bool,
    /// Operation cycles that counted as a trip.
    pub trips: u8,
    pub tripped_this_cycle: bool,
    /// Good operation cycles in a row.
    pub good_cycles: u8,
    pub healed: bool,
    /// Good operation cycles of a confirmed fault that count towards healing,
    /// and how many it takes.
    #[serde(default)]
    pub healing_counter: u8,
    #[serde(default)]
    pub healing_cycles: u8,
    /// Good operation cycles since it healed, and how many it takes until
    /// everything of it is erased (aging).
    #[serde(default)]
    pub aging_counter: u8,
    #[serde(default)]
    pub aging_cycles: u8,
    /// The first failure of the current occurrence.
    pub freeze_frame: Option<EvidenceView>,
    #[serde(default)]
    pub in_use: InUseView,
}

/// The ISO 14229 status byte, bit by bit from 0 to 7.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct StatusBitsView {
    /// The latest result of the test is a failure.
    pub test_failed: bool,
    /// It has failed in this session.
    pub test_failed_this_operation_cycle: bool,
    /// It has failed in this session or in the last one that came to a result.
    pub pending: bool,
    /// It has failed long enough, often enough, and is kept until it ages.
    pub confirmed: bool,
    /// The test has not come to a result since the code was last cleared.
    pub test_not_completed_since_last_clear: bool,
    /// It has failed since the code was last cleared.
    pub test_failed_since_last_clear: bool,
    /// The test has not come to a result in this session.
    pub test_not_completed_this_operation_cycle: bool,
    /// A warning is asked for.
    pub warning_indicator_requested: bool,
}

/// How often a monitor has been in a position to find its fault (the in-use
/// performance of SAE J1979). Counted at the end of each session; neither
/// clearing nor aging erases it.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct InUseView {
    /// Operation cycles (sessions) that have ended.
    pub operation_cycles: u32,
    /// Those that brought enough data to judge by.
    pub cycles_with_data: u32,
    /// Those in which the gate was open long enough to have found a fault.
    pub cycles_judged: u32,
    /// `cycles_judged` over `cycles_with_data`, 0 to 1; null before there is
    /// one. A low one says that the gate is too strict for this rig.
    pub ratio: Option<f64>,
}

/// The view of a fault memory.
#[must_use]
pub fn view(memory: &FaultMemory, rules: &MemoryRules) -> MemoryView {
    let record = |&code| record_view(code, memory.record(code), rules);
    MemoryView { records: FaultCode::ALL.iter().map(record).collect() }
}

/// The view of one record.
#[must_use]
pub fn record_view(code: FaultCode, record: &FaultRecord, rules: &MemoryRules) -> FaultRecordView {
    let suspicion = record.suspicion.as_ref();
    FaultRecordView {
        code: code.to_string(),
        kind: record.kind().map(|k| k.to_string()),
        status: record.word().to_string(),
        status_byte: record.status.to_string(),
        status_bits: status_bits(record.status),
        axis: code.axis().map(|a| a.as_str().to_owned()),
        command: code.axis().map(|a| a.command().to_owned()),
        onset_s: suspicion.and_then(|s| s.onset).map(SimTime::seconds),
        candidates: suspicion
            .map(|s| s.candidates.iter().map(candidate_view).collect())
            .unwrap_or_default(),
        occurrences: record.occurrences,
        first_onset_s: record.first_onset.map(SimTime::seconds),
        last_onset_s: record.last_onset.map(SimTime::seconds),
        failed_cycles: record.failed_cycles,
        acknowledged: record.acknowledged,
        trips: record.trips,
        tripped_this_cycle: record.tripped_this_cycle,
        good_cycles: record.good_cycles,
        healed: record.healed,
        healing_counter: record.healing_counter(rules),
        healing_cycles: rules.healing_cycles,
        aging_counter: record.aging_counter(rules),
        aging_cycles: rules.aging_cycles,
        freeze_frame: record.freeze_frame.as_deref().map(evidence_view),
        in_use: in_use_view(&record.in_use),
    }
}

const fn status_bits(byte: StatusByte) -> StatusBitsView {
    StatusBitsView {
        test_failed: byte.test_failed(),
        test_failed_this_operation_cycle: byte.failed_this_cycle(),
        pending: byte.pending(),
        confirmed: byte.confirmed(),
        test_not_completed_since_last_clear: !byte.completed_since_clear(),
        test_failed_since_last_clear: byte.failed_since_clear(),
        test_not_completed_this_operation_cycle: !byte.completed_this_cycle(),
        warning_indicator_requested: byte.indicator_requested(),
    }
}

fn in_use_view(in_use: &InUse) -> InUseView {
    InUseView {
        operation_cycles: in_use.cycles,
        cycles_with_data: in_use.with_data,
        cycles_judged: in_use.judged,
        ratio: in_use.ratio(),
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
        first_onset: view.first_onset_s.and_then(SimTime::new),
        last_onset: view.last_onset_s.and_then(SimTime::new),
        failed_cycles: view.failed_cycles,
        acknowledged: view.acknowledged,
        suspicion: (suspicion != Suspicion::default()).then_some(suspicion),
        freeze_frame: view.freeze_frame.as_ref().map(evidence).map(Box::new),
        in_use: InUse {
            cycles: view.in_use.operation_cycles,
            with_data: view.in_use.cycles_with_data,
            judged: view.in_use.cycles_judged,
        },
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
        missing_share: view.missing_share,
        identical_s: view.identical_s,
        still_s: view.still_s,
        outliers: view.outliers,
        scatter_m: view.scatter_m,
        healthy_scatter_m: view.healthy_scatter_m,
        jump: view.jump.map(|step| Step { at_s: step.t_s, size_m: step.size_m }),
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
        path_error_m: view.path_error_m,
        path_limit_m: view.path_limit_m,
        answer: view.answer.as_ref().map(answer),
        identical_s: view.identical_s,
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
                    identical_s: 0.5,
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
            missing_share: 0.25,
            healthy_scatter_m: 2e-4,
            jump: Some(Step { at_s: 1.25, size_m: 0.1 }),
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
        before.count_use(FaultCode::Sensor, 60.0, 30.0, 0.8);
        let json = serde_json::to_string(&view(&before, &MemoryRules::default())).unwrap();
        let after = memory(&serde_json::from_str(&json).unwrap()).unwrap();
        assert_eq!(after, before);
    }

    /// The bits of ISO 14229-1, D.2: 0 is the lowest.
    #[test]
    fn validate_the_bits_have_their_places() {
        let names = [
            "test_failed",
            "test_failed_this_operation_cycle",
            "pending",
            "confirmed",
            "test_not_completed_since_last_clear",
            "test_failed_since_last_clear",
            "test_not_completed_this_operation_cycle",
            "warning_indicator_requested",
        ];
        for (i, name) in names.iter().enumerate() {
            let bits = serde_json::to_value(status_bits(StatusByte::from_bits(1 << i))).unwrap();
            for other in names {
                assert_eq!(bits[other], other == *name, "bit {i}: {bits}");
            }
        }
    }
}
