//! The writing side of the entropy-coded syntax that both profiles have: each file mirrors the one of the same name in `isv-decode`.

pub(crate) mod block_set;
pub(crate) mod masks;

/// The entropy-coded segments of a frame.
#[derive(Clone, Debug)]
pub struct SymbolSegments {
    /// The set of blocks.
    pub block_set: Vec<u8>,
    /// Unobserved voxels.
    pub masks: Vec<u8>,
    /// Modes and coefficients of each slice.
    pub slices: Vec<SliceSegments>,
}

/// The entropy-coded segments of a slice.
#[derive(Clone, Debug)]
pub struct SliceSegments {
    /// Modes of blocks in profile `main`, motion vectors in profile `paper`; empty without prediction from another frame.
    pub modes: Vec<u8>,
    /// Quantized coefficients.
    pub coefficients: Vec<u8>,
    /// Bits of `coefficients` that the DC coefficients take.
    pub dc_bits: f64,
}
