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
/// Distance within which the surface is looked for around a point that does not lie on it, in voxels. Vertices of coarse and of
/// simplified meshes do not.
const REACH: i32 = 6;
/// Radius of the surface in a cell (1/256 voxel): half the cell's diagonal.
const CELL: f64 = 222.0;
/// Points of a block from which on it pays to take its cells together.
const SHARING: usize = 12;
/// Edge of a block in 1/256 voxel.
const BLOCK: f64 = 2048.0;
/// Cells around a point that are looked in, nearest first.
const AROUND: [[i32; 3]; 7] =
    [[0, 0, 0], [-1, 0, 0], [0, -1, 0], [0, 0, -1], [-1, -1, 0], [-1, 0, -1], [0, -1, -1]];

/// The sRGB colours of points on the surface of a frame, in metres: vertices of marching cubes, or points between them.
///
/// Positions are rounded to 1/256 of a voxel: the same points have the same colours on every machine. A point beside the surface has
/// the colour of the place there that is about the nearest. A point that no coloured surface is near is grey.
#[must_use]
pub fn surface_colours<P: Copy + Into<[f64; 3]> + Sync>(
    frame: &ColourFrame,
    grid: &Grid,
    points: &[P],
) -> Vec<Rgb> {
    let grey = to_rgb(GREY);
    colours_near(frame, grid, points).into_iter().map(|colour| colour.unwrap_or(grey)).collect()
}

/// The colours as [`surface_colours`] has them; `None` for points that no coloured surface is near.
#[must_use]
pub fn colours_near<P: Copy + Into<[f64; 3]> + Sync>(
    frame: &ColourFrame,
    grid: &Grid,
    points: &[P],
) -> Vec<Option<Rgb>> {
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
fn colours(reader: &mut Reader, positions: &[[f64; 3]], depth: u8) -> Vec<Option<Rgb>> {
    let mut colours = Vec::with_capacity(positions.len());
    let mut rest = positions;
    while let Some(first) = rest.first() {
        let block = first.map(|p| (p / BLOCK).floor());
        if !block.iter().all(|b| b.abs() < f64::from(isv_volume::COORD_LIMIT)) {
            colours.push(None);
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
                    |p| colour(reader, from_block(p).map(|p| p as i32), depth).map(to_rgb),
                ));
            },
        );
    }
    colours
}

/// The colour at a position, in 1/256 voxel from the middle of the first voxel of the reader's origin, or beside it.
#[inline(always)]
fn colour(reader: &mut Reader, mut position: [i32; 3], depth: u8) -> Option<Sample> {
    let mut is_beside = false;
    // One place in the code that reads: it is large.
    loop {
        let voxel = position.map(|p| p >> 8);
        let surfel = AROUND.iter().find_map(|step| reader.plane(sum(voxel, *step)));
        let normal = surfel.map(|surfel| surfel.normal).unwrap_or_default();
        let found = reader.read(position, normal, depth);
        if found.is_some() || is_beside {
            return found;
        }
        position = place_beside(reader, position)?;
        is_beside = true;
    }
}

/// The place of the surface that is about the nearest to a position, within [`REACH`].
#[inline(never)]
fn place_beside(reader: &mut Reader, position: [i32; 3]) -> Option<[i32; 3]> {
    let home = position.map(|p| p >> 8);
    let mut best: Option<(f64, [i32; 3])> = None;
    for reach in 0..=REACH {
        // What lies in cells farther out is farther away than what was found.
        if best.is_some_and(|(squared, _)| squared <= f64::from(256 * (reach - 1)).powi(2)) {
            break;
        }
        for step in shell(reach) {
            let voxel = sum(home, step);
            let Some(surfel) = reader.plane(voxel) else { continue };
            // The plane of the cell's surface, as far as it goes in the cell.
            let within =
                [0, 1, 2].map(|axis| f64::from(256 * voxel[axis] + 128) + f64::from(surfel.offset[axis]));
            let normal = surfel.normal.map(|n| f64::from(n) / 127.0);
            let aside = [0, 1, 2].map(|axis| f64::from(position[axis]) - within[axis]);
            let height = dot(aside, normal);
            let along = [0, 1, 2].map(|axis| aside[axis] - height * normal[axis]);
            let shorter = (CELL / dot(along, along).sqrt()).min(1.0);
            let onto = [0, 1, 2].map(|axis| within[axis] + shorter * along[axis]);
            let apart = [0, 1, 2].map(|axis| onto[axis] - f64::from(position[axis]));
            let squared = dot(apart, apart);
            if best.is_none_or(|(least, _)| squared < least) {
                best = Some((squared, onto.map(|o| o.round() as i32)));
            }
        }
    }
    best.map(|(_, onto)| onto)
}

/// The steps to cells of which the largest coordinate is a distance away.
fn shell(distance: i32) -> impl Iterator<Item = [i32; 3]> {
    let along = move || -distance..=distance;
    along().flat_map(move |z| {
        along().flat_map(move |y| {
            // Inside of the other two faces there are but the ends of the row.
            let is_row = z.abs() == distance || y.abs() == distance;
            along().step_by(if is_row { 1 } else { (2 * distance).max(1) as usize }).map(move |x| [x, y, z])
        })
    })
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| a[axis] * b[axis]).sum()
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
