//! The connected parts of a mesh, and which of them have an inside.
//!
//! Faces that share an edge are of one part. A part along whose edges as many faces run one way as the other
//! has an inside, unless it encloses nothing. Other parts have one if nine tenths of their area look closed.
//! The winding number of the part alone, or of all parts whose borders meet, tells. A body may be cut into
//! pieces, down to single triangles. In a sequence, a part that is about where one was, and about as large,
//! keeps what was decided of that one. So nothing flickers.

use crate::edges::Edges;
use crate::sign::{CLOSED_SHARE, SAMPLES, closed_share, closed_share_of_first};
use glam::DVec3;
use isv_spatial::{DisjointSets, Neighbour, PointTree};
use isv_volume::TriangleMesh;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

/// A part of fewer faces encloses nothing.
const FEWEST_FACES: usize = 4;

/// Places that the smallest part is looked at in; the largest is looked at in [`SAMPLES`].
const FEWEST_SAMPLES: usize = 64;

/// Overlap of the bounding boxes of a part and of one in the frame before, from which both may be the same.
/// It is a share of the box around both.
const OVERLAP: f64 = 0.5;

/// Growth or shrinking of a part's area from one frame to the next, as a factor, up to which it may be the same part.
const GROWTH: f64 = 1.25;

/// Length of a part's vector area, as a share of its area, up to which it stays closed as it was. A closed surface has 0, one with a hole
/// about the hole's share, a flat sheet 1.
const OPENED: f64 = 0.25;

/// Most parts that are remembered; among more, each frame decides for itself.
const MOST_REMEMBERED: usize = 4096;

/// Parts of a mesh.
struct ConnectedParts {
    /// The faces of each part, ascending; parts by their first faces.
    faces: Vec<Vec<u32>>,
    /// Whether as many faces of each run one way along every edge as the other.
    is_watertight: Vec<bool>,
}

/// Decisions on the parts of a frame.
pub(crate) struct PartMemory(Vec<Remembered>);

/// A part and its decision.
struct Remembered {
    bounds: [DVec3; 2],
    area: f64,
    /// Length of the sum of area vectors.
    vector_area: f64,
    is_open: bool,
}

impl PartMemory {
    /// Recalls the decision on the part with the most similar bounds, if any is similar enough.
    fn recall(&self, part: &Remembered) -> Option<bool> {
        let is_alike =
            |other: &&Remembered| other.area <= GROWTH * part.area && part.area <= GROWTH * other.area;
        let overlaps =
            self.0.iter().filter(is_alike).map(|other| (overlap(other.bounds, part.bounds), other));
        let best = overlaps.max_by(|a, b| a.0.total_cmp(&b.0));
        let decision = best.filter(|(overlap, _)| *overlap >= OVERLAP).map(|(_, other)| other.is_open);
        decision.filter(|is_open| *is_open || part.vector_area <= OPENED * part.area)
    }
}

/// Volume of the intersection of two boxes over that of the box around both. Flat boxes count as a thousandth of the diagonal thick.
fn overlap(a: [DVec3; 2], b: [DVec3; 2]) -> f64 {
    let (low, high) = (a[0].min(b[0]), a[1].max(b[1]));
    let least = DVec3::splat(1e-3 * (high - low).length());
    let inner = a[1].min(b[1]) - a[0].max(b[0]) + least;
    let outer = high - low + least;
    (inner.max(DVec3::ZERO) / outer).to_array().iter().product()
}

/// Finds the faces of open parts, for each face of a mesh, given what was decided in the frame before.
pub(crate) fn open_faces(
    mesh: &TriangleMesh,
    edges: &Edges,
    before: Option<&PartMemory>,
) -> (Vec<bool>, PartMemory) {
    let parts = ConnectedParts::new(mesh, edges);
    let faces = mesh.triangles.len();
    let areas: Vec<f64> = (0..faces).map(|face| mesh.area_vector(face).length()).collect();
    let whole: f64 = areas.iter().sum();
    let mut known: Vec<Remembered> = parts.faces.iter().map(|faces| describe(mesh, faces, &areas)).collect();
    let before = before.filter(|_| known.len() <= MOST_REMEMBERED);
    // Some(is_open) as far as that is known.
    let decide = |part: usize| {
        let (faces, is_watertight) = (&parts.faces[part], parts.is_watertight[part]);
        if is_watertight && faces.len() >= FEWEST_FACES && !is_flat(mesh, faces) {
            return Some(false);
        }
        let area = known[part].area;
        if let Some(is_open) = before.and_then(|before| before.recall(&known[part])) {
            return Some(is_open);
        }
        let samples = ((area / whole * SAMPLES as f64) as usize).max(FEWEST_SAMPLES);
        let looks_closed =
            faces.len() >= FEWEST_FACES && closed_share(&submesh(mesh, faces), samples) >= CLOSED_SHARE;
        looks_closed.then_some(false)
    };
    let mut decided: Vec<Option<bool>> = (0..parts.faces.len()).into_par_iter().map(decide).collect();
    decide_together(mesh, edges, &parts, &mut decided);
    let mut open = vec![false; faces];
    for (faces, _) in parts.faces.iter().zip(&decided).filter(|(_, is_open)| **is_open == Some(true)) {
        faces.iter().for_each(|face| open[*face as usize] = true);
    }
    for (part, is_open) in known.iter_mut().zip(&decided) {
        part.is_open = *is_open == Some(true);
    }
    known.truncate(if known.len() <= MOST_REMEMBERED { known.len() } else { 0 });
    (open, PartMemory(known))
}

/// Describes a part that nothing was decided of.
fn describe(mesh: &TriangleMesh, faces: &[u32], areas: &[f64]) -> Remembered {
    let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    for corner in faces.iter().flat_map(|face| mesh.corners(*face as usize)) {
        bounds = [bounds[0].min(corner), bounds[1].max(corner)];
    }
    let area = faces.iter().map(|face| areas[*face as usize]).sum();
    let vector: DVec3 = faces.iter().map(|face| mesh.area_vector(*face as usize)).sum();
    Remembered { bounds, area, vector_area: vector.length(), is_open: false }
}

/// Decides what is left: parts whose borders meet others are pieces of a body if they look closed together with these.
fn decide_together(mesh: &TriangleMesh, edges: &Edges, parts: &ConnectedParts, decided: &mut [Option<bool>]) {
    if !decided.contains(&None) {
        return;
    }
    let mut part_of = vec![0; mesh.triangles.len()];
    for (faces, part) in parts.faces.iter().zip(0..) {
        faces.iter().for_each(|face| part_of[*face as usize] = part);
    }
    let mut groups = DisjointSets::new(decided.len() as u32);
    join_meeting(mesh, edges, &part_of, &mut groups);
    let mut members: FxHashMap<u32, Vec<usize>> = FxHashMap::default();
    (0..decided.len()).for_each(|part| members.entry(groups.find(part as u32)).or_default().push(part));
    for group in members.values() {
        let (left, others): (Vec<usize>, Vec<usize>) =
            group.iter().partition(|part| decided[**part].is_none());
        let faces_of = |some: &[usize]| -> Vec<u32> {
            some.iter().flat_map(|part| &parts.faces[*part]).copied().collect()
        };
        let (first, rest) = (faces_of(&left), faces_of(&others));
        let all = [&first[..], &rest].concat();
        let is_closed = !left.is_empty()
            && group.len() > 1
            && all.len() >= FEWEST_FACES
            && closed_share_of_first(&submesh(mesh, &all), first.len(), SAMPLES) >= CLOSED_SHARE;
        left.iter().for_each(|part| decided[*part] = Some(!is_closed));
    }
}

/// Joins parts with borders that meet.
fn join_meeting(mesh: &TriangleMesh, edges: &Edges, part_of: &[u32], groups: &mut DisjointSets) {
    let reach = MEETING * mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
    let borders = edges.iter().filter(|sides| sides.len() == 1).map(|sides| {
        let face = sides[0].face() as usize;
        let corners = mesh.corners(face);
        (part_of[face], [corners[sides[0].side()], corners[(sides[0].side() + 1) % 3]])
    });
    let ends: Vec<(u32, DVec3)> = borders.flat_map(|(part, ends)| ends.map(|end| (part, end))).collect();
    if ends.is_empty() || reach == 0.0 {
        return;
    }
    let tree = PointTree::new(ends.iter().map(|end| end.1).collect());
    let near = |found: &mut Vec<Neighbour>, (part, end): &(u32, DVec3)| {
        tree.k_nearest(*end, MOST_MEETING, found);
        let near = found.iter().filter(|near| near.distance_sq <= reach * reach);
        let mut others: Vec<u32> =
            near.map(|near| ends[near.index as usize].0).filter(|other| other != part).collect();
        others.sort_unstable();
        others.dedup();
        others
    };
    // In pieces, so that no more pairs are held than those of a piece.
    for piece in ends.chunks(MEETING_AT_ONCE) {
        let found: Vec<Vec<u32>> = piece.par_iter().map_init(Vec::new, near).collect();
        for ((part, _), others) in piece.iter().zip(found) {
            others.into_iter().for_each(|other| groups.join(*part, other));
        }
    }
}

/// Ends of borders whose neighbours are held at one time.
const MEETING_AT_ONCE: usize = 1 << 16;

/// Distance within which borders meet, as a share of the mesh's diagonal.
const MEETING: f64 = 1e-3;

/// Ends of borders that are looked at around one.
const MOST_MEETING: usize = 16;

/// Whether faces enclose almost nothing for their area, as a sheet and its back do.
fn is_flat(mesh: &TriangleMesh, faces: &[u32]) -> bool {
    let origin = mesh.corners(faces[0] as usize)[0];
    let (mut volume, mut area) = (0.0, 0.0);
    for face in faces {
        let [a, b, c] = mesh.corners(*face as usize).map(|corner| corner - origin);
        volume += a.dot(b.cross(c)) / 6.0;
        area += 0.5 * (b - a).cross(c - a).length();
    }
    volume.abs() < FLAT * area * area.sqrt()
}

/// Volume below which a watertight part is flat, as a share of its area to the power of 3/2. A ball has 0.094.
const FLAT: f64 = 1e-6;

impl ConnectedParts {
    /// Finds the parts of a mesh.
    fn new(mesh: &TriangleMesh, edges: &Edges) -> Self {
        let count = mesh.triangles.len() as u32;
        let mut sets = DisjointSets::new(count);
        for sides in edges.iter() {
            sides.windows(2).for_each(|pair| sets.join(pair[0].face(), pair[1].face()));
        }
        let mut numbers = vec![0; mesh.triangles.len()];
        let mut faces: Vec<Vec<u32>> = Vec::new();
        for face in 0..count {
            // A set is represented by its first face.
            let first = sets.find(face) as usize;
            if first == face as usize {
                numbers[first] = faces.len();
                faces.push(Vec::new());
            }
            numbers[face as usize] = numbers[first];
            faces[numbers[first]].push(face);
        }
        let mut is_watertight = vec![true; faces.len()];
        for sides in edges.iter() {
            let reversed = sides.iter().filter(|side| edges.is_reversed(**side)).count();
            if 2 * reversed != sides.len() {
                is_watertight[numbers[sides[0].face() as usize]] = false;
            }
        }
        Self { faces, is_watertight }
    }
}

/// Copies some faces of a mesh into a mesh of their own, without colours: it is asked for distances alone.
fn submesh(mesh: &TriangleMesh, faces: &[u32]) -> TriangleMesh {
    let corners = |face: &u32| mesh.corners(*face as usize);
    TriangleMesh {
        vertices: faces.iter().flat_map(corners).collect(),
        normals: Vec::new(),
        triangles: (0..faces.len() as u32).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect(),
        appearance: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::{sheet, sphere};

    fn ball() -> TriangleMesh {
        crate::faces::with_area(&sphere(0.4, 20)).into_owned()
    }

    /// Both meshes, the second moved.
    fn beside(a: &TriangleMesh, b: &TriangleMesh, by: DVec3) -> TriangleMesh {
        let mut mesh = a.clone();
        let vertices = a.vertices.len() as u32;
        mesh.vertices.extend(b.vertices.iter().map(|v| *v + by));
        mesh.triangles.extend(b.triangles.iter().map(|t| t.map(|v| v + vertices)));
        mesh
    }

    fn open_in(mesh: &TriangleMesh, before: Option<&PartMemory>) -> (Vec<bool>, PartMemory) {
        open_faces(mesh, &Edges::new(mesh), before)
    }

    /// A mesh as one part.
    fn describe_all(mesh: &TriangleMesh) -> Remembered {
        let areas: Vec<f64> = (0..mesh.triangles.len()).map(|face| mesh.area_vector(face).length()).collect();
        describe(mesh, &(0..mesh.triangles.len() as u32).collect::<Vec<_>>(), &areas)
    }

    #[test]
    fn a_body_and_a_sheet_beside_it_are_told_apart_and_so_are_their_soups() {
        let mesh = beside(&ball(), &sheet(1.0), DVec3::Z);
        let body = ball().triangles.len();
        let expected: Vec<bool> = (0..mesh.triangles.len()).map(|face| face >= body).collect();
        assert_eq!(ConnectedParts::new(&mesh, &Edges::new(&mesh)).faces.len(), 2);
        assert_eq!(open_in(&mesh, None).0, expected);
        let faces: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
        assert_eq!(open_in(&submesh(&mesh, &faces), None).0, expected);
    }

    /// Halves that share no vertex, and a soup whose triangles hang together nowhere.
    #[test]
    fn pieces_of_a_body_are_closed_as_the_whole_is() {
        let whole = ball();
        let upper = |face: usize| whole.corners(face).iter().map(|corner| corner.y).sum::<f64>() > 0.0;
        let [above, below] = [true, false].map(|is_upper| {
            let faces = (0..whole.triangles.len()).filter(|face| upper(*face) == is_upper);
            submesh(&whole, &faces.map(|face| face as u32).collect::<Vec<_>>())
        });
        let halves = beside(&above, &below, DVec3::Y * 1e-4);
        assert_eq!(ConnectedParts::new(&halves, &Edges::new(&halves)).faces.len(), 2);
        let mut soup = submesh(&whole, &(0..whole.triangles.len() as u32).collect::<Vec<_>>());
        let mut random = isv_testkit::Random::new(4);
        soup.vertices.iter_mut().for_each(|vertex| *vertex += 1e-5 * random.point());
        assert_eq!(ConnectedParts::new(&soup, &Edges::new(&soup)).faces.len(), soup.triangles.len());
        for mesh in [&halves, &soup] {
            assert!(!open_in(mesh, None).0.contains(&true));
        }
        // One of the pieces changes, so that it is decided anew beside one that is known.
        let (_, memory) = open_in(&halves, None);
        let mut deeper = below.clone();
        deeper.vertices.iter_mut().for_each(|vertex| vertex.y *= 1.8);
        assert!(!open_in(&beside(&above, &deeper, DVec3::Y * 1e-4), Some(&memory)).0.contains(&true));
    }

    #[test]
    fn a_sheet_with_a_back_is_open_and_a_thin_plate_is_closed() {
        let mut mesh = sheet(1.0);
        let back: Vec<_> = mesh.triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        mesh.triangles.extend(back);
        assert!(!open_in(&mesh, None).0.contains(&false));
        let mut plate = isv_testkit::cube(0.5);
        plate.vertices.iter_mut().for_each(|vertex| vertex.z *= 1e-3);
        assert!(!open_in(&plate, None).0.contains(&true));
    }

    /// A bowl that is closed a little more in each frame is one thing throughout, and another if seen for the first time.
    #[test]
    fn what_was_decided_holds_on() {
        let whole = ball();
        let up_to = |y: f64| {
            let faces =
                (0..whole.triangles.len()).filter(|face| whole.corners(*face).iter().all(|c| c.y <= y));
            submesh(&whole, &faces.map(|face| face as u32).collect::<Vec<_>>())
        };
        let (open, closed) = (up_to(0.0), up_to(0.399));
        let (is_open, mut memory) = open_in(&open, None);
        assert!(!is_open.contains(&false));
        assert!(!open_in(&closed, None).0.contains(&true));
        for y in [0.02, 0.04, 0.06, 0.08, 0.1] {
            let (is_open, next) = open_in(&up_to(y), Some(&memory));
            assert!(!is_open.contains(&false), "{y}");
            memory = next;
        }
        // A closed part that has come to be a bowl is no longer one.
        let (_, closed_before) = open_in(&up_to(0.399), None);
        assert!(!open_in(&up_to(0.25), Some(&closed_before)).0.contains(&true));
        let memory_of_bowl = PartMemory(vec![Remembered { is_open: false, ..describe_all(&open) }]);
        assert!(!open_in(&open, Some(&memory_of_bowl)).0.contains(&false));
        // What has no border is closed whatever was before.
        assert!(!open_in(&whole, Some(&memory)).0.contains(&true));
    }
}
