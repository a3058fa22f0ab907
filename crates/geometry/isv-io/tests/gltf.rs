//! glTF, still and moving, against positions worked out by hand; whole and broken files.

use glam::DVec3;
use isv_io::{Animation, GltfFault, Malformation, ReadError, Unit, parse_mesh, read_mesh};
use isv_testfiles::gltf::{
    Data, MORPH_SPLINE, TRIANGLE, below_ancestors, chunks, container, embedded, morphed, of_all_primitives,
    of_animations_from, of_several_animations, skinned, strided_and_sparse, triangle_shown_by,
};
use isv_volume::TriangleMesh;
use proptest::prelude::*;
use serde_json::{Value, json};
use std::path::Path;

fn animation(bytes: &[u8]) -> Result<Animation, ReadError> {
    Animation::parse(Path::new("a.glb"), bytes, Unit::Metre)
}

fn mesh(bytes: &[u8]) -> Result<TriangleMesh, ReadError> {
    parse_mesh(Path::new("a.glb"), bytes, Unit::Metre)
}

fn message(bytes: &[u8]) -> String {
    mesh(bytes).unwrap_err().to_string()
}

fn assert_near(found: &[DVec3], expected: &[[f64; 3]]) {
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (found, expected) in found.iter().zip(expected) {
        assert!(found.distance(DVec3::from(*expected)) < 1e-6, "{found:?} is not {expected:?}");
    }
}

#[test]
fn transforms_of_all_ancestors_apply_and_mirrors_turn_triangles_over() {
    let glb = below_ancestors();
    let mesh = mesh(&glb).unwrap();
    let expected = [
        [10.0, 0.0, 0.0],
        [10.0, 2.0, 0.0],
        [7.0, 0.0, 0.0],
        [10.0, 0.0, 5.0],
        [10.0, -1.0, 5.0],
        [9.0, 0.0, 5.0],
    ];
    assert_near(&mesh.vertices, &expected);
    assert_eq!(mesh.triangles, [[0, 1, 2], [3, 5, 4]]);
    assert!(!animation(&glb).unwrap().is_animated());
    let centimetres = parse_mesh(Path::new("a.glb"), &glb, Unit::Centimetre).unwrap();
    assert_near(&centimetres.vertices[..1], &[[0.1, 0.0, 0.0]]);
}

#[test]
fn what_is_not_visible_is_not_there() {
    let node = |visible: bool, children: &[usize]| json!({ "mesh": 0, "children": children, "extensions": { "KHR_node_visibility": { "visible": visible } } });
    let glb = triangle_shown_by(json!([node(true, &[1]), node(false, &[2]), { "mesh": 0 }, { "mesh": 0 }]));
    assert_eq!(mesh(&glb).unwrap().triangles.len(), 2);
}

#[test]
fn strips_fans_and_lists_become_triangles_and_lines_are_left_out() {
    let mesh = mesh(&of_all_primitives()).unwrap();
    assert_eq!(mesh.vertices.len(), 4, "primitives that share their vertices share them here");
    assert_eq!(mesh.triangles, [[3, 0, 2], [2, 0, 1], [0, 1, 2], [0, 2, 3], [1, 2, 3]]);
}

#[test]
fn integers_strides_and_sparse_elements_are_read() {
    let expected = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 0.0],
        [3.0, 0.0, 0.0],
        [0.0, 250.0, 1.0],
    ];
    assert_near(&mesh(&strided_and_sparse()).unwrap().vertices, &expected);
}

#[test]
fn the_default_scene_is_shown_and_a_file_without_meshes_says_so() {
    let mut data = Data::default();
    let positions = data.floats("VEC3", &TRIANGLE);
    let meshes = json!([{ "primitives": [{ "attributes": { "POSITION": positions } }] }]);
    let nodes = json!([{ "mesh": 0 }, { "mesh": 0, "translation": [5, 0, 0] }, {}]);
    let scenes = json!([{ "nodes": [0] }, { "nodes": [1] }, { "nodes": [2] }]);
    let glb = |scene: Option<usize>| {
        let mut json = json!({ "nodes": nodes, "meshes": meshes, "scenes": scenes });
        if let Some(scene) = scene {
            json["scene"] = scene.into();
        }
        data.glb(json)
    };
    assert_eq!(mesh(&glb(None)).unwrap().vertices[0].x, 0.0);
    assert_eq!(mesh(&glb(Some(1))).unwrap().vertices[0].x, 5.0);
    assert_eq!(message(&glb(Some(2))), "a.glb: no mesh with triangles in the scene (scene 2)");
    assert_eq!(message(&glb(Some(3))), "a.glb: names scene 3 of 3 (scene 3)");
    assert!(mesh(b"{\"asset\":{}}").unwrap().triangles.is_empty(), "a scene with nobody in it");
}

#[test]
fn a_skin_bends_its_mesh() {
    for sets in [1, 2] {
        let walk = animation(&skinned(sets)).unwrap();
        assert_eq!(walk.names().collect::<Vec<_>>(), ["bend"]);
        assert_eq!((walk.is_animated(), walk.duration_s(), walk.frame_count(10.0)), (true, 1.0, 10));
        let rest = [[0.0, 0.0, 4.0], [1.5, 0.0, 4.0], [2.0, 0.0, 4.0]];
        assert_near(&walk.mesh_at(0.0).unwrap().vertices, &rest);
        // Joint 1 takes x = 1.5 to (1, 0.5), of which the middle vertex goes half the way, and x = 2 to (1, 1).
        let bent = [[0.0, 0.0, 4.0], [1.25, 0.25, 4.0], [1.0, 1.0, 4.0]];
        assert_near(&walk.mesh_at(1.0).unwrap().vertices, &bent);
        assert_near(&walk.mesh_at(7.0).unwrap().vertices, &bent);
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let between = walk.mesh_at(0.5).unwrap();
        assert_near(&between.vertices[2..], &[[1.0 + half, half, 4.0]]);
        assert_eq!(mesh(&skinned(sets)).unwrap(), walk.mesh_at(0.0).unwrap());
    }
    let unskinned = mesh(&skinned(0)).unwrap();
    assert_near(&unskinned.vertices[..1], &[[100.0, 100.0, 100.0]]);
}

#[test]
fn morph_targets_follow_their_weights() {
    let height = |glb: &[u8], seconds| animation(glb).unwrap().mesh_at(seconds).unwrap().vertices[2].z;
    let line = morphed("LINEAR", &[0.0, 7.0, 1.0, 7.0], &Value::Null);
    assert_eq!([0.0, 0.5, 0.75, 1.0, 2.0].map(|t| height(&line, t)), [0.0, 0.0, 2.0, 4.0, 4.0]);
    let step = morphed("STEP", &[0.5, 7.0, 1.0, 7.0], &Value::Null);
    assert_eq!([0.0, 0.99, 1.0].map(|t| height(&step, t)), [2.0, 2.0, 4.0]);
    // Tangents of 8 a second out of the first key: an eighth of half a second's worth arrives half way.
    let spline = morphed("CUBICSPLINE", &MORPH_SPLINE, &Value::Null);
    assert_eq!([0.5, 0.75, 1.0].map(|t| height(&spline, t)), [0.0, 2.0, 0.0]);
    let at_rest = |nodes: Value| {
        let glb = morphed("LINEAR", &[0.0; 4], &json!({ "animations": [], "nodes": nodes }));
        assert!(!animation(&glb).unwrap().is_animated());
        height(&glb, 0.0)
    };
    assert_eq!(at_rest(json!([{ "mesh": 0 }])), 1.0, "the weights of the mesh");
    assert_eq!(at_rest(json!([{ "mesh": 0, "weights": [0.5] }])), 2.0, "the node's own");
}

#[test]
fn another_animation_can_be_asked_for_and_what_moves_nothing_is_at_rest() {
    let mut film = animation(&of_several_animations()).unwrap();
    assert!(!film.is_animated(), "a node that shows nothing");
    assert_eq!(film.frame_count(25.0), 1);
    assert_eq!(film.names().collect::<Vec<_>>(), ["", "walk", "jump"]);
    for (moving, height) in [(1, 3.0), (2, 6.0)] {
        film.select(moving).unwrap();
        assert_eq!((film.duration_s(), film.mesh_at(1.0).unwrap().vertices[0].z), (2.0, height));
        assert_eq!(film.start_s(), 0.0);
    }
    let mut late = animation(&of_animations_from(5.0)).unwrap();
    assert_eq!(late.start_s(), 0.0, "what moves nothing has no beginning");
    late.select(1).unwrap();
    assert_eq!(
        (late.start_s(), late.duration_s(), late.mesh_at(6.0).unwrap().vertices[0].z),
        (5.0, 7.0, 3.0)
    );
    let error = film.select(3).unwrap_err().to_string();
    assert_eq!(error, "a.glb: animation 3 asked for, but there are 3 (animation 3)");
}

#[test]
fn what_is_scaled_to_nothing_is_hidden() {
    let nodes = json!([{ "mesh": 0 }, { "scale": [0, 0, 0], "children": [2] }, { "mesh": 0 }]);
    assert_eq!(mesh(&triangle_shown_by(nodes)).unwrap().triangles.len(), 1);
    let glb = triangle_shown_by(json!([{ "mesh": 0, "scale": [0, 0, 0] }]));
    assert!(mesh(&glb).unwrap().triangles.is_empty());
}

#[test]
fn buffers_may_lie_beside_the_file_or_inside_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut data = Data::default();
    let positions = data.floats("VEC3", &TRIANGLE);
    let json = data.json(json!({
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions } }] }],
        "images": [{ "uri": "missing.png" }],
    }));
    std::fs::write(folder.path().join("the bytes.bin"), &data.bytes).unwrap();
    std::fs::write(folder.path().join("short.bin"), &data.bytes[1..]).unwrap();
    let path = folder.path().join("a.gltf");
    let read = |uri: &str| {
        let mut json = json.clone();
        json["buffers"][0]["uri"] = uri.into();
        std::fs::write(&path, json.to_string()).unwrap();
        read_mesh(&path, Unit::Metre)
            .map_err(|error| error.to_string().replace(path.to_str().unwrap(), "a.gltf"))
    };
    assert_eq!(read("the%20bytes.bin").unwrap().triangles, [[0, 1, 2]]);
    let zeros = "A".repeat(4 * data.bytes.len().div_ceil(3));
    assert_eq!(read(&format!("data:;base64,{zeros}")).unwrap().vertices, [DVec3::ZERO; 3]);
    assert_eq!(
        read("short.bin").unwrap_err(),
        "a.gltf: its file `short.bin` cannot be read: it has 35 bytes where 36 are needed (buffer 0)"
    );
    assert!(read("gone.bin").unwrap_err().starts_with("a.gltf: its file `gone.bin` cannot be read: "));
    assert!(read(".").unwrap_err().contains("not a regular file"));
    for bad in ["../a.bin", "/etc/hostname", "https://host/a.bin"] {
        assert!(read(bad).unwrap_err().contains("buffers must lie beside"), "{bad}");
    }
    assert!(read("data:;base64,A*").unwrap_err().contains("broken base64"));
    assert!(read("data:,hello").unwrap_err().contains("not base64"));
    std::fs::write(&path, json.to_string()).unwrap();
    let error = read_mesh(&path, Unit::Metre).unwrap_err().to_string();
    assert!(error.ends_with("truncated: its bytes should have 36 bytes, 0 are there (buffer 0)"), "{error}");
}

#[test]
fn bytes_inside_the_text_are_those_of_the_binary_file() {
    for glb in [skinned(2), of_all_primitives(), strided_and_sparse()] {
        assert_eq!(mesh(&embedded(&glb)).unwrap(), mesh(&glb).unwrap());
    }
}

/// The fault of a triangle's file after a change of its JSON.
fn fault(change: impl FnOnce(&mut Value)) -> GltfFault {
    let mut data = Data::default();
    let positions = data.floats("VEC3", &TRIANGLE);
    let indices = data.shorts(&[0, 1, 2]);
    let mut json = data.json(json!({
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions }, "indices": indices }] }],
    }));
    assert!(mesh(&container(json.to_string().into_bytes(), &data.bytes)).is_ok());
    change(&mut json);
    match mesh(&container(json.to_string().into_bytes(), &data.bytes)) {
        Err(ReadError::Malformed { why: Malformation::Gltf(fault), .. }) => fault,
        other => panic!("{other:?}"),
    }
}

#[test]
fn faults_say_what_is_wrong() {
    let extension = |name: &str| GltfFault::Extension { extension: name.to_owned() };
    let unknown = "ACME_mesh_compression";
    assert_eq!(fault(|f| f["extensionsRequired"] = json!([unknown])), extension(unknown));
    assert_eq!(
        fault(|f| f["meshes"][0]["primitives"][0]["extensions"][unknown] = json!({ "bufferView": 9 })),
        extension(unknown)
    );
    let instancing = "EXT_mesh_gpu_instancing";
    assert_eq!(
        fault(|f| f["nodes"][0]["extensions"][instancing] = json!({ "attributes": {} })),
        extension(instancing)
    );
    assert_eq!(fault(|f| f["bufferViews"][0]["extensions"][unknown] = json!({})), extension(unknown));
    assert_eq!(
        extension(unknown).to_string(),
        "uses the extension ACME_mesh_compression, which cannot be read; save the file without it"
    );
    assert!(matches!(fault(|f| f["nodes"] = json!({})), GltfFault::Json { .. }));
    assert!(matches!(fault(|f| f["accessors"][0]["count"] = (-1).into()), GltfFault::Json { .. }));
    let none = |kind, index, count| GltfFault::NoSuch { kind, index, count };
    assert_eq!(fault(|f| f["nodes"][0]["mesh"] = 7.into()), none("mesh", 7, 1));
    assert_eq!(fault(|f| f["nodes"][0]["skin"] = 7.into()), none("skin", 7, 0));
    assert_eq!(fault(|f| f["accessors"][0]["bufferView"] = 7.into()), none("bufferView", 7, 2));
    assert_eq!(fault(|f| f["bufferViews"][0]["buffer"] = 7.into()), none("buffer", 7, 1));
    assert_eq!(fault(|f| f["meshes"][0]["primitives"][0]["mode"] = 9.into()), none("primitive mode", 9, 7));
    assert!(matches!(fault(|f| f["accessors"][0]["type"] = "VEC2".into()), GltfFault::AccessorType { .. }));
    assert!(matches!(
        fault(|f| f["accessors"][1]["componentType"] = 5126.into()),
        GltfFault::AccessorType { .. }
    ));
    assert_eq!(
        fault(|f| f["bufferViews"][0]["byteStride"] = 8.into()),
        GltfFault::Stride { stride: 8, bytes: 12 }
    );
    assert_eq!(
        fault(|f| f["accessors"][0]["byteOffset"] = 4.into()),
        GltfFault::PastEnd { end: 40, bytes: 36 }
    );
    assert_eq!(
        fault(|f| f["bufferViews"][0]["byteLength"] = 99.into()),
        GltfFault::PastEnd { end: 99, bytes: 44 }
    );
    assert_eq!(
        fault(|f| f["accessors"][0]["count"] = 2.into()),
        GltfFault::Index { kind: "vertex", index: 2, last: 1 }
    );
    let end = u64::MAX;
    assert_eq!(fault(|f| f["accessors"][0]["count"] = end.into()), GltfFault::PastEnd { end, bytes: 36 });
    assert_eq!(fault(|f| f["nodes"][0]["children"] = json!([0])), GltfFault::Cycle);
}

#[test]
fn faults_of_moving_files_say_what_is_wrong() {
    let count = |wanted, found| Some(GltfFault::Count { wanted, found });
    let why = |glb: &[u8]| match animation(glb) {
        Err(ReadError::Malformed { why: Malformation::Gltf(fault), .. }) => Some(fault),
        _ => None,
    };
    assert_eq!(why(&morphed("LINEAR", &[0.0; 3], &Value::Null)), count(4, 3));
    assert_eq!(why(&morphed("CUBICSPLINE", &[0.0; 4], &Value::Null)), count(12, 4));
    let timed = |times: &[f32]| {
        let mut data = Data::default();
        let (positions, times) = (data.floats("VEC3", &TRIANGLE), data.times(times));
        data.glb(json!({
            "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions } }] }],
            "animations": [{ "channels": [{ "sampler": 0, "target": { "node": 0, "path": "scale" } }],
                             "samplers": [{ "input": times, "output": positions }] }],
        }))
    };
    assert_eq!(why(&timed(&[0.0, 1.0, 2.0])), None);
    for broken in [&[][..], &[2.0, 1.0, 3.0], &[0.0, f32::NAN, 1.0], &[0.0, 1.0, f32::INFINITY]] {
        assert_eq!(why(&timed(broken)), Some(GltfFault::Times), "{broken:?}");
    }
    assert_eq!(why(&timed(&[0.0, 1.0, 1e9])), Some(GltfFault::Duration { seconds: 1_000_000_000 }));
    let mut glb = skinned(1);
    let at = glb.windows(14).position(|w| w == b"\"joints\":[1,2]").unwrap();
    glb[at..at + 14].copy_from_slice(b"\"joints\":[1]  ");
    assert_eq!(why(&glb), Some(GltfFault::Index { kind: "joint", index: 1, last: 0 }));
}

#[test]
fn small_files_that_ask_for_much_are_refused() {
    let zeros = json!({
        "nodes": [{ "mesh": 0 }], "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "componentType": 5126, "type": "VEC3", "count": u64::MAX }],
    });
    assert!(message(zeros.to_string().as_bytes()).contains("the limit for a file of this size is"));
    // A hundred thousand nodes that show a thousand triangles each.
    let mut data = Data::default();
    let positions = data.floats("VEC3", &[[1.0; 3]; 3000]);
    let glb = data.glb(json!({
        "nodes": vec![json!({ "mesh": 0 }); 100_000],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions } }] }],
    }));
    assert!(message(&glb).contains("the limit for a file of this size is"));
}

#[test]
fn every_truncation_fails() {
    for glb in [skinned(2), morphed("STEP", &[0.0; 4], &Value::Null)] {
        for length in 0..glb.len() {
            let error = mesh(&glb[..length]).unwrap_err();
            assert!(matches!(error, ReadError::Malformed { .. }), "cut at {length}: {error}");
        }
    }
    assert_eq!(
        message(b"glTF\x01\0\0\0\x0c\0\0\0"),
        "a.glb: glTF of version 1; only version 2 can be read (byte 4)"
    );
    assert_eq!(message(b"hello"), "a.glb: not a glTF file: it starts with neither `glTF` nor `{` (byte 0)");
    assert_eq!(
        message(b"{\n\"nodes\": 5}"),
        "a.glb: its JSON cannot be understood: invalid type: integer `5`, expected a sequence (byte 12)"
    );
}

/// Reads a file whatever it is, and plays it.
fn play(bytes: &[u8]) {
    if let Ok(animation) = animation(bytes) {
        assert!(animation.frame_count(30.0) >= 1);
        for seconds in [0.0, 0.6, animation.duration_s(), f64::MAX] {
            let _ = animation.mesh_at(seconds);
        }
    }
}

proptest! {
    #[test]
    fn changed_bytes_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        digits in any::<bool>(),
    ) {
        for mut glb in [skinned(2), morphed("CUBICSPLINE", &[0.5; 12], &Value::Null)] {
            let numbers: Vec<_> = (0..glb.len()).filter(|at| glb[*at].is_ascii_digit()).collect();
            for (at, byte) in &changes {
                // Digits for digits, so that the JSON stays one and what it says is wrong.
                let (at, byte) = if digits { (numbers[at.index(numbers.len())], b'0' + byte % 10) } else { (at.index(glb.len()), *byte) };
                glb[at] = byte;
            }
            play(&glb);
        }
    }

    #[test]
    fn arbitrary_numbers_never_panic(
        key in prop::sample::select(vec![
            "count", "byteOffset", "byteLength", "bufferView", "componentType", "mesh", "skin", "POSITION", "indices", "mode",
            "JOINTS_0", "WEIGHTS_0", "sampler", "input", "output", "node", "inverseBindMatrices", "scene",
        ]),
        number in prop::sample::select(vec![0u64, 1, 2, 3, 4, 5, 6, 100, 5120, 5123, 5125, 5126, 1 << 24, 1 << 32, u64::MAX]),
        place in any::<prop::sample::Index>(),
    ) {
        for glb in [skinned(2), morphed("LINEAR", &[0.5; 4], &Value::Null)] {
            let (json, binary) = chunks(&glb);
            let key = format!("\"{key}\":");
            let places: Vec<_> = json.match_indices(&key).map(|(at, _)| at + key.len()).collect();
            if places.is_empty() {
                continue;
            }
            let at = places[place.index(places.len())];
            let rest = json[at..].trim_start_matches(|c: char| c.is_ascii_digit());
            play(&container(format!("{}{number}{rest}", &json[..at]).into_bytes(), binary));
        }
    }
}
