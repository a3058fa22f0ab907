//! TMC13, the test model of MPEG's G-PCC, run as a program the way its test conditions run it.

use crate::ToolError;
use crate::bench::{Bench, ToolRun, command_line};
use crate::tools::{Identity, Tool, ToolVersion, Tools};
use isv_volume::PointCloud;
use std::time::Duration;

/// What the program says of itself.
const IDENTITY: Identity =
    Identity { name: "tmc3", arguments: &["--help"], mark: "MPEG PCC tmc3 version ", tested: "23.0" };

/// A program still running after this hangs: a million points take seconds.
const TIME_LIMIT: Duration = Duration::from_secs(600);

/// How TMC13 codes geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tmc13Geometry {
    /// Occupancy of voxels, without loss.
    Octree,
    /// Triangles in nodes of an octree, with loss.
    Trisoup {
        /// Edge of a node is `2^node_size_log2` voxels, 2 to 5 here.
        node_size_log2: u8,
    },
}

/// `tmc3`, built from the public source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tmc13 {
    tool: Tool,
}

impl Tmc13 {
    /// Name of the program.
    pub const PROGRAM: &str = IDENTITY.name;

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

    /// Encodes voxels of one frame, positions alone. Settings are those of the common test conditions for solid clouds:
    /// octree without loss, trisoup with loss.
    ///
    /// # Errors
    /// See [`ToolError`].
    pub fn encode(
        &self,
        voxels: &[[i32; 3]],
        geometry: Tmc13Geometry,
    ) -> Result<ToolRun<Vec<u8>>, ToolError> {
        let bench = Bench::new()?;
        bench.write_voxels("points.ply", voxels, None)?;
        let run = bench.run(&self.tool.path, &encoder_arguments(geometry), self.tool.limit)?;
        let bytes = bench.read(&self.tool.path, "points.bin")?;
        Ok(run.with(bytes))
    }

    /// Command line of the decoder.
    #[must_use]
    pub fn decoder_command(&self) -> String {
        command_line(&self.tool.path, &decoder_arguments())
    }

    /// Decodes what [`Self::encode`] made; positions on the lattice.
    ///
    /// # Errors
    /// See [`ToolError`].
    pub fn decode(&self, bytes: &[u8]) -> Result<ToolRun<PointCloud>, ToolError> {
        let bench = Bench::new()?;
        std::fs::write(bench.path("points.bin"), bytes)?;
        let run = bench.run(&self.tool.path, &decoder_arguments(), self.tool.limit)?;
        let points = bench.read_points(&self.tool.path, "decoded.ply")?;
        Ok(run.with(points))
    }
}

fn decoder_arguments() -> [String; 3] {
    ["--mode=1", "--compressedStreamPath=points.bin", "--reconstructedDataPath=decoded.ply"]
        .map(str::to_owned)
}

fn encoder_arguments(geometry: Tmc13Geometry) -> Vec<String> {
    let mut arguments: Vec<String> = [
        "--mode=0",
        "--uncompressedDataPath=points.ply",
        "--compressedStreamPath=points.bin",
        "--disableAttributeCoding=1",
        "--mergeDuplicatedPoints=1",
        "--positionQuantizationScale=1",
        "--neighbourAvailBoundaryLog2=8",
        "--intra_pred_max_node_size_log2=6",
        "--planarEnabled=0",
    ]
    .map(str::to_owned)
    .to_vec();
    match geometry {
        Tmc13Geometry::Octree => {
            arguments.extend(["--trisoupNodeSizeLog2=0", "--inferredDirectCodingMode=1"].map(str::to_owned));
        }
        Tmc13Geometry::Trisoup { node_size_log2 } => {
            // The test conditions switch both off at their finest rate.
            let coarse = u8::from(node_size_log2 > 2);
            arguments.extend([
                format!("--trisoupNodeSizeLog2={node_size_log2}"),
                "--inferredDirectCodingMode=0".to_owned(),
                "--trisoupQuantizationBits=2".to_owned(),
                format!("--trisoupCentroidResidualEnabled={coarse}"),
                format!("--trisoupFaceVertexEnabled={coarse}"),
                "--trisoupFineRayTracingEnabled=0".to_owned(),
                "--trisoupImprovedEncoderEnabled=1".to_owned(),
            ]);
        }
    }
    arguments
}
