//! What `--stats` writes. The names of the fields are the keys of the JSON file.

use crate::failure::usage;
use crate::output::{is_pipe, is_same_file};
use anyhow::Result;
use isv::raw::io::{AtomicFile, check_overwriting};
use isv::raw::kernels::simd;
use isv_study::Stages;
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

/// One frame of `encode --stats`.
#[derive(Debug, Serialize)]
pub(crate) struct EncodedFrameStats {
    /// Capture to volume, reading the file not included.
    pub(crate) ingest_ms: f64,
    /// Volume to packet.
    pub(crate) encode_ms: f64,
    /// Colour of the decoded surface to its part of the packet.
    pub(crate) colour_ms: f64,
    /// The packet, its header included.
    pub(crate) bytes: usize,
    /// The part of `bytes` that is colour.
    pub(crate) bytes_colour: usize,
    pub(crate) bytes_blocks: usize,
    pub(crate) bytes_motion: usize,
    pub(crate) bytes_coefficients: usize,
    /// The part of `bytes_blocks` that tells which voxels are unobserved.
    pub(crate) bytes_masks: usize,
    /// The part of `bytes_coefficients` that DC coefficients take.
    pub(crate) bytes_dc: f64,
    /// Blocks that ingest made: those of the truncation band, or as many as are near the surface if no others are coded.
    pub(crate) blocks_band: usize,
    /// Blocks in the stream.
    pub(crate) blocks_coded: usize,
    pub(crate) keyframe: bool,
    /// Change of the field within 0.9 voxel of the surface.
    pub(crate) surface_rms_mm: f64,
}

/// One frame of `decode --stats`.
#[derive(Debug, Serialize)]
pub(crate) struct DecodedFrameStats {
    /// Packet to volume.
    pub(crate) decode_ms: f64,
    /// Volume to mesh or points; nothing for volumes.
    pub(crate) surface_ms: f64,
    pub(crate) write_ms: f64,
}

/// A whole run.
#[derive(Debug, Serialize)]
struct RunStats<'a, F> {
    frames: &'a [F],
    /// The vector instructions that were used.
    simd: String,
    /// Milliseconds in each stage of the codec, over all frames. Stages that run at the same time each count in full.
    stages_ms: BTreeMap<&'static str, f64>,
    /// The most memory that was resident at a time; null where the system does not say.
    peak_memory_bytes: Option<u64>,
    wall_ms: f64,
}

/// How the file begins: what else is in the way is not overwritten.
const STATS_START: &str = "{\n  \"frames\": [";

/// Collects the statistics of a run, if they were asked for.
#[derive(Debug)]
pub(crate) struct StatsFile<F> {
    file: Option<(AtomicFile, Stages)>,
    frames: Vec<F>,
    started: Instant,
}

impl<F: Serialize> StatsFile<F> {
    /// Opens the file now, so that a path that cannot be written is refused before the work is done. `used`: what the command reads
    /// and writes otherwise.
    pub(crate) fn create(path: Option<&Path>, used: [&Path; 2]) -> Result<Self> {
        if let Some(path) = path {
            if is_pipe(path) {
                return Err(usage("--stats: a file, as standard output is for results"));
            }
            if used.iter().any(|used| is_same_file(path, used)) {
                return Err(usage(format!(
                    "--stats: {} is what the command reads or writes",
                    path.display()
                )));
            }
            check_overwriting(path, "holds no statistics", |start| {
                start.starts_with(STATS_START.as_bytes())
            })?;
        }
        let file = path.map(AtomicFile::create).transpose()?.map(|file| (file, Stages::listen()));
        Ok(Self { file, frames: Vec::new(), started: Instant::now() })
    }

    /// Whether anyone will read them.
    pub(crate) fn is_wanted(&self) -> bool {
        self.file.is_some()
    }

    /// Adds a frame.
    pub(crate) fn push(&mut self, frame: F) {
        self.frames.push(frame);
    }

    /// Milliseconds since the run began.
    pub(crate) fn wall_ms(&self) -> f64 {
        milliseconds(self.started.elapsed())
    }

    /// Writes the file.
    pub(crate) fn commit(self) -> Result<()> {
        let wall_ms = self.wall_ms();
        let Some((mut file, stages)) = self.file else { return Ok(()) };
        let run = RunStats {
            frames: &self.frames,
            simd: simd::in_use().to_string(),
            stages_ms: stages.take_milliseconds(),
            peak_memory_bytes: isv_study::peak_bytes(),
            wall_ms,
        };
        file.write_all((serde_json::to_string_pretty(&run)? + "\n").as_bytes())?;
        Ok(file.commit()?)
    }
}

/// A duration in milliseconds.
pub(crate) fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}

/// Megabits a second of what is shown for so long; 0 if that is no time.
pub(crate) fn megabits_per_second(bytes: u64, seconds: f64) -> f64 {
    if seconds > 0.0 { bytes as f64 * 8.0 / seconds / 1e6 } else { 0.0 }
}
