//! The one step that meets a rate, found by coding everything with others.

use super::{Args, ingested};
use crate::ahead::Ahead;
use crate::backend::Backend;
use crate::capture::Capture;
use crate::interrupt;
use crate::progress::Progress;
use crate::stream;
use anyhow::{Result, bail};
use isv::encode::{COARSEST_STEP, Encoder, EncoderSettings, FINEST_STEP, FrameQuality};
use isv::format::{PacketWriter, StreamHeader};
use std::io::{self, Write};
use std::sync::Arc;

/// Passes that measure, at most.
const PASSES: usize = 4;
/// Close enough to the rate, as a share of it.
const TOLERANCE: f64 = 0.01;
/// More above the rate than this is too large.
const MOST_EXCESS: f64 = 0.02;
/// Bytes fall with about this power of the step, until two passes say better.
const EXPONENT: f64 = 0.9;
/// What two passes may say it is.
const EXPONENTS: std::ops::RangeInclusive<f64> = 0.3..=1.5;

/// The settings with the step at which the stream has about `rate` bits a second.
pub(super) fn settings_for_rate(
    args: &Args,
    header: &StreamHeader,
    settings: EncoderSettings,
    rate: f64,
) -> Result<EncoderSettings> {
    let with_step = |step: f64| {
        let mut settings = settings;
        settings.main.quality = FrameQuality { step: step as f32, ..settings.main.quality };
        settings
    };
    let mut step = f64::from(settings.main.quality.step);
    let mut exponent = EXPONENT;
    let mut best = (f64::INFINITY, step);
    let mut last: Option<(f64, f64)> = None;
    for _ in 0..PASSES {
        let excess = (measure_rate(args, header, with_step(step))? / rate).ln();
        // What is too large is taken if nothing else is there.
        let badness = if excess > MOST_EXCESS { 1.0 / TOLERANCE + excess } else { excess.abs() };
        if badness < best.0 {
            best = (badness, step);
        }
        if excess.abs() < TOLERANCE {
            break;
        }
        if let Some((last_step, last_excess)) = last {
            let slope = (last_excess - excess) / (step / last_step).ln();
            exponent = slope.clamp(*EXPONENTS.start(), *EXPONENTS.end());
        }
        last = Some((step, excess));
        let next = (step * (excess / exponent).exp()).clamp(FINEST_STEP, COARSEST_STEP);
        if next == step {
            break;
        }
        step = next;
    }
    Ok(with_step(best.1))
}

/// Bits a second of the stream under settings.
fn measure_rate(args: &Args, header: &StreamHeader, settings: EncoderSettings) -> Result<f64> {
    let capture = Capture::open(&args.input, &args.hints()?)?;
    let skip_bad_frames = args.skip_bad_frames && capture.frames_stand_alone();
    let range = capture.range(args.frames)?;
    let progress = Arc::new(Progress::silent(Some(range.len()), "measuring"));
    let profile = args.header.profile_name();
    let maker = args.ingest.volume_maker(
        header.grid,
        profile,
        args.header.band(),
        Backend::CPU,
        Arc::clone(&progress),
        &args.hints()?,
    )?;
    let mut encoder = Encoder::new(header, settings);
    let mut writer = PacketWriter::new(ByteCount(0), header)?;
    let mut frames = 0u32;
    for frame in Ahead::new(ingested(capture.read(range)?, maker)) {
        match frame {
            Ok(frame) => {
                let coded = encoder.encode(&frame.volume);
                writer.write_frame(coded.keyframe, 0, &coded.payload())?;
                frames += 1;
            }
            Err(_) if skip_bad_frames => {}
            Err(error) => return Err(error),
        }
        progress.step();
    }
    if interrupt::requested() {
        bail!("interrupted before the last pass");
    }
    if frames == 0 {
        bail!("{}: no frame could be used", stream::name(&args.input));
    }
    let seconds = f64::from(frames) / header.frame_rate.per_second();
    Ok(writer.finish()?.0 as f64 * 8.0 / seconds)
}

/// Counts what is written.
#[derive(Debug)]
struct ByteCount(u64);

impl Write for ByteCount {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
