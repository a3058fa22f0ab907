//! The kernels of fusion.

use crate::kernel::{Kernel, Shader};
use crate::prefix_sums::PrefixSums;
use crate::{Gpu, GpuError};

const VIEW: &str = include_str!("../shaders/fusion_view.wgsl");
const SUMS: &str = include_str!("../shaders/fusion_sums.wgsl");
const BLOCK_TABLE: &str = include_str!("../shaders/block_table.wgsl");

/// A plane for each pixel.
pub(crate) const PLANES: Shader =
    Shader { name: "fusion planes", parts: &[VIEW, include_str!("../shaders/fusion_planes.wgsl")] };
/// How many rays each pixel is cut into.
pub(crate) const COUNT: Shader =
    Shader { name: "fusion count", parts: &[VIEW, include_str!("../shaders/fusion_count.wgsl")] };
/// The blocks on rays.
pub(crate) const ALLOCATE: Shader = Shader {
    name: "fusion allocate",
    parts: &[VIEW, BLOCK_TABLE, include_str!("../shaders/fusion_allocate.wgsl")],
};
/// Sums of voxels.
pub(crate) const INTEGRATE: Shader = Shader {
    name: "fusion integrate",
    parts: &[VIEW, SUMS, include_str!("../shaders/fusion_integrate.wgsl")],
};
/// From sums to samples.
pub(crate) const RESOLVE: Shader =
    Shader { name: "fusion resolve", parts: &[SUMS, include_str!("../shaders/fusion_resolve.wgsl")] };

/// The compiled kernels.
#[derive(Debug)]
pub(super) struct Kernels {
    pub(super) planes: Kernel,
    pub(super) count: Kernel,
    pub(super) prefix_sums: PrefixSums,
    pub(super) allocate: Kernel,
    pub(super) integrate: Kernel,
    pub(super) resolve: Kernel,
}

impl Kernels {
    /// Compiles them.
    ///
    /// # Errors
    /// As [`Kernel::new`].
    pub(super) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        // None of them looks at the pool.
        let kernel = |shader: &Shader, entry| Kernel::new(gpu, shader, entry, 0);
        Ok(Self {
            planes: kernel(&PLANES, "fit_planes")?,
            count: kernel(&COUNT, "count_rays")?,
            prefix_sums: PrefixSums::new(gpu)?,
            allocate: kernel(&ALLOCATE, "allocate")?,
            integrate: kernel(&INTEGRATE, "integrate")?,
            resolve: kernel(&RESOLVE, "resolve")?,
        })
    }
}
