//! A temporary folder in which the program of another codec runs.

use crate::ToolError;
use crate::program::{ProgramRun, check_output, run_in};
use isv_io::{Colours, Format, Geometry, ReadOptions, Unit, read_geometry_as, write_points};
use isv_volume::{PointCloud, Rgb, TriangleMesh};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;

/// PNG file of one grey pixel, for programs that want a texture.
pub(crate) const GREY_PIXEL: &[u8] = &[
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00,
    0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x02, 0x00, 0x00, 0x00, 0x90, 0x77, 0x53, 0xde, 0x00,
    0x00, 0x00, 0x0c, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0x68, 0x68, 0x68, 0x00, 0x00, 0x03, 0x04,
    0x01, 0x81, 0x4b, 0xd3, 0xd2, 0x10, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60,
    0x82,
];

/// A folder with the files of one run, removed at the end.
pub(crate) struct Bench {
    folder: TempDir,
}

/// What an adapter runs, and what that took.
#[derive(Clone, Debug, PartialEq)]
pub struct ToolRun<T> {
    /// What the program made.
    pub output: T,
    /// Wall time from start to end (ms).
    pub ms: f64,
    /// Peak memory of the program (bytes), where the system says.
    pub peak_memory_bytes: Option<u64>,
    /// The command line. Files are named without their folder.
    pub command: String,
}

/// Points as coded, with or without colours.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CodedPoints {
    /// The stream.
    pub bytes: Vec<u8>,
    /// Bytes of it that are colours.
    pub colour_bytes: u64,
}

impl<T> ToolRun<T> {
    /// The run with another output.
    pub(crate) fn with<U>(self, output: U) -> ToolRun<U> {
        let Self { ms, peak_memory_bytes, command, .. } = self;
        ToolRun { output, ms, peak_memory_bytes, command }
    }
}

impl Bench {
    pub(crate) fn new() -> Result<Self, ToolError> {
        Ok(Self { folder: tempfile::tempdir()? })
    }

    /// Path of a file in the folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs a program in the folder.
    pub(crate) fn run(
        &self,
        program: &Path,
        arguments: &[String],
        limit: Duration,
    ) -> Result<ToolRun<()>, ToolError> {
        let ProgramRun { ms, peak_memory_bytes, .. } = run_in(self.folder.path(), program, arguments, limit)?;
        Ok(ToolRun { output: (), ms, peak_memory_bytes, command: command_line(program, arguments) })
    }

    /// Writes points at whole coordinates, and their colours if there are any.
    pub(crate) fn write_voxels(
        &self,
        name: &str,
        places: &[[i32; 3]],
        colours: &[Rgb],
    ) -> Result<(), ToolError> {
        let positions = places.iter().map(|place| place.map(f64::from).into()).collect();
        let points = PointCloud { positions, colours: colours.to_vec(), ..PointCloud::default() };
        Ok(write_points(&self.path(name), &points, Format::Ply)?)
    }

    /// Bytes of a file that a program wrote.
    pub(crate) fn read(&self, program: &Path, name: &str) -> Result<Vec<u8>, ToolError> {
        let path = self.path(name);
        check_output(program, &path)?;
        Ok(std::fs::read(path)?)
    }

    /// A file that a program wrote, to be read piece by piece.
    pub(crate) fn open(&self, program: &Path, name: &str) -> Result<File, ToolError> {
        let path = self.path(name);
        check_output(program, &path)?;
        Ok(File::open(path)?)
    }

    /// Points of a file that a program wrote, with their colours if they have any.
    pub(crate) fn read_points(&self, program: &Path, name: &str) -> Result<PointCloud, ToolError> {
        match self.read_file(program, name, Colours::Keep)? {
            Geometry::Points(points) => Ok(points),
            Geometry::Mesh(_) => Err(ToolError::Kind { program: program.to_owned(), expected: "points" }),
        }
    }

    /// The mesh of a file that a program wrote, without colours.
    pub(crate) fn read_mesh(&self, program: &Path, name: &str) -> Result<TriangleMesh, ToolError> {
        match self.read_file(program, name, Colours::Drop)? {
            Geometry::Mesh(mesh) => Ok(mesh),
            Geometry::Points(_) => Err(ToolError::Kind { program: program.to_owned(), expected: "a mesh" }),
        }
    }

    fn read_file(&self, program: &Path, name: &str, colours: Colours) -> Result<Geometry, ToolError> {
        let path = self.path(name);
        check_output(program, &path)?;
        let unreadable = |cause| ToolError::Read { program: program.to_owned(), cause: Box::new(cause) };
        read_geometry_as(&path, &ReadOptions::new(Unit::Metre).with_colours(colours)).map_err(unreadable)
    }
}

/// A command line as a reader would type it, without the folder of the program.
pub(crate) fn command_line(program: &Path, arguments: &[String]) -> String {
    let name = program.file_name().unwrap_or(program.as_os_str()).to_string_lossy();
    std::iter::once(name.into_owned()).chain(arguments.iter().cloned()).collect::<Vec<_>>().join(" ")
}
