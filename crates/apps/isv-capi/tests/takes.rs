//! Whole takes: folders of files to a stream, and a stream to files.

mod support;

use isv_capi::*;
use std::ffi::{CStr, c_void};
use std::ptr::{null, null_mut};
use support::{Cuboid, c_path, fails, message, ok, options, sized};

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
        ok(isv_encode_options_set_title(options, c"Two cuboids".as_ptr()));
        ok(isv_encode_options_set_capture_device(options, c"none".as_ptr()));
        ok(isv_encode_options_set_metadata(options, ISV_METADATA_ALWAYS));
        ok(isv_encode_take(input.as_ptr(), stream.as_ptr(), options, &mut report));
        assert_eq!((report.frames, report.is_cancelled), (20, 0));
        assert_eq!(report.bytes, output.metadata().unwrap().len());

        let mut json = null();
        ok(isv_info_json(stream.as_ptr(), &mut json));
        let text: serde_json::Value = serde_json::from_str(CStr::from_ptr(json).to_str().unwrap()).unwrap();
        assert_eq!((&text["frames"], &text["voxel_size_m"]), (&20.into(), &0.02.into()));
        let metadata = &text["metadata"];
        assert_eq!((&metadata["title"], &metadata["device"]), (&"Two cuboids".into(), &"none".into()));
        ok(isv_text_free(json));
        fails(isv_text_free(json), ISV_ERROR_HANDLE, "freed before");

        let bare = c_path(&folder.path().join("bare.isv"));
        ok(isv_encode_options_set_metadata(options, ISV_METADATA_NEVER));
        ok(isv_encode_take(input.as_ptr(), bare.as_ptr(), options, &mut report));
        ok(isv_info_json(bare.as_ptr(), &mut json));
        let text: serde_json::Value = serde_json::from_str(CStr::from_ptr(json).to_str().unwrap()).unwrap();
        assert!(text["metadata"].is_null(), "{text}");
        ok(isv_text_free(json));
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
fn streams_are_cut_joined_repaired_put_into_mp4_and_measured() {
    let folder = folder_of_meshes(6);
    let inside = |name: &str| folder.path().join(name);
    let options = options();
    let (input, stream) = (c_path(folder.path()), c_path(&inside("take.isv")));
    let frames_of = |name: &str| {
        let mut json = null();
        // SAFETY: the text and the place are good.
        unsafe { ok(isv_info_json(c_path(&inside(name)).as_ptr(), &mut json)) };
        // SAFETY: the text was just given.
        let text: serde_json::Value =
            serde_json::from_str(unsafe { CStr::from_ptr(json) }.to_str().unwrap()).unwrap();
        ok(isv_text_free(json));
        text["frames"].as_u64().unwrap()
    };
    // SAFETY: texts and places are good, or null.
    unsafe {
        ok(isv_encode_options_set_keyframe_interval(options, 3));
        ok(isv_encode_take(input.as_ptr(), stream.as_ptr(), options, null_mut()));
        let (a, b, both) = (c_path(&inside("a.isv")), c_path(&inside("b.isv")), c_path(&inside("ab.isv")));
        let mut count = 0;
        ok(isv_cut(stream.as_ptr(), 0, 3, a.as_ptr(), &mut count));
        ok(isv_cut(stream.as_ptr(), 3, u64::MAX, b.as_ptr(), null_mut()));
        assert_eq!((count, frames_of("b.isv")), (3, 3));
        fails(isv_cut(stream.as_ptr(), 1, 3, a.as_ptr(), null_mut()), ISV_ERROR_STREAM, "no keyframe");
        fails(isv_cut(stream.as_ptr(), 3, 3, a.as_ptr(), null_mut()), ISV_ERROR_OPTIONS, "3..3");
        fails(isv_cut(null(), 0, 3, a.as_ptr(), null_mut()), ISV_ERROR_ARGUMENT, "input is null");
        let parts = [a.as_ptr(), b.as_ptr()];
        ok(isv_join(parts.as_ptr(), 2, both.as_ptr(), &mut count));
        assert_eq!(count, 6);
        assert!(std::fs::read(inside("ab.isv")).unwrap() == std::fs::read(inside("take.isv")).unwrap());
        fails(isv_join(parts.as_ptr(), 0, both.as_ptr(), null_mut()), ISV_ERROR_OPTIONS, "no stream to join");
        fails(isv_join(null(), 2, both.as_ptr(), null_mut()), ISV_ERROR_ARGUMENT, "inputs is null");
        fails(
            isv_join([null()].as_ptr(), 1, both.as_ptr(), null_mut()),
            ISV_ERROR_ARGUMENT,
            "an input is null",
        );

        let mut bytes = std::fs::read(inside("take.isv")).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        std::fs::write(inside("damaged.isv"), bytes).unwrap();
        let (damaged, mended) = (c_path(&inside("damaged.isv")), c_path(&inside("mended.isv")));
        ok(isv_repair(damaged.as_ptr(), null(), mended.as_ptr(), &mut count));
        assert!((1..6).contains(&count) && frames_of("mended.isv") == count, "{count}");

        let (mp4, back) = (c_path(&inside("take.mp4")), c_path(&inside("back.isv")));
        ok(isv_mux(stream.as_ptr(), null(), mp4.as_ptr(), &mut count));
        ok(isv_demux(mp4.as_ptr(), back.as_ptr()));
        assert!(std::fs::read(inside("back.isv")).unwrap() == std::fs::read(inside("take.isv")).unwrap());
        fails(isv_demux(stream.as_ptr(), back.as_ptr()), ISV_ERROR_STREAM, "not an MP4 file");
        fails(
            isv_mux(stream.as_ptr(), stream.as_ptr(), mp4.as_ptr(), null_mut()),
            ISV_ERROR_INPUT,
            "take.isv",
        );

        let mut json = null();
        ok(isv_evaluate_json(stream.as_ptr(), mp4.as_ptr(), 0.01, &mut json));
        let text: serde_json::Value = serde_json::from_str(CStr::from_ptr(json).to_str().unwrap()).unwrap();
        assert_eq!(text["frames"].as_array().unwrap().len(), 6);
        assert!(text["p2s_mean_mm"].as_f64().unwrap() < 1e-9, "one is the other: {text}");
        ok(isv_text_free(json));
        fails(
            isv_evaluate_json(stream.as_ptr(), mp4.as_ptr(), 0.0, &mut json),
            ISV_ERROR_OPTIONS,
            "spacing 0",
        );
        assert!(json.is_null());
    }
    ok(isv_encode_options_free(options));
}
