//! A thing may lie anywhere in the world. Tens of kilometres away, on both sides of the origin, a mesh
//! becomes the same volume, the same decoded volume and the same surface.

use glam::DVec3;
use isv::raw::decode::{Decoder, Limits};
use isv::raw::encode::{Encoder, EncoderSettings, Preset};
use isv::raw::format::{FrameRate, Packet, PacketReader, PacketWriter, Profile, StreamHeader};
use isv::raw::ingest::{MeshIngest, Reach, SignDecision, ingest_mesh};
use isv::raw::surface::{SurfaceOptions, extract_surface};
use isv::raw::volume::{BlockEdge, Grid, SparseVolume, TriangleMesh, Truncation, VoxelSize};

/// A voxel is 1/256 m, so that whole blocks are exact in binary, and 64 of them 2 m.
const VOXEL_NM: u64 = 3_906_250;
const CUBE_M: f64 = 2.0;
const CUBE_BLOCKS: i32 = 64;

fn header() -> StreamHeader {
    let voxel_size = VoxelSize::from_nanometres(VOXEL_NM).unwrap();
    let grid = Grid { voxel_size, edge: BlockEdge::E8, truncation: Truncation::DEFAULT };
    StreamHeader::new(Profile::Main, grid, FrameRate::DEFAULT)
}

/// A ball in the cube of 2 m from the origin on, a little further on in each frame. The cube is moved by
/// whole cubes.
fn ball(frame: u32, cubes: [i32; 3]) -> TriangleMesh {
    let mut mesh = isv_testkit::sphere(0.3, 40);
    let centre = DVec3::splat(0.8) + f64::from(frame) * DVec3::new(0.011, -0.007, 0.004);
    let unit = f64::from(1 << 20);
    for vertex in &mut mesh.vertices {
        // In binary fractions of few digits: exact wherever it is.
        *vertex = ((*vertex + centre) * unit).round() / unit + CUBE_M * DVec3::from(cubes.map(f64::from));
    }
    mesh
}

/// Volumes as ingested, and as decoded.
fn coded(cubes: [i32; 3], reach: Reach) -> (Vec<SparseVolume>, Vec<SparseVolume>) {
    let header = header();
    let settings = MeshIngest { reach, ..MeshIngest::new(header.grid) };
    let sign = SignDecision::Closed { flipped: false };
    let volumes: Vec<_> =
        (0..3).map(|frame| ingest_mesh(&ball(frame, cubes), &settings, sign).unwrap()).collect();
    let settings = EncoderSettings { main: Preset::Realtime.settings(), ..EncoderSettings::default() };
    let mut encoder = Encoder::new(&header, settings);
    let mut writer = PacketWriter::new(Vec::new(), &header).unwrap();
    for (n, volume) in volumes.iter().enumerate() {
        let frame = encoder.encode(volume);
        writer.write_frame(frame.keyframe, n as u64, &frame.payload()).unwrap();
    }
    let stream = writer.finish().unwrap();
    let (mut reader, mut decoder) =
        (PacketReader::new(&stream[..]).unwrap(), Decoder::new(&header, Limits::default()));
    let packets = std::iter::from_fn(|| reader.next_frame().unwrap());
    let decoded = packets.map(|packet: Packet| decoder.decode(&packet).unwrap().volume.clone()).collect();
    (volumes, decoded)
}

fn assert_moved(volume: &SparseVolume, here: &SparseVolume, cubes: [i32; 3], what: &str) {
    let moved = here.coords().iter().map(|coord| coord.offset(cubes.map(|c| CUBE_BLOCKS * c)));
    assert!(volume.coords().iter().copied().eq(moved), "{what}, {cubes:?}: other blocks");
    let same = (0..here.block_count()).all(|block| volume.block(block) == here.block(block));
    assert!(same, "{what}, {cubes:?}: other samples");
}

#[test]
fn a_volume_is_the_same_wherever_it_is() {
    for reach in [Reach::Band, Reach::Surface] {
        let (volumes, decoded) = coded([0; 3], reach);
        let mesh = extract_surface(&decoded[2], &SurfaceOptions::default());
        for cubes in [[-1; 3], [-15_000, 10_000, -5_000], [16_000, -16_000, 16_000]] {
            let (far_volumes, far_decoded) = coded(cubes, reach);
            for n in 0..3 {
                assert_moved(&far_volumes[n], &volumes[n], cubes, "ingested");
                assert_moved(&far_decoded[n], &decoded[n], cubes, "decoded");
            }
            let far = extract_surface(&far_decoded[2], &SurfaceOptions::default());
            assert_eq!(far.triangles, mesh.triangles);
            let offset = CUBE_M * DVec3::from(cubes.map(f64::from));
            for (far, here) in far.vertices.iter().zip(&mesh.vertices) {
                // To a hundredth of a micrometre, of which doubles at 30 km have thousands.
                assert!((*far - offset - *here).abs().max_element() < 1e-8, "{far} for {here}");
            }
        }
    }
}
