//! Tang et al. 2018, "Real-time Compression and Streaming of 4D Performances": intra-only coding of TSDF blocks under a
//! learned transform.
//!
//! Everything but the transform and its quantizer is isv's own. Blocks, masks, [`FrameSymbols`], syntax, models, range
//! coder and payload are the same. So a difference in rate is a difference of transforms.

use crate::BlockBasis;
use crate::basis::LeadingBasis;
use isv_decode::paper::FrameSymbols;
use isv_decode::paper::syntax::{EntropyState, most_slices};
use isv_decode::shared::syntax::SyntaxError;
use isv_decode::{BitTally, Limits};
use isv_encode::BLOCKS_PER_SLICE;
use isv_encode::paper::syntax;
use isv_encode::shared::syntax::SymbolSegments;
use isv_format::{
    FormatError, FrameCoding, FrameHeader, FramePayload, PaperParameters, Prediction, Profile, SliceLayout,
    SlicePayload,
};
use isv_kernels::quant::{STEP_FRACTION_BITS, StepSize};
use isv_kernels::warp::MotionVector;
use isv_volume::{Grid, SparseVolume};
use rayon::prelude::*;
use thiserror::Error;

/// Largest level that the syntax codes. Coefficients of 8^3 blocks reach it only under steps below a quarter of a code.
const LEVEL_LIMIT: f32 = (1 << 20) as f32;

/// What a stream of frames is coded with; encoder and decoder must be given the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TangSettings {
    /// The grid of every frame.
    pub grid: Grid,
    /// Coefficients kept of a block: K, 1 to the number of its voxels.
    pub coefficients: usize,
    /// Quantizer step of all of them. The transform is orthonormal, so one step for all gives the least squared error for
    /// the rate (`docs/design/017-baselines.md`).
    pub step: StepSize,
}

impl TangSettings {
    /// The profile of isv whose frames these are, but for the transform.
    fn profile(&self) -> Profile {
        let step = self.step.sixteenths();
        let coefficients = self.coefficients as u16;
        Profile::Paper(PaperParameters { coefficients, dc_step: step, ac_step: step })
    }
}

/// A frame as coded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TangFrame {
    /// The whole frame: counts, lengths and segments, as in the payload of an isv keyframe.
    pub bytes: Vec<u8>,
    /// Bytes of the set of blocks.
    pub bytes_occupancy: usize,
    /// Bytes of masks of unobserved voxels.
    pub bytes_masks: usize,
    /// Bytes of quantized coefficients.
    pub bytes_coefficients: usize,
}

impl TangFrame {
    /// Bytes of counts and lengths.
    #[must_use]
    pub fn bytes_headers(&self) -> usize {
        self.bytes.len() - self.bytes_occupancy - self.bytes_masks - self.bytes_coefficients
    }
}

/// A frame that cannot be decoded.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TangError {
    /// The payload cannot be taken apart.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The payload's fields or symbols are none that an encoder writes.
    #[error("frame {frame}: {what}")]
    Malformed {
        /// Frames decoded before this one.
        frame: u64,
        /// What is wrong.
        what: &'static str,
    },
    /// More blocks than the caller allows.
    #[error("frame {frame} has {blocks} blocks, above the limit of {limit}")]
    TooManyBlocks {
        /// Frames decoded before this one.
        frame: u64,
        /// Blocks the frame states.
        blocks: usize,
        /// The caller's limit.
        limit: usize,
    },
}

/// Codes frames one by one. Only what the adaptive models have learned is kept from frame to frame.
#[derive(Clone, Debug)]
pub struct TangEncoder {
    codec: BlockCodec,
    entropy: EntropyState,
    /// Symbols of the last frame.
    symbols: Option<FrameSymbols>,
}

impl TangEncoder {
    /// An encoder under a transform, as a rule [`crate::BlockMoments::klt`].
    ///
    /// # Panics
    /// If the transform is of blocks of another edge or K is not 1 to the voxels of a block.
    #[must_use]
    pub fn new(basis: &BlockBasis, settings: TangSettings) -> Self {
        let codec = BlockCodec::new(basis, settings);
        Self { codec, entropy: EntropyState::new(settings.coefficients), symbols: None }
    }

    /// Codes the next frame.
    ///
    /// # Panics
    /// If the volume is not on the grid of the settings.
    pub fn encode(&mut self, volume: &SparseVolume) -> TangFrame {
        assert_eq!(volume.grid(), &self.codec.grid, "one grid a stream");
        let blocks = volume.block_count();
        let symbols = FrameSymbols {
            prediction: Prediction::None,
            coords: volume.coords().to_vec(),
            unobserved: volume.unobserved_masks().clone(),
            references: vec![None; blocks],
            motion: vec![MotionVector::ZERO; blocks],
            levels: self.codec.levels(volume),
        };
        let slices = blocks.div_ceil(BLOCKS_PER_SLICE).clamp(1, most_slices(self.codec.basis.coefficients()));
        let edge = self.codec.grid.edge;
        let segments = syntax::write_symbols(&mut self.entropy, edge, &symbols, slices, None);
        self.symbols = Some(symbols);
        frame_of(blocks, &segments)
    }

    /// What the decoder will have after the last frame; `None` before the first. Computed when asked for: coding needs no
    /// reference.
    #[must_use]
    pub fn reconstruction(&self) -> Option<SparseVolume> {
        self.symbols.clone().map(|symbols| self.codec.reconstruct(symbols))
    }
}

/// Puts the segments of a frame together.
fn frame_of(blocks: usize, segments: &SymbolSegments) -> TangFrame {
    let slices: Vec<_> = segments
        .slices
        .iter()
        .map(|s| SlicePayload { modes: &s.modes, coefficients: &s.coefficients })
        .collect();
    let bytes_coefficients = slices.iter().map(|s| s.coefficients.len()).sum();
    let header = FrameHeader {
        blocks: blocks as u32,
        slices: slices.len() as u16,
        coding: FrameCoding::Paper { prediction: Prediction::None },
        volume_hash: None,
    };
    let (block_set, masks) = (&segments.block_set, &segments.masks);
    TangFrame {
        bytes: FramePayload { header, block_set, masks, slices }.to_bytes(),
        bytes_occupancy: block_set.len(),
        bytes_masks: masks.len(),
        bytes_coefficients,
    }
}

/// Decodes the frames of a [`TangEncoder`] in order.
#[derive(Clone, Debug)]
pub struct TangDecoder {
    codec: BlockCodec,
    profile: Profile,
    limits: Limits,
    entropy: EntropyState,
    frames: u64,
}

impl TangDecoder {
    /// A decoder with the encoder's transform and settings.
    ///
    /// # Panics
    /// As [`TangEncoder::new`].
    #[must_use]
    pub fn new(basis: &BlockBasis, settings: TangSettings, limits: Limits) -> Self {
        let codec = BlockCodec::new(basis, settings);
        Self {
            codec,
            profile: settings.profile(),
            limits,
            entropy: EntropyState::new(settings.coefficients),
            frames: 0,
        }
    }

    /// Decodes the next frame from all of its bytes.
    ///
    /// # Errors
    /// See [`TangError`]. The decoder is then as it was before.
    pub fn decode(&mut self, bytes: &[u8]) -> Result<SparseVolume, TangError> {
        let payload = FramePayload::parse(bytes, 0, false, &self.profile)?;
        self.check(&payload)?;
        let mut entropy = self.entropy.clone();
        let symbols = read_symbols(&mut entropy, &self.codec.grid, &payload)
            .map_err(|SyntaxError(what)| self.malformed(what))?;
        self.entropy = entropy;
        self.frames += 1;
        Ok(self.codec.reconstruct(symbols))
    }

    fn check(&self, payload: &FramePayload) -> Result<(), TangError> {
        let header = &payload.header;
        let limit = self.limits.frame_voxels / self.codec.grid.edge.block_voxels();
        let blocks = header.blocks as usize;
        if blocks > limit {
            return Err(TangError::TooManyBlocks { frame: self.frames, blocks, limit });
        }
        if usize::from(header.slices) > most_slices(self.codec.basis.coefficients()) {
            return Err(self.malformed("more slices than this many coefficients allow"));
        }
        if header.prediction() != Prediction::None || payload.slices.iter().any(|s| !s.modes.is_empty()) {
            return Err(self.malformed("a frame that predicts from another frame"));
        }
        Ok(())
    }

    fn malformed(&self, what: &'static str) -> TangError {
        TangError::Malformed { frame: self.frames, what }
    }
}

/// The mirror image of [`syntax::write_symbols`] for intra frames.
fn read_symbols(
    entropy: &mut EntropyState,
    grid: &Grid,
    payload: &FramePayload,
) -> Result<FrameSymbols, SyntaxError> {
    let blocks = payload.header.blocks as usize;
    let coords = entropy.block_set.read(payload.block_set, blocks, None)?;
    let unobserved = entropy.masks.read(payload.masks, grid.edge, &coords, None)?;
    let references = vec![None; blocks];
    let layout = SliceLayout::new(blocks, payload.slices.len());
    let slices = entropy.slices(payload.slices.len()).par_iter_mut();
    let levels = slices
        .zip(layout.ranges().collect::<Vec<_>>())
        .zip(&payload.slices)
        .map(|((models, range), slice)| {
            models.coefficients.read(slice.coefficients, &references[range], &mut BitTally::default())
        })
        .collect::<Result<Vec<_>, _>>()?
        .concat();
    let motion = vec![MotionVector::ZERO; blocks];
    Ok(FrameSymbols { prediction: Prediction::None, coords, unobserved, references, motion, levels })
}

/// Transform and quantizer of blocks, and back.
#[derive(Clone, Debug)]
struct BlockCodec {
    grid: Grid,
    basis: LeadingBasis,
    /// In codes.
    step: f32,
}

impl BlockCodec {
    fn new(basis: &BlockBasis, settings: TangSettings) -> Self {
        assert_eq!(basis.edge(), settings.grid.edge, "blocks of one size");
        let step = settings.step.sixteenths() as f32 / (1 << STEP_FRACTION_BITS) as f32;
        Self { grid: settings.grid, basis: LeadingBasis::new(basis, settings.coefficients), step }
    }

    /// K levels a block, block after block; nearest, halves away from zero.
    fn levels(&self, volume: &SparseVolume) -> Vec<i32> {
        let (voxels, coefficients) = (self.grid.edge.block_voxels(), self.basis.coefficients());
        let mut levels = vec![0; volume.block_count() * coefficients];
        levels
            .par_chunks_exact_mut(coefficients)
            .zip((0..volume.block_count()).into_par_iter().map(|block| volume.block(block)))
            .for_each_init(
                || (vec![0.0; coefficients], vec![0.0; voxels]),
                |(spectrum, block), (levels, samples)| {
                    self.basis.forward(samples, block, spectrum);
                    for (level, c) in levels.iter_mut().zip(spectrum) {
                        *level = (*c / self.step).round().clamp(-LEVEL_LIMIT, LEVEL_LIMIT) as i32;
                    }
                },
            );
        levels
    }

    fn reconstruct(&self, symbols: FrameSymbols) -> SparseVolume {
        let (voxels, coefficients) = (self.grid.edge.block_voxels(), self.basis.coefficients());
        let mut samples = vec![0; symbols.coords.len() * voxels];
        samples
            .par_chunks_exact_mut(voxels)
            .zip(symbols.levels.par_chunks_exact(coefficients))
            .for_each_init(
                || (vec![0.0; coefficients], vec![0.0; voxels]),
                |(spectrum, block), (samples, levels)| {
                    for (c, level) in spectrum.iter_mut().zip(levels) {
                        *c = *level as f32 * self.step;
                    }
                    self.basis.inverse(&self.grid, spectrum, block, samples);
                },
            );
        SparseVolume::from_parts(self.grid, symbols.coords, samples, symbols.unobserved)
    }
}
