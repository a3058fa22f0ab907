//! Frames that are no meshes or points: depth and colour images, and fields.

use crate::{Error, ErrorKind, Volume, VolumeArrays};
use glam::{DMat4, DVec2};
use isv_io::fill_unobserved;
use isv_volume::{
    BlockCoord, BlockEdge, CODES_PER_VOXEL, CameraPose, DepthImage, Grid, Image, Intrinsics, SparseVolume,
    Truncation, VolumeBuilder, VoxelMask, VoxelSize,
};
use std::collections::HashSet;
use std::fmt::Display;
use std::sync::Arc;

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
    /// Number of the depth view of the same frame from about the same place, such as that of an RGB-D camera.
    /// `None` if there is none.
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
        let blocks = self.blocks.iter().map(|block| (block.coord, &*block.distances_m));
        raw_volume([self.edge, self.truncation_voxels], self.voxel_m, blocks)
    }
}

impl VolumeArrays {
    /// The volume as the codec has it, its distances as integers.
    pub(crate) fn to_raw(&self) -> Result<SparseVolume, Error> {
        let edge = BlockEdge::from_voxels(self.edge).map_err(invalid)?;
        let (found, wanted) = (self.distances_m.len(), self.coords.len().saturating_mul(edge.block_voxels()));
        if found != wanted {
            return Err(invalid(format!("a volume has {found} distances in place of {wanted}")));
        }
        let blocks = self.distances_m.chunks_exact(edge.block_voxels());
        let blocks = self.coords.iter().copied().zip(blocks);
        raw_volume([self.edge, self.truncation_voxels], self.voxel_m, blocks)
    }
}

/// A volume as the codec has it, of the coordinates and distances of its blocks.
fn raw_volume<'a>(
    [edge, truncation_voxels]: [u32; 2],
    voxel_m: f64,
    blocks: impl Iterator<Item = ([i32; 3], &'a [f32])>,
) -> Result<SparseVolume, Error> {
    let edge = BlockEdge::from_voxels(edge).map_err(invalid)?;
    let voxel_size = VoxelSize::from_metres(voxel_m).map_err(invalid)?;
    let truncation = Truncation::from_voxels(truncation_voxels).map_err(invalid)?;
    let invalid = |why: String| invalid(format!("a volume {why}"));
    let grid = Grid { voxel_size, edge, truncation };
    let limit = f64::from(truncation.codes());
    let codes_per_metre = f64::from(CODES_PER_VOXEL) / voxel_size.metres();
    let (mut builder, mut seen) = (VolumeBuilder::new(grid), HashSet::new());
    for (place, distances_m) in blocks {
        let coord = BlockCoord::from(place);
        if !coord.in_range() {
            return Err(invalid(format!("has a block at {place:?}, which is too far away")));
        }
        if !seen.insert(place) {
            return Err(invalid(format!("has two blocks at {place:?}")));
        }
        if distances_m.len() != edge.block_voxels() {
            let (found, wanted) = (distances_m.len(), edge.block_voxels());
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
        let mut samples: Vec<i16> = distances_m.iter().enumerate().map(code).collect();
        fill_unobserved(edge, &mut samples, &unobserved);
        builder.push(coord, samples, (!unobserved.is_empty()).then_some(unobserved));
    }
    Ok(builder.finish())
}
