//! The writing side of `isv_decode::colour::syntax`.

pub(crate) mod coefficients;
pub(crate) mod modes;
