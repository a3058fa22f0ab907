//! Options of decoding to files.

use crate::call::{Failure, Outcome, call_ok};
use crate::callback::{User, event_handler, isv_event_fn, isv_progress_fn, progress_handler};
use crate::encode_options::{device_from, frame_range, isv_device, no_such, origin_from, parsed, up_from};
use crate::handle::{self, Handle, lock};
use crate::memory::{place, text};
use crate::status::{ISV_ERROR_OPTIONS, isv_status};
use isv::{AfterLoss, Cancellation, DecodeOptions, Length, Lod};
use std::collections::BTreeMap;
use std::ffi::{c_char, c_void};
use std::sync::{Arc, Mutex};

/// Options of `isv_decode_take`. Each begins with its default, and a call that fails leaves it as it was.
pub struct isv_decode_options;

/// Reaction to damaged or missing packets: `ISV_AFTER_LOSS_STOP` or `ISV_AFTER_LOSS_HOLD`.
pub type isv_after_loss = i32;
/// End with an error. The default.
pub const ISV_AFTER_LOSS_STOP: isv_after_loss = 0;
/// Hold the last frame in place of each lost one, and go on where that can be.
pub const ISV_AFTER_LOSS_HOLD: isv_after_loss = 1;

type Edit = Box<dyn Fn(DecodeOptions) -> DecodeOptions + Send + Sync>;
type Progress = Arc<dyn Fn(usize, Option<usize>) -> bool + Send + Sync>;

/// Object behind a handle of options.
#[derive(Default)]
pub(crate) struct Settings {
    /// Changes, by the name of the option.
    edits: BTreeMap<&'static str, Edit>,
    progress: Option<Progress>,
}

impl Handle for isv_decode_options {
    type Object = Mutex<Settings>;
    const NAME: &'static str = "isv_decode_options";
}

impl Settings {
    fn build_job(&self) -> DecodeOptions {
        let options = self.edits.values().fold(DecodeOptions::new(), |options, edit| edit(options));
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
pub(crate) fn job_options_of(options: *const isv_decode_options) -> Outcome<DecodeOptions> {
    if options.is_null() {
        return Ok(DecodeOptions::new());
    }
    let settings = handle::get(options)?;
    let settings = lock(&settings)?;
    Ok(settings.build_job())
}

/// Sets an option, if the library takes it. Whether all go together shows when a job begins.
fn set(
    options: *mut isv_decode_options,
    name: &'static str,
    edit: impl Fn(DecodeOptions) -> DecodeOptions + Send + Sync + 'static,
) -> Outcome {
    let settings = handle::get(options)?;
    // Any name of a folder will do.
    edit(DecodeOptions::new()).check("frames")?;
    lock(&settings)?.edits.insert(name, Box::new(edit));
    Ok(())
}

fn length(name: &str, metres: f64) -> Outcome<Length> {
    match metres.is_finite() && metres > 0.0 {
        true => Ok(Length::from_metres(metres)),
        false => Err(Failure::new(ISV_ERROR_OPTIONS, format!("{name} is {metres} m: a length is above 0"))),
    }
}

pub(crate) fn after_loss_from(after_loss: isv_after_loss) -> Outcome<AfterLoss> {
    match after_loss {
        ISV_AFTER_LOSS_STOP => Ok(AfterLoss::Stop),
        ISV_AFTER_LOSS_HOLD => Ok(AfterLoss::Hold),
        other => Err(no_such("isv_after_loss", other)),
    }
}

pub(crate) fn lod_from(divisor: u32) -> Outcome<Lod> {
    match divisor {
        1 => Ok(Lod::Full),
        2 => Ok(Lod::Half),
        4 => Ok(Lod::Quarter),
        other => Err(Failure::new(
            ISV_ERROR_OPTIONS,
            format!("{other} is no level of detail: these are 1, 2 and 4"),
        )),
    }
}

/// Creates options with all defaults. Free them with `isv_decode_options_free`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_decode_options_new(options: *mut *mut isv_decode_options) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for a place for a handle.
        unsafe { place("options", options) }?.write(handle::add(Mutex::default()));
        Ok(())
    })
}

/// Frees options. Null is no error.
#[unsafe(no_mangle)]
pub extern "C" fn isv_decode_options_free(options: *mut isv_decode_options) -> isv_status {
    call_ok(|| handle::free(options))
}

/// Writes fields of signed distances (1) or meshes (0, the default), and no points.
#[unsafe(no_mangle)]
pub extern "C" fn isv_decode_options_set_fields(
    options: *mut isv_decode_options,
    are_wanted: i32,
) -> isv_status {
    call_ok(|| {
        let edit = move |options: DecodeOptions| if are_wanted != 0 { options.fields() } else { options };
        set(options, "form", edit)
    })
}

/// Writes points in place of meshes, so many a frame, at least 1.
#[unsafe(no_mangle)]
pub extern "C" fn isv_decode_options_set_point_count(
    options: *mut isv_decode_options,
    points: usize,
) -> isv_status {
    call_ok(|| set(options, "form", move |options| options.point_count(points)))
}

/// Writes points in place of meshes, each for a square of the surface with this edge (m).
#[unsafe(no_mangle)]
pub extern "C" fn isv_decode_options_set_point_spacing(
    options: *mut isv_decode_options,
    spacing_m: f64,
) -> isv_status {
    call_ok(|| {
        let spacing = length("the spacing of points", spacing_m)?;
        set(options, "form", move |options| options.points(spacing))
    })
}

/// Sets the format of the files of a folder. Meshes have "ply", "obj", "stl", "glb", "usda" or "usdc", points "ply", "pcd" or
/// "xyz", fields "npy" or "vdb".
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_decode_options_set_format(
    options: *mut isv_decode_options,
    extension: *const c_char,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for text.
        let extension = unsafe { text("extension", extension) }?.to_owned();
        set(options, "format", move |options| options.format(&extension))
    })
}

/// Writes vertex normals of meshes (1) or not (0) [default: in GLB and USD files alone].
#[unsafe(no_mangle)]
pub extern "C" fn isv_decode_options_set_normals(
    options: *mut isv_decode_options,
    are_wanted: i32,
) -> isv_status {
    call_ok(|| set(options, "normals", move |options| options.normals(are_wanted != 0)))
}

/// Sets the most faces of each mesh, at least 1.
#[unsafe(no_mangle)]
pub extern "C" fn isv_decode_options_set_target_faces(
    options: *mut isv_decode_options,
    faces: usize,
) -> isv_status {
    call_ok(|| set(options, "faces", move |options| options.target_faces(faces)))
}

/// Collapses edges as long as the surface stays within this distance (m).
#[unsafe(no_mangle)]
pub extern "C" fn isv_decode_options_set_simplify(
    options: *mut isv_decode_options,
    distance_m: f64,
) -> isv_status {
    call_ok(|| {
        let distance = length("the distance", distance_m)?;
        set(options, "simplify", move |options| options.simplify(distance))
    })
}

/// Sets the unit of the output: "m", "dm", "cm", "mm", "in", "ft" or "us-ft" [default: "m"].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_decode_options_set_unit(
    options: *mut isv_decode_options,
    unit: *const c_char,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for text.
        let unit: isv::Unit = unsafe { parsed("unit", unit) }?;
        set(options, "unit", move |options| options.units(unit))
    })
}

/// Sets the axis of the output that points up: "x", "y", "z", "-x", "-y" or "-z" [default: "y"].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_decode_options_set_up(
    options: *mut isv_decode_options,
    axis: *const c_char,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for text.
        let up = unsafe { up_from(axis) }?;
        set(options, "up", move |options| options.up(up))
    })
}

/// Sets the place of the stream's origin in the output, x, y and z in its unit. `place_xyz` has 3 numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_decode_options_set_origin(
    options: *mut isv_decode_options,
    place_xyz: *const f64,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for 3 numbers.
        let origin = unsafe { origin_from(place_xyz) }?;
        set(options, "origin", move |options| options.origin(origin))
    })
}

/// Decodes the frames from `first` up to and without `end`, counted from 0.
#[unsafe(no_mangle)]
pub extern "C" fn isv_decode_options_set_frames(
    options: *mut isv_decode_options,
    first: u64,
    end: u64,
) -> isv_status {
    call_ok(|| {
        let range = frame_range(first, end);
        set(options, "frames", move |options| options.frames(range.clone()))
    })
}

/// Sets the level of detail: 1 for all voxels, 2 for half and 4 for a quarter of the resolution [default: 1].
#[unsafe(no_mangle)]
pub extern "C" fn isv_decode_options_set_lod(options: *mut isv_decode_options, divisor: u32) -> isv_status {
    call_ok(|| {
        let lod = lod_from(divisor)?;
        set(options, "lod", move |options| options.lod(lod))
    })
}

/// Sets the reaction to damaged or missing packets [default: `ISV_AFTER_LOSS_STOP`].
#[unsafe(no_mangle)]
pub extern "C" fn isv_decode_options_set_after_loss(
    options: *mut isv_decode_options,
    after_loss: isv_after_loss,
) -> isv_status {
    call_ok(|| {
        let after_loss = after_loss_from(after_loss)?;
        set(options, "after loss", move |options| options.after_loss(after_loss))
    })
}

/// Sets the device that does the arithmetic [default: `ISV_DEVICE_CPU`].
#[unsafe(no_mangle)]
pub extern "C" fn isv_decode_options_set_device(
    options: *mut isv_decode_options,
    device: isv_device,
) -> isv_status {
    call_ok(|| {
        let device = device_from(device)?;
        set(options, "device", move |options| options.device(device))
    })
}

/// Limits the memory for a frame (bytes). Frames that need more are an error.
#[unsafe(no_mangle)]
pub extern "C" fn isv_decode_options_set_memory_limit(
    options: *mut isv_decode_options,
    bytes: u64,
) -> isv_status {
    call_ok(|| set(options, "memory", move |options| options.memory_limit(bytes)))
}

/// Sets the callback that takes warnings; null for none. `user` comes back to it as it is.
#[unsafe(no_mangle)]
pub extern "C" fn isv_decode_options_set_event_callback(
    options: *mut isv_decode_options,
    callback: isv_event_fn,
    user: *mut c_void,
) -> isv_status {
    call_ok(|| {
        let handler = callback.map(|callback| event_handler(callback, User(user)));
        let edit = move |options: DecodeOptions| match handler.clone() {
            Some(handler) => options.on_event(handler),
            None => options,
        };
        set(options, "events", edit)
    })
}

/// Sets the callback that follows a job and may stop it; null for none. `user` comes back to it as it is.
#[unsafe(no_mangle)]
pub extern "C" fn isv_decode_options_set_progress_callback(
    options: *mut isv_decode_options,
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
