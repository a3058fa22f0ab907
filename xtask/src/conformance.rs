//! Makes the conformance streams: small, one feature after the other, each with the hashes of its decoded frames. A stream that is
//! there is never made again: what an encoder chooses may change, and what others have tested with must not.

mod cells;
mod colour;
mod extremes;
mod main_profile;
mod raw;
mod refused;
mod version_2;

pub(crate) use colour::painted;

use anyhow::{Context, Result};
use isv::raw::decode::volume_hash;
use isv::raw::encode::{Encoder, EncoderSettings, MotionMode};
use isv::raw::format::{FrameRate, PacketWriter, PaperParameters, Prediction, Profile, StreamHeader};
use isv::raw::volume::{BlockEdge, Grid, SparseVolume, Truncation, VoxelSize};
use isv_testkit::ball;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

/// A stream's bytes and the hashes of its frames.
type Stream = (Vec<u8>, Vec<u64>);

/// A stream of profile `paper`, of which the first frame is a keyframe.
struct Case {
    name: &'static str,
    edge: u32,
    truncation: u32,
    coefficients: u16,
    /// DC and AC step in sixteenths of a code.
    steps: [u32; 2],
    motion: Prediction,
    slices: u16,
    frames: u32,
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
    frames: 4,
};

/// Two frames of blocks and truncations that no other stream has: a row each of the table of scales and shifts (section 7.8).
const fn scaled(name: &'static str, edge: u32, truncation: u32, coefficients: u16) -> Case {
    Case { name, edge, truncation, coefficients, motion: Prediction::SixDof, frames: 2, ..PAPER }
}

const CASES: [Case; 16] = [
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
    scaled("paper_edge_4_truncation_5", 4, 5, 20),
    scaled("paper_edge_4_truncation_12", 4, 12, 20),
    scaled("paper_edge_8_truncation_3", 8, 3, 64),
    scaled("paper_edge_8_truncation_6", 8, 6, 64),
    scaled("paper_edge_8_truncation_13", 8, 13, 64),
    scaled("paper_edge_16_truncation_6", 16, 6, 200),
    scaled("paper_edge_16_truncation_12", 16, 12, 200),
    Case { name: "paper_long_segment", coefficients: 512, steps: [32, 160], frames: 1, ..PAPER },
];

/// Writes the streams that a folder does not have yet, and adds them to its tables. `colour`: those with colour alone.
pub(crate) fn run(folder: &str, colour: bool) -> Result<()> {
    let folder = Path::new(folder);
    if !colour {
        write_volumes(folder)?;
    }
    write_colours(folder)
}

/// Writes the streams whose volumes are what matters.
fn write_volumes(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder.join("refused"))?;
    let paper = CASES.iter().map(|case| Ok((case.name, encode_case(case)?))).collect::<Result<Vec<_>>>()?;
    let mut table = String::new();
    for (name, (stream, hashes)) in paper
        .into_iter()
        .chain(main_profile::streams()?)
        .chain(extremes::streams()?)
        .chain(version_2::streams()?)
        .chain(cells::streams()?)
    {
        if write_new(&folder.join(format!("{name}.isv")), &stream)? {
            for (frame, hash) in hashes.iter().enumerate() {
                writeln!(table, "{name}.isv {frame} {hash:016x}")?;
            }
        }
    }
    append(&folder.join("hashes.txt"), &table)?;
    write_refused(folder, "refused.txt", "refused", refused::streams()?)?;
    write_refused(folder, "may_refuse.txt", "refused", refused::optional_streams()?)
}

/// Writes the streams whose colour is what matters.
fn write_colours(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder.join("colour_refused"))?;
    let (mut table, mut colours) = (String::new(), String::new());
    for (name, colour::ColourStream { stream: (bytes, hashes), colours: found }) in colour::streams()? {
        if write_new(&folder.join(format!("{name}.isv")), &bytes)? {
            for (frame, (hash, colour)) in hashes.iter().zip(&found).enumerate() {
                writeln!(table, "{name}.isv {frame} {hash:016x}")?;
                let colour = colour.map_or("-".to_owned(), |hash| format!("{hash:016x}"));
                writeln!(colours, "{name}.isv {frame} {colour}")?;
            }
        }
    }
    append(&folder.join("hashes.txt"), &table)?;
    append(&folder.join("colour.txt"), &colours)?;
    write_refused(folder, "colour_refused.txt", "colour_refused", colour::refused()?)
}

/// Writes streams that must be refused into one of the folder's folders, and adds them to a table.
fn write_refused(folder: &Path, table: &str, place: &str, cases: Vec<refused::Refused>) -> Result<()> {
    let mut lines = String::new();
    for case in cases {
        if write_new(&folder.join(place).join(format!("{}.isv", case.name)), &case.bytes)? {
            writeln!(lines, "{}.isv {} {}", case.name, case.frames, case.class)?;
        }
    }
    append(&folder.join(table), &lines)
}

/// Writes a file if there is none. Whether it did.
fn write_new(path: &Path, bytes: &[u8]) -> Result<bool> {
    if path.exists() {
        return Ok(false);
    }
    std::fs::write(path, bytes).with_context(|| path.display().to_string())?;
    Ok(true)
}

/// Adds lines to the end of a file.
fn append(path: &Path, lines: &str) -> Result<()> {
    let mut file = std::fs::OpenOptions::new().create(true).append(true).open(path)?;
    file.write_all(lines.as_bytes()).with_context(|| path.display().to_string())
}

fn encode_case(case: &Case) -> Result<Stream> {
    let profile = Profile::Paper(PaperParameters {
        coefficients: case.coefficients,
        dc_step: case.steps[0],
        ac_step: case.steps[1],
    });
    let header = header(profile, case.edge, case.truncation)?;
    let motion = MotionMode::Fixed(case.motion);
    let settings = EncoderSettings { motion, slices: Some(case.slices), ..Default::default() };
    let volumes: Vec<_> = (0..case.frames).map(|frame| ball(header.grid, f64::from(frame))).collect();
    encode(&header, settings, &volumes)
}

fn header(profile: Profile, edge: u32, truncation: u32) -> Result<StreamHeader> {
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(0.005)?,
        edge: BlockEdge::from_voxels(edge)?,
        truncation: Truncation::from_voxels(truncation)?,
    };
    Ok(StreamHeader::new(profile, grid, FrameRate::DEFAULT))
}

fn encode(header: &StreamHeader, settings: EncoderSettings, volumes: &[SparseVolume]) -> Result<Stream> {
    let mut encoder = Encoder::new(header, EncoderSettings { checksums: true, ..settings });
    let mut writer = PacketWriter::new(Vec::new(), header)?;
    let mut hashes = Vec::new();
    for (frame, volume) in volumes.iter().enumerate() {
        let coded = encoder.encode(volume);
        let timestamp = header.frame_rate.timestamp_ns(frame as u64);
        writer.write_frame(coded.keyframe, timestamp, &coded.payload())?;
        hashes.push(volume_hash(encoder.reconstruction().context("a frame was just encoded")?));
    }
    Ok((writer.finish()?, hashes))
}
