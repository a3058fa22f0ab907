//! Volumes to symbols: the part of encoding between ingest and the bytes.

use super::EncodeError;
use super::volumes::IngestedFrame;
use crate::device::Coder;
use crate::stream::timed;
use isv_encode::colour::{ColourEncoder, EncodedColour};
use isv_encode::{ColourRate, UnwrittenFrame, surface_rms_voxels};
use isv_volume::{BlockIndex, ColourSample, SparseVolume};
use std::borrow::Cow;
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
    pub(super) colour: Option<ColourCoding>,
    /// Whether statistics are wanted of what coding has done to the surface.
    pub(super) measures_change: bool,
}

/// Share of blocks without a colour of their own that a frame may have before its colours are coded: one in so many.
const NEW_SHARE: usize = 128;

/// The coder of colour, and what it coded last.
pub(super) struct ColourCoding {
    pub(super) encoder: ColourEncoder,
    /// Whether any frame may be coded without the one before, so that each needs all colours.
    pub(super) is_gradual: bool,
    /// Blocks of the last frame whose colours were coded and not just kept.
    pub(super) blocks: Option<BlockIndex>,
}

impl ColourCoding {
    /// Codes the colour of a frame. `stand`: whether what was seen has hardly changed since it was last coded.
    fn code(
        &mut self,
        decoded: &SparseVolume,
        seen: &[ColourSample],
        stand: bool,
        is_keyframe: bool,
        rate: ColourRate,
    ) -> EncodedColour {
        let stands_alone = is_keyframe || self.is_gradual;
        let samples = match self.encoder.reconstruction() {
            // Without samples the encoder keeps the frame before, which frames that stand alone do not have.
            Some(_) if stand && !stands_alone && self.has_few_new_blocks(decoded) => Cow::Borrowed(&[][..]),
            Some(before) if seen.is_empty() && stands_alone => Cow::Owned(before.to_samples(decoded.grid())),
            _ => Cow::Borrowed(seen),
        };
        if !samples.is_empty() {
            self.blocks = Some(decoded.index());
        }
        self.encoder.encode_at_rate(decoded, &samples, is_keyframe, rate)
    }

    /// Whether almost all blocks of a frame were there when colours were last coded. New ones need a colour of their own.
    fn has_few_new_blocks(&self, decoded: &SparseVolume) -> bool {
        let Some(before) = &self.blocks else { return false };
        let new = decoded.coords().iter().filter(|block| before.get(**block).is_none()).count();
        new * NEW_SHARE <= decoded.block_count()
    }
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
            colours_stand,
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
            Some(colour) => {
                let decoded = self.coder.reconstruction()?.expect("a frame was just coded");
                let rate = self.coder.colour_rate();
                timed(|| Some(colour.code(&decoded, &colours, colours_stand, frame.is_keyframe(), rate)))
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
