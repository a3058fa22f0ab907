//! The calls of isv.h as C programs make them: every way in and out, and every wrong argument an error with its words.

use isv_capi::*;
use std::ffi::{CStr, CString, c_char, c_void};
use std::path::Path;
use std::ptr::{null, null_mut};
use std::sync::Mutex;

/// Words of the last error.
fn message() -> String {
    // SAFETY: the text is this thread's, and no call comes between.
    unsafe { CStr::from_ptr(isv_error_message()) }.to_str().unwrap().to_owned()
}

#[track_caller]
fn ok(status: isv_status) {
    assert_eq!(status, ISV_OK, "{}", message());
}

/// Asserts that a call failed in one way, and said these words.
#[track_caller]
fn fails(status: isv_status, expected: isv_status, words: &str) {
    assert_eq!(status, expected, "{}", message());
    assert!(message().contains(words), "{:?} does not say {words:?}", message());
}

/// A struct of isv.h, all 0.
fn zeroed<T: Copy>() -> T {
    // SAFETY: structs of isv.h are made of numbers, pointers and optional functions.
    unsafe { std::mem::zeroed() }
}

/// A struct of isv.h that states its size; the rest is 0.
macro_rules! sized {
    ($name:ident) => {
        $name { struct_size: size_of::<$name>(), ..zeroed() }
    };
}

/// A box of 0.5 x 0.4 x 0.4 m whose lowest corner is at `x`, red at its lower end and blue at the other.
struct Cuboid {
    positions: Vec<f32>,
    colours: Vec<u8>,
    indices: Vec<u32>,
}

impl Cuboid {
    fn new(x: f32) -> Self {
        let high = |corner: u32, bit: u32, length: f32| if corner & bit == 0 { 0.0 } else { length };
        let corners = (0..8).flat_map(|i| [x + high(i, 1, 0.5), high(i, 2, 0.4), high(i, 4, 0.4)]);
        let colours = (0..8).flat_map(|i| if i & 1 == 0 { [220, 30, 30] } else { [30, 30, 220] });
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let indices = faces.iter().flat_map(|[a, b, c, d]| [*a, *b, *c, *a, *c, *d]);
        Self { positions: corners.collect(), colours: colours.collect(), indices: indices.collect() }
    }

    fn mesh(&self) -> isv_mesh {
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

fn options() -> *mut isv_encode_options {
    let mut options = null_mut();
    // SAFETY: the place is good.
    ok(unsafe { isv_encode_options_new(&mut options) });
    ok(isv_encode_options_set_quality(options, 60.0));
    ok(isv_encode_options_set_voxel(options, 0.02));
    ok(isv_encode_options_set_keyframe_interval(options, 4));
    options
}

/// Appends bytes to the vector behind the pointer.
unsafe extern "C" fn append(user: *mut c_void, bytes: *const u8, size: usize) -> i32 {
    // SAFETY: the tests give a vector, and the library gives bytes.
    unsafe { (*user.cast::<Vec<u8>>()).extend_from_slice(std::slice::from_raw_parts(bytes, size)) };
    0
}

/// A writer into a vector.
fn writer_to(bytes: &mut Vec<u8>, options: *const isv_encode_options) -> *mut isv_writer {
    let mut writer = null_mut();
    // SAFETY: the vector outlives the writer in all tests.
    ok(unsafe { isv_writer_create_callback(Some(append), (&raw mut *bytes).cast(), options, &mut writer) });
    writer
}

/// A stream of coloured boxes that move 1 cm a frame.
fn stream(frames: usize) -> Vec<u8> {
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

fn open(bytes: &[u8]) -> *mut isv_reader {
    let mut reader = null_mut();
    // SAFETY: the bytes are good.
    ok(unsafe { isv_reader_open_memory(bytes.as_ptr(), bytes.len(), &mut reader) });
    reader
}

fn next(reader: *mut isv_reader) -> *mut isv_frame {
    let mut frame = null_mut();
    // SAFETY: the place is good.
    ok(unsafe { isv_reader_next_frame(reader, &mut frame) });
    frame
}

fn mesh_of(frame: *const isv_frame) -> isv_mesh {
    let mut mesh = sized!(isv_mesh);
    // SAFETY: the struct is good.
    ok(unsafe { isv_frame_get_mesh(frame, &mut mesh) });
    mesh
}

fn number_of(frame: *const isv_frame) -> u64 {
    let mut info = sized!(isv_frame_info);
    // SAFETY: the struct is good.
    ok(unsafe { isv_frame_get_info(frame, &mut info) });
    info.number
}

fn info_of(reader: *mut isv_reader) -> isv_stream_info {
    let mut info = sized!(isv_stream_info);
    // SAFETY: the struct is good.
    ok(unsafe { isv_reader_info(reader, &mut info) });
    info
}

/// Numbers of an array of a frame.
fn array<'a, T>(pointer: *const T, count: usize) -> &'a [T] {
    assert!(!pointer.is_null());
    // SAFETY: the frame lives as long as the tests look at its arrays.
    unsafe { std::slice::from_raw_parts(pointer, count) }
}

fn c_path(path: &Path) -> CString {
    CString::new(path.to_str().unwrap()).unwrap()
}

#[test]
fn meshes_come_back_in_the_frames_arrays() {
    let reader = open(&stream(3));
    let info = info_of(reader);
    assert_eq!(
        (info.frame_count, info.fps, info.voxel_m, info.has_colour, info.can_seek),
        (3, 30.0, 0.02, 1, 1)
    );
    let frames: Vec<_> = (0..3).map(|_| next(reader)).collect();
    let mut frame = null_mut();
    // SAFETY: the place is good.
    assert_eq!(unsafe { isv_reader_next_frame(reader, &mut frame) }, ISV_END);
    assert!(frame.is_null());
    // Frames outlive their reader.
    ok(isv_reader_free(reader));
    for (number, frame) in frames.into_iter().enumerate() {
        let mesh = mesh_of(frame);
        assert_eq!(mesh_of(frame).positions, mesh.positions, "the surface is made once");
        assert_eq!(number_of(frame), number as u64);
        let (positions, normals) =
            (array(mesh.positions, 3 * mesh.vertex_count), array(mesh.normals, 3 * mesh.vertex_count));
        let colours = array(mesh.colours, 3 * mesh.vertex_count);
        let lowest = positions.chunks(3).map(|p| p[0]).fold(f32::MAX, f32::min);
        assert!((lowest - 0.01 * number as f32).abs() < 0.01, "{lowest}");
        assert!(normals.chunks(3).all(|n| (n.iter().map(|c| c * c).sum::<f32>() - 1.0).abs() < 1e-3));
        for (position, colour) in positions.chunks(3).zip(colours.chunks(3)) {
            let along = (position[0] - lowest) / 0.5;
            assert!(
                (0.2..0.8).contains(&along) || (colour[0] > colour[2]) == (along < 0.5),
                "{position:?} {colour:?}"
            );
        }
        let indices = array(mesh.indices, 3 * mesh.triangle_count);
        assert!(
            mesh.triangle_count > 100 && indices.iter().all(|index| (*index as usize) < mesh.vertex_count)
        );
        ok(isv_frame_free(frame));
    }
}

#[test]
fn arrays_are_those_of_the_library() {
    let bytes = stream(2);
    let reader = open(&bytes);
    for expected in isv::Reader::from_bytes("test", bytes).unwrap() {
        let expected = expected.unwrap();
        let frame = next(reader);
        let (mesh, surface) = (mesh_of(frame), expected.mesh().unwrap());
        assert_eq!(array(mesh.positions, 3 * mesh.vertex_count), surface.positions.as_flattened());
        assert_eq!(array(mesh.normals, 3 * mesh.vertex_count), surface.normals.as_flattened());
        assert_eq!(array(mesh.colours, 3 * mesh.vertex_count), surface.colours.as_flattened());
        assert_eq!(array(mesh.indices, 3 * mesh.triangle_count), surface.triangles.as_flattened());
        for count in [100, 0] {
            let mut points = sized!(isv_points);
            // SAFETY: the struct is good.
            ok(unsafe { isv_frame_get_points(frame, count, &mut points) });
            let cloud = if count == 0 { expected.points_by_voxel() } else { expected.points(count) }.unwrap();
            assert_eq!(array(points.positions, 3 * points.count), cloud.positions.as_flattened());
            assert_eq!(array(points.normals, 3 * points.count), cloud.normals.as_flattened());
            assert_eq!(array(points.colours, 3 * points.count), cloud.colours.as_flattened());
            assert!(points.viewpoint.is_null());
        }
        let mut volume = sized!(isv_volume);
        // SAFETY: the struct is good.
        ok(unsafe { isv_frame_get_volume(frame, &mut volume) });
        let field = expected.volume_arrays().unwrap();
        assert_eq!((volume.voxel_m, volume.block_edge), (field.voxel_m, field.edge));
        assert_eq!(array(volume.coords, 3 * volume.block_count), field.coords.as_flattened());
        let distances = array(volume.distances, volume.block_count * (volume.block_edge as usize).pow(3));
        let same = |(a, b): (&f32, &f32)| a == b || a.is_nan() && b.is_nan();
        assert!(
            distances.len() == field.distances_m.len() && distances.iter().zip(&field.distances_m).all(same)
        );
        ok(isv_frame_free(frame));
    }
    ok(isv_reader_free(reader));
}

#[test]
fn seeking_and_levels_of_detail_go_on_from_any_frame() {
    let reader = open(&stream(10));
    let all: Vec<_> = (0..10).map(|_| mesh_of_next(reader)).collect();
    for number in [6, 0, 9, 3] {
        ok(isv_reader_seek(reader, number as u64));
        assert_eq!(mesh_of_next(reader), all[number]);
    }
    // Frame 4 comes next, at any level.
    ok(isv_reader_set_lod(reader, 2));
    let half = mesh_of_next(reader);
    assert!(half.1.len() * 2 < all[4].1.len() && half.0 == 4);
    ok(isv_reader_set_lod(reader, 1));
    ok(isv_reader_leave_out_colour(reader));
    let frame = next(reader);
    assert!(number_of(frame) == 5 && mesh_of(frame).colours.is_null());
    ok(isv_frame_free(frame));
    fails(isv_reader_set_lod(reader, 3), ISV_ERROR_OPTIONS, "3 is no level of detail");
    fails(isv_reader_seek(reader, 10), ISV_ERROR_OPTIONS, "there are 10");
    fails(isv_reader_seek(reader, u64::MAX), ISV_ERROR_OPTIONS, "there are 10");
    ok(isv_reader_seek(reader, 9));
    assert_eq!(mesh_of_next(reader).0, 9);
    // Options may be set at the end, which comes again.
    ok(isv_reader_set_memory_limit(reader, 1 << 30));
    let mut frame = null_mut();
    // SAFETY: the place is good.
    assert_eq!(unsafe { isv_reader_next_frame(reader, &mut frame) }, ISV_END);
    ok(isv_reader_seek(reader, 0));
    ok(isv_reader_set_memory_limit(reader, 1000));
    // SAFETY: the place is good.
    fails(unsafe { isv_reader_next_frame(reader, &mut frame) }, ISV_ERROR_MEMORY, "above the limit");
    // SAFETY: the place is good.
    assert_eq!(unsafe { isv_reader_next_frame(reader, &mut frame) }, ISV_END, "nothing follows an error");
    ok(isv_reader_free(reader));
}

/// Number, indices and positions of the next frame.
fn mesh_of_next(reader: *mut isv_reader) -> (u64, Vec<u32>, Vec<f32>) {
    let frame = next(reader);
    let mesh = mesh_of(frame);
    let indices = array(mesh.indices, 3 * mesh.triangle_count).to_vec();
    let positions = array(mesh.positions, 3 * mesh.vertex_count).to_vec();
    let number = number_of(frame);
    ok(isv_frame_free(frame));
    (number, indices, positions)
}

/// Bytes with a place, for callbacks.
struct Tape {
    bytes: Vec<u8>,
    at: usize,
    /// Number that the read callback returns in place of the true one.
    lie: Option<i64>,
}

unsafe extern "C" fn tape_read(user: *mut c_void, bytes: *mut u8, size: usize) -> i64 {
    // SAFETY: the tests give a tape, and the library gives room.
    let (tape, room) = unsafe { (&mut *user.cast::<Tape>(), std::slice::from_raw_parts_mut(bytes, size)) };
    let count = size.min(tape.bytes.len() - tape.at);
    room[..count].copy_from_slice(&tape.bytes[tape.at..tape.at + count]);
    tape.at += count;
    tape.lie.unwrap_or(count as i64)
}

unsafe extern "C" fn tape_seek(user: *mut c_void, offset: i64, whence: i32) -> i64 {
    // SAFETY: the tests give a tape.
    let tape = unsafe { &mut *user.cast::<Tape>() };
    let from = match whence {
        ISV_SEEK_START => 0,
        ISV_SEEK_CURRENT => tape.at,
        ISV_SEEK_END => tape.bytes.len(),
        _ => return -1,
    };
    tape.at = (from as i64 + offset).clamp(0, tape.bytes.len() as i64) as usize;
    tape.at as i64
}

fn source(tape: &mut Tape, seek: isv_seek_fn) -> isv_source {
    isv_source { user: (&raw mut *tape).cast(), read: Some(tape_read), seek, ..sized!(isv_source) }
}

#[test]
fn streams_come_from_files_and_callbacks() {
    let bytes = stream(5);
    let expected: Vec<_> = {
        let reader = open(&bytes);
        let all = (0..5).map(|_| mesh_of_next(reader)).collect();
        ok(isv_reader_free(reader));
        all
    };
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), &bytes).unwrap();
    let mut reader = null_mut();
    // SAFETY: the text and the place are good.
    ok(unsafe { isv_reader_open(c_path(file.path()).as_ptr(), &mut reader) });
    ok(isv_reader_seek(reader, 3));
    assert_eq!(mesh_of_next(reader), expected[3]);
    ok(isv_reader_free(reader));

    let mut tape = Tape { bytes, at: 0, lie: None };
    // SAFETY: the struct and the place are good, and the tape outlives the reader.
    ok(unsafe { isv_reader_open_source(&source(&mut tape, Some(tape_seek)), &mut reader) });
    assert_eq!(info_of(reader).frame_count, 5);
    ok(isv_reader_seek(reader, 4));
    assert_eq!(mesh_of_next(reader), expected[4]);
    ok(isv_reader_free(reader));

    tape.at = 0;
    // SAFETY: as above.
    ok(unsafe { isv_reader_open_source(&source(&mut tape, None), &mut reader) });
    let info = info_of(reader);
    assert_eq!((info.frame_count, info.fps, info.can_seek, tape.at), (-1, 0.0, 0, 0));
    ok(isv_reader_set_lod(reader, 1));
    let all: Vec<_> = (0..5).map(|_| mesh_of_next(reader)).collect();
    assert!(all == expected);
    let info = info_of(reader);
    assert_eq!((info.frame_count, info.fps, info.has_colour), (-1, 30.0, 1));
    fails(isv_reader_seek(reader, 1), ISV_ERROR_OPTIONS, "sought");
    fails(isv_reader_set_lod(reader, 2), ISV_ERROR_STATE, "before the first frame");
    ok(isv_reader_free(reader));

    // Callbacks that fail, or return what cannot be.
    for (lie, words) in [(-7, "returned -7"), (i64::MAX, "more than"), (0, "")] {
        (tape.at, tape.lie) = (0, Some(lie));
        let source = source(&mut tape, Some(tape_seek));
        // SAFETY: as above.
        let status = unsafe { isv_reader_open_source(&source, &mut reader) };
        fails(status, if lie == 0 { ISV_ERROR_STREAM } else { ISV_ERROR_INPUT }, words);
        assert!(reader.is_null());
    }
    // SAFETY: as above.
    let none =
        unsafe { isv_reader_open_source(&isv_source { read: None, ..source(&mut tape, None) }, &mut reader) };
    fails(none, ISV_ERROR_ARGUMENT, "isv_source.read is null");
}

#[test]
fn inputs_that_are_no_streams_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("take.isv");
    let mut reader = null_mut();
    // SAFETY: texts and places are good, or null.
    unsafe {
        fails(isv_reader_open(c_path(&path).as_ptr(), &mut reader), ISV_ERROR_INPUT, "take.isv");
        fails(isv_reader_open(c_path(folder.path()).as_ptr(), &mut reader), ISV_ERROR_INPUT, "folder");
        std::fs::write(&path, b"no stream at all, but long enough to be one's header, is it not?").unwrap();
        fails(isv_reader_open(c_path(&path).as_ptr(), &mut reader), ISV_ERROR_STREAM, "take.isv");
        fails(isv_reader_open(null(), &mut reader), ISV_ERROR_ARGUMENT, "path is null");
        fails(isv_reader_open(c"".as_ptr(), &mut reader), ISV_ERROR_ARGUMENT, "path is empty");
        fails(isv_reader_open(c"\xff\xfe".as_ptr(), &mut reader), ISV_ERROR_ARGUMENT, "not UTF-8");
        fails(isv_reader_open(c"take.isv".as_ptr(), null_mut()), ISV_ERROR_ARGUMENT, "reader is null");
        fails(isv_reader_open_memory(null(), 9, &mut reader), ISV_ERROR_ARGUMENT, "bytes is null");
        fails(isv_reader_open_memory([0].as_ptr(), usize::MAX, &mut reader), ISV_ERROR_ARGUMENT, "no memory");
        fails(isv_reader_open_memory(null(), 0, &mut reader), ISV_ERROR_STREAM, "");
        let mut json = null();
        fails(isv_info_json(c_path(&path).as_ptr(), &mut json), ISV_ERROR_STREAM, "take.isv");
        assert!(json.is_null() && reader.is_null());
    }
}

#[test]
fn damage_is_told_or_concealed() {
    let mut bytes = stream(8);
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x55;
    let reader = open(&bytes);
    let mut frame = null_mut();
    let status = loop {
        // SAFETY: the place is good.
        match unsafe { isv_reader_next_frame(reader, &mut frame) } {
            ISV_OK => ok(isv_frame_free(frame)),
            status => break status,
        }
    };
    fails(status, ISV_ERROR_STREAM, "");
    ok(isv_reader_free(reader));

    unsafe extern "C" fn note(user: *mut c_void, is_warning: i32, text: *const c_char) {
        // SAFETY: the test gives a list, and the library gives text.
        let (heard, text) = unsafe { (&*user.cast::<Mutex<Vec<(i32, String)>>>(), CStr::from_ptr(text)) };
        heard.lock().unwrap().push((is_warning, text.to_str().unwrap().to_owned()));
    }
    let heard: Mutex<Vec<(i32, String)>> = Mutex::default();
    let reader = open(&bytes);
    ok(isv_reader_set_after_loss(reader, ISV_AFTER_LOSS_HOLD));
    ok(isv_reader_set_event_callback(reader, Some(note), (&raw const heard).cast_mut().cast()));
    (0..8).for_each(|_| ok(isv_frame_free(next(reader))));
    ok(isv_reader_free(reader));
    let heard = heard.lock().unwrap();
    assert!(heard.iter().any(|(is_warning, text)| *is_warning == 1 && text.contains("lost")), "{heard:?}");
    fails(isv_reader_set_after_loss(null_mut(), 7), ISV_ERROR_OPTIONS, "7 is no isv_after_loss");
}

#[test]
fn wrong_options_are_refused_and_leave_what_was() {
    let options = options();
    let o = options;
    let wrong = [
        isv_encode_options_set_quality(o, -1.0),
        isv_encode_options_set_quality(o, f32::NAN),
        isv_encode_options_set_bitrate(o, 0.0),
        isv_encode_options_set_bitrate(o, f64::INFINITY),
        isv_encode_options_set_max_error(o, -0.001),
        isv_encode_options_set_colour_quality(o, 101.0),
        isv_encode_options_set_voxel(o, 0.0),
        isv_encode_options_set_voxel(o, -1.0),
        isv_encode_options_set_voxel(o, f64::NAN),
        isv_encode_options_set_fps(o, 0.0),
        isv_encode_options_set_fps(o, f64::NAN),
        isv_encode_options_set_preset(o, 3),
        isv_encode_options_set_preset(o, -1),
        isv_encode_options_set_keyframe_interval(o, 0),
        isv_encode_options_set_refresh(o, 2),
        isv_encode_options_set_sign(o, 4),
        isv_encode_options_set_timestamps(o, 3),
        isv_encode_options_set_device(o, 3),
        isv_encode_options_set_frames(o, 5, 3),
    ];
    for (number, status) in wrong.into_iter().enumerate() {
        assert_eq!(status, ISV_ERROR_OPTIONS, "number {number}");
    }
    assert!(message().contains("frames 5..3"), "{}", message());
    // SAFETY: texts and numbers are good, or null.
    unsafe {
        fails(isv_encode_options_set_unit(o, c"yd".as_ptr()), ISV_ERROR_OPTIONS, "unit `yd`");
        fails(isv_encode_options_set_unit(o, null()), ISV_ERROR_ARGUMENT, "unit is null");
        fails(isv_encode_options_set_up(o, c"w".as_ptr()), ISV_ERROR_OPTIONS, "axis `w`");
        fails(isv_encode_options_set_origin(o, [0.0, f64::NAN, 0.0].as_ptr()), ISV_ERROR_OPTIONS, "finite");
        fails(isv_encode_options_set_origin(o, null()), ISV_ERROR_ARGUMENT, "place_xyz is null");
        let numbers = [0.0_f64; 4];
        let askew = numbers.as_ptr().byte_add(1);
        fails(isv_encode_options_set_origin(o, askew), ISV_ERROR_ARGUMENT, "not a multiple of 8");
        fails(isv_encode_options_new(null_mut()), ISV_ERROR_ARGUMENT, "options is null");
    }
    let mut bytes = Vec::new();
    let writer = writer_to(&mut bytes, options);
    // SAFETY: the mesh and the report are good.
    unsafe {
        ok(isv_writer_push_mesh(writer, &Cuboid::new(0.0).mesh()));
        let mut report = sized!(isv_report);
        ok(isv_writer_finish(writer, &mut report));
        assert_eq!(report.voxel_m, 0.02, "the last good value holds");
    }
    ok(isv_writer_free(writer));
    // Whole takes alone can have these.
    for is_trial in [true, false] {
        ok(isv_encode_options_set_bitrate(options, 1e6));
        ok(match is_trial {
            true => isv_encode_options_set_voxel_by_trial(options),
            false => isv_encode_options_set_two_passes(options, 1),
        });
        let mut writer = null_mut();
        // SAFETY: the place is good.
        fails(
            unsafe { isv_writer_create_callback(Some(append), null_mut(), options, &mut writer) },
            ISV_ERROR_OPTIONS,
            "",
        );
        assert!(writer.is_null());
        ok(isv_encode_options_set_voxel(options, 0.02));
        ok(isv_encode_options_set_two_passes(options, 0));
    }
    ok(isv_encode_options_free(options));
}

#[test]
fn options_are_those_of_the_library() {
    let options = options();
    for status in [
        isv_encode_options_set_colour(options, 0),
        isv_encode_options_set_preset(options, ISV_PRESET_REALTIME),
        isv_encode_options_set_sign(options, ISV_SIGN_CLOSED),
        isv_encode_options_set_fps(options, 24.0),
        isv_encode_options_set_checksums(options, 1),
        isv_encode_options_set_bitrate(options, 400e3),
    ] {
        ok(status);
    }
    let mut bytes = Vec::new();
    let writer = writer_to(&mut bytes, options);
    ok(isv_encode_options_free(options));
    use isv::Quantity;
    let own = isv::EncodeOptions::bitrate(400.kbps())
        .voxel(20.mm())
        .gop(4)
        .without_colour()
        .fps(24)
        .checksums(true);
    let own = own.preset(isv::Preset::Realtime).sign(isv::SignMode::Closed);
    let mut library = isv::Writer::new(Vec::new(), &own).unwrap();
    for frame in 0..6 {
        let cuboid = Cuboid::new(0.01 * frame as f32);
        // SAFETY: the mesh is good.
        ok(unsafe { isv_writer_push_mesh(writer, &cuboid.mesh()) });
        let positions = cuboid.positions.as_chunks().0.to_vec();
        let triangles = cuboid.indices.as_chunks().0.to_vec();
        library.push_mesh(&isv::Mesh { positions, triangles, ..isv::Mesh::default() }).unwrap();
    }
    // SAFETY: no report is wanted.
    ok(unsafe { isv_writer_finish(writer, null_mut()) });
    ok(isv_writer_free(writer));
    assert!(bytes == library.into_inner().unwrap().0);
}

#[test]
fn a_wrong_mesh_costs_itself_alone() {
    let mut bytes = Vec::new();
    let options = options();
    let writer = writer_to(&mut bytes, options);
    ok(isv_encode_options_free(options));
    let cuboid = Cuboid::new(0.0);
    let good = cuboid.mesh();
    let not_finite = Cuboid::new(f32::NAN);
    let far = Cuboid::new(1e30);
    let indices = [0_u32, 1, 99];
    // SAFETY: arrays are good, or wrong in ways that are looked for.
    unsafe {
        ok(isv_writer_push_mesh(writer, &good));
        let refuse =
            |mesh: isv_mesh, status, words| fails(isv_writer_push_mesh(writer, &mesh), status, words);
        refuse(isv_mesh { positions: null(), ..good }, ISV_ERROR_ARGUMENT, "positions is null");
        refuse(isv_mesh { indices: null(), ..good }, ISV_ERROR_ARGUMENT, "indices is null");
        refuse(
            isv_mesh { positions: good.positions.byte_add(1), ..good },
            ISV_ERROR_ARGUMENT,
            "not a multiple of 4",
        );
        refuse(
            isv_mesh { vertex_count: -1_isize as usize, ..good },
            ISV_ERROR_ARGUMENT,
            "no memory holds as many",
        );
        refuse(
            isv_mesh { triangle_count: -1_isize as usize, ..good },
            ISV_ERROR_ARGUMENT,
            "no memory holds as many",
        );
        refuse(isv_mesh { struct_size: 0, ..good }, ISV_ERROR_ARGUMENT, "sizeof(isv_mesh)");
        refuse(isv_mesh { struct_size: usize::MAX, ..good }, ISV_ERROR_ARGUMENT, "no isv_mesh is that large");
        refuse(isv_mesh { indices: indices.as_ptr(), triangle_count: 1, ..good }, ISV_ERROR_FRAME, "99");
        refuse(not_finite.mesh(), ISV_ERROR_FRAME, "");
        refuse(far.mesh(), ISV_ERROR_FRAME, "");
        fails(isv_writer_push_mesh(writer, null()), ISV_ERROR_ARGUMENT, "isv_mesh is null");
        let points = isv_points { count: 8, positions: good.positions, ..sized!(isv_points) };
        fails(isv_writer_push_points(writer, &points), ISV_ERROR_FRAME, "");
        // A mesh without triangles is a frame.
        ok(isv_writer_push_mesh(writer, &sized!(isv_mesh)));
        let mut report = isv_report { struct_size: 8, ..sized!(isv_report) };
        fails(isv_writer_finish(writer, &mut report), ISV_ERROR_ARGUMENT, "isv_report.struct_size is 8");
        ok(isv_writer_push_mesh(writer, &good));
        report.struct_size = size_of::<isv_report>();
        ok(isv_writer_finish(writer, &mut report));
        assert_eq!((report.frames, report.empty), (3, 1));
        fails(isv_writer_push_mesh(writer, &good), ISV_ERROR_STATE, "finished");
        fails(isv_writer_finish(writer, null_mut()), ISV_ERROR_STATE, "finished");
    }
    ok(isv_writer_free(writer));
}

#[test]
fn times_are_kept() {
    let mut bytes = Vec::new();
    let writer = writer_to(&mut bytes, null());
    for time in [5_000_000_000, 5_100_000_000, 7_000_000_000] {
        // SAFETY: the mesh is good.
        ok(unsafe { isv_writer_push_mesh_at(writer, &Cuboid::new(0.0).mesh(), time) });
    }
    // SAFETY: no report is wanted.
    ok(unsafe { isv_writer_finish(writer, null_mut()) });
    ok(isv_writer_free(writer));
    let reader = open(&bytes);
    for expected in [0, 100_000_000, 2_000_000_000] {
        let frame = next(reader);
        let mut info = sized!(isv_frame_info);
        // SAFETY: the struct is good.
        ok(unsafe { isv_frame_get_info(frame, &mut info) });
        assert_eq!(info.timestamp_ns, expected);
        ok(isv_frame_free(frame));
    }
    ok(isv_reader_free(reader));
}

/// Lowest and highest x of the only frame of a stream.
fn extent(bytes: &[u8]) -> [f32; 2] {
    let reader = open(bytes);
    let (_, _, positions) = mesh_of_next(reader);
    ok(isv_reader_free(reader));
    let x = || positions.chunks(3).map(|p| p[0]);
    [x().fold(f32::MAX, f32::min), x().fold(f32::MIN, f32::max)]
}

#[track_caller]
fn assert_near(found: [f32; 2], expected: [f32; 2], tolerance: f32) {
    assert!(
        found.iter().zip(expected).all(|(a, b)| (a - b).abs() < tolerance),
        "{found:?}, not {expected:?}"
    );
}

#[test]
fn points_become_streams() {
    // A sphere of 0.3 m by a spiral.
    let place = |i: usize| {
        let (y, around) = (1.0 - 2.0 * (i as f32 + 0.5) / 4000.0, 2.399_963_2 * i as f32);
        let radius = (1.0 - y * y).sqrt();
        [radius * around.cos(), y, radius * around.sin()]
    };
    let normals: Vec<f32> = (0..4000).flat_map(place).collect();
    let positions: Vec<f32> = normals.iter().map(|c| 0.3 * c).collect();
    let colours = vec![200_u8; 12000];
    let viewpoint = [0.0_f32, 0.0, 5.0];
    let mut bytes = Vec::new();
    let options = options();
    let writer = writer_to(&mut bytes, options);
    let points = isv_points {
        count: 4000,
        positions: positions.as_ptr(),
        normals: normals.as_ptr(),
        colours: colours.as_ptr(),
        viewpoint: viewpoint.as_ptr(),
        ..sized!(isv_points)
    };
    // SAFETY: arrays are good, or null.
    unsafe {
        ok(isv_writer_push_points(writer, &points));
        let none = isv_points { positions: null(), ..points };
        fails(isv_writer_push_points(writer, &none), ISV_ERROR_ARGUMENT, "positions is null");
        let many = isv_points { count: usize::MAX / 2, ..points };
        fails(isv_writer_push_points(writer, &many), ISV_ERROR_ARGUMENT, "no memory holds as many");
        ok(isv_writer_finish(writer, null_mut()));
    }
    ok(isv_writer_free(writer));
    assert_near(extent(&bytes), [-0.3, 0.3], 0.02);
    let reader = open(&bytes);
    assert_eq!(info_of(reader).has_colour, 1);
    ok(isv_reader_free(reader));

    // Without normals they are estimated, if that is asked for.
    let bare = isv_points { normals: null(), colours: null(), ..points };
    ok(isv_encode_options_set_estimated_normals(options, 1));
    let mut bytes = Vec::new();
    let writer = writer_to(&mut bytes, options);
    // SAFETY: arrays are good, or null.
    unsafe {
        ok(isv_writer_push_points(writer, &isv_points { viewpoint: null(), ..bare }));
        ok(isv_writer_finish(writer, null_mut()));
    }
    ok(isv_writer_free(writer));
    ok(isv_encode_options_free(options));
    assert_near(extent(&bytes), [-0.3, 0.3], 0.03);
}

#[test]
fn depth_and_colour_images_become_streams() {
    // A wall 1 m before the camera.
    let (width, height) = (64, 48);
    let camera = isv_camera {
        width,
        height,
        focal: [60.0, 60.0],
        principal: [32.0, 24.0],
        camera_to_world: std::array::from_fn(|entry| if entry % 5 == 0 { 1.0 } else { 0.0 }),
    };
    let depths = vec![1.0_f32; (width * height) as usize];
    let colours = vec![90_u8; 3 * (width * height) as usize];
    let depth = isv_depth_image { camera, depths: depths.as_ptr() };
    let colour = isv_colour_image { camera, colours: colours.as_ptr(), depth_image: 0 };
    let mut bytes = Vec::new();
    let options = options();
    ok(isv_encode_options_set_voxel(options, 0.03));
    ok(isv_encode_options_set_max_depth(options, 3.0));
    ok(isv_encode_options_set_accumulated_depth(options, 0));
    let writer = writer_to(&mut bytes, options);
    ok(isv_encode_options_free(options));
    // SAFETY: arrays are good, or null.
    unsafe {
        ok(isv_writer_push_depth(writer, &depth, 1, &colour, 1));
        ok(isv_writer_push_depth(writer, &depth, 1, null(), 0));
        fails(isv_writer_push_depth(writer, &depth, 0, null(), 0), ISV_ERROR_ARGUMENT, "depth_count is 0");
        fails(
            isv_writer_push_depth(writer, null(), 1, null(), 0),
            ISV_ERROR_ARGUMENT,
            "depth_images is null",
        );
        fails(
            isv_writer_push_depth(writer, &depth, 1, null(), 1),
            ISV_ERROR_ARGUMENT,
            "colour_images is null",
        );
        let refuse_depth = |image: isv_depth_image, status, words: &str| {
            fails(isv_writer_push_depth(writer, &image, 1, null(), 0), status, words);
        };
        refuse_depth(isv_depth_image { depths: null(), ..depth }, ISV_ERROR_ARGUMENT, "depths is null");
        let flat = isv_camera { width: 0, ..camera };
        refuse_depth(isv_depth_image { camera: flat, ..depth }, ISV_ERROR_ARGUMENT, "0 x 48");
        let lens = isv_camera { focal: [f64::NAN, 1.0], ..camera };
        refuse_depth(isv_depth_image { camera: lens, ..depth }, ISV_ERROR_FRAME, "");
        let pose = isv_camera { camera_to_world: [f64::NAN; 16], ..camera };
        refuse_depth(isv_depth_image { camera: pose, ..depth }, ISV_ERROR_FRAME, "");
        let beside = isv_colour_image { depth_image: 1, ..colour };
        fails(isv_writer_push_depth(writer, &depth, 1, &beside, 1), ISV_ERROR_ARGUMENT, "depth_image is 1");
        let bare = isv_colour_image { colours: null(), ..colour };
        fails(isv_writer_push_depth(writer, &depth, 1, &bare, 1), ISV_ERROR_ARGUMENT, "colours is null");
        let mut report = sized!(isv_report);
        ok(isv_writer_finish(writer, &mut report));
        assert_eq!((report.frames, report.empty), (2, 0));
    }
    ok(isv_writer_free(writer));
    assert_near(extent(&bytes), [-0.53, 0.53], 0.06);
}

#[test]
fn dense_and_sparse_volumes_become_streams() {
    // A sphere of 0.2 m in a box of voxels of 1 cm, not in line with blocks.
    let (size, first) = ([51_u32, 52, 53], [-25_i32, -26, -27]);
    let mut distances = Vec::new();
    for z in 0..53 {
        for y in 0..52 {
            for x in 0..51 {
                let centre = |at: i32, first: i32| 0.01 * (at + first) as f32 + 0.005;
                let [x, y, z] = [centre(x, first[0]), centre(y, first[1]), centre(z, first[2])];
                distances.push((x * x + y * y + z * z).sqrt() - 0.2);
            }
        }
    }
    let dense = isv_dense_volume {
        voxel_m: 0.01,
        truncation_voxels: 8,
        size,
        first,
        distances: distances.as_ptr(),
        ..sized!(isv_dense_volume)
    };
    let mut bytes = Vec::new();
    let writer = writer_to(&mut bytes, null());
    // SAFETY: arrays are good, or null.
    unsafe {
        ok(isv_writer_push_dense_volume(writer, &dense));
        let refuse = |volume: isv_dense_volume, status, words: &str| {
            fails(isv_writer_push_dense_volume(writer, &volume), status, words);
        };
        refuse(isv_dense_volume { distances: null(), ..dense }, ISV_ERROR_ARGUMENT, "distances is null");
        refuse(
            isv_dense_volume { size: [u32::MAX; 3], ..dense },
            ISV_ERROR_ARGUMENT,
            "no memory holds as many",
        );
        refuse(isv_dense_volume { first: [i32::MAX; 3], ..dense }, ISV_ERROR_ARGUMENT, "too far away");
        refuse(isv_dense_volume { voxel_m: -1.0, ..dense }, ISV_ERROR_FRAME, "");
        refuse(isv_dense_volume { voxel_m: f64::NAN, ..dense }, ISV_ERROR_FRAME, "");
        refuse(isv_dense_volume { truncation_voxels: 99, ..dense }, ISV_ERROR_FRAME, "");
        let mut report = sized!(isv_report);
        ok(isv_writer_finish(writer, &mut report));
        assert_eq!((report.frames, report.voxel_m), (1, 0.01));
    }
    ok(isv_writer_free(writer));
    assert_near(extent(&bytes), [-0.2, 0.2], 0.005);

    // What comes out sparse goes in again.
    let reader = open(&bytes);
    let frame = next(reader);
    let mut sparse = sized!(isv_volume);
    // SAFETY: the struct is good.
    ok(unsafe { isv_frame_get_volume(frame, &mut sparse) });
    let mut again = Vec::new();
    let writer = writer_to(&mut again, null());
    // SAFETY: arrays are good, or null.
    unsafe {
        let refuse = |volume: isv_volume, status, words: &str| {
            fails(isv_writer_push_volume(writer, &volume), status, words);
        };
        refuse(isv_volume { coords: null(), ..sparse }, ISV_ERROR_ARGUMENT, "coords is null");
        refuse(isv_volume { distances: null(), ..sparse }, ISV_ERROR_ARGUMENT, "distances is null");
        refuse(isv_volume { block_edge: 5, ..sparse }, ISV_ERROR_ARGUMENT, "block_edge is 5");
        refuse(
            isv_volume { block_count: usize::MAX, ..sparse },
            ISV_ERROR_ARGUMENT,
            "no memory holds as many",
        );
        refuse(isv_volume { voxel_m: f64::INFINITY, ..sparse }, ISV_ERROR_FRAME, "");
        let twice = [0_i32; 6];
        refuse(
            isv_volume { block_count: 2, coords: twice.as_ptr(), ..sparse },
            ISV_ERROR_FRAME,
            "two blocks",
        );
        ok(isv_writer_push_volume(writer, &sparse));
        ok(isv_writer_finish(writer, null_mut()));
    }
    ok(isv_writer_free(writer));
    ok(isv_frame_free(frame));
    ok(isv_reader_free(reader));
    assert_near(extent(&again), [-0.2, 0.2], 0.01);
}

#[test]
fn handles_that_are_none_are_told_apart() {
    let bytes = stream(1);
    let reader = open(&bytes);
    let mut frame = null_mut();
    let local = 0_u64;
    // SAFETY: places are good. Handles are numbers, which are never followed.
    unsafe {
        let refuse = |reader: *mut isv_reader, words: &str| {
            let mut frame = null_mut();
            fails(isv_reader_next_frame(reader, &mut frame), ISV_ERROR_HANDLE, words);
            fails(isv_reader_seek(reader, 0), ISV_ERROR_HANDLE, words);
            fails(isv_reader_set_lod(reader, 1), ISV_ERROR_HANDLE, words);
            fails(isv_reader_info(reader, &mut sized!(isv_stream_info)), ISV_ERROR_HANDLE, words);
        };
        refuse(null_mut(), "isv_reader is null");
        refuse((&raw const local).cast_mut().cast(), "did not come from this library");
        refuse(77 as *mut isv_reader, "did not come from this library");
        refuse(usize::MAX as *mut isv_reader, "did not come from this library");
        let options = options();
        refuse(options.cast(), "isv_encode_options was given in place of an isv_reader");
        fails(isv_reader_free(options.cast()), ISV_ERROR_HANDLE, "in place of");
        ok(isv_encode_options_free(options));
        fails(isv_encode_options_free(options), ISV_ERROR_HANDLE, "freed before");
        ok(isv_reader_next_frame(reader, &mut frame));
        ok(isv_reader_free(reader));
        refuse(reader, "freed before");
        fails(isv_reader_free(reader), ISV_ERROR_HANDLE, "freed before");
        fails(isv_reader_next_frame(reader, null_mut()), ISV_ERROR_ARGUMENT, "frame is null");
        ok(isv_frame_free(frame));
        fails(isv_frame_get_mesh(frame, &mut sized!(isv_mesh)), ISV_ERROR_HANDLE, "freed before");
        fails(isv_frame_get_info(null(), &mut sized!(isv_frame_info)), ISV_ERROR_HANDLE, "isv_frame is null");
        fails(isv_writer_push_mesh(null_mut(), null()), ISV_ERROR_HANDLE, "isv_writer is null");
        fails(isv_writer_finish(null_mut(), null_mut()), ISV_ERROR_HANDLE, "isv_writer is null");
        let mut writer = null_mut();
        fails(
            isv_writer_create_callback(Some(append), null_mut(), frame.cast(), &mut writer),
            ISV_ERROR_HANDLE,
            "isv_encode_options was freed before",
        );
        fails(
            isv_writer_create_callback(None, null_mut(), null(), &mut writer),
            ISV_ERROR_ARGUMENT,
            "callback is null",
        );
    }
    // Null may be freed: it is what a failed call leaves.
    ok(isv_reader_free(null_mut()));
    ok(isv_writer_free(null_mut()));
    ok(isv_frame_free(null_mut()));
    ok(isv_encode_options_free(null_mut()));
    ok(isv_decode_options_free(null_mut()));
    ok(isv_text_free(null()));
    fails(isv_text_free(c"mine".as_ptr()), ISV_ERROR_HANDLE, "no text of this library");
}

/// User data of a write callback: a writer that it calls, and the status of that call.
struct Loop {
    writer: *mut isv_writer,
    found: isv_status,
}

#[test]
fn a_handle_serves_one_call_at_a_time() {
    unsafe extern "C" fn call_again(user: *mut c_void, _: *const u8, _: usize) -> i32 {
        // SAFETY: the test gives a loop, and the mesh is good.
        unsafe {
            let around = &mut *user.cast::<Loop>();
            around.found = isv_writer_push_mesh(around.writer, &Cuboid::new(0.0).mesh());
        }
        0
    }
    let mut around = Loop { writer: null_mut(), found: ISV_OK };
    let user = (&raw mut around).cast();
    // SAFETY: the loop outlives the writer, and meshes are good.
    unsafe {
        ok(isv_writer_create_callback(Some(call_again), user, null(), &raw mut around.writer));
        ok(isv_writer_push_mesh(around.writer, &Cuboid::new(0.0).mesh()));
        ok(isv_writer_finish(around.writer, null_mut()));
    }
    fails(around.found, ISV_ERROR_BUSY, "one call at a time");
    ok(isv_writer_free(around.writer));
}

#[test]
fn a_writer_may_be_freed_by_its_own_callback() {
    unsafe extern "C" fn free(user: *mut c_void, _: *const u8, _: usize) -> i32 {
        // SAFETY: the test gives a loop.
        let around = unsafe { &mut *user.cast::<Loop>() };
        around.found = isv_writer_free(around.writer);
        0
    }
    let mut around = Loop { writer: null_mut(), found: ISV_END };
    let user = (&raw mut around).cast();
    // SAFETY: the loop outlives the writer, and the mesh is good.
    unsafe {
        ok(isv_writer_create_callback(Some(free), user, null(), &raw mut around.writer));
        ok(isv_writer_push_mesh(around.writer, &Cuboid::new(0.0).mesh()));
        fails(isv_writer_finish(around.writer, null_mut()), ISV_ERROR_HANDLE, "freed before");
    }
}

#[test]
fn a_sink_that_fails_ends_the_stream() {
    unsafe extern "C" fn refuse(_: *mut c_void, _: *const u8, _: usize) -> i32 {
        28
    }
    let mut writer = null_mut();
    // SAFETY: the place and the mesh are good.
    unsafe {
        ok(isv_writer_create_callback(Some(refuse), null_mut(), null(), &mut writer));
        let cuboid = Cuboid::new(0.0);
        fails(
            isv_writer_push_mesh(writer, &cuboid.mesh()),
            ISV_ERROR_OUTPUT,
            "the write callback returned 28",
        );
        fails(isv_writer_push_mesh(writer, &cuboid.mesh()), ISV_ERROR_OUTPUT, "");
        fails(isv_writer_finish(writer, null_mut()), ISV_ERROR_OUTPUT, "");
    }
    ok(isv_writer_free(writer));
}

#[test]
fn threads_share_frames_and_have_handles_of_their_own() {
    let bytes = stream(4);
    let shared = open(&bytes);
    let frame = next(shared) as usize;
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..4)
            .map(|_| {
                scope.spawn(|| {
                    let reader = open(&bytes);
                    let all: Vec<_> = (0..4).map(|_| mesh_of_next(reader)).collect();
                    ok(isv_reader_free(reader));
                    let mesh = mesh_of(frame as *const isv_frame);
                    (all, mesh.positions as usize)
                })
            })
            .collect();
        let found: Vec<_> = threads.into_iter().map(|thread| thread.join().unwrap()).collect();
        assert!(found.iter().all(|one| *one == found[0]), "all threads see the same");
    });
    ok(isv_frame_free(frame as *mut isv_frame));
    ok(isv_reader_free(shared));
}

#[test]
fn a_stream_without_frames_has_a_start() {
    let reader = open(&stream(0));
    assert_eq!(info_of(reader).frame_count, 0);
    for _ in 0..2 {
        let mut frame = null_mut();
        // SAFETY: the place is good.
        assert_eq!(unsafe { isv_reader_next_frame(reader, &mut frame) }, ISV_END);
        ok(isv_reader_seek(reader, 0));
    }
    fails(isv_reader_seek(reader, 1), ISV_ERROR_OPTIONS, "there are 0");
    ok(isv_reader_free(reader));
}

#[test]
fn a_reader_may_be_freed_while_another_thread_decodes() {
    let reader = open(&stream(8)) as usize;
    let decoder = std::thread::spawn(move || {
        loop {
            let mut frame = null_mut();
            // SAFETY: the place is good, and a handle is a number.
            match unsafe { isv_reader_next_frame(reader as *mut isv_reader, &mut frame) } {
                ISV_OK => ok(isv_frame_free(frame)),
                ISV_END => ok(isv_reader_seek(reader as *mut isv_reader, 0)),
                status => break (status, message()),
            }
        }
    });
    std::thread::sleep(std::time::Duration::from_millis(100));
    ok(isv_reader_free(reader as *mut isv_reader));
    let (status, message) = decoder.join().unwrap();
    assert_eq!((status, &*message), (ISV_ERROR_HANDLE, "the isv_reader was freed before"));
}

#[test]
fn the_end_of_a_stream_without_index_stays_the_end() {
    let bytes = stream(3);
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), &bytes).unwrap();
    let mut json = null();
    // SAFETY: the text and the place are good.
    let packets: serde_json::Value = unsafe {
        ok(isv_info_json(c_path(file.path()).as_ptr(), &mut json));
        serde_json::from_str(CStr::from_ptr(json).to_str().unwrap()).unwrap()
    };
    ok(isv_text_free(json));
    let frames =
        packets["packets"].as_array().unwrap().iter().map(|packet| packet["bytes"].as_u64().unwrap());
    // A header of 48 bytes, the frames, and no index.
    let cut = 48 + frames.sum::<u64>() as usize;
    assert!(cut < bytes.len());
    let reader = open(&bytes[..cut]);
    for _ in 0..2 {
        (0..3).for_each(|_| ok(isv_frame_free(next(reader))));
        for _ in 0..2 {
            let mut frame = null_mut();
            // SAFETY: the place is good.
            assert_eq!(unsafe { isv_reader_next_frame(reader, &mut frame) }, ISV_END);
            ok(isv_reader_set_lod(reader, 2));
        }
        ok(isv_reader_seek(reader, 0));
    }
    ok(isv_reader_free(reader));
}

/// Structs of a newer header go into this library, if their new members are 0.
#[test]
fn structs_of_newer_headers_are_taken() {
    #[repr(C)]
    struct Newer<T> {
        known: T,
        unknown: [u64; 2],
    }
    let mut bytes = Vec::new();
    let writer = writer_to(&mut bytes, null());
    let cuboid = Cuboid::new(0.0);
    let mut mesh = Newer { known: cuboid.mesh(), unknown: [0; 2] };
    mesh.known.struct_size = size_of_val(&mesh);
    let mut report = Newer { known: sized!(isv_report), unknown: [7; 2] };
    report.known.struct_size = size_of_val(&report);
    // SAFETY: structs are good, and as large as they say.
    unsafe {
        ok(isv_writer_push_mesh(writer, (&raw const mesh).cast()));
        mesh.unknown[1] = 1;
        fails(isv_writer_push_mesh(writer, (&raw const mesh).cast()), ISV_ERROR_ARGUMENT, "does not know");
        ok(isv_writer_finish(writer, (&raw mut report).cast()));
    }
    assert_eq!((report.known.frames, report.unknown), (1, [0; 2]));
    assert_eq!(report.known.struct_size, size_of_val(&report));
    ok(isv_writer_free(writer));
}

/// Writes meshes as OBJ files.
fn folder_of_meshes(frames: usize) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for frame in 0..frames {
        let cuboid = Cuboid::new(0.01 * frame as f32);
        let vertices = cuboid.positions.chunks(3).map(|p| format!("v {} {} {}\n", p[0], p[1], p[2]));
        let faces = cuboid.indices.chunks(3).map(|t| format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1));
        let text: String = vertices.chain(faces).collect();
        std::fs::write(folder.path().join(format!("frame_{frame:04}.obj")), text).unwrap();
    }
    folder
}

/// Stops a job after so many frames.
unsafe extern "C" fn stop(user: *mut c_void, done: u64, total: u64) -> i32 {
    // SAFETY: the tests give numbers.
    let (most, seen) = unsafe { *user.cast::<(u64, *mut u64)>() };
    // SAFETY: as above.
    unsafe { *seen = total };
    i32::from(done >= most)
}

#[test]
fn takes_are_encoded_and_decoded_and_can_be_stopped() {
    let folder = folder_of_meshes(20);
    let output = folder.path().join("take.isv");
    let (input, stream, meshes) =
        (c_path(folder.path()), c_path(&output), c_path(&folder.path().join("meshes")));
    let options = options();
    let mut report = sized!(isv_report);
    // SAFETY: texts and structs are good, or null.
    unsafe {
        ok(isv_encode_take(input.as_ptr(), stream.as_ptr(), options, &mut report));
        assert_eq!((report.frames, report.is_cancelled), (20, 0));
        assert_eq!(report.bytes, output.metadata().unwrap().len());

        let mut json = null();
        ok(isv_info_json(stream.as_ptr(), &mut json));
        let text: serde_json::Value = serde_json::from_str(CStr::from_ptr(json).to_str().unwrap()).unwrap();
        assert_eq!((&text["frames"], &text["voxel_size_m"]), (&20.into(), &0.02.into()));
        ok(isv_text_free(json));
        fails(isv_text_free(json), ISV_ERROR_HANDLE, "freed before");
        fails(isv_info_json(stream.as_ptr(), null_mut()), ISV_ERROR_ARGUMENT, "json is null");

        let mut wanted = null_mut();
        ok(isv_decode_options_new(&mut wanted));
        ok(isv_decode_options_set_frames(wanted, 2, 5));
        ok(isv_decode_options_set_format(wanted, c"obj".as_ptr()));
        ok(isv_decode_options_set_unit(wanted, c"cm".as_ptr()));
        let mut decoded = sized!(isv_decode_report);
        ok(isv_decode_take(stream.as_ptr(), meshes.as_ptr(), wanted, &mut decoded));
        assert_eq!((decoded.frames, decoded.is_cancelled), (3, 0));
        assert_eq!(folder.path().join("meshes").read_dir().unwrap().count(), 3);
        for status in [
            isv_decode_options_set_frames(wanted, 5, 5),
            isv_decode_options_set_format(wanted, c"usd".as_ptr()),
            isv_decode_options_set_point_count(wanted, 0),
            isv_decode_options_set_point_spacing(wanted, f64::NAN),
            isv_decode_options_set_target_faces(wanted, 0),
            isv_decode_options_set_simplify(wanted, -1.0),
            isv_decode_options_set_lod(wanted, 3),
            isv_decode_options_set_after_loss(wanted, 2),
            isv_decode_options_set_device(wanted, -1),
            isv_decode_options_set_unit(wanted, c"yd".as_ptr()),
            isv_decode_options_set_up(wanted, c"up".as_ptr()),
            isv_decode_options_set_origin(wanted, [f64::NAN; 3].as_ptr()),
        ] {
            assert_eq!(status, ISV_ERROR_OPTIONS, "{}", message());
        }
        // Points and fields exclude each other: the last one holds.
        ok(isv_decode_options_set_fields(wanted, 1));
        ok(isv_decode_options_set_point_count(wanted, 50));
        ok(isv_decode_options_set_format(wanted, c"xyz".as_ptr()));
        let points = folder.path().join("points");
        ok(isv_decode_take(stream.as_ptr(), c_path(&points).as_ptr(), wanted, null_mut()));
        let text = std::fs::read_to_string(points.join("frame_0002.xyz")).unwrap();
        assert_eq!(text.lines().filter(|line| !line.starts_with('#')).count(), 50);
        let mut total = 0_u64;
        let mut most = (1_u64, &raw mut total);
        ok(isv_decode_options_set_progress_callback(wanted, Some(stop), (&raw mut most).cast()));
        ok(isv_decode_take(stream.as_ptr(), c_path(&points).as_ptr(), wanted, &mut decoded));
        assert_eq!((decoded.frames, decoded.is_cancelled, total), (1, 1, 3));
        ok(isv_decode_options_free(wanted));

        most.0 = 3;
        ok(isv_encode_options_set_progress_callback(options, Some(stop), (&raw mut most).cast()));
        ok(isv_encode_take(input.as_ptr(), stream.as_ptr(), options, &mut report));
        assert!(
            report.is_cancelled == 1 && (3..20).contains(&report.frames) && total == 20,
            "{}",
            report.frames
        );
        fails(
            isv_encode_take(null(), stream.as_ptr(), options, null_mut()),
            ISV_ERROR_ARGUMENT,
            "input is null",
        );
        fails(
            isv_encode_take(input.as_ptr(), null(), options, null_mut()),
            ISV_ERROR_ARGUMENT,
            "output is null",
        );
        let none = c_path(&folder.path().join("none"));
        fails(isv_encode_take(none.as_ptr(), stream.as_ptr(), null(), null_mut()), ISV_ERROR_INPUT, "none");
        fails(isv_decode_take(none.as_ptr(), meshes.as_ptr(), null(), null_mut()), ISV_ERROR_INPUT, "none");
    }
    ok(isv_encode_options_free(options));
}

#[test]
fn a_file_appears_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("take.isv");
    let text = c_path(&path);
    let mut writer = null_mut();
    // SAFETY: texts, places and meshes are good.
    unsafe {
        ok(isv_writer_create(text.as_ptr(), null(), &mut writer));
        ok(isv_writer_push_mesh(writer, &Cuboid::new(0.0).mesh()));
        assert!(!path.exists());
        ok(isv_writer_finish(writer, null_mut()));
        assert!(path.exists());
        ok(isv_writer_free(writer));
        // One that is not finished leaves nothing.
        ok(isv_writer_create(c_path(&folder.path().join("other.isv")).as_ptr(), null(), &mut writer));
        ok(isv_writer_free(writer));
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
        let nowhere = c_path(&folder.path().join("no/such/folder.isv"));
        fails(isv_writer_create(nowhere.as_ptr(), null(), &mut writer), ISV_ERROR_OUTPUT, "folder.isv");
        assert!(writer.is_null());
        fails(isv_writer_create(null(), null(), &mut writer), ISV_ERROR_ARGUMENT, "path is null");
    }
}

#[test]
fn results_have_names() {
    let name = |status| {
        // SAFETY: the text is never freed.
        unsafe { CStr::from_ptr(isv_status_name(status)) }.to_str().unwrap().to_owned()
    };
    let names: std::collections::BTreeSet<_> = (ISV_ERROR_INTERNAL..=ISV_END).map(name).collect();
    assert_eq!(names.len(), 15);
    assert_eq!((&*name(ISV_ERROR_FRAME), &*name(-99)), ("ISV_ERROR_FRAME", "unknown"));
}

#[test]
fn threads_start_once() {
    fails(isv_set_thread_count(0), ISV_ERROR_ARGUMENT, "0 threads");
    fails(isv_set_thread_count(u32::MAX), ISV_ERROR_ARGUMENT, "threads");
    stream(1);
    fails(isv_set_thread_count(2), ISV_ERROR_STATE, "threads");
}
