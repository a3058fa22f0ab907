//! glTF, still and moving, against positions worked out by hand; whole and broken files.

use glam::DVec3;
use isv_io::{Animation, GltfFault, Malformation, ReadError, Unit, parse_mesh, read_mesh};
use isv_volume::{MeshError, TriangleMesh};
use proptest::prelude::*;
use serde_json::{Value, json};
use std::path::Path;

/// The binary part of a file, and what its JSON says of it.
#[derive(Default)]
struct Data {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Data {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.views.push(json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() }));
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.len() - 1
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn of_bytes(&mut self, shape: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.accessor(
            json!({ "bufferView": view, "componentType": component, "type": shape, "count": count }),
        )
    }

    fn floats<const N: usize>(&mut self, shape: &str, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
        self.of_bytes(shape, 5126, values.len(), &bytes)
    }

    fn times(&mut self, values: &[f32]) -> usize {
        let values: Vec<_> = values.iter().map(|v| [*v]).collect();
        self.floats("SCALAR", &values)
    }

    fn shorts(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.of_bytes("SCALAR", 5123, values.len(), &bytes)
    }

    fn joints(&mut self, values: &[[u8; 4]]) -> usize {
        self.of_bytes("VEC4", 5121, values.len(), values.as_flattened())
    }

    /// The JSON with the lists of this data.
    fn json(&self, mut json: Value) -> Value {
        json["asset"] = json!({ "version": "2.0" });
        json["accessors"] = self.accessors.clone().into();
        json["bufferViews"] = self.views.clone().into();
        json["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        json
    }

    fn glb(&self, json: Value) -> Vec<u8> {
        container(self.json(json).to_string().into_bytes(), &self.bytes)
    }
}

fn container(mut json: Vec<u8>, binary: &[u8]) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = (12 + 8 + json.len() + 8 + binary.len()) as u32;
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend(length.to_le_bytes());
    for (kind, chunk) in [(b"JSON", json.as_slice()), (b"BIN\0", binary)] {
        glb.extend((chunk.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    glb
}

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

const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

/// A quarter turn about z, from x to y.
const QUARTER: [f32; 4] = [0.0, 0.0, std::f32::consts::FRAC_1_SQRT_2, std::f32::consts::FRAC_1_SQRT_2];
const NO_TURN: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

/// One mesh of one triangle and the nodes that show it.
fn triangle_shown_by(nodes: Value) -> Vec<u8> {
    let mut data = Data::default();
    let positions = data.floats("VEC3", &TRIANGLE);
    data.glb(json!({ "nodes": nodes, "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions } }] }] }))
}

#[test]
fn transforms_of_all_ancestors_apply_and_mirrors_turn_triangles_over() {
    let glb = triangle_shown_by(json!([
        { "translation": [10, 0, 0], "rotation": QUARTER, "children": [1, 2] },
        { "scale": [2, 3, 1], "mesh": 0 },
        { "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1], "mesh": 0 },
    ]));
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
fn strips_fans_and_lists_become_triangles_and_lines_are_left_out() {
    let mut data = Data::default();
    let positions = data.floats("VEC3", &SQUARE);
    let indices = data.shorts(&[3, 0, 2, 1]);
    let bytes = data.of_bytes("SCALAR", 5121, 3, &[1, 2, 3]);
    let attributes = json!({ "POSITION": positions });
    let primitives = json!([
        { "attributes": attributes, "mode": 5, "indices": indices },
        { "attributes": attributes, "mode": 6 },
        { "attributes": attributes, "mode": 4, "indices": bytes },
        { "attributes": attributes, "mode": 1 },
        { "attributes": attributes, "mode": 0 },
        { "attributes": { "TEXCOORD_0": positions } },
    ]);
    let glb = data.glb(json!({ "nodes": [{ "mesh": 0 }], "meshes": [{ "primitives": primitives }] }));
    let mesh = mesh(&glb).unwrap();
    assert_eq!(mesh.vertices.len(), 4, "primitives that share their vertices share them here");
    assert_eq!(mesh.triangles, [[3, 0, 2], [2, 0, 1], [0, 1, 2], [0, 2, 3], [1, 2, 3]]);
}

#[test]
fn integers_strides_and_sparse_elements_are_read() {
    let mut data = Data::default();
    // Normalised 16-bit positions every 8 bytes.
    let rows = [[0i16, 0, 0, 99], [32767, 0, 0, 99], [0, -32768, 0, 99]];
    let view = data.view(&rows.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>());
    data.views[view]["byteStride"] = 8.into();
    let small =
        json!({ "bufferView": view, "componentType": 5122, "normalized": true, "type": "VEC3", "count": 3 });
    let small = data.accessor(small);
    // No view: zeros, two of them replaced.
    let (places, values) = (data.view(&[1, 2]), data.view(&[3, 0, 0, 0, 250, 1]));
    let sparse = data.accessor(json!({ "componentType": 5121, "type": "VEC3", "count": 3, "sparse": {
        "count": 2,
        "indices": { "bufferView": places, "componentType": 5121 },
        "values": { "bufferView": values },
    } }));
    let primitive = |positions| json!({ "attributes": { "POSITION": positions } });
    let glb = data.glb(json!({
        "extensionsRequired": ["KHR_mesh_quantization", "KHR_materials_unlit"],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [primitive(small), primitive(sparse)] }],
    }));
    let expected = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 0.0],
        [3.0, 0.0, 0.0],
        [0.0, 250.0, 1.0],
    ];
    assert_near(&mesh(&glb).unwrap().vertices, &expected);
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
    assert_eq!(message(b"{\"asset\":{}}"), "a.glb: no mesh with triangles in the scene (scene 0)");
}

/// A band of three vertices that two joints bend: the first follows joint 0, the last joint 1, the middle one both. Joint 1 sits
/// at x = 1 and turns a quarter in one second; the whole skeleton stands at z = 4. The node of the mesh is elsewhere.
fn skinned(influences: usize) -> Vec<u8> {
    let mut data = Data::default();
    let positions = data.floats("VEC3", &[[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [2.0, 0.0, 0.0]]);
    let joints = data.joints(&[[0, 0, 0, 0], [0, 1, 0, 0], [1, 9, 0, 0]]);
    let weights = data.floats("VEC4", &[[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0], [2.0, 0.0, 0.0, 0.0]]);
    let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let mut back = identity;
    back[12] = -1.0;
    let inverse_bind = data.floats("MAT4", &[identity, back]);
    let (times, turns) = (data.times(&[0.0, 1.0]), data.floats("VEC4", &[NO_TURN, QUARTER]));
    let mut attributes = json!({ "POSITION": positions });
    for set in 0..influences {
        attributes[format!("JOINTS_{set}")] = joints.into();
        attributes[format!("WEIGHTS_{set}")] = weights.into();
    }
    data.glb(json!({
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [
            { "mesh": 0, "skin": 0, "translation": [100, 100, 100] },
            { "translation": [0, 0, 4], "children": [2] },
            { "translation": [1, 0, 0] },
        ],
        "meshes": [{ "primitives": [{ "attributes": attributes }] }],
        "skins": [{ "joints": [1, 2], "inverseBindMatrices": inverse_bind }],
        "animations": [{
            "name": "bend",
            "channels": [{ "sampler": 0, "target": { "node": 2, "path": "rotation" } }],
            "samplers": [{ "input": times, "output": turns }],
        }],
    }))
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

/// A triangle with two morph targets, the second without positions: the first lifts vertex 2 by 4.
fn morphed(interpolation: &str, weights: &[f32], extra: &Value) -> Vec<u8> {
    let mut data = Data::default();
    let positions = data.floats("VEC3", &TRIANGLE);
    let lift = data.floats("VEC3", &[[0.0; 3], [0.0; 3], [0.0, 0.0, 4.0]]);
    let times = data.times(&[0.5, 1.0]);
    let weights: Vec<_> = weights.iter().map(|w| [*w]).collect();
    let weights = data.floats("SCALAR", &weights);
    let mut json = json!({
        "nodes": [{ "mesh": 0 }],
        "meshes": [{
            "weights": [0.25, 1],
            "primitives": [{ "attributes": { "POSITION": positions }, "targets": [{ "POSITION": lift }, {}] }],
        }],
        "animations": [{
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
            "samplers": [{ "input": times, "output": weights, "interpolation": interpolation }],
        }],
    });
    for (key, value) in extra.as_object().into_iter().flatten() {
        json[key] = value.clone();
    }
    data.glb(json)
}

#[test]
fn morph_targets_follow_their_weights() {
    let height = |glb: &[u8], seconds| animation(glb).unwrap().mesh_at(seconds).unwrap().vertices[2].z;
    let line = morphed("LINEAR", &[0.0, 7.0, 1.0, 7.0], &Value::Null);
    assert_eq!([0.0, 0.5, 0.75, 1.0, 2.0].map(|t| height(&line, t)), [0.0, 0.0, 2.0, 4.0, 4.0]);
    let step = morphed("STEP", &[0.5, 7.0, 1.0, 7.0], &Value::Null);
    assert_eq!([0.0, 0.99, 1.0].map(|t| height(&step, t)), [2.0, 2.0, 4.0]);
    // Tangents of 8 a second out of the first key: an eighth of half a second's worth arrives half way.
    let spline =
        morphed("CUBICSPLINE", &[9.0, 9.0, 0.0, 0.0, 8.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9.0, 9.0], &Value::Null);
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
    let mut data = Data::default();
    let positions = data.floats("VEC3", &TRIANGLE);
    let times = data.times(&[0.0, 2.0]);
    let path = data.floats("VEC3", &[[0.0; 3], [0.0, 0.0, 6.0]]);
    let clip = |node: usize| {
        json!({ "channels": [{ "sampler": 0, "target": { "node": node, "path": "translation" } }],
                "samplers": [{ "input": times, "output": path }] })
    };
    let glb = data.glb(json!({
        "nodes": [{ "mesh": 0 }, { "children": [0] }, {}],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions } }] }],
        "animations": [clip(2), clip(1), clip(0)],
    }));
    let mut film = animation(&glb).unwrap();
    assert!(!film.is_animated(), "a node that shows nothing");
    assert_eq!(film.frame_count(25.0), 1);
    for moving in [1, 2] {
        film.select(moving).unwrap();
        assert_eq!((film.duration_s(), film.mesh_at(1.0).unwrap().vertices[0].z), (2.0, 3.0));
    }
    let error = film.select(3).unwrap_err().to_string();
    assert_eq!(error, "a.glb: animation 3 asked for, but there are 3 (animation 3)");
}

#[test]
fn what_is_scaled_to_nothing_is_hidden() {
    let nodes = json!([{ "mesh": 0 }, { "scale": [0, 0, 0], "children": [2] }, { "mesh": 0 }]);
    assert_eq!(mesh(&triangle_shown_by(nodes)).unwrap().triangles.len(), 1);
    let glb = triangle_shown_by(json!([{ "mesh": 0, "scale": [0, 0, 0] }]));
    assert!(matches!(mesh(&glb), Err(ReadError::Mesh { cause: MeshError::NoFaces, .. })));
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
    let draco = "KHR_draco_mesh_compression";
    assert_eq!(fault(|f| f["extensionsRequired"] = json!([draco])), extension(draco));
    assert_eq!(
        fault(|f| f["meshes"][0]["primitives"][0]["extensions"][draco] = json!({ "bufferView": 9 })),
        extension(draco)
    );
    let meshopt = "EXT_meshopt_compression";
    assert_eq!(fault(|f| f["bufferViews"][0]["extensions"][meshopt] = json!({})), extension(meshopt));
    assert_eq!(
        extension(draco).to_string(),
        "uses the extension KHR_draco_mesh_compression, which cannot be read; save the file without it"
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
        "a.glb: binary glTF of version 1; only version 2 can be read (byte 4)"
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
            let json_bytes = u32::from_le_bytes(*glb[12..].first_chunk().unwrap()) as usize;
            let (json, binary) = (str::from_utf8(&glb[20..20 + json_bytes]).unwrap(), &glb[28 + json_bytes..]);
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
