//! A point cloud that grows point by point.

use crate::error::Malformation;
use crate::raw_colours::{RawColours, Scale};
use glam::DVec3;
use isv_volume::PointCloud;

/// Most points that a byte of a compressed file may stand for. Without a limit, models that have learnt that nothing
/// changes would give millions of points for a byte; scans take several bytes a point.
const MOST_POINTS_A_BYTE: u64 = 16;

/// Refuses more points than a compressed file of so many bytes may hold.
pub(crate) fn check_compressed(points: u64, bytes: usize) -> Result<(), Malformation> {
    let bytes = bytes as u64;
    let limit = bytes.saturating_mul(MOST_POINTS_A_BYTE);
    if points > limit { Err(Malformation::TooManyPoints { points, bytes, limit }) } else { Ok(()) }
}

/// Collects points and brings their normals to length 1; a normal without a direction becomes zero, "not known".
pub(crate) struct CloudBuilder {
    positions: Vec<DVec3>,
    normals: Option<Vec<DVec3>>,
    colours: Option<RawColours>,
}

impl CloudBuilder {
    /// Starts a cloud; `room` is a number of points whose bytes are there, so that it bounds the memory taken.
    pub(crate) fn new(with_normals: bool, room: usize) -> Self {
        let reserved = || Vec::with_capacity(room);
        Self { positions: reserved(), normals: with_normals.then(reserved), colours: None }
    }

    /// Says that points have colours of a scale, if they have any.
    pub(crate) fn with_colours(self, scale: Option<Scale>) -> Self {
        Self { colours: scale.map(|scale| RawColours::new(scale, 0)), ..self }
    }

    /// Gives the point added last its colour, which is passed over if the cloud has none.
    pub(crate) fn push_colour(&mut self, colour: [f64; 3]) {
        if let Some(colours) = &mut self.colours {
            colours.push(colour);
        }
    }

    /// Adds a point; its normal may have any length, and is passed over if the cloud has none.
    pub(crate) fn push(&mut self, position: DVec3, normal: DVec3) {
        self.positions.push(position);
        if let Some(normals) = &mut self.normals {
            normals.push(normal.normalize_or_zero());
        }
    }

    /// How many points there are.
    pub(crate) fn len(&self) -> usize {
        self.positions.len()
    }

    pub(crate) fn finish(self, viewpoint: Option<DVec3>) -> PointCloud {
        let (positions, normals) = (self.positions, self.normals.unwrap_or_default());
        let colours = self.colours.map(RawColours::finish).unwrap_or_default();
        PointCloud { positions, normals, colours, viewpoint, scans: Vec::new() }
    }
}
