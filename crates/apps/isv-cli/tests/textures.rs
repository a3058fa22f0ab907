//! `isv decode --texture`: colour as a texture in files that other programs open.

mod support;

use isv::raw::io::{Colours, Geometry, ReadOptions, Unit, read_geometry_as};
use isv::raw::volume::TriangleMesh;
use isv_testkit::capture;
use std::io::Cursor;
use support::Workspace;

/// Encodes a ball that turns its colours, in frames of 2 cm voxels.
fn with_coloured_stream(frames: usize) -> Workspace {
    let work = Workspace::with_painted_balls(frames);
    work.isv(&["encode", "balls", "-o", "take.isv", "--voxel", "20mm", "--fps", "30"]).done();
    work
}

/// Reads a mesh with its colours.
fn read(work: &Workspace, name: &str) -> TriangleMesh {
    let options = ReadOptions::new(Unit::Metre).with_colours(Colours::Keep);
    match read_geometry_as(&work.path(name), &options).unwrap() {
        Geometry::Mesh(mesh) => mesh,
        Geometry::Points(_) => panic!("{name} has no faces"),
    }
}

/// RGBA pixels of a picture of an input in colour.
fn picture(work: &Workspace, args: &[&str]) -> Vec<u8> {
    let options = ["--shade", "colour", "--background", "transparent"];
    work.isv(&[&["render", "-o", "p.png"], args, &options].concat()).done();
    let bytes = work.read("p.png");
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    pixels
}

/// Peak signal to noise of colours where both pictures show something (dB).
fn psnr_db(a: &[u8], b: &[u8]) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for (a, b) in a.chunks_exact(4).zip(b.chunks_exact(4)).filter(|(a, b)| a[3] == 255 && b[3] == 255) {
        count += 3.0;
        squares += (0..3).map(|c| (f64::from(a[c]) - f64::from(b[c])).powi(2)).sum::<f64>();
    }
    assert!(count > 30_000.0, "the pictures show something");
    10.0 * (255.0f64.powi(2) * count / squares).log10()
}

#[test]
fn textures_come_out_as_glb_and_obj_and_look_as_the_stream_does() {
    let work = with_coloured_stream(2);
    work.isv(&["decode", "take.isv", "--as", "mesh", "--texture", "512", "-o", "glb"]).done();
    assert_eq!(work.names("glb"), ["frame_0000.glb", "frame_0001.glb"]);
    let decode = ["decode", "take.isv", "--texture", "512"];
    work.isv(&[&decode[..], &["-o", "obj", "--format", "obj"]].concat()).done();
    let names =
        ["frame_0000", "frame_0001"].map(|name| ["mtl", "obj", "png"].map(|end| format!("{name}.{end}")));
    assert_eq!(work.names("obj"), names.concat());
    work.isv(&[&decode[..], &["-o", "take.glb"]].concat()).done();
    work.isv(&[&decode[..], &["-o", "one.obj", "--frames", "1..2"]].concat()).done();
    let view = ["--size", "400", "--yaw", "30"];
    let of_stream = picture(&work, &[&["take.isv", "--frame", "1"], &view[..]].concat());
    for name in ["glb/frame_0001.glb", "obj/frame_0001.obj", "one.obj"] {
        let mesh = read(&work, name);
        let appearance = mesh.appearance.as_ref().unwrap();
        assert!(appearance.vertex_colours.is_empty(), "{name}: a viewer would multiply both");
        assert_eq!(appearance.texture_coordinates.len(), mesh.triangles.len());
        assert_eq!(appearance.materials[0].texture.as_ref().unwrap().width(), 512);
        let psnr = psnr_db(&of_stream, &picture(&work, &[&[name], &view[..]].concat()));
        println!("{name}: {psnr:.1} dB");
        assert!(psnr > 45.0, "{name}: {psnr:.1} dB");
    }
    let animated = picture(&work, &[&["take.glb", "--frame", "1"], &view[..]].concat());
    assert!(psnr_db(&of_stream, &animated) > 45.0);
    // What isv wrote is replaced.
    work.isv(&[&decode[..], &["-o", "obj", "--format", "obj", "--target-faces", "500"]].concat()).done();
    assert!(read(&work, "obj/frame_0000.obj").triangles.len() <= 500);
}

#[test]
fn a_texture_that_cannot_be_is_refused_in_a_sentence() {
    let work = with_coloured_stream(1);
    let decode = |more: &[&str]| work.isv(&[&["decode", "take.isv", "--texture", "512"], more].concat());
    decode(&["-o", "out", "--as", "points"]).fails(2, &["a texture is for meshes"]);
    decode(&["-o", "out.ply"]).fails(2, &["ply files hold no texture: use glb or obj"]);
    decode(&["-o", "out", "--format", "stl"]).fails(2, &["stl files hold no texture"]);
    decode(&["-o", "out", "--no-colour"]).fails(2, &["--no-colour leaves out"]);
    decode(&["-o", "-", "--format", "obj"]).fails(2, &["three files"]);
    for side in ["0", "63", "8193", "big"] {
        let run = work.isv(&["decode", "take.isv", "-o", "out", "--texture", side]);
        run.fails(2, &["64 to 8192 texels"]);
    }
    work.isv(&["encode", "balls", "-o", "grey.isv", "--voxel", "20mm", "--no-colour"]).done();
    let run = work.isv(&["decode", "grey.isv", "-o", "out", "--texture", "512"]);
    run.fails(1, &["grey.isv", "no colour in this stream"]);
    assert!(!work.path("out").exists());
}

#[test]
fn a_person_in_a_texture_looks_as_the_stream_does() {
    let Some(person) = capture("liam_textured") else { return };
    let work = Workspace::new();
    let person = person.to_str().unwrap();
    work.isv(&["encode", person, "-o", "take.isv", "--voxel", "5mm", "--frames", "0..1"]).done();
    work.isv(&["decode", "take.isv", "-o", "take.glb", "--texture", "2048"]).done();
    for yaw in ["0", "150", "200"] {
        let view = ["--size", "700", "--yaw", yaw];
        let [stream, baked] = ["take.isv", "take.glb"].map(|of| picture(&work, &[&[of], &view[..]].concat()));
        let psnr = psnr_db(&stream, &baked);
        println!("yaw {yaw}: {psnr:.1} dB");
        assert!(psnr >= 43.0, "yaw {yaw}: {psnr:.1} dB");
    }
}
