//! A temporary folder in which the program of another codec runs.

use crate::ToolError;
use crate::program::{ProgramRun, check_output, run_in};
use isv_io::{Format, Geometry, Unit, read_geometry, write_points};
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

    /// Writes points at whole coordinates; with a colour each of them has it.
    pub(crate) fn write_voxels(
        &self,
        name: &str,
        voxels: &[[i32; 3]],
        colour: Option<Rgb>,
    ) -> Result<(), ToolError> {
        let positions: Vec<_> = voxels.iter().map(|voxel| voxel.map(f64::from).into()).collect();
        let colours = colour.map_or(Vec::new(), |colour| vec![colour; positions.len()]);
        let points = PointCloud { positions, colours, ..PointCloud::default() };
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

    /// Points of a file that a program wrote.
    pub(crate) fn read_points(&self, program: &Path, name: &str) -> Result<PointCloud, ToolError> {
        match self.read_file(program, name)? {
            Geometry::Points(points) => Ok(points),
            Geometry::Mesh(_) => Err(ToolError::Kind { program: program.to_owned(), expected: "points" }),
        }
    }

    /// The mesh of a file that a program wrote.
    pub(crate) fn read_mesh(&self, program: &Path, name: &str) -> Result<TriangleMesh, ToolError> {
        match self.read_file(program, name)? {
            Geometry::Mesh(mesh) => Ok(mesh),
            Geometry::Points(_) => Err(ToolError::Kind { program: program.to_owned(), expected: "a mesh" }),
        }
    }

    fn read_file(&self, program: &Path, name: &str) -> Result<Geometry, ToolError> {
        let path = self.path(name);
        check_output(program, &path)?;
        let unreadable = |cause| ToolError::Read { program: program.to_owned(), cause: Box::new(cause) };
        read_geometry(&path, Unit::Metre).map_err(unreadable)
    }
}

/// A command line as a reader would type it, without the folder of the program.
pub(crate) fn command_line(program: &Path, arguments: &[String]) -> String {
    let name = program.file_name().unwrap_or(program.as_os_str()).to_string_lossy();
    std::iter::once(name.into_owned()).chain(arguments.iter().cloned()).collect::<Vec<_>>().join(" ")
}
