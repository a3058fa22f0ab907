//! Things sorted into cubes of 8 voxels.

use glam::{DVec3, IVec3};
use isv_volume::{BlockCoord, BlockEdge, BlockIndex};

/// Edge of a brick in voxels, whatever the edge of the grid's blocks.
pub(crate) const BRICK: usize = 8;

/// Voxels in a brick.
pub(crate) const BRICK_VOXELS: usize = BRICK * BRICK * BRICK;

/// Coordinate of the first voxel's centre relative to the centre of its brick.
pub(crate) const FIRST: f32 = -3.5;

/// Things by brick, bricks in Morton order.
pub(crate) struct Bricks<T> {
    pub(crate) coords: Vec<BlockCoord>,
    index: BlockIndex,
    /// Start of the things of each brick, and the end of the last ones.
    starts: Vec<usize>,
    pub(crate) items: Vec<T>,
}

impl<T> Bricks<T> {
    /// From lists of things in Morton order of their bricks; empty lists are left out.
    pub(crate) fn new(lists: Vec<(BlockCoord, Vec<T>)>) -> Self {
        let (mut coords, mut starts, mut items) = (Vec::new(), vec![0], Vec::new());
        for (coord, list) in lists.into_iter().filter(|(_, list)| !list.is_empty()) {
            coords.push(coord);
            items.extend(list);
            starts.push(items.len());
        }
        Self { index: BlockIndex::new(&coords), coords, starts, items }
    }

    /// The things of the brick at a position in [`Self::coords`].
    pub(crate) fn list(&self, brick: usize) -> &[T] {
        &self.items[self.starts[brick]..self.starts[brick + 1]]
    }

    /// Bricks up to `reach` bricks away from a coordinate that are there: their steps from it, and their positions.
    pub(crate) fn around(&self, coord: BlockCoord, reach: i32) -> impl Iterator<Item = (IVec3, usize)> {
        let steps = move || -reach..=reach;
        let all = steps().flat_map(move |z| steps().flat_map(move |y| steps().map(move |x| [x, y, z])));
        all.filter_map(move |step| Some((step.into(), self.index.get(coord.offset(step))? as usize)))
    }

    /// All things with the coordinate of their brick, in order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (BlockCoord, &T)> {
        let list = move |brick| self.list(brick).iter().map(move |item| (self.coords[brick], item));
        (0..self.coords.len()).flat_map(list)
    }

    /// Position of a brick.
    pub(crate) fn position(&self, coord: BlockCoord) -> Option<usize> {
        self.index.get(coord).map(|i| i as usize)
    }
}

/// The brick that a point, in voxels, lies in.
pub(crate) fn brick_of(p: DVec3) -> BlockCoord {
    BlockCoord::from((p / BRICK as f64).floor().as_ivec3().to_array())
}

/// Centre of a brick in voxels.
pub(crate) fn brick_centre(coord: BlockCoord) -> DVec3 {
    (IVec3::from_array(coord.to_array()).as_dvec3() + 0.5) * BRICK as f64
}

/// Neighbour of a voxel of a cube along axis `side / 2`, down if `side` is even. Gives its index in its own
/// cube, and the step to that cube if it is another one.
pub(crate) fn step(edge: BlockEdge, voxel: usize, side: usize) -> (usize, Option<[i32; 3]>) {
    let (axis, up, n) = (side / 2, side % 2 == 1, edge.voxels());
    let stride = n.pow(axis as u32);
    let place = voxel / stride % n;
    let across = (n - 1) * stride;
    let mut by = [0; 3];
    by[axis] = if up { 1 } else { -1 };
    match (up, place) {
        (true, place) if place == n - 1 => (voxel - across, Some(by)),
        (true, _) => (voxel + stride, None),
        (false, 0) => (voxel + across, Some(by)),
        (false, _) => (voxel - stride, None),
    }
}
