//! The in-loop filter of a frame: which faces between blocks are smoothed.

use super::reconstruct::BLOCK_SAMPLES;
use super::{BlockMode, FrameSymbols};
use isv_kernels::deblock::{FaceFilter, smooth_face};
use isv_volume::{BlockIndex, NeighbourFinder};

/// Smooths the faces between coded blocks along x, then y, then z.
///
/// A face is left as it is if both blocks continue what the frame before had there: same vector, no levels. It was smoothed
/// then, and smoothing it once a frame would wear the surface down.
///
/// `places`: where in `samples` each block is.
pub(super) fn smooth_faces(symbols: &FrameSymbols, filter: FaceFilter, samples: &mut [i16], places: &[u32]) {
    let index = BlockIndex::new(&symbols.coords);
    let mut finder = NeighbourFinder::new(&index);
    for (axis, after) in [14, 16, 22].into_iter().enumerate() {
        for (lower, coord) in symbols.coords.iter().enumerate() {
            finder.turn_to(*coord);
            let Some(upper) = finder.get(after).map(|block| block as usize) else { continue };
            if is_continued(symbols, lower, upper) {
                continue;
            }
            // Morton order puts the upper block after the lower one.
            let [lower, upper] = [lower, upper].map(|block| places[block] as usize);
            let (before, after) = samples.as_chunks_mut::<BLOCK_SAMPLES>().0.split_at_mut(upper);
            smooth_face(axis, &mut before[lower], &mut after[0], filter);
        }
    }
}

/// Whether two blocks go on from the frame before as one.
fn is_continued(symbols: &FrameSymbols, a: usize, b: usize) -> bool {
    let unchanged =
        |block: usize| symbols.modes[block] != BlockMode::Spatial && symbols.levels.count(block) == 0;
    unchanged(a) && unchanged(b) && symbols.modes[a].vector() == symbols.modes[b].vector()
}
