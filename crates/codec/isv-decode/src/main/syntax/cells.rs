//! Cells that the surface crosses and that are not drawn, after the samples. Streams whose
//! [`MaskCoding`](isv_format::MaskCoding) is by cell say so what was not observed.
//!
//! A cell that is not drawn has an unobserved corner. The surface does not depend on which. So all of its corners count as
//! unobserved that no drawn cell has.

use crate::ReferenceBlocks;
use crate::main::cell_corners::{Bits, CellCorners, bits};
use crate::main::crossed_cells::{Layer, Rows, SIDE, layers, rows};
use crate::main::extension::FrameBlocks;
use crate::shared::syntax::SyntaxError;
use isv_entropy::{BitModel, RangeDecoder};
use isv_volume::{NeighbourFinder, Neighbourhood, VoxelMask};
use std::collections::BTreeMap;

/// Neighbours around a cell that are told apart by number, drawn and undrawn ones.
const MOST: u32 = 6;

/// Models of the cells of a frame.
#[derive(Clone, Debug)]
pub struct CellModels {
    /// Whether a frame has a cell that is not drawn.
    pub any: BitModel,
    /// Whether a block has, by [`CellContexts::turn_to`].
    pub block: [BitModel; 72],
    /// Whether a cell is not drawn, by the cells behind it: see [`CellContexts::cell`].
    pub by_behind: [BitModel; 135],
    /// Whether a cell is not drawn, by the cells around it.
    pub by_count: [BitModel; 245],
}

impl Default for CellModels {
    fn default() -> Self {
        let model = BitModel::default();
        Self { any: model, block: [model; 72], by_behind: [model; 135], by_count: [model; 245] }
    }
}

impl CellModels {
    /// Reads which cells of a frame are not drawn. Gives the masks of its unsettled blocks that follow, by block.
    ///
    /// - `frame`, `sets`: its extended volume's blocks, and what they are.
    /// - `cells`: what [`cells_at_unsettled`](crate::main::crossed_cells::cells_at_unsettled) finds. Asked for only if some are
    ///   not drawn.
    /// - `reference`: the frame before.
    ///
    /// # Errors
    /// That of `cells`, a block of which all cells are drawn although it says otherwise, or bytes that end too early.
    pub fn read<E: From<SyntaxError>>(
        &mut self,
        bytes: &[u8],
        (frame, sets): (ReferenceBlocks, &FrameBlocks),
        reference: Option<ReferenceBlocks>,
        cells: impl FnOnce() -> Result<Vec<(u32, VoxelMask)>, E>,
    ) -> Result<BTreeMap<u32, VoxelMask>, E> {
        let mut decoder = RangeDecoder::new(bytes);
        if !decoder.decode(&mut self.any) {
            return Ok(BTreeMap::new());
        }
        let cells = cells()?;
        let mut contexts = CellContexts::new(frame, reference);
        let mut all_undrawn = BTreeMap::new();
        for (block, cells) in &cells {
            let cells = bits(cells);
            let mut undrawn = [0; 8];
            if decoder.decode(&mut self.block[contexts.turn_to(*block)]) {
                for cell in set_bits(&cells) {
                    let [behind, count] = contexts.cell(cell);
                    let models = [&mut self.by_behind[behind], &mut self.by_count[count]];
                    let is_undrawn = decoder.decode_mixed(models);
                    contexts.set(cell, is_undrawn);
                    undrawn[cell / 64] |= u64::from(is_undrawn) << (cell % 64);
                }
                if undrawn == [0; 8] {
                    return Err(SyntaxError("all cells of a block that has others are drawn").into());
                }
                if decoder.overran() {
                    break;
                }
                all_undrawn.insert(*block, undrawn);
            }
            contexts.leave(&cells, &undrawn);
        }
        if decoder.overran() {
            return Err(SyntaxError("the masks end too early").into());
        }
        Ok(CellCorners::new(frame, sets).of_undrawn(&cells, &all_undrawn))
    }
}

/// The voxels of bits, in order.
pub fn set_bits(bits: &Bits) -> impl Iterator<Item = usize> {
    bits.iter().enumerate().flat_map(|(z, word)| {
        let mut rest = *word;
        std::iter::from_fn(move || {
            let voxel = (rest != 0).then(|| 64 * z + rest.trailing_zeros() as usize);
            rest &= rest.wrapping_sub(1);
            voxel
        })
    })
}

/// Cells of a block that are known.
#[derive(Clone, Debug)]
struct Known {
    drawn: Rows,
    undrawn: Rows,
}

/// What is known around a cell when it is coded. That are the cells that were coded before, and the reference's unobserved voxels.
#[derive(Debug)]
pub struct CellContexts<'a> {
    frame: ReferenceBlocks<'a>,
    finder: NeighbourFinder<'a>,
    reference: Option<(ReferenceBlocks<'a>, NeighbourFinder<'a>)>,
    /// For each block of the frame, one more than the place of what is known of its cells, or 0.
    places: Vec<u32>,
    known: Vec<Known>,
    block: u32,
    /// The block turned to and one layer around it: the cells that are known, and the reference's unobserved voxels.
    drawn: [Layer; SIDE],
    undrawn: [Layer; SIDE],
    unobserved: [Layer; SIDE],
}

impl<'a> CellContexts<'a> {
    /// For the cells of a frame. `reference`: the frame before, with its masks.
    #[must_use]
    pub fn new(frame: ReferenceBlocks<'a>, reference: Option<ReferenceBlocks<'a>>) -> Self {
        let nothing = [[0; 24]; SIDE];
        Self {
            frame,
            finder: NeighbourFinder::new(frame.index),
            reference: reference.map(|reference| (reference, NeighbourFinder::new(reference.index))),
            places: vec![0; frame.coords.len()],
            known: Vec::new(),
            block: 0,
            drawn: nothing,
            undrawn: nothing,
            unobserved: nothing,
        }
    }

    /// Goes on to a block, by its index in the frame, and gives the context of its flag.
    ///
    /// It counts the blocks behind, and those around, where a cell begins that is known not to be drawn. It tells whether the
    /// block at its place in the reference has a mask.
    #[must_use]
    pub fn turn_to(&mut self, block: u32) -> usize {
        self.block = block;
        let coord = self.frame.coords[block as usize];
        self.finder.turn_to(coord);
        let around = self.finder.neighbourhood();
        let known = around.map(|block| self.known(block?));
        let drawn = gathered(&known.map(|known| Some(&known?.drawn)));
        let undrawn = gathered(&known.map(|known| Some(&known?.undrawn)));
        let has_undrawn = known.map(|known| known.is_some_and(|known| known.undrawn != [0; 64]));
        let behind = [12, 10, 4].into_iter().filter(|slot| has_undrawn[*slot]).count();
        let count = has_undrawn.into_iter().filter(|has| *has).count().min(5);
        (self.drawn, self.undrawn) = (drawn, undrawn);
        let masked = match &mut self.reference {
            None => 2,
            Some((reference, finder)) => {
                finder.turn_to(coord);
                let masks = masks_around(*reference, &finder.neighbourhood());
                self.unobserved = gathered(&masks.each_ref().map(Option::as_ref));
                usize::from(masks[13].is_some())
            }
        };
        (masked * 4 + behind) * 6 + count
    }

    fn known(&self, block: u32) -> Option<&Known> {
        let place = self.places[block as usize].checked_sub(1)?;
        Some(&self.known[place as usize])
    }

    /// The contexts of a cell of the block, by its lowest corner. One has what the cells behind it along x, y and z are. The other
    /// has how many cells around it are drawn, and how many are not. Both have what the reference says.
    #[must_use]
    pub fn cell(&self, voxel: usize) -> [usize; 2] {
        let [x, y, z] = [voxel & 7, voxel >> 3 & 7, voxel >> 6];
        // The place of a voxel of the block in the layers is one more along each axis.
        let state = |x: usize, y: usize, z: usize| {
            usize::from(self.drawn[z][y] >> x & 1) + 2 * usize::from(self.undrawn[z][y] >> x & 1)
        };
        let behind = [state(x, y + 1, z + 1), state(x + 1, y, z + 1), state(x + 1, y + 1, z)];
        let behind = behind.into_iter().fold(0, |context, state| 3 * context + state);
        let [drawn, undrawn] =
            [&self.drawn, &self.undrawn].map(|cells| count(cells, [x, y, z], 3).min(MOST) as usize);
        let before = self.before([x, y, z]);
        [27 * before + behind, 49 * before + 7 * drawn + undrawn]
    }

    /// What the reference says of a cell.
    ///
    /// | | unobserved there |
    /// |---|---|
    /// | 0 | nothing |
    /// | 1 | no corner of the cell, but a voxel around its lowest one |
    /// | 2 | up to four corners |
    /// | 3 | more corners |
    /// | 4 | not known: there is no reference |
    fn before(&self, at: [usize; 3]) -> usize {
        if self.reference.is_none() {
            return 4;
        }
        match count(&self.unobserved, at.map(|place| place + 1), 2) {
            0 => usize::from(count(&self.unobserved, at, 3) > 0),
            1..=4 => 2,
            _ => 3,
        }
    }

    /// Takes note of a cell of the block.
    pub fn set(&mut self, voxel: usize, is_undrawn: bool) {
        let [x, y, z] = [voxel & 7, voxel >> 3 & 7, voxel >> 6];
        let cells = if is_undrawn { &mut self.undrawn } else { &mut self.drawn };
        cells[z + 1][y + 1] |= 2 << x;
    }

    /// Takes note of all cells of the block, and of those that are not drawn, for the blocks after it.
    pub fn leave(&mut self, cells: &Bits, undrawn: &Bits) {
        let drawn: Bits = std::array::from_fn(|z| cells[z] & !undrawn[z]);
        self.known.push(Known { drawn: rows(&drawn), undrawn: rows(undrawn) });
        self.places[self.block as usize] = self.known.len() as u32;
    }
}

/// How many bits are set in a cube. `side`: its voxels along an axis. The place is that of its lowest voxel in the layers.
fn count(layers: &[Layer; SIDE], [x, y, z]: [usize; 3], side: usize) -> u32 {
    let row = (1u16 << side) - 1;
    let rows = layers[z..z + side].iter().flat_map(|layer| &layer[y..y + side]);
    rows.map(|bits| (bits >> x & row).count_ones()).sum()
}

/// The layers of a block and its surroundings, of what the blocks around it have. Not inlined, as its code is long.
#[inline(never)]
fn gathered(around: &[Option<&Rows>; 27]) -> [Layer; SIDE] {
    if around.iter().all(Option::is_none) {
        return [[0; 24]; SIDE];
    }
    layers(&around.map(|rows| rows.unwrap_or(&[0; 64])))
}

/// The masks of the blocks around one.
fn masks_around(frame: ReferenceBlocks, around: &Neighbourhood) -> [Option<Rows>; 27] {
    around.map(|block| frame.unobserved.get(&block?).map(|mask| rows(&bits(mask))))
}
