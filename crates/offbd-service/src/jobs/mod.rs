//! Background jobs: replays and calibrations. A few run at a time, others wait in bounded
//! queues.

pub(super) mod calibration;
mod context;
mod quiet;
pub(super) mod replay;
mod workers;

/// Why a job failed that a person cancelled.
const CANCELLED: &str = "it was cancelled";

pub(super) use context::JobContext;
pub(super) use workers::spawn;

#[cfg(test)]
mod tests;
