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
//! assert!(volume.samples().iter().any(|s| *s < 0));
//! ```
//!
//! How it works, by private module. `tiles` lists the triangles that matter in each cube of 4 x 4 x 4 blocks; `topology` says
//! how faces, edges and vertices hang together, and `cells` where each of them can be the closest part of the mesh. `descent`
//! goes down from a tile to the voxels in each cell, eight at a time, and measures. `regions` spreads each winding number over
//! all voxels that are certain to share it, and `sampler` puts the samples of a tile together. `holes` finds the openings that
//! must stay open, `caps` removes what the winding number would still close there, and `rim` trims teeth and specks off the
//! surface's ends; `sign` tells open from closed surfaces, and `limits` refuses what cannot be done.
//! Point clouds take a way of their own, in `points`: [`estimate_normals`] if they have none, [`decide_point_sign`],
//! [`ingest_points`].

mod caps;
mod cells;
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
use cells::Directions;
use holes::WideHoles;
use isv_spatial::WindingNumber;
use isv_volume::{Grid, SparseVolume, TriangleMesh};
use rayon::prelude::*;
use sampler::{Sign, Source, Workspace, sample_tile};
use std::sync::{Mutex, PoisonError};
use tiles::{Band, TileList};
use topology::Topology;

/// Blocks a volume may have by default: 2 GiB of samples with blocks of 8 voxels.
pub const DEFAULT_BLOCK_LIMIT: usize = 1 << 21;

/// The offset of Eq. 9 by default, in voxels: a shell three voxels thick, which marching cubes cannot miss.
const DEFAULT_OFFSET: f64 = 1.5;

/// Tiles whose blocks are held apart from the volume at one time.
const TILES_AT_ONCE: usize = 256;

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
}

impl MeshIngest {
    /// The defaults on a grid: automatic sign, an offset of 1.5 voxels, [`DEFAULT_BLOCK_LIMIT`].
    #[must_use]
    pub fn new(grid: Grid) -> Self {
        Self { grid, sign: SignMode::Auto, offset_voxels: DEFAULT_OFFSET, max_blocks: DEFAULT_BLOCK_LIMIT }
    }
}

/// Samples the distance field of a mesh (Eq. 1, 2, 7 to 9) in all blocks with an observed voxel in the band.
///
/// Distances are exact to 1/1000 of a voxel before they are rounded to codes. With [`SignDecision::Closed`], voxels whose
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
    let voxel_mesh = limits::in_voxels(mesh, settings.grid.voxel_size.metres());
    let list = limits::list_tiles(mesh, &voxel_mesh, settings, offset)?;
    let closed = matches!(sign, SignDecision::Closed { .. });
    let connect = || {
        let topology = Topology::of(&voxel_mesh);
        let holes = if closed { WideHoles::find(&voxel_mesh, &topology) } else { None };
        (topology, holes)
    };
    let ((topology, holes), (directions, winding)) = rayon::join(connect, || {
        rayon::join(|| Directions::of(&voxel_mesh), || closed.then(|| WindingNumber::new(mesh)))
    });
    let sign = match winding {
        Some(winding) => Sign::Closed(winding, holes),
        None => Sign::Offset(offset as f32),
    };
    Ok(sample(&Source { grid: settings.grid, band, mesh: voxel_mesh, topology, directions, sign }, &list))
}

/// Samples all tiles.
fn sample(source: &Source, list: &TileList) -> SparseVolume {
    let mut blocks = Blocks::default();
    let workspaces = Mutex::new(Vec::new());
    for tiles in list.tiles().chunks(TILES_AT_ONCE) {
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
    blocks.open_caps(source);
    blocks.trim_rims(source.grid.edge);
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
