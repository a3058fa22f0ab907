//! Point clouds.

use crate::Rgb;
use glam::DVec3;
use std::ops::Range;
use thiserror::Error;

/// A point cloud that cannot be worked with.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum PointsError {
    /// A NaN or infinite coordinate or normal.
    #[error("point {point} is not finite")]
    NotFinite {
        /// Index of the point.
        point: usize,
    },
    /// Normals that are neither absent nor one a point.
    #[error("{normals} normals for {points} points")]
    NormalCount {
        /// How many normals there are.
        normals: usize,
        /// How many points there are.
        points: usize,
    },
    /// Colours that are neither absent nor one a point.
    #[error("{colours} colours for {points} points")]
    ColourCount {
        /// How many colours there are.
        colours: usize,
        /// How many points there are.
        points: usize,
    },
    /// No points at all.
    #[error("no points")]
    NoPoints,
}

/// Points on a surface: positions in metres, with or without normals.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// Positions in metres.
    pub positions: Vec<DVec3>,
    /// Unit normals pointing outside, one a point; empty when the cloud has none. A zero vector says that the normal of
    /// its point is not known.
    pub normals: Vec<DVec3>,
    /// sRGB of each point; empty when the cloud has no colours.
    pub colours: Vec<Rgb>,
    /// Place that the points were seen from, in metres, if the capture tells.
    pub viewpoint: Option<DVec3>,
    /// Places of several scans, where the points were seen from more than one; those of runs of points, in order.
    pub scans: Vec<ScanPlace>,
}

/// Viewpoint of a run of points.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanPlace {
    /// Indices of the points.
    pub points: Range<usize>,
    /// The scanner's place, in metres.
    pub viewpoint: DVec3,
}

impl PointCloud {
    /// Checks what every consumer relies on: at least one point, all finite, normals and colours for all points or
    /// for none.
    ///
    /// # Errors
    /// The first violation found.
    pub fn validate(&self) -> Result<(), PointsError> {
        let (points, normals) = (self.positions.len(), self.normals.len());
        if points == 0 {
            return Err(PointsError::NoPoints);
        }
        if normals != 0 && normals != points {
            return Err(PointsError::NormalCount { normals, points });
        }
        let colours = self.colours.len();
        if colours != 0 && colours != points {
            return Err(PointsError::ColourCount { colours, points });
        }
        let broken = |vectors: &[DVec3]| vectors.iter().position(|v| !v.is_finite());
        match broken(&self.positions).or_else(|| broken(&self.normals)) {
            Some(point) => Err(PointsError::NotFinite { point }),
            None => Ok(()),
        }
    }

    /// Keeps the points whose positions are wanted, with their normals, colours and scans.
    pub fn retain(&mut self, wanted: impl Fn(DVec3) -> bool) {
        let kept: Vec<bool> = self.positions.iter().map(|position| wanted(*position)).collect();
        if !kept.contains(&false) {
            return;
        }
        // Points kept before each one.
        let mut before: Vec<usize> = Vec::with_capacity(kept.len() + 1);
        before.push(0);
        for kept in &kept {
            before.push(before[before.len() - 1] + usize::from(*kept));
        }
        for scan in &mut self.scans {
            let place = |point: usize| before[point.min(kept.len())];
            scan.points = place(scan.points.start)..place(scan.points.end);
        }
        retain_marked(&mut self.positions, &kept);
        retain_marked(&mut self.normals, &kept);
        retain_marked(&mut self.colours, &kept);
    }

    /// Copies the viewpoints alone, without the points.
    #[must_use]
    pub fn without_points(&self) -> Self {
        Self { viewpoint: self.viewpoint, scans: self.scans.clone(), ..Self::default() }
    }

    /// Viewpoint of each point, in their order; `None` if the capture does not give one.
    pub fn viewpoints(&self) -> impl Iterator<Item = Option<DVec3>> + '_ {
        let mut scans = self.scans.iter().peekable();
        (0..self.positions.len()).map(move |point| {
            while scans.next_if(|scan| scan.points.end <= point).is_some() {}
            let scan = scans.peek().filter(|scan| scan.points.contains(&point));
            self.viewpoint.or(scan.map(|scan| scan.viewpoint))
        })
    }

    /// Smallest and largest corner of the bounding box; `None` without points.
    #[must_use]
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let first = *self.positions.first()?;
        Some(self.positions.iter().fold((first, first), |(lo, hi), v| (lo.min(*v), hi.max(*v))))
    }
}

/// Keeps the items whose marks are set. An empty list stays empty.
fn retain_marked<T>(list: &mut Vec<T>, marks: &[bool]) {
    let mut marks = marks.iter();
    list.retain(|_| *marks.next().unwrap_or(&true));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_know_the_place_of_their_scan() {
        let scan = |points, viewpoint| ScanPlace { points, viewpoint };
        let scans = vec![scan(0..2, DVec3::X), scan(2..2, DVec3::Y), scan(3..4, DVec3::Z)];
        let mut cloud = PointCloud { positions: vec![DVec3::ZERO; 5], scans, ..PointCloud::default() };
        let places: Vec<_> = cloud.viewpoints().collect();
        assert_eq!(places, [Some(DVec3::X), Some(DVec3::X), None, Some(DVec3::Z), None]);
        cloud.viewpoint = Some(DVec3::ONE);
        assert!(cloud.viewpoints().all(|place| place == Some(DVec3::ONE)));
    }
}
