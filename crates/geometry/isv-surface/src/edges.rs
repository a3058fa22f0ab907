//! The crossing edges of a row of voxels, and the numbers of the vertices on them.

/// Position of the first-vertex number in the word.
const FIRST_SHIFT: u32 = 48;

/// Crossing edges that start in a row of up to 16 voxels, in one word. Bit `3 x + axis` is for the edge that
/// starts in voxel x and runs along `axis`. The upper 16 bits hold the number, within the block, of the first
/// vertex of the row.
///
/// A block has at most `3 * 16^3 = 12288` vertices, so the number fits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct EdgeRow(u64);

impl EdgeRow {
    /// From the crossing edges by axis, bit x for voxel x.
    #[inline(always)]
    pub(crate) fn new([x, y, z]: [u32; 3]) -> Self {
        Self(spread_by_three(x) | spread_by_three(y) << 1 | spread_by_three(z) << 2)
    }

    /// Row of these edges, given the number of vertices in the block before it.
    #[inline(always)]
    pub(crate) fn with_first(self, first: u32) -> Self {
        Self(self.bits() | u64::from(first) << FIRST_SHIFT)
    }

    /// Number of crossing edges in the row.
    #[inline(always)]
    pub(crate) fn count(self) -> u32 {
        self.bits().count_ones()
    }

    /// Number, within the block, of the first vertex of the row.
    #[inline(always)]
    pub(crate) fn first(self) -> u32 {
        (self.0 >> FIRST_SHIFT) as u32
    }

    /// The row's edges in the order of their vertices: `3 x + axis`.
    #[inline(always)]
    pub(crate) fn edges(self) -> SetBits {
        SetBits(self.bits())
    }

    /// The row's part that starts in voxel 0.
    #[inline(always)]
    pub(crate) fn first_voxel(self) -> Self {
        Self(self.0 & (u64::MAX << FIRST_SHIFT | 0b111))
    }

    #[inline(always)]
    fn bits(self) -> u64 {
        self.0 & ((1 << FIRST_SHIFT) - 1)
    }
}

/// Positions of the set bits of a word, lowest first.
pub(crate) struct SetBits(pub(crate) u64);

impl Iterator for SetBits {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let bit = self.0.trailing_zeros();
        self.0 &= self.0.wrapping_sub(1);
        (bit < u64::BITS).then_some(bit as usize)
    }
}

/// Moves bit `i` of a 16-bit number to bit `3 i`.
#[inline(always)]
fn spread_by_three(v: u32) -> u64 {
    let mut v = u64::from(v);
    v = (v | v << 16) & 0x0000_0000_ff00_00ff;
    v = (v | v << 8) & 0x0000_00f0_0f00_f00f;
    v = (v | v << 4) & 0x0000_0c30_c30c_30c3;
    (v | v << 2) & 0x0000_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_are_numbered_in_voxel_order() {
        let axes = [0b1000_0000_0000_0001, 0b0101, 0b1000_0000_0000_0001];
        let row = EdgeRow::new(axes).with_first(12_000);
        assert_eq!(row.edges().collect::<Vec<_>>(), [0, 1, 2, 7, 45, 47]);
        assert_eq!(row.first_voxel().edges().collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!((row.count(), row.first(), row.first_voxel().first()), (6, 12_000, 12_000));
    }
}
