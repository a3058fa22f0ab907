//! Normals of points that came without.

use crate::IngestError;
use crate::points::distinct::Distinct;
use crate::points::eigen::eigen;
use crate::points::orient::{NEIGHBOURS, Neighbours, NormalSides, SideEvidence, orient};
use crate::points::sign::{SPACING_NEIGHBOURS, spacing};
use glam::DVec3;
use isv_spatial::{Neighbour, PointTree};
use isv_volume::PointCloud;
use rayon::prelude::*;
use std::collections::HashMap;

/// Neighbours that a plane is laid through at first, and at most. Each time that they lie on a line, as the
/// points of one sweep of a scanner do, there are twice as many.
const FEWEST: usize = 12;
const MOST: usize = 192;

/// Points whose extent across their line is less than this share of that along it lie on a line.
const LINE: f64 = 0.15;

/// The cloud with a normal at every point around which others lie on a plane, turned as [`estimate_normals_seen_from`] does with no
/// guess.
///
/// # Errors
/// [`IngestError::Points`] if the cloud is not valid.
pub fn estimate_normals(cloud: &PointCloud) -> Result<PointCloud, IngestError> {
    estimate_normals_seen_from(cloud, None).map(|(cloud, _)| cloud)
}

/// The cloud with a normal at every point around which others lie on a plane: the direction in which its nearest neighbours
/// extend least. Where there is no plane, all neighbours lying on a line or in one place, the normal is zero: not known. With what the
/// sides rest on.
///
/// Normals point towards the cloud's viewpoint, or those of its scans, if it has any. Where that is seen at a
/// grazing angle, they point the way of their neighbours. Without a viewpoint, they point towards `guess`, in
/// metres, if the points look as if they had been scanned from there. Such points are as far apart as a
/// scanner's rays, and one behind the other along few of them. Else each connected part is given the signs
/// that differ least between neighbours (a minimum spanning tree, Hoppe et al. 1992). The whole of it is
/// turned such that its outermost points look outward. Normals that the cloud has are not used. Points in one
/// place count as one. The result is the same for any number of threads.
///
/// # Errors
/// [`IngestError::Points`] if the cloud is not valid.
pub fn estimate_normals_seen_from(
    cloud: &PointCloud,
    guess: Option<DVec3>,
) -> Result<(PointCloud, SideEvidence), IngestError> {
    cloud.validate()?;
    let distinct = Distinct::new(&cloud.positions);
    let positions = &distinct.positions[..];
    let tree = PointTree::new(positions.to_vec());
    let planes: Vec<(DVec3, Neighbours)> = positions
        .par_iter()
        .map_init(Vec::new, |found, p| {
            let normal = plane_normal(positions, &tree, *p, found);
            let mut neighbours = [None; NEIGHBOURS];
            for (slot, neighbour) in neighbours.iter_mut().zip(found.iter()) {
                *slot = Some(neighbour.index);
            }
            (normal, neighbours)
        })
        .collect();
    let (mut normals, neighbours): (Vec<DVec3>, Vec<Neighbours>) = planes.into_iter().unzip();
    let of_points: Vec<Option<DVec3>> = cloud.viewpoints().collect();
    let mut views: Vec<Option<DVec3>> =
        (0..positions.len()).map(|position| of_points[distinct.first(position)]).collect();
    let mut basis =
        if views.iter().any(Option::is_some) { NormalSides::Viewpoint } else { NormalSides::Outward };
    if basis == NormalSides::Outward
        && let Some(place) = guess.filter(|place| looks_scanned_from(*place, positions, &tree))
    {
        basis = NormalSides::Guessed(place);
        views.fill(Some(place));
    }
    let evidence = orient(positions, &neighbours, &views, &mut normals);
    let normals = (0..cloud.positions.len()).map(|point| normals[distinct.of_point(point)]).collect();
    let (positions, colours) = (cloud.positions.clone(), cloud.colours.clone());
    let cloud = PointCloud { normals, positions, colours, ..cloud.without_points() };
    Ok((cloud, SideEvidence { basis, ..evidence }))
}

/// Whether points look as if a scanner had taken them all from one place. They are the farther apart the
/// farther away, which points spread over a surface are not. And few lie behind others.
fn looks_scanned_from(place: DVec3, positions: &[DVec3], tree: &PointTree) -> bool {
    /// Points looked at.
    const SAMPLES: usize = 4096;
    /// How much farther than the nearest tenth the farthest tenth is at least.
    const LEAST_SPREAD: f64 = 3.0;
    /// Least exponent of distance in what points are apart.
    const LEAST_GROWTH: f64 = 0.6;
    /// Directions a turn. Rays of scanners are closer.
    const DIRECTIONS: f64 = 720.0;
    /// Points behind others by more than this ratio hide behind them.
    const BEHIND: f64 = 1.3;
    const MOST_HIDDEN: f64 = 0.25;
    let step = positions.len().div_ceil(SAMPLES).max(1);
    let mut found = Vec::new();
    let mut looks: Vec<(f64, f64)> = Vec::new();
    for p in positions.iter().step_by(step) {
        tree.k_nearest(*p, SPACING_NEIGHBOURS + 1, &mut found);
        let (distance, apart) = (p.distance(place), spacing(&found));
        if distance > 0.0 && apart > 0.0 {
            looks.push((distance.ln(), apart.ln()));
        }
    }
    if looks.len() < 100 {
        return false;
    }
    looks.sort_by(|a, b| a.0.total_cmp(&b.0));
    let tenth = looks.len() / 10;
    if looks[looks.len() - 1 - tenth].0 - looks[tenth].0 < LEAST_SPREAD.ln() {
        return false;
    }
    let count = looks.len() as f64;
    let mean = looks.iter().fold((0.0, 0.0), |sum, look| (sum.0 + look.0 / count, sum.1 + look.1 / count));
    let (mut both, mut own) = (0.0, 0.0);
    for (distance, apart) in &looks {
        both += (distance - mean.0) * (apart - mean.1);
        own += (distance - mean.0).powi(2);
    }
    if both / own < LEAST_GROWTH {
        return false;
    }
    // The nearest point of each direction, over cells of equal height and about equal width.
    let cell = |p: &DVec3| {
        let towards = (*p - place).normalize_or_zero();
        let turn = DIRECTIONS / std::f64::consts::TAU;
        ((towards.z.asin() * turn).round() as i32, (towards.y.atan2(towards.x) * turn).round() as i32)
    };
    let mut nearest: HashMap<(i32, i32), f64> = HashMap::new();
    for p in positions {
        let least = nearest.entry(cell(p)).or_insert(f64::INFINITY);
        *least = least.min(p.distance(place));
    }
    let hidden = positions.iter().filter(|p| p.distance(place) > BEHIND * nearest[&cell(p)]).count();
    (hidden as f64) < MOST_HIDDEN * positions.len() as f64
}

/// The normal of the plane through the neighbours of a point, of either sign; zero if there is none. Leaves the neighbours
/// in `found`.
fn plane_normal(positions: &[DVec3], tree: &PointTree, p: DVec3, found: &mut Vec<Neighbour>) -> DVec3 {
    let mut count = FEWEST;
    loop {
        tree.k_nearest(p, count, found);
        let points = found.iter().map(|n| positions[n.index as usize] - p);
        let [_, (middle, _), (largest, _)] = principal_axes(points.clone());
        if middle > LINE * LINE * largest {
            return principal_axes(points)[0].1;
        }
        if found.len() < count || count >= MOST {
            return DVec3::ZERO;
        }
        count *= 2;
    }
}

/// Variances and directions of the axes along which points extend, ascending.
fn principal_axes(points: impl Iterator<Item = DVec3> + Clone) -> [(f64, DVec3); 3] {
    let count = points.clone().count().max(1) as f64;
    let mean = points.clone().sum::<DVec3>() / count;
    let mut covariance = [[0.0; 3]; 3];
    for p in points {
        let d = p - mean;
        for row in 0..3 {
            for column in 0..3 {
                covariance[row][column] += d[row] * d[column] / count;
            }
        }
    }
    eigen(covariance)
}
