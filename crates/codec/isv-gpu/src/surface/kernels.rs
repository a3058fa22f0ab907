//! The kernels of surface extraction, and their table of cases.

use crate::kernel::{Kernel, Shader};
use crate::pool::segment_bits;
use crate::{Gpu, GpuError};
use isv_surface::{SurfaceOptions, case_triangles};

const SAMPLES: &str = include_str!("../shaders/samples.wgsl");
const BLOCK_TABLE: &str = include_str!("../shaders/block_table.wgsl");
const BLOCK_FIND: &str = include_str!("../shaders/block_find.wgsl");
const NEIGHBOURS: &str = include_str!("../shaders/neighbours.wgsl");
const MASKS: &str = include_str!("../shaders/masks.wgsl");
const ROW_SUMS: &str = include_str!("../shaders/row_sums.wgsl");
const BLOCKS: &str = include_str!("../shaders/surface_blocks.wgsl");
const WINDOW: &str = include_str!("../shaders/surface_window.wgsl");
const CASES: &str = include_str!("../shaders/surface_cases.wgsl");
const EDGES: &str = include_str!("../shaders/surface_edges.wgsl");
const VERTICES: &str = include_str!("../shaders/surface_vertices.wgsl");

pub(crate) const SIGNS: Shader = Shader {
    name: "surface signs",
    parts: &[SAMPLES, BLOCKS, include_str!("../shaders/surface_signs.wgsl")],
};
pub(crate) const COUNT: Shader = Shader {
    name: "surface count",
    parts: &[
        BLOCK_TABLE,
        BLOCK_FIND,
        NEIGHBOURS,
        MASKS,
        ROW_SUMS,
        BLOCKS,
        WINDOW,
        CASES,
        EDGES,
        include_str!("../shaders/surface_count.wgsl"),
    ],
};
pub(crate) const POSITIONS: Shader = Shader {
    name: "surface positions",
    parts: &[
        SAMPLES,
        BLOCK_TABLE,
        BLOCK_FIND,
        NEIGHBOURS,
        ROW_SUMS,
        EDGES,
        VERTICES,
        include_str!("../shaders/surface_positions.wgsl"),
    ],
};
pub(crate) const NORMALS: Shader = Shader {
    name: "surface normals",
    parts: &[
        SAMPLES,
        BLOCK_TABLE,
        BLOCK_FIND,
        NEIGHBOURS,
        MASKS,
        ROW_SUMS,
        EDGES,
        VERTICES,
        include_str!("../shaders/surface_normals.wgsl"),
    ],
};
pub(crate) const TRIANGLES: Shader = Shader {
    name: "surface triangles",
    parts: &[
        BLOCK_TABLE,
        BLOCK_FIND,
        NEIGHBOURS,
        ROW_SUMS,
        BLOCKS,
        WINDOW,
        CASES,
        EDGES,
        include_str!("../shaders/surface_triangles.wgsl"),
    ],
};

/// The compiled kernels.
#[derive(Debug)]
pub(super) struct Kernels {
    pub(super) signs: Kernel,
    pub(super) count: Kernel,
    pub(super) positions: Kernel,
    /// If normals are wanted.
    pub(super) normals: Option<Kernel>,
    pub(super) triangles: Kernel,
}

impl Kernels {
    /// Compiles them.
    ///
    /// # Errors
    /// As [`Kernel::new`].
    pub(super) fn new(gpu: &Gpu, options: SurfaceOptions) -> Result<Self, GpuError> {
        let kernel = |shader: &Shader, entry| Kernel::new(gpu, shader, entry, segment_bits(gpu));
        Ok(Self {
            signs: kernel(&SIGNS, "find_signs")?,
            count: kernel(&COUNT, "count")?,
            positions: kernel(&POSITIONS, "place_vertices")?,
            normals: options.normals.then(|| kernel(&NORMALS, "find_normals")).transpose()?,
            triangles: kernel(&TRIANGLES, "make_triangles")?,
        })
    }
}

/// The triangles of each pattern of signs as `surface_cases.wgsl` reads them.
pub(super) fn cases() -> [[u32; 2]; 256] {
    std::array::from_fn(|pattern| {
        let triangles = case_triangles(pattern as u8);
        let corners = triangles.as_flattened().iter().enumerate();
        let word = corners
            .fold((triangles.len() as u64) << 60, |word, (i, edge)| word | u64::from(*edge) << (4 * i));
        [word as u32, (word >> 32) as u32]
    })
}
