//! Colours of points on a decoded surface, as users have them.

use super::frame::{ColourFrame, GREY, Sample};
use super::morton::{position, wide_position};
use super::reader::Reader;
use super::tree::BlockTree;
use super::ycbcr::to_rgb;
use isv_volume::{BlockCoord, ColourSample, Grid, Rgb};
use rayon::prelude::*;

/// Points that a thread works on at a time.
const CHUNK: usize = 1024;
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
    let of_chunk = |chunk: &[P]| {
        let mut reader = Reader::new(frame);
        let colours: Vec<Rgb> =
            chunk.iter().map(|point| to_rgb(colour(&mut reader, (*point).into(), voxel_m, depth))).collect();
        colours
    };
    points.par_chunks(CHUNK).flat_map_iter(of_chunk).collect()
}

fn colour(reader: &mut Reader, point_m: [f64; 3], voxel_m: f64, depth: u8) -> Sample {
    let at = point_m.map(|p| ((p / voxel_m - 0.5) * 256.0).round());
    let block = at.map(|p| (p / 2048.0).floor());
    if !block.iter().all(|b| b.abs() < f64::from(isv_volume::COORD_LIMIT)) {
        return GREY;
    }
    reader.turn_to(BlockCoord::from(block.map(|b| b as i32)));
    let position: [i32; 3] = std::array::from_fn(|axis| (at[axis] - 2048.0 * block[axis]) as i32);
    let voxel = position.map(|p| p >> 8);
    let found = AROUND.iter().find_map(|step| reader.cell([0, 1, 2].map(|axis| voxel[axis] + step[axis])));
    let normal = found.map_or([0; 3], |found| reader.surfel(found).normal);
    reader.read(position, normal, depth).unwrap_or(GREY)
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
