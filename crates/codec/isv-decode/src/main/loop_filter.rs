//! The in-loop filter of a frame: which faces between blocks are smoothed.

use super::{BlockMode, FrameSymbols};
use isv_kernels::block8::Block;
use isv_kernels::deblock::{FaceFilter, smooth_face};
use isv_volume::{BlockIndex, NeighbourFinder};
use rayon::prelude::*;

/// Faces that a thread smooths by itself.
const FACES_AT_ONCE: usize = 256;

/// The two blocks of a face, the lower one first.
type Face = [usize; 2];

/// Smooths the faces between blocks coded in the frame, along x, then y, then z.
///
/// A face is left as it is if both blocks continue what the frame before had there: same vector, no levels. It was smoothed
/// then, and smoothing it once a frame would wear the surface down.
///
/// `places`: where in `samples` each block is.
pub(super) fn smooth_faces(symbols: &FrameSymbols, filter: FaceFilter, samples: &mut [i16], places: &[u32]) {
    for (axis, faces) in filtered_faces(symbols).into_iter().enumerate() {
        let place = |face: Face| face.map(|block| places[block] as usize);
        smooth(axis, faces.into_iter().map(place).collect(), samples.as_chunks_mut().0, 0, filter);
    }
}

/// The faces that are smoothed along each axis: the numbers of the two blocks among those coded in the frame.
pub(super) fn filtered_faces(symbols: &FrameSymbols) -> [Vec<Face>; 3] {
    let index = BlockIndex::new(&symbols.coords);
    let faces = |finder: &mut NeighbourFinder, lower: usize| {
        finder.turn_to(symbols.coords[lower]);
        [14, 16, 22].map(|after| {
            let upper = finder.get(after)? as usize;
            // Morton order puts the upper block after the lower one.
            (!is_continued(symbols, lower, upper)).then_some([lower, upper])
        })
    };
    let blocks = (0..symbols.coords.len()).into_par_iter().with_min_len(FACES_AT_ONCE);
    let faces: Vec<_> = blocks.map_init(|| NeighbourFinder::new(&index), faces).collect();
    std::array::from_fn(|axis| faces.iter().filter_map(|faces| faces[axis]).collect())
}

/// Smooths faces along an axis, none of which depends on another. `first`: the place of the first of the blocks.
fn smooth(axis: usize, faces: Vec<Face>, blocks: &mut [Block], first: usize, filter: FaceFilter) {
    let mut across = faces;
    if across.len() > FACES_AT_ONCE {
        let middle = first + blocks.len() / 2;
        let (before, others): (Vec<_>, Vec<_>) = across.into_iter().partition(|[_, upper]| *upper < middle);
        let (after, others): (Vec<_>, _) = others.into_iter().partition(|[lower, _]| *lower >= middle);
        let (lower, upper) = blocks.split_at_mut(middle - first);
        rayon::join(
            || smooth(axis, before, lower, first, filter),
            || smooth(axis, after, upper, middle, filter),
        );
        across = others;
    }
    for [lower, upper] in across {
        let (before, after) = blocks.split_at_mut(upper - first);
        smooth_face(axis, &mut before[lower - first], &mut after[0], filter);
    }
}

/// Whether two blocks go on from the frame before as one.
fn is_continued(symbols: &FrameSymbols, a: usize, b: usize) -> bool {
    let unchanged =
        |block: usize| symbols.modes[block] != BlockMode::Spatial && symbols.levels.count(block) == 0;
    unchanged(a) && unchanged(b) && symbols.modes[a].vector() == symbols.modes[b].vector()
}
