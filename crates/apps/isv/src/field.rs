//! Frames that are no meshes: points, depth and colour images, and fields.

use crate::{Error, ErrorKind, Volume};
use glam::{DMat4, DVec2, DVec3};
use isv_io::fill_unobserved;
use isv_volume::{
    BlockCoord, BlockEdge, CODES_PER_VOXEL, CameraPose, DepthImage, Grid, Image, Intrinsics, PointCloud,
    SparseVolume, Truncation, VolumeBuilder, VoxelMask, VoxelSize,
};
use std::collections::HashSet;
use std::fmt::Display;
use std::sync::Arc;

/// Points of a surface, in metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Positions: x, y, z.
    pub positions: Vec<[f32; 3]>,
    /// Normals that point outside, one a point, zero where one is not known; empty if there are none.
    pub normals: Vec<[f32; 3]>,
    /// 8-bit sRGB colours, one a point; empty if there are none.
    pub colours: Vec<[u8; 3]>,
    /// Place that the points were seen from, if it is known. Estimated normals face it.
    pub viewpoint: Option<[f32; 3]>,
}

impl Points {
    pub(crate) fn to_raw(&self) -> PointCloud {
        let wide = |v: &[f32; 3]| DVec3::from(v.map(f64::from));
        PointCloud {
            positions: self.positions.iter().map(wide).collect(),
            normals: self.normals.iter().map(|normal| wide(normal).normalize_or_zero()).collect(),
            colours: self.colours.clone(),
            viewpoint: self.viewpoint.as_ref().map(wide),
            ..PointCloud::default()
        }
    }
}

/// Image of a depth camera at one instant. Lens distortion has been removed.
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
        let Self { width, height, focal, principal, camera_to_world, .. } = *self;
        let (intrinsics, pose) = camera([width, height], focal, principal, &camera_to_world)?;
        DepthImage::new(intrinsics, pose, self.depths_m.clone()).map_err(invalid)
    }
}

/// Image of a colour camera at one instant. Lens distortion has been removed.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourView {
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
    /// 8-bit sRGB of all pixels, row by row from the top.
    pub colours: Vec<[u8; 3]>,
    /// Number of the depth view of the same frame from about the same place, such as that of an RGB-D camera; `None` if there is none.
    pub depth_view: Option<usize>,
}

impl ColourView {
    pub(crate) fn to_raw(&self) -> Result<isv_volume::ColourView, Error> {
        let Self { width, height, focal, principal, camera_to_world, depth_view, .. } = *self;
        let (intrinsics, pose) = camera([width, height], focal, principal, &camera_to_world)?;
        let pixels = u64::from(width) * u64::from(height);
        let image = Image::new(width, height, self.colours.clone()).ok_or_else(|| {
            invalid(format!("a colour view has {} colours for {pixels} pixels", self.colours.len()))
        })?;
        let view = isv_volume::ColourView::new(Arc::new(image), intrinsics, pose);
        Ok(view.expect("the lens has the image's size").with_depth_image(depth_view))
    }
}

/// Lens and place of a camera.
fn camera(
    [width, height]: [u32; 2],
    focal: [f64; 2],
    principal: [f64; 2],
    camera_to_world: &[[f64; 4]; 4],
) -> Result<(Intrinsics, CameraPose), Error> {
    let (focal, principal) = (DVec2::from(focal), DVec2::from(principal));
    let intrinsics = Intrinsics { width, height, focal, principal };
    intrinsics.validate().map_err(invalid)?;
    let matrix = DMat4::from_cols_array_2d(camera_to_world).transpose();
    Ok((intrinsics, CameraPose::from_matrix(matrix).map_err(invalid)?))
}

fn invalid(why: impl Display) -> Error {
    Error::new(ErrorKind::Frame, why)
}

impl Volume {
    /// The volume as the codec has it, its distances as integers.
    pub(crate) fn to_raw(&self) -> Result<SparseVolume, Error> {
        let edge = BlockEdge::from_voxels(self.edge).map_err(invalid)?;
        let voxel_size = VoxelSize::from_metres(self.voxel_m).map_err(invalid)?;
        let truncation = Truncation::from_voxels(self.truncation_voxels).map_err(invalid)?;
        let invalid = |why: String| invalid(format!("a volume {why}"));
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
