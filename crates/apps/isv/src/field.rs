//! Frames that are no meshes: points, depth images and fields.

use crate::{Error, ErrorKind, Volume};
use glam::{DMat4, DVec2, DVec3};
use isv_io::fill_unobserved;
use isv_volume::{
    BlockCoord, BlockEdge, CODES_PER_VOXEL, CameraPose, DepthImage, Grid, Intrinsics, PointCloud,
    SparseVolume, Truncation, VolumeBuilder, VoxelMask, VoxelSize,
};
use std::collections::HashSet;

/// Points of a surface, in metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Positions: x, y, z.
    pub positions: Vec<[f32; 3]>,
    /// Normals that point outside, one a point, zero where one is not known; empty if there are none.
    pub normals: Vec<[f32; 3]>,
    /// Place that the points were seen from, if it is known. Estimated normals face it.
    pub viewpoint: Option<[f32; 3]>,
}

impl Points {
    pub(crate) fn to_raw(&self) -> PointCloud {
        let wide = |v: &[f32; 3]| DVec3::from(v.map(f64::from));
        PointCloud {
            positions: self.positions.iter().map(wide).collect(),
            normals: self.normals.iter().map(|normal| wide(normal).normalize_or_zero()).collect(),
            viewpoint: self.viewpoint.as_ref().map(wide),
            ..PointCloud::default()
        }
    }
}

/// What a depth camera saw at one instant. Lens distortion has been removed.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthView {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal lengths along x and y (pixels).
    pub focal: [f64; 2],
    /// Column and row of the principal point (pixels).
    pub principal: [f64; 2],
    /// Transform from the camera to the world (m), row by row. The camera looks along +z, its x points right and its y down.
    pub camera_to_world: [[f64; 4]; 4],
    /// Depths along z (m), row by row; 0 or NaN where there is no reading.
    pub depths_m: Vec<f32>,
}

impl DepthView {
    pub(crate) fn to_raw(&self) -> Result<DepthImage, Error> {
        let invalid = |error| Error::new(ErrorKind::Frame, error);
        let intrinsics = Intrinsics {
            width: self.width,
            height: self.height,
            focal: DVec2::from(self.focal),
            principal: DVec2::from(self.principal),
        };
        let matrix = DMat4::from_cols_array_2d(&self.camera_to_world).transpose();
        let pose = CameraPose::from_matrix(matrix).map_err(invalid)?;
        DepthImage::new(intrinsics, pose, self.depths_m.clone()).map_err(invalid)
    }
}

impl Volume {
    /// The volume as the codec has it, its distances as integers.
    pub(crate) fn to_raw(&self) -> Result<SparseVolume, Error> {
        let invalid = |why: String| Error::new(ErrorKind::Frame, format!("a volume {why}"));
        let out_of_range = |error: isv_volume::GridError| Error::new(ErrorKind::Frame, error);
        let edge = BlockEdge::from_voxels(self.edge).map_err(out_of_range)?;
        let voxel_size = VoxelSize::from_metres(self.voxel_m).map_err(out_of_range)?;
        let truncation = Truncation::from_voxels(self.truncation_voxels).map_err(out_of_range)?;
        let grid = Grid { voxel_size, edge, truncation };
        let limit = f64::from(truncation.codes());
        let codes_per_metre = f64::from(CODES_PER_VOXEL) / voxel_size.metres();
        let (mut builder, mut seen) = (VolumeBuilder::new(grid), HashSet::new());
        for block in &self.blocks {
            let coord = BlockCoord::from(block.coord);
            if !coord.in_range() {
                return Err(invalid(format!("has a block at {:?}, which is too far away", block.coord)));
            }
            if !seen.insert(block.coord) {
                return Err(invalid(format!("has two blocks at {:?}", block.coord)));
            }
            if block.distances_m.len() != edge.block_voxels() {
                let (found, wanted) = (block.distances_m.len(), edge.block_voxels());
                return Err(invalid(format!("has a block of {found} distances in place of {wanted}")));
            }
            let mut unobserved = VoxelMask::empty(edge);
            let code = |(voxel, distance): (usize, &f32)| {
                if distance.is_nan() {
                    unobserved.insert(voxel);
                    return truncation.codes();
                }
                (f64::from(*distance) * codes_per_metre).round().clamp(-limit, limit) as i16
            };
            let mut samples: Vec<i16> = block.distances_m.iter().enumerate().map(code).collect();
            fill_unobserved(edge, &mut samples, &unobserved);
            builder.push(coord, samples, (!unobserved.is_empty()).then_some(unobserved));
        }
        Ok(builder.finish())
    }
}
