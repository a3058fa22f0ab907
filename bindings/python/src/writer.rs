//! Frames to streams.

use crate::exclusive::Exclusive;
use crate::files::{PySink, Raised};
use crate::options::{Options, Placement};
use crate::{arrays, jobs, threads};
use isv::{ColourView, DepthView, Mesh, Points, VolumeArrays};
use numpy::{PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArray4, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::io;
use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

/// Lens and place of a camera: focal lengths, principal point (pixels), transform to the world (m).
type Camera = ([f64; 2], [f64; 2], [[f64; 4]; 4]);
/// A depth image (m) and its camera.
type PyDepth<'py> = (PyReadonlyArray2<'py, f32>, Camera);
/// A colour image, its camera, and the number of the depth image from about the same place.
type PyColour<'py> = (PyReadonlyArray3<'py, u8>, Camera, Option<usize>);
/// Meshes and points come in either precision.
#[derive(FromPyObject)]
enum Places<'py> {
    Single(PyReadonlyArray2<'py, f32>),
    Double(PyReadonlyArray2<'py, f64>),
}

/// A stream that is written.
#[pyclass(frozen, module = "isv._isv")]
pub(crate) struct Writer {
    writer: Exclusive<Option<Target>>,
    placement: Option<Placement>,
    raised: Raised,
    events: jobs::Events,
}

/// Output of a stream.
enum Target {
    File(isv::Writer),
    Sink(isv::Writer<PySink>),
}

/// Calls a method of the writer of either target.
macro_rules! each_target {
    ($target:expr, $writer:ident => $call:expr) => {
        match $target {
            Target::File($writer) => $call,
            Target::Sink($writer) => $call,
        }
    };
}

#[pymethods]
impl Writer {
    #[new]
    fn new(py: Python<'_>, output: &Bound<'_, PyAny>, options: &Bound<'_, PyDict>) -> PyResult<Self> {
        let (raised, events) = (Raised::default(), jobs::Events::default());
        let Options { encode, placement } = Options::read(options)?;
        let options = encode.on_event(events.handler());
        let target = match output.extract::<PathBuf>() {
            Ok(path) => {
                options.check().map_err(|error| raised.or(py, error))?;
                jobs::check_output(py, &[], &path)?;
                py.detach(|| isv::Writer::create(path, &options)).map(Target::File)
            }
            Err(_) => {
                let sink = PySink::new(output, &raised)?;
                py.detach(|| isv::Writer::new(sink, &options)).map(Target::Sink)
            }
        };
        let target = target.map_err(|error| raised.or(py, error))?;
        Ok(Self { writer: Exclusive::new(Some(target)), placement, raised, events })
    }

    fn push_mesh(
        &self,
        py: Python<'_>,
        vertices: Places<'_>,
        faces: PyReadonlyArray2<'_, u32>,
        colors: Option<PyReadonlyArray2<'_, u8>>,
        time_ns: Option<u64>,
    ) -> PyResult<()> {
        let positions = self.places("vertices", &vertices)?;
        let triangles = arrays::to_rows("faces", &faces)?;
        let colours = colours(colors.as_ref())?;
        let mesh = Mesh { positions, triangles, colours, normals: Vec::new() };
        self.with(py, |target| {
            each_target!(target, writer => match time(time_ns) {
                Some(time) => writer.push_mesh_at(&mesh, time),
                None => writer.push_mesh(&mesh),
            })
        })
    }

    fn push_points(
        &self,
        py: Python<'_>,
        positions: Places<'_>,
        normals: Option<PyReadonlyArray2<'_, f32>>,
        colors: Option<PyReadonlyArray2<'_, u8>>,
        viewpoint: Option<[f64; 3]>,
        time_ns: Option<u64>,
    ) -> PyResult<()> {
        let positions = self.places("positions", &positions)?;
        let mut normals = normals.map_or(Ok(Vec::new()), |normals| arrays::to_rows("normals", &normals))?;
        let place = |place: [f64; 3]| match &self.placement {
            Some(placement) => placement.point(place),
            None => place.map(|coordinate| coordinate as f32),
        };
        if let Some(placement) = &self.placement {
            normals.iter_mut().for_each(|normal| *normal = placement.direction(normal.map(f64::from)));
        }
        let colours = colours(colors.as_ref())?;
        let points = Points { positions, normals, colours, viewpoint: viewpoint.map(place) };
        self.with(py, |target| {
            each_target!(target, writer => match time(time_ns) {
                Some(time) => writer.push_points_at(&points, time),
                None => writer.push_points(&points),
            })
        })
    }

    fn push_depth(
        &self,
        py: Python<'_>,
        depths: Vec<PyDepth<'_>>,
        colors: Vec<PyColour<'_>>,
        time_ns: Option<u64>,
    ) -> PyResult<()> {
        self.refuse_placement("depth images")?;
        let depths: Vec<_> = depths.iter().map(depth_view).collect::<PyResult<_>>()?;
        let colours: Vec<_> = colors.iter().map(colour_view).collect::<PyResult<_>>()?;
        self.with(py, |target| {
            each_target!(target, writer => match time(time_ns) {
                Some(time) => writer.push_depth_and_colour_at(&depths, &colours, time),
                None => writer.push_depth_and_colour(&depths, &colours),
            })
        })
    }

    fn push_volume(
        &self,
        py: Python<'_>,
        voxel_m: f64,
        truncation_voxels: u32,
        coords: PyReadonlyArray2<'_, i32>,
        distances: PyReadonlyArray4<'_, f32>,
        time_ns: Option<u64>,
    ) -> PyResult<()> {
        self.refuse_placement("volumes")?;
        let edge = u32::try_from(distances.shape()[1]).unwrap_or(u32::MAX);
        let coords = arrays::to_rows("coords", &coords)?;
        let distances_m = distances.as_array().iter().copied().collect();
        let volume = VolumeArrays { voxel_m, edge, truncation_voxels, coords, distances_m };
        self.with(py, |target| {
            each_target!(target, writer => match time(time_ns) {
                Some(time) => writer.push_volume_arrays_at(&volume, time),
                None => writer.push_volume_arrays(&volume),
            })
        })
    }

    /// Completes the stream.
    fn finish(&self, py: Python<'_>) -> PyResult<jobs::PyReport> {
        let Some(target) = self.take(py)? else { return Err(closed()) };
        let finished = py.detach(|| {
            threads::run(|| match target {
                Target::File(writer) => writer.finish(),
                Target::Sink(writer) => writer.into_inner().and_then(|(mut sink, report)| {
                    sink.flush()?;
                    Ok(report)
                }),
            })
        });
        self.events.log(py)?;
        finished.map(|report| jobs::report(&report)).map_err(|error| self.raised.or(py, error))
    }

    /// Gives up the stream: nothing is left of its file.
    fn abandon(&self, py: Python<'_>) -> PyResult<()> {
        let target = self.take(py)?;
        py.detach(|| drop(target));
        Ok(())
    }
}

impl Writer {
    fn take(&self, py: Python<'_>) -> PyResult<Option<Target>> {
        self.writer.with(py, Option::take)
    }

    fn with(
        &self,
        py: Python<'_>,
        push: impl FnOnce(&mut Target) -> Result<(), isv::Error> + Send,
    ) -> PyResult<()> {
        let pushed = self.writer.with(py, |writer| writer.as_mut().map(push))?;
        self.events.log(py)?;
        pushed.ok_or_else(closed)?.map_err(|error| self.raised.or(py, error))
    }

    fn places(&self, name: &str, places: &Places<'_>) -> PyResult<Vec<[f32; 3]>> {
        let place = |p: [f64; 3]| self.placement.as_ref().map_or(p.map(|c| c as f32), |to| to.point(p));
        match places {
            Places::Single(array) if self.placement.is_none() => arrays::to_rows(name, array),
            Places::Single(array) => {
                let rows = arrays::to_rows::<f32, 3>(name, array)?;
                Ok(rows.into_iter().map(|row| place(row.map(f64::from))).collect())
            }
            Places::Double(array) => Ok(arrays::to_rows(name, array)?.into_iter().map(place).collect()),
        }
    }

    fn refuse_placement(&self, what: &str) -> PyResult<()> {
        match self.placement {
            Some(_) => Err(PyValueError::new_err(format!(
                "units, origin and up are for meshes and points, not {what}"
            ))),
            None => Ok(()),
        }
    }
}

fn closed() -> PyErr {
    PyValueError::new_err("the writer is closed")
}

fn time(time_ns: Option<u64>) -> Option<Duration> {
    time_ns.map(Duration::from_nanos)
}

fn colours(array: Option<&PyReadonlyArray2<'_, u8>>) -> PyResult<Vec<[u8; 3]>> {
    array.map_or(Ok(Vec::new()), |array| arrays::to_rows("colors", array))
}

fn depth_view((depths, (focal, principal, camera_to_world)): &PyDepth<'_>) -> PyResult<DepthView> {
    let [width, height] = size(depths.shape()[1], depths.shape()[0])?;
    let depths_m = depths.as_array().iter().copied().collect();
    let (focal, principal, camera_to_world) = (*focal, *principal, *camera_to_world);
    Ok(DepthView { width, height, focal, principal, camera_to_world, depths_m })
}

fn colour_view((image, camera, depth_view): &PyColour<'_>) -> PyResult<ColourView> {
    let (focal, principal, camera_to_world) = *camera;
    let [width, height] = size(image.shape()[1], image.shape()[0])?;
    if image.shape()[2] != 3 {
        let channels = image.shape()[2];
        return Err(PyValueError::new_err(format!("a colour image has {channels} channels in place of 3")));
    }
    let view = image.as_array();
    let pixels = view.lanes(numpy::ndarray::Axis(2)).into_iter();
    let colours = pixels.map(|pixel| std::array::from_fn(|channel| pixel[channel])).collect();
    Ok(ColourView { width, height, focal, principal, camera_to_world, colours, depth_view: *depth_view })
}

fn size(width: usize, height: usize) -> PyResult<[u32; 2]> {
    let size = |pixels| u32::try_from(pixels).map_err(|_| PyValueError::new_err("an image is too large"));
    Ok([size(width)?, size(height)?])
}

/// A sink that a whole take is encoded into.
pub(crate) enum TakeSink {
    File(isv::FileSink),
    Python(PySink),
}

impl Write for TakeSink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.write(bytes),
            Self::Python(sink) => sink.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::File(file) => file.flush(),
            Self::Python(sink) => sink.flush(),
        }
    }
}
