//! One codec at one point on one take: frames in, a stream out, frames back.

mod draco;
mod paper;
mod tang;
mod volumes;

use crate::record::BytesByKind;
use crate::{Codec, OperatingPoint, Prepared, StudyError, StudySettings, Take};
use isv::volume::TriangleMesh;
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

    /// What of it says what, where that is known.
    fn kinds(&self) -> Option<BytesByKind>;

    /// Decodes frame after frame, from the bytes alone.
    fn decode(&self) -> Result<Box<dyn Iterator<Item = Result<DecodedFrame, StudyError>> + '_>, StudyError>;

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
    /// Peak memory of a program that did it; `None` if this process did.
    pub(crate) program_peak_bytes: Option<u64>,
}

/// A frame as decoded.
pub(crate) struct DecodedFrame {
    pub(crate) mesh: TriangleMesh,
    pub(crate) ms: f64,
    /// Peak memory of a program that did it; `None` if this process did.
    pub(crate) program_peak_bytes: Option<u64>,
}

/// A codec ready to encode a take.
pub(crate) fn begin(
    codec: Codec,
    point: OperatingPoint,
    take: &dyn Take,
    settings: &StudySettings,
    prepared: &Prepared,
) -> Result<Box<dyn Encoding>, StudyError> {
    Ok(match (codec, point) {
        (Codec::Paper(motion), OperatingPoint::Steps { coefficients, dc_step_m, ac_step_m }) => {
            let steps = [dc_step_m, ac_step_m];
            Box::new(paper::PaperEncoding::new(motion, coefficients, steps, take.frame_rate(), settings)?)
        }
        (Codec::Tang(_), OperatingPoint::UniformStep { coefficients, step_m }) => {
            Box::new(tang::TangEncoding::new(prepared.basis(), coefficients, step_m, settings)?)
        }
        (Codec::Draco { faces_percent }, OperatingPoint::PositionBits(bits)) => {
            Box::new(draco::DracoEncoding::new(prepared.draco(), faces_percent, bits))
        }
        _ => unreachable!("a codec's points are its own"),
    })
}

/// Runs a step and measures it in milliseconds.
fn timed<T>(step: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = step();
    (result, start.elapsed().as_secs_f64() * 1e3)
}
