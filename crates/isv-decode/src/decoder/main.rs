//! The decoder of profile `main`.

use super::sequence::Sequence;
use super::{DecodedFrame, Limits};
use crate::DecodeError;
use crate::extension::{ExtensionPlan, FrameBlocks, Kept};
use crate::main_profile::reconstruct::{BLOCK_SAMPLES, filter_and_extend, reconstruct};
use crate::main_profile::syntax::EntropyState;
use crate::main_profile::{
    BlockMode, CausalBlocks, FrameSymbols, MainParameters, MainReference, SliceBlocks,
};
use crate::reduced::{Lod, ReducedGrid, downsample};
use crate::syntax::SyntaxError;
use isv_format::{
    FrameCoding, FrameHeader, FramePayload, MainFrameHeader, Packet, PacketKind, Prediction, Profile,
    SliceLayout,
};
use isv_volume::{Grid, GridError, SparseVolume};
use rayon::prelude::*;
use std::mem::take;
use tracing::debug_span;

/// [`super::Decoder`] for streams of profile `main`.
#[derive(Debug)]
pub(super) struct MainDecoder {
    parameters: MainParameters,
    limits: Limits,
    entropy: EntropyState,
    reference: Option<MainReference>,
    /// Samples of the frame before the last, for their memory.
    spare: Vec<i16>,
    /// At reduced resolution, the grid there and the last frame on it.
    reduced: Option<(ReducedGrid, SparseVolume)>,
    sequence: Sequence,
}

impl MainDecoder {
    /// A decoder for the frames of a stream.
    pub(super) fn new(grid: Grid, limits: Limits) -> Self {
        let parameters = MainParameters::new(grid);
        let (entropy, sequence) = (EntropyState::default(), Sequence::default());
        Self { parameters, limits, entropy, reference: None, spare: Vec::new(), reduced: None, sequence }
    }

    /// A decoder at reduced resolution.
    ///
    /// # Errors
    /// As [`super::Decoder::with_lod`].
    pub(super) fn with_lod(self, lod: Lod) -> Result<Self, GridError> {
        let grid = self.parameters.grid;
        let reduced = match lod {
            Lod::Full => None,
            _ => Some((ReducedGrid::new(&grid, lod)?, SparseVolume::empty(grid))),
        };
        Ok(Self { reduced, ..self })
    }

    /// Frames decoded so far.
    pub(super) fn frames(&self) -> u64 {
        self.sequence.frames()
    }

    /// Decodes a frame packet.
    ///
    /// # Errors
    /// As [`super::Decoder::decode`].
    pub(super) fn decode(&mut self, packet: &Packet) -> Result<DecodedFrame<'_>, DecodeError> {
        // Taken out, so that an error leaves no reference behind.
        let last = self.reference.take();
        let PacketKind::Frame { keyframe, hashed } = packet.header.kind else {
            return Err(self.sequence.malformed(packet, "an index where a frame should be"));
        };
        if keyframe {
            self.entropy = EntropyState::default();
        } else {
            self.sequence.check(packet, last.is_some())?;
        }
        let reference = last.as_ref().filter(|_| !keyframe);
        let payload = FramePayload::parse(&packet.payload, packet.payload_at(), hashed, &Profile::Main)?;
        self.check_limit(packet, payload.header.blocks as usize)?;
        if keyframe && payload.header.prediction != Prediction::None {
            return Err(self.sequence.malformed(packet, "a keyframe that predicts from another frame"));
        }
        let FrameCoding::Main(main) = payload.header.coding else {
            unreachable!("the payload was parsed as one of profile main")
        };
        let count = payload.header.blocks as usize;
        let (still, coords) = debug_span!("block set")
            .in_scope(|| self.entropy.block_set.read(payload.block_set, count, reference, main.still_cells))
            .map_err(|SyntaxError(what)| self.sequence.malformed(packet, what))?;
        let kept = reference.map(|before| Kept { before: before.extended(), still: &still });
        let kept = kept.filter(|kept| !kept.still.is_empty());
        let blocks = FrameBlocks::new(&coords, kept);
        self.check_limit(packet, blocks.all.count())?;
        let plan = || ExtensionPlan::new(blocks, &coords, kept);
        let symbols =
            FrameSymbols { still: still.clone(), coords: coords.clone(), ..FrameSymbols::default() };
        let decoded = self
            .read_frame(&payload, &main, symbols, plan, reference)
            .map_err(|SyntaxError(what)| self.sequence.malformed(packet, what))?;
        self.sequence.advance(packet);
        self.spare = last.map_or_else(Vec::new, MainReference::into_samples);
        let full = self.reference.insert(decoded).volume();
        let (volume, stated_hash) = match &mut self.reduced {
            None => (full, payload.header.volume_hash),
            Some((grid, volume)) => {
                *volume = downsample(full, grid);
                (&*volume, None)
            }
        };
        Ok(DecodedFrame { volume, timestamp_ns: packet.header.timestamp_ns, keyframe, stated_hash })
    }

    fn check_limit(&self, packet: &Packet, blocks: usize) -> Result<(), DecodeError> {
        let limit = self.limits.frame_voxels / BLOCK_SAMPLES;
        if blocks > limit { Err(DecodeError::TooManyBlocks { at: packet.at, blocks, limit }) } else { Ok(()) }
    }

    /// The frame, from its block set on. `symbols`: that, and nothing else yet. `plan`: of its extension.
    fn read_frame<'a>(
        &mut self,
        payload: &FramePayload,
        main: &MainFrameHeader,
        symbols: FrameSymbols,
        plan: impl FnOnce() -> ExtensionPlan<'a> + Send,
        reference: Option<&MainReference>,
    ) -> Result<MainReference, SyntaxError> {
        let header = &payload.header;
        let layout = SliceLayout::new(symbols.coords.len(), usize::from(header.slices));
        let causal =
            debug_span!("neighbours").in_scope(|| CausalBlocks::new(&symbols.coords, layout.ranges()));
        // Without prediction, modes and contexts do not look at the frame before; the block set and the masks still do.
        let before = reference.filter(|_| header.prediction != Prediction::None);
        // The blocks are known: those around them are found while the symbols are read.
        let (plan, symbols) = rayon::join(
            || debug_span!("extension plan").in_scope(plan),
            || debug_span!("symbols").in_scope(|| self.read_symbols(payload, main, symbols, &causal, before)),
        );
        let symbols = symbols?;
        let mut samples = plan.room(take(&mut self.spare));
        debug_span!("prediction and residual").in_scope(|| {
            let (parameters, places) = (&self.parameters, plan.places());
            reconstruct(parameters, main, &symbols, &causal, before, places, &mut samples);
        });
        let extended = filter_and_extend(&self.parameters, main, &symbols, samples, plan);
        let blocks = reference.map(|reference| reference.reference().blocks());
        let masks =
            debug_span!("masks").in_scope(|| self.entropy.masks.read(payload.masks, &extended, blocks))?;
        Ok(MainReference::new(extended, symbols, masks))
    }

    /// Adds the modes and levels of all slices.
    fn read_symbols(
        &mut self,
        payload: &FramePayload,
        main: &MainFrameHeader,
        mut symbols: FrameSymbols,
        causal: &CausalBlocks,
        reference: Option<&MainReference>,
    ) -> Result<FrameSymbols, SyntaxError> {
        let FrameHeader { slices, .. } = payload.header;
        let ranges: Vec<_> = SliceLayout::new(symbols.coords.len(), usize::from(slices)).ranges().collect();
        let parameters = &self.parameters;
        let slices = self.entropy.slices(usize::from(slices)).par_iter_mut().zip(ranges).zip(&payload.slices);
        let decoded: Vec<_> = slices
            .map(|((models, range), bytes)| {
                let blocks = SliceBlocks { coords: &symbols.coords, range, causal };
                let modes = match reference {
                    Some(reference) => {
                        models.modes.read(bytes.motion, &blocks, reference, main.vector_step())?
                    }
                    None => vec![BlockMode::Spatial; blocks.range.len()],
                };
                let levels =
                    models.coefficients.read(parameters, bytes.coefficients, &blocks, &modes, reference)?;
                Ok((modes, levels))
            })
            .collect::<Result<_, SyntaxError>>()?;
        for (modes, levels) in decoded {
            symbols.modes.extend(modes);
            symbols.levels.append(&levels);
        }
        Ok(symbols)
    }
}
