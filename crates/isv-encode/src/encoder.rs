//! The encoder: one volume, one frame payload.

use crate::main_profile::{MainEncoder, MainSettings};
use crate::motion_search::search_motion;
use crate::residual::quantized_residual;
use crate::syntax::{self, SymbolSegments};
use isv_decode::reconstruct::{predict, reconstruct};
use isv_decode::syntax::{EntropyState, most_slices};
use isv_decode::{CodingParameters, FrameSymbols, Reference, volume_hash};
use isv_format::{
    FrameCoding, FrameHeader, FramePayload, PacketHeader, Prediction, Profile, SlicePayload, StreamHeader,
};
use isv_kernels::warp::MotionVector;
use isv_volume::SparseVolume;

/// Blocks a slice holds at most, unless the number of slices is given or has reached its limit. A person at 5 mm is one
/// slice; the models of more would have to learn everything again.
pub const BLOCKS_PER_SLICE: usize = 1 << 14;

/// Bytes of a frame in a stream's index.
const INDEX_ENTRY_BYTES: usize = 8;

/// How frames that are not keyframes are predicted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionMode {
    /// Always so.
    Fixed(Prediction),
    /// For each frame, whichever kind takes the fewest bytes: after a jump, that is no prediction at all.
    Auto,
}

/// Choices that a stream's header does not record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncoderSettings {
    /// Prediction of frames that are not keyframes.
    pub motion: MotionMode,
    /// A keyframe at least every this many frames; not 0.
    pub gop: u32,
    /// Whether frames carry a hash of the decoded volume (8 bytes).
    pub checksums: bool,
    /// Number of slices; `None` for one to every 16,384 blocks in profile `paper`, and what [`Self::main`] says in profile
    /// `main`.
    pub slices: Option<u16>,
    /// Choices of profile `main`.
    pub main: MainSettings,
}

impl Default for EncoderSettings {
    fn default() -> Self {
        Self {
            motion: MotionMode::Fixed(Prediction::ThreeDof),
            gop: 30,
            checksums: false,
            slices: None,
            main: MainSettings::default(),
        }
    }
}

/// A frame as coded.
#[derive(Clone, Debug)]
pub struct EncodedFrame {
    /// Whether decoding can begin here.
    pub keyframe: bool,
    header: FrameHeader,
    segments: SymbolSegments,
}

impl EncodedFrame {
    pub(crate) fn new(keyframe: bool, header: FrameHeader, segments: SymbolSegments) -> Self {
        Self { keyframe, header, segments }
    }

    /// The payload for a [`isv_format::PacketWriter`].
    #[must_use]
    pub fn payload(&self) -> FramePayload<'_> {
        let slices = self.segments.slices.iter();
        FramePayload {
            header: self.header,
            block_set: &self.segments.block_set,
            masks: &self.segments.masks,
            slices: slices
                .map(|s| SlicePayload { motion: &s.motion, coefficients: &s.coefficients })
                .collect(),
        }
    }

    /// How the frame's blocks are predicted.
    #[must_use]
    pub fn prediction(&self) -> Prediction {
        self.header.prediction
    }

    /// Bytes of the block set and the masks of unobserved voxels.
    #[must_use]
    pub fn bytes_blocks(&self) -> usize {
        self.segments.block_set.len() + self.bytes_masks()
    }

    /// Bytes of the masks of unobserved voxels.
    #[must_use]
    pub fn bytes_masks(&self) -> usize {
        self.segments.masks.len()
    }

    /// Bytes of motion vectors.
    #[must_use]
    pub fn bytes_motion(&self) -> usize {
        self.segments.slices.iter().map(|s| s.motion.len()).sum()
    }

    /// Bytes of quantized coefficients.
    #[must_use]
    pub fn bytes_coefficients(&self) -> usize {
        self.segments.slices.iter().map(|s| s.coefficients.len()).sum()
    }

    /// The part of [`Self::bytes_coefficients`] that DC coefficients take, to a fraction of a byte.
    #[must_use]
    pub fn bytes_dc(&self) -> f64 {
        self.segments.slices.iter().map(|s| s.dc_bits / 8.0).sum()
    }

    /// Bytes that the frame adds to a stream: packet and entry in the index.
    pub(crate) fn stream_bytes(&self) -> usize {
        PacketHeader::BYTES + self.payload().to_bytes().len() + INDEX_ENTRY_BYTES
    }

    fn segment_bytes(&self) -> usize {
        self.bytes_blocks() + self.bytes_motion() + self.bytes_coefficients()
    }
}

/// Codes the frames of a stream in order.
#[derive(Debug)]
pub struct Encoder {
    settings: EncoderSettings,
    profile: ProfileEncoder,
    /// Frames since the last keyframe and with it; 0 before the first.
    since_keyframe: u32,
}

/// An encoder of each profile.
#[derive(Debug)]
enum ProfileEncoder {
    Paper(Box<PaperEncoder>),
    Main(Box<MainEncoder>),
}

/// The encoder of profile `paper`.
#[derive(Debug)]
struct PaperEncoder {
    parameters: CodingParameters,
    settings: EncoderSettings,
    state: State,
}

/// What one frame leaves behind for the next.
#[derive(Debug)]
struct State {
    entropy: EntropyState,
    reference: Option<Reference>,
}

impl Encoder {
    /// An encoder for the frames of a stream.
    ///
    /// # Panics
    /// If `settings.gop` is 0.
    #[must_use]
    pub fn new(header: &StreamHeader, settings: EncoderSettings) -> Self {
        assert!(settings.gop > 0, "a GOP has at least one frame");
        let profile = match &header.profile {
            Profile::Paper(paper) => {
                let parameters = CodingParameters::new(header.grid, paper);
                let state = State { entropy: EntropyState::new(parameters.coefficients()), reference: None };
                ProfileEncoder::Paper(Box::new(PaperEncoder { parameters, settings, state }))
            }
            Profile::Main => {
                ProfileEncoder::Main(Box::new(MainEncoder::new(header.grid, settings.main, settings.gop)))
            }
        };
        Self { settings, profile, since_keyframe: 0 }
    }

    /// Codes the next frame.
    ///
    /// # Panics
    /// If the volume is not on the stream's grid.
    pub fn encode(&mut self, volume: &SparseVolume) -> EncodedFrame {
        let keyframe = self.since_keyframe.is_multiple_of(self.settings.gop);
        let frame = match &mut self.profile {
            ProfileEncoder::Paper(encoder) => encoder.encode(volume, keyframe),
            ProfileEncoder::Main(encoder) => {
                let wanted = self
                    .settings
                    .slices
                    .unwrap_or(self.settings.main.slices)
                    .clamp(1, FrameHeader::MAX_SLICES);
                encoder.encode(volume, keyframe, wanted, self.settings.checksums)
            }
        };
        self.since_keyframe = if frame.keyframe { 1 } else { self.since_keyframe + 1 };
        frame
    }

    /// What the decoder will have after the last frame; `None` before the first.
    #[must_use]
    pub fn reconstruction(&self) -> Option<&SparseVolume> {
        match &self.profile {
            ProfileEncoder::Paper(encoder) => encoder.state.reference.as_ref().map(Reference::volume),
            ProfileEncoder::Main(encoder) => encoder.reconstruction(),
        }
    }
}

impl PaperEncoder {
    fn encode(&mut self, volume: &SparseVolume, keyframe: bool) -> EncodedFrame {
        assert_eq!(volume.grid(), &self.parameters.grid, "one grid a stream");
        if keyframe {
            self.state =
                State { entropy: EntropyState::new(self.parameters.coefficients()), reference: None };
        }
        let candidates = match self.settings.motion {
            _ if keyframe => vec![Prediction::None],
            MotionMode::Fixed(prediction) => vec![prediction],
            MotionMode::Auto => Prediction::ALL.to_vec(),
        };
        let coded =
            candidates.into_iter().map(|prediction| self.encode_predicted(volume, keyframe, prediction));
        let (frame, state) =
            coded.min_by_key(|(frame, _)| frame.segment_bytes()).expect("at least one candidate");
        self.state = state;
        frame
    }

    /// Codes a frame under one kind of prediction, leaving the encoder as it is.
    fn encode_predicted(
        &self,
        volume: &SparseVolume,
        keyframe: bool,
        prediction: Prediction,
    ) -> (EncodedFrame, State) {
        let parameters = &self.parameters;
        let reference = self.state.reference.as_ref();
        let before = reference.map(Reference::blocks);
        let references = FrameSymbols::find_references(volume.coords(), prediction, before);
        let motion = match reference {
            Some(reference) if prediction.has_motion() => {
                search_motion(prediction, volume, reference, &references)
            }
            _ => vec![MotionVector::ZERO; volume.block_count()],
        };
        let mut symbols = FrameSymbols {
            prediction,
            coords: volume.coords().to_vec(),
            unobserved: volume.unobserved_masks().clone(),
            references,
            motion,
            levels: Vec::new(),
        };
        let predicted = predict(parameters, &symbols, reference);
        symbols.levels = quantized_residual(parameters, volume, &predicted);

        let slices = self.slice_count(volume.block_count());
        let mut entropy = self.state.entropy.clone();
        let segments =
            syntax::write_symbols(&mut entropy, parameters.grid.edge, &symbols, usize::from(slices), before);
        let decoded = reconstruct(parameters, symbols, predicted);
        let header = FrameHeader {
            prediction,
            blocks: volume.block_count() as u32,
            slices,
            coding: FrameCoding::Paper,
            volume_hash: self.settings.checksums.then(|| volume_hash(&decoded)),
        };
        let state = State { entropy, reference: Some(Reference::new(decoded)) };
        (EncodedFrame { keyframe, header, segments }, state)
    }

    fn slice_count(&self, blocks: usize) -> u16 {
        let wanted = self.settings.slices.map_or(blocks.div_ceil(BLOCKS_PER_SLICE), usize::from);
        wanted.clamp(1, most_slices(self.parameters.coefficients())) as u16
    }
}
