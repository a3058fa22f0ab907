//! The fixed order of coefficients: the K lowest frequencies come first.

use isv_volume::BlockEdge;

/// Positions `[w][v][u]` of a block's first `count` coefficients, lowest frequency first.
///
/// Sorted by index sum `u + v + w` (Sec. 3.3: "sorted by increasing index sum, i.e. Manhattan distance from DC"); equal
/// sums by `u^2 + v^2 + w^2`, which prefers mixed over pure frequencies; what is still equal by position.
///
/// `count` above the number of voxels gives all of them.
#[must_use]
pub fn scan_order(edge: BlockEdge, count: usize) -> Vec<u16> {
    let n = edge.voxels();
    let mut order: Vec<u16> = (0..edge.block_voxels() as u16).collect();
    order.sort_by_key(|&position| {
        let p = position as usize;
        let (u, v, w) = (p % n, p / n % n, p / n / n);
        (u + v + w, u * u + v * v + w * w, position)
    });
    order.truncate(count);
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lowest_index_sums_come_first() {
        let order = scan_order(BlockEdge::E8, 11);
        assert_eq!(order[0], 0);
        assert_eq!(order[1..4], [1, 8, 64]);
        assert_eq!(order[4..7], [9, 65, 72], "mixed second-order terms");
        assert_eq!(order[7..10], [2, 16, 128], "pure second-order terms");
    }

    #[test]
    fn the_whole_order_is_a_permutation() {
        for edge in [BlockEdge::E4, BlockEdge::E8, BlockEdge::E16] {
            let mut order = scan_order(edge, usize::MAX);
            order.sort_unstable();
            assert!(order.iter().enumerate().all(|(i, p)| i == *p as usize));
            assert_eq!(order.len(), edge.block_voxels());
        }
    }
}
