//! One frame in profile `main`.

use super::change::skippable_blocks;
use super::field_dct::FieldDct;
use super::level_costs::LevelCosts;
use super::masks::{undrawn_cells, wanted_masks};
use super::motion_query::{BlockShifts, MotionQuery};
use super::motion_search::CubeSearch;
use super::pursuit::Pursuit;
use super::rate_control::{Attempt, ColourRate, FrameFacts, RateControl};
use super::refresh::{Refresh, Refreshed};
use super::settings::{FrameQuality, MainSettings};
use super::slice::{CodedSlice, FrameContext, MotionSearch, SliceEncoder, SliceSamples};
use super::syntax;
use super::target::Targets;
use super::tools::Tools;
use crate::backend::SearchBackend;
use crate::encoder::{EncodedFrame, EncoderSettings};
use crate::shared::surface_distance::SourceSurface;
use crate::shared::syntax::{SliceSegments, SymbolSegments};
use isv_decode::main::cell_corners::CellCorners;
use isv_decode::main::crossed_cells::{cells_at_unsettled, crossed_corners};
use isv_decode::main::extension::{DecodedBlocks, ExtensionPlan, FrameBlocks, Kept};
use isv_decode::main::reconstruct::filter_and_extend;
use isv_decode::main::syntax::cells::CellModels;
use isv_decode::main::syntax::masks::MaskModels;
use isv_decode::main::syntax::{EntropyState, SliceModels};
use isv_decode::main::{BlockMode, CausalBlocks, ExactBlocks, FrameSymbols, MainParameters, MainReference};
use isv_decode::{BackendError, volume_hash};
use isv_format::{FrameCoding, FrameHeader, FrameKind, MainFrameHeader, MaskCoding, SliceLayout};
use isv_kernels::block8::SAMPLES;
use isv_volume::{BlockCoord, BlockSet, Grid, SparseVolume, VoxelMask};
use rayon::Scope;
use rayon::prelude::*;
use std::cell::{LazyCell, OnceCell};
use std::collections::BTreeMap;
use std::mem::{replace, take};
use std::ops::Range;
use tracing::debug_span;

/// [`Encoder`](crate::Encoder) for streams of profile `main`, whose motion is searched for by a backend. All else is done on the CPU.
#[derive(Debug)]
pub struct MainEncoder<B> {
    backend: B,
    parameters: MainParameters,
    mask_coding: MaskCoding,
    settings: MainSettings,
    /// A keyframe at least every this many frames, or, with gradual refresh, all is refreshed in so many.
    gop: u32,
    slices: u16,
    checksums: bool,
    /// Frames since the last keyframe and with it; 0 before the first. With gradual refresh, those of the last cycle and the keyframe.
    since_keyframe: u32,
    dct: FieldDct,
    /// Place in scan order of each position, if it is coded.
    places: [Option<u8>; 512],
    state: State,
    /// Samples of the frame before the last, for their memory.
    spare: Vec<i16>,
    rate: RateControl,
    /// Bytes a block of the last keyframe.
    keyframe_bytes_per_block: f64,
    /// Bytes a block of the last frame, if that was predicted.
    predicted_bytes_per_block: Option<f64>,
    /// The last frame as it was to be coded.
    source: Option<SparseVolume>,
    /// The largest step that anything that stands still was coded with.
    settled_step: f64,
}

/// A frame to be coded, however often.
#[derive(Clone, Copy, Debug)]
struct Source<'a> {
    targets: &'a Targets<'a>,
    /// Blocks of the reference in cells that stay as they are.
    skipped: &'a BlockSet,
    /// Shifts of its blocks, if they were searched for all at once.
    shifts: Option<&'a [BlockShifts]>,
}

/// A frame as coded once.
#[derive(Debug)]
struct CodedFrame {
    frame: EncodedFrame,
    /// What it leaves behind.
    state: State,
    /// Share of the blocks that are predicted from their neighbours.
    spatial_share: f64,
}

impl CodedFrame {
    /// Error and lambda times the bits.
    fn cost(&self, targets: &Targets, quality: FrameQuality) -> f32 {
        let lambda = quality.lambda * quality.step * quality.step;
        let decoded = self.state.reference.as_ref().expect("a coded frame leaves a reference").volume();
        targets.weighted_error(decoded) + lambda * 8.0 * self.frame.stream_bytes() as f32
    }

    fn bytes_per_block(&self) -> f64 {
        self.frame.stream_bytes() as f64 / f64::from(self.frame.payload().header.blocks.max(1))
    }
}

/// What one frame leaves behind for the next.
#[derive(Clone, Debug, Default)]
struct State {
    entropy: EntropyState,
    /// By slice, of temporal and of spatial blocks.
    costs: Vec<[LevelCosts; 2]>,
    reference: Option<MainReference>,
    /// Which of its blocks are exact in a decoder that had none when the cycle of refresh began; not after keyframes.
    exact: Option<ExactBlocks>,
}

impl State {
    /// The samples of the reference, for their memory to serve another frame.
    fn into_spare_buffer(self) -> Vec<i16> {
        self.reference.map_or_else(Vec::new, MainReference::into_spare_buffer)
    }
}

/// Share of blocks predicted from neighbours above which a frame is also tried as a keyframe.
const CUT_SPATIAL_SHARE: f64 = 0.5;
/// Share of the last keyframe's bytes a block above which a frame is also tried as a keyframe, unless it is like the last frame.
/// Likeness is known only if the last frame was predicted.
const CUT_BYTES_SHARE: f64 = 0.7;
/// Cost of a keyframe over that of the predicted frame, up to which a frame unlike those before becomes one: decoding can begin there.
const CUT_BONUS: f32 = 1.5;
/// Ratio of a frame's bytes a block to those of the last frame, above which it is unlike those before. What moves too fast to
/// be predicted well, as cloth in the wind, does so in every frame, and is not cut.
const UNLIKE: f64 = 1.25;
/// What stands still is coded again with a step of less than this share of the one that it was coded with.
const FINER_STEP_SHARE: f64 = 0.75;
/// Strengths of the in-loop filter that are tried where the best one is searched for.
const FILTERS: [u8; 4] = [0, 8, 13, 18];

impl<B: SearchBackend> MainEncoder<B> {
    /// An encoder for the frames of a stream: the grid and the coding of masks of its header.
    ///
    /// # Panics
    /// If `settings.gop` is 0.
    #[must_use]
    pub fn new(grid: Grid, mask_coding: MaskCoding, settings: EncoderSettings, backend: B) -> Self {
        let EncoderSettings { gop, slices, checksums, main: settings, .. } = settings;
        assert!(gop > 0, "a GOP has at least one frame");
        let (parameters, dct) = (MainParameters::new(grid), FieldDct::new());
        let rate = RateControl::new(settings.target, gop);
        let mut places = [None; 512];
        (0..).zip(&parameters.scan).for_each(|(k, position)| places[usize::from(*position)] = Some(k));
        Self {
            backend,
            parameters,
            mask_coding,
            settings,
            gop,
            slices: slices.unwrap_or(settings.slices).clamp(1, FrameHeader::MAX_SLICES),
            checksums,
            since_keyframe: 0,
            dct,
            places,
            state: State::default(),
            spare: Vec::new(),
            rate,
            keyframe_bytes_per_block: 0.0,
            predicted_bytes_per_block: None,
            source: None,
            settled_step: 0.0,
        }
    }

    /// Codes the next frame. One that is cheaper as a keyframe becomes one. After an error the next one is coded as this one would
    /// have been.
    ///
    /// # Errors
    /// The backend's: see [`BackendError`].
    ///
    /// # Panics
    /// If the volume is not on the stream's grid.
    pub fn encode(&mut self, volume: &SparseVolume) -> Result<EncodedFrame, BackendError> {
        assert_eq!(volume.grid(), &self.parameters.grid, "one grid a stream");
        let keyframe = self.keyframe_is_due(self.since_keyframe);
        let constant = self.settings.quality;
        let MainSettings { band, tools, .. } = self.settings;
        // In the symbols of a resilient frame there is nothing to stay as it was.
        let mut skipped = match !keyframe && tools.skip && self.settings.refresh == Refresh::Keyframes {
            true => debug_span!("change").in_scope(|| self.skippable_blocks(volume)),
            false => BlockSet::default(),
        };
        let mut targets = debug_span!("targets").in_scope(|| Targets::new(volume, band, tools, &skipped));
        let mut facts = FrameFacts { keyframe, blocks: targets.len() };
        let mut step = self.rate.first_step(facts, f64::from(constant.step));
        let mut shifts = None;
        let mut spare = take(&mut self.spare);
        let mut attempts = Vec::new();
        let surface = OnceCell::new();
        loop {
            if !skipped.is_empty() && step < FINER_STEP_SHARE * self.settled_step {
                // What stands still is worth coding better now.
                skipped = BlockSet::default();
                targets = Targets::new(volume, band, tools, &skipped);
                facts.blocks = targets.len();
                shifts = None;
            }
            let found = match shifts.take() {
                Some(found) => found,
                None => self.find_shifts(&targets, keyframe)?,
            };
            let source = Source { targets: &targets, skipped: &skipped, shifts: found.as_deref() };
            let quality = FrameQuality { step: step as f32, ..constant };
            let mut coded = self.encode_or_cut(&source, facts.keyframe, quality, &mut spare);
            facts.keyframe = coded.frame.keyframe;
            if let Some(decoded) = coded.state.reference.as_ref().filter(|_| self.rate.needs_error()) {
                let surface = surface.get_or_init(|| SourceSurface::new(volume));
                coded.frame.surface_distance_voxels = Some(surface.distance_voxels(decoded.volume()));
            }
            let attempt = Attempt {
                frame: facts,
                step,
                bits: 8.0 * coded.frame.stream_bytes() as f64,
                surface_distance: coded.frame.surface_distance_voxels.unwrap_or(0.0),
            };
            attempts.push(attempt);
            match self.rate.retry(&attempts) {
                Some(other) => {
                    step = other;
                    shifts = Some(found);
                    spare = coded.state.into_spare_buffer();
                }
                None => {
                    let since_keyframe = if facts.keyframe { 1 } else { self.since_keyframe % self.gop + 1 };
                    if let Some(reference) = &coded.state.reference
                        && !self.keyframe_is_due(since_keyframe)
                    {
                        debug_span!("hand over").in_scope(|| self.backend.keep(reference))?;
                    }
                    self.since_keyframe = since_keyframe;
                    self.rate.learn(&attempt);
                    if facts.keyframe {
                        self.keyframe_bytes_per_block = coded.bytes_per_block();
                    }
                    // After a frame of which some stayed as it was, one of which nothing does is unlike it.
                    let bytes_per_block = if skipped.is_empty() { coded.bytes_per_block() } else { 0.0 };
                    self.predicted_bytes_per_block = (!facts.keyframe).then_some(bytes_per_block);
                    self.settled_step = if skipped.is_empty() { step } else { self.settled_step.max(step) };
                    self.source = Some(volume.clone());
                    self.spare = replace(&mut self.state, coded.state).into_spare_buffer();
                    return Ok(coded.frame);
                }
            }
        }
    }

    /// Rate control of the colour of the frame coded last.
    pub fn colour_rate(&mut self) -> ColourRate<'_> {
        self.rate.of_colour()
    }

    /// The shifts of all blocks, if the backend searches for them at once and the frame has use for them.
    fn find_shifts(
        &mut self,
        targets: &Targets,
        keyframe: bool,
    ) -> Result<Option<Vec<BlockShifts>>, BackendError> {
        match &self.state.reference {
            Some(before) if !keyframe && self.settings.tools.motion => {
                let query = MotionQuery::new(before, targets);
                debug_span!("motion").in_scope(|| self.backend.find_shifts(&query))
            }
            _ => Ok(None),
        }
    }

    /// Whether a keyframe comes after so many frames since the last one and with it.
    fn keyframe_is_due(&self, since_keyframe: u32) -> bool {
        match self.settings.refresh {
            Refresh::Keyframes => since_keyframe.is_multiple_of(self.gop),
            Refresh::Gradual => since_keyframe == 0,
        }
    }

    /// Blocks of the last frame in cells that may stay as they are.
    fn skippable_blocks(&self, volume: &SparseVolume) -> BlockSet {
        match (&self.source, &self.state.reference) {
            (Some(before), Some(reference)) => skippable_blocks(before, volume, reference),
            _ => BlockSet::default(),
        }
    }

    /// Codes a frame, and where it hardly resembles the frame before, as a keyframe too: whichever costs less.
    fn encode_or_cut(
        &self,
        source: &Source,
        keyframe: bool,
        quality: FrameQuality,
        spare: &mut Vec<i16>,
    ) -> CodedFrame {
        let coded = self.encode_frame(source, keyframe, quality, spare);
        let is_usual = self.predicted_bytes_per_block.map(|usual| coded.bytes_per_block() <= UNLIKE * usual);
        let alike = coded.spatial_share <= CUT_SPATIAL_SHARE
            && (coded.bytes_per_block() <= CUT_BYTES_SHARE * self.keyframe_bytes_per_block
                || is_usual == Some(true));
        // A scene of which some stays as it is has not been cut. Where blocks are refreshed, spatial ones tell nothing, and a
        // resilient frame is as good as a keyframe for who has lost the frame before.
        let gradual = self.settings.refresh == Refresh::Gradual;
        if keyframe || alike || gradual || !source.skipped.is_empty() {
            return coded;
        }
        let cut = self.encode_frame(source, true, quality, spare);
        let [cut_cost, cost] = [&cut, &coded].map(|frame| frame.cost(source.targets, quality));
        let bonus = if is_usual == Some(false) { CUT_BONUS } else { 1.0 };
        if cut_cost < bonus * cost { cut } else { coded }
    }

    /// What the decoder will have after the last frame; `None` before the first.
    #[must_use]
    pub fn reconstruction(&self) -> Option<&SparseVolume> {
        self.state.reference.as_ref().map(MainReference::volume)
    }

    /// Codes a frame, leaving the encoder as it is. `spare`: samples whose memory can be taken.
    fn encode_frame(
        &self,
        source: &Source,
        keyframe: bool,
        quality: FrameQuality,
        spare: &mut Vec<i16>,
    ) -> CodedFrame {
        let Source { targets, skipped, shifts, .. } = *source;
        let slices = self.slices;
        let fresh;
        let before = match keyframe {
            true => {
                fresh = State { costs: self.state.costs.clone(), ..State::default() };
                &fresh
            }
            false => &self.state,
        };
        let reference = before.reference.as_ref();
        let resilient = reference.is_some() && self.settings.refresh == Refresh::Gradual;
        let known = reference.filter(|_| !resilient);
        let exact_before = reference.filter(|_| resilient).map(|reference| self.exact_before(reference));
        let coords = targets.coords();
        let layout = SliceLayout::new(coords.len(), usize::from(slices));
        let kind = match reference {
            None => FrameKind::Intra,
            Some(_) if resilient => FrameKind::Resilient,
            Some(_) => FrameKind::Predicted { skip_cells: !skipped.is_empty() },
        };
        let main = self.frame_header(quality, kind);
        let mut entropy = if resilient { EntropyState::default() } else { before.entropy.clone() };
        let mut mask_models = (take(&mut entropy.masks), take(&mut entropy.cells));
        let (block_set_models, slice_models) = entropy.block_set_and_slices(layout.ranges().len());
        let kept = known.map(|before| Kept { before: before.decoded().sets(), skipped });
        let kept = kept.filter(|_| !skipped.is_empty());
        let plan = debug_span!("extension plan")
            .in_scope(|| ExtensionPlan::new(FrameBlocks::new(coords, kept), coords, kept));
        let mut samples = plan.samples(take(spare));
        let mut block_set = Vec::new();
        // The set is written while one slice waits for the others, and on while the frame is finished.
        let (symbols, slice_segments, (costs, exact), (main, extended), (masks, mask_bytes)) =
            rayon::scope(|scope| {
                let write_set = |_: &Scope| {
                    let write = || syntax::block_set::write(block_set_models, coords, known, skipped);
                    block_set = debug_span!("block set").in_scope(write);
                };
                let causal =
                    debug_span!("neighbours").in_scope(|| CausalBlocks::new(coords, layout.ranges()));
                let refreshed = exact_before.as_ref().zip(reference).map(|(exact, before)| {
                    Refreshed::new((self.since_keyframe - 1, self.gop), coords.len(), before.blocks(), exact)
                });
                let references = (reference, known, refreshed);
                let frame = self.frame_context(targets, shifts, &causal, references, &main, quality);
                let parts = slice_samples(&mut samples, plan.places(), layout);
                let meanwhile = || scope.spawn(write_set);
                let (coded, costs) = debug_span!("slices")
                    .in_scope(|| code_slices(&frame, parts, slice_models, &before.costs, meanwhile));
                let (symbols, segments) = gather(coded, coords, skipped);
                let exact = exact_before.as_ref().zip(reference).map(|(exact, before)| {
                    ExactBlocks::of_frame(&main, &symbols, &causal, &plan, (before.blocks(), exact))
                });
                let (main, extended) = self.filter(targets, main, &symbols, samples, plan, reference);
                let masks = debug_span!("masks")
                    .in_scope(|| self.write_masks(&mut mask_models, targets, &extended, known));
                (symbols, segments, (costs, exact), (main, extended), masks)
            });
        (entropy.masks, entropy.cells) = mask_models;
        let spatial = symbols.modes.iter().filter(|mode| **mode == BlockMode::Spatial).count();
        let spatial_share = spatial as f64 / symbols.modes.len().max(1) as f64;
        let blocks = symbols.coords.len() as u32;
        let decoded = MainReference::new(extended, symbols, masks);
        let header = FrameHeader {
            blocks,
            slices,
            coding: FrameCoding::Main(main),
            volume_hash: self.checksums.then(|| volume_hash(decoded.volume())),
        };
        let segments = SymbolSegments { block_set, masks: mask_bytes, slices: slice_segments };
        let state = State { entropy, costs, reference: Some(decoded), exact };
        CodedFrame { frame: EncodedFrame::new(keyframe, header, segments), state, spatial_share }
    }

    /// The masks of a decoded frame, and their bytes.
    fn write_masks(
        &self,
        models: &mut (MaskModels, CellModels),
        targets: &Targets,
        extended: &DecodedBlocks,
        reference: Option<&MainReference>,
    ) -> (BTreeMap<u32, VoxelMask>, Vec<u8>) {
        let crossed = LazyCell::new(|| crossed_corners(extended));
        let wanted = wanted_masks(targets, extended, || &crossed);
        let (frame, before) = (extended.blocks(), reference.map(|r| r.decoded().blocks()));
        let (voxel_models, cell_models) = models;
        match self.mask_coding {
            MaskCoding::Voxels => {
                let bytes = syntax::masks::write(voxel_models, frame, before, &wanted, || &crossed);
                (wanted, bytes)
            }
            MaskCoding::Cells => {
                let cells = LazyCell::new(|| cells_at_unsettled(extended));
                let undrawn = undrawn_cells(&wanted, extended, || &cells);
                let bytes = syntax::cells::write(cell_models, frame, before, &undrawn, || &cells);
                let masks = match undrawn.is_empty() {
                    true => BTreeMap::new(),
                    false => CellCorners::new(frame, extended.sets()).of_undrawn(&cells, &undrawn),
                };
                (masks, bytes)
            }
        }
    }

    /// Whether the in-loop filter is used. It would carry what is not exact over the faces of blocks that were refreshed.
    fn filters(&self) -> bool {
        self.settings.tools.filter && self.settings.refresh == Refresh::Keyframes
    }

    /// Which blocks of the last frame are exact in a decoder that had none when the cycle of refresh began.
    fn exact_before(&self, reference: &MainReference) -> ExactBlocks {
        let known = self.state.exact.clone().filter(|_| self.since_keyframe > 1);
        known.unwrap_or_else(|| ExactBlocks::none(reference.volume().coords().len()))
    }

    /// The fields of a frame's header. In a resilient frame blocks are not predicted from their neighbours. Where those are not
    /// exact yet, each block would carry the fault on to the next, and make it larger.
    fn frame_header(&self, quality: FrameQuality, kind: FrameKind) -> MainFrameHeader {
        let (filter, filter_limit) = self.settings.filter;
        let filter = if self.filters() { filter } else { 0 };
        let filter_limit = if filter > 0 { filter_limit } else { 0 };
        MainFrameHeader {
            kind,
            step: quality.code(),
            filter,
            filter_limit,
            half_voxel_vectors: self.settings.half_voxel_vectors,
            no_spatial_prediction: kind.is_resilient() || !self.settings.tools.spatial,
        }
    }

    /// The frame's header and decoded volume under the settings' filter. If the filter is to be searched for, the one with the
    /// least weighted error is taken.
    fn filter(
        &self,
        targets: &Targets,
        main: MainFrameHeader,
        symbols: &FrameSymbols,
        samples: Vec<i16>,
        plan: ExtensionPlan,
        reference: Option<&MainReference>,
    ) -> (MainFrameHeader, DecodedBlocks) {
        let before = reference.map(MainReference::decoded);
        let filtered = |main: &MainFrameHeader, samples, plan| {
            filter_and_extend(&self.parameters, main, symbols, samples, plan, before)
        };
        if !self.filters() || !self.settings.filter_search {
            return (main, filtered(&main, samples, plan));
        }
        let limit = self.settings.filter.1;
        let candidates = FILTERS.map(|filter| {
            let filter_limit = if filter > 0 { limit } else { 0 };
            let main = MainFrameHeader { filter, filter_limit, ..main };
            let extended = filtered(&main, samples.clone(), plan.clone());
            (targets.weighted_error(extended.volume()), main, extended)
        });
        let best = candidates.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        best.map(|(_, main, extended)| (main, extended)).expect("there are filters")
    }

    fn frame_context<'a>(
        &'a self,
        targets: &'a Targets<'a>,
        shifts: Option<&'a [BlockShifts]>,
        causal: &'a CausalBlocks,
        (reference, known, refreshed): (
            Option<&'a MainReference>,
            Option<&'a MainReference>,
            Option<Refreshed<'a>>,
        ),
        main: &MainFrameHeader,
        quality: FrameQuality,
    ) -> FrameContext<'a> {
        let FrameQuality { step, lambda } = quality;
        let effort = self.settings.effort;
        let share = if reference.is_none() { self.settings.keyframe_lambda } else { 1.0 };
        let pursuit = Pursuit {
            dct: &self.dct,
            scan: &self.parameters.scan,
            places: &self.places,
            step,
            lambda: share * lambda * step * step,
            rounding: !self.settings.tools.pursuit,
        };
        FrameContext {
            parameters: &self.parameters,
            quantizer: self.parameters.quantizer(main.step),
            pursuit,
            targets,
            causal,
            reference: reference.map(|reference| {
                let cubes = || CubeSearch::new(reference, targets, effort);
                let search = match shifts {
                    Some(shifts) => MotionSearch::Done(shifts),
                    None => MotionSearch::InSlices(debug_span!("cube search").in_scope(cubes)),
                };
                (reference, search)
            }),
            known: known.map(MainReference::blocks),
            refreshed,
            vector_step: main.vector_step(),
            trials: self.settings.trials,
            effort,
            refinement: self.settings.refinement && self.settings.tools.pursuit,
            tools: Tools { spatial: !main.no_spatial_prediction, ..self.settings.tools },
        }
    }
}

/// The blocks of each slice, and their part of the samples of a frame once extended, where the blocks have these places.
fn slice_samples<'a>(
    mut samples: &'a mut [i16],
    places: &'a [u32],
    layout: SliceLayout,
) -> Vec<(Range<usize>, SliceSamples<'a>)> {
    let mut first = 0;
    let mut part = |range: Range<usize>| {
        let end = places.get(range.end).map_or(first as usize + samples.len() / SAMPLES, |p| *p as usize);
        let part = samples.split_off_mut(..(end - first as usize) * SAMPLES).expect("places are in order");
        let part = SliceSamples { samples: part, first, places };
        first = end as u32;
        (range, part)
    };
    layout.ranges().map(&mut part).collect()
}

/// The symbols of a frame and the bytes of its slices.
fn gather(
    coded: Vec<CodedSlice>,
    coords: &[BlockCoord],
    skipped: &BlockSet,
) -> (FrameSymbols, Vec<SliceSegments>) {
    let mut symbols =
        FrameSymbols { skipped: skipped.clone(), coords: coords.to_vec(), ..FrameSymbols::default() };
    let mut segments = Vec::new();
    for slice in coded {
        symbols.modes.extend(slice.modes);
        symbols.levels.append(&slice.levels);
        let (modes, coefficients, dc_bits) = (slice.mode_bytes, slice.coefficient_bytes, slice.dc_bits);
        segments.push(SliceSegments { modes, coefficients, dc_bits });
    }
    (symbols, segments)
}

/// Codes all slices of a frame. `before` has what levels cost in the slices of the frame before. `meanwhile` begins what threads
/// that have no slice left can do: it is called when the last slice begins.
fn code_slices(
    frame: &FrameContext,
    parts: Vec<(Range<usize>, SliceSamples)>,
    models: &mut [SliceModels],
    before: &[[LevelCosts; 2]],
    meanwhile: impl FnOnce() + Send,
) -> (Vec<CodedSlice>, Vec<[LevelCosts; 2]>) {
    let fresh = || [0; 2].map(|_| LevelCosts::new(&frame.parameters.scan));
    let costs: Vec<_> = (0..parts.len()).map(|s| before.get(s).cloned().unwrap_or_else(fresh)).collect();
    let mut begin: Vec<_> = (1..parts.len()).map(|_| None).collect();
    begin.push(Some(meanwhile));
    let slices = models.par_iter_mut().zip(parts).zip(costs).zip(begin);
    slices
        .map(|(((models, (range, samples)), costs), begin)| {
            if let Some(begin) = begin {
                begin();
            }
            let (coded, mut costs) = SliceEncoder::new(frame, range, models, costs, samples).run();
            costs.iter_mut().for_each(LevelCosts::age);
            (coded, costs)
        })
        .unzip()
}
