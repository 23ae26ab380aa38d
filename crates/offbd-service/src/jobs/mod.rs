//! Background jobs: replays and calibrations. A few run at a time, others wait in a bounded
//! queue.

mod calibration;
mod context;
mod replay;
mod workers;

pub(super) use context::JobContext;
pub(super) use workers::spawn;
