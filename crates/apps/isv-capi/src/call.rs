//! The border: what every call does first and last.

use crate::status::*;
use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A call that failed.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) status: isv_status,
    pub(crate) message: String,
}

/// Result of a step of a call.
pub(crate) type Outcome<T = ()> = Result<T, Failure>;

impl Failure {
    pub(crate) fn new(status: isv_status, message: impl Display) -> Self {
        Self { status, message: message.to_string() }
    }

    /// An argument that cannot be.
    pub(crate) fn argument(message: impl Display) -> Self {
        Self::new(ISV_ERROR_ARGUMENT, message)
    }
}

impl From<isv::Error> for Failure {
    fn from(error: isv::Error) -> Self {
        use isv::ErrorKind;
        let status = match error.kind() {
            ErrorKind::Options => ISV_ERROR_OPTIONS,
            ErrorKind::Input => ISV_ERROR_INPUT,
            ErrorKind::Frame => ISV_ERROR_FRAME,
            ErrorKind::Stream => ISV_ERROR_STREAM,
            ErrorKind::Memory => ISV_ERROR_MEMORY,
            ErrorKind::Device => ISV_ERROR_DEVICE,
            ErrorKind::Output => ISV_ERROR_OUTPUT,
            ErrorKind::Cancelled => ISV_ERROR_CANCELLED,
            _ => ISV_ERROR_INTERNAL,
        };
        Self::new(status, error)
    }
}

thread_local! {
    /// Words for the last error of this thread.
    static MESSAGE: RefCell<CString> = RefCell::default();
}

/// Runs the body of a call: a failure becomes its status and the thread's message, a panic `ISV_ERROR_INTERNAL`.
pub(crate) fn call(body: impl FnOnce() -> Outcome<isv_status>) -> isv_status {
    // Objects that a panic may have left half done are behind locks, which are poisoned then.
    let outcome =
        catch_unwind(AssertUnwindSafe(body)).unwrap_or_else(|panic| Err(Failure::from_panic(&*panic)));
    outcome.unwrap_or_else(|Failure { status, message }| {
        keep_message(&message);
        status
    })
}

/// Runs the body of a call that has no other success than `ISV_OK`.
pub(crate) fn call_ok(body: impl FnOnce() -> Outcome) -> isv_status {
    call(|| body().map(|()| ISV_OK))
}

impl Failure {
    fn from_panic(panic: &(dyn Any + Send)) -> Self {
        let text = panic
            .downcast_ref::<&str>()
            .copied()
            .or_else(|| panic.downcast_ref::<String>().map(|text| &**text));
        Self::new(ISV_ERROR_INTERNAL, format!("a fault of isv: {}", text.unwrap_or("no words for it")))
    }
}

fn keep_message(message: &str) {
    let message = CString::new(message.replace('\0', " ")).unwrap_or_default();
    // While a thread ends its message may be gone already: then nobody can ask for it.
    let _ = MESSAGE.try_with(|kept| *kept.borrow_mut() = message);
}

pub(crate) fn last_message() -> *const c_char {
    MESSAGE.try_with(|kept| kept.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::CStr;

    #[test]
    fn a_panic_becomes_an_error_with_its_words() {
        assert_eq!(call_ok(|| panic!("on \0 purpose")), ISV_ERROR_INTERNAL);
        // SAFETY: the message is this thread's, and no call comes between.
        let message = unsafe { CStr::from_ptr(isv_error_message()) };
        assert_eq!(message.to_str().unwrap(), "a fault of isv: on   purpose");
        let other = std::thread::spawn(|| {
            // SAFETY: the message is this thread's, and no call comes between.
            unsafe { CStr::from_ptr(isv_error_message()) }.is_empty()
        });
        assert!(other.join().unwrap(), "each thread has its own message");
    }
}
