//! What is written as GLB, read back.

use glam::{DVec3, Vec3};
use isv_io::{
    Animation, Format, FrameSequence, GlbAnimationWriter, GlbEncoding, Placement, Unit, WriteError,
    parse_mesh, read_mesh, write_glb_to, write_mesh_to,
};
use isv_testkit::capture;
use isv_volume::TriangleMesh;
use serde_json::Value;
use std::path::Path;

/// A zigzag band of `triangles` triangles at a height.
fn band(triangles: u32, height: f64) -> TriangleMesh {
    let vertex = |i: u32| DVec3::new(f64::from(i) * 0.1, f64::from(i % 2), height);
    TriangleMesh {
        vertices: (0..triangles + 2).map(vertex).collect(),
        normals: Vec::new(),
        triangles: (0..triangles).map(|i| [i, i + 1, i + 2]).collect(),
        appearance: None,
    }
}

fn glb(mesh: &TriangleMesh) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_mesh_to(&mut bytes, mesh, Format::Glb).unwrap();
    bytes
}

/// The JSON of a file whose lengths are right.
fn json(glb: &[u8]) -> Value {
    let word = |at: usize| u32::from_le_bytes(*glb[at..].first_chunk().unwrap()) as usize;
    assert_eq!((&glb[..4], word(4), word(8)), (&b"glTF"[..], 2, glb.len()));
    let json_bytes = word(12);
    assert_eq!(&glb[16..20], b"JSON");
    let binary = 20 + json_bytes;
    if binary < glb.len() {
        assert_eq!((word(binary), &glb[binary + 4..binary + 8]), (glb.len() - binary - 8, &b"BIN\0"[..]));
    }
    assert!(binary.is_multiple_of(4) && glb.len().is_multiple_of(4));
    serde_json::from_slice(&glb[20..binary]).unwrap()
}

fn single(mesh: &TriangleMesh) -> Vec<Vec3> {
    mesh.vertices.iter().map(|v| v.as_vec3()).collect()
}

#[test]
fn indices_are_as_short_as_they_can_be_and_bounds_exact() {
    // The index 65535 is reserved, so that 65535 vertices are the most of the short ones.
    for (triangles, component) in [(3, 5123), (65_533, 5123), (65_534, 5125)] {
        let mesh = band(triangles, 0.3);
        let bytes = glb(&mesh);
        let json = json(&bytes);
        assert_eq!(json["accessors"][1]["componentType"], component);
        assert_eq!(json["accessors"][0]["min"][2], f64::from(0.3f32), "to the last bit");
        assert_eq!(json["accessors"][0]["max"][1], 1.0);
        let read = parse_mesh(Path::new("a.glb"), &bytes, Unit::Metre).unwrap();
        assert_eq!((single(&read), &read.triangles), (single(&mesh), &mesh.triangles));
    }
}

#[test]
fn normals_are_written_at_length_one_or_not_at_all() {
    let mut mesh = band(1, 0.0);
    mesh.normals = vec![DVec3::new(0.0, 0.0, 3.0); 3];
    let bytes = glb(&mesh);
    let normals = json(&bytes)["meshes"][0]["primitives"][0]["attributes"]["NORMAL"].as_u64();
    assert_eq!(normals, Some(1));
    let start = bytes.len() - 8 - 36;
    let z = f32::from_le_bytes(*bytes[start + 8..].first_chunk().unwrap());
    assert_eq!(z, 1.0);
    mesh.normals[1] = DVec3::ZERO;
    assert!(json(&glb(&mesh))["meshes"][0]["primitives"][0]["attributes"]["NORMAL"].is_null());
}

#[test]
fn a_mesh_without_triangles_is_a_node_that_shows_nothing() {
    let json = json(&glb(&TriangleMesh::default()));
    assert_eq!((json["nodes"].as_array().unwrap().len(), &json["meshes"]), (1, &Value::Null));
}

#[test]
fn positions_beyond_single_precision_are_refused() {
    let error = write_mesh_to(Vec::new(), &band(1, 1e300), Format::Glb).unwrap_err();
    assert_eq!(error.to_string(), "vertex 0 has no finite position in single precision");
}

/// Far from the origin, where single precision would show.
fn far_band(triangles: u32, height: f64) -> TriangleMesh {
    let mut mesh = band(triangles, height);
    mesh.vertices.iter_mut().for_each(|v| *v += DVec3::new(-400.0, 30.0, 7000.0));
    mesh.normals = vec![DVec3::new(0.6, 0.0, -0.8); mesh.vertices.len()];
    mesh
}

/// Half a step of the longest side, and rounding.
fn most_error(mesh: &TriangleMesh) -> f64 {
    let (low, high) = mesh.bounds().unwrap();
    let half = 0.5 / 65535.0 * (high - low).max_element();
    half + 1e-9 * high.abs().max(low.abs()).max_element()
}

/// The corners of triangles, one after the other.
fn corners(mesh: &TriangleMesh) -> Vec<[DVec3; 3]> {
    mesh.triangles.iter().map(|triangle| triangle.map(|v| mesh.vertices[v as usize])).collect()
}

/// Checks that each triangle of one mesh is one of the other, with the same front, within the error on each axis.
fn assert_near(found: &TriangleMesh, expected: &TriangleMesh) {
    let error = most_error(expected);
    assert_eq!(found.triangles.len(), expected.triangles.len());
    let mut left = corners(found);
    for triangle in corners(expected) {
        let is_it = |other: &[DVec3; 3]| {
            (0..3).any(|turn| {
                (0..3).all(|i| (other[(i + turn) % 3] - triangle[i]).abs().max_element() <= error)
            })
        };
        let place = left.iter().position(is_it).unwrap_or_else(|| panic!("no triangle at {triangle:?}"));
        left.swap_remove(place);
    }
}

#[test]
fn compact_files_are_smaller_and_hold_positions_within_half_a_step() {
    for triangles in [1, 7, 400] {
        let mesh = far_band(triangles, 0.3);
        let size = |encoding| {
            let mut bytes = Vec::new();
            write_glb_to(&mut bytes, &mesh, encoding, &Placement::default()).unwrap();
            json(&bytes);
            if encoding != GlbEncoding::Plain {
                assert_near(&parse_mesh(Path::new("a.glb"), &bytes, Unit::Metre).unwrap(), &mesh);
            }
            bytes.len()
        };
        let [plain, quantized, meshopt] =
            [GlbEncoding::Plain, GlbEncoding::Quantized, GlbEncoding::Meshopt].map(size);
        assert!(triangles < 400 || (quantized * 3 < plain * 2 && meshopt * 2 < quantized));
    }
}

#[test]
fn compact_meshes_of_many_vertices_have_long_indices() {
    for (triangles, component) in [(65_533, 5123), (65_534, 5125)] {
        for encoding in [GlbEncoding::Quantized, GlbEncoding::Meshopt] {
            let mesh = band(triangles, 0.0);
            let mut bytes = Vec::new();
            write_glb_to(&mut bytes, &mesh, encoding, &Placement::default()).unwrap();
            assert_eq!(json(&bytes)["accessors"][1]["componentType"], component);
            let read = parse_mesh(Path::new("a.glb"), &bytes, Unit::Metre).unwrap();
            assert_eq!(
                (read.vertices.len(), read.triangles.len()),
                (mesh.vertices.len(), triangles as usize)
            );
            let (error, last) = (most_error(&mesh), mesh.bounds().unwrap().1);
            assert!((read.bounds().unwrap().1 - last).abs().max_element() <= error);
        }
    }
}

#[test]
fn compact_meshes_without_extent_or_triangles_are_written() {
    for encoding in [GlbEncoding::Quantized, GlbEncoding::Meshopt] {
        let mut point = band(1, 2.5);
        point.vertices.fill(DVec3::new(1.0, 2.0, 3.0));
        for mesh in [point, TriangleMesh::default()] {
            let mut bytes = Vec::new();
            write_glb_to(&mut bytes, &mesh, encoding, &Placement::default()).unwrap();
            let read = parse_mesh(Path::new("a.glb"), &bytes, Unit::Metre).unwrap();
            assert_eq!(corners(&read), corners(&mesh));
        }
        let error = write_glb_to(Vec::new(), &band(1, 1e300), encoding, &Placement::default()).unwrap_err();
        assert_eq!(error.to_string(), "vertex 0 has no finite position in single precision");
    }
}

#[test]
fn compact_sequences_read_back_frame_by_frame() {
    for encoding in [GlbEncoding::Quantized, GlbEncoding::Meshopt] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.glb");
        let mut frames: Vec<_> = (1..6).map(|i| far_band(3 * i, f64::from(i))).collect();
        frames.insert(2, TriangleMesh::default());
        let mut writer = GlbAnimationWriter::create(&path).unwrap().with_encoding(encoding);
        frames.iter().enumerate().for_each(|(i, frame)| writer.push(i as f64 / 10.0, frame).unwrap());
        writer.finish(0.6).unwrap();
        let film = Animation::open(&path, Unit::Metre).unwrap();
        assert_eq!(film.frame_count(10.0), 6);
        for (i, frame) in frames.iter().enumerate() {
            let read = film.mesh_at((i as f64 + 0.5) / 10.0).unwrap();
            if frame.triangles.is_empty() {
                assert!(read.triangles.is_empty(), "frame {i}");
            } else {
                assert_near(&read, frame);
            }
        }
    }
}

#[test]
fn compact_meshes_are_placed_as_plain_ones_are() {
    let placement = Placement { translation: DVec3::new(4e5, -20.0, 5e6), ..Placement::default() };
    let mesh = far_band(9, 1.0);
    let mut moved = mesh.clone();
    moved.vertices.iter_mut().for_each(|v| *v += placement.translation);
    for encoding in [GlbEncoding::Quantized, GlbEncoding::Meshopt] {
        let mut bytes = Vec::new();
        write_glb_to(&mut bytes, &mesh, encoding, &placement).unwrap();
        assert_near(&parse_mesh(Path::new("a.glb"), &bytes, Unit::Metre).unwrap(), &moved);
    }
}

/// Writes a sequence and reads it.
fn sequence(frames: &[TriangleMesh], fps: f64) -> (Vec<u8>, Animation) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.glb");
    let mut writer = GlbAnimationWriter::create(&path).unwrap();
    let time = |frame: usize| frame as f64 / fps;
    frames.iter().enumerate().for_each(|(i, frame)| writer.push(time(i), frame).unwrap());
    assert!(!path.exists());
    writer.finish(time(frames.len())).unwrap();
    assert_eq!(folder.path().read_dir().unwrap().count(), 1, "no other file is left");
    (std::fs::read(&path).unwrap(), Animation::open(&path, Unit::Metre).unwrap())
}

#[test]
fn a_sequence_reads_back_frame_by_frame() {
    for (count, fps) in [(1, 30.0), (2, 24.0), (7, 29.97), (240, 120.0)] {
        let frames: Vec<_> = (0..count).map(|i| band(1 + i % 5, f64::from(i))).collect();
        let (bytes, film) = sequence(&frames, fps);
        json(&bytes);
        assert_eq!(film.frame_count(fps), u64::from(count));
        assert!((film.duration_s() - f64::from(count) / fps).abs() < 1e-6);
        for (i, frame) in frames.iter().enumerate() {
            for within in [0.0, 0.5, 0.99] {
                let read = film.mesh_at((i as f64 + within) / fps).unwrap();
                assert_eq!(
                    (single(&read), &read.triangles),
                    (single(frame), &frame.triangles),
                    "frame {i} of {count}"
                );
            }
        }
        let still = parse_mesh(Path::new("a.glb"), &bytes, Unit::Metre).unwrap();
        assert_eq!(single(&still), single(&frames[0]));
    }
}

#[test]
fn a_frame_is_shown_until_the_next_one_is_and_no_two_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.glb");
    let mut writer = GlbAnimationWriter::create(&path).unwrap();
    // The third is nearer to the second than its time can tell.
    for (frame, start) in [0.0, 0.3, 0.3 + 1e-12, 1.0].into_iter().enumerate() {
        writer.push(start, &band(1 + frame as u32, frame as f64)).unwrap();
    }
    writer.finish(1.5).unwrap();
    let film = Animation::open(&path, Unit::Metre).unwrap();
    assert!((film.duration_s() - 1.5).abs() < 1e-6);
    for (time, frame) in [(0.0, 0), (0.29, 0), (0.31, 2), (0.99, 2), (1.0, 3), (1.4, 3)] {
        assert_eq!(film.mesh_at(time).unwrap().triangles.len(), frame + 1, "at {time} s");
    }
}

#[test]
fn frames_without_triangles_keep_their_place() {
    let frames = [band(1, 0.0), TriangleMesh::default(), band(2, 1.0)];
    let (_, film) = sequence(&frames, 10.0);
    assert_eq!(film.frame_count(10.0), 3);
    assert_eq!(film.mesh_at(0.1).unwrap(), TriangleMesh::default());
    assert_eq!(film.mesh_at(0.2).unwrap().triangles.len(), 2);
}

#[test]
fn viewers_without_animation_show_the_first_frame() {
    let (bytes, _) = sequence(&[band(1, 0.0), band(1, 1.0), band(1, 2.0)], 30.0);
    let scales: Vec<_> =
        json(&bytes)["nodes"].as_array().unwrap().iter().map(|n| n["scale"][0].clone()).collect();
    assert_eq!(scales, [1, 0, 0]);
}

#[test]
fn sequences_that_cannot_be_are_refused_and_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.glb");
    let text = |error: WriteError| error.to_string().replace(path.to_str().unwrap(), "film.glb");
    let empty = GlbAnimationWriter::create(&path).unwrap();
    assert_eq!(
        text(empty.finish(0.0).unwrap_err()),
        "film.glb: cannot write: a sequence needs at least one frame"
    );
    let mut broken = GlbAnimationWriter::create(&path).unwrap();
    assert!(broken.push(0.0, &band(1, f64::NAN)).is_err());
    let error = broken.push(-1.0, &band(1, 0.0)).unwrap_err();
    assert_eq!(text(error), "film.glb: cannot write: -1 s is no time of a frame");
    assert!(broken.push(f64::NAN, &band(1, 0.0)).is_err());
    drop(broken);
    assert_eq!(folder.path().read_dir().unwrap().count(), 0);
}

#[test]
fn a_refused_frame_leaves_those_before_it_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.glb");
    let mut writer = GlbAnimationWriter::create(&path).unwrap();
    writer.push(0.0, &band(1, 0.0)).unwrap();
    assert!(writer.push(0.1, &band(1, f64::NAN)).is_err());
    writer.push(0.1, &band(2, 1.0)).unwrap();
    writer.finish(0.2).unwrap();
    assert_eq!(Animation::open(&path, Unit::Metre).unwrap().frame_count(10.0), 2);
}

#[test]
fn captured_frames_survive_a_sequence() {
    let Some(folder) = capture("flag") else { return };
    let paths = FrameSequence::open(&folder).unwrap();
    let frames: Vec<_> = paths.paths().iter().map(|path| read_mesh(path, Unit::Metre).unwrap()).collect();
    let (_, film) = sequence(&frames, 30.0);
    assert_eq!(film.frame_count(30.0), frames.len() as u64);
    for (i, frame) in frames.iter().enumerate() {
        let read = film.mesh_at(i as f64 / 30.0).unwrap();
        // Captured positions are single precision already.
        assert_eq!((&read.vertices, &read.triangles), (&frame.vertices, &frame.triangles), "frame {i}");
    }
}
