//! gltfpack, meshoptimizer's packer of glTF with `EXT_meshopt_compression`, run as a program the way a user runs it.

use crate::ToolError;
use crate::bench::{Bench, ToolRun};
use crate::tools::{Identity, Tool, ToolVersion, Tools};
use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use isv_io::{Format, write_mesh};
use isv_volume::TriangleMesh;
use std::io::{Read, Write};
use std::ops::RangeInclusive;
use std::time::{Duration, Instant};

/// What the program says of itself.
const IDENTITY: Identity =
    Identity { name: "gltfpack", arguments: &["-v"], mark: "gltfpack ", tested: "1.2" };

/// A program still running after this hangs: two million faces take seconds.
const TIME_LIMIT: Duration = Duration::from_secs(600);

/// Most bytes of a packed frame.
const MOST_BYTES: u64 = 1 << 30;

/// `gltfpack`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gltfpack {
    tool: Tool,
}

impl Gltfpack {
    /// Name of the program.
    pub const PROGRAM: &str = IDENTITY.name;

    /// Bits of a position's component that it takes.
    pub const POSITION_BITS: RangeInclusive<u8> = 1..=16;

    /// The program, if it is there.
    ///
    /// # Errors
    /// [`ToolError::Version`] for another program of this name.
    pub fn find(tools: &Tools) -> Result<Option<Self>, ToolError> {
        Ok(tools.identify(&IDENTITY, TIME_LIMIT)?.map(|tool| Self { tool }))
    }

    /// Version of the program.
    #[must_use]
    pub fn version(&self) -> &ToolVersion {
        &self.tool.version
    }

    /// Packs positions and triangles, not normals, into one GLB file, with positions of at most 16 bits. Then compresses the
    /// file as gzip does, which takes off 29 % on a captured human. gltfpack's highest ratio (`-cz`) is made for that.
    ///
    /// # Errors
    /// See [`ToolError`].
    pub fn encode(&self, mesh: &TriangleMesh, position_bits: u8) -> Result<ToolRun<Vec<u8>>, ToolError> {
        mesh.validate()?;
        let bench = Bench::new()?;
        let TriangleMesh { vertices, triangles, .. } = mesh.clone();
        let plain = TriangleMesh { vertices, normals: Vec::new(), triangles, appearance: None };
        write_mesh(&bench.path("mesh.glb"), &plain, Format::Glb)?;
        let bits = position_bits.clamp(*Self::POSITION_BITS.start(), *Self::POSITION_BITS.end()).to_string();
        let arguments = ["-i", "mesh.glb", "-o", "packed.glb", "-cz", "-vp", &bits].map(str::to_owned);
        let run = bench.run(&self.tool.path, &arguments, self.tool.limit)?;
        let packed = bench.read(&self.tool.path, "packed.glb")?;
        let mut deflated = DeflateEncoder::new(Vec::new(), Compression::best());
        deflated.write_all(&packed)?;
        let mut run = run.with(deflated.finish()?);
        run.command += " (then gzip -9)";
        Ok(run)
    }

    /// Reads what [`Self::encode`] made, with isv's own reader of glTF: gltfpack has no decoder. Its time has no inflating.
    ///
    /// # Errors
    /// See [`ToolError`].
    pub fn decode(&self, bytes: &[u8]) -> Result<ToolRun<TriangleMesh>, ToolError> {
        let bench = Bench::new()?;
        let mut packed = Vec::new();
        DeflateDecoder::new(bytes).take(MOST_BYTES).read_to_end(&mut packed)?;
        std::fs::write(bench.path("packed.glb"), packed)?;
        let start = Instant::now();
        let output = bench.read_mesh(&self.tool.path, "packed.glb")?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(ToolRun { output, ms, peak_memory_bytes: None, command: String::new() })
    }
}
