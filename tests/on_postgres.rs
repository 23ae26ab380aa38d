//! The tests that start the service once more, with PostgreSQL below it: a
//! private server that this process starts.

#![expect(clippy::duplicate_mod, reason = "each of the files brings its own support")]

#[path = "access.rs"]
mod access;
#[path = "arrival.rs"]
mod arrival;
#[path = "bad_input.rs"]
mod bad_input;
#[path = "crash.rs"]
mod crash;
#[path = "fault_memory.rs"]
mod fault_memory;
#[path = "journal.rs"]
mod journal;
#[path = "learning.rs"]
mod learning;
#[path = "liveness.rs"]
mod liveness;
#[path = "main_job.rs"]
mod main_job;
#[path = "retention.rs"]
mod retention;
#[path = "same_verdict.rs"]
mod same_verdict;
#[path = "service.rs"]
mod service;
#[path = "views.rs"]
mod views;
