//! OBJ with MTL, PLY and OFF.

use super::*;
use isv_testfiles::image::four_colours;
use isv_volume::Wrap;
use std::sync::Arc;

/// A square whose corners lie in the middles of the four pixels: blue, white, green, red.
const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt .25 .25\nvt .75 .25\nvt .75 .75\nvt .25 .75\n";

fn obj(records: &str, mtl: &str) -> TriangleMesh {
    let text = format!("mtllib my skins.mtl\n{SQUARE}{records}");
    let files: [(&str, &[u8]); 3] =
        [("a.obj", text.as_bytes()), ("my skins.mtl", mtl.as_bytes()), ("tex/a b.png", &four_colours())];
    as_mesh(read(&files).unwrap())
}

#[test]
fn v_goes_up_in_obj() {
    let mesh = obj("usemtl a\nf 1/1 2/2 3/3 4/-1\n", "newmtl a\nmap_Kd tex\\a b.png\n");
    assert_eq!([0, 1, 2].map(|i| corner(&mesh, 0, i)), [BLUE, WHITE, GREEN]);
    assert_eq!([0, 1, 2].map(|i| corner(&mesh, 1, i)), [BLUE, GREEN, RED]);
    assert_eq!(appearance(&mesh).materials.len(), 1);
    assert!(appearance(&mesh).face_materials.is_empty());
}

#[test]
fn faces_have_their_materials_and_some_no_coordinates() {
    let records = "f 1/1 2/2 3/3\nusemtl flat\nf 1 2 3\nusemtl skin #1\nf 1//1 2//2 3//3\nf 1/1 2/9 3/3\nusemtl none\nf 1 2 3\n";
    let mtl = "newmtl flat\nKd 0 1 0\nnewmtl skin #1\nKd 1 0 1\nmap_Kd -clamp on tex/a b.png\nnewmtl unused\nmap_Kd gone.png\n";
    let mesh = obj(records, mtl);
    let found: Vec<_> = (0..5).map(|face| corner(&mesh, face, 0)).collect();
    assert_eq!(found, [WHITE, GREEN, [255, 0, 255], [255, 0, 255], WHITE]);
    let appearance = appearance(&mesh);
    assert_eq!(appearance.face_materials, [0, 1, 2, 2, 0]);
    assert_eq!(appearance.materials[2].wrap, [Wrap::Clamp; 2]);
    assert!(appearance.texture_coordinates[3][1][0].is_nan());
}

#[test]
fn texture_coordinates_follow_the_corners_of_clipped_polygons() {
    let text = "mtllib a.mtl\nusemtl a\nv 0 0 0\nv 4 1 0\nv 0 2 0\nv 1 1 0\nvt 0 0\nvt 4 1\nvt 0 2\nvt 1 1\nf 1/1 2/2 3/3 4/4\n";
    let mesh = as_mesh(
        read(&[("a.obj", text.as_bytes()), ("a.mtl", b"newmtl a\nmap_Kd a.png"), ("a.png", &four_colours())])
            .unwrap(),
    );
    for (triangle, corners) in mesh.triangles.iter().zip(&appearance(&mesh).texture_coordinates) {
        for (vertex, [u, v]) in triangle.iter().zip(corners) {
            let position = mesh.vertices[*vertex as usize];
            assert_eq!([f64::from(*u), 1.0 - f64::from(*v)], [position.x, position.y]);
        }
    }
}

/// The colours of vertices show where no texture does.
#[test]
fn a_texture_replaces_the_colours_of_its_vertices() {
    let grey = ["v 0 0 0 .1 .1 .1", "v 1 0 0 .2 .2 .2", "v 1 1 0 .3 .3 .3"];
    let green = ["v 0 0 1 0 1 0", "v 0 1 1 0 1 0", "v 1 0 1 0 1 0"];
    let coordinates = ["vt .25 .25", "vt .75 .25", "vt .75 .75"];
    let faces = ["mtllib a.mtl", "usemtl a", "f 1/1 2/2 3/3", "f 4 5 6"];
    let text = [&grey[..], &green, &coordinates, &faces].concat().join("\n");
    let library: &[u8] = b"newmtl a\nmap_Kd a.png";
    let files = [("a.obj", text.as_bytes()), ("a.mtl", library), ("a.png", &four_colours())];
    let mesh = as_mesh(read(&files).unwrap());
    assert_eq!([0, 1, 2].map(|i| corner(&mesh, 0, i)), [BLUE, WHITE, GREEN]);
    assert_eq!(corner(&mesh, 1, 0), GREEN);

    let rows = "0 0 0 9 9 9 .25 .25\n1 0 0 9 9 9 .75 .25\n1 1 0 9 9 9 .75 .75\n3 0 1 2\n";
    let header = format!(
        "comment TextureFile a.png\nelement vertex 3\n{XYZ}property uchar red\nproperty uchar green\nproperty uchar blue\n\
         property float s\nproperty float t\nelement face 1\nproperty list uchar int vertex_indices\n"
    );
    let file = ply(&header, rows);
    let mesh = as_mesh(read(&[("a.ply", &file), ("a.png", &four_colours())]).unwrap());
    assert_eq!([0, 1, 2].map(|i| corner(&mesh, 0, i)), [BLUE, WHITE, GREEN]);
    assert!(appearance(&mesh).vertex_colours.is_empty());
}

#[test]
fn options_scale_and_move_the_texture() {
    let mesh = obj("usemtl a\nf 1/1 2/2 3/3\n", "newmtl a\nmap_Kd -s 1 -1 -o 0 1 tex/a b.png\n");
    assert_eq!([0, 1, 2].map(|i| corner(&mesh, 0, i)), [RED, GREEN, WHITE], "upside down");
}

#[test]
fn black_under_a_texture_is_white() {
    let mesh = obj("usemtl a\nf 1/1 2/2 3/3\n", "newmtl a\nKd 0 0 0\nmap_Kd tex/a b.png\n");
    assert_eq!(corner(&mesh, 0, 0), BLUE);
    let mesh = obj("usemtl a\nf 1/1 2/2 3/3\n", "newmtl a\nKd 0 0 0\n");
    assert_eq!(corner(&mesh, 0, 0), [0; 3]);
}

#[test]
fn vertex_colours_are_of_either_scale() {
    for (full, half) in [("1", "0.5"), ("255", "127.5"), ("255", "128")] {
        let text = format!("v 0 0 0 {full} 0 0\nv 1 0 0 0 {half} 0 1\nv 0 1 0\nf 1 2 3\n");
        let mesh = as_mesh(read(&[("a.obj", text.as_bytes())]).unwrap());
        assert_eq!(appearance(&mesh).vertex_colours, [RED, [0, 128, 0], WHITE], "{full}");
    }
    let points = as_points(read(&[("a.obj", b"v 0 0 0 1 0 0\nv 1 0 0 0 1 0\np 2 1 1\n")]).unwrap());
    assert_eq!(points.colours, [GREEN, RED, RED]);
}

#[test]
fn a_file_without_colours_has_none() {
    for text in ["", "mtllib gone.mtl\nusemtl a\n", "vt 0 0\n"] {
        let text = format!("{text}v 0 0 0\nv 1 0 0 1\nv 0 1 0\nf 1/1 2/1 3/1\n");
        assert_eq!(as_mesh(read(&[("a.obj", text.as_bytes())]).unwrap()).appearance, None, "{text}");
    }
    let text = format!("mtllib a.mtl\n{SQUARE}usemtl a\nf 1/1 2/2 3/3\n");
    assert_eq!(as_mesh(parse("a.obj", text.as_bytes()).unwrap()).appearance, None, "nothing lies beside");
}

#[test]
fn several_libraries_and_a_shared_image() {
    let text = format!(
        "mtllib a.mtl b.mtl gone.mtl\nmtllib a.mtl\n{SQUARE}usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3/3\n"
    );
    let library = |name: &str, kd: &str| format!("newmtl {name}\nKd {kd}\nmap_Kd ./a.png\n");
    let (a, b) = (library("a", "1 1 1"), library("b", "0 0 1"));
    let files: [(&str, &[u8]); 4] = [
        ("a.obj", text.as_bytes()),
        ("a.mtl", a.as_bytes()),
        ("b.mtl", b.as_bytes()),
        ("a.png", &four_colours()),
    ];
    let mesh = as_mesh(read(&files).unwrap());
    assert_eq!((corner(&mesh, 0, 2), corner(&mesh, 1, 1)), (GREEN, BLUE));
    let [a, b] = &appearance(&mesh).materials[..] else { panic!() };
    assert!(Arc::ptr_eq(a.texture.as_ref().unwrap(), b.texture.as_ref().unwrap()), "decoded once");
}

#[test]
fn missing_broken_and_outside_images_name_both_files() {
    let message = |map: &str, image: &[u8]| {
        let text = format!("mtllib a.mtl\n{SQUARE}usemtl a\nf 1/1 2/2 3/3\n");
        let mtl = format!("newmtl a\nmap_Kd {map}\n");
        message(&[("a.obj", text.as_bytes()), ("a.mtl", mtl.as_bytes()), ("b.png", image)])
    };
    let missing = message("gone.png", b"");
    assert!(missing.starts_with("a.obj: image `gone.png`: cannot be read: "), "{missing}");
    assert!(missing.ends_with(" (material 0)"), "{missing}");
    assert_eq!(
        message("b.png", b"hello"),
        "a.obj: image `b.png`: not a PNG, JPEG, WebP or KTX2 image (material 0)"
    );
    assert!(message("b.png", b"").contains("the file is empty"));
    let broken = message("b.png", &four_colours()[..40]);
    assert!(broken.contains("not a readable PNG image"), "{broken}");
    for outside in ["../b.png", "/etc/passwd", "C:\\skins\\b.png", "..\\b.png"] {
        let text = message(outside, b"");
        assert!(text.contains("leaves the folder of the file; linked files must lie beside it"), "{text}");
    }
    let text = format!("mtllib ../a.mtl\n{SQUARE}usemtl a\nf 1/1 2/2 3/3\n");
    let text = super::message(&[("a.obj", text.as_bytes())]);
    assert!(text.starts_with("a.obj: material library `../a.mtl`: its name leaves the folder"), "{text}");
}

fn ply(header: &str, body: &str) -> Vec<u8> {
    format!("ply\nformat ascii 1.0\n{header}end_header\n{body}").into_bytes()
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";

#[test]
fn vertex_colours_of_ply_have_many_names_and_types() {
    for (names, kind, values) in [
        (["red", "green", "blue"], "uchar", ["255 0 0", "0 255 0", "0 0 255"]),
        (["Red", "Green", "Blue"], "ushort", ["65535 0 0", "0 65535 0", "0 0 65535"]),
        (["red", "green", "blue"], "ushort", ["255 0 0", "0 255 0", "0 0 255"]),
        (["r", "g", "b"], "float", ["1 0 0", "0 1 0", "0 0 1"]),
        (["diffuse_red", "diffuse_green", "diffuse_blue"], "double", ["255 0 0", "0 255 0", "0 0 255"]),
    ] {
        let properties: String = names.iter().map(|name| format!("property {kind} {name}\n")).collect();
        let header = format!("element vertex 3\n{XYZ}{properties}property uchar alpha\n");
        let vertices = ["0 0 0", "1 0 0", "0 1 0"].iter().zip(values);
        let vertices: String =
            vertices.map(|(position, colour)| format!("{position} {colour} 9\n")).collect();
        let points = as_points(read(&[("a.ply", &ply(&header, &vertices))]).unwrap());
        assert_eq!(points.colours, [RED, GREEN, BLUE], "{names:?} {kind}");
        let header = format!("{header}element face 1\nproperty list uchar int vertex_indices\n");
        let mesh = as_mesh(read(&[("a.ply", &ply(&header, &format!("{vertices}3 0 1 2\n")))]).unwrap());
        assert_eq!(appearance(&mesh).vertex_colours, [RED, GREEN, BLUE], "{names:?} {kind}");
    }
}

#[test]
fn textures_of_ply_are_of_vertices() {
    for ([u, v], name) in
        [(["s", "t"], "a b.png"), (["u", "v"], "\"a b.png\""), (["texture_u", "texture_v"], "a b.png")]
    {
        let header = format!(
            "comment TextureFile {name}\nelement vertex 3\n{XYZ}property float {u}\nproperty float {v}\n\
             element face 1\nproperty list uchar int vertex_indices\n"
        );
        let file = ply(&header, "0 0 0 .25 .25\n1 0 0 .75 .25\n1 1 0 .75 .75\n3 0 1 2\n");
        let mesh = as_mesh(read(&[("a.ply", &file), ("a b.png", &four_colours())]).unwrap());
        assert_eq!([0, 1, 2].map(|i| corner(&mesh, 0, i)), [BLUE, WHITE, GREEN]);
        let text = message(&[("a.ply", &file)]);
        assert!(text.starts_with("a.ply: image `a b.png`: cannot be read"), "{text}");
    }
}

#[test]
fn textures_of_ply_are_of_faces_as_meshlab_writes_them() {
    let header = format!(
        "comment VCGLIB generated\ncomment TextureFile a.png\ncomment TextureFile b.png\nelement vertex 4\n{XYZ}\
         element face 5\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int texnumber\n"
    );
    let body = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 6 .25 .25 .75 .25 .75 .75 0\n3 0 1 2 6 .25 .25 .75 .25 .75 .75 1\n\
                3 0 1 2 0 0\n3 0 1 2 6 0 0 0 0 0 0 -1\n4 0 1 2 3 8 .25 .25 .75 .25 .75 .75 .25 .75 0\n";
    let grey = isv_testfiles::image::png(1, png::ColorType::Grayscale, png::BitDepth::Eight, &[9]);
    let file = ply(&header, body);
    let mesh = as_mesh(read(&[("a.ply", &file), ("a.png", &four_colours()), ("b.png", &grey)]).unwrap());
    let found: Vec<_> = (0..6).map(|face| corner(&mesh, face, 2)).collect();
    assert_eq!(found, [GREEN, [9; 3], WHITE, WHITE, GREEN, RED]);
    assert_eq!(appearance(&mesh).face_materials, [0, 1, 0, 2, 0, 0]);
}

#[test]
fn faces_of_ply_may_be_painted() {
    let header = format!(
        "element vertex 4\n{XYZ}element face 2\nproperty list uchar int vertex_indices\nproperty uchar red\n\
         property uchar green\nproperty uchar blue\n"
    );
    let body = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 255 0 0\n3 0 1 2 1 2 3\n";
    let mesh = as_mesh(read(&[("a.ply", &ply(&header, body))]).unwrap());
    assert_eq!([0, 1, 2].map(|face| corner(&mesh, face, 0)), [RED, RED, [1, 2, 3]]);
}

#[test]
fn off_has_colours_of_vertices_or_faces() {
    for text in [
        "COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 0 255 0 255\n0 1 0 0 0 255 255\n3 0 1 2\n",
        "COFF 3 1 0\n0 0 0 1.0 0 0 1\n1 0 0 0 1 0 1\n0 1 0 0 0 1 1\n3 0 1 2\n",
        "CNOFF 3 1 0\n0 0 0 0 0 1 1 0 0 1\n1 0 0 0 0 1 0 1 0 1\n0 1 0 0 0 1 0 0 1 1\n3 0 1 2\n",
        "COFF 3 1 0\n0 0 0 1.0 0 0 1 1 0 0 0 1 0 1 0 1 0 0 0 1 1 3 0 1 2",
    ] {
        let mesh = as_mesh(read(&[("a.off", text.as_bytes())]).unwrap());
        assert_eq!(appearance(&mesh).vertex_colours, [RED, GREEN, BLUE], "{text}");
    }
    let painted =
        "OFF\n4 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 0 255 0\n3 0 1 2 7\n3 0 1 2 0 0 255 255\n";
    let mesh = as_mesh(read(&[("a.off", painted.as_bytes())]).unwrap());
    assert_eq!([0, 1, 2, 3].map(|face| corner(&mesh, face, 0)), [GREEN, GREEN, WHITE, BLUE]);
    let plain = as_mesh(read(&[("a.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 7\n")]).unwrap());
    assert_eq!(plain.appearance, None);
}
