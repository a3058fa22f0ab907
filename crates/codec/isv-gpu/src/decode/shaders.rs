//! The kernels of decoding.

use crate::kernel::Shader;

pub(crate) const SAMPLES: &str = include_str!("../shaders/samples.wgsl");
pub(crate) const TABLE: &str = include_str!("../shaders/block_table.wgsl");
pub(crate) const FIND: &str = include_str!("../shaders/block_find.wgsl");
/// Coefficients to residuals.
pub(crate) const TRANSFORM: &str = include_str!("../shaders/transform.wgsl");
/// Rigid motion, and blocks that are predicted by it.
pub(crate) const RIGID: &str = include_str!("../shaders/rigid.wgsl");
pub(crate) const MOVED: &str = include_str!("../shaders/moved_block.wgsl");
const RESIDUAL: &str = include_str!("../shaders/residual.wgsl");
const CODED: &str = include_str!("../shaders/coded.wgsl");
const PARAMETERS: &str = include_str!("../shaders/coded_parameters.wgsl");
pub(crate) const VECTORS: &str = include_str!("../shaders/vectors.wgsl");
/// What stands for blocks that the frame before does not have.
pub(crate) const BESIDE: &str = include_str!("../shaders/beside.wgsl");
pub(crate) const FRAME: &str = include_str!("../shaders/frame_blocks.wgsl");

/// A block from the frame before, and its residual.
pub(crate) const TEMPORAL: Shader = Shader {
    name: "temporal",
    parts: &[
        SAMPLES,
        TABLE,
        TRANSFORM,
        RESIDUAL,
        CODED,
        VECTORS,
        PARAMETERS,
        BESIDE,
        include_str!("../shaders/temporal.wgsl"),
        FIND,
    ],
};
/// A block from those around it, and its residual.
pub(crate) const SPATIAL: Shader = Shader {
    name: "spatial",
    parts: &[
        SAMPLES,
        TABLE,
        TRANSFORM,
        RESIDUAL,
        CODED,
        VECTORS,
        PARAMETERS,
        include_str!("../shaders/wide.wgsl"),
        include_str!("../shaders/spatial.wgsl"),
        FIND,
    ],
};
/// The in-loop filter.
pub(crate) const FACE_FILTER: Shader = Shader {
    name: "face filter",
    parts: &[SAMPLES, TABLE, CODED, VECTORS, include_str!("../shaders/face_filter.wgsl"), FIND],
};
/// Blocks beside coded ones.
pub(crate) const EXTRAPOLATE: Shader = Shader {
    name: "extrapolate",
    parts: &[SAMPLES, TABLE, FRAME, include_str!("../shaders/extrapolate.wgsl"), FIND],
};
/// Faces between extrapolated blocks of different signs.
pub(crate) const CONFLICTS: Shader =
    Shader { name: "conflicts", parts: &[TABLE, FRAME, include_str!("../shaders/conflicts.wgsl"), FIND] };
/// Crossed cells.
pub(crate) const CROSSED_CELLS: Shader = Shader {
    name: "crossed cells",
    parts: &[SAMPLES, TABLE, FRAME, include_str!("../shaders/crossed_cells.wgsl"), FIND],
};
/// Activity of each block: how much surface is expected there.
pub(crate) const ACTIVITY: Shader = Shader {
    name: "activity",
    parts: &[SAMPLES, TABLE, FRAME, VECTORS, include_str!("../shaders/activity.wgsl"), FIND],
};
/// A block by rigid motion (profile `paper`).
pub(crate) const WARP: Shader = Shader {
    name: "warp",
    parts: &[
        SAMPLES,
        TABLE,
        FRAME,
        TRANSFORM,
        RESIDUAL,
        RIGID,
        MOVED,
        include_str!("../shaders/warp.wgsl"),
        FIND,
    ],
};
