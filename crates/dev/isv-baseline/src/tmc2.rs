//! TMC2, the test model of MPEG's V-PCC, run as programs the way its test conditions run them.

use crate::ToolError;
use crate::bench::{Bench, ToolRun, command_line};
use crate::tools::{Identity, ToolVersion, Tools, folder_above};
use isv_volume::{PointCloud, Rgb};
use std::path::PathBuf;
use std::time::Duration;

/// What the encoder says of itself.
const IDENTITY: Identity =
    Identity { name: "PccAppEncoder", arguments: &["--help"], mark: "PccAppEncoder v", tested: "24.0" };

/// A program still running after this hangs: a frame takes half a minute.
const TIME_LIMIT: Duration = Duration::from_secs(4 * 3600);

/// Colour of the points that the encoder is given and does not code: without any it crashes.
const GREY: Rgb = [128; 3];

/// A file by which the folder of configurations is known.
const CONFIGURATION: &str = "common/ctc-common.cfg";

/// `PccAppEncoder` and `PccAppDecoder`, built from the public source, with its folder `cfg`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tmc2 {
    encoder: PathBuf,
    decoder: PathBuf,
    configurations: PathBuf,
    version: ToolVersion,
    limit: Duration,
}

impl Tmc2 {
    /// Names of the programs.
    pub const PROGRAMS: [&str; 2] = [IDENTITY.name, "PccAppDecoder"];

    /// Rates of the common test conditions, fine to coarse.
    pub const RATES: [u8; 5] = [5, 4, 3, 2, 1];

    /// The programs, if both are there.
    ///
    /// # Errors
    /// [`ToolError::Version`] for other programs of these names, [`ToolError::Configuration`] if the folder `cfg` of the source
    /// is not beside them or above.
    pub fn find(tools: &Tools) -> Result<Option<Self>, ToolError> {
        let [Some(encoder), Some(decoder)] = Self::PROGRAMS.map(|name| tools.find(name)) else {
            return Ok(None);
        };
        let version = ToolVersion::ask(&encoder, &IDENTITY)?;
        let configurations = folder_above(&encoder, CONFIGURATION)?;
        Ok(Some(Self { encoder, decoder, configurations, version, limit: tools.limit(TIME_LIMIT) }))
    }

    /// Version of the encoder.
    #[must_use]
    pub fn version(&self) -> &ToolVersion {
        &self.version
    }

    /// Encodes the voxels of a whole take, positions alone, in the random-access condition at a rate of [`Self::RATES`].
    /// Coordinates are from 0 to below `2^bits`.
    ///
    /// # Errors
    /// See [`ToolError`].
    pub fn encode(
        &self,
        frames: &[Vec<[i32; 3]>],
        bits: u8,
        rate: u8,
    ) -> Result<ToolRun<Vec<u8>>, ToolError> {
        let bench = Bench::new()?;
        for (frame, voxels) in frames.iter().enumerate() {
            bench.write_voxels(&format!("points_{frame:04}.ply"), voxels, Some(GREY))?;
        }
        let run = bench.run(&self.encoder, &self.encoder_arguments(frames.len(), bits, rate), self.limit)?;
        let bytes = bench.read(&self.encoder, "take.bin")?;
        Ok(self.shortened(run.with(bytes)))
    }

    /// Decodes what [`Self::encode`] made, a number of frames; positions on the lattice.
    ///
    /// # Errors
    /// See [`ToolError`].
    pub fn decode(&self, bytes: &[u8], frames: usize) -> Result<ToolRun<Vec<PointCloud>>, ToolError> {
        let bench = Bench::new()?;
        std::fs::write(bench.path("take.bin"), bytes)?;
        let run = bench.run(&self.decoder, &self.decoder_arguments(), self.limit)?;
        let decoded = |frame| bench.read_points(&self.decoder, &format!("decoded_{frame:04}.ply"));
        let points = (0..frames).map(decoded).collect::<Result<_, _>>()?;
        Ok(self.shortened(run.with(points)))
    }

    /// Command line of the decoder. `CFG` is the folder of configurations.
    #[must_use]
    pub fn decoder_command(&self) -> String {
        let command = command_line(&self.decoder, &self.decoder_arguments());
        command.replace(&self.configurations.display().to_string(), "CFG")
    }

    fn decoder_arguments(&self) -> [String; 7] {
        [
            "--compressedStreamPath=take.bin".to_owned(),
            "--reconstructedDataPath=decoded_%04d.ply".to_owned(),
            format!(
                "--inverseColorSpaceConversionConfig={}/hdrconvert/yuv420toyuv444_16bit.cfg",
                self.configurations.display()
            ),
            "--startFrameNumber=0".to_owned(),
            "--computeMetrics=0".to_owned(),
            "--computeChecksum=0".to_owned(),
            format!("--nbThread={}", threads()),
        ]
    }

    fn encoder_arguments(&self, frames: usize, bits: u8, rate: u8) -> Vec<String> {
        let cfg = self.configurations.display();
        vec![
            format!("--configurationFolder={cfg}/"),
            format!("--config={cfg}/{CONFIGURATION}"),
            format!("--config={cfg}/condition/ctc-random-access.cfg"),
            format!("--config={cfg}/rate/ctc-r{rate}.cfg"),
            "--uncompressedDataPath=points_%04d.ply".to_owned(),
            "--compressedStreamPath=take.bin".to_owned(),
            "--startFrameNumber=0".to_owned(),
            format!("--frameCount={frames}"),
            "--groupOfFramesSize=32".to_owned(),
            format!("--geometry3dCoordinatesBitdepth={bits}"),
            "--geometryNominal2dBitdepth=8".to_owned(),
            "--noAttributes=1".to_owned(),
            "--computeMetrics=0".to_owned(),
            "--computeChecksum=0".to_owned(),
            "--keepIntermediateFiles=0".to_owned(),
            format!("--nbThread={}", threads()),
        ]
    }

    /// The run with `CFG` for the folder of configurations, which lies where a reader's does not.
    fn shortened<T>(&self, run: ToolRun<T>) -> ToolRun<T> {
        let cfg = self.configurations.display().to_string();
        ToolRun { command: run.command.replace(&cfg, "CFG"), ..run }
    }
}

/// Threads that the programs may use.
fn threads() -> usize {
    rayon::current_num_threads()
}
