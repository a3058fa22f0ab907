//! Polygons to triangles: a fan where the polygon is convex, else by clipping ears.
//!
//! After Meisters, "Polygons have ears" (1975). Every simple polygon has a corner whose triangle holds no
//! other corner, and what is left without it is simple again.

use crate::{Malformation, error::Flaw};
use glam::{DVec2, DVec3};
use std::ops::Range;

/// Most corners of a polygon that is clipped; larger ones must be such that a fan covers them, as convex ones are. Clipping
/// takes time quadratic in the corners, so this bounds the time that each byte of a file can ask for.
const MOST_CORNERS: usize = 1000;

/// Share of its area by which a fan may leave a polygon: what rounding does to straight rims.
const OUTSIDE: f64 = 1e-3;

/// The faces of a file as they come, possibly before the vertices that they name.
#[derive(Debug, Default)]
pub(crate) struct Polygons {
    triangles: Vec<[u32; 3]>,
    /// Texture coordinates of the corners, by their numbers; as long as `triangles`, or empty.
    coordinates: Vec<[u32; 3]>,
    /// The runs of `triangles` that are fans of polygons with more than three corners.
    fans: Vec<Range<usize>>,
}

impl Polygons {
    /// Makes room for as many triangles.
    pub(crate) fn reserve(&mut self, triangles: usize) {
        self.triangles.reserve(triangles);
    }

    /// Takes a polygon; one of fewer than three corners is nothing.
    pub(crate) fn push(&mut self, corners: &[u32]) {
        let start = self.triangles.len();
        self.triangles.extend(fan(corners));
        if corners.len() > 3 {
            self.fans.push(start..self.triangles.len());
        }
    }

    /// Takes a polygon and the numbers of its corners' texture coordinates. All polygons have them, or none.
    pub(crate) fn push_textured(&mut self, corners: &[u32], coordinates: &[u32]) {
        self.push(corners);
        self.coordinates.extend(fan(coordinates));
    }

    /// How many triangles the polygons so far make.
    pub(crate) fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// The triangles, in the order of the polygons; one of `n` corners gives `n - 2`. A polygon that is not planar is
    /// looked at along its mean normal; one that cuts itself gives some triangles between its corners.
    ///
    /// # Errors
    /// [`Malformation::LargePolygon`].
    pub(crate) fn into_triangles(self, vertices: &[DVec3]) -> Result<Vec<[u32; 3]>, Flaw> {
        self.into_textured(vertices).map(|(triangles, _)| triangles)
    }

    /// The triangles as [`Self::into_triangles`] gives them, and the numbers of their corners' texture coordinates.
    ///
    /// # Errors
    /// [`Malformation::LargePolygon`].
    pub(crate) fn into_textured(mut self, vertices: &[DVec3]) -> Result<(Triangles, Triangles), Flaw> {
        for fan in self.fans {
            let corners = corners_of_fan(&self.triangles[fan.clone()]);
            let ears = ears(&corners, vertices).map_err(|why| Flaw::in_object("face", fan.start, why))?;
            let Some(ears) = ears else { continue };
            let place = |list: &mut [[u32; 3]], names: &[u32]| {
                list.iter_mut().zip(&ears).for_each(|(triangle, ear)| *triangle = ear.map(|i| names[i]));
            };
            place(&mut self.triangles[fan.clone()], &corners);
            if let Some(coordinates) = self.coordinates.get_mut(fan) {
                let names = corners_of_fan(coordinates);
                place(coordinates, &names);
            }
        }
        Ok((self.triangles, self.coordinates))
    }
}

/// Corners of triangles.
type Triangles = Vec<[u32; 3]>;

/// The triangles around the first corner of a polygon.
fn fan(corners: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    let (apex, rim) = corners.split_first().unwrap_or((&0, &[]));
    rim.windows(2).map(|edge| [*apex, edge[0], edge[1]])
}

/// The corners of the polygon that a fan was made of.
fn corners_of_fan(fan: &[[u32; 3]]) -> Vec<u32> {
    let [apex, first, _] = fan[0];
    [apex, first].into_iter().chain(fan.iter().map(|t| t[2])).collect()
}

/// The triangles of a strip, every second one turned back to face the same way. Those that name a vertex twice only
/// lead to where the strip goes on.
pub(crate) fn strip(corners: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    let triangles = corners.windows(3).enumerate().map(|(index, corners)| match corners {
        [a, b, c] if index % 2 == 0 => [*a, *b, *c],
        corners => [corners[1], corners[0], corners[2]],
    });
    triangles.filter(|[a, b, c]| a != b && b != c && c != a)
}

/// Triangles of a polygon, as places in `corners`, where a fan around the first corner would leave it; `None` where the fan will do.
fn ears(corners: &[u32], vertices: &[DVec3]) -> Result<Option<Vec<[usize; 3]>>, Malformation> {
    // Corners that name no vertex are reported later, where all triangles are checked.
    let positions = corners.iter().map(|c| vertices.get(*c as usize).copied()).collect::<Option<Vec<_>>>();
    let Some(points) = positions.and_then(|positions| flatten(&positions)) else { return Ok(None) };
    if corners.len() > MOST_CORNERS {
        let fits = fan_covers(&points);
        let refused = Malformation::LargePolygon { corners: corners.len(), limit: MOST_CORNERS };
        return if fits { Ok(None) } else { Err(refused) };
    }
    let mut ring = Ring::new(points);
    if ring.turns.iter().all(|turn| *turn >= 0.0) {
        return Ok(None);
    }
    Ok(Some((3..=corners.len()).rev().map(|left| ring.clip(left)).collect()))
}

/// Whether a fan around the first corner stays within a polygon: none of its triangles is turned over.
fn fan_covers(points: &[DVec2]) -> bool {
    let area = |rim: &[DVec2]| (rim[0] - points[0]).perp_dot(rim[1] - points[0]);
    let (mut inside, mut outside) = (0.0, 0.0);
    for area in points[1..].windows(2).map(area) {
        *(if area < 0.0 { &mut outside } else { &mut inside }) += area.abs();
    }
    outside <= OUTSIDE * inside
}

/// The corners in a plane, counter-clockwise as a whole; `None` for a polygon without area or with corners at infinity.
fn flatten(corners: &[DVec3]) -> Option<Vec<DVec2>> {
    let origin = corners[0];
    // Newell's normal: the vector area, right for corners that are not quite in a plane.
    let area = (1..corners.len())
        .map(|i| (corners[i] - origin).cross(corners[(i + 1) % corners.len()] - origin))
        .sum::<DVec3>();
    if !area.is_finite() || area == DVec3::ZERO {
        return None;
    }
    let axis = area.abs().max_position();
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let (u, v) = if area[axis] > 0.0 { (u, v) } else { (v, u) };
    Some(corners.iter().map(|c| *c - origin).map(|c| DVec2::new(c[u], c[v])).collect())
}

/// What is left of a polygon.
struct Ring {
    points: Vec<DVec2>,
    previous: Vec<usize>,
    next: Vec<usize>,
    /// Twice the area of the triangle at a corner; negative where the corner is reflex. Zero at corners that are gone.
    turns: Vec<f64>,
    ears: Vec<bool>,
    /// Place at which the search for an ear goes on.
    at: usize,
}

impl Ring {
    fn new(points: Vec<DVec2>) -> Self {
        let n = points.len();
        let mut ring = Self {
            points,
            previous: (0..n).map(|i| (i + n - 1) % n).collect(),
            next: (0..n).map(|i| (i + 1) % n).collect(),
            turns: vec![0.0; n],
            ears: vec![false; n],
            at: 0,
        };
        (0..n).for_each(|i| ring.turns[i] = ring.turn(ring.triangle(i)));
        (0..n).for_each(|i| ring.ears[i] = ring.is_ear(i));
        ring
    }

    fn triangle(&self, corner: usize) -> [usize; 3] {
        [self.previous[corner], corner, self.next[corner]]
    }

    fn turn(&self, [a, b, c]: [usize; 3]) -> f64 {
        (self.points[b] - self.points[a]).perp_dot(self.points[c] - self.points[a])
    }

    /// Whether the triangle at a corner holds no other corner. Only reflex and straight ones need to be
    /// looked at. Those at the place of one of its own are touching, as where a bridge leads to a hole.
    fn is_ear(&self, corner: usize) -> bool {
        let triangle @ [a, b, c] = self.triangle(corner);
        let own = triangle.map(|i| self.points[i]);
        let mut other = self.next[c];
        while self.turns[corner] > 0.0 && other != a {
            let inside = self.turns[other] <= 0.0
                && [[a, b], [b, c], [c, a]].iter().all(|[p, q]| self.turn([*p, *q, other]) >= 0.0);
            if inside && !own.contains(&self.points[other]) {
                return false;
            }
            other = self.next[other];
        }
        self.turns[corner] > 0.0
    }

    /// Cuts off an ear of the `left` corners that there are. A polygon that cuts itself may have none: then any corner.
    fn clip(&mut self, left: usize) -> [usize; 3] {
        for _ in 0..left {
            if self.ears[self.at] {
                break;
            }
            self.at = self.next[self.at];
        }
        let triangle @ [a, _, c] = self.triangle(self.at);
        (self.next[a], self.previous[c]) = (c, a);
        for neighbour in [a, c] {
            self.turns[neighbour] = self.turn(self.triangle(neighbour));
        }
        for neighbour in [a, c] {
            self.ears[neighbour] = self.is_ear(neighbour);
        }
        // Going on one corner further makes fewer slivers than cutting at the same place again.
        self.at = self.next[c];
        triangle
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn triangulate(corners: &[u32], vertices: &[DVec3]) -> Vec<[u32; 3]> {
        let mut polygons = Polygons::default();
        polygons.push(corners);
        polygons.into_triangles(vertices).unwrap()
    }

    /// Signed areas in the plane z = 0.
    fn areas(triangles: &[[u32; 3]], vertices: &[DVec3]) -> Vec<f64> {
        let corners = |t: &[u32; 3]| t.map(|v| vertices[v as usize]);
        triangles.iter().map(corners).map(|[a, b, c]| (b - a).cross(c - a).z / 2.0).collect()
    }

    #[test]
    fn a_convex_polygon_is_a_fan_and_short_ones_are_nothing() {
        let square = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
        for short in [&[][..], &[1], &[1, 2]] {
            assert!(triangulate(short, &square).is_empty());
        }
        assert_eq!(triangulate(&[0, 1, 2, 3], &square), [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(triangulate(&[3, 2, 1, 0], &square), [[3, 2, 1], [3, 1, 0]]);
        assert_eq!(
            triangulate(&[0, 1, 2, 9], &square),
            [[0, 1, 2], [0, 2, 9]],
            "named later as out of range"
        );
    }

    #[test]
    fn a_strip_keeps_its_side_up_and_leaves_out_its_turns() {
        let triangles: Vec<_> = strip(&[0, 1, 2, 3, 3, 4, 4, 5, 6]).collect();
        assert_eq!(triangles, [[0, 1, 2], [2, 1, 3], [4, 5, 6]]);
        assert_eq!(strip(&[0, 1]).count(), 0);
    }

    #[test]
    fn a_quad_is_split_at_its_reflex_corner_in_every_plane_and_order() {
        let dart = [[0.0, 0.0, 0.0], [4.0, 1.0, 0.0], [0.0, 2.0, 0.0], [1.0, 1.0, 0.0]].map(DVec3::from);
        for (axes, start) in (0..3).flat_map(|axes| (0..4).map(move |start| (axes, start))) {
            let turned = dart.map(|p| DVec3::new(p[axes], p[(axes + 1) % 3], p[(axes + 2) % 3]));
            for backwards in [false, true] {
                let mut corners = [0, 1, 2, 3].map(|i| (i + start) % 4);
                if backwards {
                    corners.reverse();
                }
                let triangles = triangulate(&corners, &turned);
                assert_eq!(triangles.len(), 2);
                assert!(triangles.iter().all(|t| t.contains(&3) && t.contains(&1)), "{triangles:?}");
                let area: DVec3 = triangles
                    .iter()
                    .map(|t| t.map(|v| turned[v as usize]))
                    .map(|[a, b, c]| (b - a).cross(c - a) / 2.0)
                    .inspect(|n| assert!(n.length() > 0.5))
                    .sum();
                assert!((area.length() - 3.0).abs() < 1e-12, "no triangle is turned over");
            }
        }
    }

    #[test]
    fn a_bridge_to_a_hole_is_cut_cleanly() {
        let outer = [[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]];
        let hole = [[1.0, 1.0], [1.0, 2.0], [2.0, 2.0], [2.0, 1.0]];
        let vertices: Vec<_> = outer.into_iter().chain(hole).map(|[x, y]| DVec3::new(x, y, 0.0)).collect();
        let triangles = triangulate(&[0, 1, 2, 3, 0, 4, 5, 6, 7, 4], &vertices);
        assert_eq!(triangles.len(), 8);
        let areas = areas(&triangles, &vertices);
        assert!(areas.iter().all(|area| *area >= 0.0), "{areas:?}");
        assert!((areas.iter().sum::<f64>() - 8.0).abs() < 1e-12);
    }

    #[test]
    fn huge_broken_and_crossing_polygons_still_give_triangles() {
        let n = MOST_CORNERS as u32 + 1;
        let zigzag: Vec<_> = (0..n).map(|i| DVec3::new(f64::from(i), f64::from(i % 2), 0.0)).collect();
        let corners: Vec<u32> = (0..n).collect();
        let mut polygons = Polygons::default();
        polygons.push(&[0, 1, 2]);
        polygons.push(&corners);
        let refused = polygons.into_triangles(&zigzag).unwrap_err();
        let why = Malformation::LargePolygon { corners: corners.len(), limit: MOST_CORNERS };
        assert_eq!(refused, Flaw::in_object("face", 1, why));
        let around = |i: u32| {
            DVec3::from((DVec2::from_angle(f64::from(i) / f64::from(n) * std::f64::consts::TAU), 0.0))
                .as_vec3()
        };
        let circle: Vec<_> = (0..n).map(|i| around(i).as_dvec3()).collect();
        assert_eq!(triangulate(&corners, &circle)[1], [0, 2, 3], "a fan");
        assert_eq!(triangulate(&corners[1..], &zigzag).len(), MOST_CORNERS - 2);
        let bow =
            [DVec3::ZERO, DVec3::new(2.0, 2.0, 0.0), DVec3::new(2.0, 0.0, 0.0), DVec3::new(0.0, 3.0, 0.0)];
        assert_eq!(triangulate(&[0, 1, 2, 3], &bow).len(), 2);
        assert_eq!(triangulate(&[0; 5], &bow).len(), 3);
        assert_eq!(triangulate(&[0, 1, 2, 3, 0], &[DVec3::NAN; 4]).len(), 3);
    }

    proptest! {
        #[test]
        fn triangles_of_a_star_cover_it_once(radii in prop::collection::vec(0.05f64..1.0, 3..40)) {
            let n = radii.len();
            let around = |i: usize| std::f64::consts::TAU * i as f64 / n as f64;
            let vertices: Vec<_> = radii.iter().enumerate()
                .map(|(i, r)| DVec3::new(r * around(i).cos(), r * around(i).sin(), 0.0)).collect();
            let area: f64 = (0..n).map(|i| vertices[i].cross(vertices[(i + 1) % n]).z / 2.0).sum();
            let corners: Vec<_> = (0..n as u32).collect();
            let triangles = triangulate(&corners, &vertices);
            prop_assert_eq!(triangles.len(), n - 2);
            let areas = areas(&triangles, &vertices);
            // None negative, and in all the area of the polygon: they cover it, each point once.
            prop_assert!(areas.iter().all(|a| *a > -1e-12));
            prop_assert!((areas.iter().sum::<f64>() - area).abs() < 1e-9);
        }
    }
}
