//! How much of a mesh its volume does not show.

use crate::sign::{SAMPLES, sample_faces};
use glam::DVec3;
use isv_volume::{BlockCoord, BlockIndex, SparseVolume, TriangleMesh};

/// Share of a mesh's area, 0 to 1, that has outside on both sides in a volume made of it: what belongs to nothing closed, such
/// as a sheet beside a body, and what is thinner than a voxel. A sign by winding number has no place for it; the offset shell does.
///
/// The area is looked at in about a thousand places. Parts that overlap, and so have inside on both sides, are not lost, nor are
/// places with unobserved voxels around them.
#[must_use]
pub fn open_surface_share(mesh: &TriangleMesh, volume: &SparseVolume) -> f64 {
    let index = volume.index();
    let is_lost = |(face, _): &(usize, usize)| {
        let [a, b, c] = mesh.corners(*face);
        is_outside_all_around(volume, &index, (a + b + c) / 3.0)
    };
    let lost: usize =
        sample_faces(mesh, SAMPLES).iter().filter(|sample| is_lost(sample)).map(|(_, weight)| weight).sum();
    lost as f64 / SAMPLES as f64
}

/// A point this near to voxels of a plane, in voxels, lies in it: then those on both sides are around it.
const IN_PLANE: f64 = 0.05;

/// Whether the voxels around a point are all observed and outside.
fn is_outside_all_around(volume: &SparseVolume, index: &BlockIndex, point: DVec3) -> bool {
    let edge = volume.grid().edge;
    let n = edge.voxels() as i32;
    let point = point / volume.grid().voxel_size.metres() - 0.5;
    let low = (point - IN_PLANE).floor().as_ivec3();
    let high = (point + IN_PLANE).floor().as_ivec3() + 1;
    let around = (low.z..=high.z)
        .flat_map(|z| (low.y..=high.y).flat_map(move |y| (low.x..=high.x).map(move |x| [x, y, z])));
    around.into_iter().all(|voxel| {
        let Some(block) = index.get(BlockCoord::from(voxel.map(|c| c.div_euclid(n)))) else { return false };
        let [x, y, z] = voxel.map(|c| c.rem_euclid(n) as usize);
        let voxel = edge.voxel_index(x, y, z);
        let block = block as usize;
        volume.block(block)[voxel] >= 0 && volume.unobserved(block).is_none_or(|mask| !mask.contains(voxel))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MeshIngest, SignDecision, ingest_mesh};
    use isv_testkit::{cube, sheet, sphere};
    use isv_volume::{BlockEdge, Grid, Truncation, VoxelSize};

    /// Samples on its faces are 0, which counts as outside.
    #[test]
    fn nothing_is_lost_of_a_cube_whose_faces_are_on_voxel_centres() {
        for half in [0.21, 0.2, 0.205] {
            let settings = MeshIngest::new(Grid {
                voxel_size: VoxelSize::from_metres(0.02).unwrap(),
                edge: BlockEdge::E8,
                truncation: Truncation::from_voxels(4).unwrap(),
            });
            let volume =
                ingest_mesh(&cube(half), &settings, SignDecision::Closed { flipped: false }).unwrap();
            assert_eq!(open_surface_share(&cube(half), &volume), 0.0, "{half} m");
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
            open_surface_share(
                mesh,
                &ingest_mesh(mesh, &settings, SignDecision::Closed { flipped: false }).unwrap(),
            )
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
