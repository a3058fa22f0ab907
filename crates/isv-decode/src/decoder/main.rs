//! The decoder of profile `main`.

use super::failure::Failure;
use super::sequence::Sequence;
use super::{FrameFacts, Limits};
use crate::DecodeError;
use crate::backend::{Backend, MainFrame};
use crate::details::{BlockCoding, Details};
use crate::extension::{ExtensionPlan, FrameBlocks, Kept};
use crate::main_profile::reconstruct::BLOCK_SAMPLES;
use crate::main_profile::syntax::EntropyState;
use crate::main_profile::{BlockMode, CausalBlocks, FrameSymbols, MainBlocks, MainParameters, SliceBlocks};
use crate::syntax::SyntaxError;
use isv_format::{
    FrameCoding, FrameHeader, FramePayload, MainFrameHeader, Packet, PacketKind, Prediction, Profile,
    SliceLayout,
};
use isv_volume::{BlockSet, Grid};
use rayon::prelude::*;
use tracing::debug_span;

/// [`super::Decoder`] for streams of profile `main`.
#[derive(Debug)]
pub(super) struct MainDecoder<B: Backend> {
    parameters: MainParameters,
    limits: Limits,
    entropy: EntropyState,
    reference: Option<B::Main>,
    sequence: Sequence,
}

impl<B: Backend> MainDecoder<B> {
    /// A decoder for the frames of a stream.
    pub(super) fn new(grid: Grid, limits: Limits) -> Self {
        let parameters = MainParameters::new(grid);
        let (entropy, sequence) = (EntropyState::default(), Sequence::default());
        Self { parameters, limits, entropy, reference: None, sequence }
    }

    /// Frames decoded so far.
    pub(super) fn frames(&self) -> u64 {
        self.sequence.frames()
    }

    /// The last frame's volume, if it was decoded.
    pub(super) fn volume(&self) -> Option<&B::Volume> {
        self.reference.as_ref().map(B::main_volume)
    }

    /// Decodes a frame packet.
    ///
    /// # Errors
    /// As [`super::Decoder::decode`].
    pub(super) fn decode(
        &mut self,
        packet: &Packet,
        backend: &mut B,
        details: &mut Details,
    ) -> Result<FrameFacts, DecodeError> {
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
        let before = reference.map(B::main_blocks);
        let payload = FramePayload::parse(&packet.payload, packet.payload_at(), hashed, &Profile::Main)?;
        self.check_limit(packet, payload.header.blocks as usize)?;
        if keyframe && payload.header.prediction != Prediction::None {
            return Err(self.sequence.malformed(packet, "a keyframe that predicts from another frame"));
        }
        let FrameCoding::Main(main) = payload.header.coding else {
            unreachable!("the payload was parsed as one of profile main")
        };
        let count = payload.header.blocks as usize;
        let activity = |still: &BlockSet| match reference {
            Some(reference) => backend.expected_activity(reference, still).map_err(Failure::from),
            None => Ok(Vec::new()),
        };
        let block_set = &mut self.entropy.block_set;
        let (still, coords) = debug_span!("block set")
            .in_scope(|| block_set.read(payload.block_set, count, before, main.still_cells, activity))
            .map_err(|failure| failure.of(packet, self.sequence))?;
        let kept = before.map(|before| Kept { before: before.sets, still: &still });
        let kept = kept.filter(|kept| !kept.still.is_empty());
        let blocks = FrameBlocks::new(&coords, kept);
        self.check_limit(packet, blocks.all.count())?;
        let plan = || ExtensionPlan::new(blocks, &coords, kept);
        let symbols =
            FrameSymbols { still: still.clone(), coords: coords.clone(), ..FrameSymbols::default() };
        let decoded = self
            .read_frame(&payload, &main, symbols, plan, reference, backend, details)
            .map_err(|failure| failure.of(packet, self.sequence))?;
        self.sequence.advance(packet);
        self.reference = Some(decoded);
        if let Some(last) = last {
            backend.retire(last);
        }
        Ok(FrameFacts {
            timestamp_ns: packet.header.timestamp_ns,
            keyframe,
            stated_hash: payload.header.volume_hash.filter(|_| backend.is_exact()),
        })
    }

    fn check_limit(&self, packet: &Packet, blocks: usize) -> Result<(), DecodeError> {
        self.limits.check(packet, self.sequence, BLOCK_SAMPLES, blocks)
    }

    /// The frame, from its block set on. `symbols`: that, and nothing else yet. `plan`: of its extension.
    #[expect(clippy::too_many_arguments, reason = "what the block set leaves to read, and who reads it")]
    fn read_frame(
        &mut self,
        payload: &FramePayload,
        main: &MainFrameHeader,
        symbols: FrameSymbols,
        plan: impl FnOnce() -> ExtensionPlan + Send,
        reference: Option<&B::Main>,
        backend: &mut B,
        details: &mut Details,
    ) -> Result<B::Main, Failure> {
        let (header, blocks_before) = (&payload.header, reference.map(B::main_blocks));
        let layout = SliceLayout::new(symbols.coords.len(), usize::from(header.slices));
        let causal =
            debug_span!("neighbours").in_scope(|| CausalBlocks::new(&symbols.coords, layout.ranges()));
        // Without prediction, modes and contexts do not look at the frame before; the block set and the masks still do.
        let predicts = header.prediction != Prediction::None;
        let before = blocks_before.filter(|_| predicts);
        // The blocks are known: those around them are found while the symbols are read.
        let (plan, symbols) = rayon::join(
            || debug_span!("extension plan").in_scope(plan),
            || {
                debug_span!("symbols")
                    .in_scope(|| self.read_symbols(payload, main, symbols, &causal, before, details))
            },
        );
        let symbols = symbols?;
        let parameters = &self.parameters;
        let known = MainFrame { parameters, header: main, symbols, causal: &causal, plan, predicts };
        let mut frame = backend.reconstruct_main(known, reference)?;
        let masks = debug_span!("masks").in_scope(|| {
            let (blocks, before) = (B::main_blocks(&frame).blocks, blocks_before.map(|before| before.blocks));
            let corners = || backend.crossed_corners(&frame).map_err(Failure::from);
            self.entropy.masks.read(payload.masks, blocks, before, corners)
        })?;
        backend.add_masks(&mut frame, masks)?;
        Ok(frame)
    }

    /// Adds the modes and levels of all slices.
    fn read_symbols(
        &mut self,
        payload: &FramePayload,
        main: &MainFrameHeader,
        mut symbols: FrameSymbols,
        causal: &CausalBlocks,
        reference: Option<MainBlocks>,
        details: &mut Details,
    ) -> Result<FrameSymbols, SyntaxError> {
        let FrameHeader { slices, .. } = payload.header;
        let ranges: Vec<_> = SliceLayout::new(symbols.coords.len(), usize::from(slices)).ranges().collect();
        let parameters = &self.parameters;
        let tallies = details.tallies(ranges.iter().cloned());
        let slices = self.entropy.slices(usize::from(slices)).par_iter_mut().zip(ranges).zip(&payload.slices);
        let decoded: Vec<_> = slices
            .zip(tallies)
            .map(|(((models, range), bytes), mut tally)| {
                let blocks = SliceBlocks { coords: &symbols.coords, range, causal };
                let modes = match reference {
                    Some(reference) => {
                        models.modes.read(bytes.motion, &blocks, reference, main.vector_step(), &mut tally)?
                    }
                    None => vec![BlockMode::Spatial; blocks.range.len()],
                };
                let bytes = bytes.coefficients;
                let levels =
                    models.coefficients.read(parameters, bytes, &blocks, &modes, reference, &mut tally)?;
                Ok(((modes, levels), tally))
            })
            .collect::<Result<_, SyntaxError>>()?;
        let (decoded, tallies): (Vec<_>, Vec<_>) = decoded.into_iter().unzip();
        for (modes, levels) in decoded {
            symbols.modes.extend(modes);
            symbols.levels.append(&levels);
        }
        details.set(&symbols.coords, tallies, |block| match symbols.modes[block].vector() {
            Some(vector) => BlockCoding::Predicted { from: vector.0 },
            None => BlockCoding::Alone,
        });
        details.add_still(&symbols.still);
        Ok(symbols)
    }
}
