//! Points spread over a surface.

use crate::SplitMix64;
use glam::DVec3;
use isv_volume::TriangleMesh;

/// A point on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSample {
    /// Position in metres.
    pub point: DVec3,
    /// Unit normal of its triangle by the right-hand rule; zero on a triangle without area.
    pub normal: DVec3,
}

/// Number of samples for an area, in square metres: one a spacing squared, at least one.
pub(crate) fn sample_count(area: f64, spacing_m: f64) -> f64 {
    (area / (spacing_m * spacing_m)).round().max(1.0)
}

/// Draws points uniformly from a surface, each on its own (no stratification), as Sec. 4.1 of the paper does.
///
/// `round(area / spacing_m^2)` samples, at least one. Mesh, spacing and seed fix the sequence. Three numbers
/// of [`SplitMix64`] a sample pick a triangle by its share of the area, then a point in it.
///
/// # Panics
/// If the mesh has no triangles or names vertices that are not there ([`TriangleMesh::validate`] tells), or the
/// spacing is not positive.
#[must_use]
pub fn sample_surface(mesh: &TriangleMesh, spacing_m: f64, seed: u64) -> Vec<SurfaceSample> {
    let normals: Vec<DVec3> =
        (0..mesh.triangles.len()).map(|face| mesh.area_vector(face).normalize_or_zero()).collect();
    let sample = |drawn: Drawn| SurfaceSample { point: drawn.point, normal: normals[drawn.face] };
    draw(mesh, spacing_m, seed).map(sample).collect()
}

/// A sample as it is drawn.
pub(crate) struct Drawn {
    pub(crate) point: DVec3,
    /// Triangle of the sample.
    pub(crate) face: usize,
    /// How much of each corner of the triangle it is (barycentric coordinates).
    pub(crate) weights: [f64; 3],
}

/// The samples of [`sample_surface`].
pub(crate) fn draw(mesh: &TriangleMesh, spacing_m: f64, seed: u64) -> impl ExactSizeIterator<Item = Drawn> {
    let area_up_to = areas_up_to(mesh);
    picks(&area_up_to, spacing_m, seed).map(move |(target, in_face)| {
        // Rounding can put the target at the total, past the last triangle.
        let face = area_up_to.partition_point(|up_to| *up_to <= target).min(area_up_to.len() - 1);
        drawn(mesh, face, in_face)
    })
}

/// Samples in the order of their triangles, which most files list by place: found by one walk through the
/// mesh.
pub(crate) fn draw_in_order(mesh: &TriangleMesh, spacing_m: f64, seed: u64) -> Vec<Drawn> {
    let area_up_to = areas_up_to(mesh);
    let mut picks: Vec<_> = picks(&area_up_to, spacing_m, seed).collect();
    picks.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let mut face = 0;
    let walk = |(target, in_face)| {
        while area_up_to[face] <= target && face + 1 < area_up_to.len() {
            face += 1;
        }
        drawn(mesh, face, in_face)
    };
    picks.into_iter().map(walk).collect()
}

/// The area of each triangle and all before it.
fn areas_up_to(mesh: &TriangleMesh) -> Vec<f64> {
    assert!(!mesh.triangles.is_empty(), "a mesh without faces has no surface to sample");
    let mut area = 0.0;
    let up_to = |face| {
        area += mesh.area_vector(face).length();
        area
    };
    (0..mesh.triangles.len()).map(up_to).collect()
}

/// For each sample how much of the area lies before it, and two uniform numbers for its place in the triangle there.
fn picks(
    area_up_to: &[f64],
    spacing_m: f64,
    seed: u64,
) -> impl ExactSizeIterator<Item = (f64, [f64; 2])> + use<> {
    assert!(spacing_m > 0.0, "spacing {spacing_m} is not positive");
    let area = area_up_to[area_up_to.len() - 1];
    let mut random = SplitMix64::new(seed);
    (0..sample_count(area, spacing_m) as usize)
        .map(move |_| (random.next_f64() * area, [random.next_f64(), random.next_f64()]))
}

/// The sample at a uniform place of a triangle.
fn drawn(mesh: &TriangleMesh, face: usize, in_face: [f64; 2]) -> Drawn {
    let [u, v] = in_triangle(in_face);
    let [a, b, c] = mesh.corners(face);
    Drawn { point: a + (b - a) * u + (c - a) * v, face, weights: [1.0 - u - v, u, v] }
}

/// Uniform point of a triangle, as shares of two edges, from two uniform numbers. It is a point of the
/// parallelogram over the edges, its far half turned onto the near one.
fn in_triangle([u, v]: [f64; 2]) -> [f64; 2] {
    if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles in different planes with areas 0.5 and 1.5.
    fn two_triangles() -> TriangleMesh {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 3.0]];
        TriangleMesh {
            vertices: corners.map(DVec3::from).to_vec(),
            normals: Vec::new(),
            triangles: vec![[0, 1, 2], [0, 1, 3]],
            appearance: None,
        }
    }

    /// Which quarter of a triangle (cut at its edge midpoints) holds a point.
    fn quarter([a, b, c]: [DVec3; 3], p: DVec3) -> usize {
        let (ab, ac, ap) = (b - a, c - a, p - a);
        let u = ap.dot(ab) / ab.length_squared();
        let v = ap.dot(ac) / ac.length_squared();
        [u > 0.5, v > 0.5, u + v < 0.5].iter().position(|inside| *inside).unwrap_or(3)
    }

    #[test]
    fn density_is_uniform_over_and_within_triangles() {
        let mesh = two_triangles();
        for seed in 0..5 {
            let samples = sample_surface(&mesh, 0.01, seed);
            assert_eq!(samples.len(), 20_000);
            let mut counts = [0usize; 8];
            for sample in &samples {
                let face = usize::from(sample.normal.z.abs() < 0.5);
                counts[4 * face + quarter(mesh.corners(face), sample.point)] += 1;
            }
            let chi_square: f64 = counts
                .iter()
                .zip([1250.0, 1250.0, 1250.0, 1250.0, 3750.0, 3750.0, 3750.0, 3750.0])
                .map(|(count, expected)| (*count as f64 - expected).powi(2) / expected)
                .sum();
            // 7 degrees of freedom: one seed in a thousand passes 24.3.
            assert!(chi_square < 24.3, "seed {seed}: {counts:?}, chi square {chi_square}");
        }
    }

    #[test]
    fn samples_lie_on_their_triangle_with_its_normal() {
        let mesh = two_triangles();
        assert!((mesh.area() - 2.0).abs() < 1e-15);
        for SurfaceSample { point, normal } in sample_surface(&mesh, 0.05, 9) {
            assert!(normal == DVec3::Z || normal == DVec3::NEG_Y);
            assert!(point.dot(normal).abs() < 1e-15 && point.min_element() >= 0.0);
        }
    }

    #[test]
    fn samples_in_order_are_the_same_samples() {
        let bits = |drawn: &Drawn| (drawn.face, drawn.point.to_array().map(f64::to_bits));
        let mut expected: Vec<_> = draw(&two_triangles(), 0.02, 3).map(|drawn| bits(&drawn)).collect();
        let in_order: Vec<_> = draw_in_order(&two_triangles(), 0.02, 3).iter().map(bits).collect();
        assert!(in_order.is_sorted_by_key(|(face, _)| *face));
        expected.sort_unstable();
        let mut sorted = in_order;
        sorted.sort_unstable();
        assert_eq!(sorted, expected);
    }

    #[test]
    fn sequences_are_fixed_by_their_seed_and_never_empty() {
        let mesh = two_triangles();
        assert_eq!(sample_surface(&mesh, 0.1, 5), sample_surface(&mesh, 0.1, 5));
        assert_ne!(sample_surface(&mesh, 0.1, 5), sample_surface(&mesh, 0.1, 6));
        assert_eq!(sample_surface(&mesh, 100.0, 5).len(), 1);
        let point = TriangleMesh { triangles: vec![[1, 1, 1]], ..two_triangles() };
        assert_eq!(sample_surface(&point, 0.1, 5), [SurfaceSample { point: DVec3::X, normal: DVec3::ZERO }]);
    }

    /// SplitMix64 of seed 1 starts 0.5665..., 0.7458..., 0.9710... The first picks the second triangle (0.5
    /// of its 2 square metres lie before it); u and v are folded to 0.2542... and 0.0289...
    #[test]
    fn published_samples_never_move() {
        let first = sample_surface(&two_triangles(), 0.1, 1)[0].point;
        assert_eq!(first, DVec3::new(0.254_218_242_737_298_87, 0.0, 0.086_991_739_239_611_34));
    }
}
