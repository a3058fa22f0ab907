//! The point of one triangle closest to a given point.

use glam::DVec3;

/// Share of its longest edge below which the height of a triangle makes it count as its three edges. Its
/// plane is then lost in rounding, and the edges are that close to every point of it.
const FLAT_SHARE: f64 = 1e-11;

/// The part of a triangle that holds a closest point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// The inside of the triangle.
    Face,
    /// The inside of edge `i`, which runs from corner `i` to corner `i + 1` (modulo 3).
    Edge(u8),
    /// Corner `i`.
    Vertex(u8),
}

/// The point of triangle `corners` closest to `p`, and the part of the triangle it lies on.
///
/// Foot of `p` on the plane, if it falls inside; otherwise the closest point of the three edges. These are
/// the Voronoi regions of Ericson, Real-Time Collision Detection, 5.1.5. They are found in an order that
/// needs no barycentric quotient, so slivers keep full precision. Of equal candidates the one with the lowest
/// edge wins. A triangle without area behaves as the segment or point it is; the result is finite for finite
/// input.
#[must_use]
pub fn closest_on_triangle(p: DVec3, corners: &[DVec3; 3]) -> (DVec3, Feature) {
    foot_inside(p, corners).map_or_else(|| closest_on_edges(p, corners), |foot| (foot, Feature::Face))
}

/// The foot of `p` on the triangle's plane, if it lies inside and the triangle has a plane at all.
fn foot_inside(p: DVec3, &[a, b, c]: &[DVec3; 3]) -> Option<DVec3> {
    let (ab, bc, ca) = (b - a, c - b, a - c);
    let normal = ab.cross(-ca);
    let normal_sq = normal.length_squared();
    let longest_sq = ab.length_squared().max(bc.length_squared()).max(ca.length_squared());
    if normal_sq <= (FLAT_SHARE * longest_sq).powi(2) {
        return None;
    }
    let inside = |edge: DVec3, from: DVec3| normal.cross(edge).dot(p - from) >= 0.0;
    (inside(ab, a) && inside(bc, b) && inside(ca, c)).then(|| p - normal * (normal.dot(p - a) / normal_sq))
}

/// The closest point on the outline.
fn closest_on_edges(p: DVec3, corners: &[DVec3; 3]) -> (DVec3, Feature) {
    let mut best = (corners[0], Feature::Vertex(0));
    let mut best_sq = f64::INFINITY;
    for i in 0..3u8 {
        let next = (i + 1) % 3;
        let (from, to) = (corners[usize::from(i)], corners[usize::from(next)]);
        let along = (p - from).dot(to - from);
        let length_sq = (to - from).length_squared();
        let candidate = if along <= 0.0 {
            (from, Feature::Vertex(i))
        } else if along >= length_sq {
            (to, Feature::Vertex(next))
        } else {
            (from + (to - from) * (along / length_sq), Feature::Edge(i))
        };
        let distance_sq = candidate.0.distance_squared(p);
        if distance_sq < best_sq {
            (best, best_sq) = (candidate, distance_sq);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::Random;

    const RIGHT: [DVec3; 3] = [DVec3::ZERO, DVec3::new(2.0, 0.0, 0.0), DVec3::new(0.0, 2.0, 0.0)];

    #[test]
    fn each_region_gives_its_feature() {
        for (p, point, feature) in [
            ([0.5, 0.5, 3.0], [0.5, 0.5, 0.0], Feature::Face),
            ([1.0, -1.0, 1.0], [1.0, 0.0, 0.0], Feature::Edge(0)),
            ([2.0, 2.0, 0.0], [1.0, 1.0, 0.0], Feature::Edge(1)),
            ([-1.0, 1.0, 0.0], [0.0, 1.0, 0.0], Feature::Edge(2)),
            ([-1.0, -1.0, 0.0], [0.0, 0.0, 0.0], Feature::Vertex(0)),
            ([4.0, 0.0, 0.0], [2.0, 0.0, 0.0], Feature::Vertex(1)),
            ([0.0, 4.0, 1.0], [0.0, 2.0, 0.0], Feature::Vertex(2)),
        ] {
            let found = closest_on_triangle(DVec3::from(p), &RIGHT);
            assert!(found.0.distance(DVec3::from(point)) < 1e-15, "{p:?}: {found:?}");
            assert_eq!(found.1, feature, "{p:?}");
        }
    }

    #[test]
    fn triangles_without_area_are_segments_and_points() {
        let p = DVec3::new(0.25, 1.0, 0.0);
        let segment = [DVec3::ZERO, DVec3::X, DVec3::X * 0.5];
        assert_eq!(closest_on_triangle(p, &segment).0, DVec3::X * 0.25);
        assert_eq!(closest_on_triangle(p, &[DVec3::Y; 3]).0, DVec3::Y);
        let doubled = [DVec3::X, DVec3::X, DVec3::Y];
        assert!(closest_on_triangle(DVec3::ZERO, &doubled).0.distance(DVec3::new(0.5, 0.5, 0.0)) < 1e-15);
    }

    /// Dense barycentric sampling can only be farther than the closest point, and by no more than its spacing.
    #[test]
    fn agrees_with_sampling_on_random_and_thin_triangles() {
        let mut random = Random::new(11);
        for round in 0..300 {
            let mut t = [random.point(), random.point(), random.point()];
            if round % 3 == 0 {
                t[2] = t[0].lerp(t[1], 0.3) + 10f64.powi(-(round % 40) / 2) * t[2];
            }
            let p = random.point() * 2.0;
            let (q, _) = closest_on_triangle(p, &t);
            let mut best = f64::INFINITY;
            for i in 0..=60 {
                for j in 0..=60 - i {
                    let (v, w) = (f64::from(i) / 60.0, f64::from(j) / 60.0);
                    best = best.min((t[0] + v * (t[1] - t[0]) + w * (t[2] - t[0])).distance(p));
                }
            }
            let d = q.distance(p);
            assert!(d <= best + 1e-9 && best - d < 0.1, "seed 11 round {round}: {d} against {best}");
        }
    }
}
