//! glTF: at rest as `.glb` and `.gltf`, and what moves.

use super::{Seeds, tetrahedron};
use anyhow::Result;
use isv::raw::io::GlbAnimationWriter;
use isv_testfiles::compressed;
use isv_testfiles::gltf::{
    Data, MORPH_SPLINE, NO_TURN, QUARTER, SQUARE, below_ancestors, embedded, morphed, of_all_primitives,
    of_several_animations, skinned, strided_and_sparse,
};
use serde_json::{Value, json};
use std::fs;

pub(super) fn save(seeds: &mut Seeds) -> Result<()> {
    let mut skipped = vec![
        below_ancestors(),
        of_all_primitives(),
        strided_and_sparse(),
        long_indices(),
        sparse_over_values(),
    ];
    skipped.extend(compressed::DRACO_STREAMS.map(|(_, stream)| compressed::draco(stream)));
    skipped.extend(compressed::meshopt().map(|(_, glb)| glb));
    let moving = [
        frame_by_frame()?,
        skinned(1),
        skinned(2),
        skinned_by_integers(),
        morphed("LINEAR", &[0.0, 7.0, 1.0, 7.0], &Value::Null),
        morphed("STEP", &[0.5, 7.0, 1.0, 7.0], &Value::Null),
        morphed("CUBICSPLINE", &MORPH_SPLINE, &Value::Null),
        of_several_animations(),
        moved("LINEAR", 1),
        moved("STEP", 1),
        moved("CUBICSPLINE", 3),
    ];
    for glb in skipped.iter().chain(&moving) {
        seeds.save("glb", glb)?;
        seeds.save("gltf", &embedded(glb))?;
    }
    moving.iter().try_for_each(|glb| seeds.save("animation", glb))
}

/// A film as the library writes it.
fn frame_by_frame() -> Result<Vec<u8>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("frame.glb");
    let mut writer = GlbAnimationWriter::create(&path)?;
    for frame in 0..2 {
        writer.push(f64::from(frame) / 30.0, &tetrahedron())?;
    }
    writer.finish(2.0 / 30.0)?;
    Ok(fs::read(path)?)
}

/// Indices of 32 bits, in a list, a strip and a fan.
fn long_indices() -> Vec<u8> {
    let mut data = Data::default();
    let positions = data.floats("VEC3", &SQUARE);
    let bytes: Vec<u8> = [0u32, 1, 2, 3, 2, 1].iter().flat_map(|index| index.to_le_bytes()).collect();
    let indices = data.of_bytes("SCALAR", 5125, 6, &bytes);
    let primitive =
        |mode: u32| json!({ "attributes": { "POSITION": positions }, "indices": indices, "mode": mode });
    let primitives = [4, 5, 6].map(primitive);
    data.glb(json!({ "nodes": [{ "mesh": 0 }], "meshes": [{ "primitives": primitives }] }))
}

/// Positions of which one is replaced, by an index of 16 bits.
fn sparse_over_values() -> Vec<u8> {
    let mut data = Data::default();
    let values = SQUARE.as_flattened().iter().flat_map(|value| value.to_le_bytes());
    let view = data.view(&values.collect::<Vec<_>>());
    let (places, values) = (data.view(&[3, 0]), data.view(&[0; 12]));
    let positions = data.accessor(json!({
        "bufferView": view, "componentType": 5126, "type": "VEC3", "count": 4,
        "sparse": {
            "count": 1,
            "indices": { "bufferView": places, "componentType": 5123 },
            "values": { "bufferView": values },
        },
    }));
    let primitives = json!([{ "attributes": { "POSITION": positions }, "mode": 5 }]);
    data.glb(json!({ "nodes": [{ "mesh": 0 }], "meshes": [{ "primitives": primitives }] }))
}

/// A skin without matrices, whose joints and weights are integers of 8 and 16 bits.
fn skinned_by_integers() -> Vec<u8> {
    let mut data = Data::default();
    let positions = data.floats("VEC3", &SQUARE);
    let shorts: Vec<u8> = [[0u16, 1, 0, 0]; 4].as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
    let joints = [data.joints(&[[0, 1, 0, 0]; 4]), data.of_bytes("VEC4", 5123, 4, &shorts)];
    let mut weights = |component: u32, bytes: &[u8]| {
        let view = data.view(bytes);
        data.accessor(json!({
            "bufferView": view, "componentType": component, "normalized": true, "type": "VEC4", "count": 4,
        }))
    };
    let weights = [weights(5121, &[100; 16]), weights(5123, &[100; 32])];
    let (times, turns) = (data.times(&[0.0, 1.0]), data.floats("VEC4", &[NO_TURN, QUARTER]));
    let attributes = json!({
        "POSITION": positions, "JOINTS_0": joints[0], "WEIGHTS_0": weights[0], "JOINTS_1": joints[1], "WEIGHTS_1": weights[1],
    });
    data.glb(json!({
        "nodes": [{ "mesh": 0, "skin": 0, "children": [1] }, { "children": [2] }, {}],
        "meshes": [{ "primitives": [{ "attributes": attributes, "mode": 6 }] }],
        "skins": [{ "joints": [1, 2] }],
        "animations": [{
            "channels": [{ "sampler": 0, "target": { "node": 1, "path": "rotation" } }],
            "samplers": [{ "input": times, "output": turns }],
        }],
    }))
}

/// A node of which everything moves; each of its two keys has so many values.
fn moved(interpolation: &str, values_per_key: usize) -> Vec<u8> {
    let mut data = Data::default();
    let positions = data.floats("VEC3", &SQUARE);
    let times = data.times(&[0.0, 0.05]);
    let outputs = [
        data.floats("VEC3", &vec![[1.0, 2.0, 3.0]; 2 * values_per_key]),
        data.floats("VEC4", &[vec![NO_TURN; values_per_key], vec![QUARTER; values_per_key]].concat()),
        data.floats("VEC3", &vec![[1.0, 2.0, 0.5]; 2 * values_per_key]),
    ];
    let channel = |(sampler, path)| json!({ "sampler": sampler, "target": { "node": 0, "path": path } });
    let channels: Vec<_> = ["translation", "rotation", "scale"].iter().enumerate().map(channel).collect();
    let samplers =
        outputs.map(|output| json!({ "input": times, "output": output, "interpolation": interpolation }));
    data.glb(json!({
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions }, "mode": 6 }] }],
        "animations": [{ "name": interpolation, "channels": channels, "samplers": samplers }],
    }))
}
