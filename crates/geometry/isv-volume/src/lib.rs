//! The nouns of isv: what every other crate talks about, with no algorithm beyond indexing.
//!
//! A frame is a [`SparseVolume`]: a set of cubic blocks of voxels in Morton order. Each voxel is an integer
//! code of the truncated signed distance to the surface (negative inside), with [`CODES_PER_VOXEL`] codes to
//! one voxel edge. A [`TriangleMesh`], a [`PointCloud`] or a [`DepthImage`] is what goes in, a mesh or points
//! are what comes out.
//!
//! ```
//! use isv_volume::{BlockCoord, BlockEdge, Grid, Truncation, VolumeBuilder, VoxelSize};
//!
//! let grid = Grid {
//!     voxel_size: VoxelSize::from_metres(0.005).unwrap(),
//!     edge: BlockEdge::E8,
//!     truncation: Truncation::DEFAULT,
//! };
//! let mut builder = VolumeBuilder::new(grid);
//! builder.push(BlockCoord { x: 0, y: -1, z: 2 }, vec![-100; 512], None);
//! let volume = builder.finish();
//! assert_eq!(volume.block_count(), 1);
//! ```

mod appearance;
mod block_index;
mod block_set;
mod colour_samples;
mod colour_view;
mod coord;
mod depth;
mod fit;
mod grid;
mod mask;
mod mesh;
mod points;
mod random;
mod volume;
mod ycbcr;

pub use appearance::{
    Appearance, AppearanceError, AppearanceList, Image, Material, Rgb, Wrap, linear_from_srgb,
    srgb_from_linear,
};
pub use block_index::{BlockIndex, NeighbourFinder, Neighbourhood, OCTET_SLOTS};
pub use block_set::{BlockCell, BlockSet};
pub use colour_samples::ColourSample;
pub use colour_view::ColourView;
pub use coord::{BlockCoord, COORD_LIMIT, MortonCode};
pub use depth::{CameraPose, DepthError, DepthImage, Intrinsics, MAX_PIXELS};
pub use fit::{FitError, round_up};
pub use grid::{BlockEdge, CODES_PER_VOXEL, Grid, GridError, Truncation, VoxelSize};
pub use mask::VoxelMask;
pub use mesh::{MeshError, TriangleMesh};
pub use points::{PointCloud, PointsError, ScanPlace};
pub use random::SplitMix64;
pub use volume::{BlockOrigin, SparseVolume, VolumeBuilder};
pub use ycbcr::ycbcr_from_rgb;
