//! From pointers to references, and from results to states of a call.

#![expect(unsafe_code, reason = "the interface of FMI is C")]

use std::ffi::{c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::component::{Component, ERROR, FATAL, OK, RefusedCall, null};

/// Does `work` with the instance behind `pointer`, and reports a refusal to the importer's
/// log. A panic, which would be a mistake in this program, makes the call fatal.
///
/// # Safety
/// `pointer` is null, or comes from the instantiation, is not freed, and no other thread uses
/// it during this call.
pub(crate) unsafe fn with(
    pointer: *mut c_void,
    work: impl FnOnce(&mut Component) -> Result<(), RefusedCall>,
) -> c_int {
    // SAFETY: by the contract above it points to a component that nothing else refers to.
    let Some(component) = (unsafe { pointer.cast::<Component>().as_mut() }) else { return ERROR };
    match catch_unwind(AssertUnwindSafe(|| work(&mut *component))) {
        Ok(Ok(())) => OK,
        Ok(Err(RefusedCall(reason))) => {
            component.log.error(&reason);
            ERROR
        }
        Err(_) => FATAL,
    }
}

/// Writes `value` to `to`.
///
/// # Safety
/// `to` is null or may be written to.
pub(crate) unsafe fn put<T>(to: *mut T, name: &str, value: T) -> Result<(), RefusedCall> {
    if to.is_null() {
        return Err(null(name));
    }
    // SAFETY: by the contract above.
    unsafe { to.write(value) };
    Ok(())
}

/// Returns the `n` elements from `start` on; none if `n` is 0, whatever `start` is.
///
/// # Safety
/// `start` is null, or that many elements can be read during `'a`.
pub(crate) unsafe fn slice<'a, T>(
    start: *const T,
    n: usize,
    name: &str,
) -> Result<&'a [T], RefusedCall> {
    if n == 0 {
        return Ok(&[]);
    }
    if start.is_null() {
        return Err(null(name));
    }
    // SAFETY: by the contract above.
    Ok(unsafe { std::slice::from_raw_parts(start, n) })
}
