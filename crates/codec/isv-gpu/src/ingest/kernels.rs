//! The kernels of ingest.

use crate::decode::shaders::{FIND, SAMPLES, TABLE};
use crate::kernel::{Kernel, Shader};
use crate::pool::segment_bits;
use crate::{Gpu, GpuError};

const TRIANGLES: &str = include_str!("../shaders/ingest_triangles.wgsl");
const REACH: &str = include_str!("../shaders/ingest_reach.wgsl");
const LISTS: &str = include_str!("../shaders/ingest_lists.wgsl");

/// Which blocks triangles reach.
pub(crate) const REACHED: Shader = Shader {
    name: "reached blocks",
    parts: &[TRIANGLES, REACH, TABLE, include_str!("../shaders/ingest_find.wgsl")],
};
/// The triangles of each block.
pub(crate) const LIST: Shader = Shader {
    name: "triangles of blocks",
    parts: &[TRIANGLES, REACH, TABLE, include_str!("../shaders/ingest_list.wgsl"), FIND],
};
/// Changes of winding numbers in each block.
pub(crate) const WIND: Shader = Shader {
    name: "winding numbers in blocks",
    parts: &[SAMPLES, TRIANGLES, LISTS, include_str!("../shaders/ingest_wind.wgsl")],
};
/// Winding numbers along lines of blocks.
pub(crate) const CARRY: Shader = Shader {
    name: "winding numbers along lines",
    parts: &[SAMPLES, include_str!("../shaders/ingest_carry.wgsl")],
};
/// The samples of each block.
pub(crate) const MEASURE: Shader = Shader {
    name: "distances",
    parts: &[SAMPLES, TRIANGLES, LISTS, include_str!("../shaders/ingest_measure.wgsl")],
};

/// The compiled kernels.
#[derive(Debug)]
pub(super) struct Kernels {
    pub(super) find: Kernel,
    pub(super) list: Kernel,
    pub(super) wind: Kernel,
    pub(super) carry: Kernel,
    pub(super) measure: Kernel,
}

impl Kernels {
    /// Compiles them.
    ///
    /// # Errors
    /// As [`Kernel::new`].
    pub(super) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let kernel = |shader: &Shader, entry| Kernel::new(gpu, shader, entry, segment_bits(gpu));
        Ok(Self {
            find: kernel(&REACHED, "find_reached")?,
            list: kernel(&LIST, "list_triangles")?,
            wind: kernel(&WIND, "wind")?,
            carry: kernel(&CARRY, "carry")?,
            measure: kernel(&MEASURE, "measure")?,
        })
    }
}
