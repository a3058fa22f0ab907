//! Point clouds to sparse TSDF volumes (paper Sec. 3.2).
//!
//! Points with normals become surfels, small discs as wide as the points are apart (`surfels`). Near them the
//! distance is a smooth blend of the heights over their planes (`near`), taken back to where points were
//! captured (`ends`). The sites are where that field crosses zero (`sites`). Everywhere else in the band the
//! distance is that to the closest site (`closest`). The field tells its side (`samples`), and neighbours
//! must agree on it (`sides`). Points without normals are sites themselves, and the sample is their unsigned
//! distance less the offset.

mod bricks;
mod closest;
pub(crate) mod cubes;
mod distinct;
mod eigen;
mod ends;
mod fit;
mod near;
mod normals;
mod orient;
mod parts;
mod samples;
mod sides;
mod sign;
mod sites;
mod surfels;

#[cfg(test)]
mod tests;

pub use fit::{PointSpacing, check_points_fit};
pub use normals::{estimate_normals, estimate_normals_seen_from};
pub use orient::{NormalSides, SideEvidence};
pub use sign::{PointEvidence, PointSign, decide_point_sign};

use crate::limits::{check_points_blocks, check_points_offset, check_points_range};
use crate::{DEFAULT_BLOCK_LIMIT, DEFAULT_OFFSET, IngestError, SignMode};
use bricks::{BRICK, Bricks, brick_centre};
use cubes::{boxes, reached};
use ends::NearField;
use glam::{DVec3, Vec3};
use isv_volume::{BlockCoord, BlockEdge, Grid, PointCloud, SparseVolume, round_up};
use near::{HEIGHT, near_field};
use samples::{Sign, Source, sample};
use sites::{Site, bare, crossings};
use surfels::{Merged, WIDEST_SPACING, merge, surfels};

/// Share of the points that must be close enough to others to make a surface.
const CONNECTED_SHARE: f64 = 0.1;

/// How point clouds become volumes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointIngest {
    /// The grid to sample on.
    pub grid: Grid,
    /// How to find the sign, for [`decide_point_sign`]; [`ingest_points`] takes what that decided.
    pub sign: SignMode,
    /// Delta of Eq. 9 in voxels, above 0 and at most the truncation.
    pub offset_voxels: f64,
    /// Clouds that need more blocks are refused.
    pub max_blocks: usize,
}

impl PointIngest {
    /// The defaults on a grid: automatic sign, an offset of 1.5 voxels, [`DEFAULT_BLOCK_LIMIT`].
    #[must_use]
    pub fn new(grid: Grid) -> Self {
        Self { grid, sign: SignMode::Auto, offset_voxels: DEFAULT_OFFSET, max_blocks: DEFAULT_BLOCK_LIMIT }
    }
}

/// Samples the distance field of a point cloud (Eq. 1, 2, 9 and Sec. 3.2) in all blocks with an observed voxel in the band.
///
/// With [`PointSign::Oriented`] the surface passes smoothly near the points, wherever they are at most 3
/// voxels apart. Points that are farther from all others, and points without a normal, are left out. Gaps of
/// up to 3 voxels, or 4 times the distance between points, are closed; voxels beyond the border of a wider
/// one are unobserved. With [`PointSign::Offset`] the distance is that to the points themselves, of which
/// those within half a voxel count as one. The result is the same for any number of threads.
///
/// # Errors
/// See [`IngestError`]; that there are too many blocks is found before memory for samples is taken.
pub fn ingest_points(
    cloud: &PointCloud,
    settings: &PointIngest,
    sign: PointSign,
) -> Result<SparseVolume, IngestError> {
    cloud.validate()?;
    let grid = settings.grid;
    let offset = check_points_offset(settings, sign)?;
    check_points_range(cloud, &grid, offset, BRICK)?;
    let width = f64::from(grid.truncation.voxels()) + offset;
    let voxel_m = grid.voxel_size.metres();
    let points: Vec<DVec3> = cloud.positions.iter().map(|p| *p / voxel_m).collect();
    let (sites, sign) = match sign {
        PointSign::Offset => {
            let merged = merge(&points, &[]);
            check_blocks(cloud, settings, width, &merged)?;
            (bare(&merged), Sign::Offset(offset as f32))
        }
        PointSign::Oriented => {
            if !cloud.normals.iter().any(|normal| *normal != DVec3::ZERO) {
                return Err(IngestError::NoNormals);
            }
            let merged = merge(&points, &cloud.normals);
            check_blocks(cloud, settings, width, &merged)?;
            let field = oriented_field(&merged, voxel_m)?;
            (crossings(&field), Sign::Oriented(field))
        }
    };
    let bricks = bricks_in_band(&sites, grid.edge, width);
    let mut blocks = sample(&Source { grid, width: width as f32, sites, sign }, &bricks);
    blocks.settle_sides(grid.edge);
    blocks.trim_rims(grid.edge);
    Ok(SparseVolume::from_parts(grid, blocks.coords, blocks.samples, blocks.masks))
}

/// Refuses points that need more blocks than allowed; counts them only if it could be.
fn check_blocks(
    cloud: &PointCloud,
    settings: &PointIngest,
    width: f64,
    merged: &[Merged],
) -> Result<(), IngestError> {
    let bricks = merged.chunk_by(|a, b| a.brick == b.brick).count();
    let around = (2 * (width / BRICK as f64).ceil() as usize + 1).pow(3);
    let blocks = if settings.grid.edge == BlockEdge::E4 { 8 } else { 1 };
    if bricks.saturating_mul(around * blocks) <= settings.max_blocks {
        return Ok(());
    }
    check_points_blocks(cloud, settings, width)
}

/// The field near oriented points.
fn oriented_field(merged: &[Merged], voxel_m: f64) -> Result<NearField, IngestError> {
    let (surfels, spacing) = surfels(merged);
    if (surfels.items.len() as f64) < CONNECTED_SHARE * merged.len() as f64 {
        return Err(IngestError::TooSparse {
            spacing_m: round_up(spacing * voxel_m),
            voxel_m,
            voxel_that_fits_m: round_up(spacing / WIDEST_SPACING * voxel_m),
        });
    }
    let reach = surfels.items.iter().map(|s| s.reach).fold(0.0, f32::max).hypot(HEIGHT);
    let positions = positions(surfels.iter().map(|(brick, surfel)| (brick, surfel.at)));
    Ok(NearField::new(near_field(&surfels, &cubes_within(&positions, BRICK, f64::from(reach)))))
}

/// The bricks with a voxel within `width` voxels of a site, and with blocks of 16 voxels all bricks of their blocks.
fn bricks_in_band(sites: &Bricks<Site>, edge: BlockEdge, width: f64) -> Vec<BlockCoord> {
    let cube = edge.voxels().max(BRICK);
    let cubes = cubes_within(&positions(sites.iter().map(|(brick, site)| (brick, site.at))), cube, width);
    if edge != BlockEdge::E16 {
        return cubes;
    }
    let octants = |block: &BlockCoord| {
        let first = block.to_array().map(|x| 2 * x);
        (0..8).map(move |o| BlockCoord::from(first).offset([o & 1, o >> 1 & 1, o >> 2]))
    };
    cubes.iter().flat_map(octants).collect()
}

fn cubes_within(points: &[DVec3], edge: usize, width: f64) -> Vec<BlockCoord> {
    reached(&boxes(points, edge), edge, width, usize::MAX).unwrap_or_default()
}

/// Positions in voxels.
fn positions<'a>(items: impl Iterator<Item = (BlockCoord, [f32; 3])> + 'a) -> Vec<DVec3> {
    items.map(|(brick, at)| brick_centre(brick) + Vec3::from(at).as_dvec3()).collect()
}
