//! The kernels of encoding.

use crate::decode::shaders::{BESIDE, FIND, FRAME, MOVED, RIGID, SAMPLES, TABLE, TRANSFORM, VECTORS};
use crate::kernel::Shader;

/// Motion of a block (profile `paper`).
pub(crate) const SEARCH: Shader = Shader {
    name: "search",
    parts: &[
        SAMPLES,
        TABLE,
        FRAME,
        RIGID,
        include_str!("../shaders/normal_equations.wgsl"),
        include_str!("../shaders/search.wgsl"),
        FIND,
    ],
};
/// Levels of a block, and the block that they give.
pub(crate) const CODE: Shader = Shader {
    name: "code",
    parts: &[SAMPLES, TABLE, FRAME, TRANSFORM, RIGID, MOVED, include_str!("../shaders/code.wgsl"), FIND],
};
/// Search for the shifts of blocks that move as one (profile `main`).
pub(crate) const SHIFTS: Shader = Shader {
    name: "shifts",
    parts: &[SAMPLES, TABLE, VECTORS, BESIDE, include_str!("../shaders/shifts.wgsl"), FIND],
};
