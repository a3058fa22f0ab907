//! Frames to streams, as C programs write them: each kind of frame, wrong ones, sinks and files.

mod support;

use isv_capi::*;
use std::ffi::c_void;
use std::ptr::{null, null_mut};
use support::{Cuboid, c_path, fails, info_of, mesh_of_next, next, ok, open, options, sized, writer_to};

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

/// Checks that a call that pushes a frame at a time keeps it.
#[track_caller]
fn keeps_times(push: impl Fn(*mut isv_writer, u64) -> isv_status) {
    let mut bytes = Vec::new();
    let writer = writer_to(&mut bytes, null());
    for time in [5_000_000_000, 5_100_000_000, 7_000_000_000] {
        ok(push(writer, time));
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

#[test]
fn times_are_kept() {
    // SAFETY: the mesh is good.
    keeps_times(|writer, time| unsafe { isv_writer_push_mesh_at(writer, &Cuboid::new(0.0).mesh(), time) });
    let positions: Vec<f32> = (0..300).map(|i| (i % 100) as f32 * 0.005).collect();
    let points = isv_points { count: 100, positions: positions.as_ptr(), ..sized!(isv_points) };
    // SAFETY: the array is good.
    keeps_times(|writer, time| unsafe { isv_writer_push_points_at(writer, &points, time) });
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
    fails(isv_encode_options_set_max_depth(options, -1.0), ISV_ERROR_OPTIONS, "max-depth: a length above 0");
    ok(isv_encode_options_set_max_depth(options, 3.0));
    ok(isv_encode_options_set_accumulated_depth(options, 0));
    let writer = writer_to(&mut bytes, options);
    ok(isv_encode_options_free(options));
    // SAFETY: arrays are good, or null.
    unsafe {
        ok(isv_writer_push_depth(writer, &depth, 1, &colour, 1));
        ok(isv_writer_push_depth(writer, &depth, 1, null(), 0));
        fails(isv_writer_push_depth(writer, &depth, 0, null(), 0), ISV_ERROR_ARGUMENT, "depth_count is 0");
        let huge = isv_camera { width: 1 << 16, height: 1 << 16, ..camera };
        let huge = isv_depth_image { camera: huge, ..depth };
        fails(
            isv_writer_push_depth(writer, &huge, 1, null(), 0),
            ISV_ERROR_ARGUMENT,
            "an image is 65536 x 65536 pixels",
        );
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
    // SAFETY: arrays are good.
    keeps_times(|writer, time| unsafe { isv_writer_push_depth_at(writer, &depth, 1, &colour, 1, time) });
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
    // SAFETY: the array is good.
    keeps_times(|writer, time| unsafe { isv_writer_push_dense_volume_at(writer, &dense, time) });

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
    // SAFETY: arrays are good.
    keeps_times(|writer, time| unsafe { isv_writer_push_volume_at(writer, &sparse, time) });
    ok(isv_frame_free(frame));
    ok(isv_reader_free(reader));
    assert_near(extent(&again), [-0.2, 0.2], 0.01);
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
