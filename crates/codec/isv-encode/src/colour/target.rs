//! The samples that a frame's colour should have: those that read back, at the points where colours were seen, as these.

use isv_decode::colour::frame::Reader;
use isv_decode::colour::tree::BlockTree;
use isv_decode::colour::{ColourFrame, ColourShape};
use isv_volume::{BlockCoord, ColourSample, Grid, ycbcr_from_rgb};
use rayon::prelude::*;

/// Samples that a thread works on at a time.
const CHUNK: usize = 4096;
/// Distance from the decoded surface, in voxels, at which what was seen counts a third as much as on it.
const NEAR: f32 = 0.15;
/// Least weight of a colour sample.
const LEAST: f32 = 1e-3;
/// Gain of a round of back projection.
const GAIN: f32 = 1.3;
/// Weights of samples below this do not make a correction larger.
const LEAST_WEIGHT: f32 = 0.5;

/// Samples to be coded: YCbCr of 8-bit steps, and whether anything was seen near each.
#[derive(Clone, Debug, Default)]
pub struct ColourTarget {
    /// Values of each layer, as [`ColourFrame::layers`] has them; the deepest of each block, and means above.
    pub layers: [Vec<[f32; 3]>; 3],
    /// Whether something was seen near each value of the deepest layer of each block.
    pub seen: [Vec<bool>; 3],
}

/// Colour seen at a point of the decoded surface.
#[derive(Clone, Copy, Debug)]
struct Seen {
    /// Samples that a reading there takes the mean of, and their weights; none if the point is too far from the surface.
    taps: [(u32, f32); 8],
    /// How many of these count.
    count: u8,
    layer: u8,
    colour: [f32; 3],
    weight: f32,
}

impl ColourTarget {
    /// Fits samples to what was seen. `shape`: of the samples; `rounds`: of back projection.
    #[must_use]
    pub fn new(shape: &ColourShape, grid: &Grid, samples: &[ColourSample], rounds: usize) -> Self {
        let frame = ColourFrame { shape: shape.clone(), layers: Default::default() };
        let seen: Vec<Seen> = samples
            .par_chunks(CHUNK)
            .flat_map_iter(|samples| {
                let mut reader = Reader::new(&frame);
                samples
                    .iter()
                    .filter_map(move |sample| find(&mut reader, shape, grid, sample))
                    .collect::<Vec<_>>()
            })
            .collect();
        let counts = [0, 1, 2].map(|layer| shape.layer_len(layer));
        let mut target = Self {
            layers: counts.map(|count| vec![[0.0; 3]; count]),
            seen: counts.map(|count| vec![false; count]),
        };
        let mut weights = counts.map(|count| vec![0.0f32; count]);
        for point in &seen {
            let layer = usize::from(point.layer);
            // The sample of the leaf that the point lies in counts most.
            let nearest = point.taps().iter().max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((at, share)) = nearest.map(|(at, share)| (*at as usize, *share)) else { continue };
            let weight = point.weight * share;
            weights[layer][at] += weight;
            (0..3).for_each(|c| target.layers[layer][at][c] += weight * point.colour[c]);
        }
        for layer in 0..3 {
            let values = target.layers[layer].iter_mut().zip(&weights[layer]).zip(&mut target.seen[layer]);
            for ((value, weight), seen) in values {
                *seen = *weight > 0.0;
                if *seen {
                    *value = value.map(|v| v / weight);
                }
            }
        }
        target.fill(shape);
        for _ in 0..rounds {
            target.project_back(&seen);
        }
        target
    }

    /// Gives the leaves near which nothing was seen the mean of their node's others, of the smallest node that has any; then of the
    /// blocks around.
    fn fill(&mut self, shape: &ColourShape) {
        let mut tree = BlockTree::default();
        let mut means: Vec<Option<[f32; 3]>> = Vec::with_capacity(shape.depths().len());
        for block in 0..shape.depths().len() {
            shape.build_tree(block, &mut tree);
            let depth = tree.depth();
            let start = shape.block_samples(block, depth).start;
            let (values, seen) = (&mut self.layers[usize::from(depth)], &self.seen[usize::from(depth)]);
            let slots: Vec<usize> = tree.leaf_slots().map(|slot| start + slot).collect();
            let leaves: Vec<Option<[f32; 3]>> =
                slots.iter().map(|at| seen[*at].then(|| values[*at])).collect();
            let filled = filled(&tree, leaves);
            means.push(filled.first().copied().flatten().map(|_| mean(&filled)));
            for (at, value) in slots.iter().zip(filled) {
                values[*at] = value.unwrap_or([f32::NAN; 3]);
            }
        }
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
                for at in shape.block_samples(block, depth) {
                    let sample = &mut self.layers[usize::from(depth)][at];
                    if sample[0].is_nan() {
                        *sample = value;
                    }
                }
            }
            empty.retain(|block| means[*block].is_none());
        }
    }

    /// Corrects the samples by what readings at the points miss of what was seen there.
    fn project_back(&mut self, seen: &[Seen]) {
        let mut corrections = [0, 1, 2].map(|layer| vec![([0.0f32; 3], 0.0f32); self.layers[layer].len()]);
        let missed: Vec<[f32; 3]> = seen
            .par_iter()
            .map(|point| {
                let values = &self.layers[usize::from(point.layer)];
                let mut missed = point.colour;
                for (at, weight) in point.taps() {
                    (0..3).for_each(|c| missed[c] -= weight * values[*at as usize][c]);
                }
                missed
            })
            .collect();
        for (point, missed) in seen.iter().zip(missed) {
            let corrections = &mut corrections[usize::from(point.layer)];
            for (at, share) in point.taps() {
                let (correction, weight) = &mut corrections[*at as usize];
                let share = share * point.weight;
                *weight += share;
                (0..3).for_each(|c| correction[c] += share * missed[c]);
            }
        }
        for (values, corrections) in self.layers.iter_mut().zip(corrections) {
            for (value, (correction, weight)) in values.iter_mut().zip(corrections) {
                (0..3).for_each(|c| value[c] += GAIN * correction[c] / weight.max(LEAST_WEIGHT));
            }
        }
    }
}

impl Seen {
    fn taps(&self) -> &[(u32, f32)] {
        &self.taps[..usize::from(self.count)]
    }
}

/// The leaves of a block, of which those without a value have the mean of the smallest node that has any. All `None` if none has.
fn filled(tree: &BlockTree, leaves: Vec<Option<[f32; 3]>>) -> Vec<Option<[f32; 3]>> {
    let levels = tree.levels();
    let mut up = vec![leaves];
    for nodes in levels[..levels.len() - 1].iter().rev() {
        let below = &up[up.len() - 1];
        let mut rest = &below[..];
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
        let below = up.pop().unwrap_or_default();
        let parents = nodes.children.iter().zip(&values);
        let of_parents = parents.flat_map(|(children, value)| vec![*value; children.count_ones() as usize]);
        values = below.iter().zip(of_parents).map(|(own, parent)| own.or(parent)).collect();
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

/// Finds the point of the decoded surface that shows a colour sample: its position, its normal, and its distance (voxels).
///
/// The position counts 1/256 voxel from the centre of the first voxel of the sample's block, which the reader is turned to. `None`
/// without a near surface that faces the same way.
#[must_use]
pub fn locate(reader: &mut Reader, grid: &Grid, sample: &ColourSample) -> Option<([i32; 3], [i8; 3], f32)> {
    let voxel_m = grid.voxel_size.metres();
    let at = sample.position.map(|p| f64::from(p) / voxel_m - 0.5);
    let voxel = at.map(|p| p.floor() as i32);
    let block = voxel.map(|v| v >> 3);
    let origin = BlockCoord::from(block);
    if !origin.in_range() {
        return None;
    }
    reader.turn_to(origin);
    let local = [0, 1, 2].map(|axis| voxel[axis] - 8 * block[axis]);
    let position: [f32; 3] =
        std::array::from_fn(|axis| (256.0 * (at[axis] - 8.0 * f64::from(block[axis]))) as f32);
    let mut best = nearest_plane(reader, local, position, sample.normal);
    if best.is_none_or(|plane| plane.height > 0.5) {
        for neighbour in (0..27).filter(|n| *n != 13) {
            let step = [neighbour % 3 - 1, neighbour / 3 % 3 - 1, neighbour / 9 - 1];
            let voxel = [0, 1, 2].map(|axis| local[axis] + step[axis]);
            let other = nearest_plane(reader, voxel, position, sample.normal);
            best = match (best, other) {
                (Some(a), Some(b)) => Some(if b.height < a.height { b } else { a }),
                (a, b) => a.or(b),
            };
        }
    }
    let Landing { onto, normal, height } = best?;
    Some((onto.map(|p| p.round() as i32), normal, height))
}

/// Finds the samples that a reading takes where a colour was seen.
fn find(reader: &mut Reader, shape: &ColourShape, grid: &Grid, sample: &ColourSample) -> Option<Seen> {
    let (onto, normal, height) = locate(reader, grid, sample)?;
    let agreement: f32 = match sample.normal == [0.0; 3] {
        true => 1.0,
        false => (0..3).map(|axis| f32::from(normal[axis]) / 127.0 * sample.normal[axis]).sum(),
    };
    let nearness = (-(height / NEAR).powi(2)).exp().max(LEAST);
    let weight = sample.weight * nearness * agreement.clamp(LEAST, 1.0);
    let max_depth = shape.depths().first().copied().unwrap_or(0);
    let mut seen = Seen {
        taps: [(0, 0.0); 8],
        count: 0,
        layer: 0,
        colour: ycbcr_from_rgb(sample.colour).map(|c| c as f32),
        weight,
    };
    let mut all = 0;
    reader.taps(onto, normal, max_depth, |layer, at, weight| {
        seen.taps[usize::from(seen.count)] = (at, weight as f32);
        seen.count += 1;
        seen.layer = layer;
        all += weight;
    });
    if all == 0 {
        return None;
    }
    seen.taps.iter_mut().for_each(|(_, weight)| *weight /= all as f32);
    Some(seen)
}

/// Point of the decoded surface that shows a colour sample.
#[derive(Clone, Copy, Debug)]
struct Landing {
    /// In 1/256 voxel from the reader's origin.
    onto: [f32; 3],
    normal: [i8; 3],
    /// Distance in voxels, and more where the plane does not stand for the surface any more.
    height: f32,
}

/// The point nearest to a position on the plane of a cell that faces a normal.
fn nearest_plane(
    reader: &mut Reader,
    voxel: [i32; 3],
    position: [f32; 3],
    facing: [f32; 3],
) -> Option<Landing> {
    let found = reader.cell(voxel)?;
    let surfel = reader.surfel(found);
    let normal = surfel.normal.map(|n| f32::from(n) / 127.0);
    let agreement: f32 = (0..3).map(|axis| normal[axis] * facing[axis]).sum();
    if facing != [0.0; 3] && agreement <= 0.0 {
        return None;
    }
    let middle = voxel.map(|v| (256 * v + 128) as f32);
    let height: f32 = (0..3)
        .map(|axis| (position[axis] - middle[axis] - f32::from(surfel.offset[axis])) * normal[axis])
        .sum();
    let onto: [f32; 3] = std::array::from_fn(|axis| position[axis] - height * normal[axis]);
    // A plane stands for the surface in its cell and a little beyond.
    let beyond: f32 = (0..3).map(|axis| ((onto[axis] - middle[axis]).abs() - 192.0).max(0.0)).sum();
    Some(Landing { onto, normal: surfel.normal, height: height.abs() / 256.0 + beyond / 64.0 })
}
