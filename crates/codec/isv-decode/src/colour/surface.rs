//! Colours of points on a decoded surface, as users have them.

use super::frame::{ColourFrame, GREY, Sample};
use super::morton::{position, wide_position};
use super::reader::{Reader, sum};
use super::tree::BlockTree;
use super::ycbcr::to_rgb;
use isv_kernels::simd::vectorized;
use isv_volume::{BlockCoord, ColourSample, Grid, Rgb};
use rayon::prelude::*;

/// Points that a thread works on at a time.
const CHUNK: usize = 1024;
/// Points of a block from which on it pays to take its cells together.
const SHARING: usize = 12;
/// Edge of a block in 1/256 voxel.
const BLOCK: f64 = 2048.0;
/// Cells around a point that are looked in, nearest first.
const AROUND: [[i32; 3]; 7] =
    [[0, 0, 0], [-1, 0, 0], [0, -1, 0], [0, 0, -1], [-1, -1, 0], [-1, 0, -1], [0, -1, -1]];

/// The sRGB colours of points on the surface of a frame, in metres: vertices of marching cubes, or points between them.
///
/// Positions are rounded to 1/256 of a voxel, and from there on all is integers: the same points have the same colours on every
/// machine. A point that no coloured surface is near is grey.
#[must_use]
pub fn surface_colours<P: Copy + Into<[f64; 3]> + Sync>(
    frame: &ColourFrame,
    grid: &Grid,
    points: &[P],
) -> Vec<Rgb> {
    let depth = frame.shape.depths().iter().max().copied().unwrap_or(0);
    let voxel_m = grid.voxel_size.metres();
    // From the middle of the first voxel of all.
    let position = |point: &P| -> [f64; 3] {
        (*point).into().map(|metres: f64| ((metres / voxel_m - 0.5) * 256.0).round())
    };
    let of_chunk = |chunk: &[P]| {
        let positions: Vec<[f64; 3]> = chunk.iter().map(position).collect();
        colours(&mut Reader::new(frame), &positions, depth)
    };
    points.par_chunks(CHUNK).flat_map_iter(of_chunk).collect()
}

/// The colours at positions, in 1/256 voxel. Neighbours in the list that lie in one block share its cells. `depth`: of the deepest block.
fn colours(reader: &mut Reader, positions: &[[f64; 3]], depth: u8) -> Vec<Rgb> {
    let mut colours = Vec::with_capacity(positions.len());
    let mut rest = positions;
    while let Some(first) = rest.first() {
        let block = first.map(|p| (p / BLOCK).floor());
        if !block.iter().all(|b| b.abs() < f64::from(isv_volume::COORD_LIMIT)) {
            colours.push(to_rgb(GREY));
            rest = &rest[1..];
            continue;
        }
        let from_block = |p: &[f64; 3]| [0, 1, 2].map(|axis| p[axis] - BLOCK * block[axis]);
        let is_in_block = |p: &&[f64; 3]| from_block(p).iter().all(|p| (0.0..BLOCK).contains(p));
        let run;
        (run, rest) = rest.split_at(rest.iter().take_while(is_in_block).count());
        reader.turn_to(BlockCoord::from(block.map(|b| b as i32)));
        if run.len() >= SHARING {
            let depth = reader.depth_at([0; 3], depth);
            reader.hold([-1; 3], [9; 3], depth);
        }
        vectorized(
            #[inline(always)]
            || {
                colours.extend(run.iter().map(
                    #[inline(always)]
                    |p| to_rgb(colour(reader, from_block(p).map(|p| p as i32), depth)),
                ));
            },
        );
    }
    colours
}

/// The colour at a position, in 1/256 voxel from the middle of the first voxel of the reader's origin.
#[inline(always)]
fn colour(reader: &mut Reader, position: [i32; 3], depth: u8) -> Sample {
    let voxel = position.map(|p| p >> 8);
    let normal = AROUND.iter().find_map(|step| reader.plane(sum(voxel, *step))).map(|surfel| surfel.normal);
    reader.read(position, normal.unwrap_or_default(), depth).unwrap_or(GREY)
}

impl ColourFrame {
    /// The samples of a frame as colours seen at its surface: what another stream is encoded from.
    #[must_use]
    pub fn to_samples(&self, grid: &Grid) -> Vec<ColourSample> {
        let voxel_m = grid.voxel_size.metres();
        let of_block = |tree: &mut BlockTree, block: usize| {
            self.shape.build_tree(block, tree);
            let depth = self.shape.depths()[block];
            let origin = self.shape.cells().coords()[block].to_array().map(|c| f64::from(c) * 8.0 + 0.5);
            let samples = &self.layers[usize::from(depth)][self.shape.block_samples(block, depth)];
            let surfels = self.shape.cells().block_surfels(block);
            let leaves: Vec<ColourSample> = tree
                .leaf_slots()
                .zip(tree.leaf_places())
                .map(|(slot, place)| {
                    let surfel = &surfels[slot >> (3 * depth)];
                    let voxel = position(usize::from(place) >> (3 * depth)).map(|v| v as f64);
                    let inner = match depth {
                        0 => [0.5; 3],
                        _ => wide_position(slot & ((1 << (3 * depth)) - 1))
                            .map(|p| (p as f64 + 0.5) / f64::from(1 << depth)),
                    };
                    let normal = surfel.normal.map(|n| f64::from(n) / 127.0);
                    let height: f64 = (0..3)
                        .map(|axis| {
                            (inner[axis] - 0.5 - f64::from(surfel.offset[axis]) / 256.0) * normal[axis]
                        })
                        .sum();
                    let position = [0, 1, 2].map(|axis| {
                        let voxels = origin[axis] + voxel[axis] + inner[axis] - height * normal[axis];
                        (voxels * voxel_m) as f32
                    });
                    let colour = to_rgb(samples[slot]).map(f32::from);
                    ColourSample { position, normal: normal.map(|n| n as f32), colour, weight: 1.0 }
                })
                .collect();
            leaves
        };
        (0..self.shape.depths().len())
            .into_par_iter()
            .map_init(BlockTree::default, of_block)
            .flatten_iter()
            .collect()
    }
}
