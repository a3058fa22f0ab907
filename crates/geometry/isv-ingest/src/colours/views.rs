//! Colours that cameras see of a surface.

use super::depth_map::{DepthMap, slant};
use super::{spread_over, weights_of};
use glam::{DVec2, DVec3};
use isv_volume::{ColourSample, ColourView, DepthImage, Intrinsics, TriangleMesh};
use rayon::prelude::*;

/// Points that a thread works on at a time.
const CHUNK: usize = 4096;

/// Least cosine of the angle between the view of a point and its normal: 75 degrees.
const LEAST_COSINE: f64 = 0.26;

/// Voxels along the view, that a surface may lie before or behind another and count as one.
const TOLERANCE_VOXELS: f64 = 2.0;

/// Pixels by which a camera without calibration may be wrong.
const ROUGH_PIXELS: usize = 4;

/// Noise of inverse depth in depth images (1/m), as fusion takes it.
const NOISE: f64 = 0.006;

/// Pixels around a reading of a depth image that must not be nearer.
const BESIDE: i32 = 2;

/// Weight of a view, as (cosine / metre)^2, that counts half as much as the best.
const HALF_WEIGHT: f32 = 0.05;

/// Point of a surface whose colour is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Place in metres.
    pub position: DVec3,
    /// Unit normal towards the outside.
    pub normal: DVec3,
}

/// Colour that cameras saw of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SeenColour {
    /// sRGB of 0 to 255 a channel.
    pub colour: [f32; 3],
    /// Sum of (cosine / distance in metres)^2 over the cameras; 0 if none saw the point.
    pub weight: f32,
}

/// The colours of points of a mesh that cameras see, in the order of the points.
///
/// A camera sees a point if the mesh, drawn from it, is not nearer there, and no jump in depth is within a
/// few pixels. These are a voxel and one pixel, or more if the camera is not calibrated. If the camera has a
/// depth image beside it, this must have a reading at the point, too. Views count by (cosine / distance)^4,
/// so that the best one prevails. `voxel_m`: edge of a voxel of the mesh, which it may be wrong by.
#[must_use]
pub fn seen_colours(
    mesh: &TriangleMesh,
    points: &[SurfacePoint],
    views: &[ColourView],
    depths: &[DepthImage],
    voxel_m: f64,
) -> Vec<SeenColour> {
    let mut seen = vec![SeenColour::default(); points.len()];
    let mut shares = vec![0.0f32; points.len()];
    let tolerance_m = TOLERANCE_VOXELS * voxel_m;
    for view in views {
        let extra = if view.is_rough() { ROUGH_PIXELS } else { 0 };
        let map = DepthMap::new(mesh, view.intrinsics(), view.pose(), voxel_m, extra);
        let depth = view.depth_image().and_then(|image| depths.get(image));
        let add = |(point, (seen, share)): (&SurfacePoint, (&mut SeenColour, &mut f32))| {
            let Some((weight, colour)) = look(view, &map, point, tolerance_m) else { return };
            if depth.is_some_and(|depth| !agrees(depth, point, tolerance_m)) {
                return;
            }
            let own = weight * weight;
            *share += own;
            seen.weight += weight;
            for (mean, value) in seen.colour.iter_mut().zip(colour) {
                *mean += (value - *mean) * (own / *share);
            }
        };
        let seen = seen.par_iter_mut().zip(&mut shares);
        points.par_iter().zip(seen).with_min_len(CHUNK).for_each(add);
    }
    seen
}

/// Samples the colours that cameras see of a mesh, at places that lie evenly on it, one a `spacing_m` squared (metres). See
/// [`seen_colours`]; what no camera saw has no samples.
#[must_use]
pub fn view_colours(
    mesh: &TriangleMesh,
    views: &[ColourView],
    depths: &[DepthImage],
    voxel_m: f64,
    spacing_m: f64,
) -> Vec<ColourSample> {
    if views.is_empty() {
        return Vec::new();
    }
    let points = spread_over(mesh, spacing_m, |face, normal, k| {
        let weights = weights_of(k);
        let corners = mesh.corners(face);
        let position = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
        // The gradient of a field is smoother than its triangles.
        let smooth = mesh.triangles[face].map(|v| mesh.normals.get(v as usize).copied().unwrap_or_default());
        let smooth = smooth[0] * weights[0] + smooth[1] * weights[1] + smooth[2] * weights[2];
        let normal = if smooth.length_squared() > 0.25 { smooth.normalize() } else { normal };
        let point = SurfacePoint { position, normal };
        // Most of a large scene is seen by no camera of a frame.
        views.iter().any(|view| cosine_in(view, &point).is_some()).then_some(point)
    });
    let seen = seen_colours(mesh, &points, views, depths, voxel_m);
    let sample = |(point, seen): (&SurfacePoint, &SeenColour)| {
        (seen.weight > 0.0).then(|| ColourSample {
            position: point.position.as_vec3().to_array(),
            normal: point.normal.as_vec3().to_array(),
            colour: seen.colour,
            weight: seen.weight,
        })
    };
    points.par_iter().zip(&seen).filter_map(sample).collect()
}

/// Samples of [`view_colours`] with weights of 0 to 1, to which the codec fits its own. A good view counts
/// little more than a fair one.
#[must_use]
pub fn level_weights(mut samples: Vec<ColourSample>) -> Vec<ColourSample> {
    samples.par_iter_mut().for_each(|sample| sample.weight = level(sample.weight));
    samples
}

/// A weight of 0 to 1: half for a view from about 4 m.
pub(super) fn level(weight: f32) -> f32 {
    weight / (weight + HALF_WEIGHT)
}

/// Cosine between a view of a point and its normal. `None` if the point does not face the camera or lies
/// outside of the image.
fn cosine_in(view: &ColourView, point: &SurfacePoint) -> Option<f64> {
    let towards = view.pose().centre - point.position;
    let cosine = towards.dot(point.normal) / towards.length();
    // What is not a number is not seen.
    if cosine.is_nan() || cosine < LEAST_COSINE {
        return None;
    }
    let p = view.pose().to_camera(point.position);
    if p.z <= 0.0 {
        return None;
    }
    let place = view.intrinsics().project(p);
    let Intrinsics { width, height, .. } = *view.intrinsics();
    let last = DVec2::new(f64::from(width) - 1.0, f64::from(height) - 1.0);
    (place.cmpge(DVec2::ZERO).all() && place.cmple(last).all()).then_some(cosine)
}

/// The weight and the colour of a point in a view that sees it.
fn look(
    view: &ColourView,
    map: &DepthMap,
    point: &SurfacePoint,
    tolerance_m: f64,
) -> Option<(f32, [f32; 3])> {
    let cosine = cosine_in(view, point)?;
    if !map.shows(point.position, point.normal, tolerance_m) {
        return None;
    }
    let colour = view.colour(view.intrinsics().project(view.pose().to_camera(point.position)))?;
    let distance = view.pose().centre.distance(point.position);
    Some(((cosine / distance).powi(2) as f32, colour))
}

/// Whether a depth image has a reading at a point, and nothing nearer beside it.
fn agrees(depth: &DepthImage, point: &SurfacePoint, tolerance_m: f64) -> bool {
    let (lens, pose) = (depth.intrinsics(), depth.pose());
    let p = pose.to_camera(point.position);
    if p.z <= 0.0 {
        return false;
    }
    let place = lens.project(p).round();
    let last = DVec2::new(f64::from(lens.width) - 1.0, f64::from(lens.height) - 1.0);
    if !(place.cmpge(DVec2::ZERO).all() && place.cmple(last).all()) {
        return false;
    }
    let (inverse, slant) = (1.0 / p.z, slant(lens, pose, p, point.normal));
    let allowed = tolerance_m / (p.z * p.z) + NOISE;
    let [column, row] = [place.x as i32, place.y as i32];
    let at = |column: i32, row: i32| {
        let inside = (0..lens.width as i32).contains(&column) && (0..lens.height as i32).contains(&row);
        inside.then(|| depth.depth_m(column as u32, row as u32)).flatten().map(|depth| 1.0 / f64::from(depth))
    };
    let is_here = at(column, row).is_some_and(|reading| (reading - inverse).abs() <= allowed + slant);
    is_here
        && (-BESIDE..=BESIDE).all(|down| {
            (-BESIDE..=BESIDE).all(|right| {
                let reach = slant * f64::from(BESIDE + 1);
                at(column + right, row + down).is_none_or(|reading| reading <= inverse + allowed + reach)
            })
        })
}
