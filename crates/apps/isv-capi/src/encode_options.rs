//! Options of encoding.

use crate::call::{Failure, Outcome, call_ok};
use crate::callback::{User, event_handler, isv_event_fn, isv_progress_fn, progress_handler};
use crate::handle::{self, Handle, lock};
use crate::memory::{place, slice, text};
use crate::status::{ISV_ERROR_OPTIONS, isv_status};
use isv::{
    BitRate, Cancellation, Device, EncodeOptions, Length, MetadataChoice, Preset, Refresh, SignMode,
    TimestampSource,
};
use std::collections::BTreeMap;
use std::ffi::{c_char, c_void};
use std::sync::{Arc, Mutex};

/// Options of encoding. Each begins with its default, and a call that fails leaves it as it was.
///
/// Writers and jobs copy the options when they begin. Later changes do not reach them.
pub struct isv_encode_options;

/// Amount of work for small streams: `ISV_PRESET_REALTIME`, `ISV_PRESET_BALANCED` or `ISV_PRESET_ARCHIVE`.
pub type isv_preset = i32;
/// Least work, for live encoding.
pub const ISV_PRESET_REALTIME: isv_preset = 0;
/// Good for most uses. The default.
pub const ISV_PRESET_BALANCED: isv_preset = 1;
/// Ten times the work of `ISV_PRESET_BALANCED`, for 6 to 11 % fewer bits at equal error.
pub const ISV_PRESET_ARCHIVE: isv_preset = 2;

/// Rule that tells inside from outside of meshes and points: one of the numbers `ISV_SIGN_...`.
pub type isv_sign = i32;
/// `ISV_SIGN_CLOSED` if all parts of the first frame are closed, else `ISV_SIGN_SHEET`. The default.
pub const ISV_SIGN_AUTO: isv_sign = 0;
/// Closed surfaces, by winding number.
pub const ISV_SIGN_CLOSED: isv_sign = 1;
/// Part by part: closed parts have an inside, open parts are single sheets.
pub const ISV_SIGN_SHEET: isv_sign = 2;
/// A thin closed shell around the surface.
pub const ISV_SIGN_SHELL: isv_sign = 3;

/// Recovery of decoders from lost packets: `ISV_REFRESH_KEYFRAMES` or `ISV_REFRESH_GRADUAL`.
pub type isv_refresh = i32;
/// Recovery at keyframes. The default.
pub const ISV_REFRESH_KEYFRAMES: isv_refresh = 0;
/// Recovery bit by bit. Only the first frame is a keyframe.
pub const ISV_REFRESH_GRADUAL: isv_refresh = 1;

/// Source of the frames' times: one of the numbers `ISV_TIMESTAMPS_...`.
pub type isv_timestamps = i32;
/// Times of the capture, or of `isv_writer_push_mesh_at` and the like. Without any, the frame rate. The default.
pub const ISV_TIMESTAMPS_SOURCE: isv_timestamps = 0;
/// One frame after the other at the frame rate.
pub const ISV_TIMESTAMPS_RATE: isv_timestamps = 1;
/// The time at which a frame is pushed, in nanoseconds since 1970, for live streams.
pub const ISV_TIMESTAMPS_CLOCK: isv_timestamps = 2;

/// Whether a stream says what it is: `ISV_METADATA_AUTO`, `ISV_METADATA_ALWAYS` or `ISV_METADATA_NEVER`.
pub type isv_metadata = i32;
/// Metadata where the stream has colour, a title or a capture device. The default.
pub const ISV_METADATA_AUTO: isv_metadata = 0;
/// Metadata in any stream. It then has version 2 of the format.
pub const ISV_METADATA_ALWAYS: isv_metadata = 1;
/// No metadata.
pub const ISV_METADATA_NEVER: isv_metadata = 2;

/// Device that does the arithmetic: `ISV_DEVICE_CPU`, `ISV_DEVICE_GPU` or `ISV_DEVICE_AUTO`.
pub type isv_device = i32;
/// The CPU. The default.
pub const ISV_DEVICE_CPU: isv_device = 0;
/// A GPU, or an error. The library must have been built with its feature `gpu`.
pub const ISV_DEVICE_GPU: isv_device = 1;
/// A GPU if there is one that can, else the CPU.
pub const ISV_DEVICE_AUTO: isv_device = 2;

/// A change of the library's options.
type Edit = Box<dyn Fn(EncodeOptions) -> EncodeOptions + Send + Sync>;

/// Handler of progress: whether to stop.
type Progress = Arc<dyn Fn(usize, Option<usize>) -> bool + Send + Sync>;

/// Object behind a handle of options.
#[derive(Default)]
pub(crate) struct Settings {
    target: EncodeOptions,
    /// Changes, by the name of the option.
    edits: BTreeMap<&'static str, Edit>,
    progress: Option<Progress>,
}

impl Handle for isv_encode_options {
    type Object = Mutex<Settings>;
    const NAME: &'static str = "isv_encode_options";
}

impl Settings {
    /// The options as the library takes them.
    pub(crate) fn build(&self) -> EncodeOptions {
        self.edits.values().fold(self.target.clone(), |options, edit| edit(options))
    }

    /// The options of a job that tells its progress and can be stopped.
    pub(crate) fn build_job(&self) -> EncodeOptions {
        let options = self.build();
        let Some(progress) = self.progress.clone() else { return options };
        let cancellation = Cancellation::new();
        let request = cancellation.clone();
        options.cancellation(&cancellation).on_progress(move |done, total| {
            if progress(done, total) {
                request.cancel();
            }
        })
    }
}

/// Copies the options of a handle; null stands for the defaults.
pub(crate) fn options_of<T>(
    options: *const isv_encode_options,
    build: impl Fn(&Settings) -> T,
) -> Outcome<T> {
    if options.is_null() {
        return Ok(build(&Settings::default()));
    }
    let settings = handle::get(options)?;
    let settings = lock(&settings)?;
    Ok(build(&settings))
}

/// Sets an option, if the library takes it.
fn set(
    options: *mut isv_encode_options,
    name: &'static str,
    edit: impl Fn(EncodeOptions) -> EncodeOptions + Send + Sync + 'static,
) -> Outcome {
    let settings = handle::get(options)?;
    edit(EncodeOptions::new()).check()?;
    lock(&settings)?.edits.insert(name, Box::new(edit));
    Ok(())
}

/// Sets an option that is text. `argument`: name and value of what the caller gave.
///
/// # Safety
/// As for [`text`].
unsafe fn set_text(
    options: *mut isv_encode_options,
    name: &'static str,
    (argument, value): (&'static str, *const c_char),
    edit: fn(EncodeOptions, String) -> EncodeOptions,
) -> Outcome {
    // SAFETY: as the caller says.
    let value = unsafe { text(argument, value) }?.to_owned();
    set(options, name, move |options| edit(options, value.clone()))
}

fn set_target(options: *mut isv_encode_options, target: EncodeOptions) -> Outcome {
    let settings = handle::get(options)?;
    target.check()?;
    lock(&settings)?.target = target;
    Ok(())
}

/// An option that has no such value.
pub(crate) fn no_such(what: &str, value: i32) -> Failure {
    Failure::new(ISV_ERROR_OPTIONS, format!("{value} is no {what}"))
}

pub(crate) fn device_from(device: isv_device) -> Outcome<Device> {
    match device {
        ISV_DEVICE_CPU => Ok(Device::Cpu),
        ISV_DEVICE_GPU => Ok(Device::Gpu),
        ISV_DEVICE_AUTO => Ok(Device::Auto),
        other => Err(no_such("isv_device", other)),
    }
}

/// A name of the caller's that the library parses.
pub(crate) unsafe fn parsed<T: std::str::FromStr<Err: std::fmt::Display>>(
    name: &str,
    pointer: *const c_char,
) -> Outcome<T> {
    // SAFETY: the caller vouches for it.
    let text = unsafe { text(name, pointer) }?;
    text.parse().map_err(|why| Failure::new(ISV_ERROR_OPTIONS, why))
}

/// An axis of the caller's.
pub(crate) unsafe fn up_from(pointer: *const c_char) -> Outcome<isv::Up> {
    // SAFETY: the caller vouches for it.
    let name = unsafe { text("axis", pointer) }?;
    let known = isv::Up::ALL.into_iter().find(|axis| axis.name() == name);
    known.ok_or_else(|| {
        Failure::new(ISV_ERROR_OPTIONS, format!("axis `{name}` is not one of x, y, z, -x, -y, -z"))
    })
}

/// An origin of the caller's.
pub(crate) unsafe fn origin_from(place_xyz: *const f64) -> Outcome<[f64; 3]> {
    // SAFETY: the caller vouches for 3 numbers.
    let place = unsafe { slice("place_xyz", place_xyz, 3) }?;
    Ok([place[0], place[1], place[2]])
}

/// Creates options with all defaults. Free them with `isv_encode_options_free`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_encode_options_new(options: *mut *mut isv_encode_options) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for a place for a handle.
        unsafe { place("options", options) }?.write(handle::add(Mutex::default()));
        Ok(())
    })
}

/// Frees options. Null is no error.
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_free(options: *mut isv_encode_options) -> isv_status {
    call_ok(|| handle::free(options))
}

/// Sets a constant quality from 0 to 100 [default: 50]. It takes the place of a bit rate and of an error.
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_quality(
    options: *mut isv_encode_options,
    quality: f32,
) -> isv_status {
    call_ok(|| set_target(options, EncodeOptions::quality(quality)))
}

/// Sets a bit rate (bits a second) of geometry and colour. It takes the place of a quality and of an error.
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_bitrate(
    options: *mut isv_encode_options,
    bits_per_second: f64,
) -> isv_status {
    call_ok(|| set_target(options, EncodeOptions::bitrate(BitRate::from_bits_per_second(bits_per_second))))
}

/// Sets an RMS surface error (m) that every frame stays below. It takes the place of a quality and of a bit rate.
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_max_error(
    options: *mut isv_encode_options,
    error_m: f64,
) -> isv_status {
    call_ok(|| set_target(options, EncodeOptions::max_error(Length::from_metres(error_m))))
}

/// Sets the quality of colour from 0 to 100 [default: 50, or what a bit rate gives].
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_colour_quality(
    options: *mut isv_encode_options,
    quality: f32,
) -> isv_status {
    call_ok(|| set(options, "colour quality", move |options| options.colour_quality(quality)))
}

/// Keeps colour (1, the default) or leaves it out (0).
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_colour(
    options: *mut isv_encode_options,
    is_kept: i32,
) -> isv_status {
    call_ok(|| {
        set(options, "colour", move |options| if is_kept != 0 { options } else { options.without_colour() })
    })
}

/// Sets the edge of a voxel (m). By default meshes get 0.005, volumes keep theirs, and points and depth images get what their
/// spacing and noise allow.
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_voxel(options: *mut isv_encode_options, edge_m: f64) -> isv_status {
    call_ok(|| set(options, "voxel", move |options| options.voxel(Length::from_metres(edge_m))))
}

/// Chooses the voxel size that serves the target best, by coding samples. For `isv_encode_take` with meshes alone.
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_voxel_by_trial(options: *mut isv_encode_options) -> isv_status {
    call_ok(|| set(options, "voxel", EncodeOptions::voxel_by_trial))
}

/// Sets the frames a second, to a thousandth [default: those of the capture, else 30].
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_fps(options: *mut isv_encode_options, fps: f64) -> isv_status {
    call_ok(|| set(options, "fps", move |options| options.fps(fps)))
}

/// Sets the amount of work for small streams [default: `ISV_PRESET_BALANCED`].
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_preset(
    options: *mut isv_encode_options,
    preset: isv_preset,
) -> isv_status {
    call_ok(|| {
        let preset = match preset {
            ISV_PRESET_REALTIME => Preset::Realtime,
            ISV_PRESET_BALANCED => Preset::Balanced,
            ISV_PRESET_ARCHIVE => Preset::Archive,
            other => return Err(no_such("isv_preset", other)),
        };
        set(options, "preset", move |options| options.preset(preset))
    })
}

/// Sets the most frames from a keyframe to the next, at least 1 [default: 30].
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_keyframe_interval(
    options: *mut isv_encode_options,
    frames: u32,
) -> isv_status {
    call_ok(|| set(options, "keyframe interval", move |options| options.gop(frames)))
}

/// Sets the recovery of decoders from lost packets [default: `ISV_REFRESH_KEYFRAMES`].
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_refresh(
    options: *mut isv_encode_options,
    refresh: isv_refresh,
) -> isv_status {
    call_ok(|| {
        let refresh = match refresh {
            ISV_REFRESH_KEYFRAMES => Refresh::Keyframes,
            ISV_REFRESH_GRADUAL => Refresh::Gradual,
            other => return Err(no_such("isv_refresh", other)),
        };
        set(options, "refresh", move |options| options.refresh(refresh))
    })
}

/// Sets the rule that tells inside from outside of meshes and points [default: `ISV_SIGN_AUTO`].
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_sign(
    options: *mut isv_encode_options,
    sign: isv_sign,
) -> isv_status {
    call_ok(|| {
        let sign = match sign {
            ISV_SIGN_AUTO => SignMode::Auto,
            ISV_SIGN_CLOSED => SignMode::Closed,
            ISV_SIGN_SHEET => SignMode::Sheet,
            ISV_SIGN_SHELL => SignMode::Offset,
            other => return Err(no_such("isv_sign", other)),
        };
        set(options, "sign", move |options| options.sign(sign))
    })
}

/// Estimates the normals of points (1), or takes those that come with them (0, the default).
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_estimated_normals(
    options: *mut isv_encode_options,
    are_estimated: i32,
) -> isv_status {
    call_ok(|| {
        let edit = move |options: EncodeOptions| {
            if are_estimated != 0 { options.estimate_normals() } else { options }
        };
        set(options, "normals", edit)
    })
}

/// Takes a frame of depth images for all that was seen so far (1), or for itself alone (0, the default).
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_accumulated_depth(
    options: *mut isv_encode_options,
    is_accumulated: i32,
) -> isv_status {
    call_ok(|| {
        let edit = move |options: EncodeOptions| {
            if is_accumulated != 0 { options.accumulate_depth() } else { options }
        };
        set(options, "depth", edit)
    })
}

/// Leaves out what depth cameras saw farther away (m).
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_max_depth(
    options: *mut isv_encode_options,
    depth_m: f64,
) -> isv_status {
    call_ok(|| set(options, "max depth", move |options| options.max_depth(Length::from_metres(depth_m))))
}

/// Sets the source of the frames' times [default: `ISV_TIMESTAMPS_SOURCE`].
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_timestamps(
    options: *mut isv_encode_options,
    source: isv_timestamps,
) -> isv_status {
    call_ok(|| {
        let source = match source {
            ISV_TIMESTAMPS_SOURCE => TimestampSource::Source,
            ISV_TIMESTAMPS_RATE => TimestampSource::Rate,
            ISV_TIMESTAMPS_CLOCK => TimestampSource::Clock,
            other => return Err(no_such("isv_timestamps", other)),
        };
        set(options, "timestamps", move |options| options.timestamps(source))
    })
}

/// Puts a hash of each decoded frame into the stream (1), or not (0, the default).
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_checksums(
    options: *mut isv_encode_options,
    are_wanted: i32,
) -> isv_status {
    call_ok(|| set(options, "checksums", move |options| options.checksums(are_wanted != 0)))
}

/// Meets a bit rate by coding the take more than once (1), or once (0, the default). For `isv_encode_take` alone.
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_two_passes(
    options: *mut isv_encode_options,
    are_wanted: i32,
) -> isv_status {
    call_ok(|| {
        let settings = handle::get(options)?;
        let edit = move |options: EncodeOptions| if are_wanted != 0 { options.two_passes() } else { options };
        // Two passes need a bit rate, so they are checked beside any other target when the job begins.
        lock(&settings)?.edits.insert("passes", Box::new(edit));
        Ok(())
    })
}

/// Sets the animation of a glTF file, by name or number from 0 [default: the first that moves anything].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_encode_options_set_animation(
    options: *mut isv_encode_options,
    animation: *const c_char,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for text.
        unsafe { set_text(options, "animation", ("animation", animation), EncodeOptions::animation) }
    })
}

/// Sets the title of the take, for people. `isv_info_json` tells it under "metadata".
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_encode_options_set_title(
    options: *mut isv_encode_options,
    title: *const c_char,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for text.
        unsafe { set_text(options, "title", ("title", title), EncodeOptions::title) }
    })
}

/// Sets the name of the device that captured the take, for people.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_encode_options_set_capture_device(
    options: *mut isv_encode_options,
    device: *const c_char,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for text.
        unsafe { set_text(options, "capture device", ("device", device), EncodeOptions::capture_device) }
    })
}

/// Sets whether the stream says what it is and how it was made [default: `ISV_METADATA_AUTO`].
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_metadata(
    options: *mut isv_encode_options,
    choice: isv_metadata,
) -> isv_status {
    call_ok(|| {
        let choice = match choice {
            ISV_METADATA_AUTO => MetadataChoice::Auto,
            ISV_METADATA_ALWAYS => MetadataChoice::Always,
            ISV_METADATA_NEVER => MetadataChoice::Never,
            other => return Err(no_such("isv_metadata", other)),
        };
        set(options, "metadata", move |options| options.metadata(choice))
    })
}

/// Sets the unit of coordinates in files: "m", "dm", "cm", "mm", "in", "ft" or "us-ft" [default: "m"]. For `isv_encode_take` alone.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_encode_options_set_unit(
    options: *mut isv_encode_options,
    unit: *const c_char,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for text.
        let unit: isv::Unit = unsafe { parsed("unit", unit) }?;
        set(options, "unit", move |options| options.units(unit))
    })
}

/// Sets the axis of files that points up: "x", "y", "z", "-x", "-y" or "-z" [default: "y"]. For `isv_encode_take` alone.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_encode_options_set_up(
    options: *mut isv_encode_options,
    axis: *const c_char,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for text.
        let up = unsafe { up_from(axis) }?;
        set(options, "up", move |options| options.up(up))
    })
}

/// Sets the place of meshes and points, x, y and z in their unit, that becomes the origin. `place_xyz` has 3 numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_encode_options_set_origin(
    options: *mut isv_encode_options,
    place_xyz: *const f64,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for 3 numbers.
        let origin = unsafe { origin_from(place_xyz) }?;
        set(options, "origin", move |options| options.origin(origin))
    })
}

/// Encodes the frames from `first` up to and without `end`, counted from 0. For `isv_encode_take` alone.
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_frames(
    options: *mut isv_encode_options,
    first: u64,
    end: u64,
) -> isv_status {
    call_ok(|| {
        let range = frame_range(first, end);
        set(options, "frames", move |options| options.frames(range.clone()))
    })
}

/// Frames as the library counts them.
pub(crate) fn frame_range(first: u64, end: u64) -> std::ops::Range<usize> {
    let number = |frame: u64| usize::try_from(frame).unwrap_or(usize::MAX);
    number(first)..number(end)
}

/// Leaves out frames that cannot be read or used (1), or stops at them (0, the default). For `isv_encode_take` alone.
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_skip_bad_frames(
    options: *mut isv_encode_options,
    are_skipped: i32,
) -> isv_status {
    call_ok(|| set(options, "bad frames", move |options| options.skip_bad_frames(are_skipped != 0)))
}

/// Sets the device that does the arithmetic [default: `ISV_DEVICE_CPU`]. It is opened when a writer or job begins.
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_device(
    options: *mut isv_encode_options,
    device: isv_device,
) -> isv_status {
    call_ok(|| {
        let device = device_from(device)?;
        set(options, "device", move |options| options.device(device))
    })
}

/// Limits the memory for a frame (bytes) that decoders are known to have. Frames that need more are refused.
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_memory_limit(
    options: *mut isv_encode_options,
    bytes: u64,
) -> isv_status {
    call_ok(|| set(options, "memory", move |options| options.memory_limit(bytes)))
}

/// Sets the callback that takes decisions and warnings; null for none. `user` comes back to it as it is.
///
/// Writers and jobs keep both: they must stay good until these are freed.
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_event_callback(
    options: *mut isv_encode_options,
    callback: isv_event_fn,
    user: *mut c_void,
) -> isv_status {
    call_ok(|| {
        let handler = callback.map(|callback| event_handler(callback, User(user)));
        let edit = move |options: EncodeOptions| match handler.clone() {
            Some(handler) => options.on_event(handler),
            None => options,
        };
        set(options, "events", edit)
    })
}

/// Sets the callback that follows a job and may stop it; null for none. `user` comes back to it as it is. For `isv_encode_take` alone.
#[unsafe(no_mangle)]
pub extern "C" fn isv_encode_options_set_progress_callback(
    options: *mut isv_encode_options,
    callback: isv_progress_fn,
    user: *mut c_void,
) -> isv_status {
    call_ok(|| {
        let settings = handle::get(options)?;
        let progress =
            callback.map(|callback| -> Progress { Arc::new(progress_handler(callback, User(user))) });
        lock(&settings)?.progress = progress;
        Ok(())
    })
}
