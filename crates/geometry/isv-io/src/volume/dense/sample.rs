//! From a dense field to blocks.

use super::{Dense, SampleAt, Scale};
use crate::volume::VolumeError;
use crate::volume::fill::fill_unobserved;
use isv_volume::{BlockCoord, CODES_PER_VOXEL, Grid, SparseVolume, VoxelMask};
use std::collections::BTreeMap;
use std::path::Path;

/// Parts of a voxel that a place may be off the grid without being interpolated.
const ON_GRID: f64 = 1e-3;
/// With a truncation of fewer voxels, a step from inside to the truncation is nothing unusual.
const JUMP_VOXELS: f64 = 3.0;

/// Along each axis: the sample at or before the centre of voxel 0 of the grid, and what share the next one has there.
pub(super) fn placement(dense: &Dense, sample_at: SampleAt, voxel_m: f64) -> [(i64, f64); 3] {
    let offset = match sample_at {
        SampleAt::Centre => 0.0,
        SampleAt::Corner => 0.5,
    };
    dense.origin_m.map(|origin| {
        let place = offset - origin / voxel_m;
        let nearest = place.round();
        let (first, share) = if (place - nearest).abs() < ON_GRID {
            (nearest, 0.0)
        } else {
            (place.floor(), place - place.floor())
        };
        // Saturates; what is that far away is refused below.
        (first as i64, share)
    })
}

/// The field on a grid whose origin is that of the world. Samples between voxels are interpolated.
pub(super) fn volume(
    dense: &Dense,
    path: &Path,
    sample_at: SampleAt,
    grid: &Grid,
    scale: &Scale,
) -> Result<SparseVolume, VolumeError> {
    let voxel_m = grid.voxel_size.metres();
    let placement = placement(dense, sample_at, voxel_m);
    let edge = grid.edge.voxels() as i64;
    let mut ranges = [(0, 0); 3];
    for axis in 0..3 {
        let (first, share) = placement[axis];
        let samples = dense.extents[axis] as i64 - i64::from(share > 0.0);
        let low = first.saturating_neg();
        ranges[axis] = (low.div_euclid(edge), low.saturating_add(samples - 1).div_euclid(edge));
    }
    let corner = |end: fn(&(i64, i64)) -> i64| ranges.each_ref().map(end);
    for corner in [corner(|range| range.0), corner(|range| range.1)] {
        let coord = BlockCoord::from(corner.map(|c| c.clamp(i32::MIN.into(), i32::MAX.into()) as i32));
        if !coord.in_range() {
            return Err(VolumeError::OutOfRange { path: path.to_owned(), row: 0, coord: corner });
        }
    }
    let mut coords = Vec::new();
    for z in ranges[2].0..=ranges[2].1 {
        for y in ranges[1].0..=ranges[1].1 {
            coords.extend((ranges[0].0..=ranges[0].1).map(|x| BlockCoord::from([x, y, z].map(|c| c as i32))));
        }
    }
    coords.sort_unstable_by_key(|coord| coord.morton());
    let sampler = Sampler { dense, grid, scale, placement };
    let (mut kept, mut samples, mut masks) = (Vec::new(), Vec::new(), BTreeMap::new());
    for coord in coords {
        let start = samples.len();
        let Some(unobserved) = sampler.block(coord, &mut samples) else { continue };
        if !unobserved.is_empty() {
            fill_unobserved(grid.edge, &mut samples[start..], &unobserved);
            masks.insert(kept.len() as u32, unobserved);
        }
        kept.push(coord);
    }
    Ok(SparseVolume::from_parts(*grid, kept, samples, masks))
}

struct Sampler<'a> {
    dense: &'a Dense,
    grid: &'a Grid,
    scale: &'a Scale,
    placement: [(i64, f64); 3],
}

impl Sampler<'_> {
    /// Adds the samples of a block; its unobserved voxels. `None`, with nothing added, if it has nothing to keep.
    fn block(&self, coord: BlockCoord, samples: &mut Vec<i16>) -> Option<VoxelMask> {
        let edge = self.grid.edge;
        let (n, voxels) = (edge.voxels(), edge.block_voxels());
        let first: [i64; 3] =
            std::array::from_fn(|axis| i64::from(coord.to_array()[axis]) * n as i64 + self.placement[axis].0);
        let window = Window::new(self, first, n);
        let shares = self.placement.map(|(_, share)| share);
        let codes_per_value = self.scale.metres / self.grid.voxel_size.metres() * f64::from(CODES_PER_VOXEL);
        let limit = f64::from(self.grid.truncation.codes());
        let mut unobserved = VoxelMask::empty(edge);
        let start = samples.len();
        let mut any_within = false;
        for voxel in 0..voxels {
            let at = [voxel % n, voxel / n % n, voxel / n / n];
            let codes = (window.interpolated(at, shares) * codes_per_value).round();
            if codes.is_nan() {
                unobserved.insert(voxel);
            }
            any_within |= codes.abs() < limit;
            // NaN becomes 0 and is filled by the caller.
            samples.push(codes.clamp(-limit, limit) as i16);
        }
        // Without weights nobody says that what is far from the surface was seen.
        let keep = unobserved.count() < voxels && (any_within || self.dense.has_weights());
        if !keep {
            samples.truncate(start);
        }
        keep.then_some(unobserved)
    }

    /// A value, clamped to the truncation, by its place among the samples; NaN where nothing was observed.
    fn value(&self, at: [i64; 3]) -> f64 {
        let mut place = [0; 3];
        for axis in 0..3 {
            match usize::try_from(at[axis]).ok().filter(|at| *at < self.dense.extents[axis]) {
                Some(at) => place[axis] = at,
                None => return f64::NAN,
            }
        }
        self.dense.value(place)
    }
}

/// The values that a block's samples lie between, and one more on either side.
struct Window {
    values: Vec<f64>,
    side: usize,
}

impl Window {
    /// Copies `n` samples from `first` on along each axis.
    fn new(sampler: &Sampler, first: [i64; 3], n: usize) -> Self {
        let side = n + 3;
        let mut values = Vec::with_capacity(side * side * side);
        for place in 0..side * side * side {
            let at = [place % side, place / side % side, place / side / side];
            values.push(sampler.value(std::array::from_fn(|axis| first[axis] + at[axis] as i64 - 1)));
        }
        let mut window = Self { values, side };
        let voxels = sampler.scale.saturated * sampler.scale.metres / sampler.grid.voxel_size.metres();
        if !sampler.dense.has_weights() && voxels >= JUMP_VOXELS {
            window.forget_jumps(sampler.scale.saturated);
        }
        // Infinite distances are beyond the truncation, and have to be interpolated with others.
        let beyond = sampler.scale.saturated.max(f64::MIN_POSITIVE) / 0.999;
        window
            .values
            .iter_mut()
            .filter(|value| value.is_infinite())
            .for_each(|value| *value = beyond.copysign(*value));
        window
    }

    /// Takes values at the truncation for unobserved that are beside negative ones: distances do not jump. Writers without weights fill
    /// with them what they have not seen, which would be a wall behind every surface.
    fn forget_jumps(&mut self, saturated: f64) {
        if !self.values.iter().any(|value| *value < 0.0) {
            return;
        }
        let side = self.side as isize;
        let near = |place: usize| {
            let at = [place % self.side, place / self.side % self.side, place / self.side / self.side];
            (0..27).any(|step: isize| {
                let to: [isize; 3] =
                    std::array::from_fn(|axis| at[axis] as isize + step / 3_isize.pow(axis as u32) % 3 - 1);
                let is_there = to.iter().all(|c| (0..side).contains(c));
                is_there && self.values[((to[2] * side + to[1]) * side + to[0]) as usize] < 0.0
            })
        };
        let jumps: Vec<usize> =
            (0..self.values.len()).filter(|place| self.values[*place] >= saturated && near(*place)).collect();
        jumps.into_iter().for_each(|place| self.values[place] = f64::NAN);
    }

    /// The value at a voxel of the block.
    fn interpolated(&self, at: [usize; 3], shares: [f64; 3]) -> f64 {
        let mut sum = 0.0;
        for corner in 0..8 {
            let step = [corner & 1, corner >> 1 & 1, corner >> 2];
            let share: f64 = (0..3).map(|a| if step[a] == 1 { shares[a] } else { 1.0 - shares[a] }).product();
            if share > 0.0 {
                let [x, y, z] = std::array::from_fn(|axis| at[axis] + step[axis] + 1);
                sum += share * self.values[(z * self.side + y) * self.side + x];
            }
        }
        sum
    }
}
