//! The functions of FMI 2.0 whose arguments are those of this version only.

#![expect(unsafe_code, reason = "the interface of FMI is C")]

use std::ffi::{CStr, CString, c_char, c_int, c_void};

use offbd_fmu_model::path_of_location;

use crate::call::with;
use crate::calls;
use crate::component::{ImporterLog, LogFormat, Logger, OK, RefusedCall};

/// `fmi2Type`: the FMU is used for co-simulation.
const CO_SIMULATION: c_int = 1;

/// `fmi2CallbackFunctions`.
#[repr(C)]
struct ImporterFunctions {
    logger: Option<LogFormat>,
    _allocate: *const c_void,
    _free: *const c_void,
    _step_finished: *const c_void,
    environment: *mut c_void,
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

/// Errors are always logged, and there is nothing else to log.
#[unsafe(no_mangle)]
extern "C" fn fmi2SetDebugLogging(
    _: *mut c_void,
    _: c_int,
    _: usize,
    _: *const *const c_char,
) -> c_int {
    OK
}

/// # Safety
/// Strings are null or end with a zero byte; `functions` is null, or its logger can be called
/// until the instance is freed.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: c_int,
    token: *const c_char,
    resources: *const c_char,
    functions: *const ImporterFunctions,
    _visible: c_int,
    _logging: c_int,
) -> *mut c_void {
    let made = || {
        if kind != CO_SIMULATION {
            return Err(RefusedCall("the model is for co-simulation only".to_owned()));
        }
        // SAFETY: both are strings of the importer, which live during this call.
        let token = unsafe { calls::text(token, "the GUID") }?;
        // SAFETY: as above.
        let location = unsafe { calls::text(resources, "the location of the resources") }?;
        calls::instance(token, &path_of_location(location)?)
    };
    // SAFETY: the caller's contract.
    calls::instantiate(made(), unsafe { log(name, functions) })
}

/// Returns the logger of the importer.
///
/// # Safety
/// As for [`fmi2Instantiate`].
unsafe fn log(name: *const c_char, functions: *const ImporterFunctions) -> ImporterLog {
    // SAFETY: the caller's contract.
    let Some(functions) = (unsafe { functions.as_ref() }) else {
        return ImporterLog { environment: std::ptr::null_mut(), logger: None };
    };
    let name = if name.is_null() {
        CString::default()
    } else {
        // SAFETY: the caller's contract.
        unsafe { CStr::from_ptr(name) }.to_owned()
    };
    let logger = functions.logger.map(|log| Logger::Format(log, name));
    ImporterLog { environment: functions.environment, logger }
}

/// # Safety
/// As for [`with`].
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetupExperiment(
    instance: *mut c_void,
    _has_tolerance: c_int,
    _tolerance: f64,
    start_s: f64,
    _has_stop: c_int,
    _stop_s: f64,
) -> c_int {
    // SAFETY: the caller's contract is that of `with`.
    unsafe { with(instance, |c| Ok(c.instance.start_at(start_s)?)) }
}

/// # Safety
/// As for [`with`].
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2EnterInitializationMode(instance: *mut c_void) -> c_int {
    // SAFETY: the caller's contract is that of `with`.
    unsafe { with(instance, |c| Ok(c.instance.enter_initialization()?)) }
}

/// # Safety
/// As for [`with`]; `references` and `values` have `n` elements.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetReal(
    instance: *mut c_void,
    references: *const u32,
    n: usize,
    values: *mut f64,
) -> c_int {
    // SAFETY: the caller's contract.
    unsafe { with(instance, |c| calls::get(c, references, n, values)) }
}

/// # Safety
/// As for [`with`]; `references` and `values` have `n` elements.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetReal(
    instance: *mut c_void,
    references: *const u32,
    n: usize,
    values: *const f64,
) -> c_int {
    // SAFETY: the caller's contract.
    unsafe { with(instance, |c| calls::set(c, references, n, values)) }
}

/// # Safety
/// As for [`with`].
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2DoStep(
    instance: *mut c_void,
    from_s: f64,
    step_s: f64,
    _no_return: c_int,
) -> c_int {
    // SAFETY: the caller's contract is that of `with`.
    unsafe { with(instance, |c| Ok(c.instance.step(from_s, step_s)?)) }
}
