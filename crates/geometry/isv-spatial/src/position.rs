//! Places as keys.

use foldhash::fast::RandomState;
use glam::DVec3;
use std::collections::{HashMap, HashSet};

/// What equal positions have in common, and no others.
pub type PositionKey = [u64; 3];

/// Something for each of some positions.
///
/// The hash has a key of its own, unlike faster ones. Positions are what a file says. A file that knows how
/// they are hashed can choose thousands that fall into one place. Each one is then compared with all before
/// it. The order of iteration is another one each time.
pub type PositionMap<T> = HashMap<PositionKey, T, RandomState>;

/// Some positions, or groups of them; hashed as in [`PositionMap`].
pub type PositionSet<K = PositionKey> = HashSet<K, RandomState>;

/// The key of a position.
#[must_use]
pub fn position_key(position: DVec3) -> PositionKey {
    // Adding zero turns -0 into 0, which is the same place.
    (position + 0.0).to_array().map(f64::to_bits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::hash::BuildHasher;

    #[test]
    fn equal_positions_have_equal_keys_and_others_do_not() {
        let key = |x| position_key(DVec3::new(x, 1.0, 2.0));
        assert_eq!(key(0.0), key(-0.0));
        assert_ne!(key(1.0), key(1f64.next_up()));
        assert_ne!(key(1.0), key(-1.0));
    }

    #[test]
    fn no_file_can_know_how_positions_are_hashed() {
        let hash = |position| PositionMap::<u32>::default().hasher().hash_one(position_key(position));
        for position in [DVec3::ZERO, DVec3::ONE] {
            assert_ne!(hash(position), hash(position), "{position}");
        }
    }
}
