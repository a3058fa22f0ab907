//! Meshes and point clouds to sparse TSDF volumes (paper Sec. 3.2, explicit surface conversion).
//!
//! Every voxel within the truncation band of a triangle gets the exact distance to the closest triangle (Eq. 7), signed
//! by the generalized winding number where the surface is closed (Eq. 8) or lowered by a constant where it is not
//! (Eq. 9). Work and memory grow with the area of the surface, never with the volume of its bounding box.
//!
//! ```
//! use isv_ingest::{MeshIngest, SignMode, decide_sign, ingest_mesh};
//! use isv_volume::{BlockEdge, Grid, TriangleMesh, Truncation, VoxelSize};
//!
//! let mesh = TriangleMesh {
//!     vertices: vec![[0., 0., 0.].into(), [1., 0., 0.].into(), [0., 1., 0.].into(), [0., 0., 1.].into()],
//!     normals: Vec::new(),
//!     triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
//! };
//! let settings = MeshIngest::new(Grid {
//!     voxel_size: VoxelSize::from_metres(0.02).unwrap(),
//!     edge: BlockEdge::E8,
//!     truncation: Truncation::from_voxels(8).unwrap(),
//! });
//! let (decision, evidence) = decide_sign(&mesh, settings.sign);
//! println!("{decision} ({:.0} % of the surface looks closed)", 100.0 * evidence.closed_share);
//! let volume = ingest_mesh(&mesh, &settings, decision).unwrap();
//! assert!(volume.samples().any(|s| s < 0));
//! ```
//!
//! How it works, by private module. `tiles` lists the triangles that matter in each cube of 4 x 4 x 4 blocks; `topology` says
//! how faces, edges and vertices hang together, and `cells` where each of them can be the closest part of the mesh. `descent`
//! goes down from a tile to the voxels in each cell, eight at a time, and measures. Where only the surface is wanted, `scatter`
//! measures near it, triangle by triangle, and `continuation` goes on from there. `regions` spreads each winding number over
//! all voxels that are certain to share it, and `sampler` puts the samples of a tile together. `boundary` finds the edges with
//! one face, `holes` the openings that must stay open, `caps` removes what the winding number would still close there, and
//! `rim` trims teeth and specks off the surface's ends; `sign` tells open from closed surfaces, and `limits` refuses what
//! cannot be done.
//! Point clouds take a way of their own, in `points`: [`estimate_normals`] if they have none, [`decide_point_sign`],
//! [`ingest_points`].

mod boundary;
mod caps;
mod cells;
mod continuation;
mod descent;
mod error;
mod faces;
mod holes;
mod limits;
mod lost;
mod points;
mod regions;
mod rim;
mod sampler;
mod scatter;
mod sign;
mod tiles;
mod topology;

#[cfg(test)]
mod tests;

pub use error::IngestError;
pub use lost::lost_share;
pub use points::{PointEvidence, PointIngest, PointSign, decide_point_sign, estimate_normals, ingest_points};
pub use sign::{SignDecision, SignEvidence, SignMode, decide_sign};

use caps::Blocks;
use glam::IVec3;
use holes::WideHoles;
use isv_spatial::WindingNumber;
use isv_volume::{BlockEdge, Grid, SparseVolume, TriangleMesh};
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use sampler::{Connections, Sign, Source, Workspace, sample_tile};
use std::borrow::Cow;
use std::sync::{Mutex, PoisonError};
use tiles::{Band, Measure, Tile, TileList, VoxelMesh};
use tracing::debug_span;

/// Blocks a volume may have by default: 2 GiB of samples with blocks of 8 voxels.
pub const DEFAULT_BLOCK_LIMIT: usize = 1 << 21;

/// The offset of Eq. 9 by default, in voxels: a shell three voxels thick, which marching cubes cannot miss.
const DEFAULT_OFFSET: f64 = 1.5;

/// In voxels, more than the length of a cell's diagonal: a voxel that far from the surface has only neighbours on its side.
const CELL_DIAGONAL: f64 = 1.75;

/// Tiles whose blocks are held apart from the volume at one time.
const TILES_AT_ONCE: usize = 256;

/// How far from the surface a volume has blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reach {
    /// Wherever a voxel is in the truncation band. Distances are exact in all of it.
    #[default]
    Band,
    /// Where a voxel is within a voxel's diagonal of the surface: the blocks that hold the surface and the corners of the cells
    /// that it passes through, which is all that profile `main` codes unless it is told to code the band. Distances are exact up to
    /// there; farther from the surface they are only about right. Several times as fast. Blocks of other edges than 8, which that
    /// profile does not have, get the band.
    Surface,
}

/// How meshes become volumes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshIngest {
    /// The grid to sample on.
    pub grid: Grid,
    /// How to find the sign, for [`decide_sign`]; [`ingest_mesh`] takes what that decided.
    pub sign: SignMode,
    /// Delta of Eq. 9 in voxels, above 0 and at most the truncation.
    pub offset_voxels: f64,
    /// Meshes that need more blocks are refused.
    pub max_blocks: usize,
    /// How far from the surface there are to be blocks.
    pub reach: Reach,
}

impl MeshIngest {
    /// The defaults on a grid: automatic sign, an offset of 1.5 voxels, [`DEFAULT_BLOCK_LIMIT`].
    #[must_use]
    pub fn new(grid: Grid) -> Self {
        Self {
            grid,
            sign: SignMode::Auto,
            offset_voxels: DEFAULT_OFFSET,
            max_blocks: DEFAULT_BLOCK_LIMIT,
            reach: Reach::Band,
        }
    }
}

/// Samples the distance field of a mesh (Eq. 1, 2, 7 to 9) in all blocks with an observed voxel in the band.
///
/// Distances are exact to 1/1000 of a voxel before they are rounded to codes, as far as [`Reach`] says. With [`SignDecision::Closed`], voxels whose
/// closest surface point lies on the edge of a hole wider than 3 voxels are unobserved; narrower holes are closed. What
/// belongs to nothing closed is lost: see [`lost_share`]. Faces without area are left out. The result is the same for any number
/// of threads.
///
/// # Errors
/// See [`IngestError`]; all of them are found before memory for samples is taken.
pub fn ingest_mesh(
    mesh: &TriangleMesh,
    settings: &MeshIngest,
    sign: SignDecision,
) -> Result<SparseVolume, IngestError> {
    mesh.validate()?;
    let mesh = &*faces::with_area(mesh);
    mesh.validate()?;
    let offset = limits::check_offset(settings, sign)?;
    limits::check_range(mesh, &settings.grid, offset)?;
    let band = Band::new(&settings.grid, offset);
    let reach = if settings.grid.edge == BlockEdge::E8 { settings.reach } else { Reach::Band };
    let near = match reach {
        Reach::Band => band,
        Reach::Surface => band.within(offset + CELL_DIAGONAL),
    };
    let voxel_mesh = limits::in_voxels(mesh, settings.grid.voxel_size.metres());
    let list =
        debug_span!("ingest tiles").in_scope(|| limits::list_tiles(mesh, &voxel_mesh, settings, &near))?;
    let closed = matches!(sign, SignDecision::Closed { .. });
    let find_holes = || if closed { WideHoles::find(&voxel_mesh) } else { None };
    let find_winding = || closed.then(|| WindingNumber::new(mesh));
    let (holes, winding) =
        debug_span!("ingest holes and winding numbers").in_scope(|| rayon::join(find_holes, find_winding));
    let exact_list;
    let (tiles, connections) = match (reach, holes) {
        (Reach::Band, holes) => {
            let connections = Connections::new(Cow::Borrowed(&voxel_mesh), holes);
            (list.tiles(Measure::Exact), Some(connections))
        }
        (Reach::Surface, None) => (list.tiles(Measure::Scatter), None),
        (Reach::Surface, Some(holes)) => {
            let (beside, connections) = debug_span!("ingest beside holes")
                .in_scope(|| beside_holes(&voxel_mesh, &holes, [&near, &band]));
            exact_list = beside;
            (replace(list.tiles(Measure::Scatter), exact_list.tiles(Measure::Exact)), Some(connections))
        }
    };
    let sign = match winding {
        Some(winding) => Sign::Closed(winding),
        None => Sign::Offset(offset as f32),
    };
    Ok(sample(&Source { grid: settings.grid, band, near, mesh: &voxel_mesh, connections, sign }, &tiles))
}

/// The tiles near wide holes with what is to be known to measure them exactly, which is where what is unobserved ends.
fn beside_holes<'a>(mesh: &VoxelMesh, holes: &WideHoles, bands: [&Band; 2]) -> (TileList, Connections<'a>) {
    let touching: Vec<u32> =
        (0..mesh.triangles.len() as u32).filter(|face| holes.touch(mesh, *face)).collect();
    let mut list = TileList::around(mesh, bands, &touching);
    let faces = list.faces();
    list.renumber(&faces);
    let (part, vertices) = mesh.part(&faces);
    (list, Connections::new(Cow::Owned(part), Some(holes.part(&faces, &vertices))))
}

/// Takes tiles of another list in place of those at the same coordinates. Both are in Morton order.
fn replace<'a>(tiles: Vec<Tile<'a>>, others: Vec<Tile<'a>>) -> Vec<Tile<'a>> {
    let others: FxHashMap<IVec3, Tile> = others.into_iter().map(|tile| (tile.coord, tile)).collect();
    tiles.into_iter().map(|tile| others.get(&tile.coord).copied().unwrap_or(tile)).collect()
}

/// Samples all tiles.
fn sample(source: &Source, tiles: &[Tile]) -> SparseVolume {
    let mut blocks = Blocks::default();
    let workspaces = Mutex::new(Vec::new());
    for tiles in tiles.chunks(TILES_AT_ONCE) {
        let _span = debug_span!("ingest samples").entered();
        let parts: Vec<_> = tiles
            .par_iter()
            .map(|tile| with_workspace(&workspaces, |work| sample_tile(source, tile, work)))
            .collect();
        blocks.samples.reserve(parts.iter().map(|part| part.samples.len()).sum());
        for part in parts {
            let before = blocks.coords.len();
            blocks.masks.extend(part.masks.into_iter().map(|(at, mask)| ((before + at) as u32, mask)));
            blocks.coords.extend(part.coords);
            blocks.samples.extend_from_slice(&part.samples);
        }
    }
    debug_span!("ingest rims").in_scope(|| {
        blocks.open_caps(source);
        blocks.trim_rims(source.grid.edge);
    });
    SparseVolume::from_parts(source.grid, blocks.coords, blocks.samples, blocks.masks)
}

/// Lends an idle workspace, so that there are never more than threads: rayon makes one for each part that it splits work into.
fn with_workspace<T>(idle: &Mutex<Vec<Workspace>>, run: impl FnOnce(&mut Workspace) -> T) -> T {
    let lock = || idle.lock().unwrap_or_else(PoisonError::into_inner);
    let mut work = lock().pop().unwrap_or_default();
    let done = run(&mut work);
    lock().push(work);
    done
}
