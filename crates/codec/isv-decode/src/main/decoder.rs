//! The decoder of profile `main`.

use super::recovery::{Gap, Recovery};
use crate::backend::{Backend, MainFrame};
use crate::colour::{ColourDecoder, ColourError, ColourFrame, ExactColour};
use crate::decoder::failure::Failure;
use crate::decoder::sequence::Sequence;
use crate::decoder::{FrameFacts, Limits};
use crate::main::extension::{ExtensionPlan, FrameBlocks, Kept};
use crate::main::syntax::EntropyState;
use crate::main::{
    BlockMode, CausalBlocks, ExactBlocks, FrameSymbols, MainBlocks, MainParameters, SliceBlocks,
    lead_over_loss,
};
use crate::shared::syntax::SyntaxError;
use crate::shared::{BlockCoding, Details};
use crate::{BackendError, DecodeError};
use isv_format::{
    FrameCoding, FrameHeader, FramePayload, MainFrameHeader, MaskCoding, Packet, PacketKind, Prediction,
    Profile, SliceLayout,
};
use isv_kernels::block8::SAMPLES;
use isv_volume::{BlockSet, Grid, VoxelMask};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;
use tracing::debug_span;

/// [`crate::Decoder`] for streams of profile `main`.
#[derive(Debug)]
pub(crate) struct MainDecoder<B: Backend> {
    parameters: MainParameters,
    mask_coding: MaskCoding,
    limits: Limits,
    entropy: EntropyState,
    reference: Option<B::Main>,
    /// Whether and how it goes on after a loss.
    recovery: Recovery,
    sequence: Sequence,
    /// Decoder of colour, if colour is wanted.
    colour: Option<ColourDecoder>,
}

/// What a frame leaves behind.
struct Decoded<F> {
    frame: F,
    /// Which of its blocks are exact, unless all are.
    exact: Option<ExactBlocks>,
}

impl<B: Backend> MainDecoder<B> {
    /// A decoder for the frames of a stream.
    pub(crate) fn new(grid: Grid, mask_coding: MaskCoding, limits: Limits) -> Self {
        let parameters = MainParameters::new(grid);
        let (entropy, sequence) = (EntropyState::default(), Sequence::default());
        let recovery = Recovery::default();
        Self { parameters, mask_coding, limits, entropy, reference: None, recovery, sequence, colour: None }
    }

    /// See [`crate::Decoder::keep_colour`].
    pub(crate) fn keep_colour(&mut self, layers: u8) {
        self.colour = (layers > 0).then(|| ColourDecoder::new(layers));
    }

    /// See [`crate::Decoder::colour`].
    pub(crate) fn colour(&self) -> Option<&Arc<ColourFrame>> {
        self.colour.as_ref()?.frame()
    }

    /// See [`crate::Decoder::is_colour_exact`].
    pub(crate) fn is_colour_exact(&self) -> bool {
        self.colour.as_ref().is_some_and(ColourDecoder::is_exact)
    }

    /// See [`crate::Decoder::exact_colour`].
    pub(crate) fn exact_colour(&self) -> Option<&ExactColour> {
        self.colour.as_ref().map(ColourDecoder::exact)
    }

    /// See [`crate::Decoder::recover`].
    pub(crate) fn recover(&mut self, wanted: bool) {
        self.recovery.want(wanted);
    }

    /// See [`crate::Decoder::exact_blocks`].
    pub(crate) fn exact_blocks(&self) -> Option<&ExactBlocks> {
        self.recovery.exact()
    }

    /// Frames decoded so far.
    pub(crate) fn frames(&self) -> u64 {
        self.sequence.frames()
    }

    /// Blocks of the last frame that were coded, not extrapolated: see [`crate::Decoder::coded_blocks`].
    pub(crate) fn coded_blocks(&self) -> Option<&BlockSet> {
        self.reference.as_ref().map(|frame| &B::main_blocks(frame).sets.coded)
    }

    /// The last frame's volume, if it was decoded.
    pub(crate) fn volume(&self) -> Option<&B::Volume> {
        self.reference.as_ref().map(B::main_volume)
    }

    /// Decodes a frame packet.
    ///
    /// # Errors
    /// See [`crate::Decoder::decode`].
    pub(crate) fn decode(
        &mut self,
        packet: &Packet,
        backend: &mut B,
        details: &mut Details,
    ) -> Result<FrameFacts, DecodeError> {
        // Taken out while it is read from. After an error, `lose` decides what stays of it.
        let last = self.reference.take();
        match self.decode_after(last.as_ref(), packet, backend, details) {
            Ok((Decoded { frame, exact }, facts)) => {
                self.sequence.advance(packet);
                self.recovery.set(exact);
                self.reference = Some(frame);
                if let Some(last) = last {
                    backend.retire(last);
                }
                Ok(facts)
            }
            Err(error) => {
                self.reference = last;
                self.pass_over(packet);
                Err(error)
            }
        }
    }

    /// See [`crate::Decoder::lose_packet`].
    pub(crate) fn lose(&mut self) {
        if let Some(colour) = &mut self.colour {
            colour.lose();
        }
        let last = self.reference.take();
        self.reference = self.recovery.lose(last, |frame| B::main_blocks(frame).coded.len());
    }

    /// See [`crate::Decoder::pass_over`].
    pub(crate) fn pass_over(&mut self, packet: &Packet) {
        self.sequence.pass_over(packet);
        self.lose();
    }

    /// Decodes a frame packet with the frame before it at hand, which may be another than the encoder's after a loss.
    fn decode_after(
        &mut self,
        last: Option<&B::Main>,
        packet: &Packet,
        backend: &mut B,
        details: &mut Details,
    ) -> Result<(Decoded<B::Main>, FrameFacts), DecodeError> {
        let PacketKind::Frame { keyframe, hashed, .. } = packet.header.kind else {
            return Err(self.sequence.malformed(packet, "an index where a frame should be"));
        };
        let lost = match keyframe {
            true => None,
            false => self.sequence.check(packet, last.is_some() && self.recovery.is_whole()).err(),
        };
        if !self.recovery.is_wanted()
            && let Some(lost) = lost
        {
            return Err(lost);
        }
        // What follows is decoded all the same, where it is a resilient frame.
        if let Some(colour) =
            self.colour.as_mut().filter(|_| !keyframe && self.sequence.check(packet, true).is_err())
        {
            colour.lose();
        }
        let payload = FramePayload::parse(packet.geometry()?, packet.payload_at(), hashed, &Profile::Main)?;
        if keyframe && payload.header.prediction() != Prediction::None {
            return Err(self.sequence.malformed(packet, "a keyframe that predicts from another frame"));
        }
        let FrameCoding::Main(main) = payload.header.coding else {
            unreachable!("the payload was parsed as one of profile main")
        };
        let empty;
        let (reference, gap) = match lost {
            None => (last.filter(|_| !keyframe), None),
            Some(lost) if !main.kind.is_resilient() => return Err(lost),
            Some(_) => {
                let reference = match last {
                    Some(last) => last,
                    None => {
                        empty = self.empty_frame(&main, backend)?;
                        &empty
                    }
                };
                let gap = self.recovery.gap(&self.sequence, packet, B::main_blocks(reference));
                (Some(reference), Some(gap))
            }
        };
        if keyframe || main.kind.is_resilient() {
            self.entropy = EntropyState::default();
        }
        let before = reference.map(B::main_blocks).filter(|_| !main.kind.is_resilient());
        let count = payload.header.blocks as usize;
        self.check_limit(packet, count)?;
        let activity = |skipped: &BlockSet| match reference {
            Some(reference) => backend.expected_activity(reference, skipped).map_err(Failure::from),
            None => Ok(Vec::new()),
        };
        let block_set = &mut self.entropy.block_set;
        let (skipped, coords) = debug_span!("block set")
            .in_scope(|| block_set.read(payload.block_set, count, before, main.kind.skips_cells(), activity))
            .map_err(|failure| failure.of(packet, self.sequence))?;
        let kept = before.map(|before| Kept { before: before.sets, skipped: &skipped });
        let kept = kept.filter(|kept| !kept.skipped.is_empty());
        let blocks = FrameBlocks::new(&coords, kept);
        self.check_limit(packet, blocks.all.count())?;
        let plan = || ExtensionPlan::new(blocks, &coords, kept);
        let symbols =
            FrameSymbols { skipped: skipped.clone(), coords: coords.clone(), ..FrameSymbols::default() };
        let decoded = self
            .read_frame(&payload, &main, symbols, plan, (reference, gap), backend, details)
            .map_err(|failure| failure.of(packet, self.sequence))?;
        let inexact_blocks = decoded.exact.as_ref().map_or(0, ExactBlocks::inexact);
        self.decode_colour(packet, &decoded.frame, inexact_blocks == 0, backend)?;
        let facts = FrameFacts {
            timestamp_ns: packet.header.timestamp_ns,
            keyframe,
            stated_hash: payload.header.volume_hash.filter(|_| backend.is_exact() && inexact_blocks == 0),
            inexact_blocks,
        };
        Ok((decoded, facts))
    }

    /// Decodes the colour of a frame, if it is wanted.
    fn decode_colour(
        &mut self,
        packet: &Packet,
        frame: &B::Main,
        is_exact: bool,
        backend: &mut B,
    ) -> Result<(), DecodeError> {
        let Some(colour) = &mut self.colour else { return Ok(()) };
        let field = backend.main_field(frame)?;
        if packet.is_keyframe() {
            colour.begin_group();
        }
        // On another surface than the encoder's, the symbols of colour cannot be read.
        let part = packet.colour()?.filter(|_| is_exact);
        let at = packet.payload_at() + packet.geometry()?.len() as u64;
        let after_loss = !colour.is_exact();
        let decoded = debug_span!("colour").in_scope(|| {
            if !is_exact {
                colour.lose();
            }
            match part.map(|part| colour.decode(&field, part, at, true).map(drop)) {
                Some(Err(ColourError::NoReference)) if after_loss => colour.carry_over(&field).map(drop),
                Some(decoded) => decoded,
                None => colour.carry_over(&field).map(drop),
            }
        });
        let (frame, at) = (self.sequence.frames(), packet.at);
        decoded.map_err(|cause| DecodeError::Colour { frame, at, cause })
    }

    /// A frame without blocks.
    fn empty_frame(&self, header: &MainFrameHeader, backend: &mut B) -> Result<B::Main, BackendError> {
        let plan = ExtensionPlan::new(FrameBlocks::default(), &[], None);
        let (parameters, causal) = (&self.parameters, &CausalBlocks::new(&[], std::iter::once(0..0)));
        let symbols = FrameSymbols::default();
        let frame = MainFrame { parameters, header, symbols, causal, plan, predicts: false };
        let mut frame = backend.reconstruct_main(frame, None)?;
        backend.add_masks(&mut frame, BTreeMap::new())?;
        Ok(frame)
    }

    fn check_limit(&self, packet: &Packet, blocks: usize) -> Result<(), DecodeError> {
        self.limits.check(packet, self.sequence, SAMPLES, blocks)
    }

    /// The frame, from its block set on. `symbols`: that, and nothing else yet. `plan`: of its extension. `reference`: the frame
    /// before, and how it differs from the one that the encoder had, if it does.
    #[expect(clippy::too_many_arguments, reason = "what the block set leaves to read, and who reads it")]
    fn read_frame(
        &mut self,
        payload: &FramePayload,
        main: &MainFrameHeader,
        symbols: FrameSymbols,
        plan: impl FnOnce() -> ExtensionPlan + Send,
        (reference, gap): (Option<&B::Main>, Option<Gap>),
        backend: &mut B,
        details: &mut Details,
    ) -> Result<Decoded<B::Main>, Failure> {
        let header = &payload.header;
        let layout = SliceLayout::new(symbols.coords.len(), usize::from(header.slices));
        let causal =
            debug_span!("neighbours").in_scope(|| CausalBlocks::new(&symbols.coords, layout.ranges()));
        // A resilient frame's symbols are read without the frame before; its samples are predicted from it.
        let known = reference.map(B::main_blocks).filter(|_| !main.kind.is_resilient());
        // Without prediction, modes and contexts do not look at the frame before; the block set and the masks still do.
        let predicts = main.kind.predicts();
        let (temporal, before) = (predicts && reference.is_some(), known.filter(|_| predicts));
        // The blocks are known: those around them are found while the symbols are read.
        let (plan, symbols) = rayon::join(
            || debug_span!("extension plan").in_scope(plan),
            || {
                debug_span!("symbols").in_scope(|| {
                    self.read_symbols(payload, main, symbols, &causal, (temporal, before), details)
                })
            },
        );
        let mut symbols = symbols?;
        let exact = reference.map(B::main_blocks).zip(gap).map(|(before, gap)| {
            let exact = ExactBlocks::of_frame(main, &symbols, &causal, &plan, (before, &gap.exact));
            lead_over_loss(&mut symbols.modes, gap.missing);
            exact
        });
        let parameters = &self.parameters;
        let frame = MainFrame { parameters, header: main, symbols, causal: &causal, plan, predicts };
        let mut frame = backend.reconstruct_main(frame, reference)?;
        let masks = debug_span!("masks").in_scope(|| match (&exact, reference) {
            // Where masks can be is told by samples: they cannot be read before these are right. Until then they stay.
            (Some(exact), Some(reference)) if !exact.is_whole() => {
                Ok(masks_kept(B::main_blocks(&frame), B::main_blocks(reference)))
            }
            _ => {
                let MainBlocks { blocks, sets, .. } = B::main_blocks(&frame);
                let before = known.map(|known| known.blocks);
                match self.mask_coding {
                    MaskCoding::Voxels => {
                        let corners = || backend.crossed_corners(&frame).map_err(Failure::from);
                        self.entropy.masks.read(payload.masks, blocks, before, corners)
                    }
                    MaskCoding::Cells => {
                        let cells = || backend.crossed_cells(&frame).map_err(Failure::from);
                        self.entropy.cells.read(payload.masks, (blocks, sets), before, cells)
                    }
                }
            }
        })?;
        backend.add_masks(&mut frame, masks)?;
        Ok(Decoded { frame, exact: exact.filter(|exact| !exact.is_whole()) })
    }

    /// Adds the modes and levels of all slices. `temporal`: whether blocks can be predicted from the frame before; `reference`: that
    /// frame, as far as modes and contexts look at it.
    fn read_symbols(
        &mut self,
        payload: &FramePayload,
        main: &MainFrameHeader,
        mut symbols: FrameSymbols,
        causal: &CausalBlocks,
        (temporal, reference): (bool, Option<MainBlocks>),
        details: &mut Details,
    ) -> Result<FrameSymbols, SyntaxError> {
        let FrameHeader { slices, .. } = payload.header;
        let ranges: Vec<_> = SliceLayout::new(symbols.coords.len(), usize::from(slices)).ranges().collect();
        let parameters = &self.parameters;
        let tallies = details.tallies(ranges.iter().cloned());
        let slices = self.entropy.slices(usize::from(slices)).par_iter_mut().zip(ranges).zip(&payload.slices);
        let decoded: Vec<Result<_, SyntaxError>> = slices
            .zip(tallies)
            .map(|(((models, range), bytes), mut tally)| {
                let blocks = SliceBlocks { coords: &symbols.coords, range, causal };
                let modes = match temporal {
                    true => {
                        models.modes.read(bytes.modes, &blocks, reference, main.vector_step(), &mut tally)?
                    }
                    false => vec![BlockMode::Spatial; blocks.range.len()],
                };
                let bytes = bytes.coefficients;
                let levels =
                    models.coefficients.read(parameters, bytes, &blocks, &modes, reference, &mut tally)?;
                Ok(((modes, levels), tally))
            })
            .collect();
        // In order, so that what is said of several bad slices does not depend on threads.
        let decoded: Vec<_> = decoded.into_iter().collect::<Result<_, SyntaxError>>()?;
        let (decoded, tallies): (Vec<_>, Vec<_>) = decoded.into_iter().unzip();
        for (modes, levels) in decoded {
            symbols.modes.extend(modes);
            symbols.levels.append(&levels);
        }
        details.set(&symbols.coords, tallies, |block| match symbols.modes[block].vector() {
            Some(vector) => BlockCoding::Predicted { from: vector.0 },
            None => BlockCoding::Alone,
        });
        details.add_skipped(&symbols.skipped);
        Ok(symbols)
    }
}

/// The masks that a frame's blocks have in another one, by index in the frame.
fn masks_kept(frame: MainBlocks, other: MainBlocks) -> BTreeMap<u32, VoxelMask> {
    let place = |block: &u32| frame.blocks.index.get(other.blocks.coords[*block as usize]);
    let masks = other.blocks.unobserved.iter();
    masks.filter_map(|(block, mask)| Some((place(block)?, mask.clone()))).collect()
}
