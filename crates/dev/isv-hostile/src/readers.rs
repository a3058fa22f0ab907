//! Files of other formats: meshes, points, depth images, arrays, and volumes made of them.

use crate::sealing::{with_header_checksums, with_page_checksums};
use glam::DVec3;
use isv::raw::ingest::{
    MeshIngest, PointIngest, SignMode, decide_point_sign, decide_sign, estimate_normals, ingest_mesh,
    ingest_points, turn_faces,
};
use isv::raw::io::{
    Animation, Colours, DenseAxes, DenseOptions, DepthSequence, FrameStream, Geometry, InvalidPoints,
    ReadOptions, SampleAt, Unit, VolumeError, VolumeSequence, decode_image, hush_foreign_panics,
    parse_geometry_as, read_geometry_as,
};
use isv::raw::volume::{BlockEdge, Grid, PointCloud, TriangleMesh, Truncation, VoxelSize};
use isv_testfiles::{exr, image, png};
use std::borrow::Cow;
use std::cell::OnceCell;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// The camera that goes with depth images: 8 x 6 pixels.
const CAMERA_JSON: &str = r#"{"width": 8, "height": 6, "fx": 8, "fy": 8, "cx": 3.5, "cy": 2.5, "fps": 30,
    "depth_scale_m": 0.001, "poses": [[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]]}"#;

/// Frames of an animation that are looked at.
const ANIMATION_FRAMES: u64 = 4;
/// Frames of depth images that are looked at.
const DEPTH_FRAMES: usize = 2;
/// Most blocks of a volume that is made.
const MAX_BLOCKS: usize = 1000;

/// Reads a file of meshes or points, as it is, without invalid points, and with its colours; the name tells its format. What is read
/// has finite places, and no place at all where there is no surface.
pub(crate) fn read_geometry(name: &str, bytes: &[u8]) {
    hush_foreign_panics();
    let plain = ReadOptions::new(Unit::Metre);
    let options = [plain, plain.with_invalid_points(InvalidPoints::Drop), plain.with_colours(Colours::Keep)];
    for options in options {
        if let Ok(geometry) = parse_geometry_as(Path::new(name), bytes, &options) {
            check(&geometry);
        }
    }
}

fn check(geometry: &Geometry) {
    let bounds = geometry.bounds();
    assert_eq!(bounds.is_none(), geometry.is_empty());
    assert!(bounds.is_none_or(|(lo, hi)| lo.is_finite() && hi.is_finite()));
    let Geometry::Mesh(mesh) = geometry else { return };
    if let (Some(appearance), Some(triangle)) = (&mesh.appearance, mesh.triangles.first()) {
        let colour = appearance.colour(0, *triangle, [0.25, 0.25, 0.5]);
        assert!(colour.iter().all(|value| (-0.5..=255.5).contains(value)), "{colour:?}");
    }
}

/// Reads an OBJ file with a material library, which begins where `newmtl` does, and a sound image.
pub(crate) fn read_materials(bytes: &[u8]) {
    let (obj, mtl) = split(bytes, b"newmtl");
    let standing = || vec![("a.png", image::four_colours())];
    in_folder(standing, &[("frame.obj", obj), ("frame.mtl", mtl)], |folder| {
        let options = ReadOptions::new(Unit::Metre).with_colours(Colours::Keep);
        if let Ok(geometry) = read_geometry_as(&folder.join("frame.obj"), &options) {
            check(&geometry);
        }
    });
}

/// Decodes an image of a texture.
pub(crate) fn read_image(bytes: &[u8]) {
    hush_foreign_panics();
    if let Ok(image) = decode_image(bytes, "image") {
        assert_eq!(image.pixels().len() as u64, u64::from(image.width()) * u64::from(image.height()));
    }
}

/// Reads a file of E57 whose checksums are made to fit first: behind a wrong one nothing is read.
pub(crate) fn read_scans(bytes: &[u8]) {
    read_geometry("frame.e57", &with_page_checksums(bytes));
}

/// Reads frames from a pipe until it ends, as they are and, of an archive, with checksums that fit.
pub(crate) fn read_pipe(bytes: &[u8]) {
    let sealed = with_header_checksums(bytes);
    if sealed != bytes {
        read_frames(&sealed);
    }
    read_frames(bytes);
}

fn read_frames(bytes: &[u8]) {
    hush_foreign_panics();
    if let Ok(frames) = FrameStream::new(bytes, Unit::Metre) {
        frames.with_colours(Colours::Keep).for_each(drop);
    }
}

/// Poses the first frames of all animations of a GLB.
pub(crate) fn play_animation(bytes: &[u8]) {
    hush_foreign_panics();
    let options = ReadOptions::new(Unit::Metre).with_colours(Colours::Keep);
    let Ok(mut animation) = Animation::parse_with(Path::new("frame.glb"), bytes, &options) else { return };
    let animations = animation.names().len();
    for index in 0..animations {
        if animation.select(index).is_ok() {
            for frame in 0..animation.frame_count(30.0).min(ANIMATION_FRAMES) {
                let _ = animation.mesh_at(frame as f64 / 30.0);
            }
        }
    }
}

/// Reads the `camera.json` of a folder of depth images.
pub(crate) fn read_camera(bytes: &[u8]) {
    read_depth(&[("camera.json", bytes)], &["depth/0.png", "depth/1.png"]);
}

/// Reads the `rig.json` of a folder of depth images.
pub(crate) fn read_rig(bytes: &[u8]) {
    let images = ["front/0.png", "front/1.png", "back/left_0.exr", "back/left_1.exr"];
    read_depth(&[("rig.json", bytes)], &images);
}

/// Reads the two lists of a folder in the TUM RGB-D layout and its lens, with empty lines between them. The lens, which begins with a
/// brace if it is `camera.json`, may be missing.
pub(crate) fn read_lists(bytes: &[u8]) {
    let (depth, rest) = split(bytes, b"\n\n");
    let (poses, lens) = split(rest.trim_ascii_start(), b"\n\n");
    let lens = lens.trim_ascii_start();
    let (json, text) = if lens.starts_with(b"{") { (lens, &[][..]) } else { (&[][..], lens) };
    let lists = [("depth.txt", depth), ("groundtruth.txt", poses)];
    let lenses = [("camera.json", json), ("calibration.txt", text)];
    read_depth(&[lists, lenses].concat(), &["depth/0.png", "depth/1.png"]);
}

/// Reads the first frames of a folder of depth images. It has texts that come with an input, and names of
/// images of 8 x 6 pixels that are sound.
fn read_depth(texts: &[(&str, &[u8])], images: &[&'static str]) {
    let depths = exr::steps(48);
    let sound = |name: &str| match name.ends_with(".png") {
        true => png::depths(8, &depths.iter().map(|depth| (1000.0 * depth) as u16).collect::<Vec<_>>()),
        false => exr::image([8, 6], vec![("Z", exr::floats(&depths))]),
    };
    in_folder(|| images.iter().map(|name| (*name, sound(name))).collect(), texts, read_frames_of_depth);
}

/// Reads a depth image of 8 x 6 pixels; the name tells its format.
pub(crate) fn read_depth_image(name: &str, bytes: &[u8]) {
    in_folder(|| vec![("camera.json", CAMERA_JSON.into())], &[(name, bytes)], read_frames_of_depth);
}

fn read_frames_of_depth(folder: &Path) {
    let Ok(sequence) = DepthSequence::open_with(folder, Colours::Keep) else { return };
    for frame in 0..sequence.frames().min(DEPTH_FRAMES) {
        let _ = sequence.read(frame);
        let _ = sequence.read_colours(frame);
    }
}

/// Reads a volume as NumPy arrays, one file after the other: `grid.json` if the bytes do not begin as an array, coordinates, distances,
/// and weights. Where nothing says how large a voxel is, it has 5 mm.
pub(crate) fn read_arrays(bytes: &[u8]) {
    const MARK: &[u8] = b"\x93NUMPY";
    let (description, arrays) = if bytes.starts_with(MARK) { (&[][..], bytes) } else { split(bytes, MARK) };
    let (coords, rest) = split(arrays, MARK);
    let (tsdf, weight) = split(rest, MARK);
    let files =
        [("grid.json", description), ("coords.npy", coords), ("tsdf.npy", tsdf), ("weight.npy", weight)];
    in_folder(Vec::new, &files, |folder| read_volume(VolumeSequence::open(folder)));
}

/// Reads a dense field: a byte that says its axes and where its samples are, then an array or an archive of arrays.
pub(crate) fn read_dense(bytes: &[u8]) {
    let Some((options, bytes)) = bytes.split_first() else { return };
    let axes = if options & 1 == 0 { DenseAxes::Zyx } else { DenseAxes::Xyz };
    let sample_at = if options & 2 == 0 { SampleAt::Centre } else { SampleAt::Corner };
    let name = if bytes.starts_with(b"PK") { "frame.npz" } else { "frame.npy" };
    in_folder(Vec::new, &[(name, bytes)], |folder| {
        let options = DenseOptions { axes, sample_at, scale_m: None };
        read_volume(VolumeSequence::open_with(&folder.join(name), options));
    });
}

fn read_volume(volumes: Result<VolumeSequence, VolumeError>) {
    let Ok(volumes) = volumes else { return };
    let voxel = VoxelSize::from_metres(0.005).ok();
    if let Ok(grid) = volumes.grid(0, None, None).or_else(|_| volumes.grid(0, voxel, None)) {
        let _ = volumes.read(0, &grid);
    }
}

/// Makes volumes of whatever mesh and points the bytes give.
pub(crate) fn ingest(bytes: &[u8]) {
    let coordinates: Vec<f64> =
        bytes.chunks_exact(2).map(|b| f64::from(i16::from_le_bytes([b[0], b[1]])) * 1e-5).collect();
    let positions: Vec<DVec3> = coordinates.chunks_exact(3).map(DVec3::from_slice).collect();
    let Some(last) = positions.len().checked_sub(1) else { return };
    let triangles = bytes.chunks_exact(3).map(|b| [b[0], b[1], b[2]].map(|i| u32::from(i).min(last as u32)));
    let mesh = TriangleMesh {
        vertices: positions.clone(),
        triangles: triangles.collect(),
        ..TriangleMesh::default()
    };
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(0.01).expect("in range"),
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    };
    let settings = MeshIngest { max_blocks: MAX_BLOCKS, ..MeshIngest::new(grid) };
    for mesh in [turn_faces(&mesh), Cow::Borrowed(&mesh)] {
        let _ = ingest_mesh(&mesh, &settings, decide_sign(&mesh, SignMode::Auto).0);
    }
    let settings = PointIngest { max_blocks: MAX_BLOCKS, ..PointIngest::new(grid) };
    if let Ok(cloud) = estimate_normals(&PointCloud { positions, ..PointCloud::default() }) {
        let _ = ingest_points(&cloud, &settings, decide_point_sign(&cloud, SignMode::Auto).0);
    }
}

/// Two files that come as one: the second begins where `mark` does, after the first byte.
fn split<'a>(bytes: &'a [u8], mark: &[u8]) -> (&'a [u8], &'a [u8]) {
    let after = bytes.get(1..).unwrap_or_default();
    let at = after.windows(mark.len()).position(|window| window == mark).unwrap_or(after.len());
    bytes.split_at(bytes.len().min(at + 1))
}

/// Does something with a folder of files. There is one folder a thread, as a target always writes the same names; the files of
/// `standing` stay in it. A file without bytes is not there.
fn in_folder(
    standing: impl FnOnce() -> Vec<(&'static str, Vec<u8>)>,
    files: &[(&str, &[u8])],
    work: impl FnOnce(&Path),
) {
    hush_foreign_panics();
    thread_local! {
        static FOLDER: OnceCell<TempDir> = const { OnceCell::new() };
    }
    FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| {
            let folder = tempfile::tempdir().expect("a folder can be made");
            standing().iter().for_each(|(name, bytes)| write(&folder.path().join(name), bytes));
            folder
        });
        files.iter().for_each(|(name, bytes)| write(&folder.path().join(name), bytes));
        work(folder.path());
    });
}

fn write(path: &Path, bytes: &[u8]) {
    fs::create_dir_all(path.parent().expect("it is in the folder")).expect("a folder can be made");
    if bytes.is_empty() {
        // It may never have been there.
        let _ = fs::remove_file(path);
    } else {
        fs::write(path, bytes).expect("a file can be written");
    }
}
