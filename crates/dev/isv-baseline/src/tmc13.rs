//! TMC13, the test model of MPEG's G-PCC, run as a program the way its test conditions run it.

use crate::ToolError;
use crate::bench::{Bench, CodedPoints, ToolRun, command_line};
use crate::lattice::Voxels;
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

    /// Encodes the voxels of one frame; their colours, if there are any, by RAHT with a quantization parameter of 4 to 51. Settings are
    /// those of the common test conditions for solid clouds: octree without loss, trisoup with loss.
    ///
    /// # Errors
    /// See [`ToolError`].
    pub fn encode(
        &self,
        voxels: &Voxels,
        geometry: Tmc13Geometry,
        colour_qp: u8,
    ) -> Result<ToolRun<CodedPoints>, ToolError> {
        let bench = Bench::new()?;
        bench.write_voxels("points.ply", &voxels.places, &voxels.colours)?;
        let colour_qp = Some(colour_qp).filter(|_| !voxels.colours.is_empty());
        let run = bench.run(&self.tool.path, &encoder_arguments(geometry, colour_qp), self.tool.limit)?;
        let bytes = bench.read(&self.tool.path, "points.bin")?;
        let colour_bytes = colour_bytes(&bytes).ok_or_else(|| ToolError::Kind {
            program: self.tool.path.clone(),
            expected: "a stream of G-PCC",
        })?;
        Ok(run.with(CodedPoints { bytes, colour_bytes }))
    }

    /// Command line of the decoder.
    #[must_use]
    pub fn decoder_command(&self) -> String {
        command_line(&self.tool.path, &decoder_arguments())
    }

    /// Decodes what [`Self::encode`] made; positions on the lattice, and colours if the stream has any.
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

fn decoder_arguments() -> [String; 4] {
    [
        "--mode=1",
        "--compressedStreamPath=points.bin",
        "--reconstructedDataPath=decoded.ply",
        "--convertPlyColourspace=1",
    ]
    .map(str::to_owned)
}

fn encoder_arguments(geometry: Tmc13Geometry, colour_qp: Option<u8>) -> Vec<String> {
    let mut arguments: Vec<String> = [
        "--mode=0",
        "--uncompressedDataPath=points.ply",
        "--compressedStreamPath=points.bin",
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
    match colour_qp {
        Some(qp) => arguments.extend([
            "--convertPlyColourspace=1".to_owned(),
            "--transformType=0".to_owned(),
            "--rahtPredictionSearchRange=50000".to_owned(),
            format!("--qp={qp}"),
            "--qpChromaOffset=-2".to_owned(),
            "--bitdepth=8".to_owned(),
            // What is set above belongs to the attribute that is named after it.
            "--attribute=color".to_owned(),
        ]),
        None => arguments.push("--disableAttributeCoding=1".to_owned()),
    }
    arguments
}

/// Bytes of a stream's attributes: units of a type, a length and so many bytes (ISO/IEC 23090-9, annex B). `None` for anything else.
fn colour_bytes(mut stream: &[u8]) -> Option<u64> {
    /// Types of units that say how an attribute is coded, and that hold it.
    const OF_ATTRIBUTES: [u8; 2] = [3, 4];
    const HEADER: usize = 5;
    let mut bytes = 0;
    while !stream.is_empty() {
        let (header, rest) = stream.split_first_chunk::<HEADER>()?;
        let [kind, length @ ..] = *header;
        let (_, rest) = rest.split_at_checked(u32::from_be_bytes(length) as usize)?;
        if OF_ATTRIBUTES.contains(&kind) {
            bytes += (stream.len() - rest.len()) as u64;
        }
        stream = rest;
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_attributes_are_counted_with_their_headers() {
        let stream =
            [&[0, 0, 0, 0, 2, 7, 7][..], &[3, 0, 0, 0, 1, 7], &[2, 0, 0, 0, 0], &[4, 0, 0, 0, 3, 7, 7, 7]];
        assert_eq!(colour_bytes(&stream.concat()), Some(6 + 8));
        assert_eq!(colour_bytes(&[]), Some(0));
        for broken in [&[4, 0, 0][..], &[4, 0, 0, 0, 2, 7], &[2, 255, 255, 255, 255, 7]] {
            assert_eq!(colour_bytes(broken), None, "{broken:?}");
        }
    }
}
