//! offbd: off-board diagnostics with a digital twin for ball-on-plate rigs.
//!
//! A device streams its commands and the measured positions of the ball. A physical model
//! of the rig, its twin, receives the same commands in lockstep. Differences between the
//! measured motion and the twin's are the evidence for faults of the servos, the ball and
//! the sensor.
//!
//! With the profile `default`, a servo fault is raised by a likelihood-ratio test (CUSUM)
//! of a broken against a healthy servo, or if the acceleration or the path of the ball
//! deviates from the twin's by more than a limit for a debounce time. With the profile
//! `textbook`, it is raised by a fixed limit on the residual, the measured minus the
//! twin's acceleration, without debounce.
//!
//! This crate is the service and the command line. The twin and the diagnosis are the
//! crate `offbd-core`, which other programs can embed; scenes, simulated rigs and charts
//! are the crate `offbd-lab`. The modules, from the lowest layer to the highest:
//!
//! - [`wire`]: the formats of files and messages (assets, scenes, sessions, verdicts),
//!   and their conversion to and from the types of `offbd-core`;
//! - [`judging`]: the judgement of one session, shared by the service and the command
//!   line;
//! - [`store`]: assets, sessions, recordings and faults in a database (SQLite or
//!   PostgreSQL);
//! - [`service`]: the engines of all assets, sessions, jobs, access control and events;
//! - [`http`]: the HTTP and WebSocket interface;
//! - `bus`, with the features `nats` and `mqtt`: devices over NATS and MQTT;
//! - [`edge_agent`]: `offbd forward`, which keeps telemetry until the service has stored it;
//! - [`config`]: the configuration of the service;
//! - [`server`]: the assembly of these parts, with TLS and limits on connections;
//! - [`cli`]: the subcommands of the program `offbd`.
//!
//! `ARCHITECTURE.md` describes how they work together, `docs/notation.md` the terms.

#[cfg(test)]
mod any_sample;
#[cfg(any(feature = "nats", feature = "mqtt"))]
pub mod bus;
pub mod cli;
pub mod config;
pub mod edge_agent;
pub mod http;
pub mod judging;
mod reasons;
pub mod server;
pub mod service;
pub mod store;
pub mod wire;
