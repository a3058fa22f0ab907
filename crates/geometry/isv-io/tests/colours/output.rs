//! Colours that are written come back.

use super::*;
use isv_io::{
    Animation, Format, GlbAnimationWriter, GlbEncoding, Placement, decode_image, write_glb_to, write_mesh,
    write_mesh_to, write_points_to,
};
use isv_testfiles::image::{JPEG, four_colours};
use isv_volume::{Image, Material, Rgb, Wrap};
use std::fs;
use std::sync::Arc;

/// A mesh of 256 vertices with all levels of a channel.
fn coloured() -> TriangleMesh {
    let vertex_colours: Vec<Rgb> = (0..=255).map(|level| [level, 255 - level, level / 2]).collect();
    TriangleMesh {
        vertices: (0..256u16)
            .map(|i| [f64::from(i % 16), f64::from(i / 16), f64::from(i % 7)].into())
            .collect(),
        triangles: (0..254).map(|i| [i, i + 1, i + 2]).collect(),
        appearance: Some(Arc::new(Appearance { vertex_colours, ..Appearance::default() })),
        ..TriangleMesh::default()
    }
}

/// A square of two triangles. The first has a texture, and the second, of another material, has none. A third
/// triangle has the texture but no coordinates.
fn textured(image: Arc<Image>) -> TriangleMesh {
    let middles = [[0.25, 0.25], [0.75, 0.25], [0.75, 0.75]];
    let skin = Material { texture: Some(image), base_colour: [1.0, 0.5, 1.0], wrap: [Wrap::Clamp; 2] };
    let flat = Material { base_colour: [0.0, 1.0, 0.0], ..Material::default() };
    TriangleMesh {
        vertices: [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]].map(Into::into).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3], [1, 2, 3]],
        appearance: Some(Arc::new(Appearance {
            texture_coordinates: vec![middles, [[f32::NAN; 2]; 3], [[f32::NAN; 2]; 3]],
            face_materials: vec![0, 1, 0],
            materials: vec![skin, flat],
            ..Appearance::default()
        })),
        ..TriangleMesh::default()
    }
}

fn four() -> Arc<Image> {
    Arc::new(decode_image(&four_colours(), "four").unwrap())
}

/// The colours of all corners of all faces, with where the corners are, in no order.
fn corners(mesh: &TriangleMesh) -> Vec<([i64; 3], Rgb)> {
    mesh.validate().unwrap();
    let of_face = |face: usize| {
        [0, 1, 2].map(|i| {
            (mesh.corners(face)[i].to_array().map(|x| (x * 100.0).round() as i64), corner(mesh, face, i))
        })
    };
    let mut corners: Vec<_> = (0..mesh.triangles.len()).flat_map(of_face).collect();
    corners.sort_unstable();
    corners
}

#[test]
fn vertex_colours_come_back_from_every_format() {
    let mesh = coloured();
    for format in [Format::Ply, Format::Obj, Format::Glb] {
        for normals in [false, true] {
            for tolerance in [f64::INFINITY, 1e-12] {
                let mut mesh = mesh.clone();
                if normals {
                    mesh.normals = vec![[0.0, 0.0, 1.0].into(); 256];
                }
                let placement = Placement { tolerance, ..Placement::default() };
                let mut bytes = Vec::new();
                isv_io::write_mesh_placed(&mut bytes, &mesh, format, &placement).unwrap();
                let read = as_mesh(parse(&format!("a.{format}"), &bytes).unwrap());
                assert_eq!(appearance(&read).vertex_colours, appearance(&mesh).vertex_colours, "{format}");
                assert_eq!(read.triangles, mesh.triangles);
            }
        }
    }
    for encoding in [GlbEncoding::Quantized, GlbEncoding::Meshopt] {
        let mut bytes = Vec::new();
        write_glb_to(&mut bytes, &mesh, encoding, &Placement::default()).unwrap();
        let read = as_mesh(parse("a.glb", &bytes).unwrap());
        assert_eq!(corners(&read), corners(&mesh), "{encoding:?}");
    }
}

#[test]
fn colours_of_points_come_back() {
    let colours: Vec<Rgb> = (0..=255).map(|level| [level, 7, 255 - level]).collect();
    let positions: Vec<_> = (0..256u16).map(|i| [f64::from(i), 0.5, 1.0].into()).collect();
    for format in [Format::Ply, Format::Pcd, Format::Xyz] {
        for normals in [vec![], vec![[0.0, 0.0, 1.0].into(); 256]] {
            let points = PointCloud {
                positions: positions.clone(),
                colours: colours.clone(),
                normals,
                ..PointCloud::default()
            };
            let mut bytes = Vec::new();
            write_points_to(&mut bytes, &points, format).unwrap();
            assert_eq!(as_points(parse(&format!("a.{format}"), &bytes).unwrap()), points, "{format}");
        }
    }
    let dark =
        PointCloud { positions: positions[..1].to_vec(), colours: vec![[1, 0, 1]], ..PointCloud::default() };
    let mut bytes = Vec::new();
    write_points_to(&mut bytes, &dark, Format::Xyz).unwrap();
    assert_eq!(as_points(parse("a.xyz", &bytes).unwrap()).colours, [[1, 0, 1]]);
}

#[test]
fn textures_come_back_from_obj_with_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a b.obj");
    let mesh = textured(four());
    write_mesh(&path, &mesh, Format::Obj).unwrap();
    let read = as_mesh(read_geometry_as(&path, &KEEP).unwrap());
    assert_eq!((read.vertices.len(), &read.triangles), (4, &mesh.triangles), "vertices are not split");
    assert_eq!(corners(&read), corners(&mesh));
    assert_eq!(appearance(&read).materials, appearance(&mesh).materials);
    let mut names: Vec<_> =
        fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort_unstable();
    assert_eq!(names, ["a b.mtl", "a b.obj", "a b.png"]);
    // All of them are ours, and may be written again.
    write_mesh(&path, &mesh, Format::Obj).unwrap();
    fs::write(folder.path().join("a b.png"), JPEG).unwrap();
    let error = write_mesh(&path, &mesh, Format::Obj).unwrap_err().to_string();
    assert!(error.contains("a b.png: cannot write: ") && error.contains("was not made by isv"), "{error}");
    assert_eq!(fs::read(folder.path().join("a b.png")).unwrap(), JPEG);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3, "nothing half written stays");
}

#[test]
fn textures_come_back_from_glb() {
    let mesh = textured(four());
    for encoding in [GlbEncoding::Plain, GlbEncoding::Quantized, GlbEncoding::Meshopt] {
        let mut bytes = Vec::new();
        write_glb_to(&mut bytes, &mesh, encoding, &Placement::default()).unwrap();
        let read = as_mesh(parse("a.glb", &bytes).unwrap());
        assert_eq!(corners(&read), corners(&mesh), "{encoding:?}");
        assert!(appearance(&read).materials.iter().any(|material| material.wrap == [Wrap::Clamp; 2]));
    }
    let mut tinted = textured(four());
    let mut look = Appearance::clone(appearance(&tinted));
    look.vertex_colours = vec![RED, WHITE, [9, 8, 7], BLUE];
    tinted.appearance = Some(Arc::new(look));
    let mut bytes = Vec::new();
    write_mesh_to(&mut bytes, &tinted, Format::Glb).unwrap();
    assert_eq!(corners(&as_mesh(parse("a.glb", &bytes).unwrap())), corners(&tinted));
}

#[test]
fn frames_of_an_animation_have_colours_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    for encoding in [GlbEncoding::Plain, GlbEncoding::Quantized, GlbEncoding::Meshopt] {
        let path = folder.path().join("film.glb");
        let shared = four();
        let other = Arc::new(decode_image(JPEG, "other").unwrap());
        let frames = [
            coloured(),
            textured(Arc::clone(&shared)),
            textured(shared),
            TriangleMesh::default(),
            textured(other),
        ];
        let mut writer = GlbAnimationWriter::create(&path).unwrap().with_encoding(encoding);
        (0..).zip(&frames).for_each(|(second, mesh)| writer.push(f64::from(second), mesh).unwrap());
        writer.finish(5.0).unwrap();
        let bytes = fs::read(&path).unwrap();
        let json = isv_testfiles::gltf::chunks(&bytes).0;
        let json: serde_json::Value = serde_json::from_str(json).unwrap();
        assert_eq!(json["images"].as_array().unwrap().len(), 2, "an image that frames share is written once");
        let film = Animation::open_with(&path, &KEEP).unwrap();
        for (second, mesh) in (0..).zip(&frames) {
            let read = film.mesh_at(f64::from(second) + 0.5).unwrap();
            if mesh.triangles.is_empty() {
                assert_eq!(read, TriangleMesh::default());
            } else {
                assert_eq!(corners(&read), corners(mesh), "{encoding:?} frame {second}");
            }
        }
    }
}

/// Together the textures have more pixels than a mesh may.
#[test]
fn a_long_animation_with_a_texture_a_frame_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let frames = 70;
    let colour = |frame: u8| [frame, 200 - frame, 7];
    let mut writer = GlbAnimationWriter::create(&path).unwrap();
    for frame in 0..frames {
        let image = Image::new(2048, 2048, vec![colour(frame); 2048 * 2048]).unwrap();
        writer.push(f64::from(frame), &textured(Arc::new(image))).unwrap();
    }
    writer.finish(f64::from(frames)).unwrap();
    let film = Animation::open_with(&path, &KEEP).unwrap();
    for frame in [0, 1, frames - 1] {
        let mesh = film.mesh_at(f64::from(frame)).unwrap();
        let materials = &mesh.appearance.as_ref().unwrap().materials;
        let shown: Vec<_> = materials.iter().filter_map(|material| material.texture.as_ref()).collect();
        assert!(shown.len() == 1 && shown[0].pixels()[0] == colour(frame), "frame {frame}");
    }
}

#[test]
#[should_panic(expected = "an appearance fits its mesh")]
fn an_appearance_that_does_not_fit_is_a_wrong_call() {
    let mut mesh = coloured();
    mesh.vertices.push([0.0; 3].into());
    let _ = write_mesh_to(&mut Vec::new(), &mesh, Format::Ply);
}
