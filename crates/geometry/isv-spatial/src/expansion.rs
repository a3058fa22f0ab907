//! The far field of a cluster of triangles (Barill et al. 2018, Sec. 3.2), to second order.
//!
//! With `g(x) = (x - p) / |x - p|^3`, 4 pi times the winding number at `p` is the integral of `n . g` over
//! the surface. Expanding `g` around a centre leaves the integrals of `n`, `n (x - centre)^T` and `n (x -
//! centre) (x - centre)^T`. As `g` is a gradient its derivatives are symmetric in all indices. So only the
//! symmetric parts of those tensors count, and they are kept as the coefficients of a quadratic and a cubic
//! form.

use fearless_simd::prelude::*;
use glam::DVec3;

/// Coefficients of xx, yy, zz, xy, xz, yz.
type Quadratic = [f64; 6];

/// Coefficients of xxx, yyy, zzz, xxy, xxz, xyy, yyz, xzz, yzz, xyz.
type Cubic = [f64; 10];

/// Moments of the oriented surface of some triangles.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Expansion {
    /// The point expanded around: the area-weighted mean of the triangles.
    pub(crate) centre: DVec3,
    /// No corner is farther than this from `centre`.
    pub(crate) radius: f64,
    area: f64,
    normal: DVec3,
    first: Quadratic,
    second: Cubic,
}

impl Expansion {
    /// Moments of a few triangles; there must be at least one.
    pub(crate) fn of_triangles(triangles: &[[DVec3; 3]]) -> Self {
        let (mut area, mut weighted, mut plain) = (0.0, DVec3::ZERO, DVec3::ZERO);
        for corners in triangles {
            let (normal, centroid) = (vector_area(corners), centroid(corners));
            area += normal.length();
            weighted += normal.length() * centroid;
            plain += centroid;
        }
        let centre = if area > 0.0 { weighted / area } else { plain / triangles.len() as f64 };
        let mut out = Self::empty(centre, area);
        for corners in triangles {
            let (normal, centroid) = (vector_area(corners), centroid(corners));
            let shift = centroid - centre;
            out.normal += normal;
            add_quadratic(&mut out.first, normal, shift);
            add_cubic(&mut out.second, normal, shift, shift);
            for corner in corners {
                // A triangle's second moment about its centroid is a twelfth of that of three unit masses at its corners.
                add_cubic(&mut out.second, normal / 12.0, *corner - centroid, *corner - centroid);
                out.radius = out.radius.max(corner.distance(centre));
            }
        }
        out
    }

    /// Moments of two clusters together, whose triangles all lie in the box `lo..hi`.
    pub(crate) fn join(a: &Self, b: &Self, lo: DVec3, hi: DVec3) -> Self {
        let area = a.area + b.area;
        let share = if area > 0.0 { b.area / area } else { 0.5 };
        let mut out = Self::empty(a.centre.lerp(b.centre, share), area);
        for part in [a, b] {
            out.add_shifted(part);
            out.radius = out.radius.max(part.centre.distance(out.centre) + part.radius);
        }
        out.radius = out.radius.min((out.centre - lo).abs().max((hi - out.centre).abs()).length());
        out
    }

    fn empty(centre: DVec3, area: f64) -> Self {
        Self { centre, radius: 0.0, area, normal: DVec3::ZERO, first: [0.0; 6], second: [0.0; 10] }
    }

    /// Adds the moments of `part`, moved from its centre to this one.
    fn add_shifted(&mut self, part: &Self) {
        let shift = part.centre - self.centre;
        self.normal += part.normal;
        for (sum, v) in self.first.iter_mut().zip(part.first) {
            *sum += v;
        }
        add_quadratic(&mut self.first, part.normal, shift);
        for (sum, v) in self.second.iter_mut().zip(part.second) {
            *sum += v;
        }
        add_product(&mut self.second, &part.first, 2.0 * shift);
        add_cubic(&mut self.second, part.normal, shift, shift);
    }

    /// The solid angle of the cluster seen from `p`, valid well outside its radius.
    pub(crate) fn solid_angle(&self, p: DVec3) -> f64 {
        let r = self.centre - p;
        let inverse_sq = 1.0 / r.length_squared();
        let inverse_cubed = inverse_sq * inverse_sq.sqrt();
        let [xx, yy, zz, ..] = self.first;
        let [xxx, yyy, zzz, xxy, xxz, xyy, yyz, xzz, yzz, _] = self.second;
        let trace = DVec3::new(xxx + (xyy + xzz) / 3.0, yyy + (xxy + yzz) / 3.0, zzz + (xxz + yyz) / 3.0);
        let quadratic = quadratic_at(&self.first, r) * inverse_sq;
        let cubic = cubic_at(&self.second, r) * inverse_sq;
        let first = xx + yy + zz - 3.0 * quadratic;
        let second = (7.5 * cubic - 4.5 * trace.dot(r)) * inverse_sq;
        (self.normal.dot(r) + first + second) * inverse_cubed
    }
}

/// The ways from the points of a vector to one point, by coordinate.
pub(crate) type Ways<S> = [<S as Simd>::f64s; 3];

impl Expansion {
    /// [`Self::solid_angle`] seen from several points at once, given by the ways from them to the centre.
    #[inline(always)]
    pub(crate) fn solid_angles<S: Simd>(&self, ways: &Ways<S>) -> S::f64s {
        let [x, y, z] = *ways;
        let inverse_sq = S::f64s::splat(x.token(), 1.0) / (x * x + y * y + z * z);
        let inverse_cubed = inverse_sq * inverse_sq.sqrt();
        let [xx, yy, zz, xy, xz, yz] = self.first;
        let [xxx, yyy, zzz, xxy, xxz, xyy, yyz, xzz, yzz, xyz] = self.second;
        let trace =
            x * (xxx + (xyy + xzz) / 3.0) + y * (yyy + (xxy + yzz) / 3.0) + z * (zzz + (xxz + yyz) / 3.0);
        let quadratic = (x * (x * xx + y * xy + z * xz) + y * (y * yy + z * yz) + z * z * zz) * inverse_sq;
        let cubic = x * x * (x * xxx + y * xxy + z * xxz)
            + y * y * (y * yyy + x * xyy + z * yyz)
            + z * z * (z * zzz + x * xzz + y * yzz)
            + x * y * z * xyz;
        let first = quadratic * -3.0 + (xx + yy + zz);
        let second = (cubic * inverse_sq * 7.5 - trace * 4.5) * inverse_sq;
        (x * self.normal.x + y * self.normal.y + z * self.normal.z + first + second) * inverse_cubed
    }
}

/// Area times unit normal.
fn vector_area([a, b, c]: &[DVec3; 3]) -> DVec3 {
    0.5 * (*b - *a).cross(*c - *a)
}

fn centroid([a, b, c]: &[DVec3; 3]) -> DVec3 {
    (*a + *b + *c) / 3.0
}

/// Adds the form `(a . r) (b . r)`.
fn add_quadratic(form: &mut Quadratic, a: DVec3, b: DVec3) {
    for (sum, v) in form.iter_mut().zip(linear_product(a, b)) {
        *sum += v;
    }
}

fn linear_product(a: DVec3, b: DVec3) -> Quadratic {
    [a.x * b.x, a.y * b.y, a.z * b.z, a.x * b.y + a.y * b.x, a.x * b.z + a.z * b.x, a.y * b.z + a.z * b.y]
}

/// Adds the form `(a . r) (b . r) (c . r)`.
fn add_cubic(form: &mut Cubic, a: DVec3, b: DVec3, c: DVec3) {
    add_product(form, &linear_product(a, b), c);
}

/// Adds the form `q(r) (c . r)`.
fn add_product(form: &mut Cubic, &[xx, yy, zz, xy, xz, yz]: &Quadratic, c: DVec3) {
    let product = [
        xx * c.x,
        yy * c.y,
        zz * c.z,
        xx * c.y + xy * c.x,
        xx * c.z + xz * c.x,
        yy * c.x + xy * c.y,
        yy * c.z + yz * c.y,
        zz * c.x + xz * c.z,
        zz * c.y + yz * c.z,
        xy * c.z + xz * c.y + yz * c.x,
    ];
    for (sum, v) in form.iter_mut().zip(product) {
        *sum += v;
    }
}

fn quadratic_at(&[xx, yy, zz, xy, xz, yz]: &Quadratic, r: DVec3) -> f64 {
    r.x * (xx * r.x + xy * r.y + xz * r.z) + r.y * (yy * r.y + yz * r.z) + zz * r.z * r.z
}

fn cubic_at(&[xxx, yyy, zzz, xxy, xxz, xyy, yyz, xzz, yzz, xyz]: &Cubic, r: DVec3) -> f64 {
    r.x * r.x * (xxx * r.x + xxy * r.y + xxz * r.z)
        + r.y * r.y * (yyy * r.y + xyy * r.x + yyz * r.z)
        + r.z * r.z * (zzz * r.z + xzz * r.x + yzz * r.y)
        + xyz * r.x * r.y * r.z
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::winding::solid_angle_sum;
    use isv_testkit::Random;

    /// The first term left out falls with the fifth power of the distance: twice as far must gain a factor of about 32.
    #[test]
    fn the_error_falls_with_the_fifth_power_of_the_distance() {
        let mut random = Random::new(8);
        let triangles: Vec<_> = (0..12).map(|_| [random.point(), random.point(), random.point()]).collect();
        let (a, b) = triangles.split_at(5);
        let joined = Expansion::join(
            &Expansion::of_triangles(a),
            &Expansion::of_triangles(b),
            DVec3::NEG_ONE,
            DVec3::ONE,
        );
        let error_at = |distance: f64| {
            let p = joined.centre + DVec3::new(0.48, -0.6, 0.64) * distance;
            (joined.solid_angle(p) - solid_angle_sum(&triangles, p)).abs()
        };
        let (near, far) = (error_at(8.0), error_at(16.0));
        assert!(near < 1e-2 && far * 20.0 < near, "{near} then {far}");
        let whole = Expansion::of_triangles(&triangles);
        let p = DVec3::new(9.0, 7.0, -5.0);
        assert!((whole.solid_angle(p) - joined.solid_angle(p)).abs() < 1e-12, "joining loses nothing");
    }
}
