//! Streams to frames, as C programs read them: arrays, seeks, sources, damage.

mod support;

use isv_capi::*;
use std::ffi::{CStr, c_char, c_void};
use std::ptr::{null, null_mut};
use std::sync::Mutex;
use support::{
    array, c_path, fails, info_of, mesh_of, mesh_of_next, next, number_of, ok, open, sized, stream,
};

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
fn the_end_of_a_stream_without_index_stays_the_end() {
    let bytes = stream(3);
    // The trailer says where the index begins.
    let trailer = bytes.len() - 16;
    let cut = u64::from_le_bytes(bytes[trailer..trailer + 8].try_into().unwrap()) as usize;
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
