//! The bounding-volume hierarchy under all queries.

use glam::DVec3;
use isv_volume::{BlockCoord, TriangleMesh};
use rayon::prelude::*;

/// Depth below which the surface-area heuristic may split unevenly. From here on every split halves the
/// triangles, so the depth never passes [`MAX_DEPTH`], whatever the input.
const UNEVEN_DEPTH: usize = 40;

/// Bound on the depth of a tree: [`UNEVEN_DEPTH`] plus the halvings of 2^32 triangles.
pub(crate) const MAX_DEPTH: usize = UNEVEN_DEPTH + 32;

/// Bits of a triangle's place along each axis: those of all three together are no more than [`UNEVEN_DEPTH`].
const PLACE_BITS: u32 = 13;

/// Buckets of the surface-area heuristic along the split axis.
const BINS: usize = 16;

/// Ranges with more triangles than this are built by two threads.
const PARALLEL_SIZE: usize = 4096;

/// A node; a tree lists them depth first, so the first child of an inner node is the next one in the list.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    /// Smallest corner of the bounding box.
    pub(crate) lo: DVec3,
    /// Largest corner of the bounding box.
    pub(crate) hi: DVec3,
    /// Leaf: its first entry in the tree's order. Inner node: how many nodes further the second child is.
    link: u32,
    /// Triangles of a leaf; 0 for an inner node.
    count: u32,
}

/// What a node holds.
pub(crate) enum Content {
    /// A range of the tree's triangle order.
    Leaf(std::ops::Range<usize>),
    /// The indices of two nodes, both larger than their parent's.
    Inner(usize, usize),
}

/// A binary tree of boxes over the triangles of a mesh.
pub(crate) struct Tree {
    pub(crate) nodes: Vec<Node>,
    /// Triangle indices in the order of the leaves.
    pub(crate) order: Vec<u32>,
}

impl Node {
    /// The content of the node at `index`, which must be this one.
    pub(crate) fn content(&self, index: usize) -> Content {
        if self.count > 0 {
            Content::Leaf(self.link as usize..(self.link + self.count) as usize)
        } else {
            Content::Inner(index + 1, index + self.link as usize)
        }
    }
}

/// A triangle while the tree is built.
#[derive(Clone, Copy)]
struct Item {
    lo: DVec3,
    hi: DVec3,
    face: u32,
}

impl Item {
    /// Twice the centre of the box.
    fn position(&self) -> DVec3 {
        self.lo + self.hi
    }
}

impl Tree {
    /// Builds a tree with at most `leaf_size` triangles a leaf, by where triangles are. Cubes are halved
    /// along each axis in turn, which is found by sorting (Lauterbach et al. 2009, "Fast BVH construction on
    /// GPUs"). It is far faster to build than [`Self::build`], and a little slower to search. Also returns
    /// the corners of the triangles in its order.
    ///
    /// # Panics
    /// As [`Self::build`].
    pub(crate) fn by_place(mesh: &TriangleMesh, leaf_size: usize) -> (Self, Vec<[DVec3; 3]>) {
        assert!(!mesh.triangles.is_empty(), "a mesh without faces has no winding number");
        let (lo, hi) = mesh.bounds().expect("a mesh with faces has vertices");
        let scale =
            f64::from(1 << PLACE_BITS) * (1.0 - 1e-9) / (hi - lo).max_element().max(f64::MIN_POSITIVE);
        let place = |face: usize| {
            let [a, b, c] = mesh.corners(face);
            let middle = (a.min(b).min(c) - lo) * 0.5 + (a.max(b).max(c) - lo) * 0.5;
            let place = BlockCoord::from((middle * scale).as_ivec3().to_array());
            (place.morton().0, face as u32)
        };
        let mut places: Vec<Place> = (0..mesh.triangles.len()).into_par_iter().map(place).collect();
        places.par_sort_unstable();
        let corners: Vec<_> = places.par_iter().map(|place| mesh.corners(place.1 as usize)).collect();
        let mut nodes = Vec::with_capacity(2 * places.len() / leaf_size + 1);
        halve(&mut nodes, &places, 0, &Leaves { corners: &corners, leaf_size });
        (Self { nodes, order: places.into_iter().map(|place| place.1).collect() }, corners)
    }

    /// Builds a tree with at most `leaf_size` triangles a leaf, by the surface-area heuristic.
    ///
    /// # Panics
    /// If the mesh has no triangles or names vertices that are not there.
    pub(crate) fn build(mesh: &TriangleMesh, leaf_size: usize) -> Self {
        assert!(!mesh.triangles.is_empty(), "a mesh without faces has no closest point");
        let mut items: Vec<Item> = (0..mesh.triangles.len())
            .map(|face| {
                let [a, b, c] = mesh.corners(face);
                Item { lo: a.min(b).min(c), hi: a.max(b).max(c), face: face as u32 }
            })
            .collect();
        let nodes = build_range(&mut items, 0, 0, leaf_size);
        Self { nodes, order: items.iter().map(|item| item.face).collect() }
    }
}

/// Place of a triangle, as a Morton code, and which it is.
type Place = (u64, u32);

/// What nodes are made from.
struct Leaves<'a> {
    /// Corners of the triangles in the order of their places.
    corners: &'a [[DVec3; 3]],
    leaf_size: usize,
}

/// Adds the nodes of the subtree over some places in order, the first of which has position `base` in the tree's order; returns its
/// box. Recursion is bounded: a code has [`PLACE_BITS`] bits for each axis, and triangles with equal ones are halved.
fn halve(nodes: &mut Vec<Node>, places: &[Place], base: usize, leaves: &Leaves) -> (DVec3, DVec3) {
    let here = nodes.len();
    nodes.push(Node { lo: DVec3::ZERO, hi: DVec3::ZERO, link: base as u32, count: places.len() as u32 });
    let (lo, hi) = if places.len() <= leaves.leaf_size {
        let corners = leaves.corners[base..base + places.len()].iter().flatten();
        corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| (lo.min(*p), hi.max(*p)))
    } else {
        let differ = places[0].0 ^ places[places.len() - 1].0;
        let middle = match differ.checked_ilog2() {
            Some(bit) => places.partition_point(|place| place.0 >> bit & 1 == 0),
            None => places.len() / 2,
        };
        nodes[here].count = 0;
        halve_parts(nodes, here, places.split_at(middle), base, leaves)
    };
    (nodes[here].lo, nodes[here].hi) = (lo, hi);
    (lo, hi)
}

/// Adds the nodes of both halves of the last node, which is number `here`; returns the box of both. Large ones by two threads.
fn halve_parts(
    nodes: &mut Vec<Node>,
    here: usize,
    (low, high): (&[Place], &[Place]),
    base: usize,
    leaves: &Leaves,
) -> (DVec3, DVec3) {
    let (first, second) = if low.len() + high.len() > PARALLEL_SIZE {
        let subtree = |places: &[Place], base: usize| {
            let mut nodes = Vec::with_capacity(2 * places.len() / leaves.leaf_size + 1);
            let bounds = halve(&mut nodes, places, base, leaves);
            (nodes, bounds)
        };
        let ((low_nodes, first), (high_nodes, second)) =
            rayon::join(|| subtree(low, base), || subtree(high, base + low.len()));
        nodes.extend_from_slice(&low_nodes);
        nodes[here].link = (nodes.len() - here) as u32;
        nodes.extend_from_slice(&high_nodes);
        (first, second)
    } else {
        let first = halve(nodes, low, base, leaves);
        nodes[here].link = (nodes.len() - here) as u32;
        (first, halve(nodes, high, base + low.len(), leaves))
    };
    (first.0.min(second.0), first.1.max(second.1))
}

/// Nodes of the subtree over `items`, whose first entry has position `base` in the tree's order.
/// Recursion is bounded by [`MAX_DEPTH`].
fn build_range(items: &mut [Item], base: usize, depth: usize, leaf_size: usize) -> Vec<Node> {
    let mut nodes = Vec::with_capacity(2 * items.len() / leaf_size + 1);
    build_into(&mut nodes, items, base, depth, leaf_size);
    nodes
}

fn build_into(nodes: &mut Vec<Node>, items: &mut [Item], base: usize, depth: usize, leaf_size: usize) {
    let first = items[0];
    let (lo, hi) = items.iter().fold((first.lo, first.hi), |(lo, hi), i| (lo.min(i.lo), hi.max(i.hi)));
    let here = nodes.len();
    nodes.push(Node { lo, hi, link: base as u32, count: items.len() as u32 });
    if items.len() <= leaf_size {
        return;
    }
    let middle = split(items, depth);
    let (left, right) = items.split_at_mut(middle);
    if left.len() + right.len() > PARALLEL_SIZE {
        let (first, second) = rayon::join(
            || build_range(left, base, depth + 1, leaf_size),
            || build_range(right, base + middle, depth + 1, leaf_size),
        );
        nodes.extend_from_slice(&first);
        nodes[here].link = (nodes.len() - here) as u32;
        nodes.extend_from_slice(&second);
    } else {
        build_into(nodes, left, base, depth + 1, leaf_size);
        nodes[here].link = (nodes.len() - here) as u32;
        build_into(nodes, right, base + middle, depth + 1, leaf_size);
    }
    nodes[here].count = 0;
}

/// Reorders the items so that those before the returned position make one child; both children get at least one.
fn split(items: &mut [Item], depth: usize) -> usize {
    let first = items[0].position();
    let (lo, hi) =
        items.iter().fold((first, first), |(lo, hi), i| (lo.min(i.position()), hi.max(i.position())));
    let axis = (hi - lo).max_position();
    let scale = BINS as f64 * (1.0 - 1e-9) / (hi - lo)[axis];
    let bin_of = |item: &Item| ((item.position()[axis] - lo[axis]) * scale) as usize;
    let cut = if depth < UNEVEN_DEPTH && scale.is_finite() { best_bin(items, bin_of) } else { None };
    if let Some(bin) = cut {
        return partition(items, |item| bin_of(item) < bin);
    }
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| {
        a.position()[axis].total_cmp(&b.position()[axis]).then(a.face.cmp(&b.face))
    });
    middle
}

/// The bin before which a cut costs least by the surface-area heuristic; `None` if all items share a bin.
fn best_bin(items: &[Item], bin_of: impl Fn(&Item) -> usize) -> Option<usize> {
    const EMPTY: (DVec3, DVec3, usize) = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0);
    let merge = |a: (DVec3, DVec3, usize), b: (DVec3, DVec3, usize)| (a.0.min(b.0), a.1.max(b.1), a.2 + b.2);
    let cost = |(lo, hi, count): (DVec3, DVec3, usize)| {
        let d = hi - lo;
        (d.x * d.y + d.y * d.z + d.z * d.x) * count as f64
    };
    let mut bins = [EMPTY; BINS];
    for item in items {
        let bin = bin_of(item).min(BINS - 1);
        bins[bin] = merge(bins[bin], (item.lo, item.hi, 1));
    }
    let mut above = [EMPTY; BINS + 1];
    for bin in (0..BINS).rev() {
        above[bin] = merge(above[bin + 1], bins[bin]);
    }
    let (mut best, mut best_cost, mut below) = (None, f64::INFINITY, EMPTY);
    for bin in 1..BINS {
        below = merge(below, bins[bin - 1]);
        if below.2 > 0 && above[bin].2 > 0 {
            let total = cost(below) + cost(above[bin]);
            if total < best_cost {
                (best, best_cost) = (Some(bin), total);
            }
        }
    }
    best
}

/// Moves the items for which `first` holds to the front, unstably, and returns how many there are.
fn partition(items: &mut [Item], first: impl Fn(&Item) -> bool) -> usize {
    let mut kept = 0;
    for i in 0..items.len() {
        if first(&items[i]) {
            items.swap(kept, i);
            kept += 1;
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::soup;

    fn depth(tree: &Tree) -> usize {
        let (mut deepest, mut stack) = (0, vec![(0, 1)]);
        while let Some((index, depth)) = stack.pop() {
            deepest = deepest.max(depth);
            if let Content::Inner(a, b) = tree.nodes[index].content(index) {
                stack.extend([(a, depth + 1), (b, depth + 1)]);
            }
        }
        deepest
    }

    #[test]
    fn leaves_hold_every_triangle_once() {
        let mesh = soup(3, 10_000);
        for tree in [Tree::build(&mesh, 4), Tree::by_place(&mesh, 4).0] {
            check_leaves(&tree, &mesh);
        }
    }

    /// Checks that every triangle is in one leaf, and in the boxes of that and of all nodes above.
    fn check_leaves(tree: &Tree, mesh: &TriangleMesh) {
        let mut faces = Vec::new();
        for (index, node) in tree.nodes.iter().enumerate() {
            if let Content::Inner(a, b) = node.content(index) {
                let children = [&tree.nodes[a], &tree.nodes[b]];
                assert!(children.iter().all(|c| c.lo.cmpge(node.lo).all() && c.hi.cmple(node.hi).all()));
            }
            if let Content::Leaf(range) = node.content(index) {
                assert!(range.len() <= 4);
                let corners = tree.order[range.clone()].iter().flat_map(|face| mesh.corners(*face as usize));
                corners.for_each(|p| assert!(p.cmpge(node.lo).all() && p.cmple(node.hi).all()));
                faces.extend_from_slice(&tree.order[range]);
            }
        }
        faces.sort_unstable();
        assert!(faces.into_iter().eq(0..10_000));
    }

    #[test]
    fn equal_centroids_and_exponential_spacing_stay_shallow() {
        let mut mesh = soup(4, 1);
        mesh.triangles = vec![[0, 1, 2]; 20_000];
        assert!(
            depth(&Tree::build(&mesh, 4)) <= MAX_DEPTH && depth(&Tree::by_place(&mesh, 4).0) <= MAX_DEPTH
        );
        mesh.vertices = (0..900).map(|i| DVec3::X * 2f64.powi(i - 450)).collect();
        mesh.triangles = (0..900).map(|i| [i; 3]).collect();
        assert!(
            depth(&Tree::build(&mesh, 4)) <= MAX_DEPTH && depth(&Tree::by_place(&mesh, 4).0) <= MAX_DEPTH
        );
    }
}
