//! Saved states: a copy of the instance, or its bytes.

#![expect(unsafe_code, reason = "the interface of FMI is C")]

use std::ffi::{c_int, c_void};

use offbd_fmu_model::Instance;

use crate::call::{put, slice, with};
use crate::component::{RefusedCall, null};

/// # Safety
/// `state` is null, or comes from this library and is not freed.
unsafe fn saved<'a>(state: *mut c_void) -> Result<&'a Instance, RefusedCall> {
    // SAFETY: by the contract above.
    unsafe { state.cast::<Instance>().as_ref() }.ok_or_else(|| null("FMUState"))
}

/// # Safety
/// As for [`with`]; `state` is null, or points to null or to a state of this library.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetFMUState(instance: *mut c_void, state: *mut *mut c_void) -> c_int {
    // SAFETY: the caller's contract. A state that is there already is replaced in its place.
    unsafe {
        with(instance, |c| {
            let place = state.as_mut().ok_or_else(|| null("FMUState"))?;
            match place.cast::<Instance>().as_mut() {
                Some(before) => before.clone_from(&c.instance),
                None => *place = Box::into_raw(Box::new(c.instance.clone())).cast(),
            }
            Ok(())
        })
    }
}

/// # Safety
/// As for [`with`] and [`saved`].
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetFMUState(instance: *mut c_void, state: *mut c_void) -> c_int {
    // SAFETY: the caller's contract.
    unsafe {
        with(instance, |c| {
            c.instance.clone_from(saved(state)?);
            Ok(())
        })
    }
}

/// # Safety
/// As for [`with`]; `state` is null, or points to null or to a state of this library, which is
/// not used any more.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3FreeFMUState(instance: *mut c_void, state: *mut *mut c_void) -> c_int {
    // SAFETY: the caller's contract. The state comes from `Box::into_raw` and is given up here.
    unsafe {
        with(instance, |_| {
            if let Some(place) = state.as_mut().filter(|place| !place.is_null()) {
                drop(Box::from_raw(place.cast::<Instance>()));
                *place = std::ptr::null_mut();
            }
            Ok(())
        })
    }
}

/// # Safety
/// As for [`with`] and [`saved`]; `size` is null or can be written to.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SerializedFMUStateSize(
    instance: *mut c_void,
    state: *mut c_void,
    size: *mut usize,
) -> c_int {
    // SAFETY: the caller's contract.
    unsafe { with(instance, |_| put(size, "size", saved(state)?.to_bytes()?.len())) }
}

/// # Safety
/// As for [`with`] and [`saved`]; `size` bytes can be written to `to`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SerializeFMUState(
    instance: *mut c_void,
    state: *mut c_void,
    to: *mut u8,
    size: usize,
) -> c_int {
    // SAFETY: the caller's contract; the bytes are not more than there is room for.
    unsafe {
        with(instance, |_| {
            let bytes = saved(state)?.to_bytes()?;
            if bytes.len() != size || to.is_null() {
                let reason = format!("the state has {} bytes, not {size}", bytes.len());
                return Err(RefusedCall(reason));
            }
            std::ptr::copy_nonoverlapping(bytes.as_ptr(), to, size);
            Ok(())
        })
    }
}

/// # Safety
/// As for [`with`]; there are `size` bytes at `from`, and `state` is null or can be written to.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3DeserializeFMUState(
    instance: *mut c_void,
    from: *const u8,
    size: usize,
    state: *mut *mut c_void,
) -> c_int {
    // SAFETY: the caller's contract.
    unsafe {
        with(instance, |_| {
            if state.is_null() {
                return Err(null("FMUState"));
            }
            let read = Instance::from_bytes(slice(from, size, "serializedState")?)?;
            put(state, "FMUState", Box::into_raw(Box::new(read)).cast())
        })
    }
}
