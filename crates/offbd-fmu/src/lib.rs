//! The shared library of the twin's FMU: the C functions of FMI 3.0.
//!
//! Only pointers are handled here; what a call means is in `offbd-fmu-model`. Every function
//! of the standard is exported, because importers look for all of them; those that a
//! co-simulation of real numbers does not have answer with an error.

mod call;
mod co_simulation;
mod component;
mod not_offered;
mod states;
