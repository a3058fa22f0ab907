//! Point clouds to sparse TSDF volumes (paper Sec. 3.2).

pub(crate) mod bricks;
mod closest;
mod ends;
mod near;
mod samples;
mod sides;
mod sites;
mod surfels;

use crate::{DEFAULT_BLOCK_LIMIT, DEFAULT_OFFSET, IngestError, SignMode};
use bricks::boxes;
use ends::NearField;
use glam::DVec3;
use isv_volume::{BlockCoord, BlockEdge, Grid, PointCloud, SparseVolume};
use near::{HEIGHT, near_field};
use samples::{Sign, Source, sample};
use sites::{bare, crossings};
use surfels::{merge, surfels};

/// How point clouds become volumes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointIngest {
    /// The grid to sample on.
    pub grid: Grid,
    /// How to find the sign.
    pub sign: SignMode,
    /// Delta of Eq. 9 in voxels, above 0 and at most the truncation.
    pub offset_voxels: f64,
    /// Clouds that need more blocks are refused.
    pub max_blocks: usize,
}

impl PointIngest {
    /// The defaults on a grid.
    #[must_use]
    pub fn new(grid: Grid) -> Self {
        Self { grid, sign: SignMode::Auto, offset_voxels: DEFAULT_OFFSET, max_blocks: DEFAULT_BLOCK_LIMIT }
    }
}

/// How the sign of the distance is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointSign {
    /// By normals.
    Oriented,
    /// Offset.
    Offset,
}

/// Samples.
///
/// # Errors
/// See [`IngestError`].
pub fn ingest_points(
    cloud: &PointCloud,
    settings: &PointIngest,
    sign: PointSign,
) -> Result<SparseVolume, IngestError> {
    cloud.validate().unwrap();
    let grid = settings.grid;
    let t0 = std::time::Instant::now();
    let tick = |name: &str| if std::env::var_os("TICK").is_some() { eprintln!("{name} {:.1}", t0.elapsed().as_secs_f64() * 1e3) };
    let points: Vec<DVec3> = cloud.positions.iter().map(|p| *p / grid.voxel_size.metres()).collect();
    let width = f64::from(grid.truncation.voxels());
    let (sites, sign, width) = match sign {
        PointSign::Offset => {
            (bare(&merge(&points, &[])), Sign::Offset(settings.offset_voxels as f32), width + settings.offset_voxels)
        }
        PointSign::Oriented => {
            let merged = merge(&points, &cloud.normals);
            tick("merge");
            let (surfels, spacing) = surfels(&merged);
            tick(&format!("surfels {} of {}, spacing {spacing}", surfels.items.len(), merged.len()));
            let reach = surfels.items.iter().map(|s| s.reach).fold(0.0, f32::max).hypot(HEIGHT);
            let candidates = bricks::reached(&boxes(&positions(&surfels), 8), 8, f64::from(reach), usize::MAX).unwrap();
            tick("candidates");
            let near = near_field(&surfels, &candidates);
            tick(&format!("near {} of {}", near.coords.len(), candidates.len()));
            let field = NearField::new(near);
            tick("ends");
            (crossings(&field), Sign::Oriented(field), width)
        }
    };
    tick(&format!("sites {}", sites.items.len()));
    let positions: Vec<DVec3> = (0..sites.coords.len())
        .flat_map(|b| {
            let c = bricks::brick_centre(sites.coords[b]);
            sites.list(b).iter().map(move |s| c + glam::Vec3::from(s.at).as_dvec3())
        })
        .collect();
    let cube = grid.edge.voxels().max(8);
    let mut active = bricks::reached(&boxes(&positions, cube), cube, width, settings.max_blocks).unwrap();
    if grid.edge == BlockEdge::E16 {
        active = active
            .iter()
            .flat_map(|c| (0..8).map(|o| BlockCoord::from([2 * c.x + (o & 1), 2 * c.y + (o >> 1 & 1), 2 * c.z + (o >> 2)])))
            .collect();
    }
    tick(&format!("active {}", active.len()));
    let source = Source { grid, width: width as f32, sites, sign };
    let mut blocks = sample(&source, &active);
    tick("sampled");
    blocks.settle_sides(grid.edge);
    tick("settled");
    blocks.trim_rims(grid.edge);
    tick("trimmed");
    Ok(SparseVolume::from_parts(grid, blocks.coords, blocks.samples, blocks.masks))
}

fn positions(surfels: &bricks::Bricks<surfels::Surfel>) -> Vec<DVec3> {
    (0..surfels.coords.len())
        .flat_map(|b| {
            let c = bricks::brick_centre(surfels.coords[b]);
            surfels.list(b).iter().map(move |s| c + glam::Vec3::from(s.at).as_dvec3())
        })
        .collect()
}
