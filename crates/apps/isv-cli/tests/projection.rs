//! `isv render --project-from`: textures from the colour images of a rig.

mod support;

use glam::{DVec2, DVec3};
use isv::raw::io::{Colours, Format, Geometry, ReadOptions, Unit, read_geometry_as, write_mesh};
use isv::raw::take::capture::{Capture, Hints};
use isv::raw::take::{FrameRange, Input, MemoryLimit, Projection, Up};
use isv::raw::volume::{CameraPose, Image, Intrinsics, TriangleMesh, ycbcr_from_rgb};
use isv_testkit::{camera_ring, capture, look_at, render_colours, render_depth};
use std::fs;
use std::path::Path;
use std::sync::Arc;
use support::Workspace;

const BACKGROUND: [u8; 3] = [0, 200, 0];

fn lens(width: u32, height: u32, focal: f64) -> Intrinsics {
    let principal = (DVec2::new(f64::from(width), f64::from(height)) - 1.0) / 2.0;
    Intrinsics { width, height, focal: DVec2::splat(focal), principal }
}

fn write_png(path: &Path, image: &Image) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), image.width(), image.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(image.pixels().as_flattened()).unwrap();
}

/// Writes a rig of cameras that see colours alone, `frames` times the same.
fn write_rig(folder: &Path, mesh: &TriangleMesh, lens: &Intrinsics, poses: &[CameraPose], frames: usize) {
    let mut cameras = Vec::new();
    for (number, pose) in poses.iter().enumerate() {
        let image = render_colours(mesh, lens, pose, BACKGROUND);
        for frame in 0..frames {
            write_png(&folder.join(format!("c{number}/{frame}.png")), &image);
        }
        let rows = pose.rotation.transpose().to_cols_array_2d();
        let row = |axis: usize| {
            format!("[{}, {}, {}, {}]", rows[axis][0], rows[axis][1], rows[axis][2], pose.centre[axis])
        };
        let (focal, principal) = (lens.focal, lens.principal);
        cameras.push(format!(
            r#"{{"name": "c{number}", "width": {}, "height": {}, "fx": {}, "fy": {}, "cx": {}, "cy": {},
                "camera_to_world": [{}, {}, {}, [0, 0, 0, 1]], "colour": "c{number}"}}"#,
            lens.width,
            lens.height,
            focal.x,
            focal.y,
            principal.x,
            principal.y,
            row(0),
            row(1),
            row(2),
        ));
    }
    fs::write(folder.join("rig.json"), format!(r#"{{"cameras": [{}]}}"#, cameras.join(", "))).unwrap();
}

/// The surface of the first frame of a stream.
fn surface(stream: &Path) -> (TriangleMesh, f64) {
    struct Silent;
    impl isv::raw::take::Observer for Silent {
        fn event(&self, _: &isv::raw::take::Event) {}
    }
    let hints = Hints::in_unit(Unit::Metre, MemoryLimit::default(), Arc::new(Silent));
    let capture = Capture::open(&Input::from_argument(stream), &hints).unwrap();
    let voxel_m = capture.grid().unwrap().voxel_size.metres();
    let range = capture.range(Some(FrameRange { start: 0, end: 1 })).unwrap();
    (capture.meshes(range).unwrap().next().unwrap().unwrap(), voxel_m)
}

/// PSNR of Y (dB), and the number of pixels that count. In those both meshes are seen, and the other is not
/// the grey of what no camera saw.
fn psnr(one: &TriangleMesh, other: &TriangleMesh, lens: &Intrinsics, pose: &CameraPose) -> (f64, usize) {
    let [a, b] = [one, other].map(|mesh| render_colours(mesh, lens, pose, BACKGROUND));
    let [da, db] = [one, other].map(|mesh| render_depth(mesh, lens, pose));
    let both = (0..lens.pixels()).filter(|p| da.depths_m()[*p] > 0.0 && db.depths_m()[*p] > 0.0);
    let (mut sum, mut count) = (0.0, 0);
    for pixel in both.filter(|pixel| b.pixels()[*pixel] != [128; 3]) {
        let [x, y] = [&a, &b].map(|image| ycbcr_from_rgb(image.pixels()[pixel].map(f32::from))[0]);
        sum += (x - y).powi(2);
        count += 1;
    }
    (10.0 * (255.0f64.powi(2) * count as f64 / sum).log10(), count)
}

/// A virtual rig of eight cameras around a textured person.
#[test]
fn eight_cameras_texture_a_person() {
    let Some(folder) = capture("liam_textured") else { return };
    let work = Workspace::new();
    let options = ReadOptions::new(Unit::Metre).with_colours(Colours::Keep);
    let Geometry::Mesh(source) = read_geometry_as(&folder.join("frame_0000.glb"), &options).unwrap() else {
        panic!("a mesh")
    };
    let bounds = source.bounds().unwrap();
    let rig_lens = lens(960, 1280, 1300.0);
    let ring = camera_ring(bounds, &rig_lens);
    write_rig(&work.path("rig"), &source, &rig_lens, &ring, 1);
    let input = folder.to_str().unwrap();
    work.isv(&["encode", input, "-o", "take.isv", "--frames", "0..1", "--voxel", "5mm", "--no-colour"])
        .done();

    let (mut decoded, voxel_m) = surface(&work.path("take.isv"));
    assert!(decoded.appearance.is_none());
    let projection = Projection::open(&work.path("rig"), Up::Y).unwrap();
    projection.paint(&mut decoded, 0, voxel_m).unwrap();
    let appearance = decoded.appearance.clone().unwrap();
    let texels = appearance.materials[0].texture.clone().unwrap();
    let grey = texels.pixels().iter().filter(|pixel| **pixel == [128; 3]).count();
    let green = texels.pixels().iter().filter(|[r, g, b]| *g > 120 && *r < 90 && *b < 90).count();
    let count = texels.pixels().len() as f64;
    // From between the cameras of the ring, where none of them stood.
    let middle = (bounds.0 + bounds.1) / 2.0;
    let radius = ring[0].centre.distance(middle);
    let mut all = Vec::new();
    for view in 0..8 {
        let turn = (f64::from(view) + 0.5) * std::f64::consts::FRAC_PI_4;
        let pose = look_at(middle + radius * DVec3::new(turn.sin(), 0.0, turn.cos()), middle);
        let (db, pixels) = psnr(&source, &decoded, &rig_lens, &pose);
        assert!(pixels > 50_000, "{pixels}");
        all.push(db);
    }
    let mean = all.iter().sum::<f64>() / 8.0;
    println!("Y PSNR {mean:.2} dB where a camera saw the person, of each view {all:.2?}");
    println!("texels that none saw {:.3}, green {:.5}", grey as f64 / count, green as f64 / count);
    assert!(mean > 30.0, "{all:?}");
    assert!((grey as f64) < 0.12 * count, "{grey} texels of {count} that no camera saw");
    assert!((green as f64) < 1e-4 * count, "{green} texels show what is behind the person");

    work.isv(&["render", "take.isv", "-o", "a.png", "--project-from", "rig", "--size", "300"]).done();
    work.isv(&["render", "take.isv", "-o", "b.png", "--project-from", "rig/rig.json", "--size", "300"])
        .done();
    work.isv(&["render", "take.isv", "-o", "bare.png", "--size", "300"]).done();
    assert_eq!(work.read("a.png"), work.read("b.png"));
    assert_ne!(work.read("a.png"), work.read("bare.png"));
}

/// A square of 2 m that faces +z, and a camera before it that sees its left half alone.
fn half_seen(work: &Workspace, frames: usize) {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let square = TriangleMesh {
        vertices: corners.map(|[x, y]| [x, y, 0.0].into()).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    };
    fs::create_dir_all(work.path("frames")).unwrap();
    write_mesh(&work.path("frames/0.ply"), &square, Format::Ply).unwrap();
    write_mesh(&work.path("frames/1.ply"), &square, Format::Ply).unwrap();
    let pose = look_at(DVec3::new(-1.0, 0.0, 2.0), DVec3::new(-1.0, 0.0, 0.0));
    write_rig(&work.path("rig"), &square, &lens(200, 200, 200.0), &[pose], frames);
}

/// Colours at the left and the right of the middle line of a picture.
fn left_and_right(bytes: &[u8]) -> [[u8; 3]; 2] {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    let (width, channels) = (info.width as usize, info.color_type.samples());
    [4, 8].map(|tenth| {
        let at = (info.height as usize / 2 * width + width * tenth / 10) * channels;
        [pixels[at], pixels[at + 1], pixels[at + 2]]
    })
}

#[test]
fn what_no_camera_saw_is_grey() {
    let work = Workspace::new();
    half_seen(&work, 2);
    work.isv(&["encode", "frames", "-o", "take.isv", "--voxel", "25mm"]).done();
    work.isv(&[
        "render",
        "take.isv",
        "-o",
        "out.png",
        "--project-from",
        "rig",
        "--size",
        "200",
        "--yaw",
        "0",
    ])
    .done();
    assert_eq!(left_and_right(&work.read("out.png")), [[255; 3], [128; 3]]);
}

#[test]
fn rigs_and_takes_of_different_lengths_are_told_apart() {
    let work = Workspace::new();
    half_seen(&work, 3);
    work.isv(&["encode", "frames", "-o", "take.isv", "--voxel", "25mm"]).done();
    work.isv(&["render", "take.isv", "-o", "out.png", "--project-from", "rig"])
        .fails(1, &["take.isv has 2 frames but rig has 3"]);
    work.isv(&["render", "take.isv", "-o", "out.png", "--project-from", "frames"])
        .fails(1, &["frames: no depth images here"]);
    fs::write(work.path("rig/c0/1.png"), "no image").unwrap();
    fs::remove_file(work.path("rig/c0/2.png")).unwrap();
    work.isv(&["render", "take.isv", "-o", "out.gif", "--project-from", "rig"])
        .fails(1, &["1.png: frame 1: not a PNG, JPEG, WebP or KTX2 image"]);
}
