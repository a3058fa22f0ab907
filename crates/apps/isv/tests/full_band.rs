//! The full band in profile `main`: a map with free space comes back whole, and other streams are not taken for one.

use isv::raw::decode::{Decoder, Limits};
use isv::raw::encode::{Band, Encoder, EncoderSettings, FrameQuality, MainSettings};
use isv::raw::format::{FrameRate, PacketReader, PacketWriter, Profile, StreamHeader};
use isv::raw::ingest::{MeshIngest, Reach, coded_field, decide_sign, ingest_mesh};
use isv::raw::io::{FrameSequence, Unit, read_mesh};
use isv::raw::surface::{SurfaceOptions, extract_surface, surface_band};
use isv::raw::volume::{BlockEdge, CODES_PER_VOXEL, Grid, SparseVolume, Truncation, VoxelSize};
use isv_testkit::{capture, volume_of};

fn header(truncation: u32) -> StreamHeader {
    StreamHeader::new(
        Profile::Main,
        Grid {
            voxel_size: VoxelSize::from_metres(0.01).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::from_voxels(truncation).unwrap(),
        },
        FrameRate::DEFAULT,
    )
}

/// A room of 40 x 32 x 40 voxels, seen from within: free space, a pillar, the band behind its walls. What lies behind a slanted
/// plane was not looked at.
fn room(truncation: u32) -> SparseVolume {
    let grid = header(truncation).grid;
    let reach = f64::from(truncation) - 0.01;
    let distance = |[x, y, z]: [f64; 3]| {
        let walls = (20.3 - x.abs()).min(16.2 - y.abs()).min(20.1 - z.abs());
        let pillar = (x - 5.2).hypot(z + 3.1) - 4.4;
        walls.min(pillar)
    };
    let hidden = |[x, y, z]: [f64; 3]| distance([x, y, z]) < -reach || x + 0.3 * y + 0.2 * z > 22.0;
    // Free space counts as observed, and lies within what is kept.
    let map = volume_of(grid, 4, |at| distance(at).clamp(-reach, reach), hidden);
    map.select(|block| map.unobserved(block).is_none_or(|mask| mask.count() < 512))
}

/// The frame as coded and decoded; `None` for its field unless the band is found to be full.
fn decoded(
    header: &StreamHeader,
    source: &SparseVolume,
    band: Band,
    quality: f32,
) -> (SparseVolume, Option<SparseVolume>, usize) {
    let main = MainSettings { band, quality: FrameQuality::of_quality(quality), ..MainSettings::default() };
    let mut encoder = Encoder::new(header, EncoderSettings { main, ..EncoderSettings::default() });
    let mut writer = PacketWriter::new(Vec::new(), header).unwrap();
    let frame = encoder.encode(source);
    writer.write_frame(frame.keyframe, 0, &frame.payload()).unwrap();
    let bytes = writer.finish().unwrap();
    let mut reader = PacketReader::new(&bytes[..]).unwrap();
    let mut decoder = Decoder::new(reader.header(), Limits::default());
    let packet = reader.next_frame().unwrap().unwrap();
    let volume = decoder.decode(&packet).unwrap().volume.clone();
    let field = coded_field(&volume, decoder.coded_blocks().unwrap());
    (volume, field, bytes.len())
}

#[test]
fn no_observed_voxel_of_a_map_is_lost() {
    for (truncation, quality) in [(8, 0.0), (8, 50.0), (8, 100.0), (4, 50.0), (16, 50.0)] {
        let source = room(truncation);
        let (volume, field, bytes) = decoded(&header(truncation), &source, Band::Full, quality);
        let field = field.expect("free space is coded");
        let index = field.index();
        let (mut squares, mut observed, mut unobserved, mut still) = (0.0, 0, 0, 0);
        for (block, coord) in source.coords().iter().enumerate() {
            let found = index.get(*coord).expect("every block is there") as usize;
            let is_hidden = |volume: &SparseVolume, block: usize, voxel: usize| {
                volume.unobserved(block).is_some_and(|mask| mask.contains(voxel))
            };
            for voxel in 0..512 {
                let found_hidden = is_hidden(&field, found, voxel);
                if is_hidden(&source, block, voxel) {
                    unobserved += 1;
                    still += usize::from(found_hidden);
                    continue;
                }
                assert!(!found_hidden, "quality {quality}: {coord:?} {voxel}");
                let codes = f64::from(field.block(found)[voxel] - source.block(block)[voxel]);
                squares += (codes / f64::from(CODES_PER_VOXEL)).powi(2);
                observed += 1;
            }
        }
        let rms = (squares / f64::from(observed)).sqrt();
        println!(
            "truncation {truncation}, quality {quality}: {bytes} bytes, {observed} observed, rms {rms:.3} voxel; \
             {still} of {unobserved} still unobserved"
        );
        assert!(observed > 60_000 && rms < if quality < 50.0 { 0.6 } else { 0.25 });
        // The blocks that the decoder made up hold what its surface needs, and no more.
        let mesh = |volume: &SparseVolume| extract_surface(volume, &SurfaceOptions::default());
        assert_eq!(mesh(&field).vertices, mesh(&volume).vertices);
        assert_eq!(mesh(&field).triangles, mesh(&volume).triangles);
        assert!(field.block_count() < volume.block_count());
    }
}

#[test]
fn a_stream_of_the_surface_is_not_taken_for_a_field() {
    for truncation in [2, 4, 8, 16] {
        for quality in [0.0, 50.0, 100.0] {
            for source in [room(truncation), isv_testkit::ball(header(truncation).grid, 0.0)] {
                let source = surface_band(&source);
                let (_, field, _) = decoded(&header(truncation), &source, Band::Surface, quality);
                assert!(field.is_none(), "truncation {truncation}, quality {quality}");
            }
        }
    }
}

#[test]
fn a_capture_of_a_surface_is_not_taken_for_a_field() {
    let Some(folder) = capture("dancer") else { return };
    let mesh = read_mesh(&FrameSequence::open(folder).unwrap().paths()[0], Unit::Metre).unwrap();
    let settings = MeshIngest { reach: Reach::Band, ..MeshIngest::new(header(8).grid) };
    let sign = decide_sign(&mesh, settings.sign).0;
    let volume = ingest_mesh(&mesh, &settings, sign).unwrap();
    for quality in [0.0, 50.0] {
        let near = surface_band(&volume);
        assert!(decoded(&header(8), &near, Band::Surface, quality).1.is_none());
        assert!(decoded(&header(8), &volume, Band::Full, quality).1.is_some());
    }
}
