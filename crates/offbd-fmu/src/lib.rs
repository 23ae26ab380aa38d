//! The shared library of the twin's FMU: the C functions of FMI 2.0 and of FMI 3.0.
//!
//! Only pointers are handled here; what a call means is in `offbd-fmu-model`. A call of either
//! version is a thin layer over the same one of [`calls`]. Every function of co-simulation is
//! exported, because importers look for all of them; those that a model of real numbers does not
//! have answer with an error.

mod call;
mod calls;
mod component;
mod fmi2;
mod fmi3;
mod not_offered;
