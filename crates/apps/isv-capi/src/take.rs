//! Whole takes, and the threads of the process.

use crate::call::{Failure, call_ok};
use crate::decode_options::{isv_decode_options, job_options_of};
use crate::encode_options::{Settings, isv_encode_options, options_of};
use crate::memory::{path, place, slice, stated_size, write};
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

/// Copies frames `first` to `end - 1` of a stream, from a keyframe on. Nothing is coded anew. `end` may be `UINT64_MAX` for all.
///
/// `input` and `output` are paths in UTF-8. An output that is named `.mp4` is an MP4 file. `frames` gets the number of frames, and may be
/// null. The output has its name once it is whole.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_cut(
    input: *const c_char,
    first: u64,
    end: u64,
    output: *const c_char,
    frames: *mut u64,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for text.
        let (input, output) = unsafe { (path("input", input)?, path("output", output)?) };
        let number = |frame: u64| usize::try_from(frame).unwrap_or(usize::MAX);
        let count = take::cut(input, number(first)..number(end), output)?;
        // SAFETY: isv.h asks for a place, or null.
        unsafe { write_count(frames, count) };
        Ok(())
    })
}

/// Puts streams one after the other. Nothing is coded anew. They have the same profile, grid, frame rate, layers of colour and version.
///
/// `inputs` has `input_count` paths, at least one. See `isv_cut` on paths, `output` and `frames`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_join(
    inputs: *const *const c_char,
    input_count: usize,
    output: *const c_char,
    frames: *mut u64,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for an array of texts.
        let inputs = unsafe { slice("inputs", inputs, input_count)? };
        // SAFETY: isv.h asks for text.
        let inputs: Vec<_> =
            inputs.iter().map(|input| unsafe { path("an input", *input) }).collect::<Result<_, _>>()?;
        // SAFETY: isv.h asks for text.
        let output = unsafe { path("output", output)? };
        let count = take::join(&inputs, output)?;
        // SAFETY: isv.h asks for a place, or null.
        unsafe { write_count(frames, count) };
        Ok(())
    })
}

/// Makes a stream of what is sound in a damaged, cut or unfinished one. Packets are kept byte for byte.
///
/// `header_from` is a stream of the same take, whose header stands for a damaged one; it may be null. `frames` gets the number of frames
/// that are kept. See `isv_cut` on paths, `output` and `frames`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_repair(
    input: *const c_char,
    header_from: *const c_char,
    output: *const c_char,
    frames: *mut u64,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for text.
        let (input, output) = unsafe { (path("input", input)?, path("output", output)?) };
        let other = match header_from.is_null() {
            true => None,
            // SAFETY: isv.h asks for text.
            false => Some(unsafe { path("header_from", header_from)? }),
        };
        let repaired = take::repair(input, other.as_deref(), output)?;
        // SAFETY: isv.h asks for a place, or null.
        unsafe { write_count(frames, repaired.kept) };
        Ok(())
    })
}

/// Puts a stream into an MP4 file, with sound beside it. Nothing is coded anew but waveforms, which become Opus.
///
/// `sound` is the path of an MP4, MP3, Ogg, FLAC or WAV file; it may be null. See `isv_cut` on paths, `output` and `frames`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_mux(
    input: *const c_char,
    sound: *const c_char,
    output: *const c_char,
    frames: *mut u64,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for text.
        let (input, output) = unsafe { (path("input", input)?, path("output", output)?) };
        let sound = match sound.is_null() {
            true => None,
            // SAFETY: isv.h asks for text.
            false => Some(unsafe { path("sound", sound)? }),
        };
        let count = take::mux(input, sound.as_deref(), output)?;
        // SAFETY: isv.h asks for a place, or null.
        unsafe { write_count(frames, count) };
        Ok(())
    })
}

/// Takes the stream out of an MP4 file, byte for byte. See `isv_cut` on paths and `output`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_demux(input: *const c_char, output: *const c_char) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for text.
        let (input, output) = unsafe { (path("input", input)?, path("output", output)?) };
        Ok(take::demux(input, output)?)
    })
}

/// Measures a capture or a stream against a reference, frame by frame, as JSON: what `isv eval --json` prints. Both are what
/// `isv_encode_take` takes, in metres and Y up.
///
/// Surfaces are sampled about every `spacing_m` (m). Free the text with `isv_text_free`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_evaluate_json(
    reference: *const c_char,
    test: *const c_char,
    spacing_m: f64,
    json: *mut *const c_char,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for a place for a pointer.
        let place = unsafe { place("json", json)?.write(std::ptr::null()) };
        // SAFETY: isv.h asks for text.
        let (reference, test) = unsafe { (path("reference", reference)?, path("test", test)?) };
        let evaluation = take::evaluate(reference, test, spacing_m)?;
        let text = serde_json::to_string_pretty(&evaluation.figures());
        *place = give_out(text.map_err(|error| Failure::new(ISV_ERROR_INTERNAL, error))?)?;
        Ok(())
    })
}

/// Keeps a text until it is freed, and returns its address.
fn give_out(text: String) -> Result<*const c_char, Failure> {
    let text = CString::new(text).map_err(|error| Failure::new(ISV_ERROR_INTERNAL, error))?;
    let address = text.as_ptr();
    TEXTS.lock().unwrap_or_else(PoisonError::into_inner).insert(address.addr(), text);
    Ok(address)
}

/// Writes a number of frames, if it is wanted.
///
/// # Safety
/// `frames` is null or a place for a number.
unsafe fn write_count(frames: *mut u64, count: usize) {
    if !frames.is_null() {
        // SAFETY: as the caller says.
        unsafe { frames.write(count as u64) };
    }
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
        *place = give_out(text)?;
        Ok(())
    })
}

/// Frees a text of `isv_info_json` or `isv_evaluate_json`. Null is no error.
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

/// Sets the number of threads that share the arithmetic of all handles, from 1 to 1024. The default is one a processor, or what the
/// environment variable `RAYON_NUM_THREADS` says.
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
