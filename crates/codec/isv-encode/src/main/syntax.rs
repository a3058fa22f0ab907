//! The writing side of the syntax of profile `main`: each file mirrors the one of the same name in `isv-decode`.

pub(crate) mod block_set;
pub(crate) mod cells;
pub(crate) mod coefficients;
pub(crate) mod masks;
pub(crate) mod modes;
pub(crate) mod skip_cells;
