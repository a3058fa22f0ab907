//! Voxels that are certain to lie on one side of the surface.
//!
//! No surface lies in the open balls around two voxels with their distances as radii. For face neighbours whose
//! distances add up to more than one voxel the balls cover the way between them, so both are on one side, and one
//! winding number serves all voxels of a block connected that way.

use crate::descent::{PARTS, part_number, part_position};
use isv_volume::{BlockEdge, VoxelMask};

/// Slack, in voxels, for the rounding of distances.
const SLACK: f32 = 1e-3;

/// Face neighbours whose distances add up to more are on one side.
const JOINED: f32 = 1.0 + SLACK;

/// Regions nowhere deeper than this, in voxels, are looked at a second time.
const SHALLOW: f32 = 0.5;

/// Label of a voxel that belongs to no region, or to none yet.
const EXCLUDED: u16 = u16::MAX;

/// A voxel of a tile: its block there, and its index in the block.
pub(crate) type TileVoxel = (usize, usize);

/// The distances of the voxels of a block, and the regions they fall into; its buffers are reused from block to block.
#[derive(Default)]
pub(crate) struct Regions {
    /// Unsigned distances in voxels, exact as far as is certain, and no less than that beyond.
    pub(crate) distances: Vec<f32>,
    /// Up to where distances are exact.
    certain: f32,
    /// Voxels whose closest surface point lies on a wide hole. They belong to no region, for near a hole there is a way from
    /// inside to outside.
    pub(crate) unobserved: Option<VoxelMask>,
    /// Region of each voxel.
    labels: Vec<u16>,
    /// Whether each region is inside; `None` while not known.
    inside: Vec<Option<bool>>,
    /// The voxel of largest distance of each region.
    deepest: Vec<usize>,
    /// Distances, minus infinity for voxels to be left alone.
    radii: Vec<f32>,
    /// Of labels given before all of a region was seen, one that it is joined to, no larger than itself.
    joined: Vec<u16>,
}

impl Regions {
    /// Forgets everything, and makes room for the distances of so many voxels, which will be exact up to `certain`.
    pub(crate) fn restart(&mut self, voxels: usize, certain: f32) {
        self.distances.resize(voxels, 0.0);
        self.certain = certain;
        self.unobserved = None;
        self.inside.clear();
        self.deepest.clear();
        self.labels.clear();
    }

    /// Finds the regions.
    pub(crate) fn divide(&mut self, edge: BlockEdge) {
        if self.is_one_region() {
            let most = self.distances.iter().fold(0.0, |a: f32, b| if *b > a { *b } else { a });
            self.deepest.extend(self.distances.iter().position(|distance| *distance == most));
            self.labels.resize(self.distances.len(), 0);
        } else {
            self.label(edge.voxels());
            self.number_regions();
        }
        self.inside.resize(self.deepest.len(), None);
    }

    /// Whether there can be no second region.
    fn is_one_region(&self) -> bool {
        let least = self.distances.iter().fold(f32::INFINITY, |a, b| if *b < a { *b } else { a });
        self.unobserved.is_none() && 2.0 * least > JOINED
    }

    /// Labels voxels like those of their preceding neighbours that they are joined to, and notes which labels are joined.
    fn label(&mut self, n: usize) {
        self.radii.clear();
        self.radii.extend_from_slice(&self.distances);
        if let Some(mask) = &self.unobserved {
            let excluded = |voxel: &usize| mask.contains(*voxel);
            (0..self.radii.len()).filter(excluded).for_each(|voxel| self.radii[voxel] = f32::NEG_INFINITY);
        }
        self.labels.resize(self.radii.len(), EXCLUDED);
        self.joined.clear();
        for row in (0..self.radii.len()).step_by(n) {
            let rows_before = [(n, row % (n * n) >= n), (n * n, row >= n * n)];
            let mut label = EXCLUDED;
            for voxel in row..row + n {
                let radius = self.radii[voxel];
                if voxel == row || radius + self.radii[voxel - 1] <= JOINED {
                    label = EXCLUDED;
                }
                for (stride, exists) in rows_before {
                    if exists && radius + self.radii[voxel - stride] > JOINED {
                        let other = self.labels[voxel - stride];
                        label = if other == label { label } else { self.join(label, other) };
                    }
                }
                if label == EXCLUDED && radius >= 0.0 {
                    label = self.joined.len() as u16;
                    self.joined.push(label);
                }
                self.labels[voxel] = label;
            }
        }
    }

    /// Joins two labels, of which the first may be none yet, and returns the lowest that they are joined to.
    fn join(&mut self, a: u16, b: u16) -> u16 {
        let root = |mut label: u16| {
            while self.joined[usize::from(label)] != label {
                label = self.joined[usize::from(label)];
            }
            label
        };
        let b = root(b);
        if a == EXCLUDED {
            return b;
        }
        let a = root(a);
        self.joined[usize::from(a.max(b))] = a.min(b);
        a.min(b)
    }

    /// Replaces labels by the numbers of their regions, in the order of their first voxels, and finds the deepest voxels.
    fn number_regions(&mut self) {
        let mut count = 0;
        for label in 0..self.joined.len() {
            let lower = usize::from(self.joined[label]);
            // Lower labels are replaced already.
            self.joined[label] = if lower == label { count } else { self.joined[lower] };
            count += u16::from(lower == label);
        }
        self.deepest.resize(usize::from(count), usize::MAX);
        for (voxel, label) in self.labels.iter_mut().enumerate() {
            let Some(region) = self.joined.get(usize::from(*label)) else { continue };
            *label = *region;
            let deepest = &mut self.deepest[usize::from(*region)];
            if *deepest == usize::MAX || self.distances[voxel] > self.distances[*deepest] {
                *deepest = voxel;
            }
        }
    }

    /// Finds the sides of all regions of some blocks of a tile, by asking `are_inside` about the deepest voxels of groups of
    /// regions that are joined across the faces between blocks. Shallow groups are mostly single voxels, and have the side of a
    /// deeper one that they are joined to diagonally.
    pub(crate) fn settle(
        tile: &mut [Self],
        blocks: &[usize],
        edge: BlockEdge,
        mut are_inside: impl FnMut(&[TileVoxel]) -> Vec<bool>,
    ) {
        let groups = join_across_faces(tile, blocks, edge);
        ask(tile, &groups, SHALLOW, &mut are_inside);
        for &block in blocks {
            if !tile[block].inside.contains(&None) {
                continue;
            }
            for voxel in 0..tile[block].labels.len() {
                let label = usize::from(tile[block].labels[voxel]);
                if tile[block].inside.get(label) == Some(&None) {
                    tile[block].inside[label] = side_by_neighbours(tile, block, voxel, edge);
                }
            }
        }
        ask(tile, &groups, 0.0, &mut are_inside);
    }

    /// Whether a voxel is inside, after [`Self::settle`].
    pub(crate) fn is_inside(&self, voxel: usize) -> bool {
        self.inside.get(usize::from(self.labels[voxel])) == Some(&Some(true))
    }
}

/// A region of a tile: its block there, and its number in the block.
type TileRegion = (usize, usize);

/// Regions of several blocks that are on one side.
struct Group {
    members: Vec<TileRegion>,
    deepest: TileVoxel,
    depth: f32,
}

/// Groups the regions of some blocks of a tile by which are joined, directly or not, by face neighbours in different blocks. Blocks
/// with voxels on a wide hole stay by themselves: through a hole, joined voxels lead from inside to outside.
fn join_across_faces(tile: &[Regions], blocks: &[usize], edge: BlockEdge) -> Vec<Group> {
    let mut first = [0; PARTS];
    let mut regions: Vec<TileRegion> = Vec::new();
    for &block in blocks {
        first[block] = regions.len();
        regions.extend((0..tile[block].inside.len()).map(|region| (block, region)));
    }
    let mut parents: Vec<usize> = (0..regions.len()).collect();
    for &block in blocks {
        for axis in 0..3 {
            let mut position = part_position(block);
            position[axis] += 1;
            let other = if position[axis] < 4 { part_number(position) } else { continue };
            let is_masked = tile[block].unobserved.is_some() || tile[other].unobserved.is_some();
            if !tile[other].labels.is_empty() && !is_masked {
                join_face(
                    [&tile[block], &tile[other]],
                    [first[block], first[other]],
                    axis,
                    edge,
                    &mut parents,
                );
            }
        }
    }
    let mut numbers = vec![usize::MAX; regions.len()];
    let mut groups: Vec<Group> = Vec::new();
    for (region, &(block, number)) in regions.iter().enumerate() {
        let root = root(&mut parents, region);
        let voxel = tile[block].deepest[number];
        let depth = tile[block].distances[voxel];
        if numbers[root] == usize::MAX {
            numbers[root] = groups.len();
            groups.push(Group { members: Vec::new(), deepest: (block, voxel), depth });
        }
        let group = &mut groups[numbers[root]];
        group.members.push((block, number));
        if depth > group.depth {
            (group.deepest, group.depth) = ((block, voxel), depth);
        }
    }
    groups
}

/// Joins the regions on both sides of the face between two blocks, of which the second follows the first along an axis.
/// `first`: the places of their regions in `parents`.
fn join_face(
    [lower, upper]: [&Regions; 2],
    first: [usize; 2],
    axis: usize,
    edge: BlockEdge,
    parents: &mut [usize],
) {
    let n = edge.voxels();
    let strides = [1, n, n * n];
    let (along, a, b) = (strides[axis], strides[(axis + 1) % 3], strides[(axis + 2) % 3]);
    let mut last = (EXCLUDED, EXCLUDED);
    for place in 0..n * n {
        let above = place % n * a + place / n * b;
        let below = above + (n - 1) * along;
        let labels = (lower.labels[below], upper.labels[above]);
        let joined = lower.distances[below] + upper.distances[above] > JOINED;
        if !joined || labels == last || labels.0 == EXCLUDED || labels.1 == EXCLUDED {
            continue;
        }
        last = labels;
        let [p, q] = [first[0] + usize::from(labels.0), first[1] + usize::from(labels.1)]
            .map(|region| root(parents, region));
        parents[p.max(q)] = p.min(q);
    }
}

/// The representative of a region, halving its path on the way.
fn root(parents: &mut [usize], mut region: usize) -> usize {
    while parents[region] != region {
        parents[region] = parents[parents[region]];
        region = parents[region];
    }
    region
}

/// Asks for the sides of the groups not known yet, of those that are `depth` deep.
fn ask(
    tile: &mut [Regions],
    groups: &[Group],
    depth: f32,
    are_inside: &mut impl FnMut(&[TileVoxel]) -> Vec<bool>,
) {
    let is_unknown = |&(block, region): &TileRegion| tile[block].inside[region].is_none();
    let unknown: Vec<&Group> =
        groups.iter().filter(|group| group.depth >= depth && group.members.iter().any(is_unknown)).collect();
    if unknown.is_empty() {
        return;
    }
    let voxels: Vec<TileVoxel> = unknown.iter().map(|group| group.deepest).collect();
    for (group, side) in unknown.into_iter().zip(are_inside(&voxels)) {
        for &(block, region) in &group.members {
            tile[block].inside[region].get_or_insert(side);
        }
    }
}

/// Ways to the voxels around a voxel, up to two steps along each axis, those next to it first.
const WAYS: [[i32; 3]; 124] = {
    let (mut ways, mut count, mut reach) = ([[0; 3]; 124], 0, 1);
    while reach <= 2 {
        let mut place = 0;
        while place < 125 {
            let way: [i32; 3] = [place % 5 - 2, place / 5 % 5 - 2, place / 25 - 2];
            let is_near = way[0].abs() <= 1 && way[1].abs() <= 1 && way[2].abs() <= 1;
            if place != 62 && is_near == (reach == 1) {
                ways[count] = way;
                count += 1;
            }
            place += 1;
        }
        reach += 1;
    }
    ways
};

/// The side of a voxel by one up to two steps away whose side is known, if that lies in the same tile: beside a slanting surface the
/// balls that reach each other are those of voxels along its normal.
fn side_by_neighbours(tile: &[Regions], block: usize, voxel: usize, edge: BlockEdge) -> Option<bool> {
    let (bits, last, n) = (edge.log2(), edge.voxels() as i32 - 1, 4 * edge.voxels() as i32);
    let (corner, at) = (part_position(block).map(|c| c << bits), voxel as i32);
    let [x, y, z] =
        [corner[0] + (at & last), corner[1] + (at >> bits & last), corner[2] + (at >> (2 * bits))];
    for [dx, dy, dz] in WAYS {
        let place = [x + dx, y + dy, z + dz];
        if !place.iter().all(|c| (0..n).contains(c)) {
            continue;
        }
        let other = &tile[part_number(place.map(|c| c >> bits))];
        let [u, v, w] = place.map(|c| (c & last) as usize);
        let neighbour = edge.voxel_index(u, v, w);
        let Some(label) = other.labels.get(neighbour) else { continue };
        let length = ((dx * dx + dy * dy + dz * dz) as f32).sqrt();
        let radius = other.distances[neighbour].min(other.certain);
        let joined = tile[block].distances[voxel] + radius > length + SLACK;
        let side = other.inside.get(usize::from(*label)).copied().flatten();
        if joined && side.is_some() {
            return side;
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    /// The inside voxels of the first block of a tile that has no other.
    fn inside_voxels(
        distances: &[f32],
        excluded: Option<&VoxelMask>,
        are_inside: &impl Fn(&[TileVoxel]) -> Vec<bool>,
    ) -> Vec<usize> {
        let mut tile: Vec<Regions> = (0..PARTS).map(|_| Regions::default()).collect();
        tile[0].restart(0, f32::INFINITY);
        tile[0].distances.extend_from_slice(distances);
        tile[0].unobserved = excluded.cloned();
        tile[0].divide(BlockEdge::E4);
        Regions::settle(&mut tile, &[0], BlockEdge::E4, are_inside);
        (0..64).filter(|voxel| tile[0].is_inside(*voxel)).collect()
    }

    #[test]
    fn a_plane_splits_a_block_and_a_mask_splits_what_it_covers() {
        let distances: Vec<f32> = (0..64).map(|v| (v / 16) as f32 - 1.4).map(f32::abs).collect();
        let asked = RefCell::new(Vec::new());
        let classify = |excluded: Option<&VoxelMask>| {
            let are_inside = |voxels: &[TileVoxel]| {
                asked.borrow_mut().extend(voxels.iter().map(|voxel| voxel.1));
                voxels.iter().map(|voxel| voxel.1 < 16).collect()
            };
            inside_voxels(&distances, excluded, &are_inside).len()
        };
        assert_eq!(classify(None), 32);
        let mut mask = VoxelMask::empty(BlockEdge::E4);
        (16..32).for_each(|v| mask.insert(v));
        assert_eq!(classify(Some(&mask)), 16);
        assert_eq!(asked.into_inner(), [0, 48, 0, 48]);
    }

    #[test]
    fn voxels_beside_a_slanting_plane_are_joined_diagonally() {
        // The plane x + y + z = 4.5 - epsilon: voxels whose centre is 0.05 above touch their neighbours' balls only diagonally.
        let distances: Vec<f32> =
            (0..64).map(|v| ((v % 4 + v / 4 % 4 + v / 16) as f32 - 3.9) / 3f32.sqrt()).collect();
        let asked = RefCell::new(0);
        let magnitudes: Vec<f32> = distances.iter().map(|d| d.abs()).collect();
        let inside = inside_voxels(&magnitudes, None, &|voxels: &[TileVoxel]| {
            *asked.borrow_mut() += voxels.len();
            voxels.iter().map(|voxel| distances[voxel.1] < 0.0).collect()
        });
        assert!(inside.into_iter().eq((0..64).filter(|v| distances[*v] < 0.0)));
        assert!(asked.into_inner() < 12);
    }
}
