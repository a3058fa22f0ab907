//! The set of blocks: an octree over block coordinates, coded level by level.

use isv_decode::ReferenceBlocks;
use isv_decode::shared::syntax::block_set::{BlockSetModels, CellContext, DEPTH_BITS, MAX_DEPTH};
use isv_entropy::RangeEncoder;
use isv_volume::BlockCoord;

/// Writes a set of blocks given in Morton order.
pub(crate) fn write(
    models: &mut BlockSetModels,
    coords: &[BlockCoord],
    reference: Option<ReferenceBlocks>,
) -> Vec<u8> {
    let mut encoder = RangeEncoder::new();
    encode(models, &mut encoder, coords, reference);
    // Of no blocks, nothing is written.
    if coords.is_empty() { Vec::new() } else { encoder.finish() }
}

/// [`write`] into a segment that may hold more than the set.
pub(crate) fn encode(
    models: &mut BlockSetModels,
    encoder: &mut RangeEncoder,
    coords: &[BlockCoord],
    reference: Option<ReferenceBlocks>,
) {
    let [Some(first), Some(last)] = [coords.first(), coords.last()] else {
        return;
    };
    let [first, last] = [first, last].map(|c| c.morton().0);
    // The smallest cell that holds them all: blocks in Morton order differ most at the ends.
    let depth = (64 - (first ^ last).leading_zeros()).div_ceil(3);
    encoder.encode_raw(depth, DEPTH_BITS);
    let root = first >> (3 * depth);
    for bit in (0..3 * (MAX_DEPTH - depth)).rev() {
        encoder.encode_raw((root >> bit & 1) as u32, 1);
    }
    let mut cells = vec![root];
    for level in (0..depth).rev() {
        let mut context = CellContext::new(level, &cells, reference);
        let mut present: Vec<_> = coords.iter().map(|c| c.morton().0 >> (3 * level)).collect();
        present.dedup();
        let mut present = present.into_iter().peekable();
        let mut children = Vec::new();
        for parent in cells {
            let first = children.len();
            for octant in 0..8 {
                let cell = parent << 3 | octant;
                let holds_blocks = present.next_if_eq(&cell).is_some();
                let certain = octant == 7 && children.len() == first;
                if !certain {
                    encoder.encode(&mut models.cell[context.model(cell)], holds_blocks);
                }
                if holds_blocks {
                    context.occupy(cell);
                    children.push(cell);
                }
            }
        }
        cells = children;
    }
}
