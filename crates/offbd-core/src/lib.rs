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
//!
//! ```
//! use offbd_core::diagnosis::FaultMemory;
//! use offbd_core::engine::{Admission, Engine, Input, Output, Rig, Setup};
//! use offbd_core::vocabulary::Sample;
//!
//! let setup = Setup::new(Rig::chapter("my-rig"), None)?;
//! let mut engine = Engine::new(setup, FaultMemory::default());
//! let mut outputs = Vec::new();
//! for i in 0..200 {
//!     // A ball that rests in the middle of a level plate, at 100 Hz.
//!     let (t_s, level, middle) = (f64::from(i) * 0.01, Some(0.0), Some(0.0));
//!     let sample =
//!         Sample { seq: None, t_s, cmd_qx_rad: level, cmd_qy_rad: level, x_m: middle, y_m: middle };
//!     engine.handle(Input::Sample(sample), &mut outputs);
//! }
//! assert!(outputs.iter().all(|o| matches!(o, Output::Admitted(Admission::Accepted))));
//! # Ok::<(), offbd_core::vocabulary::Invalid>(())
//! ```
//!
//! Without the feature `std` the crate needs `alloc` alone. `nalgebra` is part of
//! what it shows: positions and velocities are its vectors.

#![cfg_attr(not(feature = "std"), no_std)]

extern crate alloc;

#[cfg(not(feature = "std"))]
mod no_std;

pub mod diagnosis;
pub mod engine;
pub mod maths;
pub mod plant;
pub mod vocabulary;
