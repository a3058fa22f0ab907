//! The samples that a frame's colour should have: those that read back, at the points where colours were seen, as these.

use super::landing::locate;
use isv_decode::colour::Reader;
use isv_decode::colour::tree::BlockTree;
use isv_decode::colour::{ColourFrame, ColourShape};
use isv_kernels::simd::vectorized;
use isv_volume::{ColourSample, Grid, ycbcr_from_rgb};
use rayon::prelude::*;

/// Samples that a thread works on at a time.
const CHUNK: usize = 4096;
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

/// Samples to be coded: YCbCr of 8-bit steps.
#[derive(Clone, Debug, Default)]
pub struct ColourTarget {
    /// Values of all layers, one layer after the other; NaN where a block has none in its deepest layer.
    values: Vec<[f32; 3]>,
    /// Start of each layer among them.
    starts: [usize; 3],
}

/// A colour that was seen, and the samples that are read there.
#[derive(Clone, Copy, Debug)]
struct Point {
    /// YCbCr values.
    colour: [f32; 3],
    weight: f32,
    /// Samples among those of all layers.
    taps: [u32; 8],
    /// Shares of these; 0 for those that are not there.
    shares: [f32; 8],
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
        let counts = [0, 1, 2].map(|layer| shape.layer_len(layer));
        let starts = [0, counts[0], counts[0] + counts[1]];
        let mut target = Self { values: vec![[f32::NAN; 3]; counts.iter().sum()], starts };
        let points = target.points(shape, grid, samples);
        target.fit(shape, &points, rounds);
        target
    }

    /// Mean squared error of luma that is left in each block where samples are fitted to what was seen; 0 where nothing was.
    #[must_use]
    pub fn misses(shape: &ColourShape, grid: &Grid, samples: &[ColourSample], rounds: usize) -> Vec<f32> {
        let mut target = Self::new(shape, grid, &[], 0);
        let points = target.points(shape, grid, samples);
        target.fit(shape, &points, rounds);
        let mut squares = vec![Seen::default(); target.values.len()];
        for point in points.iter() {
            let ((tap, share), missed) = (point.heaviest(), target.missed(point));
            let own = &mut squares[tap];
            own.weight += share * point.weight;
            own.colour[0] += share * point.weight * missed[0] * missed[0];
        }
        let of_block = |block: usize| {
            let depth = shape.depths()[block];
            let start = target.starts[usize::from(depth)];
            let samples = shape.block_samples(block, depth);
            let own = &squares[start + samples.start..start + samples.end];
            let weight: f32 = own.iter().map(|own| own.weight).sum();
            let square: f32 = own.iter().map(|own| own.colour[0]).sum();
            if weight > 0.0 { square / weight } else { 0.0 }
        };
        (0..shape.depths().len()).map(of_block).collect()
    }

    /// The points of the decoded surface at which colours were seen.
    fn points(&self, shape: &ColourShape, grid: &Grid, samples: &[ColourSample]) -> Points {
        let frame = ColourFrame { shape: shape.clone(), layers: Default::default() };
        let (depth, starts) = (shape.max_depth(), self.starts);
        let of_chunk = |samples: &[ColourSample]| {
            let mut reader = Reader::new(&frame);
            let mut points = Vec::with_capacity(samples.len());
            vectorized(
                #[inline(always)]
                || {
                    for sample in samples {
                        if let Some(point) = find(&mut reader, grid, sample, (depth, starts)) {
                            points.push(point);
                        }
                    }
                },
            );
            points
        };
        Points(samples.par_chunks(CHUNK).map(of_chunk).collect())
    }

    /// Fits the samples to what was seen at points.
    fn fit(&mut self, shape: &ColourShape, points: &Points, rounds: usize) {
        let mut seen = vec![Seen::default(); self.values.len()];
        for point in points.iter() {
            let (tap, share) = point.heaviest();
            seen[tap].add(point.weight * share, &point.colour);
        }
        self.fill(shape, &seen);
        for _ in 0..rounds {
            self.project_back(points);
        }
    }

    /// Values of a block's deepest layer, by slot.
    #[must_use]
    pub fn of_block(&self, shape: &ColourShape, block: usize) -> &[[f32; 3]] {
        let depth = shape.depths()[block];
        let samples = shape.block_samples(block, depth);
        &self.values[self.starts[usize::from(depth)] + samples.start..][..samples.len()]
    }

    /// Gives the leaves near which nothing was seen the mean of their node's others, of the smallest node that has any; then of the
    /// blocks around.
    fn fill(&mut self, shape: &ColourShape, seen: &[Seen]) {
        let mut rest = &mut self.values[..];
        let mut layers: [&mut [[f32; 3]]; 3] = Default::default();
        for (layer, values) in layers.iter_mut().enumerate() {
            *values = rest.split_off_mut(..shape.layer_len(layer)).expect("as many as were counted");
        }
        let mut blocks = Vec::with_capacity(shape.depths().len());
        for (block, depth) in shape.depths().iter().enumerate() {
            let start = self.starts[usize::from(*depth)] + shape.block_samples(block, *depth).start;
            let mut values: &mut [[f32; 3]] = &mut [];
            for (layer, rest) in (0..).zip(&mut layers) {
                let own = rest.split_off_mut(..shape.block_samples(block, layer).len());
                if layer == *depth {
                    values = own.expect("as many as were counted");
                }
            }
            blocks.push((block, &seen[start..start + values.len()], values));
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
                let depth = shape.depths()[block];
                let start = self.starts[usize::from(depth)] + shape.block_samples(block, depth).start;
                for number in 0..shape.cells().blocks()[block].count() {
                    let leaves = shape.leaves(block, number);
                    let parts = (0..1 << (3 * depth)).filter(|part| leaves >> part & 1 != 0);
                    parts.for_each(|part| self.values[start + (number << (3 * depth)) + part] = value);
                }
            }
            empty.retain(|block| means[*block].is_none());
        }
    }

    /// Error of a reading at a point: what was seen there less what is read.
    #[inline(always)]
    fn missed(&self, point: &Point) -> [f32; 3] {
        let mut missed = point.colour;
        for (tap, share) in point.taps.iter().zip(point.shares) {
            if share > 0.0 {
                let value = &self.values[*tap as usize];
                for c in 0..3 {
                    missed[c] -= share * value[c];
                }
            }
        }
        missed
    }

    /// Corrects the samples by what readings at the points miss of what was seen there.
    fn project_back(&mut self, points: &Points) {
        let of_chunk = |chunk: &Vec<Point>| chunk.iter().map(|point| self.missed(point)).collect();
        let missed: Vec<Vec<[f32; 3]>> = points.0.par_iter().map(of_chunk).collect();
        let mut corrections = vec![Seen::default(); self.values.len()];
        for (point, missed) in points.iter().zip(missed.iter().flatten()) {
            for (tap, share) in point.taps.iter().zip(point.shares) {
                corrections[*tap as usize].add(share * point.weight, missed);
            }
        }
        for (value, correction) in self.values.iter_mut().zip(corrections) {
            let gain = GAIN / correction.weight.max(LEAST_WEIGHT);
            (0..3).for_each(|c| value[c] += gain * correction.colour[c]);
        }
    }
}

/// Points by the chunks of samples that they come from.
struct Points(Vec<Vec<Point>>);

impl Points {
    fn iter(&self) -> impl Iterator<Item = &Point> {
        self.0.iter().flatten()
    }
}

impl Point {
    /// The sample that counts most, which is that of the leaf that the point lies in, and its share.
    fn heaviest(&self) -> (usize, f32) {
        let mut most = 0;
        for tap in 1..8 {
            if self.shares[tap] > self.shares[most] {
                most = tap;
            }
        }
        (self.taps[most] as usize, self.shares[most])
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
    let (mut sums, mut count, mut missing) = ([0.0; 3], 0.0f32, false);
    let mut put = |slot: usize, value: [f32; 3]| {
        values[slot] = value;
        count += 1.0;
        (0..3).for_each(|c| sums[c] += value[c]);
    };
    for slot in shape.leaf_slots(block) {
        match seen[slot].mean() {
            Some(value) => put(slot, value),
            None => missing = true,
        }
    }
    if missing {
        shape.build_tree(block, tree);
        let filled = filled(tree, tree.leaf_slots().map(|slot| seen[slot].mean()).collect());
        (sums, count) = ([0.0; 3], 0.0);
        for (slot, value) in tree.leaf_slots().zip(filled) {
            let value = value?;
            values[slot] = value;
            count += 1.0;
            (0..3).for_each(|c| sums[c] += value[c]);
        }
    }
    Some(sums.map(|sum| sum / count.max(1.0)))
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

/// Finds the samples that a reading takes where a colour was seen.
#[inline(always)]
fn find(
    reader: &mut Reader,
    grid: &Grid,
    sample: &ColourSample,
    (depth, starts): (u8, [usize; 3]),
) -> Option<Point> {
    let (onto, normal, height) = locate(reader, grid, sample)?;
    let weight = weight(sample, normal, height);
    let mut point = Point { colour: ycbcr(sample), weight, taps: [0; 8], shares: [0.0; 8] };
    let (mut count, mut all) = (0, 0.0);
    reader.taps(
        onto,
        normal,
        depth,
        #[inline(always)]
        |tap, weight| {
            if !tap.is_leaf {
                return;
            }
            point.taps[count] = (starts[usize::from(tap.layer)] + tap.at as usize) as u32;
            point.shares[count] = weight as f32;
            all += weight as f32;
            count += 1;
        },
    );
    if count == 0 {
        return None;
    }
    for share in &mut point.shares {
        *share /= all;
    }
    Some(point)
}
