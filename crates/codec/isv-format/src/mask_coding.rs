//! How a stream says which voxels were not observed.

/// How frames of profile `main` code their unobserved voxels, of which only those beside the surface matter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum MaskCoding {
    /// A bit for each corner of a cell that the surface crosses.
    #[default]
    Voxels,
    /// A bit for each of these cells: whether it is drawn. Needs version 2, and half to a quarter of the bytes.
    Cells,
}

impl MaskCoding {
    /// The name: `voxels` or `cells`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Voxels => "voxels",
            Self::Cells => "cells",
        }
    }

    /// The bit of the stream header that says so.
    pub(crate) const CELLS_BIT: u8 = 1 << 2;

    /// The bits of byte 15 of the stream header that state it.
    pub(crate) fn bits(self) -> u8 {
        match self {
            Self::Voxels => 0,
            Self::Cells => Self::CELLS_BIT,
        }
    }

    /// The choice that byte 15 of the stream header states.
    pub(crate) fn from_bits(byte: u8) -> Self {
        if byte & Self::CELLS_BIT == 0 { Self::Voxels } else { Self::Cells }
    }
}
