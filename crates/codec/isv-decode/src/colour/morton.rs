//! Morton order within a block: places whose bits interleave those of x (lowest), y and z.

/// Bits of a coordinate below 32, each moved to three times its place.
const SPREAD: [u16; 32] = {
    let mut spread = [0; 32];
    let mut value = 0;
    while value < 32 {
        let mut bit = 0;
        while bit < 5 {
            spread[value] |= ((value >> bit & 1) << (3 * bit)) as u16;
            bit += 1;
        }
        value += 1;
    }
    spread
};

/// The coordinates of each place below 512.
const POSITIONS: [[u8; 3]; 512] = {
    let mut positions = [[0; 3]; 512];
    let mut place = 0;
    while place < 512 {
        let mut axis = 0;
        while axis < 3 {
            let bits = place >> axis;
            positions[place][axis] = (bits & 1 | bits >> 2 & 2 | bits >> 4 & 4) as u8;
            axis += 1;
        }
        place += 1;
    }
    positions
};

/// The place of coordinates below 32.
#[must_use]
#[inline(always)]
pub fn interleave([x, y, z]: [usize; 3]) -> usize {
    usize::from(SPREAD[x] | SPREAD[y] << 1) | usize::from(SPREAD[z]) << 2
}

/// The coordinates of a place below 512.
#[must_use]
#[inline(always)]
pub fn position(place: usize) -> [usize; 3] {
    POSITIONS[place].map(usize::from)
}

/// The coordinates of a place below 4096.
#[must_use]
#[inline(always)]
pub fn wide_position(place: usize) -> [usize; 3] {
    let low = place & 7;
    let high = position(place >> 3);
    [0, 1, 2].map(|axis| 2 * high[axis] + (low >> axis & 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_and_positions_are_inverse() {
        assert!((0..512).all(|place| interleave(position(place)) == place));
        assert_eq!(interleave([31; 3]), (1 << 15) - 1);
        assert_eq!(position(0b100_010_001), [1, 2, 4]);
    }
}
