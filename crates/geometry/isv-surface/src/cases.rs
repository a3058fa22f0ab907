//! Which triangles the surface makes in a cell, for each of the 256 patterns of corner signs.
//!
//! Corner `c` of a cell lies at `(c & 1, c >> 1 & 1, c >> 2 & 1)`; bit `c` of a pattern is set when that corner is
//! inside. Edge `e` runs along axis `e / 4`; `e % 4` holds the two coordinates of the other axes, lower axis in the
//! lower bit.
//!
//! The table is derived, not typed in:
//!
//! 1. Walk each face of the cube counter-clockwise seen from outside the cell. Each run of inside corners is
//!    *entered* over one edge and *left* over another. A segment goes from the first to the second: it cuts
//!    that run off from the rest of the face. On an ambiguous face, with the inside corners at opposite ends
//!    of a diagonal, each of the two is cut off alone. The rule looks at nothing but the four signs of the
//!    face. So the cell on the other side draws the same segments, walked the other way: no cracks.
//! 2. A crossing edge lies on two faces, whose walks pass it in opposite directions: one face enters over it,
//!    the other leaves. So the segments make each crossing edge the start of one and the end of another, and
//!    chain into closed loops. The outside is on the left of a walker on the surface: counter-clockwise seen
//!    from outside the solid.
//! 3. Each loop becomes a fan of triangles about one of its vertices. The fan must have no diagonal between
//!    two vertices on a common face. The neighbour may draw the same diagonal there, and an edge with four
//!    triangles would result. The first vertex that allows this is taken; the test
//!    `every_loop_has_a_fan_without_diagonals_in_faces` shows that there always is one.
//!
//! Source: the idea of Lorensen and Cline 1987; the face rule as in Bloomenthal's polygonizer (Graphics Gems IV, 1994).

use std::sync::LazyLock;

/// Edges of a cell.
pub(crate) const EDGES: usize = 12;

/// Most triangles in a cell: the test `no_case_has_more_triangles_than_the_limit` measures it.
pub(crate) const MAX_TRIANGLES: usize = 5;

/// What a pattern of corner signs makes of a cell.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Case {
    triangle_count: u8,
    triangles: [[u8; 3]; MAX_TRIANGLES],
}

impl Case {
    /// The triangles, their corners named by cell edge, counter-clockwise seen from outside the solid.
    pub(crate) fn triangles(&self) -> &[[u8; 3]] {
        &self.triangles[..usize::from(self.triangle_count)]
    }

    fn push_fan(&mut self, polygon: &[u8]) {
        for pair in polygon[1..].windows(2) {
            self.triangles[usize::from(self.triangle_count)] = [polygon[0], pair[0], pair[1]];
            self.triangle_count += 1;
        }
    }
}

/// All cases, by sign pattern.
pub(crate) static CASES: LazyLock<[Case; 256]> =
    LazyLock::new(|| std::array::from_fn(|pattern| derive(pattern as u8)));

/// Triangles that the surface makes in a cell whose corners have these signs, at most five. Their corners are
/// named by the edges of the cell that they lie on, counter-clockwise seen from outside the solid.
///
/// Corner `c` of a cell lies at `(c & 1, c >> 1 & 1, c >> 2 & 1)`; bit `c` of the pattern is set when that corner is inside. Edge `e`
/// runs along axis `e / 4`; `e % 4` holds the two coordinates of the other axes, lower axis in the lower bit.
#[must_use]
pub fn case_triangles(pattern: u8) -> &'static [[u8; 3]] {
    CASES[usize::from(pattern)].triangles()
}

/// The axis of a cell edge and the corner offset `[x, y, z]` of its lower end.
pub(crate) const fn edge_start(edge: usize) -> (usize, [usize; 3]) {
    let (axis, across) = (edge / 4, edge % 4);
    let (low, high) = (across & 1, across >> 1);
    let start = match axis {
        0 => [0, low, high],
        1 => [low, 0, high],
        _ => [low, high, 0],
    };
    (axis, start)
}

fn derive(pattern: u8) -> Case {
    let mut case = Case::default();
    for polygon in loops(pattern) {
        case.push_fan(&fan_order(&polygon));
    }
    case
}

/// The closed loops of crossing edges, each starting at its lowest edge.
fn loops(pattern: u8) -> Vec<Vec<u8>> {
    let mut next = segments(pattern);
    let mut loops = Vec::new();
    for first in 0..EDGES {
        let mut polygon = Vec::new();
        let mut edge = first;
        while let Some(following) = next[edge].take() {
            polygon.push(edge as u8);
            edge = following;
        }
        if !polygon.is_empty() {
            loops.push(polygon);
        }
    }
    loops
}

/// For each crossing edge, the edge at the other end of the segment that starts on it.
fn segments(pattern: u8) -> [Option<usize>; EDGES] {
    let mut next = [None; EDGES];
    for face in faces() {
        for (enter, leave) in face_segments(face, pattern) {
            next[enter] = Some(leave);
        }
    }
    next
}

/// The six faces' corners, counter-clockwise seen from outside the cell.
fn faces() -> impl Iterator<Item = [usize; 4]> {
    (0..3).flat_map(|axis| {
        let [u, v] = [1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3)];
        let far = 1 << axis;
        [[0, v, u | v, u], [far, far | u, far | u | v, far | v]]
    })
}

/// The segments on a face: for each run of inside corners, the edges over which the walk enters and leaves it.
fn face_segments(corners: [usize; 4], pattern: u8) -> impl Iterator<Item = (usize, usize)> {
    let corner = move |i: usize| corners[i % 4];
    let inside = move |i: usize| pattern >> corner(i) & 1 != 0;
    (0..4).filter(move |&i| !inside(i) && inside(i + 1)).map(move |enter| {
        let leave = (enter + 1..).find(|&i| !inside(i + 1)).expect("corner `enter` is outside");
        (edge_between(corner(enter), corner(enter + 1)), edge_between(corner(leave), corner(leave + 1)))
    })
}

/// The edge between two adjacent corners.
fn edge_between(a: usize, b: usize) -> usize {
    let axis = (a ^ b).trailing_zeros() as usize;
    let below = (1 << axis) - 1;
    axis * 4 + ((a & below) | (a >> 1 & !below & 3))
}

/// The loop, rotated to start at the first vertex whose fan has no diagonal in a face of the cell.
fn fan_order(polygon: &[u8]) -> Vec<u8> {
    let mut order = polygon.to_vec();
    for _ in 0..order.len() {
        if (2..order.len() - 1).all(|i| !on_common_face(order[0], order[i])) {
            return order;
        }
        order.rotate_left(1);
    }
    unreachable!("loop {polygon:?} has no fan")
}

fn on_common_face(a: u8, b: u8) -> bool {
    let on = |face: &[usize; 4], edge: u8| {
        (0..4).any(|i| edge_between(face[i], face[(i + 1) % 4]) == usize::from(edge))
    };
    faces().any(|face| on(&face, a) && on(&face, b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use std::collections::BTreeSet;

    fn corner_position(corner: usize) -> DVec3 {
        DVec3::new((corner & 1) as f64, (corner >> 1 & 1) as f64, (corner >> 2 & 1) as f64)
    }

    fn edge_middle(edge: u8) -> DVec3 {
        let (axis, [x, y, z]) = edge_start(usize::from(edge));
        let mut middle = DVec3::new(x as f64, y as f64, z as f64);
        middle[axis] = 0.5;
        middle
    }

    #[test]
    fn edges_are_numbered_as_documented() {
        for edge in 0..EDGES {
            let (axis, [x, y, z]) = edge_start(edge);
            let lower = x | y << 1 | z << 2;
            assert_eq!(edge_between(lower, lower | 1 << axis), edge);
            assert_eq!(edge_between(lower | 1 << axis, lower), edge);
        }
    }

    #[test]
    fn walks_are_counter_clockwise_seen_from_outside() {
        for face in faces() {
            let [a, b, c, d] = face.map(corner_position);
            let normal = (b - a).cross(c - b);
            let outward = (a + b + c + d) / 4.0 - DVec3::splat(0.5);
            assert!(normal.dot(outward) > 0.0);
        }
        assert_eq!(faces().count(), 6);
    }

    /// Mirrors a pattern's `+axis` face onto the `-axis` face of the neighbour and compares the drawn segments.
    #[test]
    fn neighbours_draw_the_same_segments_in_opposite_directions() {
        for axis in 0..3 {
            let shift = 1usize << axis;
            let [near, far] = [0, shift].map(|side| {
                faces().find(|f| f.iter().all(|c| c & shift == side)).expect("two faces an axis")
            });
            for a in 0..=255u8 {
                let ours: BTreeSet<_> = face_segments(far, a).collect();
                let to_neighbour = |edge| {
                    let (edge_axis, start) = edge_start(edge);
                    let lower = (start[0] | start[1] << 1 | start[2] << 2) & !shift;
                    edge_between(lower, lower | 1 << edge_axis)
                };
                let expected: BTreeSet<_> =
                    ours.iter().map(|&(enter, leave)| (to_neighbour(leave), to_neighbour(enter))).collect();
                let agrees = |b: u8| {
                    (0..8usize).filter(|c| c & shift == 0).all(|c| b >> c & 1 == a >> (c | shift) & 1)
                };
                for b in (0..=255u8).filter(|&b| agrees(b)) {
                    assert_eq!(face_segments(near, b).collect::<BTreeSet<_>>(), expected, "{a:08b} {b:08b}");
                }
            }
        }
    }

    #[test]
    fn loops_pass_each_crossing_edge_once() {
        for pattern in 0..=255u8 {
            let mut seen: Vec<u8> = loops(pattern).concat();
            seen.sort_unstable();
            let crossing: Vec<u8> = (0..EDGES as u8)
                .filter(|&e| {
                    let (axis, [x, y, z]) = edge_start(usize::from(e));
                    let lower = x | y << 1 | z << 2;
                    (pattern >> lower ^ pattern >> (lower | 1 << axis)) & 1 != 0
                })
                .collect();
            assert_eq!(seen, crossing, "{pattern:08b}");
            let used: BTreeSet<u8> =
                CASES[usize::from(pattern)].triangles().iter().flatten().copied().collect();
            assert!(used.into_iter().eq(crossing), "{pattern:08b}");
            assert!(loops(pattern).iter().all(|l| l.len() >= 3));
        }
    }

    /// The area vector of a loop points the way its edges run from inside to outside.
    #[test]
    fn loops_are_oriented_towards_the_outside() {
        for pattern in 1..255u8 {
            for polygon in loops(pattern) {
                let at = |i: usize| edge_middle(polygon[i % polygon.len()]);
                let area: DVec3 = (0..polygon.len()).map(|i| at(i).cross(at(i + 1)) / 2.0).sum();
                let uphill: DVec3 = polygon
                    .iter()
                    .map(|&e| {
                        let (axis, [x, y, z]) = edge_start(usize::from(e));
                        let lower_inside = pattern >> (x | y << 1 | z << 2) & 1 != 0;
                        DVec3::AXES[axis] * if lower_inside { 1.0 } else { -1.0 }
                    })
                    .sum();
                assert!(area.dot(uphill) > 0.0, "{pattern:08b} {polygon:?}");
            }
        }
    }

    #[test]
    fn every_loop_has_a_fan_without_diagonals_in_faces() {
        for pattern in 0..=255u8 {
            for polygon in loops(pattern) {
                let order = fan_order(&polygon);
                assert!((2..order.len() - 1).all(|i| !on_common_face(order[0], order[i])));
            }
        }
    }

    #[test]
    fn no_case_has_more_triangles_than_the_limit() {
        assert_eq!(CASES.iter().map(|c| c.triangles().len()).max(), Some(MAX_TRIANGLES));
    }

    #[test]
    fn one_inside_corner_makes_one_triangle() {
        assert_eq!(CASES[1].triangles(), [[0, 4, 8]]);
        assert!(CASES[0].triangles().is_empty() && CASES[255].triangles().is_empty());
    }
}
