//! Functions of the standards for what this model does not have: other types than real numbers,
//! derivatives, clocks, events, model exchange and scheduled execution.

#![expect(unsafe_code, reason = "the interface of FMI is C")]

use std::ffi::{c_int, c_void};
use std::ptr;

use crate::call::with;
use crate::component::RefusedCall;

/// Defines functions that refuse the call, and log that.
///
/// All their further arguments are left out: in the C calling conventions of the platforms of
/// FMI the caller removes them, and none of them is read.
macro_rules! not_offered {
    ($($name:ident),* $(,)?) => {$(
        /// # Safety
        /// As for [`with`].
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $name(instance: *mut c_void) -> c_int {
            let refused = concat!(stringify!($name), " is not offered by this model");
            // SAFETY: the caller's contract is that of `with`.
            unsafe { with(instance, |_| Err(RefusedCall(refused.to_owned()))) }
        }
    )*};
}

not_offered!(
    fmi2GetInteger,
    fmi2GetBoolean,
    fmi2GetString,
    fmi2SetInteger,
    fmi2SetBoolean,
    fmi2SetString,
    fmi2GetDirectionalDerivative,
    fmi2SetRealInputDerivatives,
    fmi2GetRealOutputDerivatives,
    // A step ends before its call does, and is never discarded.
    fmi2CancelStep,
    fmi2GetStatus,
    fmi2GetRealStatus,
    fmi2GetIntegerStatus,
    fmi2GetBooleanStatus,
    fmi2GetStringStatus,
    fmi3EnterEventMode,
    fmi3GetFloat32,
    fmi3GetInt8,
    fmi3GetUInt8,
    fmi3GetInt16,
    fmi3GetUInt16,
    fmi3GetInt32,
    fmi3GetUInt32,
    fmi3GetInt64,
    fmi3GetUInt64,
    fmi3GetBoolean,
    fmi3GetString,
    fmi3GetBinary,
    fmi3GetClock,
    fmi3SetFloat32,
    fmi3SetInt8,
    fmi3SetUInt8,
    fmi3SetInt16,
    fmi3SetUInt16,
    fmi3SetInt32,
    fmi3SetUInt32,
    fmi3SetInt64,
    fmi3SetUInt64,
    fmi3SetBoolean,
    fmi3SetString,
    fmi3SetBinary,
    fmi3SetClock,
    fmi3GetNumberOfVariableDependencies,
    fmi3GetVariableDependencies,
    fmi3GetDirectionalDerivative,
    fmi3GetAdjointDerivative,
    fmi3EnterConfigurationMode,
    fmi3ExitConfigurationMode,
    fmi3GetIntervalDecimal,
    fmi3GetIntervalFraction,
    fmi3GetShiftDecimal,
    fmi3GetShiftFraction,
    fmi3SetIntervalDecimal,
    fmi3SetIntervalFraction,
    fmi3SetShiftDecimal,
    fmi3SetShiftFraction,
    fmi3EvaluateDiscreteStates,
    fmi3UpdateDiscreteStates,
    fmi3EnterContinuousTimeMode,
    fmi3CompletedIntegratorStep,
    fmi3SetTime,
    fmi3SetContinuousStates,
    fmi3GetContinuousStateDerivatives,
    fmi3GetEventIndicators,
    fmi3GetContinuousStates,
    fmi3GetNominalsOfContinuousStates,
    fmi3GetNumberOfEventIndicators,
    fmi3GetNumberOfContinuousStates,
    fmi3EnterStepMode,
    fmi3GetOutputDerivatives,
    fmi3ActivateModelPartition,
);

/// Only co-simulation can be instantiated.
#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateModelExchange() -> *mut c_void {
    ptr::null_mut()
}

/// Only co-simulation can be instantiated.
#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateScheduledExecution() -> *mut c_void {
    ptr::null_mut()
}
