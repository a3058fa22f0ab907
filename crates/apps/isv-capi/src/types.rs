//! Structs that go through calls.

use crate::memory::SizedStruct;
use std::ffi::c_void;

/// A triangle mesh.
///
/// Arrays of an input are the caller's, and are read during the call. Arrays of an output belong to the frame.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct isv_mesh {
    /// Size of this struct: set it to `sizeof(isv_mesh)`.
    pub struct_size: usize,
    /// Number of vertices.
    pub vertex_count: usize,
    /// Number of triangles.
    pub triangle_count: usize,
    /// Positions of vertices (m): x, y, z. `vertex_count` x 3 numbers.
    pub positions: *const f32,
    /// Unit normals: x, y, z. `vertex_count` x 3 numbers, or null. Encoding does not read them.
    pub normals: *const f32,
    /// 8-bit sRGB colours: red, green, blue. `vertex_count` x 3 numbers, or null.
    pub colours: *const u8,
    /// Vertices of each triangle, counter-clockwise seen from outside. `triangle_count` x 3 numbers below `vertex_count`.
    pub indices: *const u32,
}

/// Points of a surface.
///
/// Arrays of an input are the caller's, and are read during the call. Arrays of an output belong to the frame.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct isv_points {
    /// Size of this struct: set it to `sizeof(isv_points)`.
    pub struct_size: usize,
    /// Number of points.
    pub count: usize,
    /// Positions (m): x, y, z. `count` x 3 numbers.
    pub positions: *const f32,
    /// Normals that point outside: x, y, z, all 0 where one is not known. `count` x 3 numbers, or null.
    pub normals: *const f32,
    /// 8-bit sRGB colours: red, green, blue. `count` x 3 numbers, or null.
    pub colours: *const u8,
    /// Place that the points were seen from (m): x, y, z. 3 numbers, or null. Estimated normals face it. Null as an output.
    pub viewpoint: *const f32,
}

/// Lens and place of a camera. Lens distortion has been removed from its images, which have 2^28 pixels at most.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct isv_camera {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal lengths along x and y (pixels).
    pub focal: [f64; 2],
    /// Column and row of the principal point (pixels).
    pub principal: [f64; 2],
    /// Transform from the camera to the world (m), 4 x 4, row by row. The camera looks along +z, its x points right and its y down.
    pub camera_to_world: [f64; 16],
}

/// Image of a depth camera.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct isv_depth_image {
    /// Lens and place of the camera.
    pub camera: isv_camera,
    /// Depths along z (m), row by row from the top; 0 or NaN where there is no reading. `width` x `height` numbers.
    pub depths: *const f32,
}

/// Image of a colour camera.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct isv_colour_image {
    /// Lens and place of the camera.
    pub camera: isv_camera,
    /// 8-bit sRGB, row by row from the top: red, green, blue. `width` x `height` x 3 numbers.
    pub colours: *const u8,
    /// Number of the depth image of the same push from about the same place, such as that of an RGB-D camera. It is -1 if there is
    /// none.
    pub depth_image: i32,
}

/// A sparse field of signed distances (TSDF). Blocks that are not there are outside, or were not observed.
///
/// Arrays of an input are the caller's, and are read during the call. Arrays of an output belong to the frame.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct isv_volume {
    /// Size of this struct: set it to `sizeof(isv_volume)`.
    pub struct_size: usize,
    /// Edge of a voxel (m).
    pub voxel_m: f64,
    /// Edge of a block (voxels): 4, 8 or 16.
    pub block_edge: u32,
    /// Distance from the surface at which distances are cut off (voxels).
    pub truncation_voxels: u32,
    /// Number of blocks.
    pub block_count: usize,
    /// Place of each block, in blocks: x, y, z. Its lowest corner is at place x `block_edge` x `voxel_m`. `block_count` x 3 numbers.
    pub coords: *const i32,
    /// Distances at the centres of voxels (m), negative inside, NaN where not observed. Block by block, in each x fastest, then y, then
    /// z. `block_count` x `block_edge`^3 numbers.
    pub distances: *const f32,
}

/// A dense field of signed distances (TSDF): a box of voxels.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct isv_dense_volume {
    /// Size of this struct: set it to `sizeof(isv_dense_volume)`.
    pub struct_size: usize,
    /// Edge of a voxel (m).
    pub voxel_m: f64,
    /// Distance from the surface at which distances are cut off (voxels). Voxels outside the box are not observed.
    pub truncation_voxels: u32,
    /// Voxels along x, y and z.
    pub size: [u32; 3],
    /// Place of the first voxel, in voxels: x, y, z. The lowest corner of the box is at place x `voxel_m`.
    pub first: [i32; 3],
    /// Distances at the centres of voxels (m), negative inside, NaN where not observed. x fastest, then y, then z. As many as voxels.
    pub distances: *const f32,
}

/// Result of a stream that was written.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct isv_report {
    /// Size of this struct: set it to `sizeof(isv_report)`.
    pub struct_size: usize,
    /// Frames in the stream.
    pub frames: u64,
    /// Frames without a surface.
    pub empty: u64,
    /// Frames that were left out.
    pub skipped: u64,
    /// Size of the stream (bytes).
    pub bytes: u64,
    /// Time that the stream takes to show (ns).
    pub duration_ns: u64,
    /// Mean rate (bits a second); 0 for a stream that takes no time.
    pub bits_per_second: f64,
    /// Edge of a voxel (m).
    pub voxel_m: f64,
    /// Thickness of the shell around surfaces without inside (m); 0 if none was made.
    pub shell_m: f64,
    /// 1 if a callback stopped the job, so that the stream holds the first frames alone; else 0.
    pub is_cancelled: i32,
}

/// Result of a stream that was decoded to files.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct isv_decode_report {
    /// Size of this struct: set it to `sizeof(isv_decode_report)`.
    pub struct_size: usize,
    /// Frames written.
    pub frames: u64,
    /// Largest distance (m) between a mesh with fewer faces and the decoded surface; 0 where no faces were taken away.
    pub simplify_error_m: f64,
    /// 1 if a callback stopped the job, so that the first frames alone were written; else 0.
    pub is_cancelled: i32,
}

/// Facts of a stream that is read.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct isv_stream_info {
    /// Size of this struct: set it to `sizeof(isv_stream_info)`.
    pub struct_size: usize,
    /// Number of frames; -1 if it is not known, as of a stream without seek callback or without a sound index.
    pub frame_count: i64,
    /// Frames a second. Without a seek callback, 0 until the first frame was read.
    pub fps: f64,
    /// Edge of a voxel at full resolution (m). Without a seek callback, 0 until the first frame was read.
    pub voxel_m: f64,
    /// 1 if frames may have colour, else 0. Without a seek callback, 0 until the first frame was read.
    pub has_colour: i32,
    /// 1 if `isv_reader_seek` works, else 0.
    pub can_seek: i32,
}

/// Facts of a decoded frame.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct isv_frame_info {
    /// Size of this struct: set it to `sizeof(isv_frame_info)`.
    pub struct_size: usize,
    /// Number in the stream, from 0.
    pub number: u64,
    /// Time at which it is shown (ns), from the stream's start or, in a live stream, from 1970.
    pub timestamp_ns: u64,
}

/// Bytes of a stream from callbacks.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct isv_source {
    /// Size of this struct: set it to `sizeof(isv_source)`.
    pub struct_size: usize,
    /// Pointer that the callbacks get back.
    pub user: *mut c_void,
    /// Gives the next bytes.
    pub read: crate::callback::isv_read_fn,
    /// Goes to a place; null if the bytes come once, as from a socket. Then frames can be read in order alone.
    pub seek: crate::callback::isv_seek_fn,
}

macro_rules! sized_structs {
    ($($name:ident: $least:expr),* $(,)?) => {$(
        // SAFETY: it is `repr(C)`, begins with a `usize`, and its members are numbers, pointers and optional functions.
        unsafe impl SizedStruct for $name {
            const NAME: &'static str = stringify!($name);
            const LEAST: usize = $least;
        }
    )*};
}

// Sizes of 0.1. They stay numbers when members are added: see `SizedStruct::LEAST`.
sized_structs! {
    isv_mesh: size_of::<isv_mesh>(),
    isv_points: size_of::<isv_points>(),
    isv_volume: size_of::<isv_volume>(),
    isv_dense_volume: size_of::<isv_dense_volume>(),
    isv_report: size_of::<isv_report>(),
    isv_decode_report: size_of::<isv_decode_report>(),
    isv_stream_info: size_of::<isv_stream_info>(),
    isv_frame_info: size_of::<isv_frame_info>(),
    isv_source: size_of::<isv_source>(),
}
