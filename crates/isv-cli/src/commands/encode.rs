//! `isv encode`: meshes to a stream.

mod header;

use crate::failure::usage;
use crate::frame_range::FrameRange;
use crate::length::Length;
use crate::output::{Output, frames_in_words};
use crate::progress::Progress;
use crate::source::MeshFrames;
use crate::stats::{EncodedFrameStats, StatsFile, megabits_per_second, timed};
use crate::terms::{MotionName, SignName};
use crate::threads::use_threads;
use anyhow::{Context, Result};
use header::HeaderArgs;
use isv::encode::{EncodedFrame, Encoder, EncoderSettings, surface_rms_voxels};
use isv::format::{PacketWriter, StreamHeader};
use isv::ingest::{
    DEFAULT_BLOCK_LIMIT, IngestError, MeshIngest, SignDecision, SignEvidence, SignMode, decide_sign,
    ingest_mesh,
};
use isv::io::{FrameSequence, Unit};
use isv::volume::{Grid, SparseVolume, TriangleMesh};
use std::num::NonZero;
use std::path::{Path, PathBuf};

/// Encode mesh frames into an .isv stream
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Frames: a folder, a pattern such as 'take/*.obj', or one file; PLY or OBJ, in natural order of their names
    input: String,
    /// The stream to write; - for standard output
    #[arg(short, long, value_name = "OUT.isv")]
    output: PathBuf,
    /// Unit of the input's coordinates: m, dm, cm, mm or in
    #[arg(long, default_value_t = Unit::Metre)]
    units: Unit,
    /// Only these frames, counted from 0, without frame B
    #[arg(long, value_name = "A..B")]
    frames: Option<FrameRange>,
    /// A keyframe at least every this many frames
    #[arg(long, value_name = "FRAMES", default_value = "30")]
    gop: NonZero<u32>,
    /// How frames between keyframes are predicted
    #[arg(long, value_enum, default_value = "3dof")]
    motion: MotionName,
    #[command(flatten)]
    header: HeaderArgs,
    /// How to tell inside from outside
    #[arg(long, value_enum, default_value = "auto")]
    sign: SignName,
    /// Half the thickness of the shell around a surface without inside, in voxels
    #[arg(long, value_name = "VOXELS", default_value = "1.5")]
    offset: f64,
    /// Refuse frames that need more blocks
    #[arg(long, value_name = "N", default_value_t = DEFAULT_BLOCK_LIMIT)]
    max_blocks: usize,
    /// Put a hash of every decoded frame into the stream, for isv verify
    #[arg(long)]
    checksums: bool,
    /// Threads to work with; without it, one a core
    #[arg(long, value_name = "N")]
    threads: Option<NonZero<usize>>,
    /// Write times and sizes of every frame to this file
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
}

impl Args {
    fn ingest(&self, grid: Grid) -> Result<MeshIngest> {
        let Self { offset, max_blocks, .. } = *self;
        let truncation = grid.truncation.voxels();
        if !(offset > 0.0 && offset <= f64::from(truncation)) {
            return Err(usage(format!(
                "--offset {offset}: it must be above 0 and at most the truncation of {truncation} voxels"
            )));
        }
        Ok(MeshIngest { grid, sign: self.sign.into(), offset_voxels: offset, max_blocks })
    }

    fn encoder_settings(&self) -> EncoderSettings {
        EncoderSettings {
            motion: self.motion.into(),
            gop: self.gop.get(),
            checksums: self.checksums,
            ..EncoderSettings::default()
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let header = args.header.header()?;
    let ingest = args.ingest(header.grid)?;
    use_threads(args.threads)?;
    let mut sequence = FrameSequence::open(&args.input)?;
    if let Some(range) = args.frames {
        sequence = sequence.select(range.start..range.end)?;
    }
    let stats = StatsFile::create(args.stats.as_deref())?;
    let mut job = Job {
        header,
        encoder: Encoder::new(&header, args.encoder_settings()),
        writer: PacketWriter::new(Output::create(&args.output)?, &header)?,
        stats,
        frames: 0,
    };
    let progress = Progress::new(Some(sequence.paths().len()), "encoding");
    let volumes =
        Volumes { meshes: MeshFrames::new(&sequence, args.units), ingest, sign: None, progress: &progress };
    for frame in volumes {
        job.encode(&frame?)?;
        progress.step();
    }
    drop(progress);
    job.finish()
}

/// A frame ready to be encoded.
struct IngestedFrame {
    volume: SparseVolume,
    ingest_ms: f64,
}

/// Reads and ingests frames.
struct Volumes<'a> {
    meshes: MeshFrames,
    ingest: MeshIngest,
    /// Made on the first frame.
    sign: Option<SignDecision>,
    progress: &'a Progress,
}

impl Volumes<'_> {
    fn ingest(&mut self, path: &Path, mesh: &TriangleMesh) -> Result<IngestedFrame> {
        let (sign, evidence) = match self.sign {
            Some(sign) => (sign, None),
            None => {
                let (sign, evidence) = decide_sign(mesh, self.ingest.sign);
                (sign, Some(evidence))
            }
        };
        let (volume, ingest_ms) = timed(|| ingest_mesh(mesh, &self.ingest, sign));
        let volume = volume.map_err(with_advice).with_context(|| path.display().to_string())?;
        if let Some(evidence) = evidence {
            self.sign = Some(sign);
            self.progress.note(&sign_sentence(sign, evidence, self.ingest.sign));
            self.warn_if_tiny(path, mesh);
        }
        Ok(IngestedFrame { volume, ingest_ms })
    }

    /// A wrong unit that makes the surface small is no error, but leaves little of it.
    fn warn_if_tiny(&self, path: &Path, mesh: &TriangleMesh) {
        let Grid { voxel_size, edge, .. } = self.ingest.grid;
        let diagonal_m = mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
        if diagonal_m < voxel_size.metres() * edge.voxels() as f64 {
            let (path, diagonal) = (path.display(), Length::from_metres(diagonal_m));
            self.progress.note(&format!("{path}: only {diagonal} across, less than a block: check --units"));
        }
    }
}

impl Iterator for Volumes<'_> {
    type Item = Result<IngestedFrame>;

    fn next(&mut self) -> Option<Self::Item> {
        let frame = self.meshes.next()?;
        Some(frame.and_then(|(path, mesh)| self.ingest(&path, &mesh)))
    }
}

/// What was decided about the sign, and why.
fn sign_sentence(decision: SignDecision, evidence: SignEvidence, mode: SignMode) -> String {
    let why = match mode {
        SignMode::Auto => format!("{:.0} % of the first frame looks closed", 100.0 * evidence.closed_share),
        SignMode::Closed | SignMode::Offset => "as --sign asks".to_owned(),
    };
    format!("{decision} ({why})")
}

/// Names the option to change where a coarser voxel would do.
fn with_advice(error: IngestError) -> anyhow::Error {
    match error {
        IngestError::TooManyBlocks { voxel_that_fits_m, .. }
        | IngestError::OutOfRange { voxel_that_fits_m, .. } => {
            let fits = Length::from_metres(voxel_that_fits_m);
            anyhow::anyhow!("{error}: try --voxel {fits}, or check --units")
        }
        other => other.into(),
    }
}

/// The encoding side.
struct Job {
    header: StreamHeader,
    encoder: Encoder,
    writer: PacketWriter<Output>,
    stats: StatsFile<EncodedFrameStats>,
    frames: usize,
}

impl Job {
    fn encode(&mut self, frame: &IngestedFrame) -> Result<()> {
        let (coded, encode_ms) = timed(|| self.encoder.encode(&frame.volume));
        let timestamp_ns = self.header.frame_rate.timestamp_ns(self.frames as u64);
        let bytes = self.writer.write_frame(coded.keyframe, timestamp_ns, &coded.payload())?;
        self.frames += 1;
        if self.stats.is_wanted() {
            let stats = self.frame_stats(frame, &coded, encode_ms, bytes);
            self.stats.push(stats);
        }
        Ok(())
    }

    fn frame_stats(
        &self,
        frame: &IngestedFrame,
        coded: &EncodedFrame,
        encode_ms: f64,
        bytes: usize,
    ) -> EncodedFrameStats {
        let blocks = frame.volume.block_count();
        let decoded = self.encoder.reconstruction().expect("a frame was just encoded");
        let voxel_mm = self.header.grid.voxel_size.metres() * 1e3;
        EncodedFrameStats {
            ingest_ms: frame.ingest_ms,
            encode_ms,
            bytes,
            bytes_blocks: coded.bytes_blocks(),
            bytes_motion: coded.bytes_motion(),
            bytes_coefficients: coded.bytes_coefficients(),
            blocks_band: blocks,
            blocks_coded: blocks,
            keyframe: coded.keyframe,
            surface_rms_mm: surface_rms_voxels(&frame.volume, decoded) * voxel_mm,
        }
    }

    fn finish(self) -> Result<()> {
        let bytes = self.writer.finish()?.commit()?;
        let rate = self.header.frame_rate.per_second();
        eprintln!(
            "{}, {bytes} bytes, {:.3} Mbps, {:.0} ms a frame",
            frames_in_words(self.frames),
            megabits_per_second(bytes, self.frames, rate),
            self.stats.wall_ms() / self.frames as f64,
        );
        self.stats.commit()
    }
}
