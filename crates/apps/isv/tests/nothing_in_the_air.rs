//! Whatever is decoded of a real capture with open soles lies near what was captured, at every resolution.

use isv::raw::decode::{Decoder, Limits, Lod};
use isv::raw::encode::{Encoder, EncoderSettings, FrameQuality, MainSettings};
use isv::raw::format::{FrameRate, PacketReader, PacketWriter, Profile, StreamHeader};
use isv::raw::ingest::{MeshIngest, Reach, decide_sign, ingest_mesh};
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
    let header = StreamHeader {
        profile: Profile::Main,
        grid: Grid {
            voxel_size: VoxelSize::from_metres(VOXEL).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::DEFAULT,
        },
        frame_rate: FrameRate::DEFAULT,
    };
    for quality in [50.0, 20.0] {
        let bytes = stream(&header, &meshes, quality);
        // In voxels of the resolution.
        for (lod, most) in [(Lod::Full, 2.5), (Lod::Half, 2.0), (Lod::Quarter, 2.0)] {
            let mut reader = PacketReader::new(&bytes[..]).unwrap();
            let mut decoder = Decoder::with_lod(reader.header().unwrap(), Limits::default(), lod).unwrap();
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
