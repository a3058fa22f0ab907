//! A whole capture to a stream.

use super::coding::{CodedFrame, Coding};
use super::describe::{MetadataDraft, stream_up};
use super::spacing::{self, Need};
use super::timestamps::Timestamps;
use super::two_pass::{Steps, Watch};
use super::volumes::{IngestedFrame, VolumeMaker};
use super::{
    EncodeError, EncodeEvent, EncodeOptions, FrameError, OptionName, OptionsError, VoxelChoice, auto_voxel,
    two_pass,
};
use crate::capture::{Capture, CapturedFrame, ContentKind, Frames, Remark};
use crate::stream::timed;
use crate::timeline::Timeline;
use crate::{Cancellation, Event, Input, Length, Observer, OpenDevice, Prefetch};
use isv_encode::{EncodedFrame, EncoderSettings, FrameWriter, RateTarget};
use isv_format::{ColourLayers, PacketWriter, StreamHeader};
use isv_volume::Grid;
use std::io::Write;
use std::ops::Range;
use std::sync::Arc;
use std::time::SystemTime;

/// A capture and all that is decided before its first frame is coded.
pub struct Job {
    input: Input,
    header: StreamHeader,
    settings: EncoderSettings,
    frames: Frames<CapturedFrame>,
    range: Range<usize>,
    maker: VolumeMaker,
    coding: Coding,
    remarks: Vec<Remark>,
    facts: Facts,
    cancellation: Cancellation,
    observer: Arc<dyn Observer>,
}

/// What is known of the capture.
struct Facts {
    comes_once: bool,
    skip_bad_frames: bool,
    /// Whether frames are shown when they were in the capture, which is a stream of this rate.
    keeps_times: bool,
    /// Size of the input files in bytes, if it is known.
    input_bytes: Option<u64>,
    takes_turns: bool,
    /// Axis of the stream that points up, if it is known.
    up: Option<String>,
    /// Frame at which the stream's time begins, and when it was taken, if that was asked for and the capture says.
    time_origin: usize,
    time_base_ns: Option<u64>,
    options: EncodeOptions,
}

/// What became of a frame.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct FrameReport {
    /// Number in the capture.
    pub number: usize,
    /// Bytes of the packet, its header included.
    pub bytes: usize,
    /// Bytes of these that are its colour.
    pub bytes_colour: usize,
    /// The frame as coded.
    pub coded: EncodedFrame,
    /// Blocks that ingest made, before any were left out.
    pub blocks_band: usize,
    /// Time from capture to volume, reading not included (ms).
    pub ingest_ms: f64,
    /// Time from volume to packet (ms).
    pub encode_ms: f64,
    /// Time to code its colour (ms).
    pub colour_ms: f64,
    /// Change of the field near the surface (m), if it is measured.
    pub surface_rms_m: Option<f64>,
}

/// What became of a take.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Report {
    /// Frames in the stream.
    pub frames: usize,
    /// Frames without a surface.
    pub empty: usize,
    /// Frames that were left out.
    pub skipped: usize,
    /// Size of the packets of all frames (bytes).
    pub bytes: u64,
    /// Time that the stream takes to show (s).
    pub seconds: f64,
    /// Size of the input files (bytes), if it is known.
    pub input_bytes: Option<u64>,
    /// Thickness of the shell around surfaces without inside (mm), if one was made.
    pub shell_mm: Option<f64>,
    /// What the stream states for all frames.
    pub header: StreamHeader,
    /// Whether the job was cancelled, so that the stream holds the first frames alone.
    pub is_cancelled: bool,
}

/// A take that could not be encoded to its end.
pub struct Unfinished<W: Write> {
    /// What went wrong.
    pub error: EncodeError,
    /// The stream up to there, if there is one.
    pub stream: Option<UnfinishedStream<W>>,
}

/// A stream that ends before its take. Its frames are whole.
pub struct UnfinishedStream<W: Write> {
    /// The stream without its index and end.
    pub writer: PacketWriter<W>,
    /// Frames written.
    pub frames: usize,
    /// Whether the input cannot be read again.
    pub comes_once: bool,
}

impl Job {
    /// Checks the options and decides what they leave open: for some of them by reading frames of the capture or coding them.
    ///
    /// # Errors
    /// See [`EncodeError`].
    pub fn prepare(
        capture: Capture,
        options: &EncodeOptions,
        open_device: impl FnOnce() -> Result<OpenDevice, crate::DeviceError>,
        observer: &Arc<dyn Observer>,
        watch: &mut dyn Watch,
    ) -> Result<Self, EncodeError> {
        let input = &capture.input().clone();
        let source = capture.metadata();
        let options = &EncodeOptions { metadata: options.metadata.or(source.as_ref()), ..options.clone() };
        let mut header = options.header(capture.grid(), capture.frame_rate())?;
        let range = capture.range(options.frames)?;
        let time_origin = options.time_origin.unwrap_or(range.start);
        if time_origin > range.start {
            let (option, what) = (OptionName::TimeOrigin, "no frame behind the first that is coded");
            return Err(OptionsError::Range { option, what }.into());
        }
        let time_base_ns = options.time_origin.and_then(|origin| capture.stated_ns(origin));
        let (comes_once, counted) = (capture.frames().is_none(), capture.counted().map(drop));
        let facts = Facts {
            comes_once,
            skip_bad_frames: options.skip_bad_frames && capture.frames_stand_alone(),
            keeps_times: capture.keeps_times(header.frame_rate),
            input_bytes: capture.bytes(&range),
            takes_turns: options.takes_turns,
            up: stream_up(options, capture.content() != ContentKind::Volume, source.as_ref()),
            time_origin,
            time_base_ns,
            options: options.clone(),
        };
        let cancellation = watch.cancellation().clone();
        let (grid, remarks, has_colour) = (header.grid, capture.remarks(), capture.has_colour());
        let (frames, need) =
            frames_and_need(input, options, capture, range.clone(), grid, observer, &cancellation)?;
        let fits = need.is_some();
        if let Some(need) = need {
            // Steps of profile paper are lengths, and count in voxels.
            header.grid.voxel_size = spacing::announce(need, &**observer);
            header.profile = options.profile(&header.grid)?;
        }
        let (frames, has_colour) = match (options.colour_layers(&header), has_colour) {
            (ColourLayers::None, _) => (frames, false),
            _ if options.colour.is_expected => (frames, true),
            (_, Some(known)) => (frames, known),
            (_, None) => with_room_for_colour(frames, options, comes_once, &cancellation)?,
        };
        if has_colour {
            header = header.with_colour(options.colour_layers(&header));
        }
        header = options.metadata.versioned(header);
        let steps = settings(input, options, counted, &mut header, fits, observer, watch)?;
        let device = open_device()?;
        let maker = options.volume_maker(&header, device.clone(), range.start, observer);
        let coding = Coding::open(options, &header, steps, &device, range.start, observer)?;
        let (input, settings, observer) = (input.clone(), steps.settings, Arc::clone(observer));
        Ok(Self {
            input,
            header,
            settings,
            frames,
            range,
            maker,
            coding,
            remarks,
            facts,
            cancellation,
            observer,
        })
    }

    /// What the stream will state for all frames.
    #[must_use]
    pub fn header(&self) -> &StreamHeader {
        &self.header
    }

    /// The encoder's settings.
    pub(super) fn settings(&self) -> &EncoderSettings {
        &self.settings
    }

    /// Number of frames that there are to code, if it is known.
    #[must_use]
    pub fn frames(&self) -> Option<usize> {
        (!self.facts.comes_once).then_some(self.range.len())
    }

    /// Codes all frames into a sink. `on_frame` gets a report of each, and `None` for each that was left out.
    ///
    /// What comes back is the stream without its index and end, which [`PacketWriter::finish`] writes.
    ///
    /// # Errors
    /// [`Unfinished`]: what went wrong, and the stream up to there.
    pub fn run<W: Write>(
        self,
        sink: W,
        mut on_frame: impl FnMut(Option<FrameReport>),
    ) -> Result<(PacketWriter<W>, Report), Box<Unfinished<W>>> {
        let Self {
            input,
            header,
            settings,
            frames,
            maker,
            coding,
            remarks,
            facts,
            cancellation,
            observer,
            ..
        } = self;
        for remark in remarks {
            observer.event(&Event::Encode(EncodeEvent::Capture { name: input.name(), remark }));
        }
        let surface = Arc::clone(&maker.surface);
        let failed = |error| Box::new(Unfinished { error, stream: None });
        let target = settings.main.target;
        let draft = MetadataDraft::new(&facts.options, &header, facts.up.clone(), &surface);
        let mut stream = StreamSink::new(sink, &header, target, &facts.options, draft).map_err(failed)?;
        (stream.first, stream.keeps_times) = (facts.time_origin, facts.keeps_times);
        if let Some(base_ns) = facts.time_base_ns.filter(|_| facts.keeps_times) {
            stream.timestamps = stream.timestamps.since(base_ns);
        }
        for frame in pipeline(frames, maker, coding, facts.takes_turns, &cancellation) {
            match frame.and_then(|frame| stream.write(frame, &*observer)) {
                Ok(report) => on_frame(Some(report)),
                Err(error) if facts.skip_bad_frames && !error.is_device() && error.is_frame() => {
                    stream.skipped += 1;
                    observer.event(&Event::Encode(EncodeEvent::Skipped { why: Arc::new(error) }));
                    on_frame(None);
                }
                Err(error) => {
                    let (frames, comes_once) = (stream.frames, facts.comes_once);
                    let stream = Some(UnfinishedStream { writer: stream.packets, frames, comes_once });
                    return Err(Box::new(Unfinished { error, stream }));
                }
            }
        }
        let is_cancelled = cancellation.is_cancelled();
        let is_part = facts.options.time_origin.is_some();
        stream.check(&input.name(), is_part, is_cancelled).map_err(failed)?;
        let report = stream.report(
            facts.input_bytes,
            surface.get().and_then(|surface| surface.shell_mm),
            is_cancelled,
        );
        Ok((stream.packets, report))
    }
}

/// The writing side of a stream.
pub(super) struct StreamSink<W: Write> {
    /// Metadata, until the first frame is written.
    metadata: Option<MetadataDraft>,
    header: StreamHeader,
    frame_writer: FrameWriter,
    pub(super) packets: PacketWriter<W>,
    /// What the encoder aims at, until it was said that it is out of reach.
    target: Option<RateTarget>,
    timestamps: Timestamps,
    pub(super) keeps_times: bool,
    pub(super) timeline: Timeline,
    /// Number in the capture of the frame that the stream's time begins with.
    pub(super) first: usize,
    pub(super) frames: usize,
    empty: usize,
    skipped: usize,
    /// Size of the packets of all frames.
    bytes: u64,
}

impl<W: Write> StreamSink<W> {
    pub(super) fn new(
        sink: W,
        header: &StreamHeader,
        target: RateTarget,
        options: &EncodeOptions,
        metadata: Option<MetadataDraft>,
    ) -> Result<Self, EncodeError> {
        Ok(Self {
            metadata,
            header: *header,
            frame_writer: FrameWriter::default(),
            packets: PacketWriter::new(sink, header)?,
            target: Some(target),
            timestamps: Timestamps::new(options.timestamps, header.frame_rate),
            keeps_times: true,
            timeline: Timeline::new(header.frame_rate),
            first: 0,
            frames: 0,
            empty: 0,
            skipped: 0,
            bytes: 0,
        })
    }

    /// Writes a frame, which keeps its time if frames before it were skipped.
    pub(super) fn write(
        &mut self,
        frame: CodedFrame,
        observer: &dyn Observer,
    ) -> Result<FrameReport, EncodeError> {
        let CodedFrame {
            number,
            read,
            timestamp_ns,
            frame,
            ingest_ms,
            has_surface,
            is_lost,
            blocks_band,
            coding_ms,
            surface_rms_voxels,
            colour,
            colour_ms,
        } = frame;
        let (coded, writing_ms) = timed(|| self.frame_writer.write(frame));
        self.tell_missed_error(number, &coded, observer);
        if is_lost {
            observer.event(&Event::Encode(EncodeEvent::NothingLeft { frame: number }));
        }
        let stated = timestamp_ns.filter(|_| self.keeps_times);
        let timestamp_ns = self.timestamps.of((number - self.first) as u64, read, stated);
        self.timeline.place(timestamp_ns);
        if let Some(text) = self.metadata.take().and_then(MetadataDraft::finish) {
            self.packets.write_metadata(&text)?;
        }
        let colour_part = colour.as_ref().map(|colour| &colour.bytes[..]);
        let bytes =
            self.packets.write_coloured_frame(coded.keyframe, timestamp_ns, &coded.payload(), colour_part)?;
        self.frames += 1;
        self.bytes += bytes as u64;
        self.empty += usize::from(!has_surface);
        let voxel_m = self.header.grid.voxel_size.metres();
        let surface_rms_m = surface_rms_voxels.map(|voxels| voxels * voxel_m);
        let encode_ms = coding_ms + writing_ms;
        let bytes_colour = colour.map_or(0, |colour| colour.bytes.len());
        Ok(FrameReport {
            number,
            bytes,
            bytes_colour,
            coded,
            blocks_band,
            ingest_ms,
            encode_ms,
            colour_ms,
            surface_rms_m,
        })
    }

    /// Tells once that a frame could not be brought within the error asked for.
    fn tell_missed_error(&mut self, number: usize, frame: &EncodedFrame, observer: &dyn Observer) {
        let (Some(RateTarget::MaxError(bound)), Some(error)) = (self.target, frame.surface_distance_voxels)
        else {
            return;
        };
        if error > bound {
            self.target = None;
            let voxel_m = self.header.grid.voxel_size.metres();
            let [error, bound] = [error, bound].map(|voxels| Length::from_metres(voxels * voxel_m));
            observer.event(&Event::Encode(EncodeEvent::ErrorMissed { frame: number, error, bound }));
        }
    }

    /// Refuses a stream in which nothing is, unless it is a part of a take: there may be nobody on stage in it.
    pub(super) fn check(&self, name: &str, is_part: bool, is_cancelled: bool) -> Result<(), EncodeError> {
        let name = name.to_owned();
        match (self.frames, is_cancelled) {
            (0, true) => Err(EncodeError::CancelledBeforeFirstFrame),
            (0, false) => Err(EncodeError::NoFrames { name, skipped: Some(self.skipped) }),
            (frames, false) if self.empty == frames && !is_part => Err(EncodeError::NoSurface { name }),
            _ => Ok(()),
        }
    }

    pub(super) fn report(
        &self,
        input_bytes: Option<u64>,
        shell_mm: Option<f64>,
        is_cancelled: bool,
    ) -> Report {
        Report {
            frames: self.frames,
            empty: self.empty,
            skipped: self.skipped,
            bytes: self.bytes,
            seconds: self.timeline.end_s(),
            input_bytes,
            shell_mm,
            header: self.header,
            is_cancelled,
        }
    }
}

/// The steps that code a capture; the header's voxel size changes if that is to be found out by coding. `counted`: an error if the
/// capture cannot be read more than once. `fits`: whether the voxel size was chosen already.
fn settings(
    input: &Input,
    options: &EncodeOptions,
    counted: Result<(), super::CaptureError>,
    header: &mut StreamHeader,
    fits: bool,
    observer: &Arc<dyn Observer>,
    watch: &mut dyn Watch,
) -> Result<Steps, EncodeError> {
    let voxel_is_auto = options.voxel == VoxelChoice::Auto && !fits;
    let mut settings = options.encoder_settings(header);
    let rate = options.main.two_pass_rate();
    if voxel_is_auto || rate.is_some() {
        counted?;
    }
    if voxel_is_auto {
        let choice = auto_voxel::choose(input, options, header, &settings, observer)?;
        header.grid.voxel_size = choice.voxel;
        settings = options.encoder_settings(header);
        settings.main.quality = choice.quality.unwrap_or(settings.main.quality);
    }
    match rate {
        Some(rate) => two_pass::steps_for_rate(input, options, header, settings, rate, watch),
        None => Ok(Steps { settings, colour_scale: 1.0 }),
    }
}

/// The frames to encode, and what they need of a voxel if nobody gave its size. A pipe is read up to its first frame for that.
fn frames_and_need(
    input: &Input,
    options: &EncodeOptions,
    capture: Capture,
    range: Range<usize>,
    grid: Grid,
    observer: &Arc<dyn Observer>,
    cancellation: &Cancellation,
) -> Result<(Frames<CapturedFrame>, Option<Need>), EncodeError> {
    let is_sampled = matches!(capture.content(), ContentKind::Geometry | ContentKind::Depth);
    if !is_sampled || !options.voxel_is_open(&capture) {
        return Ok((capture.read_since(options.time_origin, range)?, None));
    }
    if capture.frames().is_some() {
        let need = spacing::of_frames(input, options, &range, grid, observer)?;
        return Ok((capture.read_since(options.time_origin, range)?, need));
    }
    // On a thread of its own, so that the user can interrupt the wait.
    let mut frames = Prefetch::new(capture.read_since(options.time_origin, range)?, cancellation);
    let first = frames.next();
    let need = first.as_ref().and_then(|frame| spacing::of_frame(options, frame.as_ref().ok()?, grid));
    Ok((Box::new(first.into_iter().chain(frames)), need))
}

/// The frames, and whether the stream gets room for colours. The first frame with anything in it says so: a take may begin with an empty
/// stage. What comes once may be live and cannot wait for it: there is room then. Fails by a bad frame before, unless these are skipped.
fn with_room_for_colour(
    mut frames: Frames<CapturedFrame>,
    options: &EncodeOptions,
    comes_once: bool,
    cancellation: &Cancellation,
) -> Result<(Frames<CapturedFrame>, bool), FrameError> {
    if comes_once {
        // On a thread of its own, so that the user can interrupt the wait.
        let mut frames = Prefetch::new(frames, cancellation);
        let first = frames.next();
        let has_room = matches!(&first, Some(Ok(frame)) if frame.has_colour() || frame.is_empty());
        return Ok((Box::new(first.into_iter().chain(frames)), has_room));
    }
    let mut held = Vec::new();
    let mut has_room = true;
    while let Some(frame) = frames.next().filter(|_| !cancellation.is_cancelled()) {
        let frame = match frame {
            Err(_) if options.skip_bad_frames => frame,
            frame => Ok(frame?),
        };
        let is_something = matches!(&frame, Ok(frame) if !frame.is_empty());
        has_room = !is_something || matches!(&frame, Ok(frame) if frame.has_colour());
        held.push(frame);
        if is_something {
            break;
        }
    }
    Ok((Box::new(held.into_iter().chain(frames)), has_room))
}

/// The pipeline up to the writing of symbols. Reading runs ahead of everything else; making volumes runs ahead of coding them, and
/// that of writing, unless they are to take turns.
pub(super) fn pipeline(
    frames: Frames<CapturedFrame>,
    maker: VolumeMaker,
    coding: Coding,
    takes_turns: bool,
    cancellation: &Cancellation,
) -> Box<dyn Iterator<Item = Result<CodedFrame, EncodeError>>> {
    let volumes = ingested(frames, maker, cancellation);
    match takes_turns {
        true => Box::new(coding.code_all(volumes)),
        false => {
            let volumes = Prefetch::new(volumes, cancellation);
            Box::new(Prefetch::new(coding.code_all(volumes), cancellation))
        }
    }
}

/// Frames as volumes, read ahead.
fn ingested(
    frames: Frames<CapturedFrame>,
    mut maker: VolumeMaker,
    cancellation: &Cancellation,
) -> impl Iterator<Item = Result<IngestedFrame, EncodeError>> + use<> {
    let read = Prefetch::new(frames.map(|frame| (SystemTime::now(), frame)), cancellation);
    read.map(move |(read, frame): (SystemTime, Result<CapturedFrame, FrameError>)| maker.ingest(frame?, read))
}
