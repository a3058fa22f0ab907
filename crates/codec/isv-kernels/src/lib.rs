//! The codec's arithmetic on one block: pure integer functions on arrays, no I/O, no clock. Tables and scratch are allocated when they
//! are made, nothing in a kernel.
//!
//! Whatever the decoder repeats is here and is exact. Every intermediate is bounded inside `i32`, or `i64` in [`surface_fit`],
//! and rounding is stated. So any machine, instruction set or GPU gives the same bits (`docs/spec/format.md`, section 7).
//!
//! | file | step of the paper |
//! |---|---|
//! | [`dct`] | 3-D DCT of a residual block and back (Sec. 3.3) |
//! | [`scan`] | the K lowest frequencies, by index sum (Sec. 3.3) |
//! | [`quant`] | fixed DC step, tunable AC step (Sec. 3.3) |
//! | [`deblock`] | smoothing across faces of blocks (profile `main`) |
//! | [`extrapolation`] | the field beside coded blocks (profile `main`) |
//! | [`signs`] | which samples lie inside, as bits |
//! | [`surface_fit`] | a block from the surface in those around it (profile `main`) |
//! | [`warp`] | motion-compensated block warping (Sec. 3.5) |
//! | [`window`] | the same by quarter voxels, without rotation (profile `main`) |
//!
//! [`block8`] is the size of a block of profile `main`. Loops are compiled for each instruction set in [`simd`].

pub mod block8;
pub mod dct;
pub mod deblock;
pub mod extrapolation;
pub mod quant;
mod reduced_warp;
pub mod scan;
pub mod signs;
pub mod simd;
pub mod surface_fit;
pub mod warp;
pub mod window;
