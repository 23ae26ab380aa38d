//! Evaluates a recording again on request: for plots and tables ([`trace`]), for the
//! recording of a fault ([`fault_recording`]), and to try other settings ([`trial`]). Nothing
//! is stored or changed. (A replay, which stores its result, is a background job:
//! [`jobs`](super::jobs).)

pub(super) mod evaluation;
pub(super) mod fault_recording;
pub(super) mod trace;
pub(super) mod trial;
