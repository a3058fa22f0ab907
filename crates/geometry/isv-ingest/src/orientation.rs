//! Faces that do not agree on which side is outside.
//!
//! Whether a body is closed does not depend on the order of its faces' corners, but winding numbers do. Here faces are made to agree,
//! part by part, and faces that are there twice are taken once.

use crate::edges::Edges;
use crate::sign::{CLOSED_SHARE, SAMPLES, closed_share};
use glam::DVec3;
use isv_spatial::{PositionMap, Weld, position_key};
use isv_volume::TriangleMesh;
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::hash_map::Entry;
use std::sync::Arc;

/// Share of a part's area whose faces agree already, from which on their side is kept. Below it, outside is
/// where the part's volume is positive.
const MAJORITY: f64 = 0.75;

/// Share of faces with a back of their own from which on a mesh is a two-sided one. Fewer are folds, whose sides cancel out by themselves.
const DOUBLED: f64 = 0.05;

/// A mesh whose faces were made to agree.
struct Turned {
    mesh: TriangleMesh,
    /// Whether every edge has an even number of faces.
    is_watertight: bool,
}

/// Turns the faces of a mesh so that they agree, where that makes a solid of it. Such a body is closed
/// whatever its faces say, or looks closed only afterwards. Other meshes come back as they are.
#[must_use]
pub fn turn_faces(mesh: &TriangleMesh) -> Cow<'_, TriangleMesh> {
    if mesh.validate().is_err() {
        return Cow::Borrowed(mesh);
    }
    let Some(turned) = turn(mesh, Doubles::SomeMayStay) else { return Cow::Borrowed(mesh) };
    let share = |mesh: &TriangleMesh| closed_share(mesh, SAMPLES);
    let looks_closed = || {
        let share_turned = share(&turned.mesh);
        share_turned >= CLOSED_SHARE && share_turned >= share(mesh)
    };
    if turned.is_watertight || looks_closed() { Cow::Owned(turned.mesh) } else { Cow::Borrowed(mesh) }
}

/// Makes faces agree along every edge of two faces, as far as they can. A part keeps the side of its majority. Of several faces with the
/// same corners one stays, whichever way they face. Returns the edges as well.
pub(crate) fn agreeing(mesh: Cow<'_, TriangleMesh>) -> (Cow<'_, TriangleMesh>, Edges) {
    let edges = Edges::new(&mesh);
    if edges.agree() {
        return (mesh, edges);
    }
    match turn(&mesh, Doubles::NoneMayStay) {
        Some(Turned { mesh, .. }) => {
            let edges = Edges::new(&mesh);
            (Cow::Owned(mesh), edges)
        }
        None => (mesh, edges),
    }
}

/// Whether a few faces may be there twice in a mesh whose faces agree.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Doubles {
    SomeMayStay,
    NoneMayStay,
}

/// Turns the faces of a sequence's meshes as [`turn_faces`] does, at a tenth of its cost where faces agree as far as in earlier frames.
#[derive(Clone, Copy, Debug, Default)]
pub struct FaceTurner {
    /// Edges along which faces disagreed in frames that needed no turning; `None` before one, and after a frame that needed it.
    usual: Option<usize>,
}

impl FaceTurner {
    /// Turns the faces of the next frame, if that makes a solid of it.
    #[must_use]
    pub fn turn<'a>(&mut self, mesh: &'a TriangleMesh) -> Cow<'a, TriangleMesh> {
        if mesh.validate().is_err() {
            return Cow::Borrowed(mesh);
        }
        let uneven = uneven_edges(mesh);
        if self.usual.is_some_and(|usual| uneven <= usual) {
            return Cow::Borrowed(mesh);
        }
        let turned = turn_faces(mesh);
        self.usual = matches!(turned, Cow::Borrowed(_)).then_some(uneven);
        turned
    }
}

/// Counts the edges along which faces disagree: not as many run along them one way as the other. Doubled
/// faces that face both ways agree here. Vertices at one place are one, as in soups and along seams. They are
/// looked up only where a face has no neighbour by the vertices that it names.
fn uneven_edges(mesh: &TriangleMesh) -> usize {
    // Two indices and a bit share a word. Larger meshes have no room in memory.
    if mesh.vertices.len() > 1 << 31 {
        return 0;
    }
    // The ends of an edge, the lower one first, and its direction: both faces of an edge lie beside each other once sorted.
    let key = |from: u32, to: u32| {
        u64::from(from.min(to)) << 33 | u64::from(from.max(to)) << 1 | u64::from(from > to)
    };
    let same_edge = |a: &u64, b: &u64| a >> 1 == b >> 1;
    let is_uneven = |faces: &[u64]| {
        let reversed = faces.iter().filter(|side| **side & 1 == 1).count();
        faces.len() > 1 && 2 * reversed != faces.len()
    };
    let sides = |[a, b, c]: &[u32; 3]| [key(*a, *b), key(*b, *c), key(*c, *a)];
    let mut keys: Vec<u64> = mesh.triangles.par_iter().flat_map_iter(sides).collect();
    keys.par_sort_unstable();
    let shared = keys.chunk_by(same_edge).filter(|faces| is_uneven(faces)).count();
    let mut places: PositionMap<u32> = PositionMap::default();
    let mut welded = |vertex: u32| {
        let next = places.len() as u32;
        *places.entry(position_key(mesh.vertices[vertex as usize])).or_insert(next)
    };
    let alone = keys.chunk_by(same_edge).filter(|faces| faces.len() == 1);
    let mut sides: Vec<u64> = alone
        .map(|side| {
            let (low, high) = (welded((side[0] >> 33) as u32), welded((side[0] >> 1) as u32));
            if side[0] & 1 == 0 { (low, high) } else { (high, low) }
        })
        .filter(|(from, to)| from != to)
        .map(|(from, to)| key(from, to))
        .collect();
    sides.par_sort_unstable();
    shared + sides.chunk_by(same_edge).filter(|faces| is_uneven(faces)).count()
}

/// Side of a face: the two ends of its edge, the lower one first, and whether the face runs from the higher
/// one.
struct Edge {
    ends: [u32; 2],
    face: u32,
    is_reversed: bool,
}

/// Turns faces so that those on both sides of an edge agree, and keeps one of faces with the same corners. `None` if all agree already.
/// Faces keep their colours.
fn turn(mesh: &TriangleMesh, doubles: Doubles) -> Option<Turned> {
    // Vertices at one place are one.
    let welded = Weld::new(&mesh.vertices).positions;
    let mut seen: PositionMap<[u32; 3]> = PositionMap::default();
    let mut backs = 0;
    let mut triangles: Vec<[u32; 3]> = Vec::with_capacity(mesh.triangles.len());
    // Places of the kept faces among all, which their colours need.
    let mut kept: Vec<usize> = Vec::new();
    for (face, triangle) in mesh.triangles.iter().enumerate() {
        let mut corners = triangle.map(|vertex| welded[vertex as usize]);
        // The same face always starts with the same corner.
        let lowest = (0..3).min_by_key(|corner| corners[*corner]).unwrap_or(0);
        corners.rotate_left(lowest);
        let mut key = corners;
        key.sort_unstable();
        if key[0] == key[1] || key[1] == key[2] {
            continue;
        }
        match seen.entry(key.map(u64::from)) {
            Entry::Occupied(first) => backs += usize::from(*first.get() != corners),
            Entry::Vacant(place) => {
                place.insert(corners);
                triangles.push(*triangle);
                if mesh.appearance.is_some() {
                    kept.push(face);
                }
            }
        }
    }
    let mut edges: Vec<Edge> = Vec::with_capacity(3 * triangles.len());
    for (triangle, face) in triangles.iter().zip(0..) {
        let corners = triangle.map(|vertex| welded[vertex as usize]);
        for side in 0..3 {
            let (from, to) = (corners[side], corners[(side + 1) % 3]);
            edges.push(Edge { ends: [from.min(to), from.max(to)], face, is_reversed: from > to });
        }
    }
    edges.par_sort_unstable_by_key(|edge| (edge.ends, edge.face));
    let is_watertight = edges.chunk_by(|a, b| a.ends == b.ends).all(|faces| faces.len() % 2 == 0);
    // For each face its neighbours over edges of two faces, and whether the two disagree.
    let mut neighbours: Vec<Vec<(u32, bool)>> = vec![Vec::new(); triangles.len()];
    let mut agree = true;
    for pair in edges.chunk_by(|a, b| a.ends == b.ends) {
        let [a, b] = pair else { continue };
        let disagrees = a.is_reversed == b.is_reversed;
        agree &= !disagrees;
        neighbours[a.face as usize].push((b.face, disagrees));
        neighbours[b.face as usize].push((a.face, disagrees));
    }
    let may_stay = match doubles {
        Doubles::SomeMayStay => (backs as f64) < DOUBLED * mesh.triangles.len() as f64,
        Doubles::NoneMayStay => triangles.len() == mesh.triangles.len(),
    };
    if agree && may_stay {
        return None;
    }
    let mut turned = Orientation { turned: vec![None; triangles.len()] };
    for start in 0..triangles.len() as u32 {
        if turned.turned[start as usize].is_none() {
            let part = turned.agree(start, &neighbours);
            if turned.is_outside_in(&part, mesh, &triangles) {
                part.iter().for_each(|face| turned.flip(*face));
            }
        }
    }
    for (triangle, turned) in triangles.iter_mut().zip(&turned.turned) {
        if *turned == Some(true) {
            triangle.swap(1, 2);
        }
    }
    let appearance = mesh.appearance.as_ref().map(|look| {
        let is_turned = turned.turned.iter().map(|turned| *turned == Some(true));
        Arc::new(look.of_faces(kept.iter().copied().zip(is_turned)))
    });
    let (vertices, normals) = (mesh.vertices.clone(), Vec::new());
    Some(Turned { mesh: TriangleMesh { vertices, normals, triangles, appearance }, is_watertight })
}

/// Whether each face is turned over; not known yet of faces that were not reached.
struct Orientation {
    turned: Vec<Option<bool>>,
}

impl Orientation {
    /// Makes all faces that hang together with one agree with it, and gives them. Where they cannot, as on a Moebius strip, the first
    /// way to reach a face counts.
    fn agree(&mut self, start: u32, neighbours: &[Vec<(u32, bool)>]) -> Vec<u32> {
        let mut part = vec![start];
        self.turned[start as usize] = Some(false);
        let mut next = 0;
        while let Some(&face) = part.get(next) {
            next += 1;
            let is_turned = self.turned[face as usize] == Some(true);
            for (other, disagrees) in &neighbours[face as usize] {
                let turned = &mut self.turned[*other as usize];
                if turned.is_none() {
                    *turned = Some(is_turned != *disagrees);
                    part.push(*other);
                }
            }
        }
        part
    }

    /// Whether a part must be turned over as a whole. The majority of its faces as they were decides or,
    /// without one, the sign of its volume, which must be positive.
    fn is_outside_in(&self, part: &[u32], mesh: &TriangleMesh, triangles: &[[u32; 3]]) -> bool {
        let corners = |face: u32| triangles[face as usize].map(|vertex| mesh.vertices[vertex as usize]);
        let middle = corners(part[0])[0];
        let (mut area, mut turned_area, mut volume) = (0.0, 0.0, 0.0);
        for face in part {
            let [a, b, c] = corners(*face).map(|corner: DVec3| corner - middle);
            let is_turned = self.turned[*face as usize] == Some(true);
            let face_area = (b - a).cross(c - a).length();
            area += face_area;
            turned_area += if is_turned { face_area } else { 0.0 };
            volume += if is_turned { -a.dot(b.cross(c)) } else { a.dot(b.cross(c)) };
        }
        match turned_area / area {
            share if share >= MAJORITY => true,
            share if share <= 1.0 - MAJORITY => false,
            _ => volume < 0.0,
        }
    }

    fn flip(&mut self, face: u32) {
        if let Some(turned) = &mut self.turned[face as usize] {
            *turned = !*turned;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sign::{SignDecision, SignMode, decide_sign};
    use isv_testkit::{sheet, sphere};

    fn turn_some(mesh: &mut TriangleMesh, which: impl Fn(usize) -> bool) {
        for (face, triangle) in mesh.triangles.iter_mut().enumerate() {
            if which(face) {
                triangle.swap(0, 1);
            }
        }
    }

    fn is_solid(mesh: &TriangleMesh) -> bool {
        let decision = decide_sign(mesh, SignMode::Paper).0;
        decision == SignDecision::Closed { flipped: false }
    }

    /// Faces without shared vertices.
    fn soup(mesh: &TriangleMesh) -> TriangleMesh {
        TriangleMesh {
            vertices: mesh
                .triangles
                .as_flattened()
                .iter()
                .map(|vertex| mesh.vertices[*vertex as usize])
                .collect(),
            normals: Vec::new(),
            triangles: (0..mesh.triangles.len() as u32)
                .map(|face| [3 * face, 3 * face + 1, 3 * face + 2])
                .collect(),
            appearance: None,
        }
    }

    #[test]
    fn faces_keep_their_colours() {
        let mut mesh = crate::faces::with_area(&sphere(0.4, 8)).into_owned();
        turn_some(&mut mesh, |face| face == 17);
        // The same face once more, at the start.
        mesh.triangles.insert(0, mesh.triangles[30]);
        let places = |triangle: &[u32; 3]| {
            triangle.map(|vertex| {
                [mesh.vertices[vertex as usize].x as f32, mesh.vertices[vertex as usize].y as f32]
            })
        };
        let mut coloured = mesh.clone();
        coloured.appearance = Some(Arc::new(isv_volume::Appearance {
            texture_coordinates: mesh.triangles.iter().map(places).collect(),
            ..isv_volume::Appearance::default()
        }));
        let turned = turn_faces(&coloured);
        turned.validate().unwrap();
        assert_eq!(turned.triangles.len(), mesh.triangles.len() - 1);
        let look = turned.appearance.as_ref().unwrap();
        for (triangle, corners) in turned.triangles.iter().zip(&look.texture_coordinates) {
            assert_eq!(*corners, places(triangle));
        }
    }

    #[test]
    fn a_body_is_closed_whatever_its_faces_say() {
        let sound = crate::faces::with_area(&sphere(0.4, 20)).into_owned();
        let mut turner = FaceTurner::default();
        for _ in 0..2 {
            assert!(matches!(turner.turn(&sound), Cow::Borrowed(_)), "nothing to do");
        }
        for which in [
            |face: usize| face.is_multiple_of(2),
            |face: usize| face < 350,
            |face: usize| face % 10 == 3,
            |face: usize| face == 17,
        ] {
            let mut mesh = sound.clone();
            turn_some(&mut mesh, which);
            // In a frame after sound ones.
            let turned = FaceTurner { ..turner }.turn(&mesh).into_owned();
            assert!(is_solid(&turned));
            assert_eq!(turned.triangles.len(), sound.triangles.len());
            let volume = |mesh: &TriangleMesh| {
                (0..mesh.triangles.len())
                    .map(|face| {
                        let [a, b, c] = mesh.corners(face);
                        a.dot(b.cross(c)) / 6.0
                    })
                    .sum::<f64>()
            };
            assert!(
                (volume(&turned) - volume(&sound)).abs() < 1e-12,
                "{} for {}, {}",
                volume(&turned),
                volume(&sound),
                volume(&mesh)
            );
            assert!(is_solid(&FaceTurner { ..turner }.turn(&soup(&mesh))), "found after sound frames");
        }
    }

    /// Copies of a body side by side, one of them inside out.
    #[test]
    fn bodies_are_solid_each_by_itself() {
        let sound = crate::faces::with_area(&sphere(0.4, 20)).into_owned();
        let mut mesh = TriangleMesh::default();
        for body in 0..3u32 {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(sound.vertices.iter().map(|v| *v + DVec3::X * f64::from(body)));
            let faces = sound.triangles.iter().map(|triangle| triangle.map(|vertex| first + vertex));
            mesh.triangles.extend(faces.map(|[a, b, c]| if body == 1 { [a, c, b] } else { [a, b, c] }));
        }
        assert!(matches!(turn_faces(&mesh), Cow::Borrowed(_)), "faces of each body agree");
        // Some faces of the first and the last.
        let faces = sound.triangles.len();
        turn_some(&mut mesh, |face| face % 9 == 2 && face / faces != 1);
        for mesh in [mesh.clone(), soup(&mesh)] {
            let turned = turn_faces(&mesh);
            let winding = isv_spatial::WindingNumber::new(&turned);
            let inside: Vec<f64> =
                (0..3).map(|body| winding.at(DVec3::X * f64::from(body)).round()).collect();
            assert_eq!(inside, [1.0, -1.0, 1.0], "a body that agrees with itself keeps its side");
            assert_eq!(decide_sign(&turned, SignMode::Auto).1.closed_share, 1.0);
        }
    }

    #[test]
    fn a_seam_hides_no_faces_that_disagree() {
        let sound = crate::faces::with_area(&sphere(0.4, 20)).into_owned();
        // The upper half has vertices of its own, and is inside out.
        let first = sound.vertices.len() as u32;
        let mut mesh = sound.clone();
        mesh.vertices.extend(&sound.vertices);
        for (face, triangle) in mesh.triangles.iter_mut().enumerate() {
            if sound.corners(face).iter().map(|corner| corner.y).sum::<f64>() > 0.0 {
                *triangle = [triangle[0], triangle[2], triangle[1]].map(|vertex| first + vertex);
            }
        }
        assert!(!is_solid(&mesh));
        let turned = turn_faces(&mesh);
        let (decision, evidence) = decide_sign(&turned, SignMode::Auto);
        assert!(matches!(decision, SignDecision::Closed { .. }) && evidence.closed_share == 1.0);
        // A seam alone is no reason to look closer.
        let mut seam = mesh.clone();
        turn_some(&mut seam, |face| mesh.triangles[face][0] >= first);
        assert!(uneven_edges(&seam) == 0 && uneven_edges(&sound) == 0);
    }

    #[test]
    fn doubled_faces_count_once() {
        let sound = crate::faces::with_area(&sphere(0.4, 20)).into_owned();
        let mut two_sided = sound.clone();
        two_sided.triangles.extend(sound.triangles.iter().map(|[a, b, c]| [*a, *c, *b]));
        assert!(!is_solid(&two_sided));
        assert!(is_solid(&turn_faces(&two_sided)));
        assert_eq!(turn_faces(&two_sided).triangles.len(), sound.triangles.len());
    }

    #[test]
    fn sheets_stay_as_they_are() {
        let mut two_sided = sheet(1.0);
        let back: Vec<_> = two_sided.triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        two_sided.triangles.extend(back);
        let mut mixed = sheet(1.0);
        turn_some(&mut mixed, |face| face % 3 == 0);
        for mesh in [sheet(1.0), two_sided, mixed, TriangleMesh::default()] {
            assert!(matches!(turn_faces(&mesh), Cow::Borrowed(_)));
        }
    }

    #[test]
    fn a_hollow_body_keeps_its_hollow() {
        let outer = crate::faces::with_area(&sphere(0.4, 20)).into_owned();
        let mut inner = crate::faces::with_area(&sphere(0.2, 20)).into_owned();
        turn_some(&mut inner, |_| true);
        let first = outer.vertices.len() as u32;
        let mut mesh = outer.clone();
        mesh.vertices.extend(&inner.vertices);
        mesh.triangles.extend(inner.triangles.iter().map(|triangle| triangle.map(|vertex| first + vertex)));
        let faces = outer.triangles.len();
        let sound = mesh.clone();
        // Some faces of either part.
        turn_some(&mut mesh, |face| face % 10 == 1 && face != faces);
        assert_eq!(turn_faces(&mesh).triangles.len(), sound.triangles.len());
        let winding = isv_spatial::WindingNumber::new(&turn_faces(&mesh));
        assert!(
            winding.at(DVec3::ZERO).abs() < 0.01
                && (winding.at(DVec3::new(0.3, 0.0, 0.0)) - 1.0).abs() < 0.01
        );
    }
}
