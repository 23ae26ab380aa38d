//! The calls that both versions have: the life of an instance, its values, its saved states.

#![expect(unsafe_code, reason = "the interface of FMI is C")]

use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::Path;
use std::ptr;

use offbd_fmu_model::{Instance, StartValues, instantiation_token};

use crate::call::{put, slice, with};
use crate::component::{Component, ImporterLog, RefusedCall, null};

type Done = Result<(), RefusedCall>;

/// Returns a pointer to a new instance, or null and the reason in the log.
pub(crate) fn instantiate(made: Result<Instance, RefusedCall>, log: ImporterLog) -> *mut c_void {
    match made {
        Ok(instance) => Box::into_raw(Box::new(Component { instance, log })).cast(),
        Err(RefusedCall(reason)) => {
            log.error(&reason);
            ptr::null_mut()
        }
    }
}

/// Returns an instance with the start values of the folder of the resources; `token` is that of
/// the model description.
pub(crate) fn instance(token: &str, resources: &Path) -> Result<Instance, RefusedCall> {
    let own = instantiation_token();
    if token != own {
        let reason = format!("the model description has the token {token}, the library {own}");
        return Err(RefusedCall(reason));
    }
    let path = resources.join(StartValues::FILE);
    let unusable = |why: &dyn std::fmt::Display| RefusedCall(format!("{}: {why}", path.display()));
    let file = std::fs::read_to_string(&path).map_err(|error| unusable(&error))?;
    let start = StartValues::parse(&file).map_err(|error| unusable(&error))?;
    Ok(Instance::new(&start))
}

/// # Safety
/// `start` is null, or a string that ends with a zero byte and lives during `'a`.
pub(crate) unsafe fn text<'a>(start: *const c_char, name: &str) -> Result<&'a str, RefusedCall> {
    if start.is_null() {
        return Err(null(name));
    }
    // SAFETY: by the contract above.
    let text = unsafe { CStr::from_ptr(start) };
    text.to_str().map_err(|_| RefusedCall(format!("{name} is not UTF-8")))
}

/// # Safety
/// `instance` is null, or comes from [`instantiate`] and is not used any more.
unsafe fn free(instance: *mut c_void) {
    if !instance.is_null() {
        // SAFETY: it comes from `Box::into_raw` and is given up here.
        drop(unsafe { Box::from_raw(instance.cast::<Component>()) });
    }
}

/// # Safety
/// As for [`free`].
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeInstance(instance: *mut c_void) {
    // SAFETY: the caller's contract.
    unsafe { free(instance) }
}

/// # Safety
/// As for [`free`].
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3FreeInstance(instance: *mut c_void) {
    // SAFETY: the caller's contract.
    unsafe { free(instance) }
}

/// Defines calls under their names in both versions, where their arguments are the same.
macro_rules! in_both {
    ($($two:ident, $three:ident => $call:ident $arguments:tt;)*) => {$(
        in_both!(@ $two => $call $arguments);
        in_both!(@ $three => $call $arguments);
    )*};
    (@ $name:ident => $call:ident ($($argument:ident: $type:ty),*)) => {
        /// # Safety
        /// As for [`with`], and for the call.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $name(instance: *mut c_void, $($argument: $type),*) -> c_int {
            // SAFETY: the caller's contract.
            unsafe { with(instance, |c| $call(c, $($argument),*)) }
        }
    };
}

in_both! {
    fmi2ExitInitializationMode, fmi3ExitInitializationMode => exit_initialization();
    fmi2Terminate, fmi3Terminate => terminate();
    fmi2Reset, fmi3Reset => reset();
    fmi2GetFMUstate, fmi3GetFMUState => save(state: *mut *mut c_void);
    fmi2SetFMUstate, fmi3SetFMUState => restore(state: *mut c_void);
    fmi2FreeFMUstate, fmi3FreeFMUState => forget(state: *mut *mut c_void);
    fmi2SerializedFMUstateSize, fmi3SerializedFMUStateSize
        => serialized_size(state: *mut c_void, size: *mut usize);
    fmi2SerializeFMUstate, fmi3SerializeFMUState
        => serialize(state: *mut c_void, to: *mut u8, size: usize);
    fmi2DeSerializeFMUstate, fmi3DeserializeFMUState
        => deserialize(from: *const u8, size: usize, state: *mut *mut c_void);
}

fn exit_initialization(c: &mut Component) -> Done {
    Ok(c.instance.exit_initialization()?)
}

fn terminate(c: &mut Component) -> Done {
    Ok(c.instance.terminate()?)
}

#[expect(clippy::unnecessary_wraps, reason = "the same type as the other calls")]
fn reset(c: &mut Component) -> Done {
    c.instance.reset();
    Ok(())
}

/// # Safety
/// There are `n` elements at `references`, and room for as many at `values`.
pub(crate) unsafe fn get(
    c: &mut Component,
    references: *const u32,
    n: usize,
    values: *mut f64,
) -> Done {
    // SAFETY: the caller's contract.
    let references = unsafe { slice(references, n, "the value references") }?;
    for (i, reference) in references.iter().enumerate() {
        let value = c.instance.get(*reference)?;
        // SAFETY: there are as many values as references.
        unsafe { put(values.wrapping_add(i), "values", value) }?;
    }
    Ok(())
}

/// # Safety
/// There are `n` elements at `references` and at `values`.
pub(crate) unsafe fn set(
    c: &mut Component,
    references: *const u32,
    n: usize,
    values: *const f64,
) -> Done {
    // SAFETY: the caller's contract.
    let references = unsafe { slice(references, n, "the value references") }?;
    // SAFETY: the caller's contract.
    let values = unsafe { slice(values, n, "values") }?;
    for (reference, value) in references.iter().zip(values) {
        c.instance.set(*reference, *value)?;
    }
    Ok(())
}

/// # Safety
/// `state` is null, or comes from this library and is not freed.
unsafe fn saved<'a>(state: *mut c_void) -> Result<&'a Instance, RefusedCall> {
    // SAFETY: by the contract above.
    unsafe { state.cast::<Instance>().as_ref() }.ok_or_else(|| null("the state"))
}

/// # Safety
/// `state` is null, or points to null or to a state of this library, which is replaced.
unsafe fn save(c: &mut Component, state: *mut *mut c_void) -> Done {
    // SAFETY: the caller's contract.
    let place = unsafe { state.as_mut() }.ok_or_else(|| null("the state"))?;
    // SAFETY: the caller's contract.
    match unsafe { place.cast::<Instance>().as_mut() } {
        Some(before) => before.clone_from(&c.instance),
        None => *place = Box::into_raw(Box::new(c.instance.clone())).cast(),
    }
    Ok(())
}

/// # Safety
/// As for [`saved`].
unsafe fn restore(c: &mut Component, state: *mut c_void) -> Done {
    // SAFETY: the caller's contract.
    c.instance.clone_from(unsafe { saved(state) }?);
    Ok(())
}

/// # Safety
/// `state` is null, or points to null or to a state of this library, which is not used any more.
#[expect(clippy::unnecessary_wraps, reason = "the same type as the other calls")]
unsafe fn forget(_: &mut Component, state: *mut *mut c_void) -> Done {
    // SAFETY: the caller's contract.
    if let Some(place) = unsafe { state.as_mut() }.filter(|place| !place.is_null()) {
        // SAFETY: the state comes from `Box::into_raw` and is given up here.
        drop(unsafe { Box::from_raw(place.cast::<Instance>()) });
        *place = ptr::null_mut();
    }
    Ok(())
}

/// # Safety
/// As for [`saved`]; `size` is null or can be written to.
unsafe fn serialized_size(_: &mut Component, state: *mut c_void, size: *mut usize) -> Done {
    // SAFETY: the caller's contract.
    unsafe { put(size, "size", saved(state)?.to_bytes()?.len()) }
}

/// # Safety
/// As for [`saved`]; `size` bytes can be written to `to`.
unsafe fn serialize(_: &mut Component, state: *mut c_void, to: *mut u8, size: usize) -> Done {
    // SAFETY: the caller's contract.
    let bytes = unsafe { saved(state) }?.to_bytes()?;
    if bytes.len() != size || to.is_null() {
        let reason = format!("the state has {} bytes, not {size}", bytes.len());
        return Err(RefusedCall(reason));
    }
    // SAFETY: the bytes are as many as there is room for.
    unsafe { ptr::copy_nonoverlapping(bytes.as_ptr(), to, size) };
    Ok(())
}

/// # Safety
/// There are `size` bytes at `from`, and `state` is null or can be written to.
unsafe fn deserialize(
    _: &mut Component,
    from: *const u8,
    size: usize,
    state: *mut *mut c_void,
) -> Done {
    if state.is_null() {
        return Err(null("the state"));
    }
    // SAFETY: the caller's contract.
    let read = Instance::from_bytes(unsafe { slice(from, size, "the serialized state") }?)?;
    // SAFETY: the caller's contract.
    unsafe { put(state, "the state", Box::into_raw(Box::new(read)).cast()) }
}
