//! Which voxels of a decoded frame are masked.

use super::floaters::floaters;
use super::settings::Band;
use super::target::Targets;
use isv_decode::main::cell_corners::{Bits, bits, cells_touching};
use isv_decode::main::extension::{DecodedBlocks, FrameBlocks};
use isv_volume::{BlockEdge, NeighbourFinder, VoxelMask};
use std::collections::BTreeMap;

/// Voxels to be masked in a decoded frame, by index in the extended volume, for its unsettled blocks.
///
/// - Corners of crossed cells that the source has not observed or does not have.
/// - Corners of crossed cells in a block that was extrapolated, if the source has them on the other side of the surface.
/// - Voxels of floaters; with the full band, only those that the source has not observed.
///
/// `crossed`: the corners of crossed cells in these; asked for only if the source is not wholly observed.
pub(crate) fn wanted_masks<'a>(
    targets: &Targets,
    extended: &DecodedBlocks,
    crossed: impl FnOnce() -> &'a [(u32, VoxelMask)],
) -> BTreeMap<u32, VoxelMask> {
    let (source, coords) = (targets.source(), extended.volume().coords());
    let mut wanted = BTreeMap::new();
    // Masks that come only of floaters are rare, and so are frames where the corners are needed but the source is wholly observed.
    if !source.unobserved_masks().is_empty() {
        let index = source.index();
        // What the source does not have is beyond its band or was not observed at all.
        let nothing = VoxelMask::full(BlockEdge::E8);
        let FrameBlocks { all, coded, .. } = extended.sets();
        let coded = coded.marks_in(all);
        wanted.extend(crossed().iter().filter_map(|(block, corners)| {
            let mask = match index.get(coords[*block as usize]) {
                Some(own) => {
                    let unobserved = source.unobserved(own as usize).map(|mask| mask.intersection(corners));
                    let mut mask = unobserved.unwrap_or_else(|| VoxelMask::empty(BlockEdge::E8));
                    if !coded[*block as usize] {
                        // Sheets have far blocks with both signs, and such a block has one.
                        let decoded = extended.volume().block(*block as usize);
                        mask.insert_all(
                            &other_signs(source.block(own as usize), decoded).intersection(corners),
                        );
                    }
                    mask
                }
                None => nothing.intersection(corners),
            };
            (!mask.is_empty()).then_some((*block, mask))
        }));
    }
    let floaters = floaters(extended, &wanted, targets);
    let index = (targets.band() == Band::Full && !floaters.is_empty()).then(|| source.index());
    for (block, mut floaters) in floaters {
        // Who wants the whole band wants every voxel of it, also where a coarse step left floaters.
        if let Some(place) = index.as_ref().and_then(|index| index.get(coords[block as usize])) {
            match source.unobserved(place as usize) {
                Some(unobserved) => floaters = floaters.intersection(unobserved),
                None => continue,
            }
        }
        if floaters.is_empty() {
            continue;
        }
        wanted.entry(block).or_insert_with(|| VoxelMask::empty(BlockEdge::E8)).insert_all(&floaters);
    }
    wanted
}

/// The crossed cells with a corner that is to be masked, by block: those that are not drawn. `cells`: those with a corner in an
/// unsettled block; asked for only if there are masks.
pub(crate) fn undrawn_cells<'a>(
    wanted: &BTreeMap<u32, VoxelMask>,
    extended: &DecodedBlocks,
    cells: impl FnOnce() -> &'a [(u32, VoxelMask)],
) -> BTreeMap<u32, Bits> {
    if wanted.is_empty() {
        return BTreeMap::new();
    }
    let mut finder = NeighbourFinder::new(extended.index());
    let undrawn = cells().iter().filter_map(|(block, cells)| {
        finder.turn_to(extended.volume().coords()[*block as usize]);
        let masks = finder.octet().map(|block| wanted.get(&block?).map(bits));
        if masks.iter().all(Option::is_none) {
            return None;
        }
        let (touched, cells) =
            (cells_touching(masks.each_ref().map(|mask| mask.as_ref().unwrap_or(&[0; 8]))), bits(cells));
        let undrawn = std::array::from_fn(|z| cells[z] & touched[z]);
        (undrawn != [0; 8]).then_some((*block, undrawn))
    });
    undrawn.collect()
}

/// The voxels of a block whose samples have different signs in two volumes.
fn other_signs(a: &[i16], b: &[i16]) -> VoxelMask {
    let mut mask = VoxelMask::empty(BlockEdge::E8);
    for (voxel, _) in a.iter().zip(b).enumerate().filter(|(_, (a, b))| (**a < 0) != (**b < 0)) {
        mask.insert(voxel);
    }
    mask
}
