//! Place of a block, and the order blocks are kept in.

/// Block coordinates lie in `-COORD_LIMIT..COORD_LIMIT` on every axis, so that a [`MortonCode`] fits 63 bits.
/// With 8-voxel blocks of 5 mm voxels that is 42 km either way.
pub const COORD_LIMIT: i32 = 1 << 20;

/// Position of a block on the block grid: block `(x, y, z)` covers voxels `x * edge .. (x + 1) * edge` and so on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BlockCoord {
    /// Along the first world axis.
    pub x: i32,
    /// Along the second world axis.
    pub y: i32,
    /// Along the third world axis.
    pub z: i32,
}

/// Interleaved bits of a block coordinate; the order of all block lists (x in the lowest bit of each triple).
///
/// A block's neighbours at `x - 1`, `y - 1` and `z - 1` come before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MortonCode(pub u64);

impl BlockCoord {
    /// The coordinate `(x + dx, y + dy, z + dz)`.
    #[must_use]
    #[inline]
    pub fn offset(self, [dx, dy, dz]: [i32; 3]) -> Self {
        Self { x: self.x + dx, y: self.y + dy, z: self.z + dz }
    }

    /// `[x, y, z]`.
    #[must_use]
    pub fn to_array(self) -> [i32; 3] {
        [self.x, self.y, self.z]
    }

    /// Whether all three components lie within [`COORD_LIMIT`].
    #[must_use]
    pub fn in_range(self) -> bool {
        self.to_array().iter().all(|c| (-COORD_LIMIT..COORD_LIMIT).contains(c))
    }

    /// Morton code of a coordinate in range.
    ///
    /// # Panics
    /// In debug builds, if the coordinate is out of range.
    #[must_use]
    pub fn morton(self) -> MortonCode {
        debug_assert!(self.in_range(), "{self:?} is out of range");
        let [x, y, z] = self.to_array().map(|c| spread_bits((c + COORD_LIMIT) as u64));
        MortonCode(x | y << 1 | z << 2)
    }
}

impl From<[i32; 3]> for BlockCoord {
    fn from([x, y, z]: [i32; 3]) -> Self {
        Self { x, y, z }
    }
}

impl MortonCode {
    /// The coordinate this is the code of.
    #[must_use]
    pub fn coord(self) -> BlockCoord {
        BlockCoord::from([0, 1, 2].map(|axis| gather_bits(self.0 >> axis) as i32 - COORD_LIMIT))
    }
}

/// Moves bit `i` of a 21-bit number to bit `3 i`.
fn spread_bits(mut v: u64) -> u64 {
    v &= 0x1f_ffff;
    v = (v | v << 32) & 0x001f_0000_0000_ffff;
    v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

/// Inverse of [`spread_bits`].
fn gather_bits(mut v: u64) -> u64 {
    v &= 0x1249_2492_4924_9249;
    v = (v | v >> 2) & 0x10c3_0c30_c30c_30c3;
    v = (v | v >> 4) & 0x100f_00f0_0f00_f00f;
    v = (v | v >> 8) & 0x001f_0000_ff00_00ff;
    v = (v | v >> 16) & 0x001f_0000_0000_ffff;
    (v | v >> 32) & 0x1f_ffff
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn morton_code_interleaves_and_inverts() {
        for c in [[0, 0, 0], [-1, 5, 77], [-COORD_LIMIT, COORD_LIMIT - 1, 123_456], [-4, -3, -2]] {
            let coord = BlockCoord::from(c);
            let mut expected = 0u64;
            for (axis, v) in c.iter().enumerate() {
                for bit in 0..21 {
                    expected |= (((v + COORD_LIMIT) as u64 >> bit) & 1) << (3 * bit + axis);
                }
            }
            assert_eq!(coord.morton(), MortonCode(expected));
            assert_eq!(coord.morton().coord(), coord);
        }
    }

    #[test]
    fn lower_face_neighbours_precede_a_block() {
        for c in [[0, 0, 0], [-1, 5, 77], [8, 16, 31], [-8, -16, -31]].map(BlockCoord::from) {
            for d in [[-1, 0, 0], [0, -1, 0], [0, 0, -1]] {
                assert!(c.offset(d).morton() < c.morton());
            }
        }
    }
}
