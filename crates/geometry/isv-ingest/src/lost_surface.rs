//! How much of a mesh its volume does not show.

use crate::SignDecision;
use crate::sign::{SAMPLES, sample_faces};
use glam::{DVec3, IVec3};
use isv_volume::{BlockCoord, BlockIndex, SparseVolume, TriangleMesh};

/// Share of a mesh's area, 0 to 1, that a volume made of it does not show. The area is looked at in about a thousand places.
///
/// With a sign by winding number, lost surface has outside on both sides. It belongs to nothing closed, such
/// as a sheet beside a body, or is thinner than a voxel. Parts that overlap, and so have inside on both
/// sides, are not lost, nor are places with unobserved voxels around them. With [`SignDecision::Sheet`], lost
/// surface has no cell around it that a surface is drawn in, and no inside all around. It is thinner than a
/// voxel, or a layer or junction that the grid cannot hold. An offset shell loses nothing.
#[must_use]
pub fn lost_surface_share(mesh: &TriangleMesh, volume: &SparseVolume, sign: SignDecision) -> f64 {
    let voxels = Voxels { volume, index: volume.index() };
    let is_lost = |(face, _): &(usize, usize)| {
        let [a, b, c] = mesh.corners(*face);
        let middle = (a + b + c) / 3.0;
        match sign {
            SignDecision::Closed { .. } => voxels.are_outside_around(middle),
            SignDecision::Sheet => !voxels.draw_around(middle),
            SignDecision::Offset => false,
        }
    };
    let lost: usize =
        sample_faces(mesh, SAMPLES).iter().filter(|sample| is_lost(sample)).map(|(_, weight)| weight).sum();
    lost as f64 / SAMPLES as f64
}

/// A point this near to voxels of a plane, in voxels, lies in it: then those on both sides are around it.
const IN_PLANE: f64 = 0.05;

/// State of a voxel in a volume.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Seen {
    Nothing,
    Inside,
    Outside,
}

/// The voxels of a volume by place.
struct Voxels<'v> {
    volume: &'v SparseVolume,
    index: BlockIndex,
}

impl Voxels<'_> {
    fn at(&self, voxel: IVec3) -> Seen {
        let edge = self.volume.grid().edge;
        let n = edge.voxels() as i32;
        let voxel = voxel.to_array();
        let Some(block) = self.index.get(BlockCoord::from(voxel.map(|c| c.div_euclid(n)))) else {
            return Seen::Nothing;
        };
        let [x, y, z] = voxel.map(|c| c.rem_euclid(n) as usize);
        let (voxel, block) = (edge.voxel_index(x, y, z), block as usize);
        if self.volume.unobserved(block).is_some_and(|mask| mask.contains(voxel)) {
            Seen::Nothing
        } else if self.volume.block(block)[voxel] < 0 {
            Seen::Inside
        } else {
            Seen::Outside
        }
    }

    /// A point in voxels, whose centres have whole coordinates.
    fn place(&self, point: DVec3) -> DVec3 {
        point / self.volume.grid().voxel_size.metres() - 0.5
    }

    /// Whether the voxels around a point are all observed and outside.
    fn are_outside_around(&self, point: DVec3) -> bool {
        let point = self.place(point);
        let low = (point - IN_PLANE).floor().as_ivec3();
        let high = (point + IN_PLANE).floor().as_ivec3() + 1;
        box_of(low, high).all(|voxel| self.at(voxel) == Seen::Outside)
    }

    /// Whether a surface is drawn in the cell of a point or beside it, or all of that cell is inside.
    fn draw_around(&self, point: DVec3) -> bool {
        let cell = self.place(point).floor().as_ivec3();
        let corners = |cell: IVec3| box_of(cell, cell + 1).map(|voxel| self.at(voxel));
        let is_drawn = |cell: IVec3| {
            let all = || corners(cell);
            all().all(|seen| seen != Seen::Nothing)
                && all().any(|seen| seen == Seen::Inside)
                && all().any(|seen| seen == Seen::Outside)
        };
        is_drawn(cell)
            || box_of(cell - 1, cell + 1).any(is_drawn)
            || corners(cell).all(|seen| seen == Seen::Inside)
    }
}

/// All places from one to another.
fn box_of(low: IVec3, high: IVec3) -> impl Iterator<Item = IVec3> {
    (low.z..=high.z).flat_map(move |z| {
        (low.y..=high.y).flat_map(move |y| (low.x..=high.x).map(move |x| IVec3::new(x, y, z)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MeshIngest, ingest_mesh};
    use isv_testkit::{cube, sheet, sphere};
    use isv_volume::{BlockEdge, Grid, Truncation, VoxelSize};

    const CLOSED: SignDecision = SignDecision::Closed { flipped: false };

    /// Samples on its faces are 0, which counts as outside.
    #[test]
    fn nothing_is_lost_of_a_cube_whose_faces_are_on_voxel_centres() {
        for half in [0.21, 0.2, 0.205] {
            let settings = MeshIngest::new(Grid {
                voxel_size: VoxelSize::from_metres(0.02).unwrap(),
                edge: BlockEdge::E8,
                truncation: Truncation::from_voxels(4).unwrap(),
            });
            let volume = ingest_mesh(&cube(half), &settings, CLOSED).unwrap();
            for sign in [CLOSED, SignDecision::Sheet] {
                assert_eq!(lost_surface_share(&cube(half), &volume, sign), 0.0, "{half} m");
            }
        }
    }

    #[test]
    fn a_sheet_beside_a_body_is_lost_and_a_body_is_not() {
        let settings = MeshIngest::new(Grid {
            voxel_size: VoxelSize::from_metres(0.02).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::from_voxels(4).unwrap(),
        });
        let share = |mesh: &TriangleMesh| {
            let share = |sign| lost_surface_share(mesh, &ingest_mesh(mesh, &settings, sign).unwrap(), sign);
            assert!(share(SignDecision::Sheet) < 0.002);
            share(CLOSED)
        };
        let mut mesh = sphere(0.4, 40);
        assert_eq!(share(&mesh), 0.0);
        let (first, body) = (mesh.vertices.len() as u32, mesh.area());
        let beside = sheet(0.5);
        mesh.vertices.extend(beside.vertices.iter().map(|v| *v + DVec3::new(2.0, 0.0, 0.0)));
        mesh.triangles.extend(beside.triangles.iter().map(|t| t.map(|i| i + first)));
        let expected = 1.0 - body / mesh.area();
        // The rim of the sheet is the edge of a hole, around which nothing is observed.
        assert!((0.3 * expected..=expected + 0.01).contains(&share(&mesh)), "{} of {expected}", share(&mesh));
    }
}
