//! The voxel size of points and depth images where nobody gives one: what their spacing and noise allow.

use super::{EncodeError, EncodeEvent, EncodeOptions};
use crate::capture::{Capture, CapturedFrame, Content, default_voxel_size};
use crate::{Event, Input, Length, Observer};
use isv_fusion::{DepthResolution, sample_readings};
use isv_ingest::{IngestError, PointIngest, PointSpacing, check_points_fit};
use isv_io::Geometry;
use isv_volume::{Grid, PointCloud, VoxelSize};
use std::ops::Range;
use std::sync::Arc;

/// Mantissas of round lengths.
const ROUND: [f64; 10] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
/// Spacings up to this much above a round length are rounded down to it.
const ABOUT: f64 = 1.02;
/// Deviations of depth noise in a voxel: with fewer, noise is coded as surface.
const NOISE_DEVIATIONS: f64 = 2.0;
/// Readings by which blocks are counted.
const COUNTED_READINGS: usize = 200_000;

/// What a frame needs of a voxel.
#[derive(Clone, Debug)]
pub(super) struct Need {
    voxel_m: f64,
    /// What that follows from, behind "as".
    why: String,
}

/// The need of the frames of a range, by the first, the middle and the last one; `None` of meshes and volumes. Frames that cannot be
/// read have no say: encoding reports them.
pub(super) fn of_frames(
    input: &Input,
    options: &EncodeOptions,
    range: &Range<usize>,
    grid: Grid,
    observer: &Arc<dyn Observer>,
) -> Result<Option<Need>, EncodeError> {
    let mut numbers = vec![range.start, range.start + range.len() / 2, range.end.saturating_sub(1)];
    numbers.retain(|number| range.contains(number));
    numbers.dedup();
    let mut needs = Vec::new();
    for number in numbers {
        let capture = Capture::open(input, &options.hints(observer)?)?;
        for frame in capture.read(number..number + 1)?.flatten() {
            match of_frame(options, &frame, grid) {
                Some(need) => needs.push(need),
                None if is_of_faces(&frame.content) => return Ok(None),
                None => {}
            }
        }
    }
    needs.sort_by(|a, b| a.voxel_m.total_cmp(&b.voxel_m));
    let middle = needs.len() / 2;
    Ok((!needs.is_empty()).then(|| needs.swap_remove(middle)))
}

/// Whether a frame shows that the capture is one of meshes or volumes.
fn is_of_faces(content: &Content) -> bool {
    match content {
        Content::Geometry(Geometry::Mesh(mesh)) => !mesh.triangles.is_empty(),
        Content::Geometry(Geometry::Points(_)) | Content::Depth(_) => false,
        Content::Volume(_) | Content::Decoded(_) => true,
    }
}

/// The need of one frame; `None` of a mesh, of a volume and where nothing was captured.
pub(super) fn of_frame(options: &EncodeOptions, frame: &CapturedFrame, grid: Grid) -> Option<Need> {
    let settings = |voxel_size| options.fields.point_ingest(Grid { voxel_size, ..grid });
    match &frame.content {
        Content::Geometry(Geometry::Points(cloud)) if !cloud.positions.is_empty() => {
            let spacing = PointSpacing::from_cloud(cloud);
            let why = format!("points are {} apart", millimetres(spacing.median_m));
            Some(with_room(cloud, spacing.voxel_m(), why, settings))
        }
        Content::Depth(images) => {
            let max_depth_m = options.fields.max_depth_m();
            let DepthResolution { footprint_m, noise_m } = DepthResolution::from_images(images, max_depth_m)?;
            let why = format!(
                "a pixel covers {} and depths are noisy by {}",
                millimetres(footprint_m),
                millimetres(noise_m)
            );
            let positions = sample_readings(images, max_depth_m, COUNTED_READINGS);
            let cloud = PointCloud { positions, ..PointCloud::default() };
            Some(with_room(&cloud, footprint_m.max(NOISE_DEVIATIONS * noise_m), why, settings))
        }
        Content::Geometry(_) | Content::Volume(_) | Content::Decoded(_) => None,
    }
}

/// A round voxel size from a wanted one on, never below the default, that the blocks of a cloud have room at.
fn with_room(
    cloud: &PointCloud,
    wanted_m: f64,
    why: String,
    settings: impl Fn(VoxelSize) -> PointIngest,
) -> Need {
    let least_m = default_voxel_size().metres();
    let voxel_m = round_up(wanted_m.max(least_m));
    let Ok(size) = VoxelSize::from_metres(voxel_m) else { return Need { voxel_m: least_m, why } };
    match check_points_fit(cloud, &settings(size)) {
        Err(IngestError::Fit(error)) => {
            let voxel_m = round_up(error.voxel_that_fits_m());
            Need { voxel_m, why: format!("{why} and smaller ones need more blocks than --max-blocks") }
        }
        _ => Need { voxel_m, why },
    }
}

/// Tells what was chosen, and why.
pub(super) fn announce(need: Need, observer: &dyn Observer) -> VoxelSize {
    let voxel = VoxelSize::from_metres(need.voxel_m).unwrap_or(default_voxel_size());
    let length = Length::from_metres(voxel.metres());
    observer.event(&Event::Encode(EncodeEvent::VoxelFits { voxel: length, why: need.why }));
    voxel
}

/// The next round length from one on.
fn round_up(metres: f64) -> f64 {
    let decade = 10f64.powi(metres.log10().floor() as i32);
    let mantissa = ROUND.into_iter().find(|round| metres <= round * decade * ABOUT);
    // Digits of whole nanometres, not of the product.
    (mantissa.unwrap_or(10.0) * decade * 1e9).round() / 1e9
}

/// A length to two digits.
fn millimetres(metres: f64) -> String {
    let mm = 1e3 * metres;
    if mm >= 10.0 { format!("{mm:.0} mm") } else { format!("{mm:.1} mm") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_rounded_up_to_round_ones() {
        let pairs = [(0.0845, 0.1), (0.005, 0.005), (0.00505, 0.005), (0.0052, 0.006), (0.011, 0.015)];
        for (metres, round) in
            pairs.into_iter().chain([(0.0099, 0.01), (1.0, 1.0), (0.999, 1.0), (230.0, 250.0)])
        {
            assert_eq!(round_up(metres), round, "{metres}");
        }
    }
}
