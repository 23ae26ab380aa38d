//! What a pointer to an instance points to.

#![expect(unsafe_code, reason = "the interface of FMI is C")]

use std::ffi::{CString, c_char, c_int, c_void};

use offbd_fmu_model::{Instance, Refusal};

/// `fmi2Status` and `fmi3Status`: the call succeeded.
pub(crate) const OK: c_int = 0;
/// `fmi2Status` and `fmi3Status`: the call was refused.
pub(crate) const ERROR: c_int = 3;
/// `fmi2Status` and `fmi3Status`: the instance is of no use any more.
pub(crate) const FATAL: c_int = 4;

/// `fmi2CallbackLogger`: a format, and the values that it asks for.
pub(crate) type LogFormat =
    unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);

/// `fmi3LogMessageCallback`.
pub(crate) type LogMessage = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);

/// The function of the importer that receives the reason of a refusal.
pub(crate) enum Logger {
    /// Of FMI 2.0, with the name of the instance.
    Format(LogFormat, CString),
    /// Of FMI 3.0.
    Message(LogMessage),
}

/// The importer's logger, with the pointer that it wants back.
pub(crate) struct ImporterLog {
    pub environment: *mut c_void,
    pub logger: Option<Logger>,
}

impl ImporterLog {
    /// Tells the importer why a call is refused.
    pub(crate) fn error(&self, reason: &str) {
        let category = c"logStatusError".as_ptr();
        // SAFETY: the importer has passed the function and its environment at the
        // instantiation, to be called until the instance is freed; all strings live until the
        // call ends. A format without a directive asks for no value.
        match &self.logger {
            None => {}
            Some(Logger::Message(log)) => {
                let Ok(text) = CString::new(reason) else { return };
                unsafe { log(self.environment, ERROR, category, text.as_ptr()) }
            }
            Some(Logger::Format(log, name)) => {
                let Ok(text) = CString::new(reason.replace('%', "%%")) else { return };
                unsafe { log(self.environment, name.as_ptr(), ERROR, category, text.as_ptr()) }
            }
        }
    }
}

/// An instance and the logger of its importer.
pub(crate) struct Component {
    pub instance: Instance,
    pub log: ImporterLog,
}

/// A call that was refused, and why.
#[derive(Debug)]
pub(crate) struct RefusedCall(pub String);

impl From<Refusal> for RefusedCall {
    fn from(refusal: Refusal) -> Self {
        Self(refusal.to_string())
    }
}

/// A call with a null pointer where there must be none.
pub(crate) fn null(name: &str) -> RefusedCall {
    RefusedCall(format!("{name} is a null pointer"))
}
