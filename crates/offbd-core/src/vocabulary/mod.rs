//! The types that all modules share: axes, faults, times, samples, and the error for an
//! invalid value.
//!
//! Depends on the standard library only. Does not judge samples: whether one is plausible
//! is decided in [`engine`](crate::engine).

#[cfg(feature = "proptest")]
mod any_sample;
mod axis;
mod fault;
mod number;
mod sample;
mod time;

#[cfg(feature = "proptest")]
pub use any_sample::any_sample;
pub use axis::{Axis, PerAxis};
pub use fault::{FaultCode, FaultKind, FaultStatus, UnknownWord};
pub use number::{Brief, Invalid, in_range, positive};
pub use sample::Sample;
pub(crate) use time::CLOCK_RESOLUTION_S;
pub use time::{SimTime, TimeRange};
