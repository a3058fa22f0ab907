//! The samples that a frame's colour should have: those that read back, at the points where colours were seen, as these.

use super::landing::{Place, land};
use isv_decode::colour::Reader;
use isv_decode::colour::tree::BlockTree;
use isv_decode::colour::{ColourFrame, ColourShape};
use isv_kernels::simd::vectorized;
use isv_volume::{BlockCoord, ColourSample, Grid, MortonCode, ycbcr_from_rgb};
use rayon::prelude::*;
use std::ops::Range;

/// Samples that a thread works on at a time.
const CHUNK: usize = 16384;
/// Samples of a block from which on it pays to take its cells together.
const SHARING: usize = 16;
/// Voxels around a block that readings at its samples take cells from, but for a few: the first, and the one after the last.
const AROUND: ([i32; 3], [i32; 3]) = ([-1; 3], [10; 3]);
/// Blocks that a thread works on at least at a time.
const BLOCKS: usize = 32;
/// Distance from the decoded surface, in voxels, at which what was seen counts a third as much as on it.
const NEAR: f32 = 0.15;
/// Least weight of a colour sample.
const LEAST: f32 = 1e-3;
/// Gain of a round of back projection.
const GAIN: f32 = 1.3;
/// Shares of samples below this do not make a correction larger.
const LEAST_WEIGHT: f32 = 0.5;

/// Samples to be coded, those of each block's deepest layer: YCbCr of 8-bit steps.
#[derive(Clone, Debug, Default)]
pub struct ColourTarget {
    /// Values of the leaves, block after block, in the order of their trees.
    values: Vec<[f32; 3]>,
    /// First leaf of each cell, and the number of all.
    starts: Vec<u32>,
}

/// A colour that was seen, and the leaves that are read there. A cache line.
#[derive(Clone, Copy, Debug, Default)]
struct Point {
    /// YCbCr values.
    colour: [f32; 3],
    weight: f32,
    leaves: [u32; 8],
    /// Weights of these; 0 for those that are not there. None has any if nothing is read.
    shares: [u16; 8],
}

/// Sums of what was seen near a sample: of colours times their weights, and of the weights.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    colour: [f32; 3],
    weight: f32,
}

impl ColourTarget {
    /// Fits samples to what was seen. `shape`: of the samples; `rounds`: of back projection.
    #[must_use]
    pub fn new(shape: &ColourShape, grid: &Grid, samples: &[ColourSample], rounds: usize) -> Self {
        let mut target = Self::empty(shape);
        let points = target.points(shape, grid, samples);
        target.fit(shape, &points, rounds);
        target
    }

    /// Samples without values yet.
    fn empty(shape: &ColourShape) -> Self {
        let mut starts = Vec::with_capacity(shape.cells().surfels().len() + 1);
        let mut leaves = 0;
        for (block, cells) in shape.cells().blocks().iter().enumerate() {
            for number in 0..cells.count() {
                starts.push(leaves);
                leaves += shape.leaves(block, number).count_ones();
            }
        }
        starts.push(leaves);
        Self { values: vec![[f32::NAN; 3]; leaves as usize], starts }
    }

    /// Mean squared error of luma that is left in each block where samples are fitted to what was seen; 0 where nothing was.
    #[must_use]
    pub fn misses(shape: &ColourShape, grid: &Grid, samples: &[ColourSample], rounds: usize) -> Vec<f32> {
        let mut target = Self::empty(shape);
        let points = target.points(shape, grid, samples);
        target.fit(shape, &points, rounds);
        let mut squares = vec![Seen::default(); target.values.len()];
        for point in points.iter() {
            let (leaf, share) = point.heaviest();
            if share == 0.0 {
                continue;
            }
            let missed = target.missed(point, &point.shares());
            let own = &mut squares[leaf];
            own.weight += share * point.weight;
            own.colour[0] += share * point.weight * missed[0] * missed[0];
        }
        let of_block = |block: usize| {
            let own = &squares[target.leaves(shape, block)];
            let weight: f32 = own.iter().map(|own| own.weight).sum();
            let square: f32 = own.iter().map(|own| own.colour[0]).sum();
            if weight > 0.0 { square / weight } else { 0.0 }
        };
        (0..shape.depths().len()).map(of_block).collect()
    }

    /// The points of the decoded surface at which colours were seen, in the order of the samples.
    fn points(&self, shape: &ColourShape, grid: &Grid, samples: &[ColourSample]) -> Points {
        let frame = ColourFrame { shape: shape.clone(), layers: Default::default() };
        let depth = shape.max_depth();
        let of_chunk = |samples: &[ColourSample]| {
            let mut reader = Reader::new(&frame);
            let places = places(grid, samples);
            let mut points = vec![Point::default(); samples.len()];
            for of_block in runs(&places).chunk_by(|a, b| a.block == b.block) {
                reader.turn_to(of_block[0].block);
                let count: usize = of_block.iter().map(|run| run.samples.len()).sum();
                vectorized(
                    #[inline(always)]
                    || {
                        if count >= SHARING {
                            reader.hold(AROUND.0, AROUND.1, depth);
                        }
                        for number in of_block.iter().flat_map(|run| run.samples.clone()) {
                            let (place, sample) = (places[number].as_ref(), &samples[number]);
                            let found = place.and_then(
                                #[inline(always)]
                                |place| self.find(&mut reader, place, sample, depth),
                            );
                            points[number] = found.unwrap_or_default();
                        }
                    },
                );
            }
            points
        };
        Points(samples.par_chunks(CHUNK).map(of_chunk).collect())
    }

    /// Finds the leaves that are read where a colour was seen. The reader is turned to the place's block.
    #[inline(always)]
    fn find(&self, reader: &mut Reader, place: &Place, sample: &ColourSample, depth: u8) -> Option<Point> {
        let (onto, normal, height) = land(reader, place, sample.normal)?;
        let mut point =
            Point { colour: ycbcr(sample), weight: weight(sample, normal, height), ..Point::default() };
        let mut count = 0;
        for tap in reader.leaf_taps(onto, normal, depth) {
            // One that is not there is overwritten by the next.
            point.leaves[count & 7] = self.starts[tap.cell as usize] + tap.rank;
            point.shares[count & 7] = tap.weight as u16;
            count += usize::from(tap.weight > 0);
        }
        (count > 0).then_some(point)
    }

    /// Fits the samples to what was seen at points.
    fn fit(&mut self, shape: &ColourShape, points: &Points, rounds: usize) {
        let mut seen = vec![Seen::default(); self.values.len()];
        in_parts(&mut seen, |part, seen| {
            for point in points.iter() {
                let (leaf, share) = point.heaviest();
                if share > 0.0 && part.contains(&leaf) {
                    seen[leaf - part.start].add(point.weight * share, &point.colour);
                }
            }
        });
        self.fill(shape, &seen);
        for _ in 0..rounds {
            self.project_back(points);
        }
    }

    /// The leaves of a block among those of all.
    fn leaves(&self, shape: &ColourShape, block: usize) -> Range<usize> {
        let cells = &shape.cells().blocks()[block];
        let first = cells.first();
        self.starts[first] as usize..self.starts[first + cells.count()] as usize
    }

    /// Values of the leaves of each block, in the order of its tree.
    #[must_use]
    pub fn by_block(&self, shape: &ColourShape) -> Vec<&[[f32; 3]]> {
        (0..shape.depths().len()).map(|block| &self.values[self.leaves(shape, block)]).collect()
    }

    /// Fills the leaves near which nothing was seen with the mean of the other leaves of their node. The node is the smallest that has
    /// any; without one, the blocks around count.
    fn fill(&mut self, shape: &ColourShape, seen: &[Seen]) {
        let count = shape.depths().len();
        let ranges: Vec<Range<usize>> = (0..count).map(|block| self.leaves(shape, block)).collect();
        let mut rest = &mut self.values[..];
        let mut blocks = Vec::with_capacity(count);
        for (block, own) in ranges.into_iter().enumerate() {
            let values = rest.split_off_mut(..own.len()).expect("as many as were counted");
            blocks.push((block, &seen[own], values));
        }
        let means = blocks
            .into_par_iter()
            .with_min_len(BLOCKS)
            .map_init(BlockTree::default, |tree, (block, seen, values)| {
                fill_block(shape, block, tree, seen, values)
            })
            .collect();
        self.spread_between_blocks(shape, means);
    }

    /// Gives blocks of which nothing was seen the mean of those around, from the rims inwards.
    fn spread_between_blocks(&mut self, shape: &ColourShape, mut means: Vec<Option<[f32; 3]>>) {
        let index = shape.cells().index();
        let mut empty: Vec<usize> = (0..means.len()).filter(|block| means[*block].is_none()).collect();
        while !empty.is_empty() {
            let found: Vec<(usize, [f32; 3])> = empty
                .iter()
                .filter_map(|block| {
                    let around = index.neighbourhood(shape.cells().coords()[*block]);
                    let around: Vec<_> = around.iter().flatten().map(|n| means[*n as usize]).collect();
                    around.iter().any(Option::is_some).then(|| (*block, mean(&around)))
                })
                .collect();
            let found = match found.is_empty() {
                // Nothing was seen of a whole part.
                true => empty.iter().map(|block| (*block, [128.0, 0.0, 0.0])).collect(),
                false => found,
            };
            for (block, value) in found {
                means[block] = Some(value);
                let leaves = self.leaves(shape, block);
                self.values[leaves].fill(value);
            }
            empty.retain(|block| means[*block].is_none());
        }
    }

    /// Error of a reading at a point: what was seen there less what is read. `shares`: of the point's leaves.
    #[inline(always)]
    fn missed(&self, point: &Point, shares: &[f32; 8]) -> [f32; 3] {
        let mut missed = point.colour;
        for (leaf, share) in point.leaves.iter().zip(shares) {
            if *share > 0.0 {
                let value = &self.values[*leaf as usize];
                for c in 0..3 {
                    missed[c] -= share * value[c];
                }
            }
        }
        missed
    }

    /// Corrects the samples by what readings at the points miss of what was seen there.
    fn project_back(&mut self, points: &Points) {
        let mut corrections = vec![Seen::default(); self.values.len()];
        in_parts(&mut corrections, |part, corrections| {
            for point in points.iter().filter(|point| point.reads(part)) {
                let shares = point.shares();
                let missed = self.missed(point, &shares);
                for (leaf, share) in point.leaves.iter().zip(shares) {
                    let leaf = *leaf as usize;
                    if share > 0.0 && part.contains(&leaf) {
                        corrections[leaf - part.start].add(share * point.weight, &missed);
                    }
                }
            }
        });
        for (value, correction) in self.values.iter_mut().zip(corrections) {
            let gain = GAIN / correction.weight.max(LEAST_WEIGHT);
            (0..3).for_each(|c| value[c] += gain * correction.colour[c]);
        }
    }
}

/// Sums up values of leaves on several threads. Each thread sees all that is added, in one order, and takes what belongs to its part.
/// Sums do not depend on the number of threads.
fn in_parts(sums: &mut [Seen], add: impl Fn(&Range<usize>, &mut [Seen]) + Sync) {
    let of_part = sums.len().div_ceil(rayon::current_num_threads()).max(1);
    sums.par_chunks_mut(of_part).enumerate().for_each(|(part, sums)| {
        let start = part * of_part;
        add(&(start..start + sums.len()), sums);
    });
}

/// Consecutive samples in one block.
struct Run {
    block: BlockCoord,
    /// Place of the block in Morton order.
    order: MortonCode,
    samples: Range<usize>,
}

/// The runs of samples, block by block.
fn runs(places: &[Option<Place>]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (number, place) in places.iter().enumerate() {
        let Some(Place { block, .. }) = place else { continue };
        match runs.last_mut().filter(|run| run.block == *block && run.samples.end == number) {
            Some(run) => run.samples.end += 1,
            None => runs.push(Run { block: *block, order: block.morton(), samples: number..number + 1 }),
        }
    }
    runs.sort_unstable_by_key(|run| (run.order, run.samples.start));
    runs
}

/// The places of samples.
fn places(grid: &Grid, samples: &[ColourSample]) -> Vec<Option<Place>> {
    let mut places = Vec::with_capacity(samples.len());
    vectorized(
        #[inline(always)]
        || {
            for sample in samples {
                places.push(Place::new(grid, sample));
            }
        },
    );
    places
}

/// Points by the chunks of samples that they come from.
struct Points(Vec<Vec<Point>>);

impl Points {
    fn iter(&self) -> impl Iterator<Item = &Point> {
        self.0.iter().flatten()
    }
}

impl Point {
    /// Whether it reads any of some leaves.
    #[inline(always)]
    fn reads(&self, leaves: &Range<usize>) -> bool {
        self.leaves.iter().any(|leaf| leaves.contains(&(*leaf as usize)))
    }

    /// The shares of the leaves in a reading; all 0 if nothing is read.
    #[inline(always)]
    fn shares(&self) -> [f32; 8] {
        let all: u32 = self.shares.iter().map(|share| u32::from(*share)).sum();
        let all = all.max(1) as f32;
        self.shares.map(|share| f32::from(share) / all)
    }

    /// The leaf that counts most, which is the one that the point lies in, and its share.
    #[inline(always)]
    fn heaviest(&self) -> (usize, f32) {
        let shares = self.shares();
        let mut most = 0;
        for tap in 1..8 {
            if shares[tap] > shares[most] {
                most = tap;
            }
        }
        (self.leaves[most] as usize, shares[most])
    }
}

impl Seen {
    /// Adds a colour.
    #[inline(always)]
    fn add(&mut self, weight: f32, colour: &[f32; 3]) {
        for c in 0..3 {
            self.colour[c] += weight * colour[c];
        }
        self.weight += weight;
    }

    /// The mean colour, if anything was seen.
    fn mean(&self) -> Option<[f32; 3]> {
        (self.weight > 0.0).then(|| self.colour.map(|c| c / self.weight))
    }
}

/// Fills the leaves of a block, as far as anything was seen of it, and tells their mean.
fn fill_block(
    shape: &ColourShape,
    block: usize,
    tree: &mut BlockTree,
    seen: &[Seen],
    values: &mut [[f32; 3]],
) -> Option<[f32; 3]> {
    let mut missing = false;
    for (value, seen) in values.iter_mut().zip(seen) {
        match seen.mean() {
            Some(mean) => *value = mean,
            None => missing = true,
        }
    }
    if missing {
        shape.build_tree(block, tree);
        for (value, filled) in values.iter_mut().zip(filled(tree, seen.iter().map(Seen::mean).collect())) {
            *value = filled?;
        }
    }
    let mut sums = [0.0; 3];
    for value in values.iter() {
        (0..3).for_each(|c| sums[c] += value[c]);
    }
    Some(sums.map(|sum| sum / (values.len() as f32).max(1.0)))
}

/// The leaves of a block, of which those without a value have the mean of the smallest node that has any. All `None` if none has.
fn filled(tree: &BlockTree, leaves: Vec<Option<[f32; 3]>>) -> Vec<Option<[f32; 3]>> {
    let levels = tree.levels();
    let mut up = vec![leaves];
    for nodes in levels[..levels.len() - 1].iter().rev() {
        let mut rest = &up[up.len() - 1][..];
        let means = nodes.children.iter().map(|children| {
            let (own, others) = rest.split_at(children.count_ones() as usize);
            rest = others;
            own.iter().any(Option::is_some).then(|| mean(own))
        });
        let means = means.collect();
        up.push(means);
    }
    let mut values = up.pop().unwrap_or_default();
    for nodes in &levels[..levels.len() - 1] {
        let mut below = up.pop().unwrap_or_default();
        let mut rest = &mut below[..];
        for (children, value) in nodes.children.iter().zip(&values) {
            let own = rest.split_off_mut(..children.count_ones() as usize);
            own.expect("a value for each child").iter_mut().for_each(|own| *own = own.or(*value));
        }
        values = below;
    }
    values
}

/// The mean of those values that are there.
fn mean(values: &[Option<[f32; 3]>]) -> [f32; 3] {
    let (mut sums, mut count) = ([0.0; 3], 0.0f32);
    for value in values.iter().flatten() {
        count += 1.0;
        (0..3).for_each(|c| sums[c] += value[c]);
    }
    sums.map(|sum| sum / count.max(1.0))
}

/// The weight of a colour that was seen at a distance (voxels) from a plane with a normal.
#[inline(always)]
fn weight(sample: &ColourSample, normal: [i8; 3], height: f32) -> f32 {
    let mut agreement = f32::from(u8::from(sample.normal == [0.0; 3]));
    for axis in 0..3 {
        agreement += f32::from(normal[axis]) / 127.0 * sample.normal[axis];
    }
    let nearness = (-(height / NEAR).powi(2)).exp().max(LEAST);
    sample.weight * nearness * agreement.clamp(LEAST, 1.0)
}

/// The YCbCr values of a colour.
#[inline(always)]
fn ycbcr(sample: &ColourSample) -> [f32; 3] {
    let mut colour = [0.0; 3];
    for (value, ycbcr) in colour.iter_mut().zip(ycbcr_from_rgb(sample.colour)) {
        *value = ycbcr as f32;
    }
    colour
}
