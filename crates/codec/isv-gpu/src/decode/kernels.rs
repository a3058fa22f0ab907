//! The kernels of decoding, compiled.

use super::shaders;
use crate::kernel::Kernel;
use crate::pool::segment_bits;
use crate::{Gpu, GpuError};

#[derive(Debug)]
pub(super) struct Kernels {
    pub(super) temporal: Kernel,
    pub(super) spatial: Kernel,
    pub(super) face_filter: Kernel,
    pub(super) extrapolate: Kernel,
    pub(super) conflicts: Kernel,
    pub(super) crossed_cells: Kernel,
    pub(super) activity: Kernel,
    pub(super) warp: Kernel,
}

impl Kernels {
    /// Compiles them.
    ///
    /// # Errors
    /// [`GpuError::Refused`].
    pub(super) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let compile = |shader, entry| Kernel::new(gpu, shader, entry, segment_bits(gpu));
        Ok(Self {
            temporal: compile(&shaders::TEMPORAL, "temporal")?,
            spatial: compile(&shaders::SPATIAL, "spatial")?,
            face_filter: compile(&shaders::FACE_FILTER, "face_filter")?,
            extrapolate: compile(&shaders::EXTRAPOLATE, "extrapolate")?,
            conflicts: compile(&shaders::CONFLICTS, "conflicts")?,
            crossed_cells: compile(&shaders::CROSSED_CELLS, "crossed_cells")?,
            activity: compile(&shaders::ACTIVITY, "expected_activity")?,
            warp: compile(&shaders::WARP, "warp")?,
        })
    }
}
