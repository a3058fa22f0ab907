//! Points spread evenly over a surface.

use glam::DVec3;
use isv_volume::{BlockCoord, COORD_LIMIT, PointCloud, TriangleMesh};
use rayon::prelude::*;
use thiserror::Error;

/// Most points of one surface: 5 GB of positions and normals.
pub const MAX_POINTS: usize = 100_000_000;

/// How many points a surface gets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PointDensity {
    /// This many.
    Count(usize),
    /// One a square of this edge, in metres; rounded, and at least one.
    Spacing(f64),
}

/// Points that cannot be taken.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SamplingError {
    /// A spacing that is zero, negative or not a number.
    #[error("point spacing of {metres} m is not a length")]
    Spacing {
        /// The spacing asked for.
        metres: f64,
    },
    /// More points than [`MAX_POINTS`].
    #[error("{points:.0} points asked for, the limit is {MAX_POINTS}")]
    TooMany {
        /// How many.
        points: f64,
    },
}

/// Spreads points over a mesh. Its area is cut into equal pieces along a curve that fills space, and each
/// piece gets the point in its middle. No random numbers: same mesh, same points.
///
/// On the surface of a captured human the distance to the nearest other point varies by 0.33 to 0.36 of its
/// mean (standard deviation). That holds at spacings of 5 to 20 mm. It is 0.52 for random points. It is 0.67
/// for the vertices of marching cubes, of which many lie close together on either side of a voxel centre.
/// Test `a_sphere_is_covered_evenly` holds the order.
///
/// Normals are interpolated from those of the mesh; without any they are those of the triangles. A mesh without area
/// gives no points.
///
/// # Errors
/// See [`SamplingError`].
///
/// # Panics
/// If triangles name vertices that are not there.
pub fn sample_evenly(mesh: &TriangleMesh, density: PointDensity) -> Result<PointCloud, SamplingError> {
    let area = mesh.area();
    if area <= 0.0 {
        return Ok(PointCloud::default());
    }
    let count = point_count(area, density)?;
    let order = curve_order(mesh, (area / count.max(1) as f64).sqrt());
    let mut passed = 0.0;
    let area_up_to: Vec<f64> = order
        .iter()
        .map(|&face| {
            passed += mesh.area_vector(face as usize).length();
            passed
        })
        .collect();
    let (positions, normals) = (0..count)
        .into_par_iter()
        .map(|i| {
            let target = (i as f64 + 0.5) / count as f64 * passed;
            let place = area_up_to.partition_point(|up_to| *up_to <= target).min(order.len() - 1);
            let before = if place == 0 { 0.0 } else { area_up_to[place - 1] };
            let share = ((target - before) / (area_up_to[place] - before)).clamp(0.0, 1.0);
            let weights = corner_weights(share, i);
            let face = order[place] as usize;
            (interpolate(mesh.corners(face), weights), normal(mesh, face, weights))
        })
        .unzip();
    Ok(PointCloud { positions, normals, viewpoint: None, scans: Vec::new(), colours: Vec::new() })
}

fn point_count(area: f64, density: PointDensity) -> Result<usize, SamplingError> {
    let points = match density {
        PointDensity::Count(count) => count as f64,
        PointDensity::Spacing(metres) if metres.is_finite() && metres > 0.0 => {
            (area / (metres * metres)).round().max(1.0)
        }
        PointDensity::Spacing(metres) => return Err(SamplingError::Spacing { metres }),
    };
    if points > MAX_POINTS as f64 {
        return Err(SamplingError::TooMany { points });
    }
    Ok(points as usize)
}

/// Triangles along a Morton curve through their centroids, in cubes of half a point's spacing.
fn curve_order(mesh: &TriangleMesh, spacing_m: f64) -> Vec<u32> {
    let (low, high) = mesh.bounds().unwrap_or_default();
    let cube = (0.5 * spacing_m).max((high - low).max_element() / f64::from(COORD_LIMIT - 1));
    let mut order: Vec<_> = (0..mesh.triangles.len() as u32)
        .into_par_iter()
        .map(|face| {
            let centroid = mesh.corners(face as usize).iter().sum::<DVec3>() / 3.0;
            (BlockCoord::from(((centroid - low) / cube).as_ivec3().to_array()).morton(), face)
        })
        .collect();
    order.par_sort_unstable();
    order.into_iter().map(|(_, face)| face).collect()
}

/// Barycentric weights of a point. The share of the triangle's area that lies before it decides along one
/// edge, the golden ratio's multiples of its number along the other.
fn corner_weights(share: f64, number: usize) -> [f64; 3] {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let root = share.sqrt();
    let across = (number as f64 * GOLDEN).fract();
    [1.0 - root, root * (1.0 - across), root * across]
}

fn interpolate(corners: [DVec3; 3], weights: [f64; 3]) -> DVec3 {
    corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2]
}

fn normal(mesh: &TriangleMesh, face: usize, weights: [f64; 3]) -> DVec3 {
    let flat = || mesh.area_vector(face).normalize_or_zero();
    if mesh.normals.is_empty() {
        return flat();
    }
    let normals = mesh.triangles[face].map(|vertex| mesh.normals[vertex as usize]);
    interpolate(normals, weights).try_normalize().unwrap_or_else(flat)
}
