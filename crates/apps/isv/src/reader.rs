//! Streams to frames.

use crate::bytes::{SharedBytes, SharedSource};
use crate::event::{EventHandler, observer};
use crate::{Error, ErrorKind, Event, Frame};
use isv_decode::Lod;
use isv_format::{StreamHeader, StreamIndex};
#[cfg(feature = "io")]
use isv_take::metadata::Metadata;
use isv_take::stream::{
    self, AfterLoss, ByteSource, ConcealingFrames, DecodeSettings, SeekableBytes, StreamError, StreamFrame,
    StreamFrames,
};
use isv_take::{Device, FrameRange, Input, MemoryLimit, OpenDevice};
use std::cmp::Ordering;
use std::io::{Read, Seek};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// Reads the frames of a stream in order, or from any frame on. An iterator over frames, too.
pub struct Reader {
    source: Source,
    name: String,
    header: Option<StreamHeader>,
    /// Places of the frames, where the source can be sought in and its index is sound.
    index: Option<StreamIndex>,
    lod: Lod,
    after_loss: AfterLoss,
    colour: bool,
    device: Device,
    memory: MemoryLimit,
    events: Option<EventHandler>,
    /// Number of the first frame to read.
    start: usize,
    /// Number of the frame that comes next.
    next: usize,
    running: Option<Running>,
    has_failed: bool,
}

/// Place of a stream's bytes.
enum Source {
    /// In a file.
    File(Input),
    /// In bytes that can be sought in, which are opened anew for each start.
    Seekable(Box<dyn Fn() -> Box<dyn SeekableBytes> + Send>),
    /// In bytes that come once, until they are read.
    Once(Option<ByteSource>),
}

struct Running {
    header: StreamHeader,
    frames: Box<dyn Iterator<Item = Result<StreamFrame, StreamError>> + Send>,
}

impl Reader {
    /// Opens a stream in a file. A pipe with a name is read as [`Self::from_read`] reads bytes.
    ///
    /// # Errors
    /// [`ErrorKind::Input`] for a file that cannot be read, [`ErrorKind::Stream`] for one that is no stream.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        let input = Input::from(path);
        let name = input.name();
        if input.comes_once() {
            // The header of a pipe cannot be read before its frames.
            return Ok(Self::with_source(name, Source::Once(Some(stream::source(&input)?))));
        }
        let (_, header) = stream::open(&input, MemoryLimit::default())?;
        let index = stream::load_index(&input).ok();
        Ok(Self { header: Some(header), index, ..Self::with_source(name, Source::File(input)) })
    }

    /// Opens a stream in memory. `name` is its name in errors.
    ///
    /// # Errors
    /// [`ErrorKind::Stream`] for bytes that are no stream.
    pub fn from_bytes(name: &str, bytes: impl AsRef<[u8]> + Send + Sync + 'static) -> Result<Self, Error> {
        let bytes = SharedBytes::new(bytes);
        Self::with_seekable(name, Box::new(move || Box::new(bytes.open())))
    }

    /// Opens a stream in bytes that can be sought in, such as an archive's. `name` is its name in errors.
    ///
    /// # Errors
    /// [`ErrorKind::Input`] for bytes that cannot be read, [`ErrorKind::Stream`] for bytes that are no stream.
    pub fn from_seekable(name: &str, source: impl Read + Seek + Send + 'static) -> Result<Self, Error> {
        let source = SharedSource::new(source);
        Self::with_seekable(name, Box::new(move || Box::new(source.open())))
    }

    fn with_seekable(
        name: &str,
        open: Box<dyn Fn() -> Box<dyn SeekableBytes> + Send>,
    ) -> Result<Self, Error> {
        let header = stream::read_header(name, &mut stream::seekable(name, open())?)?;
        let index = stream::index_of(name, &mut stream::seekable(name, open())?).ok();
        let reader = Self::with_source(name.to_owned(), Source::Seekable(open));
        Ok(Self { header: Some(header), index, ..reader })
    }

    /// Reads a stream from bytes as they come, such as a socket's. `name` is theirs in errors. No byte is read before the first frame
    /// is asked for.
    #[must_use]
    pub fn from_read(name: &str, source: impl Read + Send + 'static) -> Self {
        Self::with_source(name.to_owned(), Source::Once(Some(Box::new(source))))
    }

    fn with_source(name: String, source: Source) -> Self {
        Self {
            source,
            name,
            header: None,
            index: None,
            lod: Lod::Full,
            after_loss: AfterLoss::Stop,
            colour: true,
            device: Device::Cpu,
            memory: MemoryLimit::default(),
            events: None,
            start: 0,
            next: 0,
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

    /// What the stream says of itself; `None` if it says nothing, and where bytes come once.
    ///
    /// # Errors
    /// [`ErrorKind::Input`] for a file that cannot be read any more.
    #[cfg(feature = "io")]
    pub fn metadata(&self) -> Result<Option<Metadata>, Error> {
        Ok(match &self.source {
            Source::File(input) => stream::metadata(input)?,
            Source::Seekable(open) => {
                stream::metadata_of(&self.name, Box::new(stream::seekable(&self.name, open())?))?
            }
            Source::Once(_) => None,
        })
    }

    /// Number of frames, unless bytes come once. Frames that are lost do not count, also where [`Self::after_loss`] shows the last one
    /// in their place.
    #[must_use]
    pub fn frames(&self) -> Option<usize> {
        self.index.as_ref().map(|index| index.frames.len())
    }

    /// Frames a second, once the header was read: at once unless bytes come once.
    #[must_use]
    pub fn fps(&self) -> Option<f64> {
        self.header().map(|header| header.frame_rate.per_second())
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

    /// Whether frames may have colour, once the header was read: at once unless bytes come once.
    #[must_use]
    pub fn has_colour(&self) -> Option<bool> {
        self.header().map(|header| header.colour_layers.count() > 0)
    }

    /// Goes to a frame: the next one that is read. Frames since the keyframe before it are decoded on the way.
    ///
    /// # Errors
    /// [`ErrorKind::Options`] for bytes that cannot be query in, and for a frame that is not there.
    pub fn seek(&mut self, frame: usize) -> Result<(), Error> {
        self.check_frame(frame)?;
        self.start_at(frame);
        Ok(())
    }

    /// Goes to the start, where there may be no frame.
    ///
    /// # Errors
    /// [`ErrorKind::Options`] for bytes that come once.
    pub fn rewind(&mut self) -> Result<(), Error> {
        self.check_seekable()?;
        self.start_at(0);
        Ok(())
    }

    /// Number of the frame that [`Self::next_frame`] reads, if the last one could be read.
    #[must_use]
    pub fn next_number(&self) -> Option<usize> {
        (!self.has_failed).then_some(self.next)
    }

    /// Goes towards a frame by the shortest way: on from the frame that comes next, or from the last keyframe before it. Returns the number
    /// of the frame that [`Self::next_frame`] reads then, so that a caller may stop on the way.
    ///
    /// # Errors
    /// [`ErrorKind::Options`], as of [`Self::seek`].
    pub fn approach(&mut self, frame: usize) -> Result<usize, Error> {
        self.check_frame(frame)?;
        let keyframe = match (self.after_loss, &self.index) {
            (AfterLoss::Stop, Some(index)) => index.keyframe_before(frame).unwrap_or(frame),
            // What is held in place of lost frames is known from the start on alone.
            _ => 0,
        };
        if self.has_failed || self.running.is_none() || !(keyframe..=frame).contains(&self.next) {
            self.start_at(keyframe);
        }
        Ok(self.next)
    }

    /// Reads a frame by its number. Frames that follow one another are decoded once.
    ///
    /// # Errors
    /// [`Self::seek`] and [`Self::next_frame`] say which.
    pub fn frame(&mut self, number: usize) -> Result<Frame, Error> {
        self.approach(number)?;
        while let Some(frame) = self.next_frame()? {
            match frame.number().cmp(&number) {
                Ordering::Less => {}
                Ordering::Equal => return Ok(frame),
                Ordering::Greater => {
                    let why =
                        format!("{}: frame {number} is lost, and no frame before it is there", self.name);
                    return Err(Error::new(ErrorKind::Stream, why));
                }
            }
        }
        Err(Error::new(ErrorKind::Stream, format!("{}: ends before frame {number}", self.name)))
    }

    fn check_frame(&self, frame: usize) -> Result<(), Error> {
        self.check_seekable()?;
        match self.frames() {
            // Frames that are held in place of lost ones count too, and are not in the index.
            Some(frames) if frame >= frames && self.after_loss == AfterLoss::Stop => {
                let why = format!("{}: frame {frame} asked for, but there are {frames}", self.name);
                Err(Error::new(ErrorKind::Options, why))
            }
            _ => Ok(()),
        }
    }

    fn check_seekable(&self) -> Result<(), Error> {
        match self.source {
            Source::Once(_) => {
                let why = format!("{}: bytes that come once cannot be sought in", self.name);
                Err(Error::new(ErrorKind::Options, why))
            }
            _ => Ok(()),
        }
    }

    fn start_at(&mut self, frame: usize) {
        (self.start, self.next, self.running, self.has_failed) = (frame, frame, None, false);
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
        let frame = frames.next().map(|frame| Frame::new(frame?, header, self.memory)).transpose()?;
        self.next = frame.as_ref().map_or(self.next, |frame| frame.number() + 1);
        Ok(frame)
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
        let name = &self.name;
        Ok(match (self.after_loss, &mut self.source) {
            (AfterLoss::Stop, Source::File(input)) => Running::whole(StreamFrames::open(input, &settings)?),
            (AfterLoss::Stop, Source::Seekable(open)) => {
                Running::whole(StreamFrames::from_seekable(name, open(), &settings)?)
            }
            (AfterLoss::Stop, Source::Once(source)) => {
                Running::whole(StreamFrames::from_source(name, take_once(source)?, &settings)?)
            }
            (_, Source::File(input)) => Running::concealing(ConcealingFrames::open(input, &settings)?),
            (_, Source::Seekable(open)) => {
                let bytes = stream::seekable(name, open())?;
                Running::concealing(ConcealingFrames::from_source(name, Box::new(bytes), &settings)?)
            }
            (_, Source::Once(source)) => {
                Running::concealing(ConcealingFrames::from_source(name, take_once(source)?, &settings)?)
            }
        })
    }

    fn header(&self) -> Option<&StreamHeader> {
        self.running.as_ref().map(|running| &running.header).or(self.header.as_ref())
    }
}

fn take_once(source: &mut Option<ByteSource>) -> Result<ByteSource, Error> {
    source.take().ok_or_else(|| Error::new(ErrorKind::Input, "the bytes were read already"))
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
            .field("frames", &self.frames())
            .finish_non_exhaustive()
    }
}
