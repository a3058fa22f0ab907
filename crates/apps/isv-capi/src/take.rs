//! Whole takes, and the threads of the process.

use crate::call::{Failure, call_ok};
use crate::decode_options::{isv_decode_options, job_options_of};
use crate::encode_options::{Settings, isv_encode_options, options_of};
use crate::memory::{path, place, stated_size, write};
use crate::status::{ISV_ERROR_HANDLE, ISV_ERROR_INTERNAL, ISV_ERROR_STATE, isv_status};
use crate::types::{isv_decode_report, isv_report};
use crate::writer::write_report;
use isv::raw::take::{Input, stream::StreamInfo};
use isv::take;
use std::collections::BTreeMap;
use std::ffi::{CString, c_char};
use std::sync::{Mutex, PoisonError};

/// Texts that were given out, by their addresses.
static TEXTS: Mutex<BTreeMap<usize, CString>> = Mutex::new(BTreeMap::new());

/// Encodes a capture into a stream.
///
/// `input` is a folder of frames, a pattern such as `take_*.obj`, one file, or an `.isv` file. `output` is the stream's path. Both are
/// UTF-8. `options` and `report` may be null. The output has its name once it is whole, and a file that is there is replaced then.
///
/// A job that the progress callback stops returns `ISV_OK` and a shorter stream, or `ISV_ERROR_CANCELLED` and none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_encode_take(
    input: *const c_char,
    output: *const c_char,
    options: *const isv_encode_options,
    report: *mut isv_report,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for text.
        let (input, output) = unsafe { (path("input", input)?, path("output", output)?) };
        if !report.is_null() {
            // SAFETY: isv.h asks for a struct.
            unsafe { stated_size(report) }?;
        }
        let done = take::encode(input, output, &options_of(options, Settings::build_job)?)?;
        // SAFETY: isv.h asks for a struct.
        unsafe { write_report(report, &done) }
    })
}

/// Decodes a stream to files.
///
/// `input` is the stream's path. `output` is a folder, which gets `frame_0000.ply` and so on, a file of one frame, or a `.glb`, `.usdc`
/// or `.usda` file of all. Both are UTF-8. `options` and `report` may be null. Files that isv did not write are not replaced.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_decode_take(
    input: *const c_char,
    output: *const c_char,
    options: *const isv_decode_options,
    report: *mut isv_decode_report,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for text.
        let (input, output) = unsafe { (path("input", input)?, path("output", output)?) };
        if !report.is_null() {
            // SAFETY: isv.h asks for a struct.
            unsafe { stated_size(report) }?;
        }
        let done = take::decode(input, output, &job_options_of(options)?)?;
        if report.is_null() {
            return Ok(());
        }
        let value = isv_decode_report {
            struct_size: 0,
            frames: done.frames as u64,
            simplify_error_m: done.simplify_error_m,
            is_cancelled: i32::from(done.is_cancelled),
        };
        // SAFETY: isv.h asks for a struct.
        unsafe { write(report, &value) }
    })
}

/// Describes a stream in a file, frame by frame, as JSON: what `isv info --json` prints. `path` is UTF-8.
///
/// Free the text with `isv_text_free`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_info_json(path: *const c_char, json: *mut *const c_char) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for a place for a pointer, and for text.
        let (place, path) =
            unsafe { (place("json", json)?.write(std::ptr::null()), self::path("path", path)?) };
        let info = StreamInfo::read(&Input::from(path)).map_err(isv::Error::from)?;
        let text =
            serde_json::to_string_pretty(&info).map_err(|error| Failure::new(ISV_ERROR_INTERNAL, error))?;
        let text = CString::new(text).map_err(|error| Failure::new(ISV_ERROR_INTERNAL, error))?;
        let address = text.as_ptr();
        TEXTS.lock().unwrap_or_else(PoisonError::into_inner).insert(address.addr(), text);
        *place = address;
        Ok(())
    })
}

/// Frees a text of `isv_info_json`. Null is no error.
#[unsafe(no_mangle)]
pub extern "C" fn isv_text_free(text: *const c_char) -> isv_status {
    call_ok(|| {
        if text.is_null() {
            return Ok(());
        }
        let freed = TEXTS.lock().unwrap_or_else(PoisonError::into_inner).remove(&text.addr());
        let foreign = || {
            Failure::new(
                ISV_ERROR_HANDLE,
                format!("{text:?} is no text of this library, or was freed before"),
            )
        };
        freed.map(drop).ok_or_else(foreign)
    })
}

/// Sets the number of threads that share the arithmetic of all handles, from 1 to 1024 [default: one a processor, or what the
/// environment variable `RAYON_NUM_THREADS` says].
///
/// It must come before the first frame is coded: the threads start then, and stay until the process ends. Later it is
/// `ISV_ERROR_STATE`.
#[unsafe(no_mangle)]
pub extern "C" fn isv_set_thread_count(threads: u32) -> isv_status {
    call_ok(|| {
        if !(1..=1024).contains(&threads) {
            return Err(Failure::argument(format!("{threads} threads: there are 1 to 1024")));
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads as usize);
        pool.build_global().map_err(|error| Failure::new(ISV_ERROR_STATE, format!("threads: {error}")))
    })
}
