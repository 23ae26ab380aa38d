//! offbd: off-board diagnostics with a digital twin for ball-on-plate rigs.
//!
//! A device streams commands and measured positions; a physics twin runs
//! beside it in lockstep; an enable-gated evaluator compares the measured
//! with the twin's acceleration and raises faults. `ARCHITECTURE.md` has the
//! map.
//!
//! This crate is the service and the command line: formats ([`wire`]), the
//! driver of a session ([`judging`]), storage ([`store`]), sessions and jobs
//! ([`service`]), the interface ([`http`]), and what puts them together
//! ([`config`], [`server`], [`cli`]). The twin and the diagnosis, to embed, are
//! the crate `offbd-core`; scenes, simulated rigs and charts `offbd-lab`.

pub mod cli;
pub mod config;
pub mod http;
pub mod judging;
pub mod server;
pub mod service;
pub mod store;
pub mod wire;
