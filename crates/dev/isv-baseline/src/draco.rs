//! Draco, the mesh codec, run as a program the way a user runs it.

use crate::bench::GREY_PIXEL;
use crate::program::{ProgramError, ProgramRun, check_output, run};
use crate::tools::Tools;
use isv_io::{
    Colours, Format, Geometry, ReadError, ReadOptions, Unit, WriteError, read_geometry_as, read_mesh,
    write_mesh,
};
use isv_volume::{Appearance, Material, MeshError, TriangleMesh};
use std::borrow::Cow;
use std::ffi::OsStr;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use thiserror::Error;

/// `-cl`: the smallest files. A twentieth smaller than the default's, for 30 ms more on a captured human
/// (`docs/design/017-baselines.md`).
const COMPRESSION_LEVEL: u8 = 10;

/// A program still running after this hangs: two million faces take seconds.
const TIME_LIMIT: Duration = Duration::from_secs(600);

/// A mesh that Draco did not code or decode.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DracoError {
    /// No such quantizer.
    #[error("positions of {bits} bits are outside 1 to 30")]
    PositionBits {
        /// The bits asked for.
        bits: u8,
    },
    /// The mesh to encode cannot be worked with.
    #[error("the mesh to encode has {0}")]
    Mesh(#[from] MeshError),
    /// A temporary file cannot be made, written or read.
    #[error("a temporary file: {0}")]
    Temporary(#[from] std::io::Error),
    /// The mesh cannot be written for the program.
    #[error("the mesh for draco_encoder: {0}")]
    Write(#[from] WriteError),
    /// The program failed.
    #[error(transparent)]
    Program(#[from] ProgramError),
    /// What the program wrote is not a mesh.
    #[error("the mesh from draco_decoder: {0}")]
    Read(#[from] ReadError),
}

/// `draco_encoder` and `draco_decoder` (Debian package `draco`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Draco {
    encoder: PathBuf,
    decoder: PathBuf,
    limit: Duration,
}

impl Draco {
    /// Names of the programs.
    pub const PROGRAMS: [&str; 2] = ["draco_encoder", "draco_decoder"];

    /// Bits of a position's component that the encoder takes.
    pub const POSITION_BITS: RangeInclusive<u8> = 1..=30;

    /// The programs, if both are on the `PATH`.
    #[must_use]
    pub fn find() -> Option<Self> {
        Self::find_in(&Tools::default())
    }

    /// The programs, if both are there.
    #[must_use]
    pub fn find_in(tools: &Tools) -> Option<Self> {
        let [encoder, decoder] = Self::PROGRAMS.map(|name| tools.find(name));
        Some(Self { encoder: encoder?, decoder: decoder?, limit: tools.limit(TIME_LIMIT) })
    }

    /// Command lines of encoder and decoder, with the names of files for their paths.
    #[must_use]
    pub fn commands(position_bits: u8) -> [String; 2] {
        [
            format!("draco_encoder -qp {position_bits} -cl {COMPRESSION_LEVEL} -i mesh.ply -o mesh.drc"),
            "draco_decoder -i mesh.drc -o mesh.ply".to_owned(),
        ]
    }

    /// Command lines of encoder and decoder for meshes with texture coordinates, as [`Self::commands`].
    #[must_use]
    pub fn commands_textured(position_bits: u8, coordinate_bits: u8) -> [String; 2] {
        [
            format!(
                "draco_encoder -qp {position_bits} -qt {coordinate_bits} -cl {COMPRESSION_LEVEL} -i mesh.obj -o mesh.drc"
            ),
            "draco_decoder -i mesh.drc -o mesh.obj".to_owned(),
        ]
    }

    /// Encodes positions and triangles, not normals, at compression level 10. Draco gets positions in metres, rounded to
    /// `f32` and otherwise as they are. It quantizes them to `2^position_bits` steps of the longest side of their bounding
    /// box.
    ///
    /// # Errors
    /// See [`DracoError`].
    pub fn encode(&self, mesh: &TriangleMesh, position_bits: u8) -> Result<ProgramRun<Vec<u8>>, DracoError> {
        self.encode_at(mesh, position_bits, COMPRESSION_LEVEL)
    }

    fn encode_at(&self, mesh: &TriangleMesh, bits: u8, level: u8) -> Result<ProgramRun<Vec<u8>>, DracoError> {
        Self::check(mesh, bits)?;
        let folder = tempfile::tempdir()?;
        let input = folder.path().join("mesh.ply");
        write_mesh(&input, &without_normals(mesh), Format::Ply)?;
        self.run_encoder(&input, &["-qp", &bits.to_string(), "-cl", &level.to_string()])
    }

    /// Checks what is to be encoded.
    fn check(mesh: &TriangleMesh, position_bits: u8) -> Result<(), DracoError> {
        if !Self::POSITION_BITS.contains(&position_bits) {
            return Err(DracoError::PositionBits { bits: position_bits });
        }
        Ok(mesh.validate()?)
    }

    /// Runs the encoder on a file, in whose folder it writes.
    fn run_encoder(&self, input: &Path, flags: &[&str]) -> Result<ProgramRun<Vec<u8>>, DracoError> {
        let [output, log] = ["mesh.drc", "log"].map(|name| input.with_file_name(name));
        let flags: Vec<&OsStr> = flags.iter().map(OsStr::new).collect();
        let files = ["-i".as_ref(), input.as_os_str(), "-o".as_ref(), output.as_os_str()];
        let ProgramRun { ms, peak_memory_bytes, .. } =
            run(&self.encoder, &[&flags[..], &files].concat(), &log, self.limit)?;
        check_output(&self.encoder, &output)?;
        Ok(ProgramRun { output: std::fs::read(output)?, ms, peak_memory_bytes })
    }

    /// Runs the decoder in a folder; it writes a file of this name.
    fn run_decoder(
        &self,
        folder: &Path,
        name: &str,
        bytes: &[u8],
    ) -> Result<ProgramRun<PathBuf>, DracoError> {
        let [input, output, log] = ["mesh.drc", name, "log"].map(|name| folder.join(name));
        std::fs::write(&input, bytes)?;
        let arguments = ["-i".as_ref(), input.as_os_str(), "-o".as_ref(), output.as_os_str()];
        let ProgramRun { ms, peak_memory_bytes, .. } = run(&self.decoder, &arguments, &log, self.limit)?;
        check_output(&self.decoder, &output)?;
        Ok(ProgramRun { output, ms, peak_memory_bytes })
    }

    /// Encodes a mesh as [`Self::encode`] does, with its texture coordinates, which Draco quantizes to `2^coordinate_bits` steps
    /// of the longer side of their bounding box. Its image is not coded.
    ///
    /// # Errors
    /// See [`DracoError`].
    pub fn encode_textured(
        &self,
        mesh: &TriangleMesh,
        position_bits: u8,
        coordinate_bits: u8,
    ) -> Result<ProgramRun<Vec<u8>>, DracoError> {
        Self::check(mesh, position_bits)?;
        let folder = tempfile::tempdir()?;
        let input = folder.path().join("mesh.obj");
        write_mesh(&input, &with_coordinates_alone(mesh), Format::Obj)?;
        // Draco would code the number of the material with each face.
        let text = std::fs::read_to_string(&input)?;
        let names_material = |line: &&str| line.starts_with("mtllib") || line.starts_with("usemtl");
        let lines: Vec<&str> = text.lines().filter(|line| !names_material(line)).collect();
        std::fs::write(&input, lines.join("\n"))?;
        let [positions, coordinates, level] =
            [position_bits, coordinate_bits, COMPRESSION_LEVEL].map(|number| number.to_string());
        self.run_encoder(&input, &["-qp", &positions, "-qt", &coordinates, "-cl", &level])
    }

    /// Decodes what [`Self::encode_textured`] made: positions in metres, texture coordinates, and one white material.
    ///
    /// # Errors
    /// See [`DracoError`].
    pub fn decode_textured(&self, bytes: &[u8]) -> Result<ProgramRun<TriangleMesh>, DracoError> {
        let folder = tempfile::tempdir()?;
        let ProgramRun { output: path, ms, peak_memory_bytes } =
            self.run_decoder(folder.path(), "mesh.obj", bytes)?;
        // Texture coordinates are read of faces that have a texture.
        let text = std::fs::read(&path)?;
        std::fs::write(&path, [b"mtllib mesh.mtl\nusemtl texture\n", &text[..]].concat())?;
        std::fs::write(folder.path().join("mesh.mtl"), "newmtl texture\nmap_Kd mesh.png\n")?;
        std::fs::write(folder.path().join("mesh.png"), GREY_PIXEL)?;
        let options = ReadOptions::new(Unit::Metre).with_colours(Colours::Keep);
        let Geometry::Mesh(mut output) = read_geometry_as(&path, &options)? else {
            return Err(ReadError::NotAMesh { path }.into());
        };
        if let Some(appearance) = &mut output.appearance {
            Arc::make_mut(appearance).materials = vec![Material::default()];
        }
        Ok(ProgramRun { output, ms, peak_memory_bytes })
    }

    /// Decodes what [`Self::encode`] made; positions in metres.
    ///
    /// # Errors
    /// See [`DracoError`].
    pub fn decode(&self, bytes: &[u8]) -> Result<ProgramRun<TriangleMesh>, DracoError> {
        let folder = tempfile::tempdir()?;
        let ProgramRun { output: path, ms, peak_memory_bytes } =
            self.run_decoder(folder.path(), "mesh.ply", bytes)?;
        Ok(ProgramRun { output: read_mesh(&path, Unit::Metre)?, ms, peak_memory_bytes })
    }
}

/// The mesh with all that [`Draco::encode_textured`] codes: positions, triangles, texture coordinates under one white material.
fn with_coordinates_alone(mesh: &TriangleMesh) -> TriangleMesh {
    let coordinates = mesh.appearance.as_ref().map(|appearance| appearance.texture_coordinates.clone());
    let appearance = Appearance {
        texture_coordinates: coordinates.unwrap_or_default(),
        materials: vec![Material::default()],
        ..Appearance::default()
    };
    let TriangleMesh { vertices, triangles, .. } = mesh.clone();
    TriangleMesh { vertices, normals: Vec::new(), triangles, appearance: Some(Arc::new(appearance)) }
}

fn without_normals(mesh: &TriangleMesh) -> Cow<'_, TriangleMesh> {
    if mesh.normals.is_empty() {
        Cow::Borrowed(mesh)
    } else {
        let TriangleMesh { vertices, triangles, .. } = mesh.clone();
        Cow::Owned(TriangleMesh { vertices, normals: Vec::new(), triangles, appearance: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support;
    use isv_testkit::{Need, skip};

    #[test]
    fn the_highest_level_gives_the_smallest_files() {
        let Some(draco) = Draco::find() else { return skip(Need::Draco, "draco_encoder is not installed") };
        let Some(mesh) = support::load("dancer", 0) else { return };
        for mesh in [crate::simplify(&mesh, 0.25).unwrap(), mesh] {
            let runs = [0, 5, 7, COMPRESSION_LEVEL].map(|level| {
                let run = draco.encode_at(&mesh, 10, level).unwrap();
                let faces = mesh.triangles.len();
                println!("{faces} faces at level {level}: {} bytes, {:.0} ms", run.output.len(), run.ms);
                run.output.len()
            });
            assert!(runs.iter().all(|bytes| *bytes >= runs[3]), "{runs:?}");
        }
    }
}
