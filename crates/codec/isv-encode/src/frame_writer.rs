//! Symbols to bytes: the last step of encoding, which looks at no samples.

use crate::encoder::EncodedFrame;
use crate::paper::syntax;
use isv_decode::ReferenceBlocks;
use isv_decode::paper::FrameSymbols;
use isv_decode::paper::syntax::EntropyState;
use isv_format::{FrameCoding, FrameHeader};
use isv_volume::{BlockCoord, BlockEdge, BlockIndex, VoxelMask};
use std::collections::BTreeMap;

/// A frame whose samples are done with, for a [`FrameWriter`]. The next frame can be begun before it is written.
#[derive(Debug)]
pub struct UnwrittenFrame(Content);

#[derive(Debug)]
enum Content {
    Symbols(Box<PaperSymbols>),
    /// Bytes of a frame of profile `main`. Its symbols cannot be told from their bytes: choices depend on what models have learned.
    Bytes(EncodedFrame),
}

/// All that is written of a frame of profile `paper`.
#[derive(Debug)]
pub(crate) struct PaperSymbols {
    pub(crate) keyframe: bool,
    pub(crate) edge: BlockEdge,
    /// Coefficients a block.
    pub(crate) coefficients: usize,
    pub(crate) slices: u16,
    pub(crate) symbols: FrameSymbols,
    /// Hash of the decoded frame, where the stream is to state it.
    pub(crate) volume_hash: Option<u64>,
}

impl From<PaperSymbols> for UnwrittenFrame {
    fn from(symbols: PaperSymbols) -> Self {
        Self(Content::Symbols(Box::new(symbols)))
    }
}

impl UnwrittenFrame {
    /// Whether decoding can begin here.
    #[must_use]
    pub fn is_keyframe(&self) -> bool {
        match &self.0 {
            Content::Symbols(symbols) => symbols.keyframe,
            Content::Bytes(frame) => frame.keyframe,
        }
    }
}

impl From<EncodedFrame> for UnwrittenFrame {
    fn from(frame: EncodedFrame) -> Self {
        Self(Content::Bytes(frame))
    }
}

/// Writes the frames of a stream in order: the range coder, its models, and what they have learned.
#[derive(Clone, Debug, Default)]
pub struct FrameWriter {
    paper: Option<PaperWriter>,
}

/// What a frame of profile `paper` leaves behind for the next.
#[derive(Clone, Debug)]
struct PaperWriter {
    entropy: EntropyState,
    before: Option<WrittenBlocks>,
}

/// The blocks of a frame that was written.
#[derive(Clone, Debug)]
struct WrittenBlocks {
    coords: Vec<BlockCoord>,
    index: BlockIndex,
    unobserved: BTreeMap<u32, VoxelMask>,
}

impl FrameWriter {
    /// Writes the next frame.
    ///
    /// # Panics
    /// If the first frame is not a keyframe.
    pub fn write(&mut self, frame: UnwrittenFrame) -> EncodedFrame {
        let symbols = match frame.0 {
            Content::Symbols(symbols) => *symbols,
            Content::Bytes(frame) => return frame,
        };
        if symbols.keyframe {
            self.paper = Some(PaperWriter::new(symbols.coefficients));
        }
        self.paper.as_mut().expect("a stream begins with a keyframe").write(symbols)
    }
}

impl PaperWriter {
    /// Before a keyframe.
    fn new(coefficients: usize) -> Self {
        Self { entropy: EntropyState::new(coefficients), before: None }
    }

    fn write(&mut self, frame: PaperSymbols) -> EncodedFrame {
        let PaperSymbols { keyframe, edge, slices, symbols, volume_hash, .. } = frame;
        let before = self.before.as_ref().map(WrittenBlocks::as_reference);
        let segments = syntax::write_symbols(&mut self.entropy, edge, &symbols, usize::from(slices), before);
        let header = FrameHeader {
            blocks: symbols.coords.len() as u32,
            slices,
            coding: FrameCoding::Paper { prediction: symbols.prediction },
            volume_hash,
        };
        self.before = Some(WrittenBlocks::new(symbols.coords, symbols.unobserved));
        EncodedFrame::new(keyframe, header, segments)
    }
}

impl WrittenBlocks {
    fn new(coords: Vec<BlockCoord>, unobserved: BTreeMap<u32, VoxelMask>) -> Self {
        Self { index: BlockIndex::new(&coords), coords, unobserved }
    }

    fn as_reference(&self) -> ReferenceBlocks<'_> {
        ReferenceBlocks { coords: &self.coords, index: &self.index, unobserved: &self.unobserved }
    }
}
