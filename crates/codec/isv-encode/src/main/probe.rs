//! The encoder's inner loops by themselves, on the blocks of a volume that follows another, with 8 voxels a block edge. They serve
//! to count instructions and to compare instruction sets. Not a part of the interface.
//!
//! Each function prepares its input, hands the work over to be run, once or more, and gives back the results of the last run.

use super::field_dct::FieldDct;
use super::level_costs::LevelCosts;
use super::motion_query::MotionQuery;
use super::motion_search::{CubeSearch, NormalEquations, SearchEffort, Shift, Sought, SoughtBlock};
use super::pursuit::{Metrics, Pursuit};
use super::settings::Band;
use super::target::{BlockTarget, Targets};
use super::tools::Tools;
use crate::backend::SearchBackend;
use isv_decode::BackendError;
use isv_decode::main::extension::DecodedBlocks;
use isv_decode::main::{
    BlockLevels, BlockMode, COEFFICIENTS, FrameSymbols, MainParameters, MainReference, Vector,
};
use isv_volume::{BlockSet, SparseVolume};
use std::collections::BTreeMap;

/// Step in voxels and lambda in squared steps, about those of the presets.
const STEP: f32 = 2.2;
const LAMBDA: f32 = 0.03;
/// Shift (voxels) at which blocks are looked for in the volume before: between its samples along every axis.
const SHIFT: [f32; 3] = [0.25, -0.5, 0.75];

/// Runs a piece of work.
pub type Runner<'a> = &'a mut dyn FnMut(&mut dyn FnMut());

/// The levels of each block that the surface touches, by pursuit from the same block of the volume before.
pub fn pursuit(before: &SparseVolume, volume: &SparseVolume, run: Runner) -> Vec<[i32; COEFFICIENTS]> {
    let parameters = MainParameters::new(*volume.grid());
    let (dct, costs) = (FieldDct::new(), LevelCosts::new(&parameters.scan));
    let mut places = [None; 512];
    (0..).zip(&parameters.scan).for_each(|(k, position)| places[usize::from(*position)] = Some(k));
    let pursuit = Pursuit {
        dct: &dct,
        scan: &parameters.scan,
        places: &places,
        step: STEP,
        lambda: LAMBDA * STEP * STEP,
        rounding: false,
    };
    let blocks = predicted_blocks(before, volume);
    let mut metrics = Metrics::NONE;
    let mut levels = vec![[0; COEFFICIENTS]; blocks.len()];
    run(&mut || {
        for ((target, prediction), levels) in blocks.iter().zip(&mut levels) {
            metrics.forget();
            *levels = pursuit.run(target, &mut metrics, prediction, &costs).levels;
        }
    });
    levels
}

/// The normal equations of each block that the surface touches, displaced by the same part of a voxel.
pub fn normal_equations(
    before: &SparseVolume,
    volume: &SparseVolume,
    run: Runner,
) -> Vec<impl PartialEq + std::fmt::Debug + use<>> {
    let (reference, targets) = (reference(before), targets(volume));
    let mut query: Vec<_> = (0..targets.len()).map(|_| SoughtBlock::new(&reference)).collect();
    query.iter_mut().enumerate().for_each(|(block, query)| query.turn_to(&targets, block, 1));
    let mut equations = vec![NormalEquations::default(); query.len()];
    run(&mut || {
        for (query, equations) in query.iter_mut().zip(&mut equations) {
            *equations = query.equations(SHIFT);
        }
    });
    equations
}

/// Finds two shifts of each block that the surface touches, each with its error. The first is that of slices at their most
/// thorough, where no neighbour's vector is known. The second is that of a backend.
///
/// # Errors
/// The backend's.
///
/// # Panics
/// If the backend leaves the search to slices.
pub fn shifts(
    before: &SparseVolume,
    volume: &SparseVolume,
    backend: &mut impl SearchBackend,
) -> Result<Vec<[(Shift, f32); 2]>, BackendError> {
    let (reference, targets) = (reference(before), targets(volume));
    backend.keep(&reference)?;
    let found = backend.find_shifts(&MotionQuery::new(&reference, &targets))?.expect("a search of its own");
    let effort = SearchEffort::THOROUGH;
    let cubes = CubeSearch::new(&reference, &targets, effort);
    let (mut query, mut scratch) = (SoughtBlock::new(&reference), Vec::new());
    let shifts = |(block, found): (usize, &[Shift; 3])| {
        query.turn_to(&targets, block, 1);
        let starts = [[0.0; 3]].into_iter().chain(cubes.shifts(block, &mut scratch));
        let refined: Vec<_> = starts.map(|start| query.refine(start, effort.block_steps)).collect();
        let mut with_error = |shift| (shift, query.error(shift));
        let own = refined.into_iter().map(&mut with_error).min_by(|a, b| a.1.total_cmp(&b.1));
        [own.expect("there are starts"), with_error(found[0])]
    };
    Ok(found.iter().enumerate().map(shifts).collect())
}

fn targets(volume: &SparseVolume) -> Targets<'_> {
    Targets::new(volume, Band::Surface, Tools::ALL, &BlockSet::default())
}

/// A volume as the frame before: the blocks that its surface touches, none of them predicted in time.
pub(super) fn reference(volume: &SparseVolume) -> MainReference {
    let coords = targets(volume).coords().to_vec();
    let index = volume.index();
    let block = |coord| volume.block(index.get(coord).expect("targets are blocks of the volume") as usize);
    let samples = coords.iter().flat_map(|coord| block(*coord)).copied().collect();
    let coded = SparseVolume::from_parts(*volume.grid(), coords.clone(), samples, BTreeMap::new());
    let mut levels = BlockLevels::with_capacity(coords.len());
    coords.iter().for_each(|_| levels.push(&[0; COEFFICIENTS]));
    let modes = vec![BlockMode::Spatial; coords.len()];
    let symbols = FrameSymbols { modes, levels, coords, ..FrameSymbols::default() };
    MainReference::new(DecodedBlocks::from_coded(&coded), symbols, BTreeMap::new())
}

/// What the blocks are to become and their predictions, in codes.
fn predicted_blocks(before: &SparseVolume, volume: &SparseVolume) -> Vec<(BlockTarget, [i16; 512])> {
    let (reference, targets) = (reference(before), targets(volume));
    let mut query = SoughtBlock::new(&reference);
    let block = |block| {
        query.turn_to(&targets, block, 1);
        let mut codes = [0; 512];
        query.predict(Vector::ZERO, &mut codes);
        (targets.block(block), codes)
    };
    (0..targets.len()).map(block).collect()
}
