//! Refusing what cannot be done, before it costs anything, and saying what could be.

use crate::points::cubes::{boxes, reached};
use crate::tiles::{Band, OverLimit, TILE_BLOCKS, TileList, VoxelMesh, count_blocks};
use crate::{IngestError, MeshIngest, PointIngest, PointSign, SignDecision};
use glam::DVec3;
use isv_volume::{FitError, Grid, PointCloud, TriangleMesh};
use std::borrow::Cow;

/// The offset in voxels: that of the settings for an open surface, zero for a closed one.
pub(crate) fn check_offset(settings: &MeshIngest, sign: SignDecision) -> Result<f64, IngestError> {
    match sign {
        SignDecision::Closed { .. } | SignDecision::Sheet => Ok(0.0),
        SignDecision::Offset => offset_in_band(settings.offset_voxels, &settings.grid),
    }
}

/// Offset of points (voxels): that of the settings for points without sides, zero for oriented ones.
pub(crate) fn check_points_offset(settings: &PointIngest, sign: PointSign) -> Result<f64, IngestError> {
    match sign {
        PointSign::Oriented => Ok(0.0),
        PointSign::Offset => offset_in_band(settings.offset_voxels, &settings.grid),
    }
}

/// An offset, if both sides of the shell are inside the truncation band.
fn offset_in_band(voxels: f64, grid: &Grid) -> Result<f64, IngestError> {
    let truncation = grid.truncation.voxels();
    let fits = voxels > 0.0 && voxels <= f64::from(truncation);
    if fits { Ok(voxels) } else { Err(IngestError::Offset { voxels, truncation }) }
}

/// Refuses meshes that reach beyond the range of block coordinates.
pub(crate) fn check_range(mesh: &TriangleMesh, grid: &Grid, offset: f64) -> Result<(), IngestError> {
    check_bounds(mesh.bounds(), grid, offset, grid.edge.voxels())
}

/// Refuses points that reach beyond the range of block coordinates, or of `cubes` of that many voxels, into
/// which they are also sorted.
pub(crate) fn check_points_range(
    cloud: &PointCloud,
    grid: &Grid,
    offset: f64,
    cubes: usize,
) -> Result<(), IngestError> {
    check_bounds(cloud.bounds(), grid, offset, cubes.min(grid.edge.voxels()))
}

/// Refuses bounds that reach beyond what coordinates of cubes of that many voxels can address.
fn check_bounds(
    bounds: Option<(DVec3, DVec3)>,
    grid: &Grid,
    offset: f64,
    cube: usize,
) -> Result<(), IngestError> {
    let Some((lo, hi)) = bounds else { return Ok(()) };
    let farthest = lo.abs().max(hi.abs()).max_element();
    let margin = f64::from(grid.truncation.voxels()) + offset;
    // One tile is kept clear at the end of the range, so that no tile begins outside it.
    Ok(grid.check_range(farthest, margin, cube, TILE_BLOCKS)?)
}

/// The mesh with the voxel edge as unit.
pub(crate) fn in_voxels(mesh: &TriangleMesh, voxel_m: f64) -> VoxelMesh<'_> {
    VoxelMesh {
        vertices: mesh.vertices.iter().map(|v| *v / voxel_m).collect(),
        triangles: Cow::Borrowed(&mesh.triangles),
    }
}

/// Lists the triangles of all tiles, or says which voxel size stays within the block limit.
pub(crate) fn list_tiles(
    mesh: &TriangleMesh,
    voxel_mesh: &VoxelMesh,
    settings: &MeshIngest,
    band: &Band,
) -> Result<TileList, IngestError> {
    let limit = settings.max_blocks;
    if let Ok(list) = TileList::build(voxel_mesh, band, limit)
        && count_blocks(voxel_mesh, band, &list.tiles(), limit) <= limit
    {
        return Ok(list);
    }
    let count = |voxel_m| count_at(mesh, voxel_m, band, limit);
    Err(FitError::too_many_blocks(&settings.grid, limit, mesh.area(), count).into())
}

/// Refuses meshes whose holes are so wide that the triangles that close them alone would take more blocks
/// than allowed. Says at which voxel size they would not.
pub(crate) fn check_closing(
    mesh: &VoxelMesh,
    closing: &[[u32; 3]],
    settings: &MeshIngest,
) -> Result<(), IngestError> {
    let doubled = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|vertex| mesh.vertices[vertex as usize]);
        (b - a).cross(c - a).length()
    };
    let (voxel_m, limit) = (settings.grid.voxel_size.metres(), settings.max_blocks);
    let area_m2 = 0.5 * closing.iter().map(doubled).sum::<f64>() * voxel_m * voxel_m;
    let count = |voxel_m: f64| {
        let blocks = area_m2 / (voxel_m * settings.grid.edge.voxels() as f64).powi(2);
        (blocks <= limit as f64).then_some(blocks as usize)
    };
    match count(voxel_m) {
        Some(_) => Ok(()),
        None => Err(FitError::too_many_blocks(&settings.grid, limit, area_m2, count).into()),
    }
}

/// Refuses points around which more blocks than allowed have voxels within `width` voxels.
pub(crate) fn check_points_blocks(
    cloud: &PointCloud,
    settings: &PointIngest,
    width: f64,
) -> Result<(), IngestError> {
    let (edge, limit) = (settings.grid.edge.voxels(), settings.max_blocks);
    let count = |voxel_m: f64| {
        let points: Vec<DVec3> = cloud.positions.iter().map(|p| *p / voxel_m).collect();
        reached(&boxes(&points, edge), edge, width, limit).map(|blocks| blocks.len())
    };
    match count(settings.grid.voxel_size.metres()) {
        Some(_) => Ok(()),
        None => Err(FitError::too_many_blocks(&settings.grid, limit, 0.0, count).into()),
    }
}

/// Number of blocks at a voxel size, if within the limit.
fn count_at(mesh: &TriangleMesh, voxel_m: f64, band: &Band, limit: usize) -> Option<usize> {
    let mesh = in_voxels(mesh, voxel_m);
    let list = TileList::build(&mesh, band, limit).map_err(|OverLimit| ()).ok()?;
    Some(count_blocks(&mesh, band, &list.tiles(), 0)).filter(|blocks| *blocks <= limit)
}
