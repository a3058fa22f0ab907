//! glTF: texture coordinates, materials, images and colours of vertices, against what is worked out by hand.

use super::*;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use isv_io::Animation;
use isv_testfiles::gltf::{Data, SQUARE, TRIANGLE};
use isv_testfiles::image::{self, four_colours};
use isv_volume::Wrap;
use serde_json::{Value, json};
use std::sync::Arc;

/// The middles of the four pixels, from the upper left one clockwise.
const MIDDLES: [[f32; 2]; 4] = [[0.25, 0.25], [0.75, 0.25], [0.75, 0.75], [0.25, 0.75]];

/// A square with a texture of four colours in the file. `edit` changes the JSON, given the number of the texture coordinates.
fn square(edit: impl FnOnce(&mut Value, &mut Data)) -> Vec<u8> {
    let mut data = Data::default();
    let positions = data.floats("VEC3", &SQUARE);
    let coordinates = data.floats("VEC2", &MIDDLES);
    let indices = data.shorts(&[0, 1, 2, 0, 2, 3]);
    let view = data.view(&four_colours());
    let attributes = json!({ "POSITION": positions, "TEXCOORD_0": coordinates });
    let mut json = json!({
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": attributes, "indices": indices, "material": 0 }] }],
        "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
        "textures": [{ "source": 0 }],
        "images": [{ "bufferView": view, "mimeType": "image/png" }],
    });
    edit(&mut json, &mut data);
    data.glb(json)
}

fn mesh(glb: &[u8]) -> TriangleMesh {
    as_mesh(parse("a.glb", glb).unwrap())
}

/// Colours of the corners of both triangles of the square.
fn corners(mesh: &TriangleMesh) -> [[u8; 3]; 4] {
    [corner(mesh, 0, 0), corner(mesh, 0, 1), corner(mesh, 0, 2), corner(mesh, 1, 2)]
}

const CLOCKWISE: [[u8; 3]; 4] = [RED, GREEN, WHITE, BLUE];

#[test]
fn v_goes_down_in_gltf_and_any_numbers_may_be_coordinates() {
    assert_eq!(corners(&mesh(&square(|_, _| ()))), CLOCKWISE);
    for (component, largest) in [(5121, 255.0f32), (5123, 65535.0)] {
        let glb = square(|json, data| {
            let values = MIDDLES.map(|middle| middle.map(|value| (value * largest) as u16));
            let bytes: Vec<u8> = match component {
                5121 => values.iter().flat_map(|[u, v]| [*u as u8, *v as u8, 0, 0]).collect(),
                _ => values.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect(),
            };
            let view = data.view(&bytes);
            data.views[view]["byteStride"] = 4.into();
            let accessor = json!({
                "bufferView": view, "componentType": component, "normalized": true, "type": "VEC2", "count": 4,
            });
            json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = data.accessor(accessor).into();
        });
        let near = |a: [u8; 3], b: [u8; 3]| (0..3).all(|channel| a[channel].abs_diff(b[channel]) <= 2);
        let found = corners(&mesh(&glb));
        assert!((0..4).all(|corner| near(found[corner], CLOCKWISE[corner])), "{found:?}");
    }
}

#[test]
fn a_texture_names_its_set_and_its_transform() {
    let glb = square(|json, data| {
        let turned = data.floats("VEC2", &[MIDDLES[1], MIDDLES[2], MIDDLES[3], MIDDLES[0]]);
        json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_3"] = turned.into();
        json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = 3.into();
    });
    assert_eq!(corners(&mesh(&glb)), [GREEN, WHITE, BLUE, RED]);
    let glb = square(|json, data| {
        let none = data.floats("VEC2", &[[0.0; 2]; 4]);
        json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = none.into();
        let texture = &mut json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
        texture["texCoord"] = 1.into();
        // Upside down.
        let transform = json!({ "offset": [0, 1], "scale": [1, -1], "texCoord": 0 });
        texture["extensions"] = json!({ "KHR_texture_transform": transform });
    });
    assert_eq!(corners(&mesh(&glb)), [BLUE, WHITE, GREEN, RED]);
}

#[test]
fn samplers_say_how_textures_go_on() {
    let glb = square(|json, _| {
        json["samplers"] = json!([{ "wrapS": 33071, "wrapT": 33648 }]);
        json["textures"][0]["sampler"] = 0.into();
    });
    assert_eq!(appearance(&mesh(&glb)).materials[0].wrap, [Wrap::Clamp, Wrap::Mirror]);
    assert_eq!(appearance(&mesh(&square(|_, _| ()))).materials[0].wrap, [Wrap::Repeat; 2]);
}

#[test]
fn images_may_lie_anywhere_and_be_of_any_kind() {
    let data_uri = format!("data:image/png;base64,{}", STANDARD.encode(four_colours()));
    let glb = square(|json, _| json["images"] = json!([{ "uri": data_uri }]));
    assert_eq!(corners(&mesh(&glb)), CLOCKWISE);
    let glb = square(|json, _| json["images"] = json!([{ "uri": "tex/a%20b.png" }]));
    let linked = as_mesh(read(&[("a.glb", &glb), ("tex/a b.png", &four_colours())]).unwrap());
    assert_eq!(corners(&linked), CLOCKWISE);
    for (extension, file) in
        [("EXT_texture_webp", image::LOSSLESS_WEBP), ("KHR_texture_basisu", image::UASTC_KTX2)]
    {
        let glb = square(|json, data| {
            let view = data.view(file);
            json["images"] = json!([{ "bufferView": view }]);
            json["textures"] = json!([{ "extensions": { extension: { "source": 0 } } }]);
            json["extensionsRequired"] = json!([extension]);
        });
        let found = corner(&mesh(&glb), 0, 0);
        assert!((0..3).all(|i| found[i].abs_diff([64, 64, 128][i]) <= 6), "{extension}: {found:?}");
    }
}

#[test]
fn factors_are_linear_and_multiply() {
    let glb = square(|json, _| {
        json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.5, 0.0, 1.0, 0.3]);
    });
    assert_eq!(corners(&mesh(&glb)), [[188, 0, 0], [0; 3], [188, 0, 255], BLUE]);
    let glb = square(|json, _| {
        let older = json!({ "diffuseFactor": [0, 1, 0, 1], "diffuseTexture": { "index": 0 } });
        json["materials"][0]["extensions"] = json!({ "KHR_materials_pbrSpecularGlossiness": older });
    });
    assert_eq!(corners(&mesh(&glb)), [[0; 3], GREEN, GREEN, [0; 3]]);
}

#[test]
fn vertex_colours_are_linear_and_of_any_numbers() {
    // Half the light is 188 of 255.
    let colours: [[f32; 4]; 4] =
        [[1.0, 0.0, 0.0, 0.5], [0.5, 0.0, 0.0, 1.0], [0.0, 0.0, 9.0, 1.0], [f32::NAN; 4]];
    let expected = [RED, [188, 0, 0], BLUE, WHITE];
    let with = |accessor: &dyn Fn(&mut Data) -> usize| {
        let glb = square(|json, data| {
            json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = accessor(data).into();
            json["materials"] = json!([{}]);
        });
        appearance(&mesh(&glb)).vertex_colours.clone()
    };
    assert_eq!(with(&|data| data.floats("VEC4", &colours)), expected);
    assert_eq!(with(&|data| data.floats("VEC3", &colours.map(|[r, g, b, _]| [r, g, b]))), expected);
    for normalized in [true, false] {
        let shorts = |data: &mut Data| {
            let values = [[65535u16, 0, 0, 0], [32768, 0, 0, 0], [0, 0, 65535, 0], [65535; 4]];
            let view =
                data.view(&values.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>());
            data.accessor(json!({
                "bufferView": view, "componentType": 5123, "normalized": normalized, "type": "VEC4", "count": 4,
            }))
        };
        assert_eq!(with(&shorts), expected);
    }
    let bytes = |data: &mut Data| {
        let view = data.view(&[255, 0, 0, 0, 0, 255, 0, 0, 0, 0, 255, 0, 255, 255, 255, 0]);
        data.views[view]["byteStride"] = 4.into();
        data.accessor(json!({ "bufferView": view, "componentType": 5121, "normalized": true, "type": "VEC3", "count": 4 }))
    };
    assert_eq!(with(&bytes), [RED, GREEN, BLUE, WHITE]);
}

#[test]
fn primitives_have_their_materials_and_share_their_vertices() {
    let glb = square(|json, data| {
        let primitive = json["meshes"][0]["primitives"][0].clone();
        let mut flat = primitive.clone();
        flat["material"] = 1.into();
        let mut bare = primitive.clone();
        bare.as_object_mut().unwrap().remove("material");
        let mut odd = primitive.clone();
        odd["material"] = (-1).into();
        let mut coloured = primitive.clone();
        coloured["attributes"]["COLOR_0"] = data.floats("VEC3", &[[0.0, 1.0, 0.0]; 4]).into();
        json["meshes"][0]["primitives"] = json!([primitive, flat, bare, odd, coloured]);
        let flat = json!({ "pbrMetallicRoughness": { "baseColorFactor": [1, 0, 0, 1] }, "extensions": { "KHR_materials_unlit": {} } });
        json["materials"].as_array_mut().unwrap().push(flat);
    });
    let mesh = mesh(&glb);
    assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (8, 10), "colours make vertices of their own");
    let found: Vec<_> = (0..5).map(|primitive| corner(&mesh, 2 * primitive, 2)).collect();
    assert_eq!(found, [WHITE, RED, WHITE, WHITE, GREEN]);
    assert_eq!(appearance(&mesh).materials.len(), 3);
}

/// Images of one address, or of one view, are decoded and counted once.
#[test]
fn images_that_are_the_same_are_one() {
    let twice = |images: fn(&Value) -> Value| {
        square(|json, _| {
            let mut second = json["meshes"][0]["primitives"][0].clone();
            second["material"] = 1.into();
            json["meshes"][0]["primitives"].as_array_mut().unwrap().push(second);
            json["images"] = images(&json["images"][0]);
            json["textures"] = json!([{ "source": 0 }, { "source": 1 }]);
            let mut material = json["materials"][0].clone();
            material["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 1.into();
            json["materials"].as_array_mut().unwrap().push(material);
        })
    };
    let of_views = mesh(&twice(|image| json!([image, image])));
    let of_files = twice(|_| json!([{ "uri": "a.png" }, { "uri": "a.png" }]));
    let of_files = as_mesh(read(&[("a.glb", &of_files), ("a.png", &four_colours())]).unwrap());
    for mesh in [of_views, of_files] {
        let materials = &appearance(&mesh).materials;
        let textures: Vec<_> = materials.iter().map(|material| material.texture.as_ref().unwrap()).collect();
        assert!(textures.len() == 2 && Arc::ptr_eq(textures[0], textures[1]));
    }
}

#[test]
fn mirrors_turn_texture_coordinates_over_too() {
    let glb = square(|json, _| json["nodes"][0]["scale"] = json!([-1, 1, 1]));
    let mesh = mesh(&glb);
    assert_eq!(mesh.triangles[0], [0, 2, 1]);
    assert_eq!([0, 1, 2].map(|i| corner(&mesh, 0, i)), [RED, WHITE, GREEN]);
}

#[test]
fn a_file_without_colours_has_none() {
    for material in
        [json!({}), json!({ "doubleSided": true, "pbrMetallicRoughness": { "metallicFactor": 0 } })]
    {
        let glb = square(|json, _| json["materials"] = json!([material]));
        assert_eq!(mesh(&glb).appearance, None);
    }
}

#[test]
fn broken_looks_name_their_objects_and_stop_nobody_who_wants_no_colours() {
    type Edit = fn(&mut Value);
    let cases: [(Edit, &str); 9] = [
        (|json| json["images"] = json!([{ "uri": "gone.png" }]), "image `gone.png`: cannot be read: "),
        (
            |json| json["images"] = json!([{ "uri": "%2e%2e/a.png" }]),
            "image `../a.png`: its name leaves the folder of the file",
        ),
        (|json| json["images"] = json!([{ "uri": "http://a/b.png" }]), "its name is absolute or remote"),
        (
            |json| json["images"] = json!([{ "uri": "data:image/png,abc" }]),
            "its name is data, but not base64",
        ),
        (
            |json| json["images"] = json!([{ "name": "skin", "bufferView": 0 }]),
            "image `skin`: not a PNG, JPEG, ",
        ),
        (|json| json["images"] = json!([{}]), "has no image that can be read (image 0)"),
        (|json| json["textures"] = json!([{}]), "has no image that can be read (texture 0)"),
        (|json| json["textures"] = json!([]), "names texture 0 of 0 (material 0)"),
        (|json| json["materials"] = json!([]), "names material 0 of 0 (mesh 0)"),
    ];
    for (edit, expected) in cases {
        let text = message(&[("a.glb", &square(|json, _| edit(json)))]);
        assert!(text.starts_with("a.glb: ") && text.contains(expected), "{text}");
    }
    let wrong = square(|json, _| json["materials"] = json!([{ "pbrMetallicRoughness": 7 }]));
    assert!(message(&[("a.glb", &wrong)]).contains("its JSON cannot be understood"));
    let short = square(|json, data| {
        let three = data.floats("VEC2", &[[0.0; 2]; 3]);
        json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = three.into();
    });
    assert!(message(&[("a.glb", &short)]).contains("has 3 elements where 4 are needed"));
}

#[test]
fn textures_without_coordinates_give_the_base_colour() {
    let glb = square(|json, data| {
        json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([1, 0, 0, 1]);
        let mut bare = json["meshes"][0]["primitives"][0].clone();
        bare["attributes"].as_object_mut().unwrap().remove("TEXCOORD_0");
        let broken = data.floats("VEC2", &[[f32::NAN, f32::INFINITY]; 4]);
        let mut nowhere = bare.clone();
        nowhere["attributes"]["TEXCOORD_0"] = broken.into();
        json["meshes"][0]["primitives"] = json!([bare, nowhere]);
    });
    let mesh = mesh(&glb);
    assert_eq!([0, 2].map(|face| corner(&mesh, face, 1)), [RED; 2]);
}

#[test]
fn poses_share_their_colours_until_other_parts_are_shown() {
    let glb = square(|json, data| {
        let times = data.times(&[0.0, 1.0]);
        let path = data.floats("VEC3", &[[0.0; 3], [0.0, 0.0, 6.0]]);
        let scales = data.floats("VEC3", &[[1.0; 3], [0.0; 3]]);
        json["nodes"] = json!([{ "mesh": 0 }, { "mesh": 0 }]);
        json["animations"] = json!([{
            "channels": [
                { "sampler": 0, "target": { "node": 0, "path": "translation" } },
                { "sampler": 1, "target": { "node": 1, "path": "scale" } },
            ],
            "samplers": [
                { "input": times, "output": path },
                { "input": times, "output": scales, "interpolation": "STEP" },
            ],
        }]);
    });
    let animation = Animation::parse_with(Path::new("a.glb"), &glb, &KEEP).unwrap();
    let at = |seconds: f64| animation.mesh_at(seconds).unwrap();
    let poses = [0.0, 0.5, 1.0, 0.25].map(at);
    let looks = poses.each_ref().map(|mesh| mesh.appearance.as_ref().unwrap());
    assert!(Arc::ptr_eq(looks[0], looks[1]) && !Arc::ptr_eq(looks[1], looks[2]));
    assert_eq!(poses.each_ref().map(|mesh| mesh.triangles.len()), [4, 4, 2, 4]);
    for mesh in &poses {
        mesh.validate().unwrap();
        assert_eq!(corner(mesh, mesh.triangles.len() - 1, 2), BLUE);
    }
    let textures = looks.map(|look| look.materials[0].texture.as_ref().unwrap());
    assert!(textures.iter().all(|texture| Arc::ptr_eq(texture, textures[0])), "decoded once");
}

#[test]
fn points_have_colours() {
    let mut data = Data::default();
    let positions = data.floats("VEC3", &TRIANGLE);
    let colours = data.floats("VEC3", &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let glb = data.glb(json!({
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [
            { "attributes": { "POSITION": positions }, "mode": 0 },
            { "attributes": { "POSITION": positions, "COLOR_0": colours }, "mode": 0 },
        ] }],
    }));
    let points = as_points(parse("a.glb", &glb).unwrap());
    assert_eq!(points.colours, [WHITE, WHITE, WHITE, RED, GREEN, BLUE]);
}

/// Streams of `draco_encoder`: a square with the texture coordinates of [`MIDDLES`] upside down, and a triangle with colours.
const DRACO_SQUARE: &str = "RFJBQ08CAgEBAAAABAIBAgAAAR//ARH/AREC/wAAAAAAAQAJAwAAAgEDCQIAAQIBAQEAAwMBMAEQAwAogpgAAAAAAP8/AAAAAAAAAAAAAAAA\
    AAAAAIA/DgUBAQADAwEwARADACSCJgACAAAAAQEgAAAAAP8PAAAAAIA+AACAPgAAAD8M";
const DRACO_TRIANGLE: &str = "RFJBQ08CAgEBAAAAAwEBAQAAAQf/AREBAQAC/wAAAAAAAQAJAwAAAgECAgMBAQEBAQEAAwNVFa0qAwRwgTEQAAAAAP8/AAAAAAAAAAAAAAAA\
    AAAAAIA/DgEBAQADA1UVrSoDBHCBwkIAAAAA/wAAAA==";

#[test]
fn draco_streams_hold_texture_coordinates_and_colours() {
    let with_stream = |name: &str, stream: &str, shape: &str, component: u32| {
        square(|json, data| {
            let view = data.view(&STANDARD.decode(stream).unwrap());
            let accessor = |data: &mut Data, shape: &str, component: u32| {
                let normalized = component != 5126;
                data.accessor(json!({ "componentType": component, "normalized": normalized, "type": shape, "count": 4 }))
            };
            let (positions, values) = (accessor(data, "VEC3", 5126), accessor(data, shape, component));
            json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
            json["meshes"][0]["primitives"] = json!([{
                "attributes": { "POSITION": positions, name: values },
                "material": 0,
                "extensions": {
                    "KHR_draco_mesh_compression": { "bufferView": view, "attributes": { "POSITION": 0, name: 1 } },
                },
            }]);
        })
    };
    let near = |found: [u8; 3], expected: [u8; 3]| (0..3).all(|i| found[i].abs_diff(expected[i]) <= 2);
    let textured = mesh(&with_stream("TEXCOORD_0", DRACO_SQUARE, "VEC2", 5126));
    let expected = [BLUE, WHITE, GREEN, RED];
    for face in 0..2 {
        for i in 0..3 {
            let position = textured.corners(face)[i].round();
            let place = SQUARE.iter().position(|p| [p[0], p[1]] == [position.x as f32, position.y as f32]);
            let found = corner(&textured, face, i);
            assert!(near(found, expected[place.unwrap()]), "{position}: {found:?}");
        }
    }
    let coloured = mesh(&with_stream("COLOR_0", DRACO_TRIANGLE, "VEC3", 5121));
    for (position, colour) in coloured.vertices.iter().zip(&appearance(&coloured).vertex_colours) {
        let place = TRIANGLE
            .iter()
            .position(|p| [p[0], p[1]] == [position.x.round() as f32, position.y.round() as f32]);
        assert_eq!(*colour, [RED, GREEN, BLUE][place.unwrap()]);
    }
}
