//! Streams of few bytes that claim much are refused before memory is taken. In a test program of its own, whose memory is measured;
//! `--nocapture` prints it and the time of each.

use isv_decode::shared::syntax::block_set::{BlockSetModels, CellContext, DEPTH_BITS, MAX_DEPTH};
use isv_decode::{Decoder, Limits, RefusalClass};
use isv_entropy::RangeEncoder;
use isv_format::{
    FrameCoding, FrameHeader, FrameKind, FramePayload, FrameRate, MainFrameHeader, PacketHeader, PacketKind,
    PacketReader, PaperParameters, Prediction, Profile, SlicePayload, StreamHeader,
};
use isv_testkit::{Need, skip};
use isv_volume::{BlockEdge, Grid, Truncation, VoxelSize};
use std::time::Instant;

/// The most memory that this process has taken, in bytes, where the system says so.
fn most_memory() -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix(" kB")?.parse::<usize>().ok()? << 10)
}

fn header(profile: Profile) -> StreamHeader {
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(0.005).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    };
    StreamHeader::new(profile, grid, FrameRate::DEFAULT)
}

/// A stream of one keyframe, whose segments, but for the block set, are zeros, which decode to ones.
fn bomb(profile: Profile, blocks: u32, slices: u16, block_set: &[u8]) -> Vec<u8> {
    let main = MainFrameHeader {
        step: 9000,
        filter: 0,
        filter_limit: 0,
        half_voxel_vectors: true,
        no_spatial_prediction: false,
        kind: FrameKind::Intra,
    };
    let coding = if profile == Profile::Main {
        FrameCoding::Main(main)
    } else {
        FrameCoding::Paper { prediction: Prediction::None }
    };
    let payload = FramePayload {
        header: FrameHeader { blocks, slices, coding, volume_hash: None },
        block_set,
        masks: &[0x80],
        slices: vec![SlicePayload { modes: &[], coefficients: &[0; 4] }; usize::from(slices)],
    };
    let payload = payload.to_bytes();
    let kind = PacketKind::Frame { keyframe: true, hashed: false, colour: false };
    let packet = PacketHeader::seal(kind, 0, 0, &payload);
    [&header(profile).to_bytes()[..], &packet, &payload].concat()
}

/// The octree of a cube of `2^depth` blocks a side. Every cell is there, which models soon expect: it takes next to no bits, and is
/// what an honest encoder would write.
fn cube(depth: u32) -> Vec<u8> {
    let (mut models, mut encoder) = (BlockSetModels::default(), RangeEncoder::new());
    encoder.encode_raw(depth, DEPTH_BITS);
    for _ in 0..3 * (MAX_DEPTH - depth) {
        encoder.encode_raw(0, 1);
    }
    let mut cells = vec![0];
    for level in (0..depth).rev() {
        let mut context = CellContext::new(level, &cells, None);
        cells = cells.iter().flat_map(|parent| (0..8).map(move |octant| parent << 3 | octant)).collect();
        for cell in &cells {
            // The last of eight is coded too: the others are there.
            encoder.encode(&mut models.cell[context.model(*cell)], true);
            context.occupy(*cell);
        }
    }
    encoder.finish()
}

#[test]
fn few_bytes_take_little_memory() {
    let paper = Profile::Paper(PaperParameters { coefficients: 64, dc_step: 1, ac_step: 1 });
    // Depth 21, then ones: every cell there is.
    let everything = [&[0xa8][..], &[0; 63]].concat();
    let cube = cube(6);
    println!("an octree of {} blocks: {} bytes", 1 << 18, cube.len());
    let mut bombs = Vec::new();
    for profile in [paper, Profile::Main] {
        bombs.extend([
            ("2^32 - 1 blocks", RefusalClass::Limit, bomb(profile, u32::MAX, 1, &[])),
            ("2^31 blocks", RefusalClass::Limit, bomb(profile, 1 << 31, 256, &everything)),
            ("as many blocks as are usual", RefusalClass::Limit, bomb(profile, 6_291_456, 1, &everything)),
            (
                "a cube of 64^3 blocks, all of them there",
                RefusalClass::Limit,
                bomb(profile, 1 << 18, 1, &cube),
            ),
            ("as many as the bytes allow", RefusalClass::Malformed, bomb(profile, 16_384, 256, &everything)),
        ]);
    }
    let mut short = bomb(Profile::Main, 1, 1, &[]);
    short[48 + 8..48 + 12].copy_from_slice(&(1u32 << 30).to_le_bytes());
    bombs.push(("a payload of 2^30 bytes", RefusalClass::Cut, short));
    let before = most_memory();
    for (name, class, bytes) in bombs {
        let start = Instant::now();
        let mut reader = PacketReader::new(&bytes[..]).unwrap();
        let mut decoder = Decoder::new(reader.header(), Limits::default());
        let error = reader
            .next_frame()
            .map_err(|error| error.class())
            .and_then(|packet| decoder.decode(&packet.unwrap()).map(|_| ()).map_err(|error| error.class()));
        println!("{name}: {} bytes, {:.1} ms", bytes.len(), start.elapsed().as_secs_f64() * 1e3);
        assert_eq!(error, Err(Some(class)), "{name}");
    }
    match before.zip(most_memory()) {
        Some((before, after)) => {
            println!("{} kB more than before", (after - before) >> 10);
            assert!(after - before < 64 << 20);
        }
        None => skip(Need::MemoryUse, "this system does not say how much memory a process has taken"),
    }
}
