//! The inputs of the engine, its decisions on them and its state.

use alloc::borrow::ToOwned;
use alloc::format;
use alloc::string::String;

use crate::diagnosis::{DebounceTimes, Evidence};
use crate::plant::Fidelity;
use crate::vocabulary::{Brief, FaultCode, PerAxis, Sample, SimTime};

/// Returns a number with at most two decimals: a limit converted to the units of a device has many.
fn hundredths(number: f64) -> String {
    let text = format!("{number:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// An input of the engine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Input {
    /// A row of telemetry, in order of arrival; it may be a retransmission.
    Sample(Sample),
    /// A row that is not a retransmission: one of a recording, or one that the recording does
    /// not contain.
    NewSample(Sample),
    /// A person clears a code.
    Clear(FaultCode),
    /// A person acknowledges the current occurrence of a code.
    Acknowledge(FaultCode),
    /// The session ends: the waiting samples are judged, the operation cycle ends.
    End,
}

/// The decision on a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Admission {
    /// New: to be recorded; judged at once or in its turn.
    Accepted,
    /// New and to be recorded, but too late to be judged, or to be judged only if the next
    /// samples confirm a jump of the clock.
    SetAside(Rejection),
    /// Already known, with the same values: neither recorded nor judged again.
    Duplicate,
    /// Older than the samples that the engine remembers, and nothing was done with it. If
    /// the recording does not contain it, it can be passed as [`Input::NewSample`].
    Unknown,
    /// Invalid: neither recorded nor judged.
    Rejected(Rejection),
}

/// Why a sample is not judged.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Rejection {
    #[error("{field} is not a finite number")]
    NotFinite { field: &'static str },
    #[error("{field} is {}, beyond ±{}{}", Brief(*value), hundredths(*limit), unit(field))]
    Absurd { field: &'static str, value: f64, limit: f64 },
    #[error("t_s is {behind_s:.3} s before the last judged sample: recorded, not judged")]
    Late { behind_s: f64 },
    #[error("t_s jumps by {step_s:.1} s: recorded, judged once the next samples confirm the jump")]
    Jump { step_s: f64 },
    #[error(
        "another sample with this {key} is recorded, with other values: a device that starts \
         again needs a new session, and two devices need two names"
    )]
    Conflict { key: &'static str },
    #[error("too old to tell whether it is recorded: send it in a batch that spans less time")]
    TooOld,
    /// Given by a caller that cannot read it.
    #[error("it is not a sample: the answer to its batch says what is wrong")]
    Malformed,
}

/// Says the unit of a time, which clocks often have otherwise.
fn unit(field: &str) -> &'static str {
    if field == "t_s" { "; its unit is s" } else { "" }
}

impl Rejection {
    /// The identifier of the reason.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::NotFinite { .. } => "not_finite",
            Self::Absurd { .. } => "absurd",
            Self::Late { .. } => "late",
            Self::Jump { .. } => "jump",
            Self::Conflict { .. } => "conflict",
            Self::TooOld => "too_old",
            Self::Malformed => "form",
        }
    }

    /// The key of `sample` is that of another sample.
    #[must_use]
    pub const fn conflict(sample: &Sample) -> Self {
        Self::Conflict { key: if sample.seq.is_some() { "seq" } else { "t_s" } }
    }
}

/// Samples that are not judged, so many of the last ones that the rig counts as not tested.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unjudged {
    /// Their number since they are so many.
    pub n: u64,
    /// Why the last of them is not judged.
    pub why: Rejection,
}

/// Whether a monitor has a result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Readiness {
    /// The monitor is enabled at present.
    pub enabled: bool,
    /// It has had a result in this session.
    pub complete_this_cycle: bool,
    /// It has had a result since the code was last cleared.
    pub complete_since_clear: bool,
}

/// The result that a monitor can give in a session so far, whatever it has found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reach {
    /// It could judge for less time than a fault takes to be confirmed.
    #[default]
    NotJudged,
    /// It has judged for long enough, but the rig is not learnt: a fault of its code is
    /// never confirmed, and agreement does not prove health.
    NotLearnt,
    /// It has judged for long enough to confirm a fault.
    Judged,
}

/// The state of one monitor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MonitorState {
    /// Fault detection counter, −128 (passed) to 127 (failed).
    pub counter: i8,
    /// Evidence against a servo as its monitor weighs it, nats: after the isolation from other
    /// causes. Zero for the other monitors and where evidence does not decide.
    pub nats: f64,
    pub readiness: Readiness,
    /// Time of this session for which it could judge, s.
    pub judged_s: f64,
    /// That time as a fraction of the session from its first sample to its last, 0 to 1.
    pub judged_share: f64,
    pub reach: Reach,
}

/// The values at which a monitor decides; constant during a session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// The debounce times for a failure of no particular kind without a rival cause.
    pub times: DebounceTimes,
    /// Evidence at which the test fails, nats; `None` if evidence does not decide.
    pub suspect_nats: Option<f64>,
    /// Evidence that confirms a fault, nats; `None` if evidence does not decide.
    pub confirm_nats: Option<f64>,
}

/// The state of an engine; see [`super::Engine::state`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Time of the last judged sample.
    pub at: Option<SimTime>,
    /// Samples judged in this session.
    pub n_judged: u64,
    /// Samples waiting for an earlier one.
    pub n_waiting: usize,
    /// The unjudged ones of the last samples, if they are so many that the rig counts as not
    /// tested; the evidence and the monitors are those of the judged samples.
    pub unjudged: Option<Unjudged>,
    /// The twin's position relative to the plate, drawn beside the measured one, m.
    pub twin_position_m: PerAxis<f64>,
    /// The twin's velocity, m/s.
    pub twin_velocity_m_s: PerAxis<f64>,
    /// The twin's plate angle of each axis, rad.
    pub plate_angle_rad: PerAxis<f64>,
    pub evidence: Evidence,
    /// One per code, in the order of [`FaultCode::ALL`].
    pub monitors: [MonitorState; FaultCode::COUNT],
    /// The plant model in use.
    pub fidelity: Fidelity,
}
