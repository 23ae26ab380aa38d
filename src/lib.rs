//! offbd: off-board diagnostics with a digital twin for ball-on-plate rigs.
//!
//! A device streams commands and measured positions; a physics twin runs
//! beside it in lockstep; an enable-gated evaluator compares the measured
//! with the twin's acceleration and raises faults. `ARCHITECTURE.md` has the
//! map. Without the feature `service` the crate is the mathematics, the
//! judgement and the engine alone:
//!
//! - [`vocabulary`]: axes, faults, times, samples (floor 0);
//! - [`maths`], [`plant`]: estimation and physics (floor 1);
//! - [`diagnosis`]: residuals, monitors, fault memory (floor 2);
//! - [`engine`]: one rig's pipeline (floor 3).

pub mod cli;
pub mod wire;

pub mod store;

pub mod service;

pub mod http;
pub mod judging;

pub mod config;
pub mod server;
