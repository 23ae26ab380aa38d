//! The embeddable core of offbd: the digital twin and the diagnosis of one rig.
//!
//! Deterministic and free of input and output: it reads no clock, no random numbers, no
//! files and no sockets. Times and samples are arguments, and equal inputs give
//! bit-identical outputs.
//!
//! - [`vocabulary`]: axes, faults, times, samples;
//! - [`maths`], [`plant`]: estimation and physics;
//! - [`diagnosis`]: residuals, monitors, fault memory;
//! - [`engine`]: the pipeline of one rig.
//!
//! ```
//! use offbd_core::diagnosis::FaultMemory;
//! use offbd_core::engine::{Admission, Engine, Input, Rig, Setup};
//! use offbd_core::vocabulary::Sample;
//!
//! let setup = Setup::new(Rig::chapter("my-rig"), None)?;
//! let mut engine = Engine::new(setup, FaultMemory::default());
//! let mut transitions = Vec::new();
//! for i in 0..200 {
//!     // A ball that rests in the middle of a level plate, at 100 Hz.
//!     let (t_s, level, middle) = (f64::from(i) * 0.01, Some(0.0), Some(0.0));
//!     let sample =
//!         Sample { seq: None, t_s, cmd_qx_rad: level, cmd_qy_rad: level, x_m: middle, y_m: middle };
//!     let admission = engine.handle(Input::Sample(sample), &mut transitions);
//!     assert_eq!(admission, Some(Admission::Accepted));
//! }
//! assert!(transitions.is_empty(), "no fault changes its status");
//! # Ok::<(), offbd_core::vocabulary::Invalid>(())
//! ```
//!
//! Without the feature `std` the crate needs only `alloc`. `nalgebra` is part of the
//! public API: positions and velocities are its vectors.

#![cfg_attr(not(feature = "std"), no_std)]

extern crate alloc;

#[cfg(not(feature = "std"))]
mod no_std;

pub mod diagnosis;
pub mod engine;
pub mod maths;
pub mod plant;
pub mod vocabulary;
