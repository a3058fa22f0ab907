//! Streams to frames, and frames to arrays.

use crate::exclusive::Exclusive;
use crate::files::{PySource, Raised};
use crate::{arrays, errors, jobs, threads};
use isv::{AfterLoss, Lod};
use numpy::{PyArray2, PyArray4};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyType;
use std::path::PathBuf;

/// Settings of reading, as Python gives them: level of detail, whether lost frames are held, whether there is colour, memory (bytes).
type Settings = (u8, bool, bool, Option<u64>);

/// A stream that is read.
#[pyclass(frozen, module = "isv._isv")]
pub(crate) struct Reader {
    reader: Exclusive<isv::Reader>,
    raised: Raised,
    events: jobs::Events,
}

/// A decoded frame.
#[pyclass(frozen, module = "isv._isv")]
pub(crate) struct Frame(isv::Frame);

/// The surface of frames in parts.
#[pyclass(frozen, module = "isv._isv")]
pub(crate) struct SurfaceParts(Exclusive<isv::SurfaceParts>);

type Place = (i32, i32, i32);

type Rows<'py, T> = Bound<'py, PyArray2<T>>;
type MeshArrays<'py> = (Rows<'py, f32>, Rows<'py, u32>, Option<Rows<'py, f32>>, Option<Rows<'py, u8>>);
type PointArrays<'py> = (Rows<'py, f32>, Rows<'py, f32>, Option<Rows<'py, u8>>);
type VolumeArrays<'py> = (f64, u32, u32, Rows<'py, i32>, Bound<'py, PyArray4<f32>>);

#[pymethods]
impl Reader {
    #[classmethod]
    fn open(_: &Bound<'_, PyType>, py: Python<'_>, path: PathBuf, settings: Settings) -> PyResult<Self> {
        let raised = Raised::default();
        Self::new(py, raised, settings, move || isv::Reader::open(path))
    }

    #[classmethod]
    fn from_bytes(
        _: &Bound<'_, PyType>,
        py: Python<'_>,
        name: String,
        bytes: PyBackedBytes,
        settings: Settings,
    ) -> PyResult<Self> {
        Self::new(py, Raised::default(), settings, move || isv::Reader::from_bytes(&name, bytes))
    }

    #[classmethod]
    fn from_file(
        _: &Bound<'_, PyType>,
        name: String,
        file: &Bound<'_, PyAny>,
        seekable: bool,
        settings: Settings,
    ) -> PyResult<Self> {
        let raised = Raised::default();
        let source = PySource::new(file, &raised)?;
        Self::new(file.py(), raised, settings, move || match seekable {
            true => isv::Reader::from_seekable(&name, source),
            false => Ok(isv::Reader::from_read(&name, std::io::BufReader::with_capacity(1 << 16, source))),
        })
    }

    /// Number of frames; `None` where bytes come once.
    #[getter]
    fn frames(&self, py: Python<'_>) -> PyResult<Option<usize>> {
        self.reader.with(py, |reader| reader.frames())
    }

    #[getter]
    fn fps(&self, py: Python<'_>) -> PyResult<Option<f64>> {
        self.reader.with(py, |reader| reader.fps())
    }

    #[getter]
    fn voxel(&self, py: Python<'_>) -> PyResult<Option<f64>> {
        self.reader.with(py, |reader| reader.voxel_m())
    }

    /// Reads what is behind the last frame: where the index is not sound, there may be damage.
    fn read_end(&self, py: Python<'_>) -> PyResult<()> {
        let read = self.reader.with(py, |reader| {
            let frames = reader.frames().unwrap_or(0);
            match frames.checked_sub(1) {
                None => reader.rewind()?,
                Some(_) if reader.next_number() == Some(frames) => {}
                Some(last) => _ = reader.approach(last)?,
            }
            while reader.next_frame()?.is_some() {}
            Ok::<_, isv::Error>(())
        })?;
        self.events.log(py)?;
        read.map_err(|error| self.raised.or(py, error))
    }

    fn next_frame(&self, py: Python<'_>) -> PyResult<Option<Frame>> {
        let frame = self.reader.with(py, isv::Reader::next_frame)?;
        self.events.log(py)?;
        Ok(frame.map_err(|error| self.raised.or(py, error))?.map(Frame))
    }

    fn frame(&self, py: Python<'_>, number: usize) -> PyResult<Frame> {
        let why = match self.frame_from(py, number)? {
            Some(frame) if frame.number() == number => return Ok(frame),
            Some(_) => format!("frame {number} is lost, and no frame before it is there"),
            None => format!("ends before frame {number}"),
        };
        Err(errors::with_kind(py, "stream", why))
    }

    /// The first frame with a number, or a larger one where frames before it are lost; `None` behind the last one.
    fn frame_from(&self, py: Python<'_>, number: usize) -> PyResult<Option<Frame>> {
        // One frame at a time, so that a signal ends a long way.
        loop {
            let frame = self.reader.with(py, |reader| {
                reader.approach(number)?;
                reader.next_frame()
            })?;
            self.events.log(py)?;
            py.check_signals()?;
            match frame.map_err(|error| self.raised.or(py, error))? {
                Some(frame) if frame.number() < number => {}
                frame => return Ok(frame.map(Frame)),
            }
        }
    }
}

impl Reader {
    fn new(
        py: Python<'_>,
        raised: Raised,
        (lod, holds, colour, memory): Settings,
        open: impl FnOnce() -> Result<isv::Reader, isv::Error> + Send,
    ) -> PyResult<Self> {
        let lod = match lod {
            1 => Lod::Full,
            2 => Lod::Half,
            4 => Lod::Quarter,
            _ => return Err(PyValueError::new_err(format!("lod is 1, 2 or 4, not {lod}"))),
        };
        let events = jobs::Events::default();
        let reader = py.detach(open).map_err(|error| raised.or(py, error))?;
        // The library can do without an index. What a file raised while it was looked for is no less an error.
        if let Some(error) = raised.take() {
            return Err(error);
        }
        let reader = reader.lod(lod).after_loss(if holds { AfterLoss::Hold } else { AfterLoss::Stop });
        let reader = reader.on_event(events.handler());
        let reader = if colour { reader } else { reader.without_colour() };
        let reader = match memory {
            Some(bytes) => reader.memory_limit(bytes),
            None => reader,
        };
        Ok(Self { reader: Exclusive::new(reader), raised, events })
    }
}

#[pymethods]
impl Frame {
    #[getter]
    fn number(&self) -> usize {
        self.0.number()
    }

    #[getter]
    fn timestamp_ns(&self) -> u64 {
        u64::try_from(self.0.timestamp().as_nanos()).unwrap_or(u64::MAX)
    }

    fn mesh<'py>(&self, py: Python<'py>, normals: bool) -> PyResult<MeshArrays<'py>> {
        let mesh =
            self.with(py, |frame| if normals { frame.mesh() } else { frame.mesh_without_normals() })?;
        Ok(mesh_arrays(py, mesh, normals))
    }

    fn points<'py>(&self, py: Python<'py>, count: Option<usize>) -> PyResult<PointArrays<'py>> {
        let points = self.with(py, |frame| match count {
            Some(count) => frame.points(count),
            None => frame.points_by_voxel(),
        })?;
        let isv::Points { positions, normals, colours, .. } = points;
        Ok((arrays::rows(py, positions), arrays::rows(py, normals), arrays::some_rows(py, colours)))
    }

    fn volume<'py>(&self, py: Python<'py>) -> PyResult<VolumeArrays<'py>> {
        let volume = self.with(py, isv::Frame::volume_arrays)?;
        let isv::VolumeArrays { voxel_m, edge, truncation_voxels, coords, distances_m } = volume;
        let distances = arrays::cubes(py, edge as usize, distances_m);
        Ok((voxel_m, edge, truncation_voxels, arrays::rows(py, coords), distances))
    }
}

impl Frame {
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&isv::Frame) -> Result<T, isv::Error> + Send,
    ) -> PyResult<T> {
        py.detach(|| threads::run(|| work(&self.0))).map_err(|error| errors::of_library(py, error))
    }
}

/// A mesh as arrays, with normals where they are wanted.
fn mesh_arrays(py: Python<'_>, mesh: isv::Mesh, normals: bool) -> MeshArrays<'_> {
    let isv::Mesh { positions, normals: directions, colours, triangles } = mesh;
    let directions = normals.then(|| arrays::rows(py, directions));
    (arrays::rows(py, positions), arrays::rows(py, triangles), directions, arrays::some_rows(py, colours))
}

#[pymethods]
impl SurfaceParts {
    #[new]
    fn new(normals: bool) -> Self {
        let parts = if normals { isv::SurfaceParts::new() } else { isv::SurfaceParts::without_normals() };
        Self(Exclusive::new(parts))
    }

    /// Takes the next frame; the places of parts that changed, and of those that are gone.
    fn update(&self, py: Python<'_>, frame: &Bound<'_, Frame>) -> PyResult<(Vec<Place>, Vec<Place>)> {
        let frame = frame.get();
        let changes = self.0.with(py, |parts| parts.update(&frame.0))?;
        let changes = changes.map_err(|error| errors::of_library(py, error))?;
        let places = |list: Vec<[i32; 3]>| list.into_iter().map(Place::from).collect();
        Ok((places(changes.changed), places(changes.removed)))
    }

    fn places(&self, py: Python<'_>) -> PyResult<Vec<Place>> {
        self.0.with(py, |parts| parts.places().map(Place::from).collect())
    }

    fn mesh<'py>(
        &self,
        py: Python<'py>,
        place: Place,
        frame: &Bound<'py, Frame>,
        normals: bool,
    ) -> PyResult<Option<MeshArrays<'py>>> {
        let frame = frame.get();
        let mesh = self.0.with(py, |parts| parts.mesh(place.into(), &frame.0))?;
        Ok(mesh.map(|mesh| mesh_arrays(py, mesh, normals)))
    }
}
