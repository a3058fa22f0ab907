//! The octree of a block's cells, and its weights.

use super::cells::BlockCells;
use super::surfel::Surfel;

/// Levels of nodes above the voxels' cells: the block, 4x4x4 and 2x2x2 cells.
pub const UPPER_LEVELS: usize = 3;
/// Levels of nodes in the deepest tree, without its leaves.
pub const MAX_LEVELS: usize = UPPER_LEVELS + 2;
/// Weight of a half cell; that of a quarter cell is 1.
pub const HALF_WEIGHT: u32 = 4;

/// The nodes of one level in Morton order.
#[derive(Clone, Debug, Default)]
pub struct TreeLevel {
    /// Places of the nodes, in Morton order of this level.
    pub places: Vec<u16>,
    /// The area that each node stands for, in quarter cells.
    pub weights: Vec<u32>,
    /// Which children each node has; empty for the leaves.
    pub children: Vec<u8>,
}

/// The octree of a block: from the block down to the cells that have samples.
///
/// The weight of a voxel's cell is the number of its half cells that the surface crosses. This holds at depth 0 too, so that a
/// coefficient means the same at every depth.
#[derive(Clone, Debug, Default)]
pub struct BlockTree {
    depth: u8,
    levels: [TreeLevel; MAX_LEVELS + 1],
}

impl BlockTree {
    /// Builds the tree of a block. `quarters` are the crossed quarter cells of each cell, if it is two deep. `lowest`: level from which on
    /// nodes are left out, but for that of the voxels' cells.
    pub fn build(
        &mut self,
        cells: &BlockCells,
        surfels: &[Surfel],
        quarters: &[u64],
        depth: u8,
        lowest: usize,
    ) {
        self.depth = depth;
        for level in &mut self.levels {
            level.places.clear();
            level.weights.clear();
            level.children.clear();
        }
        let [block, octants, cubes, voxels, halves, quarter_cells] = &mut self.levels;
        block.places.push(0);
        block.children.push(mask(cells.crossed.iter().map(|word| *word != 0)));
        for (octant, word) in cells.crossed.iter().enumerate().filter(|(_, word)| **word != 0) {
            octants.places.push(octant as u16);
            let bytes = word.to_le_bytes();
            octants.children.push(mask(bytes.iter().map(|byte| *byte != 0)));
            for (cube, byte) in bytes.into_iter().enumerate().filter(|(_, byte)| *byte != 0) {
                cubes.places.push((octant << 3 | cube) as u16);
                cubes.children.push(byte);
            }
        }
        voxels.places.extend(cells.places().map(|place| place as u16));
        let half_weights = surfels.iter().map(|surfel| surfel.halves.count_ones() * HALF_WEIGHT);
        match depth {
            0 | 1 => voxels.weights.extend(half_weights),
            _ => voxels.weights.extend(quarters.iter().map(|quarters| quarters.count_ones())),
        }
        if depth > 0 && lowest > UPPER_LEVELS {
            voxels.children.extend(surfels.iter().map(|surfel| surfel.halves));
            for (cell, (place, surfel)) in voxels.places.iter().zip(surfels).enumerate() {
                let mut rest = surfel.halves;
                while rest != 0 {
                    let half = rest.trailing_zeros() as usize;
                    rest &= rest - 1;
                    halves.places.push(*place << 3 | half as u16);
                    if depth == 1 {
                        halves.weights.push(HALF_WEIGHT);
                        continue;
                    }
                    let crossed = (quarters[cell] >> (8 * half)) as u8;
                    halves.children.push(crossed);
                    halves.weights.push(crossed.count_ones());
                    let places = (0..8).filter(|quarter| crossed >> quarter & 1 != 0);
                    quarter_cells
                        .places
                        .extend(places.map(|quarter| *place << 6 | (half << 3 | quarter) as u16));
                    quarter_cells.weights.extend((0..crossed.count_ones()).map(|_| 1));
                }
            }
        }
        for level in (0..UPPER_LEVELS).rev() {
            let (upper, lower) = self.levels.split_at_mut(level + 1);
            let (nodes, mut below) = (&mut upper[level], &lower[0].weights[..]);
            for children in &nodes.children {
                let own;
                (own, below) = below.split_at(children.count_ones() as usize);
                nodes.weights.push(own.iter().sum());
            }
        }
    }

    /// Depth of the leaves: 0 for voxels' cells, 1 for half cells, 2 for quarter cells.
    #[must_use]
    pub fn depth(&self) -> u8 {
        self.depth
    }

    /// Levels from the block to the leaves.
    #[must_use]
    pub fn levels(&self) -> &[TreeLevel] {
        &self.levels[..=UPPER_LEVELS + usize::from(self.depth)]
    }

    /// Slots of the leaves in their layer, counted from the block's first.
    pub fn leaf_slots(&self) -> impl Iterator<Item = usize> + '_ {
        self.slots(self.depth)
    }

    /// Places of the leaves, in Morton order of their level.
    pub fn leaf_places(&self) -> impl Iterator<Item = u16> + '_ {
        self.levels[UPPER_LEVELS + usize::from(self.depth)].places.iter().copied()
    }

    /// Slots of a layer's nodes. Each cell has a slot for each place in it, used or not.
    pub fn slots(&self, layer: u8) -> impl Iterator<Item = usize> + '_ {
        let shift = 3 * layer;
        let cells = &self.levels[UPPER_LEVELS].places;
        let mut number = 0;
        self.levels[UPPER_LEVELS + usize::from(layer)].places.iter().map(move |place| {
            while cells[number] != place >> shift {
                number += 1;
            }
            number << shift | usize::from(*place) & ((1 << shift) - 1)
        })
    }

    /// Levels of nodes that have children, which coefficients of a layer belong to.
    #[must_use]
    pub fn layer_levels(layer: u8) -> std::ops::Range<usize> {
        if layer == 0 {
            0..UPPER_LEVELS
        } else {
            UPPER_LEVELS + usize::from(layer) - 1..UPPER_LEVELS + usize::from(layer)
        }
    }
}

fn mask(bits: impl Iterator<Item = bool>) -> u8 {
    bits.enumerate().map(|(bit, set)| u8::from(set) << bit).sum()
}
