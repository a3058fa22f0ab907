//! Meshes and point clouds to sparse TSDF volumes (paper Sec. 3.2, explicit surface conversion).
//!
//! Every voxel within the truncation band of a triangle gets the distance to the closest triangle (Eq. 7).
//! The distance is exact in all of the band or, where only the surface is wanted, near it ([`Reach`]). On a
//! closed surface its sign tells how often the surface winds around the voxel, counted along rows of voxels
//! (Eq. 8). Open parts are single sheets, signed by side ([`SignDecision::Sheet`]); or distances to an open
//! mesh are lowered by a constant (Eq. 9, [`SignDecision::Offset`]). Work and memory grow with the area of
//! the surface, never with the volume of its bounding box.
//!
//! ```
//! use isv_ingest::{MeshIngest, SignMode, decide_sign, ingest_mesh};
//! use isv_volume::{BlockEdge, Grid, TriangleMesh, Truncation, VoxelSize};
//!
//! let mesh = TriangleMesh {
//!     vertices: vec![[0., 0., 0.].into(), [1., 0., 0.].into(), [0., 1., 0.].into(), [0., 0., 1.].into()],
//!     normals: Vec::new(),
//!     appearance: None,
//!     triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
//! };
//! let settings = MeshIngest::new(Grid {
//!     voxel_size: VoxelSize::from_metres(0.02).unwrap(),
//!     edge: BlockEdge::E8,
//!     truncation: Truncation::DEFAULT,
//! });
//! let (decision, evidence) = decide_sign(&mesh, settings.sign);
//! println!("{decision} ({:.0} % of the surface looks closed)", 100.0 * evidence.closed_share);
//! let volume = ingest_mesh(&mesh, &settings, decision).unwrap();
//! assert!(volume.samples().any(|s| s < 0));
//! ```
//!
//! How it works, by private module. `tiles` lists the triangles that matter in each cube of 4 x 4 x 4 blocks.
//! Where only the surface is wanted, `scatter` measures near it, triangle by triangle (`facet`), and
//! `continuation` goes on from there. In the whole band, `topology` says how faces, edges and vertices hang
//! together. `cells` says where each of them can be the closest part of the mesh. `descent` goes down from a
//! tile to the voxels in each cell, eight at a time, and measures. `boundary` finds where a mesh is not
//! closed, and `closure` closes it. `crossings` counts its winding numbers along rows of voxels; `sides`
//! holds what is inside. `holes` finds the openings that must stay open, and `rims` the voxels that are
//! closest to their edges. `caps` removes what the winding number would still close there, and `trim` takes
//! teeth and specks off the surface's ends. `edges` lists all faces at each edge, `parts` finds parts without
//! inside, and `sheets` on which side of them a voxel is. `sheet_block` measures where they are near, eight
//! voxels at a time, `sheet_tile` one by one. `false_crossings` takes away sign changes between them. `sign`
//! tells open from closed surfaces, `lost_surface` what a volume does not show, and `limits` refuses what
//! cannot be done. `sampler` puts the samples of a tile together. `scene` holds what a frame is made of.
//! `reuse` finds what of it is as it was in the frame before, and `ingester` puts volumes together. Who
//! samples elsewhere, as a GPU does, begins and ends with a `job`, which hands out the mesh on a `lattice`.
//! Point clouds take a way of their own, in `points`: [`estimate_normals`] if they have none,
//! [`decide_point_sign`], [`ingest_points`].

mod boundary;
mod caps;
mod cells;
mod closure;
mod coded_field;
mod colours;
mod continuation;
mod crossings;
mod descent;
mod edges;
mod error;
mod faces;
mod facet;
mod false_crossings;
mod holes;
mod ingester;
mod job;
mod lattice;
mod limits;
mod lost_surface;
mod orientation;
mod parts;
mod points;
mod redistance;
mod reuse;
mod rims;
mod sampler;
mod scatter;
mod scene;
mod sheet_block;
mod sheet_tile;
mod sheets;
mod sides;
mod sign;
mod tiles;
mod topology;
mod trim;

#[cfg(test)]
mod tests;

pub use coded_field::coded_field;
pub use colours::{
    ColourMemory, SeenColour, SurfacePoint, level_weights, mesh_colours, point_colours, seen_colours,
    view_colours,
};
pub use error::IngestError;
pub use ingester::MeshIngester;
pub use job::MeshJob;
pub use lattice::{LONGEST_EDGE, LatticeMesh};
pub use lost_surface::lost_surface_share;
pub use orientation::{FaceTurner, turn_faces};
pub use points::{
    NormalSides, PointEvidence, PointIngest, PointSign, PointSpacing, SideEvidence, check_points_fit,
    decide_point_sign, estimate_normals, estimate_normals_seen_from, ingest_points,
};
pub use redistance::redistance;
pub use sign::{SignDecision, SignEvidence, SignMode, decide_sign};

use isv_volume::{Grid, SparseVolume, TriangleMesh};

/// Blocks a volume may have by default: 2 GiB of samples with blocks of 8 voxels.
pub const DEFAULT_BLOCK_LIMIT: usize = 1 << 21;

/// The offset of Eq. 9 by default, in voxels: a shell three voxels thick, which marching cubes cannot miss.
const DEFAULT_OFFSET: f64 = 1.5;

/// How far from the surface a volume has blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reach {
    /// Wherever a voxel is in the truncation band. Distances are exact in all of it.
    #[default]
    Band,
    /// The surface alone: blocks with a voxel within a voxel's diagonal of the surface. They hold the surface
    /// and the corners of the cells that it passes through. That is all that profile `main` codes unless it
    /// is told to code the band. Distances are exact up to there; farther from the surface they are only
    /// about right. Several times as fast. Blocks of other edges than 8, which that profile does not have,
    /// get the band.
    Surface,
}

/// How meshes become volumes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshIngest {
    /// The grid to sample on.
    pub grid: Grid,
    /// How to find the sign, for [`decide_sign`]; [`ingest_mesh`] and [`MeshIngester`] take what that decided.
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
/// Distances are exact to 1/1000 of a voxel before they are rounded to codes, as far as [`Reach`] says. With
/// [`SignDecision::Closed`], voxels whose closest surface point lies on the edge of a hole wider than 3
/// voxels are unobserved. That holds as far as distances are exact. Narrower holes are closed. What belongs
/// to nothing closed is lost: see [`lost_surface_share`]. Faces without area are left out. The result is the
/// same for any number of threads. Of the meshes of a sequence, [`MeshIngester`] makes the same, and takes
/// over what stands still.
///
/// # Errors
/// See [`IngestError`]; all of them are found before memory for samples is taken.
pub fn ingest_mesh(
    mesh: &TriangleMesh,
    settings: &MeshIngest,
    sign: SignDecision,
) -> Result<SparseVolume, IngestError> {
    ingester::volume_of(mesh, settings, sign)
}
