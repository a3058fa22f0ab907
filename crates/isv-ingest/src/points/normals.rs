//! Normals of points that came without.

use crate::IngestError;
use crate::points::eigen::eigen;
use crate::points::orient::{NEIGHBOURS, Neighbours, orient_consistently, orient_towards};
use glam::DVec3;
use isv_spatial::{Neighbour, PointTree};
use isv_volume::PointCloud;
use rayon::prelude::*;

/// Neighbours that a plane is laid through at first, and at most: twice as many each time that they lie on a line, as the
/// points of one sweep of a scanner do.
const FEWEST: usize = 12;
const MOST: usize = 192;

/// Points whose extent across their line is less than this share of that along it lie on a line.
const LINE: f64 = 0.15;

/// The cloud with a normal at every point around which others lie on a plane: the direction in which its nearest neighbours
/// extend least. Where there is no plane, all neighbours lying on a line or in one place, the normal is zero: not known.
///
/// Normals point towards the cloud's viewpoint if it has one. Without, each connected part is given the signs that
/// differ least between neighbours (a minimum spanning tree, Hoppe et al. 1992), the whole of it such that its outermost
/// points look outward. Normals that the cloud has are not used. The result is the same for any number of threads.
///
/// # Errors
/// [`IngestError::Points`] if the cloud is not valid.
pub fn estimate_normals(cloud: &PointCloud) -> Result<PointCloud, IngestError> {
    cloud.validate()?;
    let tree = PointTree::new(cloud.positions.clone());
    let planes: Vec<(DVec3, Neighbours)> = cloud
        .positions
        .par_iter()
        .map_init(Vec::new, |found, p| {
            let normal = plane_normal(cloud, &tree, *p, found);
            let mut neighbours = [None; NEIGHBOURS];
            for (slot, neighbour) in neighbours.iter_mut().zip(found.iter()) {
                *slot = Some(neighbour.index);
            }
            (normal, neighbours)
        })
        .collect();
    let (mut normals, neighbours): (Vec<DVec3>, Vec<Neighbours>) = planes.into_iter().unzip();
    match cloud.viewpoint {
        Some(viewpoint) => orient_towards(viewpoint, &cloud.positions, &mut normals),
        None => orient_consistently(&cloud.positions, &neighbours, &mut normals),
    }
    Ok(PointCloud { positions: cloud.positions.clone(), normals, viewpoint: cloud.viewpoint })
}

/// The normal of the plane through the neighbours of a point, of either sign; zero if there is none. Leaves the neighbours
/// in `found`.
fn plane_normal(cloud: &PointCloud, tree: &PointTree, p: DVec3, found: &mut Vec<Neighbour>) -> DVec3 {
    let mut count = FEWEST;
    loop {
        tree.k_nearest(p, count, found);
        let points = found.iter().map(|n| cloud.positions[n.index as usize] - p);
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
