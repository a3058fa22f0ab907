//! A triangle by the heights of points above planes.

use crate::descent::LANES;
use fearless_simd::prelude::*;
use glam::DVec3;
use std::ops::{Add, Div, Mul, Sub};

/// A triangle whose height is below this, in voxels, is no more than its longest side.
const FLAT: f64 = 1e-4;

/// Farther than any voxel of a tile.
const FAR_AWAY: f32 = 1e6;

/// Planes of a facet. The first is its own. The next ones hold a side and are square to the triangle, which
/// lies above them. The last are square to a side, at its start.
pub(crate) const OWN: usize = 0;
pub(crate) const SIDES: usize = 1;
pub(crate) const STARTS: usize = 4;
const PLANES: usize = 7;

/// A triangle, by the heights of a point above its planes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Facet {
    /// Heights of the origin above the planes, and how much they grow along each axis.
    pub(crate) heights: [f32; LANES],
    pub(crate) growth: [[f32; LANES]; 3],
    /// A ball around it.
    pub(crate) centre: [f32; 3],
    pub(crate) radius: f32,
    /// Lengths of the sides.
    pub(crate) lengths: [f32; 3],
    /// What the heights above the sides are at least where the closest point is inside the triangle.
    pub(crate) inside_from: f32,
}

/// What a facet is made from, of one triangle or as many as a vector holds.
struct Shape<N> {
    normals: [[N; 3]; PLANES],
    heights: [N; PLANES],
    centre: [N; 3],
    radius: N,
    lengths: [N; 3],
    /// The height of the triangle above its longest side.
    height: N,
}

/// A number, or a vector of them.
trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// A constant of this kind of number.
    fn constant(self, value: f64) -> Self;
    fn root(self) -> Self;
    /// One value where this is larger than the other, another where not.
    fn if_above(self, other: Self, then: Self, otherwise: Self) -> Self;
}

impl Number for f64 {
    fn constant(self, value: f64) -> Self {
        value
    }

    fn root(self) -> Self {
        self.sqrt()
    }

    fn if_above(self, other: Self, then: Self, otherwise: Self) -> Self {
        if self > other { then } else { otherwise }
    }
}

/// Numbers of several triangles, as many as vectors of the machine hold.
#[derive(Clone, Copy)]
struct Vector<S: Simd>(S::f64s);

macro_rules! operators {
    ($($operator:ident $name:ident),*) => { $(
        impl<S: Simd> $operator for Vector<S> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self(self.0.$name(other.0))
            }
        }
    )* };
}
operators!(Add add, Sub sub, Mul mul, Div div);

impl<S: Simd> Number for Vector<S> {
    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        Self(S::f64s::splat(self.0.token(), value))
    }

    #[inline(always)]
    fn root(self) -> Self {
        Self(self.0.sqrt())
    }

    #[inline(always)]
    fn if_above(self, other: Self, then: Self, otherwise: Self) -> Self {
        Self(self.0.simd_gt(other.0).select(then.0, otherwise.0))
    }
}

impl<N: Number> Shape<N> {
    /// Facets of triangles that have an area.
    #[inline(always)]
    fn from_corners(corners: [[N; 3]; 3]) -> Self {
        let [a, b, c] = corners;
        let edges = [minus(b, a), minus(c, b), minus(a, c)];
        let lengths = [length(edges[0]), length(edges[1]), length(edges[2])];
        let area = cross(edges[0], edges[1]);
        let area_length = length(area);
        let normal = over(area, area_length);
        let (mut normals, mut heights) = ([normal; PLANES], [zero_less(dot(normal, a)); PLANES]);
        let half = a[0].constant(0.5);
        let (mut centre, mut longest) = (times(plus(a, b), half), lengths[0]);
        for side in 0..3 {
            let along = over(edges[side], lengths[side]);
            normals[SIDES + side] = cross(normal, along);
            normals[STARTS + side] = along;
            heights[SIDES + side] = zero_less(dot(normals[SIDES + side], corners[side]));
            heights[STARTS + side] = zero_less(dot(along, corners[side]));
            // About the smallest ball is that around the longest side, widened to the third corner.
            let middle = times(plus(corners[side], corners[(side + 1) % 3]), half);
            for axis in 0..3 {
                centre[axis] = lengths[side].if_above(longest, middle[axis], centre[axis]);
            }
            longest = lengths[side].if_above(longest, lengths[side], longest);
        }
        let mut radius_sq = a[0].constant(0.0);
        for corner in corners {
            let way = minus(corner, centre);
            let square = dot(way, way);
            radius_sq = square.if_above(radius_sq, square, radius_sq);
        }
        // Of a triangle larger than a tile, rounding moves the ball by less than this.
        let radius = radius_sq.root() * a[0].constant(1.0 + 1e-6) + a[0].constant(1e-3);
        Self { normals, heights, centre, radius, lengths, height: area_length / longest }
    }
}

impl Facet {
    /// Whether it is no more than its longest side, whichever that is.
    pub(crate) fn is_flat(&self) -> bool {
        self.inside_from >= FAR_AWAY
    }

    /// Eight triangles.
    #[inline(always)]
    pub(crate) fn of_eight<S: Simd>(simd: S, triangles: &[[DVec3; 3]; LANES]) -> [Self; LANES] {
        let mut facets = [Self::default(); LANES];
        let some = S::f64s::LEN;
        for (facets, triangles) in facets.chunks_exact_mut(some).zip(triangles.chunks_exact(some)) {
            Self::of_some(simd, triangles, facets);
        }
        facets
    }

    /// Makes facets of as many triangles as a vector holds.
    #[inline(always)]
    fn of_some<S: Simd>(simd: S, triangles: &[[DVec3; 3]], facets: &mut [Self]) {
        let mut corners = [[Vector::<S>(S::f64s::splat(simd, 0.0)); 3]; 3];
        for lane in 0..S::f64s::LEN {
            for corner in 0..3 {
                let position = triangles[lane][corner];
                corners[corner][0].0[lane] = position.x;
                corners[corner][1].0[lane] = position.y;
                corners[corner][2].0[lane] = position.z;
            }
        }
        let shape = Shape::from_corners(corners);
        for (lane, (facet, triangle)) in facets.iter_mut().zip(triangles).enumerate() {
            for plane in 0..PLANES {
                facet.heights[plane] = shape.heights[plane].0[lane] as f32;
                for axis in 0..3 {
                    facet.growth[axis][plane] = shape.normals[plane][axis].0[lane] as f32;
                }
            }
            for axis in 0..3 {
                facet.centre[axis] = shape.centre[axis].0[lane] as f32;
                facet.lengths[axis] = shape.lengths[axis].0[lane] as f32;
            }
            facet.radius = shape.radius.0[lane] as f32;
            // Of a triangle without area, the height is not even a number.
            let has_area = shape.height.0[lane] > FLAT;
            if !has_area {
                *facet = Self::flat(*triangle);
            }
        }
    }

    /// A triangle that is no more than its longest side.
    fn flat(corners: [DVec3; 3]) -> Self {
        let length = |side: usize| corners[side].distance(corners[(side + 1) % 3]);
        let longest = (0..3).fold(0, |a, b| if length(b) > length(a) { b } else { a });
        let (start, end) = (corners[longest], corners[(longest + 1) % 3]);
        let along = (end - start).try_normalize().unwrap_or(DVec3::X);
        let normal = along.any_orthonormal_vector();
        let mut facet = Self { inside_from: FAR_AWAY, ..Self::default() };
        let mut set = |plane: usize, normal: DVec3| {
            facet.heights[plane] = -normal.dot(start) as f32;
            for axis in 0..3 {
                facet.growth[axis][plane] = normal[axis] as f32;
            }
        };
        set(OWN, normal);
        for side in 0..3 {
            // The other sides may point anywhere.
            set(SIDES + side, normal.cross(along));
            set(STARTS + side, along);
        }
        let centre = 0.5 * (start + end);
        let radius = corners.map(|corner| corner.distance(centre)).into_iter().fold(0.0, f64::max);
        Self {
            centre: centre.as_vec3().to_array(),
            radius: (radius * (1.0 + 1e-6) + 1e-3) as f32,
            lengths: [length(longest) as f32; 3],
            ..facet
        }
    }
}

#[inline(always)]
fn plus<N: Number>(a: [N; 3], b: [N; 3]) -> [N; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
fn minus<N: Number>(a: [N; 3], b: [N; 3]) -> [N; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn times<N: Number>(a: [N; 3], b: N) -> [N; 3] {
    [a[0] * b, a[1] * b, a[2] * b]
}

#[inline(always)]
fn over<N: Number>(a: [N; 3], b: N) -> [N; 3] {
    times(a, b.constant(1.0) / b)
}

#[inline(always)]
fn dot<N: Number>(a: [N; 3], b: [N; 3]) -> N {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross<N: Number>(a: [N; 3], b: [N; 3]) -> [N; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
fn length<N: Number>(a: [N; 3]) -> N {
    dot(a, a).root()
}

#[inline(always)]
fn zero_less<N: Number>(a: N) -> N {
    a.constant(0.0) - a
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::dispatch;
    use isv_kernels::simd;
    use isv_testkit::Random;

    #[test]
    fn eight_triangles_are_those_of_one_at_a_time_bit_for_bit() {
        let mut random = Random::new(8);
        for size in [1e-3, 0.5, 4.0, 3000.0] {
            let triangles: [[DVec3; 3]; LANES] = std::array::from_fn(|lane| {
                let place = random.point() * 30.0;
                let [a, b, c] = [0; 3].map(|_| place + size * random.point());
                // Two without area.
                if lane < 2 { [a, b, if lane == 0 { a } else { 0.5 * (a + b) }] } else { [a, b, c] }
            });
            let facets = dispatch!(simd::level(), simd => Facet::of_eight(simd, &triangles));
            for (facet, triangle) in facets.iter().zip(&triangles) {
                let shape = Shape::from_corners(triangle.map(|corner| corner.to_array()));
                let has_area = shape.height > FLAT;
                if !has_area {
                    assert_eq!(facet.inside_from, FAR_AWAY);
                    continue;
                }
                for plane in 0..PLANES {
                    assert_eq!(facet.heights[plane], shape.heights[plane] as f32);
                    assert_eq!(
                        [0, 1, 2].map(|axis| facet.growth[axis][plane]),
                        shape.normals[plane].map(|c| c as f32)
                    );
                }
                assert_eq!(facet.centre, shape.centre.map(|c| c as f32));
                assert_eq!(
                    (facet.radius, facet.lengths),
                    (shape.radius as f32, shape.lengths.map(|c| c as f32))
                );
            }
        }
    }
}
