//! Frames to a stream, one by one as they come.

use super::coding::Coding;
use super::describe::{MetadataDraft, stream_up};
use super::job::StreamSink;
use super::two_pass::Steps;
use super::volumes::VolumeMaker;
use super::{
    EncodeError, EncodeOptions, FrameReport, OptionName, OptionsError, Report, VoxelChoice, spacing,
};
use crate::capture::{CapturedFrame, Content};
use crate::{Observer, OpenDevice};
use isv_encode::EncoderSettings;
use isv_format::{PacketWriter, StreamHeader};
use isv_volume::{ColourView, SparseVolume};
use std::io::Write;
use std::sync::Arc;
use std::time::SystemTime;

/// Encodes frames one by one. What options leave open is decided by the first frame, which writes the header.
pub struct FrameEncoder<W: Write> {
    options: EncodeOptions,
    device: OpenDevice,
    observer: Arc<dyn Observer>,
    stage: Stage<W>,
}

enum Stage<W: Write> {
    /// No frame has come yet.
    Waiting(W),
    /// The header is written.
    Running(Box<Running<W>>),
    /// The sink or the device failed: nothing can follow.
    Failed,
}

struct Running<W: Write> {
    maker: VolumeMaker,
    coding: Coding,
    stream: StreamSink<W>,
}

/// What the first frame decides.
struct Decided {
    header: StreamHeader,
    settings: EncoderSettings,
    maker: VolumeMaker,
    coding: Coding,
    up: Option<String>,
}

impl<W: Write> FrameEncoder<W> {
    /// Makes an encoder that writes to a sink. Nothing is written before the first frame.
    ///
    /// # Errors
    /// [`OptionsError`] for options that contradict each other, are out of range or need the whole take at once.
    pub fn new(
        sink: W,
        options: &EncodeOptions,
        device: OpenDevice,
        observer: &Arc<dyn Observer>,
    ) -> Result<Self, OptionsError> {
        options.header(None, None)?;
        if options.voxel == VoxelChoice::Auto {
            return Err(OptionsError::NeedsTake(OptionName::AutoVoxel));
        }
        if options.main.two_pass_rate().is_some() {
            return Err(OptionsError::NeedsTake(OptionName::Passes));
        }
        let (options, observer) = (options.clone(), Arc::clone(observer));
        Ok(Self { options, device, observer, stage: Stage::Waiting(sink) })
    }

    /// Encodes the next frame. `timestamp_ns`: when it was taken, in nanoseconds from any start; without it, frames come at the
    /// frame rate. A frame that is refused has no effect, and others may follow it.
    ///
    /// # Errors
    /// [`EncodeError::Frame`] for a frame that cannot be used, other variants for what ends the stream.
    pub fn push(&mut self, content: Content, timestamp_ns: Option<u64>) -> Result<FrameReport, EncodeError> {
        self.push_with_views(content, Vec::new(), timestamp_ns)
    }

    /// Encodes the next frame, whose depth images have colour images beside them. See [`Self::push`].
    ///
    /// # Errors
    /// [`EncodeError`], as of [`Self::push`].
    pub fn push_with_views(
        &mut self,
        content: Content,
        views: Vec<ColourView>,
        timestamp_ns: Option<u64>,
    ) -> Result<FrameReport, EncodeError> {
        let number = match &self.stage {
            Stage::Running(running) => running.stream.frames,
            _ => 0,
        };
        let name = format!("frame {number}");
        let frame = CapturedFrame { timestamp_ns, views, ..CapturedFrame::new(number, name, content) };
        let read = SystemTime::now();
        let mut decided = match self.stage {
            Stage::Waiting(_) => Some(self.decide(&frame)?),
            _ => None,
        };
        let maker = match (&mut decided, &mut self.stage) {
            (Some(decided), _) => &mut decided.maker,
            (None, Stage::Running(running)) => &mut running.maker,
            (None, _) => return Err(EncodeError::Ended),
        };
        let volume = maker.ingest(frame, read).inspect_err(|error| {
            if error.is_device() {
                self.stage = Stage::Failed;
            }
        })?;
        // A frame that is refused decides nothing.
        if let Some(decided) = decided {
            self.start(decided)?;
        }
        let Stage::Running(running) = &mut self.stage else { return Err(EncodeError::Ended) };
        let coded = running.coding.code(volume);
        let written = coded.and_then(|frame| running.stream.write(frame, &*self.observer));
        if written.is_err() {
            // Part of a packet may be out, or the frames to come would be predicted from one that is not in the stream.
            self.stage = Stage::Failed;
        }
        written
    }

    /// Completes the stream; one without a frame has the header of its options.
    ///
    /// # Errors
    /// [`EncodeError::Write`] if the sink fails, and [`EncodeError::Ended`] if it has before.
    pub fn finish(mut self) -> Result<(W, Report), EncodeError> {
        if let Stage::Waiting(_) = self.stage {
            let header = self.options.header(None, None)?;
            let empty = SparseVolume::empty(header.grid);
            let frame = CapturedFrame::new(0, String::new(), Content::Volume(empty));
            let decided = self.decide(&frame)?;
            self.start(decided)?;
        }
        let Stage::Running(running) = self.stage else { return Err(EncodeError::Ended) };
        let Running { maker, stream, .. } = *running;
        let report = stream.report(None, maker.surface.get().and_then(|surface| surface.shell_mm), false);
        Ok((PacketWriter::finish(stream.packets)?, report))
    }

    /// Decides what is open by the first frame.
    fn decide(&self, first: &CapturedFrame) -> Result<Decided, EncodeError> {
        let (options, observer) = (&self.options, &self.observer);
        let grid = match &first.content {
            Content::Volume(volume) | Content::Decoded(volume) => Some(*volume.grid()),
            Content::Geometry(_) | Content::Depth(_) => None,
        };
        let mut header = options.header(grid, None)?;
        if options.voxel == VoxelChoice::Fit
            && grid.is_none()
            && let Some(need) = spacing::of_frame(options, first, header.grid)
        {
            header.grid.voxel_size = spacing::announce(need, &**observer);
            header.profile = options.profile(&header.grid)?;
        }
        if options.colour.is_expected || first.has_colour() {
            header = header.with_colour(options.colour_layers(&header));
        }
        header = options.metadata.versioned(header);
        let settings = options.encoder_settings(&header);
        let steps = Steps { settings, colour_scale: 1.0 };
        let coding = Coding::open(options, &header, steps, &self.device, 0, observer)?;
        let maker = options.volume_maker(&header, self.device.clone(), 0, observer);
        Ok(Decided { header, settings, maker, coding, up: stream_up(options, grid.is_none(), None) })
    }

    /// Writes the header.
    fn start(&mut self, decided: Decided) -> Result<(), EncodeError> {
        let Stage::Waiting(sink) = std::mem::replace(&mut self.stage, Stage::Failed) else {
            return Err(EncodeError::Ended);
        };
        let Decided { header, settings, maker, coding, up } = decided;
        let draft = MetadataDraft::new(&self.options, &header, up, &maker.surface);
        let stream = StreamSink::new(sink, &header, settings.main.target, &self.options, draft)?;
        self.stage = Stage::Running(Box::new(Running { maker, coding, stream }));
        Ok(())
    }
}
