//! Where the captured surface ends.
//!
//! The field goes on beyond the last surfels, so that the gaps between samples close. Where it finds no surfels on the other
//! side, it has to be taken back: from the voxels where the field ends beside the surface, all voxels that can be
//! reached through uncertain ones are unobserved. A gap that has certain surface all around it stays closed.

use crate::points::bricks::{BRICK, BRICK_VOXELS, Bricks};
use crate::points::near::{HEIGHT, NearBrick};
use isv_volume::{BlockEdge, VoxelMask};
use rayon::prelude::*;

/// Voxels this close to the surface, in voxels, are looked at; the field reaches a voxel higher, so that a neighbour without
/// a distance is beside the surface and not above it.
const LEVEL: f32 = HEIGHT - 1.05;

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
        let mut front: Vec<VoxelAt> =
            (0..field.beyond.len()).into_par_iter().flat_map_iter(|brick| field.ends(brick)).collect();
        if std::env::var_os("SEEDS").is_some() { eprintln!("seeds {}", front.len()); for at in front.iter().step_by(7) { let c = field.bricks.coords[at.0 as usize]; let v = at.1 as usize;
            let ns: Vec<f32> = (0..6).map(|s| field.neighbour(*at, s).map_or(99.0, |n| field.distance(n))).collect();
            eprintln!("{:?} s {:.2} n {:?} around {ns:.1?}", [c.x*8+(v%8) as i32, c.y*8+(v/8%8) as i32, c.z*8+(v/64) as i32], field.distance(*at), field.bricks.items[at.0 as usize].normal(v)); } }
        for (brick, voxel) in &front {
            field.beyond[*brick as usize].insert(usize::from(*voxel));
        }
        while let Some(at) = front.pop() {
            for side in 0..6 {
                let Some(next) = field.neighbour(at, side) else { continue };
                if field.is_open(next) && !field.is_beyond(next) {
                    field.beyond[next.0 as usize].insert(usize::from(next.1));
                    front.push(next);
                }
            }
        }
        field
    }

    /// The uncertain voxels of a brick from which the surface leads nowhere.
    fn ends(&self, brick: usize) -> impl Iterator<Item = VoxelAt> {
        let open = (0..BRICK_VOXELS).map(move |voxel| (brick as u32, voxel as u16)).filter(|at| self.is_open(*at));
        open.filter(|at| {
            (0..6).any(|side| self.neighbour(*at, side).is_none_or(|next| self.distance(next).is_infinite()))
        })
    }

    /// Whether uncertain surface passes a voxel.
    fn is_open(&self, at: VoxelAt) -> bool {
        let near = &self.bricks.items[at.0 as usize];
        let s = near.distances[usize::from(at.1)];
        near.uncertain.contains(usize::from(at.1))
            && s.abs() <= LEVEL
            && (0..6).any(|side| self.neighbour(at, side).is_some_and(|n| (self.distance(n) < 0.0) != (s < 0.0)))
    }

    fn is_beyond(&self, (brick, voxel): VoxelAt) -> bool {
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
        let (axis, up) = (side / 2, side % 2 == 1);
        let stride = BRICK.pow(axis as u32);
        let voxel = usize::from(voxel);
        let place = voxel / stride % BRICK;
        if place != if up { BRICK - 1 } else { 0 } {
            return Some((brick, (if up { voxel + stride } else { voxel - stride }) as u16));
        }
        let mut step = [0; 3];
        step[axis] = if up { 1 } else { -1 };
        let next = self.bricks.position(self.bricks.coords[brick as usize].offset(step))?;
        let across = (BRICK - 1) * stride;
        Some((next as u32, (if up { voxel - across } else { voxel + across }) as u16))
    }
}
