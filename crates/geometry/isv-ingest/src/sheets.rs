//! Open parts of a mesh as single sheets: on which side of them a point is, and where they end.
//!
//! The pseudonormal at the closest point of a sheet tells its front from its back. It is the normal of a
//! face, the sum of the normals at an edge, or their sum at a vertex, weighted by angle. It is that of
//! Baerentzen & Aanaes 2005, "Signed distance computation using the angle weighted pseudonormal". Beyond a
//! border the sheet continues in its plane for 0.75 voxel, and voxels farther out are unobserved. Voxels
//! closest to an edge of more than two faces, or of two faces that disagree, are unobserved too: they have no
//! side.

use crate::edges::{Edges, FaceSide};
use crate::tiles::{Tile, VoxelMesh};
use glam::DVec3;
use isv_spatial::Feature;
use isv_volume::TriangleMesh;

/// Width of the continuation of a sheet beyond its border (voxels). Marching cubes draw whole cells. With this width a decoded sheet ends
/// where the source does, on average.
pub(crate) const CONTINUED: f64 = 0.75;

/// Kind of a point of a sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// The sheet has two sides there.
    Inner,
    /// The sheet ends there.
    Border,
    /// More than two faces meet there, or two that disagree.
    Unclear,
}

/// The sheet at an edge or a vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Joint {
    pub(crate) place: Place,
    /// Unit pseudonormal; zero where there is none to speak of.
    pub(crate) normal: DVec3,
}

/// Signed distance of a point to its closest sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SheetDistance {
    /// Signed distance, positive in front, in the unit of the mesh.
    pub(crate) distance: f64,
    /// Whether the sign means anything.
    pub(crate) is_observed: bool,
}

/// The open parts of a mesh.
pub(crate) struct Sheets {
    /// For each face whether it belongs to them.
    open: Vec<bool>,
    /// Unit normals of their faces.
    normals: Vec<DVec3>,
    /// Edges at the sides of each face, and the positions of its corners.
    sides: Vec<[u32; 3]>,
    corners: Vec<[u32; 3]>,
    edges: Vec<Joint>,
    vertices: Vec<Joint>,
}

impl Sheets {
    /// Creates the sheets of the `open` faces of a mesh with some edges.
    pub(crate) fn new(mesh: &TriangleMesh, edges: &Edges, open: Vec<bool>) -> Self {
        let normals: Vec<DVec3> =
            (0..open.len()).map(|face| mesh.area_vector(face).normalize_or_zero()).collect();
        let mut sheets = Self {
            sides: vec![[0; 3]; open.len()],
            vertices: vertex_joints(mesh, &open, &edges.corners, edges.positions),
            edges: Vec::new(),
            open,
            normals,
            corners: edges.corners.clone(),
        };
        // Faces of one edge are of one part.
        for sides in edges.iter() {
            if sheets.open[sides[0].face() as usize] {
                sheets.add_edge(edges, sides);
            }
        }
        sheets
    }

    /// Adds the joint of an edge, given all sides there.
    fn add_edge(&mut self, edges: &Edges, sides: &[FaceSide]) {
        let place = match sides {
            [_] => Place::Border,
            [a, b] if edges.is_reversed(*a) != edges.is_reversed(*b) => Place::Inner,
            _ => Place::Unclear,
        };
        let sum: DVec3 = sides.iter().map(|side| self.normals[side.face() as usize]).sum();
        let number = self.edges.len() as u32;
        self.edges.push(Joint { place, normal: sum.normalize_or_zero() });
        for side in sides {
            self.sides[side.face() as usize][side.side()] = number;
        }
        // A vertex is on a border if any of its edges is, for beyond it there is no sheet.
        for end in sides[0].ends() {
            let vertex = &mut self.vertices[end as usize];
            vertex.place = match (place, vertex.place) {
                (Place::Border, _) | (_, Place::Border) => Place::Border,
                (Place::Unclear, _) | (_, Place::Unclear) => Place::Unclear,
                _ => Place::Inner,
            };
        }
    }

    /// Whether a face belongs to a sheet.
    pub(crate) fn has(&self, face: u32) -> bool {
        self.open[face as usize]
    }

    /// Whether any face of a tile does.
    pub(crate) fn touch(&self, tile: &Tile) -> bool {
        tile.faces().any(|face| self.has(face))
    }

    /// Whether a face and its joints are those of another frame's face, bit for bit, given that their corners are.
    pub(crate) fn is_alike(&self, face: u32, before: &Self, old_face: u32) -> bool {
        if self.has(face) != before.has(old_face) {
            return false;
        }
        let bits = |joint: Joint| (joint.place, joint.normal.to_array().map(f64::to_bits));
        let features = (0..3).flat_map(|number| [Feature::Edge(number), Feature::Vertex(number)]);
        !self.has(face)
            || features
                .into_iter()
                .all(|feature| bits(self.joint(face, feature)) == bits(before.joint(old_face, feature)))
    }

    /// Returns the sheet at a feature of a face.
    pub(crate) fn joint(&self, face: u32, feature: Feature) -> Joint {
        let flat = self.normals[face as usize];
        let joint = match feature {
            Feature::Face => Joint { place: Place::Inner, normal: flat },
            Feature::Edge(side) => self.edges[self.sides[face as usize][usize::from(side)] as usize],
            Feature::Vertex(corner) => {
                self.vertices[self.corners[face as usize][usize::from(corner)] as usize]
            }
        };
        // Where sides mean nothing the face's normal is as good as any.
        let has_side = joint.place != Place::Unclear && joint.normal != DVec3::ZERO;
        Joint { normal: if has_side { joint.normal } else { flat }, ..joint }
    }

    /// Computes the distance of a point at `offset` (voxels) from its closest point, which lies on `feature` of `face`.
    pub(crate) fn signed_distance(&self, offset: DVec3, face: u32, feature: Feature) -> SheetDistance {
        let Joint { place, normal } = self.joint(face, feature);
        let (height, distance) = (offset.dot(normal), offset.length());
        let beyond = (distance * distance - height * height).max(0.0).sqrt();
        match place {
            Place::Border if beyond <= CONTINUED => SheetDistance { distance: height, is_observed: true },
            place => SheetDistance {
                distance: if height < 0.0 { -distance } else { distance },
                is_observed: place == Place::Inner,
            },
        }
    }
}

/// The joints of vertices, as far as open faces say: places are not known yet.
fn vertex_joints(mesh: &TriangleMesh, open: &[bool], corners: &[[u32; 3]], positions: usize) -> Vec<Joint> {
    let mut sums = vec![DVec3::ZERO; positions];
    for (face, places) in corners.iter().enumerate().filter(|(face, _)| open[*face]) {
        let at = mesh.corners(face);
        let normal = mesh.area_vector(face).normalize_or_zero();
        for corner in 0..3 {
            let [to_next, to_last] = [1, 2].map(|step| at[(corner + step) % 3] - at[corner]);
            sums[places[corner] as usize] += to_next.angle_between(to_last) * normal;
        }
    }
    let joint = |sum: DVec3| Joint { place: Place::Inner, normal: sum.normalize_or_zero() };
    sums.into_iter().map(joint).collect()
}

/// The faces of a mesh that are not open, without changing their numbers: the others have no area there.
pub(crate) fn closed_parts(mesh: &VoxelMesh, open: &[bool]) -> VoxelMesh<'static> {
    let keep = |(triangle, is_open): (&[u32; 3], &bool)| if *is_open { [triangle[0]; 3] } else { *triangle };
    let triangles: Vec<[u32; 3]> = mesh.triangles.iter().zip(open).map(keep).collect();
    VoxelMesh { vertices: mesh.vertices.clone(), triangles: triangles.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_spatial::closest_on_triangle;
    use isv_testkit::{sheet, sphere};

    fn distance_at(sheets: &Sheets, mesh: &TriangleMesh, p: DVec3) -> SheetDistance {
        let closest = (0..mesh.triangles.len())
            .map(|face| (closest_on_triangle(p, &mesh.corners(face)), face as u32))
            .min_by(|a, b| a.0.0.distance_squared(p).total_cmp(&b.0.0.distance_squared(p)));
        let ((point, feature), face) = closest.unwrap();
        sheets.signed_distance(p - point, face, feature)
    }

    #[test]
    fn a_sheet_is_seen_from_both_sides_and_a_little_beyond_its_border() {
        let mesh = sheet(5.0);
        let sheets = Sheets::new(&mesh, &Edges::new(&mesh), vec![true; 2]);
        let at = |p: [f64; 3]| distance_at(&sheets, &mesh, p.into());
        assert_eq!(at([1.0, 2.0, 3.0]).distance, 3.0);
        assert_eq!(at([1.0, 1.0, -0.5]).distance, -0.5);
        let beyond = at([5.5, 1.0, -2.0]);
        assert!(beyond.is_observed && beyond.distance == -2.0, "as far as its plane is");
        assert!(!at([5.8, 1.0, -2.0]).is_observed);
        assert!(!at([5.6, 5.6, 1.0]).is_observed && at([5.5, 5.5, 1.0]).is_observed);
    }

    #[test]
    fn sides_of_a_closed_mesh_are_those_of_its_inside() {
        let mesh = crate::faces::with_area(&sphere(4.0, 8)).into_owned();
        let sheets = Sheets::new(&mesh, &Edges::new(&mesh), vec![true; mesh.triangles.len()]);
        let mut random = isv_testkit::Random::new(9);
        for _ in 0..500 {
            let p = 6.0 * random.point();
            let seen = distance_at(&sheets, &mesh, p);
            let is_inside = isv_spatial::exact_winding_number(&mesh, p) > 0.5;
            assert!(seen.is_observed && (seen.distance < 0.0) == is_inside, "{p} {seen:?}");
        }
    }

    #[test]
    fn where_three_faces_meet_or_two_disagree_sides_mean_nothing() {
        let mut mesh = sheet(5.0);
        mesh.triangles[1].swap(1, 2);
        let sheets = Sheets::new(&mesh, &Edges::new(&mesh), vec![true; 2]);
        // Both faces are as far, on the edge between them.
        assert!(!sheets.signed_distance(DVec3::Z, 0, Feature::Edge(2)).is_observed);
        mesh = sheet(5.0);
        mesh.vertices.push(DVec3::new(0.0, 0.0, 5.0));
        mesh.triangles.push([0, 2, 4]);
        let sheets = Sheets::new(&mesh, &Edges::new(&mesh), vec![true; 3]);
        assert!(!sheets.signed_distance(-DVec3::Z, 0, Feature::Edge(2)).is_observed);
    }
}
