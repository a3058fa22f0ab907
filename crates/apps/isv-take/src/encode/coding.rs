//! Volumes to symbols: the part of encoding between ingest and the bytes.

use super::EncodeError;
use super::volumes::IngestedFrame;
use crate::device::Coder;
use crate::stream::timed;
use isv_encode::colour::{ColourEncoder, EncodedColour};
use isv_encode::{UnwrittenFrame, surface_rms_voxels};
use std::time::SystemTime;

/// A frame ready to be written.
pub(super) struct CodedFrame {
    /// Its number in the capture.
    pub(super) number: usize,
    /// When it had been read.
    pub(super) read: SystemTime,
    /// As the capture says, if it does.
    pub(super) timestamp_ns: Option<u64>,
    pub(super) frame: UnwrittenFrame,
    /// Colour of the frame, in streams with colour.
    pub(super) colour: Option<EncodedColour>,
    /// Of [`IngestedFrame`].
    pub(super) has_surface: bool,
    pub(super) blocks_band: usize,
    pub(super) ingest_ms: f64,
    pub(super) coding_ms: f64,
    /// Time that coding its colour took (ms).
    pub(super) colour_ms: f64,
    /// How much the field near the surface has changed, if statistics are wanted.
    pub(super) surface_rms_voxels: Option<f64>,
}

/// Codes volumes.
pub(super) struct Coding {
    pub(super) coder: Coder,
    /// The coder of colour, in streams that have any.
    pub(super) colour: Option<ColourEncoder>,
    /// Whether statistics are wanted of what coding has done to the surface.
    pub(super) measures_change: bool,
}

impl Coding {
    /// Codes one frame after the other.
    pub(super) fn code_all(
        mut self,
        frames: impl Iterator<Item = Result<IngestedFrame, EncodeError>>,
    ) -> impl Iterator<Item = Result<CodedFrame, EncodeError>> {
        frames.map(move |frame| self.code(frame?))
    }

    pub(super) fn code(&mut self, frame: IngestedFrame) -> Result<CodedFrame, EncodeError> {
        let IngestedFrame {
            number,
            read,
            timestamp_ns,
            volume,
            colours,
            has_surface,
            blocks_band,
            ingest_ms,
        } = frame;
        let (coded, coding_ms) = timed(|| self.coder.code(&volume));
        let frame = coded?;
        let surface_rms_voxels = match self.measures_change {
            true => {
                let decoded = self.coder.reconstruction()?.expect("a frame was just coded");
                Some(surface_rms_voxels(&volume, &decoded))
            }
            false => None,
        };
        let (colour, colour_ms) = match &mut self.colour {
            Some(encoder) => {
                let decoded = self.coder.reconstruction()?.expect("a frame was just coded");
                timed(|| Some(encoder.encode(&decoded, &colours, frame.is_keyframe())))
            }
            None => (None, 0.0),
        };
        Ok(CodedFrame {
            number,
            read,
            timestamp_ns,
            frame,
            has_surface,
            blocks_band,
            ingest_ms,
            coding_ms,
            colour,
            colour_ms,
            surface_rms_voxels,
        })
    }
}
