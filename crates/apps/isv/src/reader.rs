//! Streams to frames.

use crate::event::{EventHandler, observer};
use crate::{Error, ErrorKind, Event, Frame};
use isv_decode::Lod;
use isv_format::StreamHeader;
use isv_take::stream::{
    self, AfterLoss, ByteSource, ConcealingFrames, DecodeSettings, StreamError, StreamFrame, StreamFrames,
};
use isv_take::{Device, FrameRange, Input, MemoryLimit, OpenDevice};
use std::io::Read;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// Reads the frames of a stream in order, or from any frame on. An iterator over frames, too.
pub struct Reader {
    input: Input,
    name: String,
    header: Option<StreamHeader>,
    /// Bytes that cannot be query in, until they are read.
    source: Option<ByteSource>,
    /// Number of frames, of a file.
    frames: Option<usize>,
    lod: Lod,
    after_loss: AfterLoss,
    colour: bool,
    device: Device,
    memory: MemoryLimit,
    events: Option<EventHandler>,
    start: usize,
    running: Option<Running>,
    has_failed: bool,
}

struct Running {
    header: StreamHeader,
    frames: Box<dyn Iterator<Item = Result<StreamFrame, StreamError>> + Send>,
}

impl Reader {
    /// Opens a stream in a file.
    ///
    /// # Errors
    /// [`ErrorKind::Input`] for a file that cannot be read, [`ErrorKind::Stream`] for one that is no stream.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        let input = Input::from(path);
        let (_, header) = stream::open(&input, MemoryLimit::default())?;
        let frames = stream::load_index(&input).ok().map(|index| index.frames.len());
        Ok(Self { header: Some(header), frames, ..Self::with_source(input.name(), input, None) })
    }

    /// Reads a stream from bytes as they come, such as a socket's. `name` is theirs in errors. No byte is read before the first frame
    /// is asked for.
    #[must_use]
    pub fn from_read(name: &str, source: impl Read + Send + 'static) -> Self {
        Self::with_source(name.to_owned(), Input::StandardInput, Some(Box::new(source)))
    }

    fn with_source(name: String, input: Input, source: Option<ByteSource>) -> Self {
        Self {
            input,
            name,
            header: None,
            source,
            frames: None,
            lod: Lod::Full,
            after_loss: AfterLoss::Stop,
            colour: true,
            device: Device::Cpu,
            memory: MemoryLimit::default(),
            events: None,
            start: 0,
            running: None,
            has_failed: false,
        }
    }

    /// Decodes at a level of detail.
    #[must_use]
    pub fn lod(mut self, lod: Lod) -> Self {
        self.lod = lod;
        self
    }

    /// Chooses what is done where packets are damaged or missing.
    #[must_use]
    pub fn after_loss(mut self, after_loss: AfterLoss) -> Self {
        self.after_loss = after_loss;
        self
    }

    /// Leaves colour out, which saves the time to decode it.
    #[must_use]
    pub fn without_colour(mut self) -> Self {
        self.colour = false;
        self
    }

    /// Chooses the device that does the arithmetic.
    #[must_use]
    pub fn device(mut self, device: Device) -> Self {
        self.device = device;
        self
    }

    /// Limits the memory for a frame (bytes). Without a limit a frame has 3 billion voxels at most, and no more than the stream's bytes
    /// make likely.
    #[must_use]
    pub fn memory_limit(mut self, bytes: u64) -> Self {
        self.memory = MemoryLimit { bytes: Some(bytes) };
        self
    }

    /// Takes events: damage that was met, a GPU that was given up.
    #[must_use]
    pub fn on_event(mut self, handler: impl Fn(&Event) + Send + Sync + 'static) -> Self {
        self.events = Some(Arc::new(handler));
        self
    }

    /// Number of frames, if the stream is a file with a sound index.
    #[must_use]
    pub fn frames(&self) -> Option<usize> {
        self.frames
    }

    /// Nominal time from frame to frame, once the header was read: at once for files.
    #[must_use]
    pub fn frame_duration(&self) -> Option<Duration> {
        self.header().map(|header| Duration::from_nanos(header.frame_rate.timestamp_ns(1)))
    }

    /// Edge of a voxel at full resolution (m), once the header was read: at once for files.
    #[must_use]
    pub fn voxel_m(&self) -> Option<f64> {
        self.header().map(|header| header.grid.voxel_size.metres())
    }

    /// Goes to a frame: the next one that is read. Frames since the keyframe before it are decoded on the way.
    ///
    /// # Errors
    /// [`ErrorKind::Options`] for bytes that cannot be query in, and for a frame that is not there.
    pub fn seek(&mut self, frame: usize) -> Result<(), Error> {
        if self.input.path().is_none() {
            return Err(Error::new(ErrorKind::Options, format!("{}: only files can be query in", self.name)));
        }
        if let Some(frames) = self.frames.filter(|frames| frame >= *frames) {
            let why = format!("{}: frame {frame} asked for, but there are {frames}", self.name);
            return Err(Error::new(ErrorKind::Options, why));
        }
        (self.start, self.running, self.has_failed) = (frame, None, false);
        Ok(())
    }

    /// Reads the next frame; `None` behind the last one.
    ///
    /// # Errors
    /// See [`Error::kind`]. No frame follows an error, but after [`Self::seek`].
    pub fn next_frame(&mut self) -> Result<Option<Frame>, Error> {
        if self.has_failed {
            return Ok(None);
        }
        let frame = self.read();
        self.has_failed = frame.is_err();
        frame
    }

    fn read(&mut self) -> Result<Option<Frame>, Error> {
        let running = match self.running.take() {
            Some(running) => running,
            None => self.begin()?,
        };
        let Running { header, frames } = self.running.insert(running);
        frames.next().map(|frame| Frame::new(frame?, header, self.memory)).transpose()
    }

    fn begin(&mut self) -> Result<Running, Error> {
        let observer = observer(self.events.clone());
        let device = OpenDevice::open_for(self.device, None, self.lod, &*observer)?;
        let frames = (self.start > 0).then_some(FrameRange { start: self.start, end: FrameRange::OPEN });
        let settings = DecodeSettings {
            frames,
            lod: self.lod,
            colour: self.colour,
            device,
            memory: self.memory,
            observer,
        };
        let source = match (self.source.take(), self.input.path()) {
            (Some(source), _) => Some(source),
            (None, Some(_)) => None,
            (None, None) => return Err(Error::new(ErrorKind::Input, "the bytes were read already")),
        };
        Ok(match (self.after_loss, source) {
            (AfterLoss::Stop, None) => Running::whole(StreamFrames::open(&self.input, &settings)?),
            (AfterLoss::Stop, Some(source)) => {
                Running::whole(StreamFrames::from_source(&self.name, source, &settings)?)
            }
            (_, None) => Running::concealing(ConcealingFrames::open(&self.input, &settings)?),
            (_, Some(source)) => {
                Running::concealing(ConcealingFrames::from_source(&self.name, source, &settings)?)
            }
        })
    }

    fn header(&self) -> Option<&StreamHeader> {
        self.running.as_ref().map(|running| &running.header).or(self.header.as_ref())
    }
}

impl Running {
    fn whole(frames: StreamFrames) -> Self {
        Self { header: *frames.header(), frames: Box::new(frames) }
    }

    fn concealing(frames: ConcealingFrames) -> Self {
        Self { header: *frames.header(), frames: Box::new(frames) }
    }
}

impl Iterator for Reader {
    type Item = Result<Frame, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_frame().transpose()
    }
}

impl std::fmt::Debug for Reader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Reader")
            .field("name", &self.name)
            .field("frames", &self.frames)
            .finish_non_exhaustive()
    }
}
