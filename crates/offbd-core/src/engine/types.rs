//! What goes into the engine and what comes out.

use crate::diagnosis::{Evidence, Transition};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::plant::Fidelity;
use crate::vocabulary::{Brief, FaultCode, PerAxis, Sample, SimTime};

/// Something that happens to a rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Input {
    /// A row of telemetry, in order of arrival.
    Sample(Sample),
    /// A person clears a code.
    Clear(FaultCode),
    /// A person acknowledges the current occurrence of a code.
    Acknowledge(FaultCode),
    /// The session ends: what still waits is judged, the operation cycle ends.
    End,
}

/// Something that follows.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// What became of the sample that was put in.
    Admitted(Admission),
    /// A status byte changed.
    Transition(Box<Transition>),
}

/// What became of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Admission {
    /// New: to be recorded; judged now or once its turn comes.
    Accepted,
    /// New and to be recorded, but too late or too far ahead to be judged.
    SetAside(Rejection),
    /// Already there: neither recorded nor judged again.
    Duplicate,
    /// Not a sample: neither recorded nor judged.
    Rejected(Rejection),
}

/// Why a sample is not judged.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Rejection {
    #[error("{field} is not a finite number")]
    NotFinite { field: &'static str },
    #[error("{field} is {}, beyond ±{limit}", Brief(*value))]
    Absurd { field: &'static str, value: f64, limit: f64 },
    #[error("t_s is {behind_s:.3} s behind what has been judged: kept, not judged")]
    Late { behind_s: f64 },
    #[error("t_s jumps {ahead_s:.0} s ahead: kept, not judged unless the clock goes on from there")]
    Jump { ahead_s: f64 },
}

impl Rejection {
    /// The kind of reason in one word.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::NotFinite { .. } => "not_finite",
            Self::Absurd { .. } => "absurd",
            Self::Late { .. } => "late",
            Self::Jump { .. } => "jump",
        }
    }
}

/// Whether a monitor has come to a result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Readiness {
    /// It may judge right now.
    pub enabled: bool,
    /// It has come to a result in this session.
    pub complete_this_cycle: bool,
    /// It has come to a result since the code was last cleared.
    pub complete_since_clear: bool,
}

/// How far a monitor has got in a session, whatever it has found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reach {
    /// It could judge for less time than a fault takes to be confirmed.
    #[default]
    NotJudged,
    /// It has judged, but on a rig that is not learnt a fault of its code is
    /// never confirmed, and agreement is no proof of health.
    NotLearnt,
    /// It has judged for long enough to have confirmed a fault.
    Judged,
}

/// One monitor at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MonitorState {
    /// Fault detection counter, −128 (passed) to 127 (failed).
    pub counter: i8,
    pub readiness: Readiness,
    /// Seconds of this session in which it could judge.
    pub judged_s: f64,
    /// The same as a share of the session, from its first sample to its last,
    /// 0 to 1.
    pub judged_share: f64,
    pub reach: Reach,
}

/// Where an engine stands; see [`super::Engine::state`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Time of the last judged sample.
    pub at: Option<SimTime>,
    /// Samples judged in this session.
    pub n_judged: u64,
    /// Samples waiting for an earlier one.
    pub n_waiting: usize,
    /// The twin's position beside the measured one, m.
    pub twin_position_m: PerAxis<f64>,
    /// The twin's velocity, m/s.
    pub twin_velocity_m_s: PerAxis<f64>,
    /// The twin's plate angle behind each axis, rad.
    pub plate_angle_rad: PerAxis<f64>,
    pub evidence: Evidence,
    /// One per code, in the order of [`FaultCode::ALL`].
    pub monitors: [MonitorState; FaultCode::COUNT],
    /// The plant model in use.
    pub fidelity: Fidelity,
}
