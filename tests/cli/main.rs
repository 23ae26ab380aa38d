//! The command line from outside: a process, its two streams and its exit code.

mod bench;
mod calibrate;
mod replay;
mod score;
mod simulate;
mod usage;
