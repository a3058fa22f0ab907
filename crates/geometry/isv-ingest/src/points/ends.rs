//! Ends of the captured surface.
//!
//! The field goes on beyond the last surfels, so that the gaps between samples close. If it finds no surfels
//! on the other side, it has to be taken back. All voxels are then unobserved that can be reached through
//! uncertain ones from the voxels where the field ends beside the surface. A gap that has certain surface all
//! around it stays closed.

use crate::points::bricks::{BRICK_VOXELS, Bricks, step};
use crate::points::near::{HEIGHT, NearBrick};
use crate::points::sites::EXPLAINED;
use isv_volume::{BlockEdge, VoxelMask};
use rayon::prelude::*;

/// Voxels this close to the surface, in voxels, are looked at. The field reaches a voxel higher, so that a
/// neighbour without a distance is beside the surface and not above it.
const LEVEL: f32 = HEIGHT - 1.05;

/// A border has at least this many voxels; a hole of three voxels has more.
const BORDER: usize = 12;

/// A voxel that this many neighbours contradict is wrong.
const CONTRADICTION: usize = 3;

/// The field around surfels, without what it makes up beyond its ends.
pub(crate) struct NearField {
    pub(crate) bricks: Bricks<NearBrick>,
    /// For each brick the voxels whose distance leads to surface beyond an end.
    pub(crate) beyond: Vec<VoxelMask>,
}

/// A voxel: its brick, and its index there.
pub(crate) type VoxelAt = (u32, u16);

impl NearField {
    /// Finds the ends of a field.
    pub(crate) fn new(bricks: Bricks<NearBrick>) -> Self {
        let beyond = vec![VoxelMask::empty(BlockEdge::E8); bricks.coords.len()];
        let mut field = Self { bricks, beyond };
        field.repair();
        let ends: Vec<VoxelAt> =
            (0..field.beyond.len()).into_par_iter().flat_map_iter(|brick| field.ends(brick)).collect();
        for end in &ends {
            field.take_back(*end);
        }
        field
    }

    /// Takes back the surface that can be reached from an end through uncertain voxels, if it is a border and not a spot.
    fn take_back(&mut self, end: VoxelAt) {
        let (mut found, mut next, mut ends) = (vec![end], 0, 0);
        if self.is_beyond(end) {
            return;
        }
        self.beyond[end.0 as usize].insert(usize::from(end.1));
        while next < found.len() {
            ends += usize::from(self.is_end(found[next]));
            for side in 0..6 {
                let Some(at) = self.neighbour(found[next], side) else { continue };
                if self.is_open(at) && !self.is_beyond(at) {
                    self.beyond[at.0 as usize].insert(usize::from(at.1));
                    found.push(at);
                }
            }
            next += 1;
        }
        if ends < BORDER {
            for (brick, voxel) in found {
                self.beyond[brick as usize].remove(usize::from(voxel));
            }
        }
    }

    /// Gives voxels that most of their neighbours contradict the mean of these.
    fn repair(&mut self) {
        let changes: Vec<(VoxelAt, f32)> = (0..self.beyond.len())
            .into_par_iter()
            .flat_map_iter(|brick| (0..BRICK_VOXELS).map(move |voxel| (brick as u32, voxel as u16)))
            .filter_map(|at| Some((at, self.contradicted(at)?)))
            .collect();
        for ((brick, voxel), value) in changes {
            self.bricks.items[brick as usize].distances[usize::from(voxel)] = value;
        }
    }

    /// The mean of a voxel's neighbours, if three of them are on the other side of a surface that cannot be there.
    fn contradicted(&self, at: VoxelAt) -> Option<f32> {
        let s = self.distance(at);
        if s.abs() < 0.25 || s.is_infinite() {
            return None;
        }
        let (mut against, mut sum, mut count) = (0, 0.0, 0.0);
        for t in (0..6).filter_map(|side| self.neighbour(at, side)).map(|n| self.distance(n)) {
            if t.is_finite() {
                sum += t;
                count += 1.0;
                against += usize::from((t < 0.0) != (s < 0.0) && s.abs() + t.abs() > EXPLAINED);
            }
        }
        (against >= CONTRADICTION).then(|| sum / count)
    }

    /// The voxels of a brick at which uncertain surface leads nowhere.
    fn ends(&self, brick: usize) -> impl Iterator<Item = VoxelAt> {
        (0..BRICK_VOXELS).map(move |voxel| (brick as u32, voxel as u16)).filter(|at| self.is_end(*at))
    }

    fn is_end(&self, at: VoxelAt) -> bool {
        self.is_open(at)
            && (0..6).any(|side| self.neighbour(at, side).is_none_or(|n| self.distance(n).is_infinite()))
    }

    /// Whether uncertain surface passes a voxel.
    fn is_open(&self, at: VoxelAt) -> bool {
        let near = &self.bricks.items[at.0 as usize];
        let s = near.distances[usize::from(at.1)];
        near.uncertain.contains(usize::from(at.1))
            && s.abs() <= LEVEL
            && (0..6).any(|side| {
                self.neighbour(at, side).is_some_and(|n| {
                    let t = self.distance(n);
                    (t < 0.0) != (s < 0.0) && s.abs() + t.abs() <= EXPLAINED
                })
            })
    }

    pub(crate) fn is_beyond(&self, (brick, voxel): VoxelAt) -> bool {
        self.beyond[brick as usize].contains(usize::from(voxel))
    }

    /// The signed distance at a voxel; infinite where there is no surfel near.
    pub(crate) fn distance(&self, (brick, voxel): VoxelAt) -> f32 {
        self.bricks.items[brick as usize].distances[usize::from(voxel)]
    }

    /// Whether the surface near a voxel is seen.
    pub(crate) fn is_seen(&self, at: VoxelAt) -> bool {
        self.distance(at).is_finite() && !self.is_beyond(at)
    }

    /// The neighbour of a voxel: along axis `side / 2`, down if `side` is even. `None` where there is no brick.
    pub(crate) fn neighbour(&self, (brick, voxel): VoxelAt, side: usize) -> Option<VoxelAt> {
        let (to, leaves) = step(BlockEdge::E8, usize::from(voxel), side);
        let brick = match leaves {
            None => brick,
            Some(by) => self.bricks.position(self.bricks.coords[brick as usize].offset(by))? as u32,
        };
        Some((brick, to as u16))
    }
}
