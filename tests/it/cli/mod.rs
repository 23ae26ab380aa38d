//! The command line from outside: a process with its output and exit code.

mod calibrate;
mod chart;
mod demo;
mod drive_cycle;
pub mod fixture;
mod fmu;
mod readme;
mod replay;
mod scene;
mod score;
mod service;
mod shell;
mod simulate;
mod soak;
mod token;
mod trends;
mod usage;
