//! TMC2, the test model of MPEG's V-PCC, run as programs the way its test conditions run them.

use crate::ToolError;
use crate::bench::{Bench, CodedPoints, ToolRun, command_line};
use crate::lattice::Voxels;
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

    /// Encodes the voxels of a whole take in the random-access condition at a rate of [`Self::RATES`], with colours if all frames have
    /// them. Coordinates are from 0 to below `2^bits`.
    ///
    /// # Errors
    /// See [`ToolError`].
    pub fn encode(&self, frames: &[Voxels], bits: u8, rate: u8) -> Result<ToolRun<CodedPoints>, ToolError> {
        let bench = Bench::new()?;
        let has_colours = frames.iter().all(|voxels| !voxels.colours.is_empty());
        for (frame, Voxels { places, colours }) in frames.iter().enumerate() {
            let grey;
            let colours = match has_colours {
                true => colours,
                false => {
                    grey = vec![GREY; places.len()];
                    &grey
                }
            };
            bench.write_voxels(&format!("points_{frame:04}.ply"), places, colours)?;
        }
        let arguments = self.encoder_arguments(frames.len(), bits, rate, has_colours);
        let run = bench.run(&self.encoder, &arguments, self.limit)?;
        let bytes = bench.read(&self.encoder, "take.bin")?;
        let colour_bytes = colour_bytes(&bytes).ok_or_else(|| ToolError::Kind {
            program: self.encoder.clone(),
            expected: "a stream of V-PCC",
        })?;
        Ok(self.shortened(run.with(CodedPoints { bytes, colour_bytes })))
    }

    /// Decodes what [`Self::encode`] made, a number of frames; positions on the lattice. Without colours in the stream, what the decoder
    /// writes for them means nothing.
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

    fn encoder_arguments(&self, frames: usize, bits: u8, rate: u8, has_colours: bool) -> Vec<String> {
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
            format!("--noAttributes={}", u8::from(!has_colours)),
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

/// Bytes of a stream's attributes: a byte that says how long sizes are, then units with their sizes before them (ISO/IEC 23090-5, annex C).
/// `None` for anything else.
fn colour_bytes(stream: &[u8]) -> Option<u64> {
    /// Type of the units that hold video of attributes.
    const ATTRIBUTE_VIDEO: u8 = 4;
    let (header, mut rest) = stream.split_first()?;
    let size_bytes = usize::from(header >> 5) + 1;
    let mut bytes = 0;
    while !rest.is_empty() {
        let (size, units) = rest.split_at_checked(size_bytes)?;
        let size = size.iter().fold(0u64, |size, byte| size << 8 | u64::from(*byte));
        let (unit, others) = units.split_at_checked(usize::try_from(size).ok()?)?;
        if unit.first()? >> 3 == ATTRIBUTE_VIDEO {
            bytes += (rest.len() - others.len()) as u64;
        }
        rest = others;
    }
    Some(bytes)
}

/// Threads that the programs may use.
fn threads() -> usize {
    rayon::current_num_threads()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_attributes_are_counted_with_their_sizes() {
        // Sizes of two bytes: parameters, then attributes, then geometry.
        let stream = [&[1 << 5][..], &[0, 2, 0, 7], &[0, 3, 4 << 3, 7, 7], &[0, 1, 3 << 3]].concat();
        assert_eq!(colour_bytes(&stream), Some(5));
        assert_eq!(colour_bytes(&stream[..1]), Some(0));
        for broken in [
            &[][..],
            &[0, 0],
            &[1 << 5, 0],
            &[0, 9, 4 << 3],
            &[7 << 5, 255, 255, 255, 255, 255, 255, 255, 255],
        ] {
            assert_eq!(colour_bytes(broken), None, "{broken:?}");
        }
    }
}
