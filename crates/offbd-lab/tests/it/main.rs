//! Black-box tests of the twin, the engine and the laboratory: against reference
//! trajectories, closed forms, orders of convergence, and rigs with known faults.

#![allow(unreachable_pub, clippy::unwrap_used, reason = "a test fails by panicking")]

mod drive_cycle;
mod engine;
mod reference;
mod stability;
