//! Functions of the caller.

use isv::Event;
use std::ffi::{CString, c_void};
use std::io::{self, Read, Seek, SeekFrom, Write};

/// Takes the next bytes of a stream. Returns 0, or another number for a failure, which ends the stream.
///
/// It is called on the thread that pushes a frame or finishes the writer. `bytes` is the library's, and good during the call.
pub type isv_write_fn = Option<unsafe extern "C" fn(user: *mut c_void, bytes: *const u8, size: usize) -> i32>;

/// Gives the next bytes of a stream, at most `size` of them, into `bytes`. Returns their number, 0 at the end, or a number below 0
/// for a failure.
///
/// It is called on the thread that opens the reader or reads a frame.
pub type isv_read_fn = Option<unsafe extern "C" fn(user: *mut c_void, bytes: *mut u8, size: usize) -> i64>;

/// Goes to a place in the bytes of a stream, in bytes from where `whence` says. `ISV_SEEK_START` is their start, `ISV_SEEK_CURRENT`
/// the present place, and `ISV_SEEK_END` their end. Returns the place from the start, or a number below 0 for a failure.
pub type isv_seek_fn = Option<unsafe extern "C" fn(user: *mut c_void, offset: i64, whence: i32) -> i64>;

/// Places counted from the start.
pub const ISV_SEEK_START: i32 = 0;
/// Places counted from the present one.
pub const ISV_SEEK_CURRENT: i32 = 1;
/// Places counted from the end.
pub const ISV_SEEK_END: i32 = 2;

/// Takes an event: a sentence, and whether it is a warning (1) or not (0). `text` is the library's, and good during the call.
///
/// It may be called from any thread, and from several at once. It must not wait for the call that caused it.
pub type isv_event_fn =
    Option<unsafe extern "C" fn(user: *mut c_void, is_warning: i32, text: *const std::ffi::c_char)>;

/// Takes the number of frames done, and of all frames, 0 if that is not known. Returns 0 to go on, or another number to stop the job.
///
/// It is called after each frame, on the thread that started the job.
pub type isv_progress_fn = Option<unsafe extern "C" fn(user: *mut c_void, done: u64, total: u64) -> i32>;

/// The pointer that a callback gets back.
#[derive(Clone, Copy)]
pub(crate) struct User(pub(crate) *mut c_void);

// SAFETY: the library only hands the pointer back. isv.h says from which threads that may be.
unsafe impl Send for User {}
// SAFETY: as above.
unsafe impl Sync for User {}

impl User {
    /// The pointer. Closures that call this capture all of `self`, which may go to other threads.
    fn pointer(self) -> *mut c_void {
        self.0
    }
}

/// Makes a handler of events of a callback.
pub(crate) fn event_handler(
    callback: unsafe extern "C" fn(*mut c_void, i32, *const std::ffi::c_char),
    user: User,
) -> impl Fn(&Event) + Clone + Send + Sync + 'static {
    move |event| {
        let text = CString::new(event.text.replace('\0', " ")).unwrap_or_default();
        // SAFETY: the caller vouches for the callback and its pointer.
        unsafe { callback(user.pointer(), i32::from(event.is_warning), text.as_ptr()) }
    }
}

/// A handler of progress: returns whether the job is to stop.
pub(crate) fn progress_handler(
    callback: unsafe extern "C" fn(*mut c_void, u64, u64) -> i32,
    user: User,
) -> impl Fn(usize, Option<usize>) -> bool + Clone + Send + Sync + 'static {
    // SAFETY: the caller vouches for the callback and its pointer.
    move |done, total| unsafe { callback(user.pointer(), done as u64, total.unwrap_or(0) as u64) != 0 }
}

/// A sink that is a callback.
pub(crate) struct CallbackSink {
    pub(crate) write: unsafe extern "C" fn(*mut c_void, *const u8, usize) -> i32,
    pub(crate) user: User,
}

impl Write for CallbackSink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if bytes.is_empty() {
            return Ok(0);
        }
        // SAFETY: the caller vouches for the callback and its pointer.
        match unsafe { (self.write)(self.user.pointer(), bytes.as_ptr(), bytes.len()) } {
            0 => Ok(bytes.len()),
            code => Err(io::Error::other(format!("the write callback returned {code}"))),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Bytes from callbacks.
pub(crate) struct CallbackSource {
    pub(crate) read: unsafe extern "C" fn(*mut c_void, *mut u8, usize) -> i64,
    pub(crate) seek: isv_seek_fn,
    pub(crate) user: User,
}

impl Read for CallbackSource {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if bytes.is_empty() {
            return Ok(0);
        }
        // SAFETY: the caller vouches for the callback and its pointer. The buffer is initialised.
        let read = unsafe { (self.read)(self.user.pointer(), bytes.as_mut_ptr(), bytes.len()) };
        match usize::try_from(read) {
            Ok(read) if read <= bytes.len() => Ok(read),
            Ok(read) => {
                let size = bytes.len();
                Err(io::Error::other(format!(
                    "the read callback returned {read}, more than the {size} asked for"
                )))
            }
            Err(_) => Err(io::Error::other(format!("the read callback returned {read}"))),
        }
    }
}

impl Seek for CallbackSource {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let (offset, whence) = match to {
            SeekFrom::Start(at) => (i64::try_from(at).map_err(io::Error::other)?, ISV_SEEK_START),
            SeekFrom::Current(by) => (by, ISV_SEEK_CURRENT),
            SeekFrom::End(by) => (by, ISV_SEEK_END),
        };
        let seek = self.seek.ok_or_else(|| io::Error::other("there is no seek callback"))?;
        // SAFETY: the caller vouches for the callback and its pointer.
        let place = unsafe { seek(self.user.pointer(), offset, whence) };
        u64::try_from(place).map_err(|_| io::Error::other(format!("the seek callback returned {place}")))
    }
}
