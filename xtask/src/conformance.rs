//! Makes the conformance streams: small, one feature after the other, each with the hashes of its decoded frames.

use anyhow::{Context, Result};
use isv::decode::volume_hash;
use isv::encode::{Encoder, EncoderSettings, MotionMode};
use isv::format::{FrameRate, PacketWriter, PaperParameters, Prediction, Profile, StreamHeader};
use isv::volume::{BlockEdge, Grid, Truncation, VoxelSize};
use isv_testkit::ball;
use std::fmt::Write;
use std::path::Path;

/// A stream of four frames, the first a keyframe.
struct Case {
    name: &'static str,
    edge: u32,
    truncation: u32,
    coefficients: u16,
    /// DC and AC step in sixteenths of a code.
    steps: [u32; 2],
    motion: Prediction,
    slices: u16,
}

/// The paper's settings, of which each case changes some.
const PAPER: Case = Case {
    name: "intra",
    edge: 8,
    truncation: 8,
    coefficients: 64,
    steps: [819, 8192],
    motion: Prediction::None,
    slices: 1,
};

const CASES: [Case; 8] = [
    PAPER,
    Case { name: "zero_motion", motion: Prediction::ZeroMotion, ..PAPER },
    Case { name: "3dof", motion: Prediction::ThreeDof, ..PAPER },
    Case { name: "6dof", motion: Prediction::SixDof, ..PAPER },
    Case { name: "6dof_three_slices", motion: Prediction::SixDof, slices: 3, ..PAPER },
    Case {
        name: "3dof_fine_steps",
        motion: Prediction::ThreeDof,
        coefficients: 512,
        steps: [160, 640],
        ..PAPER
    },
    Case {
        name: "6dof_edge_4",
        edge: 4,
        truncation: 2,
        coefficients: 20,
        motion: Prediction::SixDof,
        ..PAPER
    },
    Case {
        name: "6dof_edge_16",
        edge: 16,
        truncation: 16,
        coefficients: 200,
        motion: Prediction::SixDof,
        ..PAPER
    },
];

/// Writes every stream and the table of hashes into a folder.
pub(crate) fn run(folder: &str) -> Result<()> {
    let folder = Path::new(folder);
    let mut table = String::new();
    for case in &CASES {
        let (stream, hashes) = encode(case)?;
        let path = folder.join(format!("{}.isv", case.name));
        std::fs::write(&path, stream).with_context(|| path.display().to_string())?;
        for (frame, hash) in hashes.iter().enumerate() {
            writeln!(table, "{}.isv {frame} {hash:016x}", case.name)?;
        }
    }
    let path = folder.join("hashes.txt");
    std::fs::write(&path, table).with_context(|| path.display().to_string())
}

fn encode(case: &Case) -> Result<(Vec<u8>, Vec<u64>)> {
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(0.005)?,
        edge: BlockEdge::from_voxels(case.edge)?,
        truncation: Truncation::from_voxels(case.truncation)?,
    };
    let header = StreamHeader {
        profile: Profile::Paper(PaperParameters {
            coefficients: case.coefficients,
            dc_step: case.steps[0],
            ac_step: case.steps[1],
        }),
        grid,
        frame_rate: FrameRate { numerator: 30, denominator: 1 },
    };
    let motion = MotionMode::Fixed(case.motion);
    let settings =
        EncoderSettings { motion, checksums: true, slices: Some(case.slices), ..Default::default() };
    let mut encoder = Encoder::new(&header, settings);
    let mut writer = PacketWriter::new(Vec::new(), &header)?;
    let mut hashes = Vec::new();
    for frame in 0..4u64 {
        let coded = encoder.encode(&ball(grid, frame as f64));
        writer.write_frame(coded.keyframe, header.frame_rate.timestamp_ns(frame), &coded.payload())?;
        hashes.push(volume_hash(encoder.reconstruction().context("a frame was just encoded")?));
    }
    Ok((writer.finish()?, hashes))
}
