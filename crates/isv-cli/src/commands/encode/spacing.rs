//! A voxel size that fits what is captured: points and depth images know how far apart their samples are.

use super::Args;
use crate::capture::{Capture, Content, ContentKind};
use crate::length::Length;
use crate::output::say;
use crate::stream;
use anyhow::Result;
use isv::ingest::{SignMode, decide_point_sign};
use isv::io::Geometry;
use isv::volume::{DepthImage, PointCloud, VoxelSize};

/// Edge of a voxel that no capture gets less than unless asked: what suits a person.
const FINEST_M: f64 = 0.005;

/// Voxels to the spacing of points: the typical one, and the one that a tenth exceeds. Points up to 3 voxels apart are a surface.
const TYPICAL: f64 = 1.6;
const WIDE: f64 = 2.5;

/// Voxels to the width that a pixel of a depth image sees, three quarters of them less.
const PIXEL: f64 = 0.5;

/// Frames that are looked at until one has samples.
const LOOKED_AT: usize = 8;

/// The voxel size that fits the samples of a capture, said on stderr; `None` for meshes, volumes and pipes, and where no frame can be read.
pub(super) fn fitting_voxel(args: &Args) -> Result<Option<VoxelSize>> {
    let open = || Capture::open(&args.input, &args.hints()?);
    let capture = open()?;
    let is_sampled = matches!(capture.content(), ContentKind::Geometry | ContentKind::Depth);
    if !is_sampled || capture.frames().is_none() {
        return Ok(None);
    }
    let range = capture.range(args.frames)?;
    let first = range.start..range.end.min(range.start + LOOKED_AT);
    // A frame that cannot be read is told of later, when it is its turn.
    for frame in capture.read(first)?.flatten() {
        let (spacing_m, what) = match frame.content {
            Content::Geometry(Geometry::Points(cloud)) if !cloud.positions.is_empty() => {
                (points(&cloud), "points")
            }
            Content::Geometry(geometry) if geometry.is_empty() => continue,
            Content::Depth(images) => (pixels(&images), "pixels"),
            _ => return Ok(None),
        };
        let Some(Spacing { spacing_m, voxel_m }) = spacing_m else { continue };
        let voxel_m = rounded_up(voxel_m.max(FINEST_M));
        let name = stream::name(&args.input);
        let [voxel, spacing] = [voxel_m, (spacing_m * 1e4).round() / 1e4].map(Length::from_metres);
        say(format_args!("{name}: voxels of {voxel}, as {what} are {spacing} apart; --voxel overrules it"));
        return Ok(Some(VoxelSize::from_metres(voxel_m)?));
    }
    Ok(None)
}

struct Spacing {
    /// How far apart samples typically are.
    spacing_m: f64,
    /// The edge of a voxel that connects them.
    voxel_m: f64,
}

fn points(cloud: &PointCloud) -> Option<Spacing> {
    let evidence = decide_point_sign(cloud, SignMode::Auto).1;
    let (spacing_m, wide_m) = (evidence.spacing_m, evidence.wide_spacing_m);
    (spacing_m > 0.0).then_some(Spacing { spacing_m, voxel_m: (spacing_m / TYPICAL).max(wide_m / WIDE) })
}

/// What pixels see at the depth that three quarters of them are nearer than.
fn pixels(images: &[DepthImage]) -> Option<Spacing> {
    let mut widths: Vec<f64> = Vec::new();
    for image in images {
        let focal = image.intrinsics().focal.min_element();
        let readings = image.depths_m().iter().step_by(7).filter(|depth| **depth > 0.0);
        widths.extend(readings.map(|depth| f64::from(*depth) / focal));
    }
    widths.sort_by(f64::total_cmp);
    let spacing_m = *widths.get(widths.len() * 3 / 4)?;
    Some(Spacing { spacing_m, voxel_m: spacing_m / PIXEL })
}

/// The next length that people would choose: one of a few steps a decade.
fn rounded_up(metres: f64) -> f64 {
    const STEPS: [f64; 11] = [1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
    let decade = 10f64.powf(metres.log10().floor());
    let step = STEPS.into_iter().find(|step| step * decade >= metres * (1.0 - 1e-9)).unwrap_or(10.0);
    // Whole nanometres, as streams have them.
    (step * decade * 1e9).round() / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_rounded_up_to_what_people_choose() {
        for (metres, rounded) in
            [(0.005, 0.005), (0.0051, 0.006), (0.0999, 0.1), (0.1, 0.1), (0.101, 0.12), (8.5, 10.0)]
        {
            assert_eq!(rounded_up(metres), rounded, "{metres}");
        }
    }
}
