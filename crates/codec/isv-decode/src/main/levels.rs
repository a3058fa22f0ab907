//! The quantized coefficients of a frame. Most blocks of most frames have none, so only those that are not zero are kept.

/// A coefficient that is not zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Level {
    /// Place of the coefficient in scan order.
    pub place: u8,
    /// Quantized value of the coefficient.
    pub value: i32,
}

/// The levels of blocks, one after the other.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BlockLevels {
    levels: Vec<Level>,
    /// For each block, where its levels end.
    ends: Vec<u32>,
}

impl BlockLevels {
    /// An empty list, with room for the levels of this many blocks.
    #[must_use]
    pub fn with_capacity(blocks: usize) -> Self {
        Self { levels: Vec::new(), ends: Vec::with_capacity(blocks) }
    }

    /// Adds a block: its levels in scan order, zeros included.
    pub fn push(&mut self, levels: &[i32]) {
        let places = (0..).zip(levels).filter(|(_, value)| **value != 0);
        self.levels.extend(places.map(|(place, value)| Level { place, value: *value }));
        self.ends.push(self.levels.len() as u32);
    }

    /// Adds the blocks of another list.
    pub fn append(&mut self, other: &Self) {
        let before = self.levels.len() as u32;
        self.levels.extend_from_slice(&other.levels);
        self.ends.extend(other.ends.iter().map(|end| before + end));
    }

    /// The levels of a block in scan order.
    #[must_use]
    pub fn of(&self, block: usize) -> &[Level] {
        let start = if block == 0 { 0 } else { self.ends[block - 1] };
        &self.levels[start as usize..self.ends[block] as usize]
    }

    /// How many levels a block has: at most [`super::COEFFICIENTS`].
    #[must_use]
    pub fn count(&self, block: usize) -> u8 {
        self.of(block).len() as u8
    }

    /// How many blocks there are.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.ends.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_keep_their_levels_in_order() {
        let (mut first, mut second) = (BlockLevels::default(), BlockLevels::with_capacity(2));
        first.push(&[0, 7, 0, -2]);
        first.push(&[0; 4]);
        second.push(&[1, 0, 0, 0]);
        second.push(&[0, 0, 0, 9]);
        first.append(&second);
        let level = |place, value| Level { place, value };
        let expected = [vec![level(1, 7), level(3, -2)], vec![], vec![level(0, 1)], vec![level(3, 9)]];
        assert_eq!(first.blocks(), expected.len());
        for (block, expected) in expected.iter().enumerate() {
            assert_eq!(first.of(block), expected);
            assert_eq!(usize::from(first.count(block)), expected.len());
        }
    }
}
