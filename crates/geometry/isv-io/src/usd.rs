//! Universal Scene Description (USD): a mesh over time, as text (`.usda`) or binary (`.usdc`).

mod binary;
mod crate_file;
mod integers;
mod layer;
mod text;

use crate::{AtomicFile, WriteError};
use binary::BinaryFile;
use glam::DVec3;
use isv_volume::{TriangleMesh, linear_from_srgb};
use layer::{Array, Frame, Layer, TRACKS};
use std::io;
use std::path::{Path, PathBuf};
use text::TextFile;

/// What a USD file says of all its frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UsdStage {
    /// Time codes a second. Frames at this rate have whole time codes.
    pub frames_per_second: f64,
    /// Unit of coordinates in metres: `metersPerUnit`.
    pub metres_per_unit: f64,
    /// Whether Z points up, not Y: `upAxis`. USD has no other axes.
    pub z_up: bool,
    /// Translation of all frames, in double precision.
    pub translation: DVec3,
}

impl UsdStage {
    /// The time code of a time in seconds. Times are sums of nanoseconds: what is nearly a whole time code is one.
    fn time_code(&self, seconds: f64) -> f64 {
        (seconds * self.frames_per_second * 1e6).round() / 1e6
    }
}

/// Encoding of a USD file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UsdEncoding {
    /// Text, as in `.usda` files.
    Text,
    /// Binary ("crate"), as in `.usdc` files, in version 0.8.0 of that format.
    Binary,
}

/// Writes meshes, whose triangles may differ from frame to frame, as one USD file that plays them.
///
/// A prim of type `Mesh` has one time sample a frame. It holds points, faces, normals, extent and, as linear light, `displayColor`. A single
/// frame has default values and no time samples. The mesh is no subdivision surface, and it is seen from both sides. Materials and
/// textures are not written.
///
/// Frames go to the disk as they come: a binary file grows, and text waits in temporary files beside the final one. The file appears whole
/// or not at all.
#[derive(Debug)]
pub struct UsdWriter {
    path: PathBuf,
    output: Encoded,
    stage: UsdStage,
    time_codes: Vec<f64>,
    /// Attributes that have values in some frame.
    is_filled: [bool; TRACKS],
}

#[derive(Debug)]
enum Encoded {
    Text(Box<TextFile<AtomicFile>>),
    Binary(Box<BinaryFile<AtomicFile>>),
}

impl UsdWriter {
    /// Starts a file to be known as `path`.
    ///
    /// # Errors
    /// [`WriteError`] as [`AtomicFile::create`]; also if a binary file is to go to a pipe.
    pub fn create(path: &Path, stage: UsdStage, encoding: UsdEncoding) -> Result<Self, WriteError> {
        let file = AtomicFile::create(path)?;
        let output = match encoding {
            UsdEncoding::Text => Encoded::Text(Box::new(TextFile::new(file, path))),
            UsdEncoding::Binary => {
                let binary = BinaryFile::new(file).map_err(|cause| WriteError::new(path, cause))?;
                Encoded::Binary(Box::new(binary))
            }
        };
        let (time_codes, is_filled) = (Vec::new(), [false; TRACKS]);
        Ok(Self { path: path.to_owned(), output, stage, time_codes, is_filled })
    }

    /// Appends a frame that is shown from `start_s` on, in seconds. Coordinates are rounded to `f32`.
    ///
    /// # Errors
    /// [`WriteError`] if the disk is full, a time does not follow the last one, a coordinate is not finite, or an index does not fit.
    pub fn push(&mut self, start_s: f64, mesh: &TriangleMesh) -> Result<(), WriteError> {
        let pushed = self.append(start_s, mesh);
        pushed.map_err(|cause| WriteError::new(&self.path, cause))
    }

    fn append(&mut self, start_s: f64, mesh: &TriangleMesh) -> io::Result<()> {
        let time_code = self.stage.time_code(start_s);
        let follows = self.time_codes.last().is_none_or(|last| *last < time_code);
        if !time_code.is_finite() || !follows {
            return Err(invalid(format!("{start_s} s is no time of a frame")));
        }
        let frame = frame(mesh)?;
        for (is_filled, array) in self.is_filled.iter_mut().zip(&frame) {
            *is_filled |= !array.is_empty();
        }
        match &mut self.output {
            Encoded::Text(file) => file.push(&frame)?,
            Encoded::Binary(file) => file.push(frame)?,
        }
        self.time_codes.push(time_code);
        Ok(())
    }

    /// Completes the file, in which the last frame is shown until `end_s`, in seconds, and gives it its name.
    ///
    /// # Errors
    /// [`WriteError`]; also if there are no frames.
    pub fn finish(self, end_s: f64) -> Result<(), WriteError> {
        let Self { path, output, stage, time_codes, is_filled } = self;
        let Some(last) = time_codes.last() else {
            return Err(WriteError::new(&path, invalid("a sequence needs at least one frame".to_owned())));
        };
        // A frame is shown until the next one; the last code is the last instant at which something is new.
        let end = last.max(stage.time_code(end_s).ceil() - 1.0);
        let layer = Layer::new(&stage, &time_codes, end, is_filled);
        let written = match output {
            Encoded::Text(file) => file.finish(&layer, &time_codes),
            Encoded::Binary(file) => file.finish(&layer, &time_codes),
        };
        written.map_err(|cause| WriteError::new(&path, cause))?.commit()
    }
}

fn invalid(message: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, message)
}

/// Turns a mesh into the arrays of a frame.
fn frame(mesh: &TriangleMesh) -> io::Result<Frame> {
    let points = vectors(&mesh.vertices, "a vertex")?;
    let normals = vectors(&mesh.normals, "a normal")?;
    let index = |vertex: &u32| i32::try_from(*vertex).map_err(|_| invalid("too many vertices".to_owned()));
    let indices = mesh.triangles.as_flattened().iter().map(index).collect::<io::Result<_>>()?;
    let light = |value: u8| linear_from_srgb(f32::from(value) / 255.0);
    let colours = mesh.appearance.as_ref().map_or(&[][..], |appearance| &appearance.vertex_colours);
    Ok([
        Array::Vectors(extent(&points)),
        Array::Integers(vec![3; mesh.triangles.len()]),
        Array::Integers(indices),
        Array::Vectors(points),
        Array::Vectors(normals),
        Array::Vectors(colours.iter().map(|colour| colour.map(light)).collect()),
    ])
}

/// Rounds vectors to single precision.
fn vectors(vectors: &[DVec3], what: &str) -> io::Result<Vec<[f32; 3]>> {
    // Text may lose the sign of a zero, so there is none.
    let rounded = |vector: &DVec3| vector.as_vec3().to_array().map(|value| value + 0.0);
    let rounded: Vec<[f32; 3]> = vectors.iter().map(rounded).collect();
    match rounded.as_flattened().iter().all(|value| value.is_finite()) {
        true => Ok(rounded),
        false => Err(invalid(format!("{what} is not finite"))),
    }
}

/// Least and greatest coordinates. An extent has two points, also where there is nothing.
fn extent(points: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let first = points.first().copied().unwrap_or_default();
    let (mut least, mut most) = (first, first);
    for point in points {
        for axis in 0..3 {
            least[axis] = least[axis].min(point[axis]);
            most[axis] = most[axis].max(point[axis]);
        }
    }
    vec![least, most]
}
