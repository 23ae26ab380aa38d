//! The life of an instance: instantiation, initialization, values, steps, end.

#![expect(unsafe_code, reason = "the interface of FMI is C")]

use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::Path;
use std::ptr;

use offbd_fmu_model::{Instance, StartValues, instantiation_token};

use crate::call::{put, slice, with};
use crate::component::{Component, ImporterLog, LogMessage, OK, RefusedCall, null};

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
    let log = ImporterLog { environment, message };
    // SAFETY: both are strings of the importer, which live during this call.
    let texts = unsafe { (text(token, "the token"), text(resources, "the path of the resources")) };
    match instance(texts) {
        Ok(instance) => Box::into_raw(Box::new(Component { instance, log })).cast(),
        Err(RefusedCall(reason)) => {
            log.error(&reason);
            ptr::null_mut()
        }
    }
}

type Text<'a> = Result<&'a str, RefusedCall>;

/// Reads the start values below the path of the resources.
fn instance((token, resources): (Text<'_>, Text<'_>)) -> Result<Instance, RefusedCall> {
    let (token, own) = (token?, instantiation_token());
    if token != own {
        let reason = format!("the model description has the token {token}, the library {own}");
        return Err(RefusedCall(reason));
    }
    let path = Path::new(resources?).join(StartValues::FILE);
    let unusable = |why: &dyn std::fmt::Display| RefusedCall(format!("{}: {why}", path.display()));
    let file = std::fs::read_to_string(&path).map_err(|error| unusable(&error))?;
    let start = StartValues::parse(&file).map_err(|error| unusable(&error))?;
    Ok(Instance::new(&start))
}

/// # Safety
/// `start` is null, or a string that ends with a zero byte and lives during `'a`.
unsafe fn text<'a>(start: *const c_char, name: &str) -> Text<'a> {
    if start.is_null() {
        return Err(null(name));
    }
    // SAFETY: by the contract above.
    let text = unsafe { CStr::from_ptr(start) };
    text.to_str().map_err(|_| RefusedCall(format!("{name} is not UTF-8")))
}

/// # Safety
/// As for [`with`]; the instance is not used any more.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3FreeInstance(instance: *mut c_void) {
    if !instance.is_null() {
        // SAFETY: it comes from `Box::into_raw` and is given up here.
        drop(unsafe { Box::from_raw(instance.cast::<Component>()) });
    }
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
    // SAFETY: the caller's contract is that of `with`.
    unsafe { with(instance, |c| Ok(c.instance.enter_initialization(start_s)?)) }
}

/// # Safety
/// As for [`with`].
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3ExitInitializationMode(instance: *mut c_void) -> c_int {
    // SAFETY: the caller's contract is that of `with`.
    unsafe { with(instance, |c| Ok(c.instance.exit_initialization()?)) }
}

/// # Safety
/// As for [`with`].
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3Terminate(instance: *mut c_void) -> c_int {
    // SAFETY: the caller's contract is that of `with`.
    unsafe { with(instance, |c| Ok(c.instance.terminate()?)) }
}

/// # Safety
/// As for [`with`].
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3Reset(instance: *mut c_void) -> c_int {
    // SAFETY: the caller's contract is that of `with`.
    unsafe {
        with(instance, |c| {
            c.instance.reset();
            Ok(())
        })
    }
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
        let references = unsafe { slice(references, n_references, "valueReferences") }?;
        for (i, reference) in references.iter().enumerate() {
            let value = c.instance.get(*reference)?;
            // SAFETY: there are as many values as references.
            unsafe { put(values.wrapping_add(i), "values", value) }?;
        }
        Ok(())
    };
    // SAFETY: the caller's contract is that of `with`.
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
        let references = unsafe { slice(references, n_references, "valueReferences") }?;
        // SAFETY: the caller's contract.
        let values = unsafe { slice(values, n_values, "values") }?;
        for (reference, value) in references.iter().zip(values) {
            c.instance.set(*reference, *value)?;
        }
        Ok(())
    };
    // SAFETY: the caller's contract is that of `with`.
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
    // SAFETY: the caller's contract is that of `with`.
    unsafe { with(instance, step) }
}
