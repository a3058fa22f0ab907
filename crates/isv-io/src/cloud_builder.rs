//! A point cloud that grows point by point.

use glam::DVec3;
use isv_volume::PointCloud;

/// Collects points and brings their normals to length 1; a normal without a direction becomes zero, "not known".
pub(crate) struct CloudBuilder {
    positions: Vec<DVec3>,
    normals: Option<Vec<DVec3>>,
}

impl CloudBuilder {
    /// Starts a cloud; `room` is a number of points whose bytes are there, so that it bounds the memory taken.
    pub(crate) fn new(with_normals: bool, room: usize) -> Self {
        let reserved = || Vec::with_capacity(room);
        Self { positions: reserved(), normals: with_normals.then(reserved) }
    }

    /// Adds a point; its normal may have any length, and is passed over if the cloud has none.
    pub(crate) fn push(&mut self, position: DVec3, normal: DVec3) {
        self.positions.push(position);
        if let Some(normals) = &mut self.normals {
            normals.push(normal.normalize_or_zero());
        }
    }

    pub(crate) fn finish(self, viewpoint: Option<DVec3>) -> PointCloud {
        PointCloud { positions: self.positions, normals: self.normals.unwrap_or_default(), viewpoint }
    }
}
