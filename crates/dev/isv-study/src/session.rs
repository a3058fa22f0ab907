//! One codec at one point on one take: frames in, a stream out, frames back.

mod draco;
mod isv;
mod tang;
mod volumes;

pub(crate) use self::isv::IsvEncoding;
pub(crate) use draco::DracoEncoding;
pub(crate) use tang::TangEncoding;

use crate::StudyError;
use crate::record::BytesByKind;
use ::isv::raw::volume::TriangleMesh;
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

/// A frame as decoded.
pub(crate) struct DecodedFrame {
    pub(crate) mesh: TriangleMesh,
    pub(crate) ms: f64,
    pub(crate) memory: Memory,
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
