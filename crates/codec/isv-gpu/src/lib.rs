//! The codec's arithmetic on a GPU, through wgpu (Vulkan, Metal, DX12): the same bits as on the CPU.
//!
//! ```
//! use isv_gpu::{Gpu, GpuChoice, GpuError, GpuSurfaceExtractor, GpuVolume, VolumeStore};
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
//! let volume = builder.finish();
//!
//! // A driver that computes on the processor will do here.
//! let gpu = match Gpu::open(&GpuChoice { software: true, ..GpuChoice::default() }) {
//!     Ok(gpu) => gpu,
//!     Err(GpuError::NoAdapter(_)) => return Ok(()),
//!     Err(error) => return Err(error),
//! };
//! let store = VolumeStore::new(&gpu)?;
//! let uploaded = GpuVolume::upload(&store, &volume)?;
//! let mesh = GpuSurfaceExtractor::new(&store, SurfaceOptions::default())?.extract(&uploaded)?.download()?;
//! assert_eq!(mesh.triangles, extract_surface(&volume, &SurfaceOptions::default()).triangles);
//! # Ok::<(), GpuError>(())
//! ```
//!
//! # How it works
//!
//! - A [`VolumeStore`] holds the samples of all volumes in one pool of slots, a block each (`pool`). So volumes share blocks, and a
//!   frame is predicted from the one before without leaving the GPU. A [`GpuVolume`] has a list of its blocks' coordinates and
//!   slots and a hash table to find them by (`blocks`, Sec. 3.6 of the paper).
//! - Kernels are WGSL in `shaders`, put together from parts (`kernel`); one workgroup works on one block. What a decoder repeats is
//!   `i32` and `u32` only, and written after the scalar code of `isv-kernels` and `isv-decode`, which tests compare it with.
//! - Meshes become volumes where they are coded (`ingest`): distances in floating point, everything else in integers.
//! - Depth images are fused (`fusion`): planes, blocks and sums of voxels on the GPU, the rest by `isv-fusion`. In floating point, so
//!   that these are not the CPU's bits.
//! - Surfaces are extracted where the volumes are (`surface`), and stay there until they are wanted here.
//! - Buffers are never larger than what a kernel may bind: the pool is split, lists are worked on in parts.

mod adapter;
mod blocks;
mod commands;
mod decode;
mod device;
mod encode;
mod error;
mod fusion;
mod ingest;
mod kernel;
mod pool;
mod prefix_sums;
mod stopwatch;
mod storage;
mod store;
mod surface;
mod volume;

pub use adapter::{AdapterKind, AdapterReport, adapters};
pub use decode::{GpuBackend, GpuMainFrame, GpuPaperFrame};
pub use device::{Gpu, GpuChoice, Memory};
pub use encode::{GpuMotionSearch, frame_coder};
pub use error::GpuError;
pub use fusion::{GpuFusion, GpuSums, GpuViews};
pub use ingest::{GpuIngestError, GpuMeshIngester};
pub use stopwatch::KernelTime;
pub(crate) use storage::Storage;
pub use store::VolumeStore;
pub use surface::{GpuMesh, GpuSurfaceExtractor};
pub use volume::GpuVolume;

/// All shaders, with the entry points that are used of each: tests validate them without a GPU.
#[cfg(test)]
const SHADERS: &[(kernel::Shader, &[&str])] = &[
    (blocks::INSERT, &["insert"]),
    (decode::shaders::TEMPORAL, &["temporal"]),
    (decode::shaders::SPATIAL, &["spatial"]),
    (decode::shaders::FACE_FILTER, &["face_filter"]),
    (decode::shaders::EXTRAPOLATE, &["extrapolate"]),
    (decode::shaders::CONFLICTS, &["conflicts"]),
    (decode::shaders::CROSSED_CELLS, &["crossed_cells"]),
    (decode::shaders::ACTIVITY, &["expected_activity"]),
    (decode::shaders::WARP, &["warp"]),
    (prefix_sums::SHADER, &["sum", "add"]),
    (surface::kernels::SIGNS, &["find_signs"]),
    (surface::kernels::COUNT, &["count"]),
    (surface::kernels::POSITIONS, &["place_vertices"]),
    (surface::kernels::NORMALS, &["find_normals"]),
    (surface::kernels::TRIANGLES, &["make_triangles"]),
    (ingest::kernels::REACHED, &["find_reached"]),
    (ingest::kernels::LIST, &["list_triangles"]),
    (ingest::kernels::WIND, &["wind"]),
    (ingest::kernels::CARRY, &["carry"]),
    (ingest::kernels::MEASURE, &["measure"]),
    (encode::shaders::SEARCH, &["search"]),
    (encode::shaders::CODE, &["code"]),
    (encode::shaders::SHIFTS, &["find_shifts"]),
    (fusion::kernels::PLANES, &["fit_planes"]),
    (fusion::kernels::COUNT, &["count_rays"]),
    (fusion::kernels::ALLOCATE, &["allocate"]),
    (fusion::kernels::INTEGRATE, &["integrate"]),
    (fusion::kernels::RESOLVE, &["resolve"]),
];

#[cfg(test)]
mod tests;
