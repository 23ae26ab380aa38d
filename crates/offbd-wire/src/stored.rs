//! The stored form of the fault memory and of verdicts. It is separate from the views of the API, so that a
//! change of the API does not change the store.
//!
//! Documents of earlier versions can be read: unknown keys are ignored, and missing keys
//! have default values.

use serde::{Deserialize, Serialize};

use super::verdict::SummaryView;
use super::words::{CodeWord, KindWord};
use offbd_core::diagnosis::{
    AxisEvidence, Candidate, Evidence, FaultMemory, FaultRecord, InUse, PositionJump, StatusByte,
    Suspicion,
};
use offbd_core::engine::JUDGEMENT;
use offbd_core::vocabulary::{FaultCode, PerAxis, SimTime};

/// The verdict of an ended session.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StoredVerdict {
    #[serde(flatten)]
    pub summary: SummaryView,
    /// What gives the same verdict again, to the bit: the version of the judgement and the
    /// kind of machine; `None` if an earlier version stored it.
    #[serde(default)]
    judged_by: Option<String>,
}

impl StoredVerdict {
    /// The verdict `summary` of this program.
    #[must_use]
    pub fn new(summary: SummaryView) -> Self {
        Self { summary, judged_by: Some(judged_by()) }
    }

    /// Whether this program on this machine gives the same verdict on the same recording.
    #[must_use]
    pub fn can_be_repeated(&self) -> bool {
        self.judged_by == Some(judged_by())
    }
}

fn judged_by() -> String {
    format!("{JUDGEMENT} {} {}", std::env::consts::OS, std::env::consts::ARCH)
}

/// The fault memory of one rig.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct StoredMemory {
    pub records: Vec<StoredRecord>,
}

/// The record of one fault code.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StoredRecord {
    pub code: CodeWord,
    pub kind: Option<KindWord>,
    status_byte: String,
    onset_s: Option<f64>,
    candidates: Vec<StoredCandidate>,
    occurrences: u32,
    #[serde(default)]
    first_onset_s: Option<f64>,
    #[serde(default)]
    last_onset_s: Option<f64>,
    #[serde(default)]
    failed_cycles: u32,
    acknowledged: bool,
    trips: u8,
    tripped_this_cycle: bool,
    good_cycles: u8,
    healed: bool,
    freeze_frame: Option<StoredEvidence>,
    #[serde(default)]
    in_use: StoredInUse,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct StoredCandidate {
    code: CodeWord,
    kind: Option<KindWord>,
    weight: f64,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct StoredInUse {
    operation_cycles: u32,
    cycles_with_data: u32,
    cycles_judged: u32,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct StoredEvidence {
    t_s: Option<f64>,
    window_s: f64,
    x: AxisEvidence,
    y: AxisEvidence,
    unseen_s: f64,
    #[serde(default)]
    missing_share: f64,
    identical_s: f64,
    still_s: f64,
    outliers: u32,
    scatter_m: Option<f64>,
    #[serde(default)]
    healthy_scatter_m: f64,
    #[serde(default)]
    jump: Option<StoredJump>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct StoredJump {
    t_s: f64,
    size_m: f64,
}

/// Sessions and people behind a fault record: where and when the fault occurred, who
/// acknowledged or cleared it. The engine knows neither.
// Boxed: most codes of most assets have none of them.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredProvenance {
    #[serde(default)]
    pub first_occurrence: Option<Box<StoredOccurrence>>,
    #[serde(default)]
    pub last_occurrence: Option<Box<StoredOccurrence>>,
    /// Of the current occurrence.
    #[serde(default)]
    pub acknowledgement: Option<Box<StoredAct>>,
    /// The last clear of the code.
    #[serde(default)]
    pub cleared: Option<Box<StoredAct>>,
}

/// An occurrence of a fault.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredOccurrence {
    pub session: String,
    pub session_id: String,
    pub noted_at: String,
    pub calibration_id: Option<String>,
    pub settings_id: String,
}

/// An action of a person: who, and when (RFC 3339).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredAct {
    pub by: String,
    pub at: String,
}

/// The error for an invalid stored status byte.
#[derive(Debug, thiserror::Error)]
#[error("`{0}` is not a status byte")]
pub struct NotAStatusByte(String);

impl StoredMemory {
    #[must_use]
    pub fn of(memory: &FaultMemory) -> Self {
        let record = |&code| StoredRecord::of(code, memory.record(code));
        Self { records: FaultCode::ALL.iter().map(record).collect() }
    }

    /// Returns the fault memory.
    ///
    /// # Errors
    /// [`NotAStatusByte`] if the status byte of a record is invalid.
    pub fn memory(&self) -> Result<FaultMemory, NotAStatusByte> {
        self.records.iter().try_fold(FaultMemory::default(), |memory, record| {
            Ok(memory.with(record.code.into(), record.record()?))
        })
    }
}

impl StoredRecord {
    #[must_use]
    pub fn of(code: FaultCode, record: &FaultRecord) -> Self {
        let suspicion = record.suspicion.as_deref();
        let candidates = suspicion.map(|s| s.candidates.iter().map(StoredCandidate::of).collect());
        Self {
            code: code.into(),
            kind: record.kind().map(KindWord::from),
            status_byte: record.status.to_string(),
            onset_s: suspicion.and_then(|s| s.onset).map(SimTime::seconds),
            candidates: candidates.unwrap_or_default(),
            occurrences: record.occurrences,
            first_onset_s: record.first_onset.map(SimTime::seconds),
            last_onset_s: record.last_onset.map(SimTime::seconds),
            failed_cycles: record.failed_cycles,
            acknowledged: record.acknowledged,
            trips: record.trips,
            tripped_this_cycle: record.tripped_this_cycle,
            good_cycles: record.good_cycles,
            healed: record.healed,
            freeze_frame: record.freeze_frame.as_deref().map(StoredEvidence::of),
            in_use: StoredInUse {
                operation_cycles: record.in_use.cycles,
                cycles_with_data: record.in_use.with_data,
                cycles_judged: record.in_use.judged,
            },
        }
    }

    /// Returns the record.
    ///
    /// # Errors
    /// [`NotAStatusByte`] if the status byte is invalid.
    pub fn record(&self) -> Result<FaultRecord, NotAStatusByte> {
        let bits = u8::from_str_radix(&self.status_byte, 16)
            .map_err(|_| NotAStatusByte(self.status_byte.clone()))?;
        let suspicion = Suspicion {
            onset: self.onset_s.and_then(SimTime::new),
            kind: self.kind.map(Into::into),
            candidates: self.candidates.iter().map(StoredCandidate::candidate).collect(),
        };
        Ok(FaultRecord {
            status: StatusByte::from_bits(bits),
            trips: self.trips,
            tripped_this_cycle: self.tripped_this_cycle,
            good_cycles: self.good_cycles,
            healed: self.healed,
            occurrences: self.occurrences,
            first_onset: self.first_onset_s.and_then(SimTime::new),
            last_onset: self.last_onset_s.and_then(SimTime::new),
            failed_cycles: self.failed_cycles,
            acknowledged: self.acknowledged,
            suspicion: (suspicion != Suspicion::default()).then(|| Box::new(suspicion)),
            freeze_frame: self.freeze_frame.as_ref().map(StoredEvidence::evidence).map(Box::new),
            in_use: InUse {
                cycles: self.in_use.operation_cycles,
                with_data: self.in_use.cycles_with_data,
                judged: self.in_use.cycles_judged,
            },
        })
    }
}

impl StoredCandidate {
    fn of(candidate: &Candidate) -> Self {
        let (code, kind) = (candidate.code.into(), candidate.kind.map(KindWord::from));
        Self { code, kind, weight: candidate.weight }
    }

    fn candidate(&self) -> Candidate {
        let (code, kind) = (self.code.into(), self.kind.map(Into::into));
        Candidate { code, kind, weight: self.weight }
    }
}

/// Copies the fields that both sides have under the same name.
macro_rules! copied {
    ($from:ident => $into:ident { $($field:ident),+ $(,)? } $($rest:tt)*) => {
        $into { $($field: $from.$field),+ $($rest)* }
    };
}

impl StoredEvidence {
    fn of(evidence: &Evidence) -> Self {
        copied!(evidence => Self {
            window_s, unseen_s, missing_share, identical_s, still_s, outliers, scatter_m,
            healthy_scatter_m,
        },
            t_s: evidence.at.map(|t| t.seconds()),
            x: evidence.axes.x,
            y: evidence.axes.y,
            jump: evidence.jump.map(|jump| StoredJump { t_s: jump.at_s, size_m: jump.size_m }),
        )
    }

    fn evidence(&self) -> Evidence {
        copied!(self => Evidence {
            window_s, unseen_s, missing_share, identical_s, still_s, outliers, scatter_m,
            healthy_scatter_m,
        },
            at: self.t_s.and_then(SimTime::new),
            axes: PerAxis { x: self.x, y: self.y },
            jump: self.jump.map(|jump| PositionJump { at_s: jump.t_s, size_m: jump.size_m }),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::diagnosis::ServoAnswer;
    use offbd_core::vocabulary::FaultKind;

    #[test]
    fn a_memory_is_unchanged_after_serialising_and_parsing() {
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
                    answer: Some(ServoAnswer {
                        gain: 0.5,
                        gain_error: 0.1,
                        ..ServoAnswer::default()
                    }),
                    ..AxisEvidence::default()
                },
            },
            outliers: 3,
            missing_share: 0.25,
            healthy_scatter_m: 2e-4,
            jump: Some(PositionJump { at_s: 1.25, size_m: 0.1 }),
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
        let json = serde_json::to_string(&StoredMemory::of(&before)).unwrap();
        let after: StoredMemory = serde_json::from_str(&json).unwrap();
        let after = after.memory().unwrap();
        assert_eq!(after, before);
    }

    /// The evidence of an axis in the form of earlier versions, the first of which had no more.
    #[test]
    fn the_evidence_of_an_axis_is_stored_by_these_names() {
        let first = r#"{"command_rad":0.1,"position_m":null,"velocity_m_s":null,
            "measured_m_s2":-0.5,"twin_m_s2":null,"limit_m_s2":0.2,"enabled":true}"#;
        let axis: AxisEvidence = serde_json::from_str(first).unwrap();
        let expected = AxisEvidence {
            command_rad: Some(0.1),
            measured_m_s2: Some(-0.5),
            limit_m_s2: 0.2,
            enabled: true,
            ..AxisEvidence::default()
        };
        assert_eq!(axis, expected);
        let answer = Some(ServoAnswer { gain: 0.5, ..ServoAnswer::default() });
        let stored = serde_json::to_string(&AxisEvidence { answer, ..axis }).unwrap();
        let names = "command_rad position_m velocity_m_s measured_m_s2 twin_m_s2 limit_m_s2 enabled
            nats path_nats path_limit_nats answer offset_m_s2 offset_error_m_s2 gain gain_error
            delay_s delay_error_s likelihoods identical_s";
        let found: Vec<&str> = stored.split('"').skip(1).step_by(2).collect();
        assert_eq!(found, names.split_whitespace().collect::<Vec<_>>());
    }

    /// A record as version 0.1 stored it, which was also the form of the API.
    #[test]
    fn a_record_of_an_earlier_version_is_read() {
        let json = r#"{"code":"y_servo","kind":"dead","status":"pending","status_byte":"27",
            "axis":"y","command":"qx","onset_s":1.25,"candidates":[],"occurrences":1,
            "acknowledged":false,"trips":0,"tripped_this_cycle":false,"good_cycles":0,
            "healed":false,"healing_counter":0,"freeze_frame":null}"#;
        let stored: StoredRecord = serde_json::from_str(json).unwrap();
        let record = stored.record().unwrap();
        assert_eq!(record.status.bits(), 0x27);
        assert_eq!(record.kind().map(KindWord::from), Some(KindWord::Dead));
        let broken = StoredRecord { status_byte: "XY".to_owned(), ..stored };
        assert_eq!(broken.record().unwrap_err().to_string(), "`XY` is not a status byte");
    }
}
