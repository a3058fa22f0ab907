//! Pictures of frames: contact sheets, in their colours or by distance to a reference.

use crate::errors;
use crate::jobs::{check_not_a_source, frame_rate};
use isv::raw::io::{Colours, Output};
use isv::raw::take::capture::{Capture, Hints};
use isv::raw::take::{FrameRange, Input, MemoryLimit, Observer};
use isv::raw::volume::TriangleMesh;
use isv::{Unit, Up};
use isv_render::{
    Camera, ErrorScale, Extent, NormalKind, PictureFile, PictureFormat, PictureRate, RenderSetup, Shading,
    Style,
};
use isv_spatial::Bvh;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Frames are drawn without an animation, whose rate this would be.
const NO_RATE: PictureRate = PictureRate { pictures: 1, seconds: 1 };

/// A reference: its path, unit, origin (in that unit), axis that points up, first frame, animation, and frames a second at which that is
/// sampled. The first frame is the number of its frame that belongs to frame 0 of the input.
type Reference = (PathBuf, String, Option<[f64; 3]>, String, usize, Option<String>, f64);

/// Draws frames of a stream, or of a capture in metres, into one PNG file. `range_m`: distance at which the colours of errors end (m).
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "each of them is one of the function in Python")]
pub(crate) fn draw(
    py: Python<'_>,
    input: PathBuf,
    output: PathBuf,
    frames: Vec<usize>,
    size: usize,
    columns: Option<usize>,
    against: Option<Reference>,
    range_m: f64,
) -> PyResult<()> {
    if frames.is_empty()
        || !(16..=4096).contains(&size)
        || frames.len() * size * size > 1 << 28
        || columns == Some(0)
    {
        return Err(PyValueError::new_err(
            "frames and size: at least a frame, 16 to 4096 pixels, 2**28 pixels in all",
        ));
    }
    let scale = against.as_ref().map(|_| ErrorScale::new(range_m));
    if scale.as_ref().is_some_and(Option::is_none) {
        return Err(PyValueError::new_err(format!("error_range is {range_m}: a length is above 0 (metres)")));
    }
    let observer: Arc<dyn Observer> = Arc::new(|_: &isv::raw::take::Event| {});
    let usual =
        Hints { colours: Colours::Keep, ..Hints::in_unit(Unit::Metre, MemoryLimit::default(), observer) };
    let reference = against.map(|(path, unit, origin, up, first, animation, fps)| {
        let unit: Unit = unit.parse().map_err(|why| PyValueError::new_err(format!("units: {why}")))?;
        let up = Up::ALL.into_iter().find(|axis| axis.name() == up);
        let up =
            up.ok_or_else(|| PyValueError::new_err("up is \"y\", \"z\", \"x\", \"-y\", \"-z\" or \"-x\""))?;
        let (colours, frame_rate) = (Colours::Drop, frame_rate(fps)?);
        let hints = Hints { unit, up, colours, animation, frame_rate, ..usual.clone() }.with_origin(origin);
        Ok::<_, PyErr>((path, hints, first))
    });
    let reference = reference.transpose()?;
    check_not_a_source(py, &input, &output)?;
    let drawn = py.detach(|| -> Result<(), String> {
        let words = |error: &dyn std::fmt::Display| error.to_string();
        let mut scenes = Vec::new();
        for number in &frames {
            let mesh = mesh_of(&input, &usual, *number)?;
            let behind = match &reference {
                Some((path, hints, first)) => Some(Bvh::new(&mesh_of(path, hints, first + number)?)),
                None => None,
            };
            scenes.push((*number, mesh, behind));
        }
        let extent = scenes.iter().map(|(_, mesh, _)| Extent::new(mesh)).fold(None, Extent::join);
        let extent = extent.ok_or_else(|| format!("{}: no surface to draw", input.display()))?;
        let view = extent.opening_view();
        let has_colours = scenes.iter().any(|(_, mesh, _)| mesh.appearance.is_some());
        let shading = if has_colours { Shading::Colour } else { Shading::Normals };
        let camera = Camera::fitting(extent.bounds, [size, size]);
        let setup = RenderSetup {
            camera: camera.from_direction(view.yaw_degrees, view.pitch_degrees),
            style: Style { shading, normals: NormalKind::Smooth, ..Style::default() },
            scale: scale.flatten(),
            captions: true,
        };
        let mut file = Output::create(&output).map_err(|error| words(&error))?;
        let mut picture =
            PictureFile::new(PictureFormat::Png, &mut file, setup.size(), scenes.len(), NO_RATE)
                .map_err(|e| words(&e))?;
        for (number, mesh, behind) in &scenes {
            let distance = behind.as_ref().map(|behind| |point| behind.distance(point));
            picture
                .push(setup.draw(mesh, distance, *number, view.yaw_degrees).0)
                .map_err(|error| words(&error))?;
        }
        picture.finish(|pictures| setup.still(pictures, columns)).map_err(|error| words(&error))?;
        file.commit().map_err(|error| words(&error)).map(drop)
    });
    drawn.map_err(|why| errors::with_kind(py, "input", why))
}

/// Reads the surface of a frame.
fn mesh_of(path: &Path, hints: &Hints, number: usize) -> Result<TriangleMesh, String> {
    let capture = Capture::open(&Input::from(path), hints).map_err(|error| error.to_string())?;
    let frames = FrameRange { start: number, end: number + 1 };
    let range = capture.range(Some(frames)).map_err(|error| error.to_string())?;
    let mut meshes = capture.meshes(range).map_err(|error| error.to_string())?;
    let mesh = meshes.next().ok_or_else(|| format!("{}: frame {number} is not there", path.display()))?;
    mesh.map_err(|error| error.to_string())
}
