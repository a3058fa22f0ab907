//! Results of calls, and their words.

use crate::call::last_message;
use std::ffi::c_char;

/// Result of a call: `ISV_OK`, `ISV_END`, or an error below 0.
pub type isv_status = i32;

/// Success.
pub const ISV_OK: isv_status = 0;
/// Success, and nothing follows: all frames were read.
pub const ISV_END: isv_status = 1;
/// An argument that cannot be: a null pointer, a wrong size, text that is not UTF-8.
pub const ISV_ERROR_ARGUMENT: isv_status = -1;
/// A handle that is null, was freed, is of another type, or did not come from this library.
pub const ISV_ERROR_HANDLE: isv_status = -2;
/// A handle that serves another call at this moment, perhaps the one whose callback this is.
pub const ISV_ERROR_BUSY: isv_status = -3;
/// A call that comes too late: the writer is finished, or failed before.
pub const ISV_ERROR_STATE: isv_status = -4;
/// An option, or a combination of options, that cannot be.
pub const ISV_ERROR_OPTIONS: isv_status = -5;
/// An input that cannot be read, or that holds no frames.
pub const ISV_ERROR_INPUT: isv_status = -6;
/// One frame that cannot be read or used. Others may be sound.
pub const ISV_ERROR_FRAME: isv_status = -7;
/// A stream that is damaged, cut, or of a newer version.
pub const ISV_ERROR_STREAM: isv_status = -8;
/// More memory than is allowed.
pub const ISV_ERROR_MEMORY: isv_status = -9;
/// A GPU that is not there, or that failed.
pub const ISV_ERROR_DEVICE: isv_status = -10;
/// An output that cannot be written.
pub const ISV_ERROR_OUTPUT: isv_status = -11;
/// A job that was cancelled before it had a result.
pub const ISV_ERROR_CANCELLED: isv_status = -12;
/// A fault of this library. Free the handles of the call.
pub const ISV_ERROR_INTERNAL: isv_status = -13;

/// Returns the words for the last error of the calling thread: one sentence in UTF-8, empty if there was none.
///
/// The library owns the text. It is good until the next call of this thread that returns an error.
#[unsafe(no_mangle)]
pub extern "C" fn isv_error_message() -> *const c_char {
    last_message()
}

/// Returns the name of a result, such as "ISV_ERROR_FRAME", or "unknown". The library owns the text, for good.
#[unsafe(no_mangle)]
pub extern "C" fn isv_status_name(status: isv_status) -> *const c_char {
    let name = match status {
        ISV_OK => c"ISV_OK",
        ISV_END => c"ISV_END",
        ISV_ERROR_ARGUMENT => c"ISV_ERROR_ARGUMENT",
        ISV_ERROR_HANDLE => c"ISV_ERROR_HANDLE",
        ISV_ERROR_BUSY => c"ISV_ERROR_BUSY",
        ISV_ERROR_STATE => c"ISV_ERROR_STATE",
        ISV_ERROR_OPTIONS => c"ISV_ERROR_OPTIONS",
        ISV_ERROR_INPUT => c"ISV_ERROR_INPUT",
        ISV_ERROR_FRAME => c"ISV_ERROR_FRAME",
        ISV_ERROR_STREAM => c"ISV_ERROR_STREAM",
        ISV_ERROR_MEMORY => c"ISV_ERROR_MEMORY",
        ISV_ERROR_DEVICE => c"ISV_ERROR_DEVICE",
        ISV_ERROR_OUTPUT => c"ISV_ERROR_OUTPUT",
        ISV_ERROR_CANCELLED => c"ISV_ERROR_CANCELLED",
        ISV_ERROR_INTERNAL => c"ISV_ERROR_INTERNAL",
        _ => c"unknown",
    };
    name.as_ptr()
}
