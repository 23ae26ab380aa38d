//! The twin, the engine and the laboratory from outside: against trusted
//! trajectories, closed forms, orders of convergence, and rigs whose truth is
//! known.

#![allow(unreachable_pub, clippy::unwrap_used, reason = "a test fails by panicking")]

mod drive_cycle;
mod engine;
mod reference;
mod stability;
