//! glTF compressed by other programs: Draco, meshoptimizer, integers.

use glam::DVec3;
use isv_io::{GltfFault, Malformation, ReadError, Unit, parse_mesh};
use isv_testfiles::compressed::{DRACO_STREAMS, body, draco, draco_stream, meshopt};
use isv_testfiles::gltf::{chunks, container};
use isv_volume::TriangleMesh;
use proptest::prelude::*;
use serde_json::{Value, json};
use std::path::Path;

/// Positions of 14 bits, over the longest side of the body, and three decimals.
const TOLERANCE: f64 = 0.5 * 2.2 / 16383.0 + 0.0006;

fn mesh(bytes: &[u8]) -> Result<TriangleMesh, ReadError> {
    parse_mesh(Path::new("a.glb"), bytes, Unit::Metre)
}

fn fault(bytes: &[u8]) -> GltfFault {
    match mesh(bytes).unwrap_err() {
        ReadError::Malformed { why: Malformation::Gltf(fault), .. } => fault,
        other => panic!("{other}"),
    }
}

/// Triangles by the body's vertices, in one order, each beginning with its smallest.
fn triangles_of_body(mesh: &TriangleMesh) -> Vec<[u32; 3]> {
    let (vertices, _) = body();
    let nearest = |v: DVec3| {
        let place = vertices.iter().position(|w| v.distance(DVec3::from(*w)) < 3f64.sqrt() * TOLERANCE);
        place.unwrap_or_else(|| panic!("{v} is no vertex of the body")) as u32
    };
    let places: Vec<_> = mesh.vertices.iter().map(|v| nearest(*v)).collect();
    sorted(mesh.triangles.iter().map(|triangle| triangle.map(|corner| places[corner as usize])))
}

fn sorted(triangles: impl Iterator<Item = [u32; 3]>) -> Vec<[u32; 3]> {
    let mut triangles: Vec<_> = triangles
        .map(|[a, b, c]| match a.min(b).min(c) {
            least if least == a => [a, b, c],
            least if least == b => [b, c, a],
            _ => [c, a, b],
        })
        .collect();
    triangles.sort_unstable();
    triangles
}

fn assert_is_body(name: &str, bytes: &[u8]) {
    let mesh = mesh(bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_eq!(triangles_of_body(&mesh), sorted(body().1.into_iter()), "{name}");
}

#[test]
fn draco_streams_of_every_method_are_read() {
    for (name, stream) in DRACO_STREAMS {
        assert_is_body(name, &draco(stream));
    }
}

#[test]
fn buffer_views_compressed_by_meshoptimizer_are_read() {
    for (name, glb) in meshopt() {
        assert_is_body(name, &glb);
    }
}

/// A file with a change in its JSON.
fn changed(glb: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let (json, binary) = chunks(glb);
    let mut json = serde_json::from_str(json).unwrap();
    change(&mut json);
    container(json.to_string().into_bytes(), binary)
}

#[test]
fn primitives_may_share_a_stream_and_strips_are_triangles_in_it() {
    let glb = changed(&draco(DRACO_STREAMS[1].1), |json| {
        let mut second = json["meshes"][0]["primitives"][0].clone();
        second["mode"] = 5.into();
        json["meshes"][0]["primitives"].as_array_mut().unwrap().push(second);
    });
    let (vertices, triangles) = body();
    let mesh = mesh(&glb).unwrap();
    assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (vertices.len(), 2 * triangles.len()));
}

#[test]
fn integers_of_a_stream_are_scaled_as_their_accessor_says() {
    let plain = draco(DRACO_STREAMS[0].1);
    let normalized = changed(&plain, |json| {
        json["accessors"][0]["componentType"] = 5120.into();
        json["accessors"][0]["normalized"] = true.into();
    });
    let [plain, scaled] = [plain, normalized].map(|glb| mesh(&glb).unwrap().vertices);
    assert!(scaled[5].distance(plain[5] / 127.0) < 1e-6);
}

#[test]
fn a_fallback_buffer_needs_no_bytes_and_its_view_may_leave_out_the_stride() {
    let [(_, glb), ..] = meshopt();
    let glb = changed(&glb, |json| {
        _ = json["bufferViews"][0].as_object_mut().unwrap().remove("byteStride");
        json["buffers"][1]["uri"] = "gone.bin".into();
    });
    assert_is_body("without a stride", &glb);
}

#[test]
fn faults_say_what_is_wrong() {
    let glb = draco(DRACO_STREAMS[1].1);
    let why =
        |codec| move |fault: GltfFault| matches!(fault, GltfFault::Compressed { codec: c, .. } if c == codec);
    assert!(why("Draco")(fault(&draco_stream(b"DRACO no stream"))));
    let other_attribute = |json: &mut Value| {
        json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"] =
            json!({ "POSITION": 7 });
    };
    let wanted = GltfFault::NoSuch { kind: "Draco attribute", index: 7, count: 1 };
    assert_eq!(fault(&changed(&glb, other_attribute)), wanted);
    let [(_, glb), ..] = meshopt();
    let extension = |json: &mut Value, key: &str, value: Value| {
        json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"][key] = value;
    };
    assert!(why("meshopt")(fault(&changed(&glb, |json| extension(json, "mode", "WORDS".into())))));
    assert!(why("meshopt")(fault(&changed(&glb, |json| extension(json, "filter", "LENS".into())))));
    assert!(why("meshopt")(fault(&changed(&glb, |json| extension(json, "byteStride", 13.into())))));
    assert!(matches!(
        fault(&changed(&glb, |json| extension(json, "count", 1_000_000_000.into()))),
        GltfFault::Decompressed { .. }
    ));
    assert!(matches!(
        fault(&changed(&glb, |json| extension(json, "byteLength", 9999.into()))),
        GltfFault::PastEnd { .. }
    ));
    // Views of one stream take their memory each.
    let many = changed(&glb, |json| {
        let view = json["bufferViews"][0].clone();
        let accessor = json["accessors"][0].clone();
        let primitive = json["meshes"][0]["primitives"][0].clone();
        for place in 2..60_000 {
            json["bufferViews"].as_array_mut().unwrap().push(view.clone());
            let mut accessor = accessor.clone();
            accessor["bufferView"] = place.into();
            json["accessors"].as_array_mut().unwrap().push(accessor);
            let mut primitive = primitive.clone();
            primitive["attributes"]["POSITION"] = place.into();
            json["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
        }
    });
    assert!(mesh(&many).is_ok(), "a long file may hold much");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn damaged_streams_are_refused_or_read(file in 0..6usize, at in 0..1usize << 16, byte: u8, cut: bool) {
        let glb = match file.checked_sub(3) {
            None => draco(DRACO_STREAMS[file].1),
            Some(file) => meshopt()[file].1.clone(),
        };
        let (json, binary) = chunks(&glb);
        let mut binary = binary.to_vec();
        let at = at % binary.len();
        binary[at] = byte;
        if cut {
            binary[at..].fill(0);
        }
        let _ = mesh(&container(json.as_bytes().to_vec(), &binary));
    }
}
