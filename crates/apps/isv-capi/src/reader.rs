//! Streams to frames.

use crate::call::{Failure, Outcome, call, call_ok};
use crate::callback::{CallbackSource, User, event_handler, isv_event_fn};
use crate::decode_options::{after_loss_from, isv_after_loss, lod_from};
use crate::encode_options::{device_from, isv_device};
use crate::frame::{self, isv_frame};
use crate::handle::{self, Handle, lock};
use crate::memory::{path, place, read, slice, write};
use crate::status::*;
use crate::types::{isv_source, isv_stream_info};
use isv::Reader;
use std::ffi::{c_char, c_void};
use std::sync::Mutex;

/// Reads the frames of a stream in order, or from any frame on.
///
/// After an error `ISV_END` follows, until `isv_reader_seek` goes to a frame.
pub struct isv_reader;

/// Object behind a handle of a reader.
pub(crate) struct State {
    /// `None` only while options are set.
    reader: Option<Reader>,
    /// Number of the frame that comes next.
    next: usize,
    can_seek: bool,
    /// Whether frames were asked for.
    has_begun: bool,
    /// Whether the last one was read, or an error came in its place.
    is_over: bool,
}

impl Handle for isv_reader {
    type Object = Mutex<State>;
    const NAME: &'static str = "isv_reader";
}

impl State {
    fn reader(&mut self) -> Outcome<&mut Reader> {
        self.reader
            .as_mut()
            .ok_or_else(|| Failure::new(ISV_ERROR_INTERNAL, "a fault of isv: a reader was lost"))
    }
}

fn add(reader: Reader, can_seek: bool) -> *mut isv_reader {
    handle::add(Mutex::new(State {
        reader: Some(reader),
        next: 0,
        can_seek,
        has_begun: false,
        is_over: false,
    }))
}

/// Opens a stream in a file. `path` is UTF-8. Free the reader with `isv_reader_free`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_reader_open(path: *const c_char, reader: *mut *mut isv_reader) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for a place for a handle, and for text.
        let (place, path) =
            unsafe { (place("reader", reader)?.write(std::ptr::null_mut()), self::path("path", path)?) };
        *place = add(Reader::open(path)?, true);
        Ok(())
    })
}

/// Opens a stream in memory: `size` bytes, which are copied. Free the reader with `isv_reader_free`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_reader_open_memory(
    bytes: *const u8,
    size: usize,
    reader: *mut *mut isv_reader,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for a place for a handle, and for bytes.
        let (place, bytes) =
            unsafe { (place("reader", reader)?.write(std::ptr::null_mut()), slice("bytes", bytes, size)?) };
        *place = add(Reader::from_bytes("the stream in memory", bytes.to_vec())?, true);
        Ok(())
    })
}

/// Opens a stream whose bytes callbacks give. Free the reader with `isv_reader_free`.
///
/// The struct is copied. Callbacks and their pointer must stay good until the reader is freed. Without a seek callback no byte is read
/// before the first frame is.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_reader_open_source(
    source: *const isv_source,
    reader: *mut *mut isv_reader,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for a place for a handle, and for a struct.
        let (place, source) =
            unsafe { (place("reader", reader)?.write(std::ptr::null_mut()), self::read(source)?) };
        let read = source.read.ok_or_else(|| Failure::argument("isv_source.read is null"))?;
        let bytes = CallbackSource { read, seek: source.seek, user: User(source.user) };
        const NAME: &str = "the stream of the callbacks";
        *place = match source.seek {
            Some(_) => add(Reader::from_seekable(NAME, bytes)?, true),
            None => add(Reader::from_read(NAME, bytes), false),
        };
        Ok(())
    })
}

/// Frees a reader. Null is no error. Frames that it gave stay good.
#[unsafe(no_mangle)]
pub extern "C" fn isv_reader_free(reader: *mut isv_reader) -> isv_status {
    call_ok(|| handle::free(reader))
}

/// Tells facts of a stream. `info` is the caller's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_reader_info(reader: *mut isv_reader, info: *mut isv_stream_info) -> isv_status {
    call_ok(|| {
        let state = handle::get(reader)?;
        let mut state = lock(&state)?;
        let can_seek = i32::from(state.can_seek);
        let reader = state.reader()?;
        let value = isv_stream_info {
            struct_size: 0,
            frame_count: reader.frames().and_then(|frames| i64::try_from(frames).ok()).unwrap_or(-1),
            fps: reader.fps().unwrap_or(0.0),
            voxel_m: reader.voxel_m().unwrap_or(0.0),
            has_colour: i32::from(reader.has_colour().unwrap_or(false)),
            can_seek,
        };
        // SAFETY: isv.h asks for a struct.
        unsafe { write(info, &value) }
    })
}

/// Sets an option of a reader. Where frames were read already, it goes on with the next one.
fn set(reader: *mut isv_reader, edit: impl FnOnce(Reader) -> Reader) -> Outcome {
    let state = handle::get(reader)?;
    let mut state = lock(&state)?;
    if state.has_begun && !state.can_seek {
        let why =
            "frames were read already, and there is no seek callback: set options before the first frame";
        return Err(Failure::new(ISV_ERROR_STATE, why));
    }
    state.reader = state.reader.take().map(edit);
    let (next, is_running) = (state.next, state.has_begun && !state.is_over);
    let reader = state.reader()?;
    // At the end there is no frame to go to, and the end comes again.
    let is_counted = reader.frames().is_none_or(|frames| next < frames);
    match is_running.then(|| reader.seek(next)) {
        // Behind the frames that are counted there may be some that are held in place of lost ones.
        Some(Err(error)) if is_counted => Err(error.into()),
        _ => Ok(()),
    }
}

/// Sets the level of detail: 1 for all voxels, 2 for half and 4 for a quarter of the resolution [default: 1].
///
/// Frames from the next one on have it. Where the source can seek, it may be set between any two frames.
#[unsafe(no_mangle)]
pub extern "C" fn isv_reader_set_lod(reader: *mut isv_reader, divisor: u32) -> isv_status {
    call_ok(|| {
        let lod = lod_from(divisor)?;
        set(reader, |reader| reader.lod(lod))
    })
}

/// Sets the reaction to damaged or missing packets [default: `ISV_AFTER_LOSS_STOP`]. See `isv_reader_set_lod` for when.
#[unsafe(no_mangle)]
pub extern "C" fn isv_reader_set_after_loss(
    reader: *mut isv_reader,
    after_loss: isv_after_loss,
) -> isv_status {
    call_ok(|| {
        let after_loss = after_loss_from(after_loss)?;
        set(reader, |reader| reader.after_loss(after_loss))
    })
}

/// Leaves colour out from the next frame on, which saves the time to decode it. See `isv_reader_set_lod` for when.
#[unsafe(no_mangle)]
pub extern "C" fn isv_reader_leave_out_colour(reader: *mut isv_reader) -> isv_status {
    call_ok(|| set(reader, Reader::without_colour))
}

/// Sets the device that does the arithmetic [default: `ISV_DEVICE_CPU`]. See `isv_reader_set_lod` for when.
#[unsafe(no_mangle)]
pub extern "C" fn isv_reader_set_device(reader: *mut isv_reader, device: isv_device) -> isv_status {
    call_ok(|| {
        let device = device_from(device)?;
        set(reader, |reader| reader.device(device))
    })
}

/// Limits the memory for a frame (bytes). Without a limit a frame has 3 billion voxels at most, and no more than the stream's bytes make
/// likely. See `isv_reader_set_lod` for when.
#[unsafe(no_mangle)]
pub extern "C" fn isv_reader_set_memory_limit(reader: *mut isv_reader, bytes: u64) -> isv_status {
    call_ok(|| set(reader, |reader| reader.memory_limit(bytes)))
}

/// Sets the callback that takes warnings, such as damage that was met. See `isv_reader_set_lod` for when.
///
/// It and `user` must stay good until the reader is freed.
#[unsafe(no_mangle)]
pub extern "C" fn isv_reader_set_event_callback(
    reader: *mut isv_reader,
    callback: isv_event_fn,
    user: *mut c_void,
) -> isv_status {
    call_ok(|| {
        let callback = callback.ok_or_else(|| Failure::argument("callback is null"))?;
        set(reader, |reader| reader.on_event(event_handler(callback, User(user))))
    })
}

/// Goes to a frame, counted from 0: the next one that is read. Frames since the keyframe before it are decoded on the way.
///
/// Frame 0 is the start of any stream, though there may be no frame.
#[unsafe(no_mangle)]
pub extern "C" fn isv_reader_seek(reader: *mut isv_reader, frame: u64) -> isv_status {
    call_ok(|| {
        let state = handle::get(reader)?;
        let mut state = lock(&state)?;
        let frame = usize::try_from(frame).unwrap_or(usize::MAX);
        match frame {
            0 => state.reader()?.rewind()?,
            frame => state.reader()?.seek(frame)?,
        }
        (state.next, state.is_over) = (frame, false);
        Ok(())
    })
}

/// Decodes the next frame. Returns `ISV_END` and a null frame behind the last one. Free the frame with `isv_frame_free`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_reader_next_frame(
    reader: *mut isv_reader,
    frame: *mut *mut isv_frame,
) -> isv_status {
    call(|| {
        // SAFETY: isv.h asks for a place for a handle.
        let place = unsafe { place("frame", frame)? }.write(std::ptr::null_mut());
        let state = handle::get(reader)?;
        let mut state = lock(&state)?;
        state.has_begun = true;
        let next = state.reader()?.next_frame();
        state.is_over = !matches!(next, Ok(Some(_)));
        let Some(frame) = next? else { return Ok(ISV_END) };
        state.next = frame.number() + 1;
        *place = frame::add(frame);
        Ok(ISV_OK)
    })
}
