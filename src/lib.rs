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
//! This crate is the program: configuration, assembly and command line. The crates below it,
//! from the lowest layer to the highest:
//!
//! - `offbd-core`: the twin and the diagnosis, which other programs can embed;
//! - `offbd-lab`: scenes, simulated rigs and charts;
//! - [`wire`]: the formats of files and messages (assets, sessions, verdicts), and the
//!   judgement of one session, shared by the service and the command line;
//! - [`store`]: assets, sessions, recordings and faults in a database (SQLite or
//!   PostgreSQL);
//! - [`service`]: the engines of all assets, sessions, jobs, access control and events;
//! - [`http`]: the HTTP and WebSocket interface;
//! - `bus`, with the features `nats` and `mqtt`: devices over NATS and MQTT;
//! - `offbd-forward`: the edge agent, which keeps telemetry until the service has stored it;
//! - `offbd-file-cli`, `offbd-lab-cli`: the commands that need no service;
//! - [`config`]: the configuration of the service;
//! - [`server`]: the assembly of these parts, with TLS and limits on connections;
//! - [`cli`]: the subcommands of the program `offbd`.
//!
//! `ARCHITECTURE.md` describes how they work together, `docs/notation.md` the terms.

pub mod cli;
pub mod config;
pub mod server;

#[cfg(any(feature = "nats", feature = "mqtt"))]
pub use offbd_bus as bus;
pub use offbd_http as http;
pub use offbd_service as service;
pub use offbd_store as store;
pub use offbd_wire as wire;
