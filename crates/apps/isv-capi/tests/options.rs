//! Options: wrong values are refused and leave what was, right ones reach the library.

mod support;

use isv_capi::*;
use std::ptr::{null, null_mut};
use support::{Cuboid, append, fails, message, ok, options, sized, writer_to};

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
        isv_encode_options_set_metadata(o, 3),
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
        fails(isv_encode_options_set_title(o, null()), ISV_ERROR_ARGUMENT, "title is null");
        fails(isv_encode_options_set_capture_device(o, null()), ISV_ERROR_ARGUMENT, "device is null");
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
