//! Cells of the parts of a mesh: the space in which each part can be the closest one. They are those of Mauch
//! 2000, "A fast algorithm for computing the closest point and distance transform".
//!
//! The closest point of a mesh lies inside a face, inside an edge, or on a vertex. Inside a face, it is the
//! foot of the point asked for, which therefore stands in the prism over the face. On an edge, no face at
//! that edge may hold a closer point: the point asked for lies beyond all of them, in a wedge. On a vertex,
//! no edge there may hold a closer point, which leaves a cone. These cells are cut out by planes. Inside a
//! cell the distance is that to the plane, line or point on which the part lies. They need nothing from the
//! mesh: leaving a plane out makes a cell larger, never wrong. So soups, rims, duplicates and edges with many
//! faces are all the same.

use crate::descent::SLACK;
use crate::holes::WideHoles;
use crate::tiles::VoxelMesh;
use crate::topology::{Side, Topology};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// A triangle whose height is below this share of its longest edge is no more than its edges: its plane is lost in rounding.
const FLAT_SHARE: f64 = 1e-11;

/// Share of its edge below which a triangle is too flat: its direction inwards is then not exact enough to
/// cut off anything.
const VAGUE_SHARE: f64 = 1e-7;

/// Planes that cut out the cone of a vertex, at most; most vertices have no more edges.
const MOST_CONE_SIDES: usize = 6;

/// Planes of the cell of a face: one axis, three sides.
pub(crate) const FACE_PLANES: usize = 1 + 3;

/// Planes of the cell of an edge: two axes, two ends, two faces.
pub(crate) const EDGE_PLANES: usize = 2 + 2 + 2;

/// Planes of the cell of a vertex: three axes, and the sides of its cone.
pub(crate) const VERTEX_PLANES: usize = 3 + MOST_CONE_SIDES;

/// A plane that cuts nothing off.
const NOWHERE: Plane = Plane { normal: Vec3::ZERO, height: 0.0, spread: 0.0 };

/// A plane. Within a tile of the origin `f32` gives heights to 1e-5 voxels.
#[derive(Clone, Copy)]
pub(crate) struct Plane {
    /// Unit vector.
    pub(crate) normal: Vec3,
    /// Height of the origin above it.
    pub(crate) height: f32,
    /// How much higher than its centre the highest corner of a cube whose edge is 2 is.
    pub(crate) spread: f32,
}

/// The cell of a face, an edge or a vertex.
#[derive(Clone, Copy)]
pub(crate) struct Cell {
    /// The first of its planes: first the axes, then the sides, in front of which the cell lies, those first that bound the
    /// part itself.
    first: u32,
    /// Number of the planes that are axes: one for a face, two for an edge, three for a vertex. Axes are
    /// square to each other, and their heights make up the distance to the part.
    pub(crate) axes: u8,
    /// Whether the part lies on the edge of a wide hole.
    pub(crate) on_hole: bool,
}

/// Cells of some triangles, relative to an origin near them.
#[derive(Default)]
pub(crate) struct Cells {
    origin: DVec3,
    /// Distance from the origin along each axis, as in [`Self::restart`].
    around: f32,
    cells: Vec<Cell>,
    planes: Vec<Plane>,
}

/// Directions of the triangles of a mesh, found once for all tiles.
pub(crate) struct Directions(Vec<FaceDirections>);

/// Directions of a triangle.
struct FaceDirections {
    /// Unit normal; zero if there is none to speak of.
    normal: DVec3,
    /// Unit vectors along the edges, zero for an edge without length.
    along: [DVec3; 3],
    /// Whether the triangle is so thin that its directions inwards cannot cut off anything.
    vague: bool,
}

impl FaceDirections {
    /// The unit vector into the triangle that is square to an edge and to the normal; zero where one of those is.
    /// Made anew each time, for memory is slower.
    fn inward(&self, side: usize) -> DVec3 {
        self.normal.cross(self.along[side])
    }
}

impl Directions {
    pub(crate) fn new(mesh: &VoxelMesh) -> Self {
        let describe = |face: usize| {
            let corners = mesh.corners(face as u32);
            let [a, b, c] = corners;
            let along = [b - a, c - b, a - c].map(DVec3::normalize_or_zero);
            let (normal, share) = unit_normal(&corners);
            FaceDirections { normal, along, vague: share <= VAGUE_SHARE }
        };
        Self((0..mesh.triangles.len()).into_par_iter().map(describe).collect())
    }

    fn face(&self, face: u32) -> &FaceDirections {
        &self.0[face as usize]
    }

    /// The direction from an edge into the triangle on it, square to the edge, if it is known well enough.
    fn inward(&self, Side { face, side }: Side) -> Option<DVec3> {
        let face = self.face(face);
        (!face.vague).then(|| face.inward(usize::from(side)))
    }
}

/// What cells are made from.
pub(crate) struct Parts<'a> {
    pub(crate) mesh: &'a VoxelMesh<'a>,
    pub(crate) topology: &'a Topology,
    pub(crate) directions: &'a Directions,
    pub(crate) holes: Option<&'a WideHoles>,
}

impl Cells {
    /// Forgets all cells and moves the origin. Cells that have no point within `around` of it along each axis will not be kept.
    pub(crate) fn restart(&mut self, origin: DVec3, around: f32) {
        self.origin = origin;
        self.around = around;
        self.cells.clear();
        self.planes.clear();
    }

    pub(crate) fn count(&self) -> u32 {
        self.cells.len() as u32
    }

    pub(crate) fn get(&self, index: u32) -> Cell {
        self.cells[index as usize]
    }

    /// The planes of a cell, of which there are as many as its kind has.
    pub(crate) fn planes<const PLANES: usize>(&self, cell: Cell) -> &[Plane; PLANES] {
        self.planes[cell.first as usize..].first_chunk().expect("every cell has all the planes of its kind")
    }

    fn plane(&self, normal: DVec3, point: DVec3) -> Plane {
        let height = normal.dot(self.origin - point) as f32;
        let normal = normal.as_vec3();
        Plane { normal, height, spread: normal.abs().element_sum() }
    }

    /// Whether all of the surroundings of the origin lie behind a plane.
    fn is_cut_off(&self, plane: &Plane) -> bool {
        plane.height + plane.spread * self.around < -SLACK
    }

    fn push(&mut self, planes: &[Plane], axes: u8, on_hole: bool) {
        self.cells.push(Cell { first: self.planes.len() as u32, axes, on_hole });
        self.planes.extend_from_slice(planes);
    }

    /// Adds the cells of triangles and of the edges and vertices they own, kind after kind. Loops over cells
    /// then seldom meet one with another number of planes than the last.
    pub(crate) fn add(&mut self, parts: &Parts, faces: impl Iterator<Item = u32> + Clone) {
        for face in faces.clone() {
            self.add_face(parts, face);
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
    fn add_face(&mut self, parts: &Parts, face: u32) {
        let directions = parts.directions.face(face);
        let normal = directions.normal;
        if normal == DVec3::ZERO {
            return;
        }
        let [a, b, c] = parts.mesh.corners(face);
        let [to_ab, to_bc, to_ca] = [0, 1, 2].map(|side| directions.inward(side));
        let planes =
            [self.plane(normal, a), self.plane(to_ab, a), self.plane(to_bc, b), self.plane(to_ca, c)];
        if !planes[1..].iter().any(|plane| self.is_cut_off(plane)) {
            self.push(&planes, 1, false);
        }
    }

    /// The wedge of an edge: between its ends, and beyond the faces on both sides.
    fn add_edge(&mut self, parts: &Parts, face: u32, side: usize) {
        let corners = parts.mesh.corners(face);
        let (from, to) = (corners[side], corners[(side + 1) % 3]);
        let along = parts.directions.face(face).along[side];
        let mut planes = [NOWHERE; EDGE_PLANES];
        let own = Side { face, side: side as u8 };
        let faces = [Some(own), parts.topology.across(face, side)];
        for (plane, face) in planes[4..].iter_mut().zip(faces.into_iter().flatten()) {
            if let Some(inward) = parts.directions.inward(face) {
                *plane = self.plane(-inward, from);
            }
        }
        planes[2] = self.plane(along, from);
        planes[3] = self.plane(-along, to);
        if planes[2..].iter().any(|plane| self.is_cut_off(plane)) {
            return;
        }
        let across = along.any_orthonormal_vector();
        planes[0] = self.plane(across, from);
        planes[1] = self.plane(across.cross(along), from);
        let on_hole = parts.holes.is_some_and(|holes| holes.has_edge(face, side));
        self.push(&planes, 2, on_hole);
    }

    /// The cone of a vertex: beyond the ends of its edges.
    fn add_vertex(&mut self, parts: &Parts, face: u32, corner: usize) {
        let vertex = parts.mesh.triangles[face as usize][corner];
        let point = parts.mesh.vertices[vertex as usize];
        let spokes = parts.topology.spokes(vertex);
        let mut planes = [NOWHERE; VERTEX_PLANES];
        for (plane, axis) in planes.iter_mut().zip(DVec3::AXES) {
            *plane = self.plane(axis, point);
        }
        let step = spokes.len().div_ceil(MOST_CONE_SIDES).max(1);
        for (plane, spoke) in planes[3..].iter_mut().zip(spokes.iter().step_by(step)) {
            let Side { face, side } = spoke.edge;
            let along = parts.directions.face(face).along[usize::from(side)];
            *plane = self.plane(if spoke.outward { -along } else { along }, point);
            if self.is_cut_off(plane) {
                return;
            }
        }
        let on_hole = parts.holes.is_some_and(|holes| holes.has_vertex(vertex));
        self.push(&planes, 3, on_hole);
    }
}

/// The unit normal of a triangle, zero if it has none to speak of; and the share of its height in its longest edge.
fn unit_normal(&[a, b, c]: &[DVec3; 3]) -> (DVec3, f64) {
    let lengths = [a.distance_squared(b), b.distance_squared(c), c.distance_squared(a)];
    let [p, q, r] = if lengths[0] >= lengths[1].max(lengths[2]) {
        [a, b, c]
    } else if lengths[1] >= lengths[2] {
        [b, c, a]
    } else {
        [c, a, b]
    };
    let Some(longest) = (q - p).try_normalize() else { return (DVec3::ZERO, 0.0) };
    let height = (r - p) - longest * longest.dot(r - p);
    let share = height.length() / p.distance(q);
    let normal = if share > FLAT_SHARE { longest.cross(height.normalize()).normalize() } else { DVec3::ZERO };
    (normal, share)
}
