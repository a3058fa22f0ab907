//! The colour samples of a frame, and how a colour is read at a point.

use super::cells::{ColourCells, Surfel};
use super::morton::interleave;
use super::tree::BlockTree;
use isv_volume::{BlockCoord, NeighbourFinder, SparseVolume};
use std::ops::Range;

/// Fractional bits of a sample.
pub const SAMPLE_BITS: u32 = 6;
/// Deepest layer of samples: 0 has one in a voxel's cell, 1 one in a half cell, 2 one in a quarter cell.
pub const MAX_DEPTH: u8 = 2;
/// Fractional bits of weights between samples along an axis.
const WEIGHT_BITS: u32 = 5;
/// Weight of all samples around a point together.
const FULL_WEIGHT: i32 = 1 << (3 * WEIGHT_BITS);

/// A colour sample: luma `0 ..= 255`, blue and red difference `-128 ..= 128`, in 1/64; BT.709, full range. The last value is 0.
pub type Sample = [i16; 4];

/// Lowest and highest value of each channel.
pub const SAMPLE_RANGE: [(i32, i32); 3] = [
    (0, 255 << SAMPLE_BITS),
    (-(128 << SAMPLE_BITS), 128 << SAMPLE_BITS),
    (-(128 << SAMPLE_BITS), 128 << SAMPLE_BITS),
];

/// Clamps values to the range of samples.
#[must_use]
#[inline(always)]
pub fn clamped(values: [i32; 3]) -> Sample {
    let mut sample = [0; 4];
    for channel in 0..3 {
        let (low, high) = SAMPLE_RANGE[channel];
        sample[channel] = values[channel].clamp(low, high) as i16;
    }
    sample
}

/// A sum divided by its weight, rounded to the nearest, halves up.
#[inline(always)]
pub(crate) fn rounded(sum: i32, weight: i32) -> i32 {
    (sum + weight / 2).div_euclid(weight)
}

/// Which samples a frame has, and where they are.
#[derive(Clone, Debug, Default)]
pub struct ColourShape {
    cells: ColourCells,
    depths: Vec<u8>,
    /// Start of each block's samples in each layer.
    starts: Vec<[u32; 3]>,
    /// Samples of each layer.
    counts: [usize; 3],
    /// Crossed quarter cells of each cell of the blocks that are two deep: one word to 64 samples of layer 2.
    quarters: Vec<u64>,
}

impl ColourShape {
    /// Lays out the samples of blocks of these depths. `volume`: the one that the cells are of.
    #[must_use]
    pub fn new(cells: ColourCells, depths: Vec<u8>, volume: &SparseVolume) -> Self {
        let mut counts = [0; 3];
        let mut starts = Vec::with_capacity(depths.len());
        for (cells, depth) in cells.blocks().iter().zip(&depths) {
            starts.push(counts.map(|count| count as u32));
            for layer in 0..=*depth {
                counts[usize::from(layer)] += cells.count() << (3 * layer);
            }
        }
        let quarters = cells.crossed_quarters(volume, |block| depths[block] > 1);
        Self { cells, depths, starts, counts, quarters }
    }

    /// The cells that have samples.
    #[must_use]
    pub fn cells(&self) -> &ColourCells {
        &self.cells
    }

    /// Depth of each block.
    #[must_use]
    pub fn depths(&self) -> &[u8] {
        &self.depths
    }

    /// Start of each block's samples in each layer.
    #[must_use]
    pub fn starts(&self) -> &[[u32; 3]] {
        &self.starts
    }

    /// Samples of a block in a layer.
    #[must_use]
    pub fn block_samples(&self, block: usize, layer: u8) -> Range<usize> {
        let start = self.starts[block][usize::from(layer)] as usize;
        let count =
            if layer > self.depths[block] { 0 } else { self.cells.blocks()[block].count() << (3 * layer) };
        start..start + count
    }

    /// Crossed quarter cells of each cell of a block, if it is two deep.
    #[must_use]
    pub fn block_quarters(&self, block: usize) -> &[u64] {
        let samples = self.block_samples(block, 2);
        &self.quarters[samples.start / 64..samples.end / 64]
    }

    /// Builds the tree of a block.
    pub fn build_tree(&self, block: usize, tree: &mut BlockTree) {
        let cells = &self.cells.blocks()[block];
        tree.build(cells, self.cells.block_surfels(block), self.block_quarters(block), self.depths[block]);
    }

    /// Samples of a layer.
    #[must_use]
    pub fn layer_len(&self, layer: usize) -> usize {
        self.counts[layer]
    }

    /// Layers of this shape, all samples 0.
    #[must_use]
    pub fn layers(&self) -> [Vec<Sample>; 3] {
        self.counts.map(|count| vec![[0; 4]; count])
    }
}

/// The layers of samples of a frame.
///
/// Layer 0 has 1 sample a cell. Layer 1 has 8 a cell, in blocks of depth 1 or 2. Layer 2 has 64 a cell, in blocks of depth 2. Samples
/// of a cell are in Morton order; the surface does not cross all half and quarter cells, and the samples of the others are unused. Each
/// sample is the weighted mean of those below it.
#[derive(Clone, Debug, Default)]
pub struct ColourFrame {
    /// Which samples there are.
    pub shape: ColourShape,
    /// Samples of each layer.
    pub layers: [Vec<Sample>; 3],
}

impl ColourFrame {
    /// XXH64 of all samples that lie on the surface: those of the blocks' deepest layers, in order, each channel as two bytes.
    #[must_use]
    pub fn hash(&self) -> u64 {
        let mut bytes = Vec::new();
        let mut tree = BlockTree::default();
        for block in 0..self.shape.depths.len() {
            self.shape.build_tree(block, &mut tree);
            let depth = self.shape.depths[block];
            let samples = &self.layers[usize::from(depth)][self.shape.block_samples(block, depth)];
            for slot in tree.leaf_slots() {
                bytes.extend(samples[slot][..3].iter().flat_map(|value| value.to_le_bytes()));
            }
        }
        xxhash_rust::xxh64::xxh64(&bytes, 0)
    }
}

/// The cells and samples around a point.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    frame: &'a ColourFrame,
    finder: NeighbourFinder<'a>,
    /// The block that positions count from.
    origin: BlockCoord,
    /// The block that the finder is turned to, from the origin.
    middle: [i32; 3],
    /// The last block looked up, from the origin, and its number.
    last: ([i32; 3], Option<u32>),
}

/// A cell of a frame and its block.
#[derive(Clone, Copy, Debug)]
pub struct FoundCell {
    /// Number of the block among those that have cells.
    pub block: usize,
    /// Index of the cell among all of the frame.
    pub cell: usize,
}

impl<'a> Reader<'a> {
    /// Creates a reader of a frame.
    #[must_use]
    pub fn new(frame: &'a ColourFrame) -> Self {
        let finder = NeighbourFinder::new(frame.shape.cells.index());
        let origin = BlockCoord { x: 0, y: 0, z: 0 };
        Self { frame, finder, origin, middle: [i32::MIN; 3], last: ([i32::MIN; 3], None) }
    }

    /// Turns to the block that positions count from, which need not be one of the frame's.
    pub fn turn_to(&mut self, origin: BlockCoord) {
        self.origin = origin;
        self.middle = [i32::MIN; 3];
        self.last = ([i32::MIN; 3], None);
    }

    /// The number of a block, by its place from the origin.
    #[inline(always)]
    fn block(&mut self, place: [i32; 3]) -> Option<u32> {
        if self.last.0 == place {
            return self.last.1;
        }
        let step = [0, 1, 2].map(|axis| place[axis].wrapping_sub(self.middle[axis]));
        let block = if step.iter().all(|s| (-1..=1).contains(s)) {
            self.finder.get((13 + step[0] + 3 * step[1] + 9 * step[2]) as usize)
        } else {
            let coord = self.origin.offset(place);
            if !coord.in_range() {
                return None;
            }
            self.middle = place;
            self.finder.turn_to(coord);
            self.finder.get(13)
        };
        self.last = (place, block);
        block
    }

    /// The crossed cell at a voxel, counted from the origin's first.
    #[inline(always)]
    pub fn cell(&mut self, voxel: [i32; 3]) -> Option<FoundCell> {
        let block = self.block(voxel.map(|v| v >> 3))? as usize;
        let place = interleave(voxel.map(|v| (v & 7) as usize));
        let cell = self.frame.shape.cells.blocks()[block].cell(place)?;
        Some(FoundCell { block, cell })
    }

    /// The surface in a cell.
    #[inline(always)]
    pub fn surfel(&self, found: FoundCell) -> &'a Surfel {
        &self.frame.shape.cells.surfels()[found.cell]
    }

    /// The layer and the place in it of a cell's sample at a place at a depth, or of the deepest above it. `None` if the surface
    /// does not cross it.
    #[inline(always)]
    fn sample(&self, found: FoundCell, place: [i32; 3], depth: u8) -> Option<(u8, u32)> {
        let shape = &self.frame.shape;
        let deep = depth.min(shape.depths[found.block]);
        let shift = depth - deep;
        let local = found.cell - shape.cells.blocks()[found.block].first();
        let start = shape.starts[found.block][usize::from(deep)];
        match deep {
            0 => Some((0, found.cell as u32)),
            1 => {
                let half = interleave(place.map(|c| (c >> shift & 1) as usize));
                let there = self.surfel(found).halves >> half & 1 != 0;
                there.then(|| (1, start + (8 * local + half) as u32))
            }
            _ => {
                let quarter = interleave(place.map(|c| (c & 3) as usize));
                let there = shape.quarters[start as usize / 64 + local] >> quarter & 1 != 0;
                there.then(|| (2, start + (64 * local + quarter) as u32))
            }
        }
    }

    /// Reads the colour at a position, in 1/256 voxel from the middle of the origin's first voxel: the mean of the samples around it,
    /// weighted trilinearly, of those that are there. `depth`: of the samples wanted; where a block has none so deep, its deepest
    /// are read. `normal`: only samples of surfaces that face it count. `None` if there are no samples.
    #[inline(always)]
    pub fn read(&mut self, position: [i32; 3], normal: [i8; 3], depth: u8) -> Option<Sample> {
        let home = self.block(position.map(|p| p >> 11));
        let deep = home.map_or(0, |block| depth.min(self.frame.shape.depths[block as usize]));
        self.read_at(position, normal, deep)
            .or_else(|| if deep > 0 { self.read_at(position, normal, 0) } else { None })
    }

    /// The colour between the samples of one depth.
    #[inline(always)]
    fn read_at(&mut self, position: [i32; 3], normal: [i8; 3], depth: u8) -> Option<Sample> {
        let (mut sums, mut weights) = ([0i32; 3], 0);
        let layers = &self.frame.layers;
        self.for_taps(position, normal, depth, |layer, at, weight| {
            let sample = &layers[usize::from(layer)][at as usize];
            weights += weight;
            for channel in 0..3 {
                sums[channel] += weight * i32::from(sample[channel]);
            }
        });
        match weights {
            0 => None,
            FULL_WEIGHT => {
                let mean = |sum: i32| ((sum + FULL_WEIGHT / 2) >> (3 * WEIGHT_BITS)) as i16;
                Some([mean(sums[0]), mean(sums[1]), mean(sums[2]), 0])
            }
            weights => {
                let mean = |sum: i32| rounded(sum, weights) as i16;
                Some([mean(sums[0]), mean(sums[1]), mean(sums[2]), 0])
            }
        }
    }

    /// Visits the samples that [`Self::read`] takes the mean of: the layer of each, its place there, its weight.
    pub fn taps(
        &mut self,
        position: [i32; 3],
        normal: [i8; 3],
        depth: u8,
        mut visit: impl FnMut(u8, u32, i32),
    ) {
        let home = self.block(position.map(|p| p >> 11));
        let deep = home.map_or(0, |block| depth.min(self.frame.shape.depths[block as usize]));
        let mut any = false;
        self.for_taps(position, normal, deep, |layer, at, weight| {
            any = true;
            visit(layer, at, weight);
        });
        if !any && deep > 0 {
            self.for_taps(position, normal, 0, visit);
        }
    }

    /// Visits the samples around a position: eight, less those that are not there and those whose weight is 0.
    #[inline(always)]
    fn for_taps(
        &mut self,
        position: [i32; 3],
        normal: [i8; 3],
        depth: u8,
        mut visit: impl FnMut(u8, u32, i32),
    ) {
        let shift = 8 - u32::from(depth);
        let from_first = position.map(|p| p - (128 >> depth));
        let first = from_first.map(|p| p >> shift);
        let upper = from_first.map(|p| (p & ((1 << shift) - 1)) >> (shift - WEIGHT_BITS));
        let along = upper.map(|u| [(1 << WEIGHT_BITS) - u, u]);
        let mut known: ([i32; 3], Option<FoundCell>) = ([i32::MIN; 3], None);
        for corner in 0..8 {
            let steps = [corner & 1, corner >> 1 & 1, corner >> 2];
            let weight = along[0][steps[0]] * along[1][steps[1]] * along[2][steps[2]];
            if weight == 0 {
                continue;
            }
            let place: [i32; 3] = std::array::from_fn(|axis| first[axis] + steps[axis] as i32);
            let voxel = place.map(|p| p >> depth);
            if known.0 != voxel {
                let found = self.cell(voxel).filter(|found| self.surfel(*found).faces(normal));
                known = (voxel, found);
            }
            if let Some((layer, at)) = known.1.and_then(|found| self.sample(found, place, depth)) {
                visit(layer, at, weight);
            }
        }
    }
}
