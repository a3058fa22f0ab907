//! Files of other formats: meshes, points, depth images, arrays, and volumes made of them.

use glam::DVec3;
use isv::ingest::{
    MeshIngest, PointIngest, SignMode, decide_point_sign, decide_sign, estimate_normals, ingest_mesh,
    ingest_points,
};
use isv::io::{Animation, DepthSequence, FrameStream, Unit, VolumeSequence, parse_geometry};
use isv::volume::{BlockEdge, Grid, PointCloud, TriangleMesh, Truncation, VoxelSize};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// The camera that goes with depth images: 8 x 6 pixels.
const CAMERA_JSON: &str = r#"{"width": 8, "height": 6, "fx": 8, "fy": 8, "cx": 3.5, "cy": 2.5, "fps": 30,
    "depth_scale_m": 0.001, "poses": [[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]]}"#;

/// Frames of an animation that are looked at.
const ANIMATION_FRAMES: u64 = 4;
/// Most blocks of a volume that is made.
const MAX_BLOCKS: usize = 1000;

/// Reads a file of meshes or points; the name tells its format. What is read passes its own checks.
pub fn read_geometry(name: &str, bytes: &[u8]) {
    if let Ok(geometry) = parse_geometry(Path::new(name), bytes, Unit::Metre) {
        assert!(geometry.bounds().is_some());
    }
}

/// Reads frames from a pipe until it ends.
pub fn read_pipe(bytes: &[u8]) {
    if let Ok(frames) = FrameStream::new(bytes, Unit::Metre) {
        frames.for_each(drop);
    }
}

/// Poses the first frames of all animations of a GLB.
pub fn play_animation(bytes: &[u8]) {
    let Ok(mut animation) = Animation::parse(Path::new("frame.glb"), bytes, Unit::Metre) else { return };
    let animations = animation.names().len();
    for index in 0..animations {
        if animation.select(index).is_ok() {
            for frame in 0..animation.frame_count(30.0).min(ANIMATION_FRAMES) {
                let _ = animation.mesh_at(frame as f64 / 30.0);
            }
        }
    }
}

/// Reads the first frame of a folder of depth images.
pub fn read_depth(files: &[(&str, &[u8])]) {
    in_folder(files, |folder| {
        if let Ok(sequence) = DepthSequence::open(folder) {
            let _ = sequence.read(0);
        }
    });
}

/// Reads a depth image of 8 x 6 pixels; the name tells its format.
pub fn read_depth_image(name: &str, bytes: &[u8]) {
    read_depth(&[("camera.json", CAMERA_JSON.as_bytes()), (name, bytes)]);
}

/// Reads the first frame of a folder of arrays.
pub fn read_arrays(files: &[(&str, &[u8])]) {
    in_folder(files, |folder| {
        let voxel = VoxelSize::from_metres(0.005).ok();
        let Ok(volumes) = VolumeSequence::open(folder) else { return };
        if let Ok(grid) = volumes.grid(0, voxel, None) {
            let _ = volumes.read(0, &grid);
        }
    });
}

/// Makes volumes of whatever mesh and points the bytes give.
pub fn ingest(bytes: &[u8]) {
    let coordinates: Vec<f64> =
        bytes.chunks_exact(2).map(|b| f64::from(i16::from_le_bytes([b[0], b[1]])) * 1e-5).collect();
    let positions: Vec<DVec3> = coordinates.chunks_exact(3).map(DVec3::from_slice).collect();
    let Some(last) = positions.len().checked_sub(1) else { return };
    let triangles = bytes.chunks_exact(3).map(|b| [b[0], b[1], b[2]].map(|i| u32::from(i).min(last as u32)));
    let mesh =
        TriangleMesh { vertices: positions.clone(), triangles: triangles.collect(), normals: Vec::new() };
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(0.01).expect("in range"),
        edge: BlockEdge::E8,
        truncation: Truncation::from_voxels(8).expect("in range"),
    };
    let settings = MeshIngest { max_blocks: MAX_BLOCKS, ..MeshIngest::new(grid) };
    let _ = ingest_mesh(&mesh, &settings, decide_sign(&mesh, SignMode::Auto).0);
    let settings = PointIngest { max_blocks: MAX_BLOCKS, ..PointIngest::new(grid) };
    if let Ok(cloud) = estimate_normals(&PointCloud { positions, ..PointCloud::default() }) {
        let _ = ingest_points(&cloud, &settings, decide_point_sign(&cloud, SignMode::Auto).0);
    }
}

/// Two files that come as one: the second begins where `mark` does, after the first byte.
pub fn split<'a>(bytes: &'a [u8], mark: &[u8]) -> (&'a [u8], &'a [u8]) {
    let after = bytes.get(1..).unwrap_or_default();
    let at = after.windows(mark.len()).position(|window| window == mark).unwrap_or(after.len());
    bytes.split_at(bytes.len().min(at + 1))
}

/// Does something with a folder of files. There is one folder a thread: a target always writes the same names.
fn in_folder(files: &[(&str, &[u8])], work: impl FnOnce(&Path)) {
    thread_local! {
        static FOLDER: TempDir = tempfile::tempdir().expect("a folder can be made");
    }
    FOLDER.with(|folder| {
        for (name, bytes) in files {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().expect("it is in the folder")).expect("a folder can be made");
            fs::write(path, bytes).expect("a file can be written");
        }
        work(folder.path());
    });
}
