//! One frame in profile `main`.

use super::field_dct::FieldDct;
use super::level_costs::LevelCosts;
use super::motion_search::search_cubes;
use super::pursuit::Pursuit;
use super::slice::{CodedSlice, FrameContext, SliceEncoder};
use super::syntax;
use super::target::{BlockTarget, targets};
use crate::encoder::EncodedFrame;
use crate::syntax::{SliceSegments, SymbolSegments};
use isv_decode::main_profile::reconstruct::filter_and_extend;
use isv_decode::main_profile::syntax::EntropyState;
use isv_decode::main_profile::{CausalBlocks, FrameSymbols, MainParameters, MainReference};
use isv_decode::volume_hash;
use isv_format::{FrameCoding, FrameHeader, MainFrameHeader, Prediction, SliceLayout};
use isv_kernels::quant::STEP_FRACTION_BITS;
use isv_volume::{CODES_PER_VOXEL, Grid, SparseVolume};
use rayon::prelude::*;

/// Which blocks are coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Band {
    /// Those that the surface touches. The decoder makes up the field beyond them.
    Surface,
    /// All of the volume's.
    Full,
}

/// How much a frame may be distorted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameQuality {
    /// Quantizer step of the orthonormal transform in voxels.
    pub step: f32,
    /// Lambda over the step squared: weighted squared steps of error that a bit is worth.
    pub lambda: f32,
}

impl FrameQuality {
    /// Lambda that goes well with any step, in frames that others are not predicted from.
    const LAMBDA: f32 = 0.03;
    /// What lambda is multiplied by in keyframes, whose errors stay until the next one.
    const KEYFRAME_LAMBDA: f32 = 0.4;

    /// The quality of a step.
    #[must_use]
    pub fn of_step(step: f32) -> Self {
        Self { step, lambda: Self::LAMBDA }
    }

    /// The step as it is coded.
    fn code(self) -> u32 {
        let unit = (CODES_PER_VOXEL << STEP_FRACTION_BITS) as f32;
        ((self.step * unit).round() as u32).clamp(1, MainFrameHeader::MAX_STEP)
    }
}

/// Choices of the encoder of profile `main`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MainSettings {
    /// How much frames may be distorted.
    pub quality: FrameQuality,
    /// Which blocks are coded.
    pub band: Band,
    /// How many vectors of a block are coded to see what they cost, 1 or more.
    pub trials: usize,
    /// Strength of the in-loop filter in sixty-fourths, and the most that it changes, in codes.
    pub filter: (u8, u8),
    /// Whether vectors count half voxels and not quarters.
    pub half_voxel_vectors: bool,
}

impl Default for MainSettings {
    fn default() -> Self {
        Self {
            quality: FrameQuality::of_step(2.2),
            band: Band::Surface,
            trials: 2,
            filter: (13, 38),
            half_voxel_vectors: true,
        }
    }
}

/// Codes the frames of a stream.
#[derive(Debug)]
pub(crate) struct MainEncoder {
    parameters: MainParameters,
    pub(crate) settings: MainSettings,
    dct: FieldDct,
    /// Place in scan order of each position, if it is coded.
    places: [Option<u8>; 512],
    state: State,
}

/// What one frame leaves behind for the next.
#[derive(Clone, Debug, Default)]
struct State {
    entropy: EntropyState,
    /// By slice, of temporal and of spatial blocks.
    costs: Vec<[LevelCosts; 2]>,
    reference: Option<MainReference>,
}

impl MainEncoder {
    pub(crate) fn new(grid: Grid, settings: MainSettings) -> Self {
        let (parameters, dct) = (MainParameters::new(grid), FieldDct::new());
        let mut places = [None; 512];
        (0..).zip(&parameters.scan).for_each(|(k, position)| places[usize::from(*position)] = Some(k));
        Self { parameters, settings, dct, places, state: State::default() }
    }

    /// Codes the next frame in this many slices.
    pub(crate) fn encode(
        &mut self,
        volume: &SparseVolume,
        keyframe: bool,
        slices: u16,
        checksum: bool,
    ) -> EncodedFrame {
        assert_eq!(volume.grid(), &self.parameters.grid, "one grid a stream");
        if keyframe {
            let costs = std::mem::take(&mut self.state.costs);
            self.state = State { costs, ..State::default() };
        }
        let targets = targets(volume, self.settings.band);
        let (frame, state) = self.encode_targets(volume, &targets, keyframe, slices, checksum);
        self.state = state;
        frame
    }

    /// What the decoder will have after the last frame.
    pub(crate) fn reconstruction(&self) -> Option<&SparseVolume> {
        self.state.reference.as_ref().map(MainReference::volume)
    }

    /// Codes a frame, leaving the encoder as it is.
    fn encode_targets(
        &self,
        volume: &SparseVolume,
        targets: &[BlockTarget],
        keyframe: bool,
        slices: u16,
        checksum: bool,
    ) -> (EncodedFrame, State) {
        let reference = self.state.reference.as_ref();
        let coords: Vec<_> = targets.iter().map(|target| target.coord).collect();
        let layout = SliceLayout::new(coords.len(), usize::from(slices));
        let causal = CausalBlocks::new(&coords, layout.ranges());
        let main = self.frame_header();
        let mut entropy = self.state.entropy.clone();
        let block_set = syntax::block_set::write(&mut entropy.block_set, &coords, reference);
        let frame = self.frame_context(targets, &coords, &causal, &main, keyframe);
        let (coded, costs) = self.code_slices(&frame, layout, &mut entropy);
        drop(frame);
        let mut symbols = FrameSymbols { coords, modes: vec![], levels: vec![], counts: vec![] };
        let mut samples = Vec::new();
        let mut segments = Vec::new();
        for slice in coded {
            symbols.modes.extend(slice.modes);
            symbols.levels.extend(slice.levels);
            symbols.counts.extend(slice.counts);
            samples.extend(slice.samples);
            let (motion, coefficients) = (slice.mode_bytes, slice.coefficient_bytes);
            segments.push(SliceSegments { motion, coefficients, dc_bits: 0.0 });
        }
        let extended = filter_and_extend(&self.parameters, &main, &symbols, samples);
        let index = volume.index();
        let unobserved = |block: usize| {
            let block = index.get(symbols.coords[block])?;
            volume.unobserved(block as usize).cloned()
        };
        let masks = syntax::masks::writable(&symbols.coords, &extended.volume, unobserved);
        let before = reference.map(|reference| reference.reference().blocks());
        let mask_bytes =
            syntax::masks::write(&mut entropy.masks, &symbols.coords, &masks, &extended.volume, before);
        let decoded = MainReference::new(extended, &symbols, masks);
        let header = FrameHeader {
            prediction: if reference.is_some() { Prediction::ThreeDof } else { Prediction::None },
            blocks: symbols.coords.len() as u32,
            slices,
            coding: FrameCoding::Main(main),
            volume_hash: checksum.then(|| volume_hash(decoded.volume())),
        };
        let segments = SymbolSegments { block_set, masks: mask_bytes, slices: segments };
        let state = State { entropy, costs, reference: Some(decoded) };
        (EncodedFrame::new(keyframe, header, segments), state)
    }

    fn frame_header(&self) -> MainFrameHeader {
        let (filter, filter_limit) = self.settings.filter;
        MainFrameHeader {
            step: self.settings.quality.code(),
            filter,
            filter_limit: if filter > 0 { filter_limit } else { 0 },
            half_voxel_vectors: self.settings.half_voxel_vectors,
        }
    }

    fn frame_context<'a>(
        &'a self,
        targets: &'a [BlockTarget],
        coords: &'a [isv_volume::BlockCoord],
        causal: &'a CausalBlocks,
        main: &MainFrameHeader,
        keyframe: bool,
    ) -> FrameContext<'a> {
        let FrameQuality { step, lambda } = self.settings.quality;
        let share = if keyframe { FrameQuality::KEYFRAME_LAMBDA } else { 1.0 };
        let pursuit = Pursuit {
            dct: &self.dct,
            scan: &self.parameters.scan,
            places: &self.places,
            step,
            lambda: share * lambda * step * step,
        };
        let reference = self.state.reference.as_ref();
        FrameContext {
            parameters: &self.parameters,
            quantizer: self.parameters.quantizer(main.step),
            pursuit,
            targets,
            coords,
            causal,
            reference: reference.map(|reference| (reference, search_cubes(reference, targets))),
            vector_step: main.vector_step(),
            trials: self.settings.trials,
        }
    }

    /// Codes all slices of a frame.
    fn code_slices(
        &self,
        frame: &FrameContext,
        layout: SliceLayout,
        entropy: &mut EntropyState,
    ) -> (Vec<CodedSlice>, Vec<[LevelCosts; 2]>) {
        let ranges: Vec<_> = layout.ranges().collect();
        let fresh = || [LevelCosts::new(), LevelCosts::new()];
        let costs: Vec<_> =
            (0..ranges.len()).map(|s| self.state.costs.get(s).cloned().unwrap_or_else(fresh)).collect();
        let slices = entropy.slices(ranges.len()).par_iter_mut().zip(ranges).zip(costs);
        slices
            .map(|((models, range), costs)| {
                let (coded, mut costs) = SliceEncoder::new(frame, range, models, costs).run();
                costs.iter_mut().for_each(LevelCosts::age);
                (coded, costs)
            })
            .unzip()
    }
}
