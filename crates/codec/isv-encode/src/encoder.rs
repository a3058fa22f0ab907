//! The encoder: one volume, one frame payload.

use crate::frame_coder::FrameCoder;
use crate::frame_writer::FrameWriter;
use crate::main::MainSettings;
use crate::shared::syntax::SymbolSegments;
use isv_decode::backend::Cpu;
use isv_format::{
    FrameHeader, FramePayload, PacketHeader, Prediction, SlicePayload, StreamHeader, StreamIndex,
};
use isv_volume::SparseVolume;

/// Blocks a slice holds at most, unless the number of slices is given or has reached its limit. A person at 5 mm is one
/// slice; the models of more would have to learn everything again.
pub const BLOCKS_PER_SLICE: usize = 1 << 14;

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
    /// How far the decoded surface is from the source's ([`surface_distance_voxels`](crate::surface_distance_voxels)), where an error is
    /// aimed at.
    pub surface_distance_voxels: Option<f64>,
    header: FrameHeader,
    segments: SymbolSegments,
}

impl EncodedFrame {
    pub(crate) fn new(keyframe: bool, header: FrameHeader, segments: SymbolSegments) -> Self {
        Self { keyframe, surface_distance_voxels: None, header, segments }
    }

    /// The payload for a [`isv_format::PacketWriter`].
    #[must_use]
    pub fn payload(&self) -> FramePayload<'_> {
        let slices = self.segments.slices.iter();
        FramePayload {
            header: self.header,
            block_set: &self.segments.block_set,
            masks: &self.segments.masks,
            slices: slices.map(|s| SlicePayload { modes: &s.modes, coefficients: &s.coefficients }).collect(),
        }
    }

    /// How the frame's blocks are predicted.
    #[must_use]
    pub fn prediction(&self) -> Prediction {
        self.header.prediction()
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

    /// Bytes of modes, or in profile `paper` of motion vectors.
    #[must_use]
    pub fn bytes_modes(&self) -> usize {
        self.segments.slices.iter().map(|s| s.modes.len()).sum()
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
        PacketHeader::BYTES + self.payload().to_bytes().len() + StreamIndex::ENTRY_BYTES
    }

    pub(crate) fn segment_bytes(&self) -> usize {
        self.bytes_blocks() + self.bytes_modes() + self.bytes_coefficients()
    }
}

/// Codes the frames of a stream in order, on the CPU: a coder and its writer, one after the other.
#[derive(Debug)]
pub struct Encoder {
    coder: FrameCoder<Cpu, Cpu>,
    writer: FrameWriter,
}

impl Encoder {
    /// An encoder for the frames of a stream.
    ///
    /// # Panics
    /// If `settings.gop` is 0.
    #[must_use]
    pub fn new(header: &StreamHeader, settings: EncoderSettings) -> Self {
        Self { coder: FrameCoder::on_cpu(header, settings), writer: FrameWriter::default() }
    }

    /// Codes the next frame.
    ///
    /// # Panics
    /// If the volume is not on the stream's grid.
    pub fn encode(&mut self, volume: &SparseVolume) -> EncodedFrame {
        let frame = self.coder.code(volume).expect("at full resolution the CPU never fails");
        self.writer.write(frame)
    }

    /// What the decoder will have after the last frame; `None` before the first.
    #[must_use]
    pub fn reconstruction(&self) -> Option<&SparseVolume> {
        self.coder.reconstruction()
    }
}
