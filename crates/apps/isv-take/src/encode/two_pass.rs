//! The steps that meet a rate, one for all frames, found by coding everything with others.

use super::coding::Coding;
use super::describe::MetadataDraft;
use super::job::{StreamSink, pipeline};
use super::{EncodeError, EncodeOptions, TimestampSource};
use crate::capture::Capture;
use crate::{Cancellation, Input, OpenDevice, Up};
use isv_encode::{COARSEST_STEP, ColourShare, ColourSplit, EncoderSettings, FINEST_STEP, FrameQuality};
use isv_format::StreamHeader;
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
/// Bytes of colour fall with about this power of the scale of its steps.
const COLOUR_EXPONENT: f64 = 1.6;
/// What two passes may say it is.
const EXPONENTS: std::ops::RangeInclusive<f64> = 0.3..=1.5;

/// Steps of a take.
#[derive(Clone, Copy, Debug)]
pub(super) struct Steps {
    /// Settings of geometry, with its step.
    pub(super) settings: EncoderSettings,
    /// Factor on the steps of colour.
    pub(super) colour_scale: f64,
}

impl Steps {
    fn with(mut settings: EncoderSettings, step: f64, colour_scale: f64) -> Self {
        settings.main.quality = FrameQuality { step: step as f32, ..settings.main.quality };
        Self { settings, colour_scale }
    }
}

/// The steps at which the stream has about `rate` bits a second.
pub(super) fn steps_for_rate(
    input: &Input,
    options: &EncodeOptions,
    header: &StreamHeader,
    settings: EncoderSettings,
    rate: f64,
    watch: &mut dyn Watch,
) -> Result<Steps, EncodeError> {
    let is_joint = options.colour_share(header) == ColourShare::Joint;
    let mut split = ColourSplit::default();
    let mut step = f64::from(settings.main.quality.step);
    let mut exponent = EXPONENT;
    let mut best = (f64::INFINITY, Steps::with(settings, step, 1.0));
    let mut last: Option<(f64, f64)> = None;
    for pass in 0..PASSES {
        let colour_scale = if is_joint { split.scale(step) } else { 1.0 };
        let steps = Steps::with(settings, step, colour_scale);
        let [geometry, colour] = measure_rates(input, options, header, &steps, watch)?;
        let mut excess = ((geometry + colour) / rate).ln();
        // What is too large is taken if nothing else is there.
        let badness = if excess > MOST_EXCESS { 1.0 / TOLERANCE + excess } else { excess.abs() };
        if badness < best.0 {
            best = (badness, steps);
        }
        if excess.abs() < TOLERANCE {
            break;
        }
        if is_joint && pass == 0 {
            split = ColourSplit::of_bits([geometry, colour], step, colour_scale);
            // As it would be with this split.
            let of_colour = colour * (split.scale(step) / colour_scale).powf(-COLOUR_EXPONENT);
            excess = ((geometry + of_colour) / rate).ln();
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
    Ok(best.1)
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

/// Bits a second of the stream with some steps: of geometry with all that is not colour, and of colour.
fn measure_rates(
    input: &Input,
    options: &EncodeOptions,
    header: &StreamHeader,
    steps: &Steps,
    watch: &mut dyn Watch,
) -> Result<[f64; 2], EncodeError> {
    // What is to be said of the frames is said when they are coded for good.
    let silent: Arc<dyn crate::Observer> = Arc::new(|_: &crate::Event| {});
    let cancellation = watch.cancellation().clone();
    let capture = Capture::open(input, &options.hints(&silent)?)?;
    let skip_bad_frames = options.skip_bad_frames && capture.frames_stand_alone();
    let range = capture.range(options.frames)?;
    watch.begin(range.len());
    // When a pass reads a frame says nothing of when the last one will.
    let timestamps = match options.timestamps {
        TimestampSource::Clock => TimestampSource::Rate,
        other => other,
    };
    let options = &EncodeOptions { measures_change: false, timestamps, ..options.clone() };
    let keeps_times = capture.keeps_times(header.frame_rate);
    let maker = options.volume_maker(header, OpenDevice::CPU, range.start, &silent);
    let coding = Coding::open(options, header, *steps, &OpenDevice::CPU, range.start, &silent)?;
    // Its bytes count. The axis takes a byte, whichever it is.
    let draft = MetadataDraft::new(options, header, Some(Up::Y.name().to_owned()), &maker.surface);
    let mut stream = StreamSink::new(ByteCount(0), header, steps.settings.main.target, options, draft)?;
    (stream.first, stream.keeps_times) = (range.start, keeps_times);
    let mut colour = 0;
    for frame in pipeline(capture.read(range)?, maker, coding, options.takes_turns, &cancellation) {
        match frame.and_then(|frame| stream.write(frame, &*silent)) {
            Ok(frame) => colour += frame.bytes_colour,
            Err(_) if skip_bad_frames => {}
            Err(error) => return Err(error),
        }
        watch.step();
    }
    if cancellation.is_cancelled() {
        return Err(EncodeError::CancelledBeforeLastPass);
    }
    if stream.frames == 0 {
        return Err(EncodeError::NoFrames { name: input.name(), skipped: None });
    }
    let seconds = stream.timeline.end_s();
    let all = stream.packets.finish()?.0;
    Ok([all - colour as u64, colour as u64].map(|bytes| bytes as f64 * 8.0 / seconds))
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
