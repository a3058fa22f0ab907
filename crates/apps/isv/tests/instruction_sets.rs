//! From capture to bytes and back, everything is the same bit for bit with every instruction set that the machine has.

use glam::DVec2;
use isv::raw::decode::{Decoder, Limits, volume_hash};
use isv::raw::encode::{Encoder, EncoderSettings, MotionMode, Preset};
use isv::raw::format::{FrameRate, PacketReader, PacketWriter, PaperParameters, Profile, StreamHeader};
use isv::raw::fusion::{FusionSettings, fuse};
use isv::raw::ingest::{MeshIngest, PointIngest, decide_point_sign, decide_sign, ingest_mesh, ingest_points};
use isv::raw::io::{FrameSequence, Unit, read_mesh};
use isv::raw::kernels::simd;
use isv::raw::surface::{SurfaceOptions, extract_surface};
use isv::raw::volume::{
    BlockEdge, Grid, Intrinsics, PointCloud, SparseVolume, TriangleMesh, Truncation, VoxelSize,
};
use isv_testkit::{camera_ring, capture, render_depth, soup};

fn grid(voxel_m: f64) -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(voxel_m).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    }
}

/// Two frames of the project's own figure.
fn figure() -> Vec<TriangleMesh> {
    let voxel = VoxelSize::from_metres(0.012).unwrap();
    [0.0, 1.0 / 30.0].map(|time_s| isv_figure::figure_mesh(time_s, voxel)).to_vec()
}

/// The settings whose loops differ: refined levels only in the archive, rotations only in the paper's profile.
fn codings() -> [(&'static str, Profile, EncoderSettings); 3] {
    let main = |preset: Preset| EncoderSettings { main: preset.settings(), ..EncoderSettings::default() };
    let paper = PaperParameters { coefficients: 64, dc_step: 819, ac_step: 8192 };
    let motion = MotionMode::Auto;
    [
        ("realtime", Profile::Main, main(Preset::Realtime)),
        ("archive", Profile::Main, main(Preset::Archive)),
        ("paper", Profile::Paper(paper), EncoderSettings { motion, ..EncoderSettings::default() }),
    ]
}

/// What is made of a take on the way, by name: hashes of volumes, streams, and vertices.
#[derive(Debug, Default, PartialEq)]
struct Results {
    volumes: Vec<(&'static str, u64)>,
    streams: Vec<(&'static str, Vec<u8>)>,
    vertices: Vec<[u64; 3]>,
}

impl Results {
    fn add(&mut self, name: &'static str, volume: &SparseVolume) {
        self.volumes.push((name, volume_hash(volume)));
    }
}

fn ingest(meshes: &[TriangleMesh], voxel_m: f64) -> Vec<SparseVolume> {
    let settings = MeshIngest::new(grid(voxel_m));
    let sign = decide_sign(&meshes[0], settings.sign).0;
    meshes.iter().map(|mesh| ingest_mesh(mesh, &settings, sign).unwrap()).collect()
}

fn encode(header: &StreamHeader, settings: EncoderSettings, volumes: &[SparseVolume]) -> Vec<u8> {
    let mut encoder = Encoder::new(header, settings);
    let mut writer = PacketWriter::new(Vec::new(), header).unwrap();
    for (n, volume) in (0..).zip(volumes) {
        let frame = encoder.encode(volume);
        writer.write_frame(frame.keyframe, n * 33_333_333, &frame.payload()).unwrap();
    }
    writer.finish().unwrap()
}

/// Ingest, then encoding, decoding and the surface under the first so many settings.
fn results(
    meshes: &[TriangleMesh],
    voxel_m: f64,
    codings: &[(&'static str, Profile, EncoderSettings)],
) -> Results {
    let mut results = Results::default();
    let volumes = ingest(meshes, voxel_m);
    volumes.iter().for_each(|volume| results.add("ingest", volume));
    for (name, profile, settings) in codings.iter().cloned() {
        let frame_rate = FrameRate::DEFAULT;
        let header = StreamHeader::new(profile, grid(voxel_m), frame_rate);
        let stream = encode(&header, settings, &volumes);
        let mut reader = PacketReader::new(&stream[..]).unwrap();
        let mut decoder = Decoder::new(&header, Limits::default());
        while let Some(packet) = reader.next_frame().unwrap() {
            let decoded = decoder.decode(&packet).unwrap().volume;
            results.add(name, decoded);
            let surface = extract_surface(decoded, &SurfaceOptions::default());
            results.vertices.extend(surface.vertices.iter().map(|v| v.to_array().map(f64::to_bits)));
        }
        results.streams.push((name, stream));
    }
    results
}

/// Asserts that the work has one result. `with_each` begins with the scalar code.
fn assert_same(work: impl FnMut() -> Results) {
    let runs = simd::with_each(work);
    let scalar = &runs[0].1;
    for (instructions, found) in &runs {
        assert_eq!(found.volumes, scalar.volumes, "{instructions}");
        for (found, scalar) in found.streams.iter().zip(&scalar.streams) {
            assert!(found == scalar, "{instructions}: streams of {} differ", scalar.0);
        }
        assert!(found == scalar, "{instructions}: surfaces differ");
    }
}

#[test]
fn a_take_of_the_figure() {
    let meshes = figure();
    assert_same(|| results(&meshes, 0.012, &codings()));
}

#[test]
fn a_capture() {
    let Some(folder) = capture("dancer") else { return };
    let paths = FrameSequence::open(&folder).unwrap();
    let meshes: Vec<_> =
        paths.paths()[..2].iter().map(|path| read_mesh(path, Unit::Metre).unwrap()).collect();
    assert_same(|| results(&meshes, 0.006, &codings()[..1]));
}

/// Triangles that enclose nothing: shells around sheets, rims and holes.
#[test]
fn triangles_at_random() {
    let meshes: Vec<_> = (0..6).map(|seed| soup(seed, 40)).collect();
    assert_same(|| results(&meshes, 0.03, &[]));
}

#[test]
fn points() {
    let clouds = figure().into_iter().map(|mesh| PointCloud {
        positions: mesh.vertices,
        normals: mesh.normals,
        viewpoint: None,
        scans: Vec::new(),
        colours: Vec::new(),
    });
    let clouds: Vec<_> =
        clouds.flat_map(|cloud| [cloud.clone(), PointCloud { normals: vec![], ..cloud }]).collect();
    let settings = PointIngest::new(grid(0.012));
    assert_same(|| {
        let mut results = Results::default();
        for cloud in &clouds {
            let sign = decide_point_sign(cloud, settings.sign).0;
            results.add("points", &ingest_points(cloud, &settings, sign).unwrap());
        }
        results
    });
}

#[test]
fn depth_images() {
    let focal = DVec2::splat(190.0);
    let lens = Intrinsics { width: 160, height: 120, focal, principal: DVec2::new(79.5, 59.5) };
    let mesh = &figure()[0];
    let images = camera_ring(isv_figure::BOUNDS_M, &lens).map(|pose| render_depth(mesh, &lens, &pose));
    assert_same(|| {
        let mut results = Results::default();
        results.add("fusion", &fuse(&images, &FusionSettings::new(grid(0.02))).unwrap());
        results
    });
}
