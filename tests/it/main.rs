//! Tests of offbd from outside: over sockets, as a process, with a real database. With
//! `TEST_DATABASE=postgres` the services under test use a private PostgreSQL server.

#![allow(unreachable_pub, clippy::unwrap_used, reason = "a test fails by panicking")]

mod access;
mod alarms;
mod architecture;
mod arrival;
mod backup;
mod bad_input;
mod bounds;
#[cfg(all(feature = "nats", feature = "mqtt"))]
mod bus;
mod cli;
mod cluster;
mod coding;
#[cfg(feature = "parquet")]
mod crash;
mod damage;
mod editions;
mod engine_snapshot;
mod examples;
mod fault_memory;
mod formats;
mod forward;
mod fuzz;
#[cfg(all(feature = "mcap", feature = "xlsx"))]
mod imports;
mod jobs;
mod journal;
mod jwt;
mod learning;
mod link;
mod lists;
mod liveness;
mod main_job;
mod messages;
mod monitoring;
mod network;
mod notifications;
#[cfg(all(target_os = "linux", target_env = "gnu"))]
mod one_failure;
mod outage;
mod outcome;
mod parts;
#[cfg(all(target_os = "linux", target_env = "gnu"))]
mod power_cut;
mod reads;
mod remarks;
mod restart;
mod retention;
mod same_sample;
mod same_verdict;
mod service;
mod small;
#[cfg(all(target_os = "linux", target_env = "gnu"))]
mod soak;
mod support;
mod tables;
mod tags;
#[cfg(feature = "otel")]
#[cfg(feature = "otel")]
mod traces;
mod trends;
mod trials;
mod upgrade;
mod views;
