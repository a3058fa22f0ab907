//! Whatever is decoded of real captures with holes or without inside lies near what was captured.

use glam::DVec3;
use isv::raw::decode::{Decoder, Limits, Lod};
use isv::raw::encode::{Encoder, EncoderSettings, FrameQuality, MainSettings};
use isv::raw::format::{FrameRate, PacketReader, PacketWriter, Profile, StreamHeader};
use isv::raw::ingest::{MeshIngest, Reach, SignDecision, decide_sign, ingest_mesh};
use isv::raw::io::{FrameSequence, Unit, read_mesh};
use isv::raw::surface::{SurfaceOptions, extract_surface};
use isv::raw::volume::{BlockEdge, Grid, TriangleMesh, Truncation, VoxelSize};
use isv_spatial::Bvh;
use isv_testkit::capture;

/// In metres.
const VOXEL: f64 = 0.005;
/// Frames 5 to 8, where one foot is off the ground.
const FRAMES: std::ops::Range<usize> = 5..9;

fn dancer() -> Option<Vec<TriangleMesh>> {
    let frames = FrameSequence::open(capture("dancer")?).unwrap();
    Some(frames.paths()[FRAMES].iter().map(|path| read_mesh(path, Unit::Metre).unwrap()).collect())
}

fn stream(header: &StreamHeader, meshes: &[TriangleMesh], quality: f32) -> Vec<u8> {
    let settings = MeshIngest { reach: Reach::Surface, ..MeshIngest::new(header.grid) };
    let sign = decide_sign(&meshes[0], settings.sign).0;
    let main = MainSettings { quality: FrameQuality::of_quality(quality), ..MainSettings::default() };
    let mut encoder = Encoder::new(header, EncoderSettings { main, ..EncoderSettings::default() });
    let mut writer = PacketWriter::new(Vec::new(), header).unwrap();
    for (n, mesh) in (0..).zip(meshes) {
        let frame = encoder.encode(&ingest_mesh(mesh, &settings, sign).unwrap());
        writer.write_frame(frame.keyframe, n * 33_333_333, &frame.payload()).unwrap();
    }
    writer.finish().unwrap()
}

#[test]
fn of_a_dancer_with_open_soles_nothing_is_left_in_the_air() {
    let Some(meshes) = dancer() else { return };
    let header = StreamHeader::new(
        Profile::Main,
        Grid {
            voxel_size: VoxelSize::from_metres(VOXEL).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::DEFAULT,
        },
        FrameRate::DEFAULT,
    );
    for quality in [50.0, 20.0] {
        let bytes = stream(&header, &meshes, quality);
        // In voxels of the resolution.
        for (lod, most) in [(Lod::Full, 2.5), (Lod::Half, 2.0), (Lod::Quarter, 2.0)] {
            let mut reader = PacketReader::new(&bytes[..]).unwrap();
            let mut decoder = Decoder::with_lod(reader.header(), Limits::default(), lod).unwrap();
            for mesh in &meshes {
                let bvh = Bvh::new(mesh);
                let packet = reader.next_frame().unwrap().unwrap();
                let volume = decoder.decode_and_verify(&packet).unwrap().volume;
                let surface = extract_surface(volume, &SurfaceOptions::default());
                let farthest = surface.vertices.iter().map(|v| bvh.distance(*v)).fold(0.0, f64::max);
                let voxels = farthest / volume.grid().voxel_size.metres();
                println!("quality {quality}, {lod:?}: {:.1} mm, {voxels:.2} voxels", 1e3 * farthest);
                assert!(voxels < most, "quality {quality}, {lod:?}: {voxels} voxels");
            }
        }
    }
}

/// Share of a surface's area that is more than two voxels from a mesh.
fn stray_share(surface: &TriangleMesh, mesh: &Bvh, voxel_m: f64) -> f64 {
    let is_stray = |face: usize| {
        let middle = surface.corners(face).iter().sum::<DVec3>() / 3.0;
        mesh.distance(middle) > 2.0 * voxel_m
    };
    let area = |face: usize| surface.area_vector(face).length();
    let stray: f64 = (0..surface.triangles.len()).filter(|face| is_stray(*face)).map(area).sum();
    stray / (0..surface.triangles.len()).map(area).sum::<f64>()
}

/// Coding adds no surface: where blocks were extrapolated, signs are those of the source.
#[test]
fn decoded_sheets_lie_where_the_source_has_them() {
    for (name, voxel_m, frames) in [("flag", 0.005, 2), ("monastery", 0.03, 2)] {
        let Some(folder) = capture(name) else { return };
        let voxel_size = VoxelSize::from_metres(voxel_m).unwrap();
        let grid = Grid { voxel_size, edge: BlockEdge::E8, truncation: Truncation::DEFAULT };
        let header = StreamHeader::new(Profile::Main, grid, FrameRate::DEFAULT);
        let settings = MeshIngest { reach: Reach::Surface, ..MeshIngest::new(grid) };
        let mut encoder = Encoder::new(&header, EncoderSettings::default());
        for path in FrameSequence::open(folder).unwrap().paths().iter().take(frames) {
            let mesh = read_mesh(path, Unit::Metre).unwrap();
            let sign = decide_sign(&mesh, settings.sign).0;
            assert_eq!(sign, SignDecision::Sheet, "{name}");
            let volume = ingest_mesh(&mesh, &settings, sign).unwrap();
            encoder.encode(&volume);
            let bvh = Bvh::new(&mesh);
            let [source, decoded] = [&volume, encoder.reconstruction().unwrap()].map(|volume| {
                let surface = extract_surface(volume, &SurfaceOptions { normals: false });
                (stray_share(&surface, &bvh, voxel_m), surface.area() / mesh.area())
            });
            println!("{name}: stray and area of the source {source:.5?}, decoded {decoded:.5?}");
            assert!(decoded.0 < source.0 + 1e-4, "{name}: {decoded:?} for {source:?}");
            // A coarse step smooths what is rough at the size of voxels.
            assert!((decoded.1 - source.1).abs() < 0.03, "{name}: {decoded:?} for {source:?}");
        }
    }
}
