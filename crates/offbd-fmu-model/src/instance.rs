//! An instance of the model: its values, its twin, and what may be done with it when.

use offbd_core::plant::SimulatedTwin;
use offbd_core::vocabulary::{Axis, Invalid, PerAxis, SimTime, in_range};
use serde::{Deserialize, Serialize};

use crate::start_values::StartValues;
use crate::twin;
use crate::variables::{
    COMMAND_QX, COMMAND_QY, COUNT, LONGEST_STEP, QX, QY, Role, TIME, VARIABLES, VX, VY, X, Y,
};

/// Longest communication step, s; a longer one is refused. Chosen.
const LONGEST_COMMUNICATION_STEP_S: f64 = 3600.0;

/// Largest difference between the time of an instance and that of its importer, s. Chosen:
/// above the rounding of sums, below any step.
const SAME_TIME_S: f64 = 1e-7;

/// Why an instance refuses a call.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    #[error("{0}")]
    Value(#[from] Invalid),
    #[error("there is no variable with the value reference {0}")]
    NoVariable(u32),
    #[error("{variable} cannot be set {phase}")]
    NotSettable { variable: &'static str, phase: &'static str },
    #[error("{call} is not allowed {phase}")]
    NotAllowed { call: &'static str, phase: &'static str },
    #[error("the step begins at {from_s} s, but the last one ended at {at_s} s")]
    OtherTime { from_s: f64, at_s: f64 },
    #[error("{0} is not a time")]
    NoTime(f64),
    #[error("the location of the resources, {uri}, {why}")]
    Location { uri: String, why: &'static str },
    #[error("the state was not saved by this model: {0}")]
    State(String),
}

/// Where an instance is between its start and its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum LifePhase {
    Instantiated,
    Initialization,
    Steps,
    Terminated,
}

impl LifePhase {
    const fn words(self) -> &'static str {
        match self {
            Self::Instantiated => "before the initialization",
            Self::Initialization => "during the initialization",
            Self::Steps => "after the initialization",
            Self::Terminated => "after the end",
        }
    }

    const fn is_before_steps(self) -> bool {
        matches!(self, Self::Instantiated | Self::Initialization)
    }
}

/// An instance of the model. Its copy is its saved state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Instance {
    start: [f64; COUNT],
    phase: LifePhase,
    values: [f64; COUNT],
    twin: Option<SimulatedTwin>,
}

impl Instance {
    #[must_use]
    pub const fn new(start: &StartValues) -> Self {
        let start = *start.values();
        Self { start, phase: LifePhase::Instantiated, values: start, twin: None }
    }

    /// Returns to the state after [`new`](Self::new).
    pub fn reset(&mut self) {
        *self = Self {
            start: self.start,
            phase: LifePhase::Instantiated,
            values: self.start,
            twin: None,
        };
    }

    /// Sets the time at which the simulation starts, s; without this call it is 0.
    ///
    /// # Errors
    /// [`Refusal`] if the initialization has begun before, or the time is not finite.
    pub fn start_at(&mut self, start_s: f64) -> Result<(), Refusal> {
        self.expect("a start time", LifePhase::Instantiated)?;
        self.values[TIME] = time(start_s)?.seconds();
        Ok(())
    }

    /// Begins the initialization.
    ///
    /// # Errors
    /// [`Refusal`] if it has begun before.
    pub fn enter_initialization(&mut self) -> Result<(), Refusal> {
        self.expect("the initialization", LifePhase::Instantiated)?;
        self.phase = LifePhase::Initialization;
        Ok(())
    }

    /// Ends the initialization: the servos stand on their commands.
    ///
    /// # Errors
    /// [`Refusal`] if it has not begun.
    pub fn exit_initialization(&mut self) -> Result<(), Refusal> {
        self.expect("the end of the initialization", LifePhase::Initialization)?;
        self.settle()?;
        self.phase = LifePhase::Steps;
        Ok(())
    }

    /// Ends the simulation; values can still be read.
    ///
    /// # Errors
    /// [`Refusal`] if it has not begun.
    pub fn terminate(&mut self) -> Result<(), Refusal> {
        self.expect("the end", LifePhase::Steps)?;
        self.phase = LifePhase::Terminated;
        Ok(())
    }

    /// Returns the value of a variable.
    ///
    /// # Errors
    /// [`Refusal`] if there is no such variable.
    pub fn get(&mut self, reference: u32) -> Result<f64, Refusal> {
        if self.phase == LifePhase::Initialization {
            self.settle()?;
        }
        Ok(self.values[index(reference)?])
    }

    /// Sets a variable.
    ///
    /// # Errors
    /// [`Refusal`] if there is no such variable, it cannot be set now, or the value is out of
    /// its range.
    pub fn set(&mut self, reference: u32, value: f64) -> Result<(), Refusal> {
        let index = index(reference)?;
        let variable = &VARIABLES[index];
        let settable = match variable.role {
            Role::Input | Role::TunableParameter => self.phase != LifePhase::Terminated,
            Role::State | Role::FixedParameter => self.phase.is_before_steps(),
            Role::Time | Role::Output | Role::Constant => false,
        };
        if !settable {
            let (variable, phase) = (variable.name, self.phase.words());
            return Err(Refusal::NotSettable { variable, phase });
        }
        self.values[index] = in_range(variable.name, value, variable.range.clone())?;
        Ok(())
    }

    /// Advances from `from_s`, the present time, by `step_s` under the present commands and
    /// parameters.
    ///
    /// # Errors
    /// [`Refusal`] if the initialization has not ended, the times do not fit or the step is
    /// not above 0 and at most an hour; then nothing has changed.
    pub fn step(&mut self, from_s: f64, step_s: f64) -> Result<(), Refusal> {
        self.expect("a step", LifePhase::Steps)?;
        let at_s = self.values[TIME];
        if (from_s - at_s).abs().is_nan() || (from_s - at_s).abs() > SAME_TIME_S {
            return Err(Refusal::OtherTime { from_s, at_s });
        }
        in_range("step", step_s, f64::MIN_POSITIVE..=LONGEST_COMMUNICATION_STEP_S)?;
        let (commands, to) = (self.commands(), time(from_s + step_s)?);
        let model = twin::model(&self.values)?;
        let Some(twin) = &mut self.twin else { return Ok(()) };
        twin.retune(model);
        twin.command(commands.map(Some));
        twin.advance(to, self.values[LONGEST_STEP]);
        self.values[TIME] = to.seconds();
        self.read_twin();
        Ok(())
    }

    /// Returns this instance as bytes.
    ///
    /// # Errors
    /// [`Refusal`] if memory is short.
    pub fn to_bytes(&self) -> Result<Vec<u8>, Refusal> {
        rmp_serde::to_vec(self).map_err(|error| Refusal::State(error.to_string()))
    }

    /// Returns the instance that [`to_bytes`](Self::to_bytes) has saved.
    ///
    /// # Errors
    /// [`Refusal`] if the bytes are those of something else, or have a value that cannot be set.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Refusal> {
        let saved: Self =
            rmp_serde::from_slice(bytes).map_err(|error| Refusal::State(error.to_string()))?;
        for (i, variable) in VARIABLES.iter().enumerate() {
            in_range(variable.name, saved.start[i], variable.range.clone())?;
            // What the model computes may leave the range of start values.
            if !matches!(variable.role, Role::State | Role::Output) {
                in_range(variable.name, saved.values[i], variable.range.clone())?;
            }
        }
        // The next step goes on from the time of the twin.
        let at_s = saved.values[TIME];
        let is_there = |twin: &SimulatedTwin| {
            (twin.now().seconds() - at_s).abs() <= LONGEST_COMMUNICATION_STEP_S
        };
        if saved.twin.as_ref().is_some_and(|twin| !is_there(twin)) {
            return Err(Refusal::State("the twin is at another time".to_owned()));
        }
        Ok(saved)
    }

    fn expect(&self, call: &'static str, phase: LifePhase) -> Result<(), Refusal> {
        if self.phase == phase {
            return Ok(());
        }
        Err(Refusal::NotAllowed { call, phase: self.phase.words() })
    }

    fn commands(&self) -> PerAxis<f64> {
        // The x servo turns qy, the y servo qx.
        PerAxis { x: self.values[COMMAND_QY], y: self.values[COMMAND_QX] }
    }

    /// Builds the twin at the present time with its servos on their commands.
    fn settle(&mut self) -> Result<(), Refusal> {
        let at = time(self.values[TIME])?;
        let twin = twin::start(&self.values, at, self.commands())?;
        self.twin = Some(twin);
        self.read_twin();
        Ok(())
    }

    fn read_twin(&mut self) {
        let Some(twin) = &self.twin else { return };
        let (ball, plate) = (twin.ball(), twin.plate());
        [self.values[X], self.values[Y]] = ball.position.into();
        [self.values[VX], self.values[VY]] = ball.velocity.into();
        (self.values[QX], self.values[QY]) = (plate[Axis::Y], plate[Axis::X]);
    }
}

fn index(reference: u32) -> Result<usize, Refusal> {
    let index = usize::try_from(reference).ok().filter(|&index| index < COUNT);
    index.ok_or(Refusal::NoVariable(reference))
}

fn time(seconds: f64) -> Result<SimTime, Refusal> {
    SimTime::new(seconds).ok_or(Refusal::NoTime(seconds))
}

#[cfg(test)]
mod tests;
