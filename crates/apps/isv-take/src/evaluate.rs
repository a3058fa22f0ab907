//! Distances and differences of colour between the frames of a capture and of a reference.

use crate::capture::{Capture, CapturedFrame, Content, coloured_surface, matching_ranges};
use crate::encode::{CaptureError, FrameError};
use crate::{Cancellation, FrameRange, MemoryError, MemoryLimit, Prefetch};
use isv_io::Geometry;
use isv_metrics::{
    ColourError, CompareError, CompareOptions, GeometryError, Shape, colour_summary, compare,
    compare_colours, summary,
};
use isv_surface::SurfaceOptions;
use isv_volume::TriangleMesh;
use serde::Serialize;
use std::ops::Range;
use thiserror::Error;

/// The errors of a capture's frames.
///
/// [`Self::frames`] and [`Self::colours`] have an entry for each frame, in the same order.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Evaluation {
    /// Number in the reference of the first frame.
    pub first: usize,
    /// The error of each frame; nothing where both sides are empty, which is neither right nor wrong by any distance.
    pub frames: Vec<Option<GeometryError>>,
    /// The mean over all frames that have an error.
    pub mean: GeometryError,
    /// The error of each frame's colours; without figures where a side has no colours.
    pub colours: Vec<ColourError>,
    /// The mean of each figure of colours over the frames that have it.
    pub mean_colours: ColourError,
}

/// Figures of an [`Evaluation`] as JSON has them: those of the mean, and `frames`. Their names are the keys of `isv eval --json`.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct EvaluationFigures<'a> {
    /// Figures of the mean.
    #[serde(flatten)]
    pub mean: FrameFigures<'a>,
    /// Figures of each frame; `None` where both sides are empty.
    pub frames: Vec<Option<FrameFigures<'a>>>,
}

/// Figures of a frame, or of the mean.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct FrameFigures<'a> {
    /// Errors of geometry.
    #[serde(flatten)]
    pub geometry: &'a GeometryError,
    /// Errors of colour.
    #[serde(flatten)]
    pub colours: &'a ColourError,
}

impl Evaluation {
    /// Returns all figures, to be written as JSON.
    #[must_use]
    pub fn figures(&self) -> EvaluationFigures<'_> {
        let frames = self.frames.iter().zip(&self.colours);
        let frames = frames
            .map(|(geometry, colours)| geometry.as_ref().map(|geometry| FrameFigures { geometry, colours }));
        let mean = FrameFigures { geometry: &self.mean, colours: &self.mean_colours };
        EvaluationFigures { mean, frames: frames.collect() }
    }
}

/// Captures that could not be compared.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EvaluateError {
    /// One of the captures.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// A frame of one of them.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// A surface that there is no memory for.
    #[error("{name}: {cause}")]
    Memory {
        /// Name of the frame.
        name: String,
        /// Cause of the failure.
        cause: MemoryError,
    },
    /// Depth images, which have no surface.
    #[error("{name}: depth images have no surface to measure: isv encode makes one of them")]
    Depth {
        /// Name of the frame.
        name: String,
    },
    /// Frames that cannot be compared.
    #[error("frame {frame} of {test} against {reference}: {cause}")]
    Compare {
        /// Number of the frame in the reference.
        frame: usize,
        /// Name of what is measured.
        test: String,
        /// Name of the reference.
        reference: String,
        /// Cause of the failure.
        cause: CompareError,
    },
    /// Captures in which nothing can be measured.
    #[error("{reference}: no frame has anything to measure")]
    Nothing {
        /// Name of the reference.
        reference: String,
    },
}

/// Measures the frames of a capture against those of a reference; `frames` are those of the reference, or all. Volumes are compared by
/// their zero crossings, all else as it is. `on_frame` is called for each frame.
///
/// # Errors
/// See [`EvaluateError`].
pub fn evaluate(
    reference: Capture,
    test: Capture,
    frames: Option<FrameRange>,
    options: &CompareOptions,
    memory: MemoryLimit,
    cancellation: &Cancellation,
    on_frame: impl FnMut(),
) -> Result<Evaluation, EvaluateError> {
    let ranges = matching_ranges(&reference, &test, frames)?;
    evaluate_ranges([reference, test], ranges, options, memory, cancellation, on_frame)
}

/// Measures frames of a capture against those of a reference, which comes first; both ranges have one length. See [`evaluate`].
///
/// # Errors
/// See [`EvaluateError`].
pub fn evaluate_ranges(
    [reference, test]: [Capture; 2],
    [in_reference, in_test]: [Range<usize>; 2],
    options: &CompareOptions,
    memory: MemoryLimit,
    cancellation: &Cancellation,
    mut on_frame: impl FnMut(),
) -> Result<Evaluation, EvaluateError> {
    assert_eq!(in_reference.len(), in_test.len(), "frames are measured in pairs");
    let names = [&reference, &test].map(|capture| capture.name().to_owned());
    let [reference_name, test_name] = &names;
    let first = in_reference.start;
    let geometries = |capture, range| geometries(capture, range, memory, cancellation);
    let pairs = geometries(reference, in_reference)?.zip(geometries(test, in_test)?);
    let (mut frames, mut colours) = (Vec::new(), Vec::new());
    for (reference, test) in pairs {
        let (reference, test) = (reference?, test?);
        let (error, colour) = match measure(shape(&reference), shape(&test), options) {
            Ok((error, colour)) => (Some(error), colour),
            Err(CompareError::BothEmpty) => (None, ColourError::default()),
            Err(cause) => {
                let frame = first + frames.len();
                let (test, reference) = (test_name.clone(), reference_name.clone());
                return Err(EvaluateError::Compare { frame, test, reference, cause });
            }
        };
        frames.push(error);
        colours.push(colour);
        on_frame();
    }
    let measured: Vec<GeometryError> = frames.iter().copied().flatten().collect();
    match summary(&measured) {
        Some(mean) => {
            let mean_colours = colour_summary(&colours);
            Ok(Evaluation { first, frames, mean, colours, mean_colours })
        }
        None => Err(EvaluateError::Nothing { reference: reference_name.clone() }),
    }
}

/// The errors of a frame's geometry and of its colours.
fn measure(
    reference: Shape,
    test: Shape,
    options: &CompareOptions,
) -> Result<(GeometryError, ColourError), CompareError> {
    Ok((compare(reference, test, options)?, compare_colours(reference, test, options)?))
}

/// The frames of a capture as they are measured, read and decoded ahead of their use.
fn geometries(
    capture: Capture,
    range: Range<usize>,
    memory: MemoryLimit,
    cancellation: &Cancellation,
) -> Result<Prefetch<Result<Geometry, EvaluateError>>, EvaluateError> {
    let geometry = move |frame: CapturedFrame| match frame.content {
        // A file of points without points is a frame without surface, whatever the other side holds.
        Content::Geometry(geometry) if geometry.is_empty() => Ok(Geometry::Mesh(TriangleMesh::default())),
        Content::Geometry(geometry) => Ok(geometry),
        Content::Volume(volume) | Content::Decoded(volume) => {
            let options = SurfaceOptions { normals: false };
            let surface = coloured_surface(&volume, frame.colour.as_deref(), options, memory);
            let surface = surface.map_err(|cause| EvaluateError::Memory { name: frame.name, cause })?;
            Ok(Geometry::Mesh(surface))
        }
        Content::Depth(_) => Err(EvaluateError::Depth { name: frame.name }),
    };
    let geometries = capture.read(range)?.map(move |frame| geometry(frame?));
    Ok(Prefetch::new(geometries, cancellation))
}

fn shape(geometry: &Geometry) -> Shape<'_> {
    match geometry {
        Geometry::Mesh(mesh) => mesh.into(),
        Geometry::Points(points) => points.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_stand_beside_distances_in_json() {
        let mean = GeometryError { chamfer_mm: 2.5, ..GeometryError::default() };
        let mean_colours = ColourError { colour_y_psnr_db: Some(38.25), ..ColourError::default() };
        let (frames, colours) = (vec![None, Some(mean)], vec![ColourError::default(), mean_colours]);
        let evaluation = Evaluation { first: 0, frames, mean, colours, mean_colours };
        let json = serde_json::to_value(evaluation.figures()).unwrap();
        assert!(json["frames"][0].is_null());
        for figures in [&json, &json["frames"][1]] {
            assert_eq!((&figures["chamfer_mm"], &figures["colour_y_psnr_db"]), (&2.5.into(), &38.25.into()));
            for key in ["colour_ycc_psnr_db", "render_y_psnr_db", "render_ssim"] {
                assert!(figures.as_object().unwrap()[key].is_null(), "{key}");
            }
        }
    }
}
