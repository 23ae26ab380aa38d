//! The words that every floor shares: axes, faults, times, samples, and the
//! one error for a value that cannot be.
//!
//! Knows only the standard library. Judges nothing: whether a sample is
//! believable is the engine's question.

mod axis;
mod fault;
mod number;
mod sample;
mod time;

pub use axis::{Axis, PerAxis};
pub use fault::{FaultCode, FaultKind, FaultStatus, UnknownWord};
pub use number::{Brief, Invalid, in_range, positive};
pub use sample::Sample;
pub use time::SimTime;
