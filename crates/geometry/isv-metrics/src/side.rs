//! One side of a comparison, made ready.

use crate::Shape;
use crate::components::components_of_weld;
use crate::mean::sum;
use crate::normals::{SmoothNormals, angle_between};
use crate::point_set::PointSet;
use glam::DVec3;
use isv_spatial::Weld;
use isv_spatial::{Bvh, Closest, NearestPoints};
use isv_volume::TriangleMesh;
use rayon::prelude::*;

/// A shape with all that is asked of it.
pub(crate) struct MeasuredSide<'a> {
    /// The points that stand for it.
    pub(crate) set: PointSet,
    /// The surface, if it is one.
    pub(crate) surface: Option<Surface<'a>>,
}

/// A mesh with all that is asked of it.
pub(crate) struct Surface<'a> {
    mesh: &'a TriangleMesh,
    bvh: Bvh,
    normals: SmoothNormals<'a>,
    pub(crate) components: usize,
}

/// What is on a side, as seen from the points of the other.
pub(crate) struct Seen {
    /// Exact distance of each point to the surface, in metres, if there is one.
    pub(crate) distances: Option<Vec<f64>>,
    /// Largest distance of a corner of the other side's triangles to the surface, in metres; 0 without. Specks are seen by it that are
    /// too small to have a point on them.
    pub(crate) farthest_corner: f64,
    /// Mean angle between the normals at the points and those where the side is closest, in radians, if both are known
    /// anywhere.
    pub(crate) normal_error: Option<f64>,
}

impl<'a> MeasuredSide<'a> {
    /// Prepares a shape; a mesh must have area.
    pub(crate) fn new(shape: Shape<'a>, spacing_m: f64, seed: u64) -> Self {
        match shape {
            Shape::Mesh(mesh) => {
                let (bvh, (normals, components)) = rayon::join(|| Bvh::new(mesh), || describe(mesh));
                let set = PointSet::sampled(mesh, &normals, spacing_m, seed);
                Self { set, surface: Some(Surface { mesh, bvh, normals, components }) }
            }
            Shape::Points(points) => Self { set: PointSet::of_cloud(points), surface: None },
        }
    }

    /// Looks at this side from the other, to each of whose points `nearest` is nearest in this side's set.
    pub(crate) fn seen_from(&self, other: &MeasuredSide, nearest: &NearestPoints) -> Seen {
        let points = &other.set;
        let Some(surface) = &self.surface else {
            let at_nearest =
                |normals: &[DVec3]| mean_angle(points.normals(), |i| normals[nearest.of(i)[0] as usize]);
            let normal_error = self.set.normals().and_then(at_nearest);
            return Seen { distances: None, farthest_corner: 0.0, normal_error };
        };
        let distance = |closest: &Closest| closest.distance_sq.sqrt();
        let closest = surface.bvh.closest_to_each(points.points());
        let corners = other.surface.as_ref().map_or(Vec::new(), |other| corners(other.mesh));
        let from_corners = surface.bvh.closest_to_each(&corners);
        Seen {
            distances: Some(closest.iter().map(distance).collect()),
            farthest_corner: from_corners.iter().map(distance).fold(0.0, f64::max),
            normal_error: mean_angle(points.normals(), |i| surface.normals.at_closest(&closest[i])),
        }
    }
}

impl Surface<'_> {
    /// Another sampling of the surface.
    pub(crate) fn sampled(&self, spacing_m: f64, seed: u64) -> PointSet {
        PointSet::sampled(self.mesh, &self.normals, spacing_m, seed)
    }
}

/// The corners of a mesh's triangles, but for triangles without area.
fn corners(mesh: &TriangleMesh) -> Vec<DVec3> {
    let mut used = vec![false; mesh.vertices.len()];
    for (face, triangle) in mesh.triangles.iter().enumerate() {
        if mesh.area_vector(face) != DVec3::ZERO {
            triangle.iter().for_each(|vertex| used[*vertex as usize] = true);
        }
    }
    mesh.vertices.iter().zip(used).filter_map(|(vertex, used)| used.then_some(*vertex)).collect()
}

/// The normals of a mesh and the number of its components.
fn describe(mesh: &TriangleMesh) -> (SmoothNormals<'_>, usize) {
    let weld = Weld::new(&mesh.vertices);
    let components = components_of_weld(mesh, &weld);
    (SmoothNormals::new(mesh, weld), components)
}

/// Mean angle between normals and others of the same number, where both are known; `None` if that is nowhere.
fn mean_angle(normals: Option<&[DVec3]>, other: impl Fn(usize) -> DVec3 + Sync) -> Option<f64> {
    let normals = normals?;
    let others: Vec<DVec3> = (0..normals.len()).into_par_iter().map(&other).collect();
    let known = |i: &usize| normals[*i] != DVec3::ZERO && others[*i] != DVec3::ZERO;
    let pairs = (0..normals.len()).filter(known).count();
    let total = sum(normals.len(), |i| angle_between(normals[i], others[i]));
    (pairs > 0).then(|| total / pairs as f64)
}
