//! The one step that meets a rate, found by coding everything with others.

use super::job::ingested;
use super::{EncodeError, EncodeOptions};
use crate::capture::{Capture, Hints};
use crate::{Cancellation, Input, OpenDevice, Prefetch};
use isv_encode::{COARSEST_STEP, Encoder, EncoderSettings, FINEST_STEP, FrameQuality};
use isv_format::{ColourLayers, PacketWriter, StreamHeader};
use isv_io::Colours;
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
    input: &Input,
    options: &EncodeOptions,
    header: &StreamHeader,
    settings: EncoderSettings,
    rate: f64,
    watch: &mut dyn Watch,
) -> Result<EncoderSettings, EncodeError> {
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
        let excess = (measure_rate(input, options, header, with_step(step), watch)? / rate).ln();
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

/// Follows passes over the input, frame by frame.
pub trait Watch {
    /// A pass over so many frames begins.
    fn begin(&mut self, frames: usize);
    /// A frame was coded.
    fn step(&mut self);
    /// The request to stop early.
    fn cancellation(&self) -> &Cancellation;
}

/// Bits a second of the stream under settings.
fn measure_rate(
    input: &Input,
    options: &EncodeOptions,
    header: &StreamHeader,
    settings: EncoderSettings,
    watch: &mut dyn Watch,
) -> Result<f64, EncodeError> {
    // What is to be said of the frames is said when they are coded for good.
    let silent: Arc<dyn crate::Observer> = Arc::new(|_: &crate::Event| {});
    let cancellation = watch.cancellation().clone();
    // Colour has a quality of its own, and no part in the rate that is met.
    let header = &header.with_colour(ColourLayers::None);
    let hints = Hints { colours: Colours::Drop, ..options.hints(&silent)? };
    let capture = Capture::open(input, &hints)?;
    let skip_bad_frames = options.skip_bad_frames && capture.frames_stand_alone();
    let range = capture.range(options.frames)?;
    watch.begin(range.len());
    let maker = options.volume_maker(header, OpenDevice::CPU, &silent);
    let mut encoder = Encoder::new(header, settings);
    let mut writer = PacketWriter::new(ByteCount(0), header)?;
    let mut frames = 0u32;
    for frame in Prefetch::new(ingested(capture.read(range)?, maker, &cancellation), &cancellation) {
        match frame {
            Ok(frame) => {
                let coded = encoder.encode(&frame.volume);
                writer.write_frame(coded.keyframe, 0, &coded.payload())?;
                frames += 1;
            }
            Err(_) if skip_bad_frames => {}
            Err(error) => return Err(error),
        }
        watch.step();
    }
    if cancellation.is_cancelled() {
        return Err(EncodeError::CancelledBeforeLastPass);
    }
    if frames == 0 {
        return Err(EncodeError::NoFrames { name: input.name(), skipped: None });
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
