//! Volumes to symbols: the part of encoding between ingest and the bytes.

use super::groups::Groups;
use super::two_pass::Steps;
use super::volumes::IngestedFrame;
use super::{EncodeError, EncodeOptions};
use crate::device::Coder;
use crate::stream::timed;
use crate::{DeviceError, Observer, OpenDevice};
use isv_encode::colour::{ColourEncoder, EncodedColour};
use isv_encode::{ColourRate, UnwrittenFrame, surface_rms_voxels};
use isv_format::StreamHeader;
use isv_surface::{SurfaceOptions, extract_surface};
use isv_volume::{BlockIndex, ColourSample, SparseVolume};
use std::borrow::Cow;
use std::sync::Arc;
use std::time::SystemTime;

/// A frame ready to be written.
pub(super) struct CodedFrame {
    /// Number of the frame in the capture.
    pub(super) number: usize,
    /// When it had been read.
    pub(super) read: SystemTime,
    /// Time stamp as the capture says, if it does.
    pub(super) timestamp_ns: Option<u64>,
    pub(super) frame: UnwrittenFrame,
    /// Colour of the frame, in streams with colour.
    pub(super) colour: Option<EncodedColour>,
    /// Whether there is a surface, as in [`IngestedFrame`], and decoders have any of it.
    pub(super) has_surface: bool,
    /// Whether there was one that coding has left nothing of.
    pub(super) is_lost: bool,
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
    coders: Coders,
    /// Makes the coders of a group of pictures that is coded by itself.
    open: Box<dyn Fn() -> Result<Coders, DeviceError> + Send>,
    groups: Groups,
    /// Whether statistics are wanted of what coding has done to the surface.
    measures_change: bool,
}

/// Coders of a stream, with what they keep from frame to frame.
struct Coders {
    coder: Coder,
    /// The coder of colour, in streams that have any.
    colour: Option<ColourCoding>,
}

/// Blocks of a frame up to which all of its surface may be lost in coding.
const FEW_BLOCKS: usize = 64;

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
    /// Opens the coders of a stream that begins with the frame `first` of its capture.
    pub(super) fn open(
        options: &EncodeOptions,
        header: &StreamHeader,
        Steps { settings, colour_scale }: Steps,
        device: &OpenDevice,
        first: usize,
        observer: &Arc<dyn Observer>,
    ) -> Result<Self, DeviceError> {
        let (device, header, observer, all) =
            (device.clone(), *header, Arc::clone(observer), options.clone());
        let open = move || {
            let coder = device.coder(&header, settings, &observer)?;
            Ok(Coders { coder, colour: all.colour_encoder(&header, colour_scale) })
        };
        let (coders, groups) = (open()?, options.groups(first));
        Ok(Self { coders, open: Box::new(open), groups, measures_change: options.measures_change })
    }

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
        if self.groups.enter(number) {
            self.coders = (self.open)()?;
        }
        let Coders { coder, colour } = &mut self.coders;
        let (coded, coding_ms) = timed(|| coder.code(&volume));
        let frame = coded?;
        let is_lost = has_surface && volume.block_count() <= FEW_BLOCKS && {
            let decoded = coder.reconstruction()?.expect("a frame was just coded");
            extract_surface(&decoded, &SurfaceOptions { normals: false }).triangles.is_empty()
        };
        let surface_rms_voxels = match self.measures_change {
            true => {
                let decoded = coder.reconstruction()?.expect("a frame was just coded");
                Some(surface_rms_voxels(&volume, &decoded))
            }
            false => None,
        };
        let (colour, colour_ms) = match colour {
            Some(colour) => {
                let decoded = coder.reconstruction()?.expect("a frame was just coded");
                let rate = coder.colour_rate();
                timed(|| Some(colour.code(&decoded, &colours, colours_stand, frame.is_keyframe(), rate)))
            }
            None => (None, 0.0),
        };
        Ok(CodedFrame {
            number,
            read,
            timestamp_ns,
            frame,
            has_surface: has_surface && !is_lost,
            is_lost,
            blocks_band,
            ingest_ms,
            coding_ms,
            colour,
            colour_ms,
            surface_rms_voxels,
        })
    }
}
