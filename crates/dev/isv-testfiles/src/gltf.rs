//! glTF, put together by hand: what writers rarely write is read as well.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// The binary part of a file, and what its JSON says of it.
#[derive(Clone, Debug, Default)]
pub struct Data {
    /// The bytes of the only buffer.
    pub bytes: Vec<u8>,
    /// The list `bufferViews`.
    pub views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Data {
    /// Adds bytes, and gives the number of their view.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.views.push(json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() }));
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.len() - 1
    }

    /// Adds an accessor as its JSON has it, and gives its number.
    pub fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Adds an accessor of `count` elements, by the specification's names of their type and the number of their component type.
    pub fn of_bytes(&mut self, shape: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.accessor(
            json!({ "bufferView": view, "componentType": component, "type": shape, "count": count }),
        )
    }

    /// Adds an accessor of single-precision elements of `N` numbers.
    pub fn floats<const N: usize>(&mut self, shape: &str, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
        self.of_bytes(shape, 5126, values.len(), &bytes)
    }

    /// Adds an accessor of single numbers.
    pub fn times(&mut self, values: &[f32]) -> usize {
        let values: Vec<_> = values.iter().map(|v| [*v]).collect();
        self.floats("SCALAR", &values)
    }

    /// Adds an accessor of indices of 16 bits.
    pub fn shorts(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.of_bytes("SCALAR", 5123, values.len(), &bytes)
    }

    /// Adds an accessor of the joints of vertices.
    pub fn joints(&mut self, values: &[[u8; 4]]) -> usize {
        self.of_bytes("VEC4", 5121, values.len(), values.as_flattened())
    }

    /// The JSON with the lists of this data.
    #[must_use]
    pub fn json(&self, mut json: Value) -> Value {
        json["asset"] = json!({ "version": "2.0" });
        json["accessors"] = self.accessors.clone().into();
        json["bufferViews"] = self.views.clone().into();
        json["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        json
    }

    /// The whole as a binary file.
    #[must_use]
    pub fn glb(&self, json: Value) -> Vec<u8> {
        container(self.json(json).to_string().into_bytes(), &self.bytes)
    }
}

/// A binary file of two chunks.
#[must_use]
pub fn container(mut json: Vec<u8>, binary: &[u8]) -> Vec<u8> {
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

/// The JSON and the bytes of a binary file of [`container`].
#[must_use]
pub fn chunks(glb: &[u8]) -> (&str, &[u8]) {
    let json_bytes = u32::from_le_bytes(*glb[12..].first_chunk().unwrap()) as usize;
    (str::from_utf8(&glb[20..20 + json_bytes]).unwrap(), &glb[28 + json_bytes..])
}

/// A binary file of [`Data::glb`] as text, with the bytes in a data URI.
#[must_use]
pub fn embedded(glb: &[u8]) -> Vec<u8> {
    let (json, bytes) = chunks(glb);
    let mut json: Value = serde_json::from_str(json).unwrap();
    json["buffers"][0]["uri"] =
        format!("data:application/octet-stream;base64,{}", STANDARD.encode(bytes)).into();
    json.to_string().into_bytes()
}

/// Corners of a triangle.
pub const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// Corners of a square, one after the other.
pub const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

/// A quarter turn about z, from x to y.
pub const QUARTER: [f32; 4] = [0.0, 0.0, std::f32::consts::FRAC_1_SQRT_2, std::f32::consts::FRAC_1_SQRT_2];
/// No turn.
pub const NO_TURN: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

/// One mesh of one triangle and the nodes that show it.
#[must_use]
pub fn triangle_shown_by(nodes: Value) -> Vec<u8> {
    let mut data = Data::default();
    let positions = data.floats("VEC3", &TRIANGLE);
    data.glb(json!({ "nodes": nodes, "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions } }] }] }))
}

/// A triangle three times, by nodes with all that can be between a mesh and the scene, a mirroring matrix among it.
#[must_use]
pub fn below_ancestors() -> Vec<u8> {
    triangle_shown_by(json!([
        { "translation": [10, 0, 0], "rotation": QUARTER, "children": [1, 2] },
        { "scale": [2, 3, 1], "mesh": 0 },
        { "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1], "mesh": 0 },
    ]))
}

/// A square as a strip, a fan and a list of a triangle, and what is no triangles: lines, points, and a primitive without positions.
#[must_use]
pub fn of_all_primitives() -> Vec<u8> {
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
    data.glb(json!({ "nodes": [{ "mesh": 0 }], "meshes": [{ "primitives": primitives }] }))
}

/// Two triangles: positions as normalised integers with a stride, and positions that are zeros of which two are replaced.
#[must_use]
pub fn strided_and_sparse() -> Vec<u8> {
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
    data.glb(json!({
        "extensionsRequired": ["KHR_mesh_quantization", "KHR_materials_unlit"],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [primitive(small), primitive(sparse)] }],
    }))
}

/// A band of three vertices that two joints bend: the first follows joint 0, the last joint 1, the middle one both. Joint 1 sits
/// at x = 1 and turns a quarter in one second; the whole skeleton stands at z = 4. The node of the mesh is elsewhere.
#[must_use]
pub fn skinned(influences: usize) -> Vec<u8> {
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

/// A triangle with two morph targets, the second without positions: the first lifts vertex 2 by 4. `extra` replaces entries of
/// the JSON.
#[must_use]
pub fn morphed(interpolation: &str, weights: &[f32], extra: &Value) -> Vec<u8> {
    let mut data = Data::default();
    let positions = data.floats("VEC3", &TRIANGLE);
    let lift = data.floats("VEC3", &[[0.0; 3], [0.0; 3], [0.0, 0.0, 4.0]]);
    let times = data.times(&[0.5, 1.0]);
    let weights = data.times(weights);
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

/// The tangents of a second target and those at the ends move nothing; out of the first key go 8 a second.
pub const MORPH_SPLINE: [f32; 12] = [9.0, 9.0, 0.0, 0.0, 8.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9.0, 9.0];

/// A triangle with three animations of two seconds that go up. The first moves a node that shows nothing. The second, "walk", moves a
/// node above that of the triangle by 6, the third, "jump", that one by 12.
#[must_use]
pub fn of_several_animations() -> Vec<u8> {
    of_animations_from(0.0)
}

/// A triangle with the animations of [`of_several_animations`], which begin at a time (s).
#[must_use]
pub fn of_animations_from(begin_s: f32) -> Vec<u8> {
    let mut data = Data::default();
    let positions = data.floats("VEC3", &TRIANGLE);
    let times = data.times(&[begin_s, begin_s + 2.0]);
    let mut clip = |name: &str, node: usize, height: f32| {
        let path = data.floats("VEC3", &[[0.0; 3], [0.0, 0.0, height]]);
        json!({ "name": name,
                "channels": [{ "sampler": 0, "target": { "node": node, "path": "translation" } }],
                "samplers": [{ "input": times, "output": path }] })
    };
    let clips = [clip("", 2, 6.0), clip("walk", 1, 6.0), clip("jump", 0, 12.0)];
    data.glb(json!({
        "nodes": [{ "mesh": 0 }, { "children": [0] }, {}],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions } }] }],
        "animations": clips,
    }))
}
