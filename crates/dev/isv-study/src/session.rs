//! One codec at one point on one take: frames in, a stream out, frames back.

mod draco;
mod draco_video;
mod gltfpack;
mod isv;
mod kept_frames;
mod tang;
mod tmc13;
mod tmc2;
mod vdmc;
mod volumes;

pub(crate) use self::isv::IsvEncoding;
pub(crate) use draco::DracoEncoding;
pub(crate) use draco_video::DracoVideoEncoding;
pub(crate) use gltfpack::GltfpackEncoding;
pub(crate) use tang::TangEncoding;
pub(crate) use tmc2::Tmc2Encoding;
pub(crate) use tmc13::Tmc13Encoding;
pub(crate) use vdmc::VdmcEncoding;

use crate::StudyError;
use crate::record::{BytesByKind, ProgramUse};
use ::isv::raw::io::Geometry;
use ::isv::raw::volume::TriangleMesh;
use isv_baseline::{ToolVersion, simplify};
use std::time::Instant;

/// The encoding side.
pub(crate) trait Encoding {
    /// Codes the next frame.
    fn encode(&mut self, mesh: &TriangleMesh) -> Result<EncodedFrame, StudyError>;

    /// The stream of all frames so far.
    fn finish(self: Box<Self>) -> Result<Box<dyn Stream>, StudyError>;
}

/// What a decoder gets.
pub(crate) trait Stream {
    /// Size of all of it.
    fn bytes(&self) -> u64;

    /// Bytes of it that are colour.
    fn bytes_colour(&self) -> u64 {
        0
    }

    /// What of it says what, where that is known.
    fn kinds(&self) -> Option<BytesByKind>;

    /// Decodes frame after frame, from the bytes alone; with `colour`, meshes have the stream's colour, if it has any.
    fn decode(
        &self,
        colour: bool,
    ) -> Result<Box<dyn Iterator<Item = Result<DecodedFrame, StudyError>> + '_>, StudyError>;

    /// Step (m) of the lattice that decoded points lie on, if it decodes to points.
    fn point_step_m(&self) -> Option<f64> {
        None
    }

    /// Time and memory of encoding, where the take is encoded at its end rather than frame by frame.
    fn whole_take(&self) -> Option<WholeTake> {
        None
    }

    /// Programs of others that made it and that decode it.
    fn programs(&self) -> Vec<ProgramUse> {
        Vec::new()
    }

    /// The bytes as a file that another command reads, if there is one.
    fn isv_file(&self) -> Option<&[u8]> {
        None
    }
}

/// A frame as coded.
pub(crate) struct EncodedFrame {
    pub(crate) bytes: u64,
    pub(crate) prepare_ms: f64,
    pub(crate) encode_ms: f64,
    /// Time that coding its colour took (ms), if it has any.
    pub(crate) colour_ms: Option<f64>,
    pub(crate) memory: Memory,
}

impl EncodedFrame {
    /// A frame that the program of another codec coded, whose times are not told apart by geometry and colour. It comes with its peak memory in bytes where the system says.
    fn by_program(bytes: u64, prepare_ms: f64, encode_ms: f64, peak_memory_bytes: Option<u64>) -> Self {
        let memory = Memory::OfAProgram(peak_memory_bytes);
        Self { bytes, prepare_ms, encode_ms, colour_ms: None, memory }
    }
}

/// A frame as decoded.
pub(crate) struct DecodedFrame {
    pub(crate) shape: Geometry,
    pub(crate) ms: f64,
    pub(crate) memory: Memory,
}

/// Encoding of all frames at once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WholeTake {
    pub(crate) encode_ms: f64,
    /// Time that coding colour took (ms), if there is any.
    pub(crate) colour_ms: Option<f64>,
    pub(crate) memory: Memory,
}

/// The two programs of a codec, as they were run.
fn program_uses(names: [&str; 2], version: &ToolVersion, commands: [String; 2]) -> Vec<ProgramUse> {
    let [encoder, decoder] = commands;
    let note = version.note(names[0]);
    [(encoder, note), (decoder, None)]
        .map(|(command, note)| ProgramUse { version: version.version.clone(), command, note })
        .to_vec()
}

/// A mesh without its colour, simplified to a share of its faces in percent. `frame` is its number in messages.
fn prepared_mesh(mesh: &TriangleMesh, faces_percent: u8, frame: usize) -> Result<TriangleMesh, StudyError> {
    // Colour would be coded with the vertices.
    let mesh = TriangleMesh { appearance: None, ..mesh.clone() };
    if faces_percent == 100 {
        return Ok(mesh);
    }
    simplify(&mesh, f64::from(faces_percent) / 100.0).map_err(|cause| StudyError::Simplify { frame, cause })
}

/// Whose peak memory it is that a frame took.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Memory {
    /// This process did it.
    OfThisProcess,
    /// A program of its own did it, with this peak in bytes, if that was seen.
    OfAProgram(Option<u64>),
}

impl Memory {
    /// The peak of all frames in bytes; `own` is that of this process.
    pub(crate) fn peak(frames: &[Self], own: Option<u64>) -> Option<u64> {
        let of_each = frames.iter().map(|memory| match memory {
            Self::OfThisProcess => own,
            Self::OfAProgram(peak) => *peak,
        });
        of_each.max().flatten()
    }
}

/// Runs a step and measures it in milliseconds.
fn timed<T>(step: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = step();
    (result, start.elapsed().as_secs_f64() * 1e3)
}
