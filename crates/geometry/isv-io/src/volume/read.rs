//! From arrays to a volume.

use super::description::{Description, TsdfUnit};
use super::fill::fill_unobserved;
use super::npy::{Array, Wanted};
use super::{ArrayFlaw, COORDS, TSDF, VolumeError, WEIGHT};
use crate::regular_file;
use isv_volume::{
    BlockCoord, BlockEdge, CODES_PER_VOXEL, Grid, SparseVolume, Truncation, VoxelMask, VoxelSize,
};
use std::collections::BTreeMap;
use std::path::Path;

/// Grid that a folder's volume is on: the block edge of its arrays, and voxel size and truncation. These are
/// as given, else as its `grid.json` has them. A truncation that is no whole number of voxels is rounded up,
/// and brought into [`Truncation::RANGE`]; without any it is 8 voxels.
///
/// # Errors
/// See [`VolumeError`]; [`VolumeError::NoVoxelSize`] if nobody knows it.
pub fn volume_grid(
    folder: &Path,
    voxel_size: Option<VoxelSize>,
    truncation: Option<Truncation>,
) -> Result<Grid, VolumeError> {
    let description = Description::read(folder)?;
    let edge = Blocks::open(folder, TSDF, Wanted::Floats)?.edge;
    let in_folder = |cause| VolumeError::Grid { path: folder.to_owned(), cause };
    let voxel_size = match (voxel_size, description.voxel_size_m) {
        (Some(size), _) => size,
        (None, Some(metres)) => VoxelSize::from_metres(metres).map_err(in_folder)?,
        (None, None) => return Err(VolumeError::NoVoxelSize { path: folder.to_owned() }),
    };
    let truncation = truncation.map_or_else(
        || {
            let voxels = description.truncation_m.map_or(8.0, |metres| metres / voxel_size.metres());
            let (least, most) = (*Truncation::RANGE.start(), *Truncation::RANGE.end());
            // A nanometre more than a whole number is the rounding of two decimal fractions.
            let voxels = ((voxels - 1e-6).ceil() as u32).clamp(least, most);
            Truncation::from_voxels(voxels).map_err(in_folder)
        },
        Ok,
    )?;
    Ok(Grid { voxel_size, edge, truncation })
}

/// Reads a folder of arrays as a volume on `grid`, most simply the one of [`volume_grid`].
///
/// Distances are rounded to codes and clamped to the grid's truncation. Voxels whose distance is NaN or whose weight is
/// not above 0 are unobserved; blocks with no other voxels are left out. Blocks come in Morton order, whatever the order
/// of the file.
///
/// # Errors
/// See [`VolumeError`]. Memory is bounded by the size of the files.
pub fn read_volume(folder: &Path, grid: &Grid) -> Result<SparseVolume, VolumeError> {
    let description = Description::read(folder)?;
    let tsdf = Blocks::open(folder, TSDF, Wanted::Floats)?;
    check_grid(folder, &description, tsdf.edge, grid)?;
    let order = morton_order(folder, tsdf.count)?;
    let weight = match folder.join(WEIGHT).exists() {
        true => Some(Blocks::open(folder, WEIGHT, Wanted::Numbers)?),
        false => None,
    };
    if let Some(weight) = weight.as_ref().filter(|w| w.array.shape != tsdf.array.shape) {
        let (found, wanted) = (weight.array.shape.clone(), format!("that of {TSDF}, {:?}", tsdf.array.shape));
        return Err(in_file(folder, WEIGHT, ArrayFlaw::Shape { found, wanted }));
    }
    let scale = codes_per_unit(&description, grid);
    Ok(assemble(*grid, &order, &tsdf, weight.as_ref(), scale))
}

/// An array of blocks, `(n, edge, edge, edge)` or with a last axis of one channel.
struct Blocks {
    array: Array,
    edge: BlockEdge,
    count: usize,
}

impl Blocks {
    fn open(folder: &Path, name: &str, wanted: Wanted) -> Result<Self, VolumeError> {
        let array = open_array(folder, name, wanted)?;
        let (&[count, z, y, x] | &[count, z, y, x, 1]) = array.shape.as_slice() else {
            return Err(not_blocks(folder, name, array));
        };
        match BlockEdge::from_voxels(x.try_into().unwrap_or(u32::MAX)) {
            Ok(edge) if x == y && y == z => Ok(Self { array, edge, count }),
            _ => Err(not_blocks(folder, name, array)),
        }
    }

    /// The elements of a block.
    fn read(&self, block: usize, out: &mut [f64]) {
        self.array.read(block * self.edge.block_voxels(), out);
    }
}

fn not_blocks(folder: &Path, name: &str, array: Array) -> VolumeError {
    let wanted = "(n, edge, edge, edge) with an edge of 4, 8 or 16".to_owned();
    in_file(folder, name, ArrayFlaw::Shape { found: array.shape, wanted })
}

fn open_array(folder: &Path, name: &str, wanted: Wanted) -> Result<Array, VolumeError> {
    let path = folder.join(name);
    let bytes = regular_file::read(&path).map_err(|cause| VolumeError::Io { path, cause })?;
    Array::parse(bytes, wanted).map_err(|why| in_file(folder, name, why))
}

fn in_file(folder: &Path, name: &str, why: ArrayFlaw) -> VolumeError {
    VolumeError::Array { path: folder.join(name), why }
}

/// Refuses a grid that the arrays do not lie on; a truncation may always be asked for.
fn check_grid(
    folder: &Path,
    description: &Description,
    edge: BlockEdge,
    grid: &Grid,
) -> Result<(), VolumeError> {
    let other = |what, found: String, asked: String| VolumeError::OtherGrid {
        path: folder.to_owned(),
        what,
        found,
        asked,
    };
    if edge != grid.edge {
        return Err(other("the block edge", edge.voxels().to_string(), grid.edge.voxels().to_string()));
    }
    if let Some(metres) = description.voxel_size_m {
        let size = VoxelSize::from_metres(metres)
            .map_err(|cause| VolumeError::Grid { path: folder.to_owned(), cause })?;
        if size != grid.voxel_size {
            return Err(other(
                "the voxel size",
                format!("{metres} m"),
                format!("{} m", grid.voxel_size.metres()),
            ));
        }
    }
    Ok(())
}

/// Codes to one unit of the file's distances. Truncation distances of unknown length are the grid's.
fn codes_per_unit(description: &Description, grid: &Grid) -> f64 {
    let voxels_per_metre = 1.0 / grid.voxel_size.metres();
    let voxels = match description.tsdf_unit {
        TsdfUnit::Metre => voxels_per_metre,
        TsdfUnit::Voxel => 1.0,
        TsdfUnit::Truncation => description
            .truncation_m
            .map_or(f64::from(grid.truncation.voxels()), |metres| metres * voxels_per_metre),
    };
    voxels * f64::from(CODES_PER_VOXEL)
}

/// The blocks' coordinates in Morton order, each with its row.
fn morton_order(folder: &Path, blocks: usize) -> Result<Vec<(BlockCoord, usize)>, VolumeError> {
    let array = open_array(folder, COORDS, Wanted::Integers)?;
    if array.shape != [blocks, 3] {
        let wanted = format!("({blocks}, 3), one row a block of {TSDF}");
        return Err(in_file(folder, COORDS, ArrayFlaw::Shape { found: array.shape, wanted }));
    }
    let path = || folder.join(COORDS);
    let mut order = Vec::with_capacity(blocks);
    let mut row_values = [0.0; 3];
    for row in 0..blocks {
        array.read(3 * row, &mut row_values);
        // Saturates, so that what does not fit is still out of range.
        let coord = BlockCoord::from(row_values.map(|c| c as i32));
        if !coord.in_range() {
            return Err(VolumeError::OutOfRange { path: path(), row, coord: row_values.map(|c| c as i64) });
        }
        order.push((coord, row));
    }
    order.sort_unstable_by_key(|(coord, row)| (coord.morton(), *row));
    match order.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        Some(&[(coord, first), (_, second)]) => {
            Err(VolumeError::Duplicate { path: path(), rows: [first, second], coord: coord.to_array() })
        }
        _ => Ok(order),
    }
}

fn assemble(
    grid: Grid,
    order: &[(BlockCoord, usize)],
    tsdf: &Blocks,
    weight: Option<&Blocks>,
    scale: f64,
) -> SparseVolume {
    let voxels = grid.edge.block_voxels();
    let limit = f64::from(grid.truncation.codes());
    let (mut coords, mut samples, mut masks) = (Vec::new(), Vec::new(), BTreeMap::new());
    let (mut distances, mut weights) = (vec![0.0; voxels], vec![1.0; voxels]);
    for &(coord, row) in order {
        tsdf.read(row, &mut distances);
        if let Some(weight) = weight {
            weight.read(row, &mut weights);
        }
        let unobserved = find_unobserved(grid.edge, &distances, &weights);
        if unobserved.count() == voxels {
            continue;
        }
        let start = samples.len();
        // NaN becomes 0 and is filled below.
        samples.extend(distances.iter().map(|d| (d * scale).round().clamp(-limit, limit) as i16));
        if !unobserved.is_empty() {
            fill_unobserved(grid.edge, &mut samples[start..], &unobserved);
            masks.insert(coords.len() as u32, unobserved);
        }
        coords.push(coord);
    }
    SparseVolume::from_parts(grid, coords, samples, masks)
}

fn find_unobserved(edge: BlockEdge, distances: &[f64], weights: &[f64]) -> VoxelMask {
    let mut unobserved = VoxelMask::empty(edge);
    for (voxel, (distance, weight)) in distances.iter().zip(weights).enumerate() {
        if distance.is_nan() || weight.is_nan() || *weight <= 0.0 {
            unobserved.insert(voxel);
        }
    }
    unobserved
}
