//! Every figure against a slow evaluation that shares no code with the measured one but the drawing of
//! samples. It tries all pairs, and each formula is written from its definition.

use glam::DVec3;
use isv_metrics::{CompareOptions, GeometryError, Shape, SplitMix64, chamfer, compare, sample_surface};
use isv_volume::{PointCloud, TriangleMesh};

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Closest point of a triangle by trial. It is the foot on the plane if inside, else the best of the three
/// edges, each searched by thirds.
fn closest_on(p: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let normal = (b - a).cross(c - a).normalize();
    let foot = p - normal * normal.dot(p - a);
    if [(a, b), (b, c), (c, a)].iter().all(|(s, e)| (*e - *s).cross(foot - *s).dot(normal) >= 0.0) {
        return foot;
    }
    let along = |s: DVec3, e: DVec3| {
        let (mut lo, mut hi) = (0.0, 1.0);
        for _ in 0..100 {
            let (left, right) = (lo + (hi - lo) / 3.0, hi - (hi - lo) / 3.0);
            if s.lerp(e, left).distance(p) < s.lerp(e, right).distance(p) { hi = right } else { lo = left }
        }
        s.lerp(e, lo)
    };
    let on_edges = [along(a, b), along(b, c), along(c, a)];
    on_edges.into_iter().min_by(|q, r| q.distance(p).total_cmp(&r.distance(p))).unwrap()
}

/// The closest point of a mesh, and its triangle.
fn closest(mesh: &TriangleMesh, p: DVec3) -> (DVec3, usize) {
    let candidates = (0..mesh.triangles.len()).map(|face| (closest_on(p, mesh.corners(face)), face));
    candidates.min_by(|q, r| q.0.distance(p).total_cmp(&r.0.distance(p))).unwrap()
}

/// The normal of all corners of triangles at a position, each weighed by its angle.
fn vertex_normal(mesh: &TriangleMesh, position: DVec3) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for face in 0..mesh.triangles.len() {
        let corners = mesh.corners(face);
        for i in (0..3).filter(|i| corners[*i] == position) {
            let [p, q, r] = [corners[i], corners[(i + 1) % 3], corners[(i + 2) % 3]];
            let angle = (q - p).normalize().dot((r - p).normalize()).clamp(-1.0, 1.0).acos();
            sum += angle * (q - p).cross(r - p).normalize();
        }
    }
    sum.normalize()
}

/// The interpolated normal at a point of a mesh: weights are the areas opposite of the corners.
fn normal_at(mesh: &TriangleMesh, p: DVec3) -> DVec3 {
    let [a, b, c] = mesh.corners(closest(mesh, p).1);
    let area = |u: DVec3, v: DVec3| (u - p).cross(v - p).length();
    let normals = [a, b, c].map(|corner| vertex_normal(mesh, corner));
    (normals[0] * area(b, c) + normals[1] * area(c, a) + normals[2] * area(a, b)).normalize()
}

/// All points at the smallest distance.
fn nearest(p: DVec3, points: &[DVec3]) -> Vec<usize> {
    let distances: Vec<f64> = points.iter().map(|q| q.distance_squared(p)).collect();
    let best = distances.iter().copied().fold(f64::INFINITY, f64::min);
    (0..points.len()).filter(|i| distances[*i] == best).collect()
}

/// The points of a side and their normals.
type Points = (Vec<DVec3>, Vec<DVec3>);

fn points_of(mesh: &TriangleMesh, spacing_m: f64, seed: u64) -> Points {
    let points: Vec<_> = sample_surface(mesh, spacing_m, seed).iter().map(|s| s.point).collect();
    let normals = points.iter().map(|p| normal_at(mesh, *p)).collect();
    (points, normals)
}

/// One direction of `pc_error`: mean squared error and mean squared error along the normals of `to`.
fn pc_error(from: &[DVec3], to: &[DVec3], normals: &[DVec3]) -> [f64; 2] {
    let (mut d1, mut d2) = (Vec::new(), Vec::new());
    for p in from {
        let ties = nearest(*p, to);
        d1.push(to[ties[0]].distance_squared(*p));
        d2.push(mean(&ties.iter().map(|i| (*p - to[*i]).dot(normals[*i]).powi(2)).collect::<Vec<_>>()));
    }
    [mean(&d1), mean(&d2)]
}

/// Normals of the test points as `scaleNormals` makes them.
fn scale_normals((points, normals): &Points, test: &[DVec3]) -> Vec<DVec3> {
    let taken_by: Vec<Vec<usize>> = points.iter().map(|p| nearest(*p, test)).collect();
    let average = |of: &[usize]| of.iter().map(|i| normals[*i]).sum::<DVec3>() / of.len() as f64;
    (0..test.len())
        .map(|i| {
            let givers: Vec<usize> = (0..points.len()).filter(|k| taken_by[*k].contains(&i)).collect();
            if givers.is_empty() { average(&nearest(test[i], points)) } else { average(&givers) }
        })
        .collect()
}

/// D1 and D2 in decibels.
fn psnr(reference: &Points, test: &[DVec3], peak: f64) -> [f64; 2] {
    let there = pc_error(&reference.0, test, &scale_normals(reference, test));
    let back = pc_error(test, &reference.0, &reference.1);
    [0, 1].map(|i| 10.0 * (3.0 * peak.powi(2) / f64::max(there[i], back[i])).log10())
}

fn slow_chamfer(p: &[DVec3], q: &[DVec3]) -> f64 {
    let there = |from: &[DVec3], to: &[DVec3]| -> Vec<f64> {
        from.iter().map(|x| to[nearest(*x, to)[0]].distance(*x)).collect()
    };
    (mean(&there(p, q)) + mean(&there(q, p))) / 2.0
}

/// Mean, root mean square, 99th percentile and largest, in millimetres.
fn statistics(distances: &[f64]) -> [f64; 4] {
    let mut sorted = distances.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (0.99 * sorted.len() as f64 - 1e-9).ceil() as usize;
    let rms = mean(&distances.iter().map(|d| d * d).collect::<Vec<_>>()).sqrt();
    [mean(distances), rms, sorted[rank - 1], sorted[sorted.len() - 1]].map(|metres| metres * 1e3)
}

#[track_caller]
fn assert_near(actual: impl Into<Option<f64>>, expected: f64, what: &str) {
    let actual = actual.into().unwrap_or_else(|| panic!("{what} is missing"));
    assert!(
        (actual - expected).abs() <= 1e-6 * expected.abs().max(1.0),
        "{what}: {actual}, expected {expected}"
    );
}

/// `farthest`: of the corners of triangles, in metres, there and back.
fn assert_distances(error: &GeometryError, there: &[f64], back: &[f64], farthest: [f64; 2]) {
    let forth = [
        error.ref_to_test_mean_mm,
        error.ref_to_test_rms_mm,
        error.ref_to_test_p99_mm,
        error.ref_to_test_max_mm,
    ];
    let return_ = [
        error.test_to_ref_mean_mm,
        error.test_to_ref_rms_mm,
        error.test_to_ref_p99_mm,
        error.test_to_ref_max_mm,
    ];
    let (mut expected_forth, mut expected_return) = (statistics(there), statistics(back));
    expected_forth[3] = expected_forth[3].max(farthest[0] * 1e3);
    expected_return[3] = expected_return[3].max(farthest[1] * 1e3);
    for i in 0..4 {
        assert_near(forth[i], expected_forth[i], "reference to test");
        assert_near(return_[i], expected_return[i], "test to reference");
    }
    assert_near(error.p2s_mean_mm, (expected_forth[0] + expected_return[0]) / 2.0, "mean");
    let rms = ((expected_forth[1].powi(2) + expected_return[1].powi(2)) / 2.0).sqrt();
    assert_near(error.p2s_rms_mm, rms, "rms");
    assert_near(error.hausdorff_mm, expected_forth[3].max(expected_return[3]), "hausdorff");
    let share = |limit_mm: f64| {
        let below = |d: &[f64]| d.iter().filter(|x| **x * 1e3 <= limit_mm).count() as f64 / d.len() as f64;
        (below(there) + below(back)) / 2.0
    };
    let p99 = error.p2s_p99_mm.unwrap();
    assert!(share(p99 + 1e-6) >= 0.99 && share(p99 - 1e-6) < 0.99, "{p99}");
}

fn assert_agrees(reference: &TriangleMesh, test: &TriangleMesh, spacing_m: f64, seed: u64) {
    let error = compare(reference, test, &CompareOptions { spacing_m, seed }).unwrap();
    let second = SplitMix64::new(seed).next_u64();
    let on_reference = points_of(reference, spacing_m, seed);
    let (again, _) = points_of(reference, spacing_m, second);
    let on_test = points_of(test, spacing_m, second);

    assert_near(error.chamfer_mm, 1e3 * slow_chamfer(&on_reference.0, &on_test.0), "chamfer");
    assert_near(error.chamfer_mm, 1e3 * chamfer(&on_reference.0, &on_test.0), "chamfer of points");
    assert_near(error.chamfer_floor_mm, 1e3 * slow_chamfer(&on_reference.0, &again), "floor");

    let feet = |points: &[DVec3], mesh| points.iter().map(|p| closest(mesh, *p).0).collect::<Vec<_>>();
    let distances = |points: &[DVec3], feet: &[DVec3]| -> Vec<f64> {
        points.iter().zip(feet).map(|(p, foot)| p.distance(*foot)).collect()
    };
    let (there, back) = (feet(&on_reference.0, test), feet(&on_test.0, reference));
    let farthest = |from: &TriangleMesh, to: &TriangleMesh| -> f64 {
        let corners = from.triangles.iter().flatten().map(|vertex| from.vertices[*vertex as usize]);
        corners.map(|corner| closest(to, corner).0.distance(corner)).fold(0.0, f64::max)
    };
    let farthest = [farthest(reference, test), farthest(test, reference)];
    assert_distances(&error, &distances(&on_reference.0, &there), &distances(&on_test.0, &back), farthest);

    let angles = |normals: &[DVec3], feet: &[DVec3], mesh| -> Vec<f64> {
        let angle = |(n, foot): (&DVec3, &DVec3)| n.dot(normal_at(mesh, *foot)).clamp(-1.0, 1.0).acos();
        normals.iter().zip(feet).map(angle).collect()
    };
    let radians =
        (mean(&angles(&on_reference.1, &there, test)) + mean(&angles(&on_test.1, &back, reference))) / 2.0;
    assert_near(error.normal_error_deg, radians.to_degrees(), "normals");

    let corners: Vec<DVec3> = (0..reference.triangles.len()).flat_map(|f| reference.corners(f)).collect();
    let side = |axis: usize| {
        let along = corners.iter().map(|c| c[axis]);
        along.clone().fold(f64::NEG_INFINITY, f64::max) - along.fold(f64::INFINITY, f64::min)
    };
    let peak = side(0).max(side(1)).max(side(2));
    assert_near(error.psnr_peak_m, peak, "peak");
    let [d1, d2] = psnr(&on_reference, &on_test.0, peak);
    assert_near(error.d1_psnr_db, d1, "D1");
    assert_near(error.d2_psnr_db, d2, "D2");
    let [d1, d2] = psnr(&on_reference, &again, peak);
    assert_near(error.d1_ceiling_db, d1, "ceiling of D1");
    assert_near(error.d2_ceiling_db, d2, "ceiling of D2");
}

fn random_point(random: &mut SplitMix64) -> DVec3 {
    DVec3::new(random.next_f64(), random.next_f64(), random.next_f64())
}

/// Random triangles in the unit cube.
fn soup(seed: u64, faces: u32) -> TriangleMesh {
    let mut random = SplitMix64::new(seed);
    TriangleMesh {
        vertices: (0..3 * faces).map(|_| random_point(&mut random)).collect(),
        normals: Vec::new(),
        triangles: (0..faces).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect(),
        appearance: None,
    }
}

/// A hilly field of `side` by `side` quads; every other row of quads has vertices of its own, as along a texture's seams.
fn hills(seed: u64, side: u32) -> TriangleMesh {
    let mut random = SplitMix64::new(seed);
    let heights: Vec<f64> = (0..(side + 1).pow(2)).map(|_| 0.3 * random.next_f64()).collect();
    let mut mesh = TriangleMesh::default();
    for (y, x) in (0..side).flat_map(|y| (0..side).map(move |x| (y, x))) {
        let first = mesh.vertices.len() as u32;
        for (x, y) in [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)] {
            let height = heights[(y * (side + 1) + x) as usize];
            mesh.vertices
                .push(DVec3::new(f64::from(x), f64::from(y), 0.0) / f64::from(side) + height * DVec3::Z);
        }
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    mesh
}

#[test]
fn loose_triangles_agree() {
    for seed in 0..4 {
        assert_agrees(&soup(seed, 12), &soup(seed + 100, 9), 0.1, seed);
    }
}

#[test]
fn smooth_surfaces_agree() {
    assert_agrees(&hills(1, 5), &hills(2, 6), 0.05, 3);
    assert_agrees(&hills(3, 4), &soup(4, 7), 0.07, 5);
}

/// Points on a lattice, where nearly every nearest point has others as near.
#[test]
fn clouds_of_voxels_agree() {
    for seed in 0..4 {
        let mut random = SplitMix64::new(seed);
        let mut voxels = |count: usize| -> PointCloud {
            let positions = (0..count).map(|_| (random_point(&mut random) * 7.0).floor());
            let mut positions: Vec<DVec3> = positions.collect();
            positions.sort_by(|p, q| p.to_array().partial_cmp(&q.to_array()).unwrap());
            positions.dedup();
            let mut normal = || (random_point(&mut random) - DVec3::splat(0.5)).normalize();
            let normals = positions.iter().map(|_| normal()).collect();
            PointCloud { positions, normals, viewpoint: None, scans: Vec::new(), colours: Vec::new() }
        };
        let (reference, test) = (voxels(120), voxels(80));
        let error = compare(&reference, &test, &CompareOptions::default()).unwrap();
        let points = (reference.positions.clone(), reference.normals.clone());
        let [d1, d2] = psnr(&points, &test.positions, error.psnr_peak_m);
        assert_near(error.d1_psnr_db, d1, "D1");
        assert_near(error.d2_psnr_db, d2, "D2");
        assert_near(error.chamfer_mm, 1e3 * slow_chamfer(&reference.positions, &test.positions), "chamfer");
    }
}

#[test]
fn points_and_a_mesh_agree() {
    let (mesh, normals) = (hills(8, 5), vec![DVec3::Z; 200]);
    let mut random = SplitMix64::new(2);
    let positions: Vec<DVec3> = (0..200).map(|_| random_point(&mut random)).collect();
    let cloud = PointCloud { positions, normals, viewpoint: None, scans: Vec::new(), colours: Vec::new() };
    let error = compare(&mesh, &cloud, &CompareOptions { spacing_m: 0.05, seed: 6 }).unwrap();
    let (samples, sample_normals) = points_of(&mesh, 0.05, 6);
    let feet: Vec<DVec3> = cloud.positions.iter().map(|p| closest(&mesh, *p).0).collect();
    let back: Vec<f64> = feet.iter().zip(&cloud.positions).map(|(foot, p)| foot.distance(*p)).collect();
    let [mean_mm, rms_mm, p99_mm, max_mm] = statistics(&back);
    assert_near(error.test_to_ref_mean_mm, mean_mm, "mean");
    assert_near(error.test_to_ref_rms_mm, rms_mm, "rms");
    assert_near(error.test_to_ref_p99_mm, p99_mm, "p99");
    assert_near(error.test_to_ref_max_mm, max_mm, "max");
    let there = sample_normals.iter().map(|n| n.z.acos()).collect::<Vec<_>>();
    let back = feet.iter().map(|foot| normal_at(&mesh, *foot).z.acos()).collect::<Vec<_>>();
    assert_near(error.normal_error_deg, ((mean(&there) + mean(&back)) / 2.0).to_degrees(), "normals");
    let [d1, d2] = psnr(&(samples, sample_normals), &cloud.positions, error.psnr_peak_m);
    assert_near(error.d1_psnr_db, d1, "D1");
    assert_near(error.d2_psnr_db, d2, "D2");
}

#[test]
fn figures_of_clouds_are_the_same_on_any_number_of_threads() {
    let mut random = SplitMix64::new(9);
    let mut cloud = |count: usize| {
        let positions = (0..count).map(|_| random_point(&mut random)).collect();
        let normals = (0..count).map(|_| random_point(&mut random).normalize()).collect();
        PointCloud { positions, normals, viewpoint: None, scans: Vec::new(), colours: Vec::new() }
    };
    let (reference, test, mesh) = (cloud(5000), cloud(7000), hills(4, 9));
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let pairs: [[Shape; 2]; 2] =
            [[(&reference).into(), (&test).into()], [(&reference).into(), (&mesh).into()]];
        pairs.map(|[a, b]| pool.install(|| compare(a, b, &CompareOptions::default()).unwrap()))
    };
    assert_eq!(run(1), run(2));
    assert_eq!(run(1), run(5));
}
