//! Frames to streams.

use crate::call::{Failure, Outcome, call_ok};
use crate::callback::{CallbackSink, User, isv_write_fn};
use crate::encode_options::{Settings, isv_encode_options, options_of};
use crate::handle::{self, Handle, lock};
use crate::memory::{optional_slice, path, place, read, slice, stated_size, write};
use crate::status::{ISV_ERROR_STATE, isv_status};
use crate::types::*;
use isv::{Block, ColourView, DepthView, FileSink, Mesh, Points, Report, Volume, VolumeArrays, Writer};
use std::ffi::{c_char, c_void};
use std::sync::Mutex;
use std::time::Duration;

/// Encodes frames one by one, to a file or a callback. All frames of a stream are of one kind.
///
/// After `ISV_ERROR_FRAME` and `ISV_ERROR_ARGUMENT` other frames may follow. After `ISV_ERROR_OUTPUT` and `ISV_ERROR_DEVICE` none may.
pub struct isv_writer;

/// Object behind a handle of a writer.
pub(crate) enum State {
    File(Writer<FileSink>),
    Callback(Writer<CallbackSink>),
    Finished,
}

impl Handle for isv_writer {
    type Object = Mutex<State>;
    const NAME: &'static str = "isv_writer";
}

/// Calls a method of whichever writer it is.
macro_rules! on_writer {
    ($state:expr, $writer:ident => $call:expr) => {
        match $state {
            State::File($writer) => Ok($call?),
            State::Callback($writer) => Ok($call?),
            State::Finished => Err(finished()),
        }
    };
}

fn finished() -> Failure {
    Failure::new(ISV_ERROR_STATE, "the writer is finished: no call but isv_writer_free may follow")
}

/// Creates a writer to a file. `path` is UTF-8. `options` may be null for the defaults, and may be freed at once.
///
/// The file has its name once `isv_writer_finish` was called. Until then it is called `path` with `.part` behind it. Free the writer with
/// `isv_writer_free`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_writer_create(
    path: *const c_char,
    options: *const isv_encode_options,
    writer: *mut *mut isv_writer,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for a place for a handle, and for text.
        let (place, path) =
            unsafe { (place("writer", writer)?.write(std::ptr::null_mut()), self::path("path", path)?) };
        let file = Writer::create(path, &options_of(options, Settings::build)?)?;
        *place = handle::add(Mutex::new(State::File(file)));
        Ok(())
    })
}

/// Creates a writer to a callback. `options` may be null for the defaults, and may be freed at once.
///
/// The callback is called by the calls that push frames, and by `isv_writer_finish`. It and `user` must stay good until the writer is
/// freed. Bytes come in order, and the stream can be sent while it is made. Free the writer with `isv_writer_free`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_writer_create_callback(
    callback: isv_write_fn,
    user: *mut c_void,
    options: *const isv_encode_options,
    writer: *mut *mut isv_writer,
) -> isv_status {
    call_ok(|| {
        // SAFETY: isv.h asks for a place for a handle.
        let place = unsafe { place("writer", writer)? }.write(std::ptr::null_mut());
        let write = callback.ok_or_else(|| Failure::argument("callback is null"))?;
        let sink = CallbackSink { write, user: User(user) };
        let writer = Writer::new(sink, &options_of(options, Settings::build)?)?;
        *place = handle::add(Mutex::new(State::Callback(writer)));
        Ok(())
    })
}

/// Frees a writer. Null is no error. A writer to a file that is not finished leaves no file.
#[unsafe(no_mangle)]
pub extern "C" fn isv_writer_free(writer: *mut isv_writer) -> isv_status {
    call_ok(|| handle::free(writer))
}

/// Arrays of a mesh of the caller's.
///
/// # Safety
/// Pointers of the struct are null, misaligned, or good for as many numbers as isv.h says.
unsafe fn mesh_from(mesh: &isv_mesh) -> Outcome<Mesh> {
    let (vertices, triangles) = (mesh.vertex_count, mesh.triangle_count);
    // SAFETY: the caller vouches for it.
    unsafe {
        Ok(Mesh {
            positions: slice("positions", mesh.positions.cast(), vertices)?.to_vec(),
            normals: Vec::new(),
            colours: optional_slice("colours", mesh.colours.cast(), vertices)?.to_vec(),
            triangles: slice("indices", mesh.indices.cast(), triangles)?.to_vec(),
        })
    }
}

/// Encodes a mesh. One without triangles is a frame without a surface.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_writer_push_mesh(writer: *mut isv_writer, mesh: *const isv_mesh) -> isv_status {
    call_ok(|| {
        let state = handle::get(writer)?;
        // SAFETY: isv.h asks for a struct, and for arrays in it.
        let mesh = unsafe { mesh_from(&read(mesh)?)? };
        on_writer!(&mut *lock(&state)?, writer => writer.push_mesh(&mesh))
    })
}

/// Encodes a mesh that was taken at a time (ns), from any start. Later frames have later times.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_writer_push_mesh_at(
    writer: *mut isv_writer,
    mesh: *const isv_mesh,
    time_ns: u64,
) -> isv_status {
    call_ok(|| {
        let state = handle::get(writer)?;
        // SAFETY: isv.h asks for a struct, and for arrays in it.
        let mesh = unsafe { mesh_from(&read(mesh)?)? };
        on_writer!(&mut *lock(&state)?, writer => writer.push_mesh_at(&mesh, Duration::from_nanos(time_ns)))
    })
}

/// Arrays of points of the caller's.
///
/// # Safety
/// Pointers of the struct are null, misaligned, or good for as many numbers as isv.h says.
unsafe fn points_from(points: &isv_points) -> Outcome<Points> {
    // SAFETY: the caller vouches for it.
    unsafe {
        Ok(Points {
            positions: slice("positions", points.positions.cast(), points.count)?.to_vec(),
            normals: optional_slice("normals", points.normals.cast(), points.count)?.to_vec(),
            colours: optional_slice("colours", points.colours.cast(), points.count)?.to_vec(),
            viewpoint: optional_slice("viewpoint", points.viewpoint.cast(), 1)?.first().copied(),
        })
    }
}

/// Encodes points. None at all are a frame without a surface.
///
/// Without normals a thin shell is made around them, unless `isv_encode_options_set_estimated_normals` asks for estimates.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_writer_push_points(
    writer: *mut isv_writer,
    points: *const isv_points,
) -> isv_status {
    call_ok(|| {
        let state = handle::get(writer)?;
        // SAFETY: isv.h asks for a struct, and for arrays in it.
        let points = unsafe { points_from(&read(points)?)? };
        on_writer!(&mut *lock(&state)?, writer => writer.push_points(&points))
    })
}

/// Encodes points that were taken at a time (ns), from any start. Later frames have later times.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_writer_push_points_at(
    writer: *mut isv_writer,
    points: *const isv_points,
    time_ns: u64,
) -> isv_status {
    call_ok(|| {
        let state = handle::get(writer)?;
        // SAFETY: isv.h asks for a struct, and for arrays in it.
        let points = unsafe { points_from(&read(points)?)? };
        on_writer!(&mut *lock(&state)?, writer => writer.push_points_at(&points, Duration::from_nanos(time_ns)))
    })
}

/// Images of cameras of the caller's.
///
/// # Safety
/// Pointers are null, misaligned, or good for as many images, and those for as many pixels, as isv.h says.
unsafe fn views_from(
    depth_images: *const isv_depth_image,
    depth_count: usize,
    colour_images: *const isv_colour_image,
    colour_count: usize,
) -> Outcome<(Vec<DepthView>, Vec<ColourView>)> {
    if depth_count == 0 {
        return Err(Failure::argument("depth_count is 0: a frame has at least 1 depth image"));
    }
    // SAFETY: the caller vouches for it.
    unsafe {
        let depths = slice("depth_images", depth_images, depth_count)?.iter().map(|image| depth_from(image));
        let colours = slice("colour_images", colour_images, colour_count)?;
        let colours = colours.iter().map(|image| colour_from(image, depth_count));
        Ok((depths.collect::<Outcome<_>>()?, colours.collect::<Outcome<_>>()?))
    }
}

/// Encodes what depth cameras, and perhaps colour cameras, saw at one instant.
///
/// `depth_images` has `depth_count` images, at least 1. `colour_images` has `colour_count` images, and is null for none. A stream has
/// colour if its first frame has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_writer_push_depth(
    writer: *mut isv_writer,
    depth_images: *const isv_depth_image,
    depth_count: usize,
    colour_images: *const isv_colour_image,
    colour_count: usize,
) -> isv_status {
    call_ok(|| {
        let state = handle::get(writer)?;
        // SAFETY: isv.h asks for arrays of images, and for arrays in them.
        let (depths, colours) =
            unsafe { views_from(depth_images, depth_count, colour_images, colour_count)? };
        on_writer!(&mut *lock(&state)?, writer => writer.push_depth_and_colour(&depths, &colours))
    })
}

/// Encodes what cameras saw at a time (ns), from any start. Later frames have later times. See `isv_writer_push_depth`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_writer_push_depth_at(
    writer: *mut isv_writer,
    depth_images: *const isv_depth_image,
    depth_count: usize,
    colour_images: *const isv_colour_image,
    colour_count: usize,
    time_ns: u64,
) -> isv_status {
    call_ok(|| {
        let state = handle::get(writer)?;
        // SAFETY: isv.h asks for arrays of images, and for arrays in them.
        let (depths, colours) =
            unsafe { views_from(depth_images, depth_count, colour_images, colour_count)? };
        let time = Duration::from_nanos(time_ns);
        on_writer!(&mut *lock(&state)?, writer => writer.push_depth_and_colour_at(&depths, &colours, time))
    })
}

/// Pixels of an image at most, as of images in files. They are copied before anything else is looked at.
const MOST_PIXELS: usize = 1 << 28;

/// Pixels of a camera.
fn pixels(camera: &isv_camera) -> Outcome<usize> {
    let pixels = u64::from(camera.width) * u64::from(camera.height);
    match usize::try_from(pixels) {
        Ok(pixels) if (1..=MOST_PIXELS).contains(&pixels) => Ok(pixels),
        _ => Err(Failure::argument(format!("an image is {} x {} pixels", camera.width, camera.height))),
    }
}

fn pose(camera: &isv_camera) -> [[f64; 4]; 4] {
    std::array::from_fn(|row| std::array::from_fn(|column| camera.camera_to_world[4 * row + column]))
}

/// # Safety
/// The pointer of the image is null, misaligned, or good for all pixels.
unsafe fn depth_from(image: &isv_depth_image) -> Outcome<DepthView> {
    let camera = &image.camera;
    Ok(DepthView {
        width: camera.width,
        height: camera.height,
        focal: camera.focal,
        principal: camera.principal,
        camera_to_world: pose(camera),
        // SAFETY: the caller vouches for it.
        depths_m: unsafe { slice("depths", image.depths, pixels(camera)?) }?.to_vec(),
    })
}

/// # Safety
/// The pointer of the image is null, or good for all pixels.
unsafe fn colour_from(image: &isv_colour_image, depth_count: usize) -> Outcome<ColourView> {
    let camera = &image.camera;
    let depth_view = match image.depth_image {
        -1 => None,
        number => match usize::try_from(number) {
            Ok(number) if number < depth_count => Some(number),
            _ => {
                return Err(Failure::argument(format!(
                    "depth_image is {number}, but there are {depth_count}"
                )));
            }
        },
    };
    Ok(ColourView {
        width: camera.width,
        height: camera.height,
        focal: camera.focal,
        principal: camera.principal,
        camera_to_world: pose(camera),
        // SAFETY: the caller vouches for it.
        colours: unsafe { slice("colours", image.colours.cast(), pixels(camera)?) }?.to_vec(),
        depth_view,
    })
}

/// Encodes a sparse field of signed distances.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_writer_push_volume(
    writer: *mut isv_writer,
    volume: *const isv_volume,
) -> isv_status {
    call_ok(|| {
        let state = handle::get(writer)?;
        // SAFETY: isv.h asks for a struct, and for arrays in it.
        let volume = unsafe { volume_from(&read(volume)?)? };
        on_writer!(&mut *lock(&state)?, writer => writer.push_volume_arrays(&volume))
    })
}

/// Encodes a sparse field of signed distances of a time (ns), from any start. Later frames have later times.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_writer_push_volume_at(
    writer: *mut isv_writer,
    volume: *const isv_volume,
    time_ns: u64,
) -> isv_status {
    call_ok(|| {
        let state = handle::get(writer)?;
        // SAFETY: isv.h asks for a struct, and for arrays in it.
        let volume = unsafe { volume_from(&read(volume)?)? };
        let time = Duration::from_nanos(time_ns);
        on_writer!(&mut *lock(&state)?, writer => writer.push_volume_arrays_at(&volume, time))
    })
}

/// # Safety
/// Pointers of the struct are null, misaligned, or good for as many numbers as isv.h says.
unsafe fn volume_from(volume: &isv_volume) -> Outcome<VolumeArrays> {
    let isv_volume { voxel_m, block_edge, truncation_voxels, block_count, .. } = *volume;
    let wrong_edge = || Failure::argument(format!("block_edge is {block_edge}, not 4, 8 or 16"));
    let voxels =
        [4, 8, 16].contains(&block_edge).then(|| (block_edge as usize).pow(3)).ok_or_else(wrong_edge)?;
    let too_many = || Failure::argument(format!("block_count is {block_count}: no memory holds as many"));
    let distances = block_count.checked_mul(voxels).ok_or_else(too_many)?;
    // SAFETY: the caller vouches for it.
    let (coords, distances) = unsafe {
        (
            slice("coords", volume.coords.cast(), block_count)?,
            slice("distances", volume.distances, distances)?,
        )
    };
    let (coords, distances_m) = (coords.to_vec(), distances.to_vec());
    Ok(VolumeArrays { voxel_m, edge: block_edge, truncation_voxels, coords, distances_m })
}

/// Encodes a dense field of signed distances. Parts of it that are not observed, or far outside, cost nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_writer_push_dense_volume(
    writer: *mut isv_writer,
    volume: *const isv_dense_volume,
) -> isv_status {
    call_ok(|| {
        let state = handle::get(writer)?;
        // SAFETY: isv.h asks for a struct, and for an array in it.
        let volume = unsafe { dense_from(&read(volume)?)? };
        on_writer!(&mut *lock(&state)?, writer => writer.push_volume(&volume))
    })
}

/// Encodes a dense field of signed distances of a time (ns), from any start. Later frames have later times.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_writer_push_dense_volume_at(
    writer: *mut isv_writer,
    volume: *const isv_dense_volume,
    time_ns: u64,
) -> isv_status {
    call_ok(|| {
        let state = handle::get(writer)?;
        // SAFETY: isv.h asks for a struct, and for an array in it.
        let volume = unsafe { dense_from(&read(volume)?)? };
        on_writer!(&mut *lock(&state)?, writer => writer.push_volume_at(&volume, Duration::from_nanos(time_ns)))
    })
}

/// Edge of the blocks that a dense field is cut into (voxels).
const EDGE: usize = 8;

/// # Safety
/// The pointer of the struct is null, misaligned, or good for all voxels.
unsafe fn dense_from(volume: &isv_dense_volume) -> Outcome<Volume> {
    let isv_dense_volume { voxel_m, truncation_voxels, size, first, .. } = *volume;
    let wide = size.map(|voxels| voxels as usize);
    let count = wide[0].checked_mul(wide[1]).and_then(|voxels| voxels.checked_mul(wide[2]));
    let count =
        count.ok_or_else(|| Failure::argument(format!("size is {size:?}: no memory holds as many")))?;
    for axis in 0..3 {
        if i64::from(first[axis]) + i64::from(size[axis]) > i64::from(i32::MAX) {
            return Err(Failure::argument(format!("first is {first:?}: the box ends too far away")));
        }
    }
    // SAFETY: the caller vouches for it.
    let distances = unsafe { slice("distances", volume.distances, count) }?;
    let far = (f64::from(truncation_voxels) * voxel_m) as f32;
    let edge = EDGE as i32;
    let blocks_along = |axis: usize| match size[axis] {
        0 => 0..0,
        voxels => first[axis].div_euclid(edge)..(first[axis] + (voxels - 1) as i32).div_euclid(edge) + 1,
    };
    let mut blocks = Vec::new();
    for z in blocks_along(2) {
        for y in blocks_along(1) {
            for x in blocks_along(0) {
                let coord = [x, y, z];
                let at = |axis: usize, voxel: usize| {
                    let place = i64::from(coord[axis]) * EDGE as i64 + voxel as i64 - i64::from(first[axis]);
                    usize::try_from(place).ok().filter(|place| *place < wide[axis])
                };
                let distance = |voxel: usize| {
                    let place =
                        (at(0, voxel % EDGE)?, at(1, voxel / EDGE % EDGE)?, at(2, voxel / EDGE / EDGE)?);
                    Some(distances[(place.2 * wide[1] + place.1) * wide[0] + place.0])
                };
                let distances_m: Vec<_> =
                    (0..EDGE.pow(3)).map(|voxel| distance(voxel).unwrap_or(f32::NAN)).collect();
                if distances_m.iter().any(|distance| *distance < far) {
                    blocks.push(Block { coord, distances_m });
                }
            }
        }
    }
    Ok(Volume { voxel_m, edge: EDGE as u32, truncation_voxels, blocks })
}

/// Completes the stream, and gives a file its name. `report` may be null. Afterwards only `isv_writer_free` may follow.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_writer_finish(writer: *mut isv_writer, report: *mut isv_report) -> isv_status {
    call_ok(|| {
        let state = handle::get(writer)?;
        if !report.is_null() {
            // SAFETY: isv.h asks for a struct.
            unsafe { stated_size(report) }?;
        }
        let done = match std::mem::replace(&mut *lock(&state)?, State::Finished) {
            State::File(writer) => writer.finish()?,
            State::Callback(writer) => writer.into_inner()?.1,
            State::Finished => return Err(finished()),
        };
        // SAFETY: isv.h asks for a struct.
        unsafe { write_report(report, &done) }
    })
}

/// # Safety
/// See [`write`]; or the pointer is null.
pub(crate) unsafe fn write_report(report: *mut isv_report, done: &Report) -> Outcome {
    if report.is_null() {
        return Ok(());
    }
    let value = isv_report {
        struct_size: 0,
        frames: done.frames as u64,
        empty: done.empty as u64,
        skipped: done.skipped as u64,
        bytes: done.bytes,
        duration_ns: u64::try_from(done.duration.as_nanos()).unwrap_or(u64::MAX),
        bits_per_second: done.megabits_per_second() * 1e6,
        voxel_m: done.voxel.metres(),
        shell_m: done.shell.map_or(0.0, isv::Length::metres),
        is_cancelled: i32::from(done.is_cancelled),
    };
    // SAFETY: the caller vouches for it.
    unsafe { write(report, &value) }
}
