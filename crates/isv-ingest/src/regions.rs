//! Voxels that are certain to lie on one side of the surface.
//!
//! No surface lies in the open balls around two voxels with their distances as radii. For face neighbours whose
//! distances add up to more than one voxel the balls cover the way between them, so both are on one side, and one
//! winding number serves all voxels of a block connected that way.

#[cfg(test)]
use crate::descent::PARTS;
use crate::descent::{part_number, part_position};
use isv_volume::{BlockEdge, VoxelMask};

/// Slack, in voxels, for the rounding of distances.
const SLACK: f32 = 1e-3;

/// Regions nowhere deeper than this, in voxels, are looked at a second time.
const SHALLOW: f32 = 0.5;

/// Voxel of no region yet, and voxel to be left alone.
const UNSEEN: u16 = u16::MAX;
const EXCLUDED: u16 = u16::MAX - 1;

/// The distances of the voxels of a block, and the regions they fall into; its buffers are reused from block to block.
#[derive(Default)]
pub(crate) struct Regions {
    /// Unsigned distances in voxels, exact up to the band's width and more than it beyond.
    pub(crate) distances: Vec<f32>,
    /// Voxels whose closest surface point lies on a wide hole. They belong to no region, for near a hole there is a way from
    /// inside to outside.
    pub(crate) unobserved: Option<VoxelMask>,
    /// Region of each voxel.
    labels: Vec<u16>,
    /// Whether each region is inside; `None` while not known.
    inside: Vec<Option<bool>>,
    /// Voxels region after region, and where each region starts.
    members: Vec<u16>,
    starts: Vec<usize>,
    /// The voxel of largest distance of each region.
    deepest: Vec<usize>,
}

impl Regions {
    /// Forgets everything; all voxels become `distance` voxels from the surface.
    pub(crate) fn restart(&mut self, voxels: usize, distance: f32) {
        self.distances.clear();
        self.distances.resize(voxels, distance);
        self.unobserved = None;
        self.inside.clear();
        self.members.clear();
        self.starts.clear();
        self.deepest.clear();
        self.labels.clear();
    }

    /// Finds the regions, and the sides of all but shallow ones by asking `are_inside` about one voxel of each: that of
    /// largest distance.
    pub(crate) fn divide(&mut self, edge: BlockEdge, are_inside: &impl Fn(&[usize]) -> Vec<bool>) {
        if self.is_one_region() {
            self.take_whole();
        } else {
            let excluded = self.unobserved.as_ref();
            let label = |v| if excluded.is_some_and(|mask| mask.contains(v)) { EXCLUDED } else { UNSEEN };
            self.labels.extend((0..self.distances.len()).map(label));
            for start in 0..self.distances.len() {
                if self.labels[start] == UNSEEN {
                    self.flood(edge, start);
                }
            }
        }
        self.starts.push(self.members.len());
        self.ask(|distance| distance >= SHALLOW, are_inside);
    }

    /// Finds the sides of the regions not known yet: by their neighbours, or else by asking.
    pub(crate) fn settle(
        tile: &mut [Self],
        block: usize,
        edge: BlockEdge,
        are_inside: &impl Fn(&[usize]) -> Vec<bool>,
    ) {
        for region in 0..tile[block].inside.len() {
            if tile[block].inside[region].is_none() {
                tile[block].inside[region] = side_by_neighbours(tile, block, region, edge);
            }
        }
        tile[block].ask(|_| true, are_inside);
    }

    /// Asks for the sides of the regions not known yet, of those whose largest distance is `chosen`.
    fn ask(&mut self, chosen: impl Fn(f32) -> bool, are_inside: &impl Fn(&[usize]) -> Vec<bool>) {
        let depth = |region: usize| self.distances[self.deepest[region]];
        let wanted = |region: &usize| self.inside[*region].is_none() && chosen(depth(*region));
        let regions: Vec<usize> = (0..self.inside.len()).filter(wanted).collect();
        let voxels: Vec<usize> = regions.iter().map(|region| self.deepest[*region]).collect();
        for (region, side) in regions.into_iter().zip(are_inside(&voxels)) {
            self.inside[region] = Some(side);
        }
    }

    /// The voxels that are inside, after [`Self::settle`].
    pub(crate) fn inside_voxels(&self) -> impl Iterator<Item = usize> {
        let bounds = self.starts.windows(2).zip(&self.inside).filter(|(_, side)| **side == Some(true));
        bounds.flat_map(|(bounds, _)| &self.members[bounds[0]..bounds[1]]).map(|voxel| usize::from(*voxel))
    }

    /// Whether there can be no second region.
    fn is_one_region(&self) -> bool {
        let least = self.distances.iter().fold(f32::INFINITY, |a, b| if *b < a { *b } else { a });
        self.unobserved.is_none() && 2.0 * least > 1.0 + SLACK
    }

    /// Makes all voxels one region.
    fn take_whole(&mut self) {
        let deeper = |best, voxel| if self.distances[voxel] > self.distances[best] { voxel } else { best };
        self.deepest.push((0..self.distances.len()).fold(0, deeper));
        self.labels.resize(self.distances.len(), 0);
        self.members.extend(0..self.distances.len() as u16);
        self.starts.push(0);
        self.inside.push(None);
    }

    /// Gathers the region of `start`.
    fn flood(&mut self, edge: BlockEdge, start: usize) {
        let (n, bits) = (edge.voxels(), edge.log2());
        let distances = &self.distances;
        let label = self.inside.len() as u16;
        let (mut deepest, mut next) = (start, self.members.len());
        self.starts.push(next);
        self.members.push(start as u16);
        self.labels[start] = label;
        while next < self.members.len() {
            let voxel = usize::from(self.members[next]);
            next += 1;
            if distances[voxel] > distances[deepest] {
                deepest = voxel;
            }
            for axis in 0..3 {
                let (stride, position) = (1 << (axis * bits), voxel >> (axis * bits) & (n - 1));
                let neighbours =
                    [(position > 0).then(|| voxel - stride), (position + 1 < n).then(|| voxel + stride)];
                for other in neighbours.into_iter().flatten() {
                    if self.labels[other] == UNSEEN && distances[voxel] + distances[other] > 1.0 + SLACK {
                        self.labels[other] = label;
                        self.members.push(other as u16);
                    }
                }
            }
        }
        self.deepest.push(deepest);
        self.inside.push(None);
    }
}

/// The side of a region of a block by a neighbour across a face, an edge or a corner whose side is known, if that lies in the
/// same tile: beside a slanting surface the balls that reach each other are those of diagonal neighbours.
fn side_by_neighbours(tile: &[Regions], block: usize, region: usize, edge: BlockEdge) -> Option<bool> {
    let n = edge.voxels() as i32;
    let here = &tile[block];
    let corner = part_position(block).map(|c| c * n);
    for &voxel in &here.members[here.starts[region]..here.starts[region + 1]] {
        let at = i32::from(voxel);
        let [x, y, z] = [corner[0] + at % n, corner[1] + at / n % n, corner[2] + at / (n * n)];
        for offset in 0..27 {
            let [dx, dy, dz] = [offset % 3 - 1, offset / 3 % 3 - 1, offset / 9 - 1];
            let place = [x + dx, y + dy, z + dz];
            if !place.iter().all(|c| (0..4 * n).contains(c)) {
                continue;
            }
            let other = &tile[part_number(place.map(|c| c / n))];
            let [u, v, w] = place.map(|c| (c % n) as usize);
            let neighbour = edge.voxel_index(u, v, w);
            let Some(label) = other.labels.get(neighbour) else { continue };
            let length = ((dx * dx + dy * dy + dz * dz) as f32).sqrt();
            let joined = here.distances[usize::from(voxel)] + other.distances[neighbour] > length + SLACK;
            let side = other.inside.get(usize::from(*label)).copied().flatten();
            if joined && side.is_some() {
                return side;
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    /// The regions of the first block of a tile that has no other.
    fn settled(
        distances: &[f32],
        excluded: Option<&VoxelMask>,
        are_inside: &impl Fn(&[usize]) -> Vec<bool>,
    ) -> Regions {
        let mut tile: Vec<Regions> = (0..PARTS).map(|_| Regions::default()).collect();
        tile[0].distances.extend_from_slice(distances);
        tile[0].unobserved = excluded.cloned();
        tile[0].divide(BlockEdge::E4, are_inside);
        Regions::settle(&mut tile, 0, BlockEdge::E4, are_inside);
        tile.swap_remove(0)
    }

    #[test]
    fn a_plane_splits_a_block_and_a_mask_splits_what_it_covers() {
        let distances: Vec<f32> = (0..64).map(|v| (v / 16) as f32 - 1.4).map(f32::abs).collect();
        let asked = RefCell::new(Vec::new());
        let classify = |excluded: Option<&VoxelMask>| {
            let are_inside = |voxels: &[usize]| {
                asked.borrow_mut().extend_from_slice(voxels);
                voxels.iter().map(|voxel| *voxel < 16).collect()
            };
            settled(&distances, excluded, &are_inside).inside_voxels().count()
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
        let regions = settled(&magnitudes, None, &|voxels: &[usize]| {
            *asked.borrow_mut() += voxels.len();
            voxels.iter().map(|voxel| distances[*voxel] < 0.0).collect()
        });
        let mut inside: Vec<_> = regions.inside_voxels().collect();
        inside.sort_unstable();
        assert!(inside.into_iter().eq((0..64).filter(|v| distances[*v] < 0.0)));
        assert!(asked.into_inner() < 12);
    }
}
