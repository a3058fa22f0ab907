//! The tree above the leaves: a root, nodes of 32^3 nodes, nodes of 16^3 leaves.

use super::leaf::Leaves;
use super::sign::{Ends, spread_signs};

/// A level of internal nodes.
#[derive(Clone, Copy)]
struct Level {
    /// Base-2 logarithm of the children along an edge.
    log2_children: u32,
    /// Base-2 logarithm of the voxels along the edge of a child.
    log2_child: u32,
}

const UPPER: Level = Level { log2_children: 5, log2_child: 7 };
const LOWER: Level = Level { log2_children: 4, log2_child: 3 };

/// Inactive tiles are the background where the mask that follows says so, elsewhere minus the background.
const SIGN_MASK: u8 = 3;

impl Level {
    /// First voxel of the node around a voxel.
    fn origin(self, voxel: [i32; 3]) -> [i32; 3] {
        voxel.map(|v| v & (-1 << (self.log2_children + self.log2_child)))
    }

    /// Number of the child around a voxel: z runs fastest.
    fn child(self, voxel: [i32; 3]) -> usize {
        let mask = (1 << self.log2_children) - 1;
        let [x, y, z] = voxel.map(|v| (v >> self.log2_child & mask) as usize);
        (x << self.log2_children | y) << self.log2_children | z
    }
}

/// Place of a leaf in the tree; the order in which leaves are written.
pub(super) fn path(origin: [i32; 3]) -> ([i32; 3], usize, usize) {
    (UPPER.origin(origin), UPPER.child(origin), LOWER.child(origin))
}

/// Writes the root and everything below but the values of leaves.
pub(super) fn write_topology(leaves: &Leaves, out: &mut Vec<u8>) {
    let uppers: Vec<_> = nodes(UPPER, leaves.origins()).collect();
    out.extend(leaves.background().to_le_bytes());
    // No tiles at the root.
    out.extend(0u32.to_le_bytes());
    out.extend((uppers.len() as u32).to_le_bytes());
    for upper in uppers {
        UPPER.origin(upper[0]).iter().for_each(|axis| out.extend(axis.to_le_bytes()));
        let mut below = Vec::new();
        let children = nodes(LOWER, upper).map(|lower| {
            let mut masks: Vec<u8> = Vec::new();
            let children = lower.iter().map(|origin| {
                let leaf = leaves.leaf(*origin);
                masks.extend(leaf.active());
                (LOWER.child(*origin), leaf.ends())
            });
            let children: Vec<_> = children.collect();
            let ends = write_node(LOWER, &children, &mut below);
            below.extend(masks);
            (UPPER.child(lower[0]), ends)
        });
        let children: Vec<_> = children.collect();
        write_node(UPPER, &children, out);
        out.extend(below);
    }
}

/// The leaves of each node.
fn nodes(level: Level, leaves: &[[i32; 3]]) -> impl Iterator<Item = &[[i32; 3]]> {
    leaves.chunk_by(move |a, b| level.origin(*a) == level.origin(*b))
}

/// Writes which children a node has, that none of its tiles is active, and on which side they are.
fn write_node(level: Level, children: &[(usize, Ends)], out: &mut Vec<u8>) -> Ends {
    let mut known = vec![None; 1 << (3 * level.log2_children)];
    children.iter().for_each(|(child, ends)| known[*child] = Some(*ends));
    let inside = spread_signs(1 << level.log2_children, &known);
    write_mask(known.iter().map(Option::is_some), out);
    write_mask(known.iter().map(|_| false), out);
    out.push(SIGN_MASK);
    write_mask(inside.iter().map(|inside| !inside), out);
    let last = known.len() - 1;
    Ends {
        first_inside: known[0].map_or(inside[0], |ends| ends.first_inside),
        last_inside: known[last].map_or(inside[last], |ends| ends.last_inside),
    }
}

/// One bit a place, lowest first.
fn write_mask(bits: impl Iterator<Item = bool>, out: &mut Vec<u8>) {
    let bits: Vec<bool> = bits.collect();
    out.extend(bits.chunks(8).map(|bits| bits.iter().rev().fold(0, |byte, bit| byte << 1 | u8::from(*bit))));
}
