//! The command line from outside: a process, its two streams and its exit code.

mod bench;
mod calibrate;
mod chart;
mod demo;
mod drive_cycle;
mod replay;
mod scene;
mod score;
mod service;
mod simulate;
mod soak;
mod token;
mod trends;
mod usage;
