//! Voxels of a block that are certain to lie on one side of the surface.
//!
//! No surface lies in the open balls around two voxels with their distances as radii. For face neighbours whose
//! distances add up to more than one voxel the balls cover the way between them, so both are on one side, and one
//! winding number serves all voxels connected that way.

use isv_volume::{BlockEdge, VoxelMask};

/// Slack, in voxels, for the rounding of distances.
const SLACK: f32 = 1e-3;

/// Regions nowhere deeper than this, in voxels, are looked at a second time.
const SHALLOW: f32 = 0.5;

/// Voxel of no region yet, and voxel to be left alone.
const UNSEEN: u16 = u16::MAX;
const EXCLUDED: u16 = u16::MAX - 1;

/// Finds the sides of the voxels of a block; its buffers are reused from block to block.
#[derive(Default)]
pub(crate) struct Regions {
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
    /// Decides for every voxel whether it is inside, asking `are_inside` about one voxel of each region: that of largest
    /// distance. Voxels in `excluded` belong to no region (near a hole there is a way from inside to outside) and count as
    /// outside.
    pub(crate) fn classify(
        &mut self,
        distances: &[f32],
        edge: BlockEdge,
        excluded: Option<&VoxelMask>,
        are_inside: impl Fn(&[usize]) -> Vec<bool>,
    ) {
        self.inside.clear();
        self.members.clear();
        self.starts.clear();
        if let Some(deepest) = self.take_whole(distances, excluded) {
            self.inside.push(are_inside(&[deepest]).first().copied());
            return;
        }
        self.labels.clear();
        let label = |v| if excluded.is_some_and(|mask| mask.contains(v)) { EXCLUDED } else { UNSEEN };
        self.labels.extend((0..distances.len()).map(label));
        self.deepest.clear();
        for start in 0..distances.len() {
            if self.labels[start] == UNSEEN {
                let deepest = self.flood(distances, edge, start);
                self.deepest.push(deepest);
                self.inside.push(None);
            }
        }
        self.starts.push(self.members.len());
        self.ask(|region| distances[region] >= SHALLOW, &are_inside);
        for region in 0..self.inside.len() {
            if self.inside[region].is_none() {
                self.inside[region] = self.side_of_diagonal(distances, edge, region);
            }
        }
        self.ask(|_| true, &are_inside);
    }

    /// Asks for the sides of the regions not known yet, of those whose voxel of largest distance is `chosen`.
    fn ask(&mut self, chosen: impl Fn(usize) -> bool, are_inside: &impl Fn(&[usize]) -> Vec<bool>) {
        let wanted = |region: &usize| self.inside[*region].is_none() && chosen(self.deepest[*region]);
        let regions: Vec<usize> = (0..self.inside.len()).filter(wanted).collect();
        let voxels: Vec<usize> = regions.iter().map(|region| self.deepest[*region]).collect();
        for (region, side) in regions.into_iter().zip(are_inside(&voxels)) {
            self.inside[region] = Some(side);
        }
    }

    /// The voxels that are inside, after [`Self::classify`].
    pub(crate) fn inside_voxels(&self) -> impl Iterator<Item = usize> {
        let bounds = self.starts.windows(2).zip(&self.inside).filter(|(_, side)| **side == Some(true));
        bounds.flat_map(|(bounds, _)| &self.members[bounds[0]..bounds[1]]).map(|voxel| usize::from(*voxel))
    }

    /// Makes all voxels one region if there can be no second.
    fn take_whole(&mut self, distances: &[f32], excluded: Option<&VoxelMask>) -> Option<usize> {
        let least = distances.iter().fold(f32::INFINITY, |a, b| if *b < a { *b } else { a });
        if excluded.is_some() || 2.0 * least <= 1.0 + SLACK {
            return None;
        }
        self.members.extend(0..distances.len() as u16);
        self.starts.extend([0, distances.len()]);
        let deepest =
            |best: usize, voxel: usize| if distances[voxel] > distances[best] { voxel } else { best };
        Some((0..distances.len()).fold(0, deepest))
    }

    /// Gathers the region of `start` and returns its voxel of largest distance.
    fn flood(&mut self, distances: &[f32], edge: BlockEdge, start: usize) -> usize {
        let (n, bits) = (edge.voxels(), edge.log2());
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
        deepest
    }

    /// The side of a region by a neighbour across an edge or a corner whose side is known: beside a slanting surface the
    /// balls that reach each other are those of diagonal neighbours.
    fn side_of_diagonal(&self, distances: &[f32], edge: BlockEdge, region: usize) -> Option<bool> {
        let n = edge.voxels() as i32;
        for &voxel in &self.members[self.starts[region]..self.starts[region + 1]] {
            let at = i32::from(voxel);
            let [x, y, z] = [at % n, at / n % n, at / (n * n)];
            for offset in 0..27 {
                let [dx, dy, dz] = [offset % 3 - 1, offset / 3 % 3 - 1, offset / 9 - 1];
                let [u, v, w] = [x + dx, y + dy, z + dz];
                if ![u, v, w].iter().all(|c| (0..n).contains(c)) {
                    continue;
                }
                let other = ((w * n + v) * n + u) as usize;
                let length = ((dx * dx + dy * dy + dz * dz) as f32).sqrt();
                let joined = distances[usize::from(voxel)] + distances[other] > length + SLACK;
                let side = self.inside.get(usize::from(self.labels[other])).copied().flatten();
                if joined && side.is_some() {
                    return side;
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    #[test]
    fn a_plane_splits_a_block_and_a_mask_splits_what_it_covers() {
        let distances: Vec<f32> = (0..64).map(|v| (v / 16) as f32 - 1.4).map(f32::abs).collect();
        let mut regions = Regions::default();
        let asked = RefCell::new(Vec::new());
        let mut classify = |excluded: Option<&VoxelMask>| {
            regions.classify(&distances, BlockEdge::E4, excluded, |voxels| {
                asked.borrow_mut().extend_from_slice(voxels);
                voxels.iter().map(|voxel| *voxel < 16).collect()
            });
            regions.inside_voxels().count()
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
        let mut regions = Regions::default();
        let asked = RefCell::new(0);
        let magnitudes: Vec<f32> = distances.iter().map(|d| d.abs()).collect();
        regions.classify(&magnitudes, BlockEdge::E4, None, |voxels| {
            *asked.borrow_mut() += voxels.len();
            voxels.iter().map(|voxel| distances[*voxel] < 0.0).collect()
        });
        let mut inside: Vec<_> = regions.inside_voxels().collect();
        inside.sort_unstable();
        assert!(inside.into_iter().eq((0..64).filter(|v| distances[*v] < 0.0)));
        assert!(asked.into_inner() < 12);
    }
}
