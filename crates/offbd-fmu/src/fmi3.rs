//! The functions of FMI 3.0 whose arguments are those of this version only.

#![expect(unsafe_code, reason = "the interface of FMI is C")]

use std::ffi::{c_char, c_int, c_void};
use std::path::Path;

use crate::call::{put, with};
use crate::calls;
use crate::component::{Component, ImporterLog, LogMessage, Logger, OK, RefusedCall};

#[unsafe(no_mangle)]
extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

/// Errors are always logged, and there is nothing else to log.
#[unsafe(no_mangle)]
extern "C" fn fmi3SetDebugLogging(
    _: *mut c_void,
    _: bool,
    _: usize,
    _: *const *const c_char,
) -> c_int {
    OK
}

/// # Safety
/// Strings are null or end with a zero byte; the log can be called until the instance is freed.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3InstantiateCoSimulation(
    _name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: bool,
    _logging: bool,
    _event_mode: bool,
    _early_return: bool,
    _intermediate: *const u32,
    _n_intermediate: usize,
    environment: *mut c_void,
    message: Option<LogMessage>,
    _update: *const c_void,
) -> *mut c_void {
    let made = || {
        // SAFETY: both are strings of the importer, which live during this call.
        let token = unsafe { calls::text(token, "the token") }?;
        // SAFETY: as above.
        let resources = unsafe { calls::text(resources, "the path of the resources") }?;
        calls::instance(token, Path::new(resources))
    };
    calls::instantiate(made(), ImporterLog { environment, logger: message.map(Logger::Message) })
}

/// # Safety
/// As for [`with`].
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3EnterInitializationMode(
    instance: *mut c_void,
    _has_tolerance: bool,
    _tolerance: f64,
    start_s: f64,
    _has_stop: bool,
    _stop_s: f64,
) -> c_int {
    let enter = |c: &mut Component| {
        c.instance.start_at(start_s)?;
        Ok(c.instance.enter_initialization()?)
    };
    // SAFETY: the caller promises what `with` requires.
    unsafe { with(instance, enter) }
}

/// # Safety
/// As for [`with`]; `references` and `values` have as many elements as is said.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetFloat64(
    instance: *mut c_void,
    references: *const u32,
    n_references: usize,
    values: *mut f64,
    n_values: usize,
) -> c_int {
    let get = |c: &mut Component| {
        check_numbers(n_references, n_values)?;
        // SAFETY: the caller's contract.
        unsafe { calls::get(c, references, n_references, values) }
    };
    // SAFETY: the caller promises what `with` requires.
    unsafe { with(instance, get) }
}

/// # Safety
/// As for [`with`]; `references` and `values` have as many elements as is said.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetFloat64(
    instance: *mut c_void,
    references: *const u32,
    n_references: usize,
    values: *const f64,
    n_values: usize,
) -> c_int {
    let set = |c: &mut Component| {
        check_numbers(n_references, n_values)?;
        // SAFETY: the caller's contract.
        unsafe { calls::set(c, references, n_references, values) }
    };
    // SAFETY: the caller promises what `with` requires.
    unsafe { with(instance, set) }
}

fn check_numbers(n_references: usize, n_values: usize) -> Result<(), RefusedCall> {
    if n_references == n_values {
        return Ok(());
    }
    Err(RefusedCall(format!("{n_values} values for {n_references} variables, which are numbers")))
}

/// # Safety
/// As for [`with`]; the pointers to results are null or can be written to.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3DoStep(
    instance: *mut c_void,
    from_s: f64,
    step_s: f64,
    _no_return: bool,
    event: *mut bool,
    terminate: *mut bool,
    early: *mut bool,
    last_s: *mut f64,
) -> c_int {
    let step = |c: &mut Component| {
        c.instance.step(from_s, step_s)?;
        for (to, name) in [
            (event, "eventHandlingNeeded"),
            (terminate, "terminateSimulation"),
            (early, "earlyReturn"),
        ] {
            // SAFETY: the caller's contract.
            unsafe { put(to, name, false) }?;
        }
        // SAFETY: the caller's contract.
        unsafe { put(last_s, "lastSuccessfulTime", from_s + step_s) }
    };
    // SAFETY: the caller promises what `with` requires.
    unsafe { with(instance, step) }
}
