//! The calls that tests make again and again, and frames for them.
#![allow(dead_code, reason = "each test program uses a part")]

use isv_capi::*;
use std::ffi::{CStr, CString, c_void};
use std::path::Path;
use std::ptr::null_mut;

/// Words of the last error.
pub(crate) fn message() -> String {
    // SAFETY: the text is this thread's, and no call comes between.
    unsafe { CStr::from_ptr(isv_error_message()) }.to_str().unwrap().to_owned()
}

#[track_caller]
pub(crate) fn ok(status: isv_status) {
    assert_eq!(status, ISV_OK, "{}", message());
}

/// Asserts that a call failed in one way, and said these words.
#[track_caller]
pub(crate) fn fails(status: isv_status, expected: isv_status, words: &str) {
    assert_eq!(status, expected, "{}", message());
    assert!(message().contains(words), "{:?} does not say {words:?}", message());
}

/// A struct of isv.h, all 0.
pub(crate) fn zeroed<T: Copy>() -> T {
    // SAFETY: structs of isv.h are made of numbers, pointers and optional functions.
    unsafe { std::mem::zeroed() }
}

/// A struct of isv.h that states its size; the rest is 0.
macro_rules! sized {
    ($name:ident) => {
        $name { struct_size: size_of::<$name>(), ..$crate::support::zeroed() }
    };
}

/// A box of 0.5 x 0.4 x 0.4 m whose lowest corner is at `x`, red at its lower end and blue at the other.
pub(crate) struct Cuboid {
    pub(crate) positions: Vec<f32>,
    pub(crate) colours: Vec<u8>,
    pub(crate) indices: Vec<u32>,
}

impl Cuboid {
    pub(crate) fn new(x: f32) -> Self {
        let high = |corner: u32, bit: u32, length: f32| if corner & bit == 0 { 0.0 } else { length };
        let corners = (0..8).flat_map(|i| [x + high(i, 1, 0.5), high(i, 2, 0.4), high(i, 4, 0.4)]);
        let colours = (0..8).flat_map(|i| if i & 1 == 0 { [220, 30, 30] } else { [30, 30, 220] });
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let indices = faces.iter().flat_map(|[a, b, c, d]| [*a, *b, *c, *a, *c, *d]);
        Self { positions: corners.collect(), colours: colours.collect(), indices: indices.collect() }
    }

    pub(crate) fn mesh(&self) -> isv_mesh {
        isv_mesh {
            vertex_count: 8,
            triangle_count: 12,
            positions: self.positions.as_ptr(),
            colours: self.colours.as_ptr(),
            indices: self.indices.as_ptr(),
            ..sized!(isv_mesh)
        }
    }
}

pub(crate) fn options() -> *mut isv_encode_options {
    let mut options = null_mut();
    // SAFETY: the place is good.
    ok(unsafe { isv_encode_options_new(&mut options) });
    ok(isv_encode_options_set_quality(options, 60.0));
    ok(isv_encode_options_set_voxel(options, 0.02));
    ok(isv_encode_options_set_keyframe_interval(options, 4));
    options
}

/// Appends bytes to the vector behind the pointer.
pub(crate) unsafe extern "C" fn append(user: *mut c_void, bytes: *const u8, size: usize) -> i32 {
    // SAFETY: the tests give a vector, and the library gives bytes.
    unsafe { (*user.cast::<Vec<u8>>()).extend_from_slice(std::slice::from_raw_parts(bytes, size)) };
    0
}

/// A writer into a vector.
pub(crate) fn writer_to(bytes: &mut Vec<u8>, options: *const isv_encode_options) -> *mut isv_writer {
    let mut writer = null_mut();
    // SAFETY: the vector outlives the writer in all tests.
    ok(unsafe { isv_writer_create_callback(Some(append), (&raw mut *bytes).cast(), options, &mut writer) });
    writer
}

/// A stream of coloured boxes that move 1 cm a frame.
pub(crate) fn stream(frames: usize) -> Vec<u8> {
    let (mut bytes, options) = (Vec::new(), options());
    let writer = writer_to(&mut bytes, options);
    ok(isv_encode_options_free(options));
    for frame in 0..frames {
        let cuboid = Cuboid::new(0.01 * frame as f32);
        // SAFETY: the mesh's arrays are good.
        ok(unsafe { isv_writer_push_mesh(writer, &cuboid.mesh()) });
    }
    let mut report = sized!(isv_report);
    // SAFETY: the report is good.
    ok(unsafe { isv_writer_finish(writer, &mut report) });
    assert_eq!((report.frames, report.bytes), (frames as u64, bytes.len() as u64));
    assert_eq!((report.bits_per_second > 0.0, report.voxel_m, report.is_cancelled), (frames > 0, 0.02, 0));
    ok(isv_writer_free(writer));
    bytes
}

pub(crate) fn open(bytes: &[u8]) -> *mut isv_reader {
    let mut reader = null_mut();
    // SAFETY: the bytes are good.
    ok(unsafe { isv_reader_open_memory(bytes.as_ptr(), bytes.len(), &mut reader) });
    reader
}

pub(crate) fn next(reader: *mut isv_reader) -> *mut isv_frame {
    let mut frame = null_mut();
    // SAFETY: the place is good.
    ok(unsafe { isv_reader_next_frame(reader, &mut frame) });
    frame
}

pub(crate) fn mesh_of(frame: *const isv_frame) -> isv_mesh {
    let mut mesh = sized!(isv_mesh);
    // SAFETY: the struct is good.
    ok(unsafe { isv_frame_get_mesh(frame, &mut mesh) });
    mesh
}

pub(crate) fn number_of(frame: *const isv_frame) -> u64 {
    let mut info = sized!(isv_frame_info);
    // SAFETY: the struct is good.
    ok(unsafe { isv_frame_get_info(frame, &mut info) });
    info.number
}

pub(crate) fn info_of(reader: *mut isv_reader) -> isv_stream_info {
    let mut info = sized!(isv_stream_info);
    // SAFETY: the struct is good.
    ok(unsafe { isv_reader_info(reader, &mut info) });
    info
}

/// Numbers of an array of a frame.
pub(crate) fn array<'a, T>(pointer: *const T, count: usize) -> &'a [T] {
    assert!(!pointer.is_null());
    // SAFETY: the frame lives as long as the tests look at its arrays.
    unsafe { std::slice::from_raw_parts(pointer, count) }
}

pub(crate) fn c_path(path: &Path) -> CString {
    CString::new(path.to_str().unwrap()).unwrap()
}

/// Number, indices and positions of the next frame.
pub(crate) fn mesh_of_next(reader: *mut isv_reader) -> (u64, Vec<u32>, Vec<f32>) {
    let frame = next(reader);
    let mesh = mesh_of(frame);
    let indices = array(mesh.indices, 3 * mesh.triangle_count).to_vec();
    let positions = array(mesh.positions, 3 * mesh.vertex_count).to_vec();
    let number = number_of(frame);
    ok(isv_frame_free(frame));
    (number, indices, positions)
}

pub(crate) use sized;
