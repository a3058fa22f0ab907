//! Sparse TSDF volumes to triangle meshes: marching cubes over the blocks of a
//! [`SparseVolume`](isv_volume::SparseVolume).
//!
//! A *cell* is the cube between eight neighbouring voxel centres. The surface crosses each cell whose corners
//! do not all have one sign. A table derived by code (`cases`) tells which triangles to put into it. The mesh
//! is indexed, with one vertex on each voxel edge the surface crosses. All cells around that edge share it,
//! inside blocks and across their borders. The mesh is oriented and has no cracks: away from cells that could
//! not be seen it is closed.
//!
//! ```
//! use isv_surface::{SurfaceOptions, extract_surface};
//! use isv_volume::{BlockEdge, Grid, Truncation, VolumeBuilder, VoxelSize};
//!
//! let grid = Grid {
//!     voxel_size: VoxelSize::from_metres(0.01).unwrap(),
//!     edge: BlockEdge::E8,
//!     truncation: Truncation::DEFAULT,
//! };
//! // One block, one voxel of it inside: an octahedron.
//! let mut samples = vec![256; 512];
//! samples[grid.edge.voxel_index(3, 3, 3)] = -256;
//! let mut builder = VolumeBuilder::new(grid);
//! builder.push([0, 0, 0].into(), samples, None);
//! let mesh = extract_surface(&builder.finish(), &SurfaceOptions { normals: true });
//! assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (6, 8));
//! ```
//!
//! # How it works
//!
//! 1. The signs of each block become bits, one word a row of voxels (`signs`). From these and those at the near sides of its
//!    neighbours follows which blocks the surface can cross. All that comes after looks at no others.
//! 2. Each such block, padded by one voxel of its neighbours (`window`), finds the crossing edges that start
//!    in it. A row takes a few word operations. The block keeps the edges as a bit set that also numbers them
//!    (`edges`), and lists its crossed cells (`chunk`).
//! 3. Running sums give each block its place in the output, and the blocks fill it in parallel (`fill`). They
//!    write vertices (`vertices`), their normals (`normals`), then triangles (`triangles`). Corners of
//!    triangles are looked up among the vertices of the block and of the near sides of its neighbours.
//!
//! Everything is in Morton order of blocks and voxel order within, so any number of threads gives the same mesh.
//!
//! [`SurfaceParts`] keeps the surface of a changing volume in parts, and extracts those again in which blocks changed.
//!
//! What it does not do: place vertices by anything but linear interpolation, keep sharp edges, or simplify.

mod band;
mod cases;
mod chunk;
mod edges;
mod extract;
mod fill;
mod normals;
mod parts;
mod sampling;
mod signs;
#[cfg(test)]
mod tests;
mod triangles;
mod vertices;
mod window;

pub use band::surface_band;
pub use cases::case_triangles;
pub use extract::{SurfaceExtractor, SurfaceOptions, TooManyVertices, extract_surface};
pub use parts::{PartChanges, SurfaceParts};
pub use sampling::{MAX_POINTS, PointDensity, SamplingError, sample_evenly};
pub use triangles::build_tables;
