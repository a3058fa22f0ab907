//! Where each part of a mesh can be the closest one (Mauch 2000, "A fast algorithm for computing the closest point and
//! distance transform").
//!
//! The closest point of a mesh lies inside a face, inside an edge, or on a vertex. Inside a face, it is the foot of the
//! point asked for, which therefore stands in the prism over the face. On an edge, no face at that edge may hold a
//! closer point: the point asked for lies beyond all of them, in a wedge. On a vertex, no edge there may hold a closer
//! point, which leaves a cone. These cells are cut out by planes, and inside a cell the distance is that to the plane,
//! line or point on which the part lies. They need nothing from the mesh: leaving a plane out makes a cell larger, never
//! wrong, so soups, rims, duplicates and edges with many faces are all the same.

use crate::holes::WideHoles;
use crate::tiles::VoxelMesh;
use crate::topology::{NONE, Topology};
use glam::DVec3;

/// A triangle whose height is below this share of its longest edge is no more than its edges: its plane is lost in rounding.
const FLAT_SHARE: f64 = 1e-11;

/// Of a triangle flatter than this share of its edge, the direction inwards is not exact enough to cut off anything.
const VAGUE_SHARE: f64 = 1e-7;

/// Planes that cut out the cone of a vertex, at most; a vertex seldom has more edges.
const MOST_CONE_SIDES: usize = 8;

/// Planes of the cell of a face: one axis, three sides.
pub(crate) const FACE_PLANES: usize = 1 + 3;

/// Planes of the cell of an edge: two axes, two ends, two faces.
pub(crate) const EDGE_PLANES: usize = 2 + 2 + 2;

/// Planes of the cell of a vertex: three axes, and the sides of its cone.
pub(crate) const VERTEX_PLANES: usize = 3 + MOST_CONE_SIDES;

/// A plane that cuts nothing off.
const NOWHERE: Plane = Plane { normal: DVec3::ZERO, height: 0.0 };

/// A plane.
#[derive(Clone, Copy)]
pub(crate) struct Plane {
    /// Unit vector.
    pub(crate) normal: DVec3,
    /// Height of the origin above it.
    pub(crate) height: f64,
}

/// The cell of a face, an edge or a vertex.
#[derive(Clone, Copy)]
struct Cell {
    /// The first of its planes.
    first: u32,
    /// As in [`CellPlanes`].
    axes: u8,
    on_hole: bool,
}

/// Cells of some triangles, relative to an origin near them.
#[derive(Default)]
pub(crate) struct Cells {
    origin: DVec3,
    cells: Vec<Cell>,
    planes: Vec<Plane>,
}

/// The planes of a cell: first the axes, then the sides, in front of which the cell lies.
#[derive(Clone, Copy)]
pub(crate) struct CellPlanes<'a> {
    pub(crate) planes: &'a [Plane],
    /// Planes, square to each other, whose heights make up the distance to the part: one for a face, two for an edge, three
    /// for a vertex.
    pub(crate) axes: usize,
    /// Whether the part lies on the edge of a wide hole.
    pub(crate) on_hole: bool,
}

/// What cells are made from.
pub(crate) struct Parts<'a> {
    pub(crate) mesh: &'a VoxelMesh<'a>,
    pub(crate) topology: &'a Topology,
    pub(crate) holes: Option<&'a WideHoles>,
}

impl Cells {
    /// Forgets all cells and moves the origin.
    pub(crate) fn restart(&mut self, origin: DVec3) {
        self.origin = origin;
        self.cells.clear();
        self.planes.clear();
    }

    pub(crate) fn count(&self) -> u32 {
        self.cells.len() as u32
    }

    pub(crate) fn get(&self, index: u32) -> CellPlanes<'_> {
        let Cell { first, axes, on_hole } = self.cells[index as usize];
        let count = [FACE_PLANES, EDGE_PLANES, VERTEX_PLANES][usize::from(axes) - 1];
        let planes = &self.planes[first as usize..first as usize + count];
        CellPlanes { planes, axes: usize::from(axes), on_hole }
    }

    fn push_plane(&mut self, normal: DVec3, point: DVec3) {
        self.planes.push(Plane { normal, height: normal.dot(self.origin - point) });
    }

    /// Adds the cells of triangles and of the edges and vertices they own, kind after kind: loops over cells then seldom meet
    /// one with another number of planes than the last.
    pub(crate) fn add(&mut self, parts: &Parts, faces: impl Iterator<Item = u32> + Clone) {
        for face in faces.clone() {
            let corners = parts.mesh.corners(face);
            if let Some(normal) = unit_normal(&corners) {
                self.add_face(&corners, normal);
            }
        }
        for face in faces.clone() {
            for side in (0..3).filter(|side| parts.topology.owns_edge(face, *side)) {
                self.add_edge(parts, face, side);
            }
        }
        for face in faces {
            for corner in (0..3).filter(|corner| parts.topology.owns_vertex(face, *corner)) {
                self.add_vertex(parts, face, corner);
            }
        }
    }

    /// The prism over a face, bounded by the planes through its edges.
    fn add_face(&mut self, corners: &[DVec3; 3], normal: DVec3) {
        let first = self.planes.len() as u32;
        self.push_plane(normal, corners[0]);
        for i in 0..3 {
            let along = (corners[(i + 1) % 3] - corners[i]).normalize();
            self.push_plane(normal.cross(along), corners[i]);
        }
        self.cells.push(Cell { first, axes: 1, on_hole: false });
    }

    /// The wedge of an edge: between its ends, and beyond the faces on both sides.
    fn add_edge(&mut self, parts: &Parts, face: u32, side: usize) {
        let corners = parts.mesh.corners(face);
        let (from, to, opposite) = (corners[side], corners[(side + 1) % 3], corners[(side + 2) % 3]);
        let along = (to - from).normalize();
        let across = along.any_orthonormal_vector();
        let first = self.planes.len() as u32;
        self.push_plane(across, from);
        self.push_plane(across.cross(along), from);
        self.push_plane(along, from);
        self.push_plane(-along, to);
        let mate = parts.topology.across(face, side);
        let mate = (mate != NONE).then(|| parts.mesh.vertices[mate as usize]);
        for corner in [Some(opposite), mate].into_iter().flatten() {
            if let Some(inward) = inward(from, along, corner) {
                self.push_plane(-inward, from);
            }
        }
        self.planes.resize(first as usize + EDGE_PLANES, NOWHERE);
        let on_hole = parts.holes.is_some_and(|holes| holes.has_edge(face, side));
        self.cells.push(Cell { first, axes: 2, on_hole });
    }

    /// The cone of a vertex: beyond the ends of its edges.
    fn add_vertex(&mut self, parts: &Parts, face: u32, corner: usize) {
        let vertex = parts.mesh.triangles[face as usize][corner];
        let point = parts.mesh.vertices[vertex as usize];
        let neighbours = parts.topology.neighbours(vertex);
        let first = self.planes.len() as u32;
        DVec3::AXES.into_iter().for_each(|axis| self.push_plane(axis, point));
        let step = neighbours.len().div_ceil(MOST_CONE_SIDES).max(1);
        for neighbour in neighbours.iter().step_by(step) {
            let normal = (point - parts.mesh.vertices[*neighbour as usize]).normalize();
            self.push_plane(normal, point);
        }
        self.planes.resize(first as usize + VERTEX_PLANES, NOWHERE);
        let on_hole = parts.holes.is_some_and(|holes| holes.has_vertex(vertex));
        self.cells.push(Cell { first, axes: 3, on_hole });
    }
}

/// The unit normal of a triangle, if it has an area to speak of.
fn unit_normal(&[a, b, c]: &[DVec3; 3]) -> Option<DVec3> {
    let lengths = [a.distance_squared(b), b.distance_squared(c), c.distance_squared(a)];
    let [p, q, r] = if lengths[0] >= lengths[1].max(lengths[2]) {
        [a, b, c]
    } else if lengths[1] >= lengths[2] {
        [b, c, a]
    } else {
        [c, a, b]
    };
    let longest = (q - p).try_normalize()?;
    let height = (r - p) - longest * longest.dot(r - p);
    (height.length() > FLAT_SHARE * p.distance(q)).then(|| longest.cross(height.normalize()).normalize())
}

/// The direction from an edge into the triangle on it whose third corner is given, square to the edge.
fn inward(from: DVec3, along: DVec3, corner: DVec3) -> Option<DVec3> {
    let height = (corner - from) - along * along.dot(corner - from);
    (height.length() > VAGUE_SHARE * corner.distance(from)).then(|| height.normalize())
}
