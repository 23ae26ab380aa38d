//! The twin and the diagnosis of offbd, to embed: mathematics, the plant, the
//! monitors and the engine of one rig.
//!
//! Pure and deterministic: no clock, no chance, no files, no sockets; time and
//! samples are arguments, and equal inputs give equal outputs to the bit.
//!
//! - [`vocabulary`]: axes, faults, times, samples;
//! - [`maths`], [`plant`]: estimation and physics;
//! - [`diagnosis`]: residuals, monitors, fault memory;
//! - [`engine`]: one rig's pipeline.

#![cfg_attr(not(feature = "std"), no_std)]

extern crate alloc;

#[cfg(not(feature = "std"))]
mod no_std;

pub mod diagnosis;
pub mod engine;
pub mod maths;
pub mod plant;
pub mod vocabulary;
