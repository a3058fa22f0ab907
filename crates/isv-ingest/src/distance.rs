//! Distance from a triangle to eight points at once.
//!
//! A triangle is described by what its distance needs: its plane, and for each edge the direction along it, the
//! direction into the triangle, and where along the edge its ends lie. Distances are then sums of squares of
//! coordinates in those directions, without division or branch. The describing numbers are found in `f64` relative to
//! the cube at hand and only then rounded to `f32`, so they are small where they matter, and a triangle of a kilometre
//! is as exact beside the cube as a small one.
//!
//! The loops over points are compiled once for each instruction set and chosen at run time; the arithmetic and so the bits
//! are the same in all of them.

use fearless_simd::{Level, Simd, dispatch};
use glam::DVec3;

/// Points evaluated together.
pub(crate) const LANES: usize = 8;

/// Eight points, by coordinate.
pub(crate) type Points = [[f32; LANES]; 3];

/// Directions of a triangle, in `f64` and voxel units.
pub(crate) struct TriangleFrame {
    corners: [DVec3; 3],
    normal: DVec3,
    /// Unit vector along edge `i`, from corner `i` to the next, the longest edge first.
    along: [DVec3; 3],
    /// Unit vector in the plane, square to edge `i`, pointing inside.
    inward: [DVec3; 3],
}

/// A triangle relative to some origin.
#[derive(Clone, Copy)]
pub(crate) struct LocalTriangle {
    normal: [f32; 3],
    /// Signed distance of the origin from the plane.
    height: f32,
    edges: [LocalEdge; 3],
}

#[derive(Clone, Copy)]
struct LocalEdge {
    inward: [f32; 3],
    /// Signed distance of the origin from the edge's line, in the plane.
    depth: f32,
    along: [f32; 3],
    /// Positions of the ends along the edge, measured from the origin's foot.
    start: f32,
    end: f32,
}

/// Distances and the directions they grow in.
#[derive(Clone, Copy)]
pub(crate) struct Gradient {
    pub(crate) distance: [f32; LANES],
    /// Vector from the closest point of the triangle to the point: as long as the distance.
    pub(crate) offset: Points,
}

impl TriangleFrame {
    pub(crate) fn new([a, b, c]: [DVec3; 3]) -> Self {
        let lengths = [a.distance_squared(b), b.distance_squared(c), c.distance_squared(a)];
        let corners = if lengths[0] >= lengths[1].max(lengths[2]) {
            [a, b, c]
        } else if lengths[1] >= lengths[2] {
            [b, c, a]
        } else {
            [c, a, b]
        };
        let [p, q, r] = corners;
        let longest = (q - p).normalize_or(DVec3::X);
        let across = (r - p) - longest * longest.dot(r - p);
        if across.length() <= 1e-11 * p.distance(q) || across == DVec3::ZERO {
            return Self::segment(corners, longest);
        }
        let normal = longest.cross(across.normalize()).normalize();
        let along = [longest, (r - q).normalize(), (p - r).normalize()];
        let inward = [normal.cross(along[0]), normal.cross(along[1]), normal.cross(along[2])];
        Self { corners, normal, along, inward }
    }

    /// A triangle without area: its longest edge, there and back, between which nothing is inside.
    fn segment([p, q, _]: [DVec3; 3], along: DVec3) -> Self {
        let normal = along.any_orthonormal_vector();
        let along = [along, -along, -along];
        Self { corners: [p, q, q], normal, along, inward: along.map(|u| normal.cross(u)) }
    }

    /// The triangle relative to `origin`.
    // Written out edge by edge: mapping over arrays of structures made the whole ingest 5 % slower.
    pub(crate) fn relative_to(&self, origin: DVec3) -> LocalTriangle {
        let [p, q, r] = [self.corners[0] - origin, self.corners[1] - origin, self.corners[2] - origin];
        // A segment runs back from its second corner to its first.
        let is_segment = self.corners[1] == self.corners[2];
        LocalTriangle {
            normal: self.normal.as_vec3().to_array(),
            height: -self.normal.dot(p) as f32,
            edges: [self.edge(0, p, q), self.edge(1, q, if is_segment { p } else { r }), self.edge(2, r, p)],
        }
    }

    #[inline(always)]
    fn edge(&self, i: usize, from: DVec3, to: DVec3) -> LocalEdge {
        LocalEdge {
            inward: self.inward[i].as_vec3().to_array(),
            depth: -self.inward[i].dot(from) as f32,
            along: self.along[i].as_vec3().to_array(),
            start: self.along[i].dot(from) as f32,
            end: self.along[i].dot(to) as f32,
        }
    }
}

/// Coordinates of a point relative to one edge: how far inside its line, and how far past its ends.
#[inline(always)]
fn edge_coordinates(edge: &LocalEdge, [x, y, z]: [f32; 3]) -> (f32, f32) {
    let inside = edge.inward[0] * x + edge.inward[1] * y + edge.inward[2] * z + edge.depth;
    let position = edge.along[0] * x + edge.along[1] * y + edge.along[2] * z;
    let from_start = if position < edge.start { edge.start } else { position };
    let clamped = if from_start > edge.end { edge.end } else { from_start };
    (inside, position - clamped)
}

/// Whether the foot of a point on the plane lies in the triangle. Asking that it also lies between the ends of the longest
/// edge excludes the far side of a sliver's tip, where rounding may put a point inside all three lines.
#[inline(always)]
fn foot_inside(edges: [(f32, f32); 3]) -> bool {
    (edges[0].0 >= 0.0) & (edges[1].0 >= 0.0) & (edges[2].0 >= 0.0) & (edges[0].1 == 0.0)
}

impl LocalTriangle {
    /// Height of a point above the plane, and its coordinates relative to each edge.
    #[inline(always)]
    fn coordinates(&self, p: [f32; 3]) -> (f32, [(f32, f32); 3]) {
        let height = self.normal[0] * p[0] + self.normal[1] * p[1] + self.normal[2] * p[2] + self.height;
        let [first, second, third] = &self.edges;
        (height, [edge_coordinates(first, p), edge_coordinates(second, p), edge_coordinates(third, p)])
    }

    /// Squared distances of the points.
    #[inline(always)]
    pub(crate) fn distances_sq(&self, points: &Points) -> [f32; LANES] {
        let mut out = [0.0; LANES];
        for lane in 0..LANES {
            let (height, edges) = self.coordinates([points[0][lane], points[1][lane], points[2][lane]]);
            let to_edge = edges.map(|(inside, past)| inside * inside + past * past);
            let nearer = if to_edge[1] < to_edge[0] { to_edge[1] } else { to_edge[0] };
            let nearest = if to_edge[2] < nearer { to_edge[2] } else { nearer };
            let in_plane = if foot_inside(edges) { 0.0 } else { nearest };
            out[lane] = height * height + in_plane;
        }
        out
    }

    /// Distances of the points, and the ways there from their closest points.
    #[inline(always)]
    pub(crate) fn gradient(&self, points: &Points) -> Gradient {
        let mut out = Gradient { distance: [0.0; LANES], offset: [[0.0; LANES]; 3] };
        for lane in 0..LANES {
            let (height, edges) = self.coordinates([points[0][lane], points[1][lane], points[2][lane]]);
            let (mut best, mut offset) = (f32::INFINITY, [0.0; 3]);
            for i in 0..3 {
                let (inside, past) = edges[i];
                let distance_sq = inside * inside + past * past;
                let nearer = distance_sq < best;
                best = if nearer { distance_sq } else { best };
                for axis in 0..3 {
                    let component = inside * self.edges[i].inward[axis] + past * self.edges[i].along[axis];
                    offset[axis] = if nearer { component } else { offset[axis] };
                }
            }
            let keep = if foot_inside(edges) { 0.0 } else { 1.0 };
            out.distance[lane] = (height * height + keep * best).sqrt();
            for axis in 0..3 {
                out.offset[axis][lane] = height * self.normal[axis] + keep * offset[axis];
            }
        }
        out
    }
}

/// Distance of each point from the closest of the triangles that `list` names; infinite if it names none.
pub(crate) fn nearest_distances(triangles: &[LocalTriangle], list: &[u32], points: &Points) -> [f32; LANES] {
    dispatch!(Level::new(), simd => simd.vectorize(
        #[inline(always)]
        || {
            let mut nearest = [f32::INFINITY; LANES];
            for t in list {
                let distances_sq = triangles[*t as usize].distances_sq(points);
                for lane in 0..LANES {
                    nearest[lane] =
                        if distances_sq[lane] < nearest[lane] { distances_sq[lane] } else { nearest[lane] };
                }
            }
            nearest.map(f32::sqrt)
        }
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_spatial::closest_on_triangle;

    /// Eight points of a cube around the origin, and triangles of many sizes and shapes near it.
    fn check(corners: [DVec3; 3], what: &str) {
        let points = crate::descent::corners([1.5, -2.25, 0.5], 3.5);
        let origin = DVec3::new(1000.0, -2000.0, 500.0);
        let local = TriangleFrame::new(corners.map(|c| c + origin)).relative_to(origin);
        let (squares, gradient) = (local.distances_sq(&points), local.gradient(&points));
        for lane in 0..LANES {
            let p = DVec3::from_array([0, 1, 2].map(|axis| f64::from(points[axis][lane])));
            let (q, _) = closest_on_triangle(p, &corners);
            let distance = p.distance(q);
            // What is farther than a tile only has to stay far.
            let tolerance = 1e-4 + 1e-6 * distance;
            assert!((f64::from(squares[lane]).sqrt() - distance).abs() < tolerance, "{what}: {distance}");
            assert!((f64::from(gradient.distance[lane]) - distance).abs() < tolerance, "{what}: {distance}");
            let offset = DVec3::from_array([0, 1, 2].map(|axis| f64::from(gradient.offset[axis][lane])));
            assert!(offset.distance(p - q) < 10.0 * tolerance, "{what}: {offset} against {}", p - q);
        }
    }

    #[test]
    fn agrees_with_the_closest_point_for_all_shapes_and_sizes() {
        let direction = |k: f64| DVec3::new((1.3 * k).sin(), (2.9 * k + 1.0).cos(), (4.1 * k).cos());
        for k in 0..200 {
            let k = f64::from(k);
            let centre = 9.0 * direction(k + 0.5);
            for size in [0.3, 4.0, 100.0, 20_000.0] {
                let [a, b, c] =
                    [direction(k), direction(k + 7.0), direction(k + 19.0)].map(|d| d * size + centre);
                check([a, b, c], &format!("triangle {k} of size {size}"));
                check([a, b, a.lerp(b, 0.4)], &format!("segment {k} of size {size}"));
                check([a, a, b], &format!("doubled corner {k} of size {size}"));
            }
            check([centre; 3], &format!("point {k}"));
        }
    }
}
