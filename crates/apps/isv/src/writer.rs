//! Frames to streams, one by one.

use crate::{ColourView, DepthView, EncodeOptions, Error, ErrorKind, Mesh, Points, Volume, VolumeArrays};
use isv_io::{AtomicFile, Geometry};
use isv_take::Length;
use isv_take::capture::Content;
use isv_take::encode::FrameEncoder;
use isv_take::stream::{Container, StreamOutput, Tracks};
use std::io::{self, Write};
use std::path::Path;
use std::time::Duration;

/// Encodes frames one by one, and writes them to a file or any other sink.
///
/// All frames of a stream are of one kind. What options leave open is decided by the first frame.
pub struct Writer<W: Write = FileSink> {
    encoder: FrameEncoder<Counted<W>>,
}

/// A file beside its final name, which it gets when it is whole. One that is named `.mp4` is an MP4 file.
pub struct FileSink(StreamOutput<AtomicFile>);

impl FileSink {
    /// Opens a file beside its final name.
    ///
    /// # Errors
    /// [`ErrorKind::Output`].
    pub fn create(path: &Path) -> Result<Self, Error> {
        let file = AtomicFile::create(path)?;
        let output = StreamOutput::new(file, Container::of(path), Tracks::new());
        Ok(Self(output.map_err(|error| Error::new(ErrorKind::Output, error))?))
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// [`ErrorKind::Output`], and a stream that was not written to its end.
    pub fn commit(self) -> Result<(), Error> {
        let file = self.0.finish().map_err(|error| Error::new(ErrorKind::Output, error))?;
        file.commit()?;
        Ok(())
    }
}

impl std::fmt::Debug for FileSink {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FileSink").finish_non_exhaustive()
    }
}

impl Write for FileSink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
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
    /// Size of the stream (bytes).
    pub bytes: u64,
    /// Time that the stream takes to show.
    pub duration: Duration,
    /// Edge of a voxel.
    pub voxel: Length,
    /// Thickness of the shell around surfaces without inside, if one was made.
    pub shell: Option<Length>,
    /// Whether the job was cancelled, so that the stream holds the first frames alone.
    pub is_cancelled: bool,
}

impl Report {
    /// Mean rate (Mbps); 0 for a stream that takes no time.
    #[must_use]
    pub fn megabits_per_second(&self) -> f64 {
        let seconds = self.duration.as_secs_f64();
        if seconds > 0.0 { self.bytes as f64 * 8.0 / seconds / 1e6 } else { 0.0 }
    }

    pub(crate) fn new(report: &isv_take::encode::Report, bytes: u64) -> Self {
        Self {
            frames: report.frames,
            empty: report.empty,
            skipped: report.skipped,
            bytes,
            duration: Duration::try_from_secs_f64(report.seconds).unwrap_or(Duration::MAX),
            voxel: Length::from_metres(report.header.grid.voxel_size.metres()),
            shell: report.shell_mm.map(|mm| Length::from_metres(mm / 1e3)),
            is_cancelled: report.is_cancelled,
        }
    }
}

impl Writer {
    /// Makes a stream in an `.isv` or `.mp4` file, which has its name once [`Self::finish`] has been called.
    ///
    /// # Errors
    /// [`ErrorKind::Options`], [`ErrorKind::Device`] or [`ErrorKind::Output`].
    pub fn create(path: impl AsRef<Path>, options: &EncodeOptions) -> Result<Self, Error> {
        options.check()?;
        Self::new(FileSink::create(path.as_ref())?, options)
    }

    /// Completes the stream and gives the file its name.
    ///
    /// # Errors
    /// [`ErrorKind::Output`] if the file cannot be written, or could not before.
    pub fn finish(self) -> Result<Report, Error> {
        let (file, report) = self.into_inner()?;
        file.commit()?;
        Ok(report)
    }
}

impl<W: Write> Writer<W> {
    /// Makes a stream in a sink. Nothing is written before the first frame.
    ///
    /// # Errors
    /// [`ErrorKind::Options`] or [`ErrorKind::Device`].
    pub fn new(sink: W, options: &EncodeOptions) -> Result<Self, Error> {
        options.check()?;
        let observer = options.job.observer();
        let device = options.open_device(&*observer)?;
        let sink = Counted { sink, bytes: 0 };
        Ok(Self { encoder: FrameEncoder::new(sink, &options.raw, device, &observer)? })
    }

    /// Encodes a mesh; one without triangles is a frame without surface.
    ///
    /// # Errors
    /// [`ErrorKind::Frame`] for a mesh that cannot be used: the frames after it may follow. [`ErrorKind::Output`] and
    /// [`ErrorKind::Device`] end the stream.
    pub fn push_mesh(&mut self, mesh: &Mesh) -> Result<(), Error> {
        self.push(Content::Geometry(Geometry::Mesh(mesh.to_raw())), None)
    }

    /// Encodes points; none at all are a frame without surface.
    ///
    /// # Errors
    /// See [`Self::push_mesh`].
    pub fn push_points(&mut self, points: &Points) -> Result<(), Error> {
        self.push(Content::Geometry(Geometry::Points(points.to_raw())), None)
    }

    /// Encodes what depth cameras saw at one instant.
    ///
    /// # Errors
    /// See [`Self::push_mesh`].
    pub fn push_depth(&mut self, views: &[DepthView]) -> Result<(), Error> {
        self.push_depth_and_colour(views, &[])
    }

    /// Encodes what depth and colour cameras saw at one instant. A stream has colour if its first frame has.
    ///
    /// # Errors
    /// See [`Self::push_mesh`].
    pub fn push_depth_and_colour(
        &mut self,
        views: &[DepthView],
        colours: &[ColourView],
    ) -> Result<(), Error> {
        self.push_views(views, colours, None)
    }

    /// Encodes a field.
    ///
    /// # Errors
    /// See [`Self::push_mesh`].
    pub fn push_volume(&mut self, volume: &Volume) -> Result<(), Error> {
        self.push(Content::Volume(volume.to_raw()?), None)
    }

    /// Encodes a field in plain arrays.
    ///
    /// # Errors
    /// See [`Self::push_mesh`].
    pub fn push_volume_arrays(&mut self, volume: &VolumeArrays) -> Result<(), Error> {
        self.push(Content::Volume(volume.to_raw()?), None)
    }

    /// Encodes a mesh that was taken at a time, from any start. Later frames have later times.
    ///
    /// # Errors
    /// See [`Self::push_mesh`].
    pub fn push_mesh_at(&mut self, mesh: &Mesh, time: Duration) -> Result<(), Error> {
        self.push(Content::Geometry(Geometry::Mesh(mesh.to_raw())), Some(nanoseconds(time)?))
    }

    /// Encodes points that were taken at a time, from any start. Later frames have later times.
    ///
    /// # Errors
    /// See [`Self::push_mesh`].
    pub fn push_points_at(&mut self, points: &Points, time: Duration) -> Result<(), Error> {
        self.push(Content::Geometry(Geometry::Points(points.to_raw())), Some(nanoseconds(time)?))
    }

    /// Encodes what depth cameras saw at a time, from any start. Later frames have later times.
    ///
    /// # Errors
    /// See [`Self::push_mesh`].
    pub fn push_depth_at(&mut self, views: &[DepthView], time: Duration) -> Result<(), Error> {
        self.push_depth_and_colour_at(views, &[], time)
    }

    /// Encodes what depth and colour cameras saw at a time, from any start. Later frames have later times.
    ///
    /// # Errors
    /// See [`Self::push_mesh`].
    pub fn push_depth_and_colour_at(
        &mut self,
        views: &[DepthView],
        colours: &[ColourView],
        time: Duration,
    ) -> Result<(), Error> {
        self.push_views(views, colours, Some(nanoseconds(time)?))
    }

    /// Encodes a field of a time, from any start. Later frames have later times.
    ///
    /// # Errors
    /// See [`Self::push_mesh`].
    pub fn push_volume_at(&mut self, volume: &Volume, time: Duration) -> Result<(), Error> {
        self.push(Content::Volume(volume.to_raw()?), Some(nanoseconds(time)?))
    }

    /// Encodes a field in plain arrays, of a time, from any start. Later frames have later times.
    ///
    /// # Errors
    /// See [`Self::push_mesh`].
    pub fn push_volume_arrays_at(&mut self, volume: &VolumeArrays, time: Duration) -> Result<(), Error> {
        self.push(Content::Volume(volume.to_raw()?), Some(nanoseconds(time)?))
    }

    /// Completes the stream and gives back the sink.
    ///
    /// # Errors
    /// [`ErrorKind::Output`] if the sink fails, or has before.
    pub fn into_inner(self) -> Result<(W, Report), Error> {
        let (mut counted, report) = self.encoder.finish()?;
        counted.flush()?;
        let report = Report::new(&report, counted.bytes);
        Ok((counted.sink, report))
    }

    fn push(&mut self, content: Content, timestamp_ns: Option<u64>) -> Result<(), Error> {
        self.encoder.push(content, timestamp_ns)?;
        Ok(())
    }

    fn push_views(
        &mut self,
        views: &[DepthView],
        colours: &[ColourView],
        timestamp_ns: Option<u64>,
    ) -> Result<(), Error> {
        let images = views.iter().map(DepthView::to_raw).collect::<Result<_, _>>()?;
        let colours = colours.iter().map(ColourView::to_raw).collect::<Result<_, _>>()?;
        self.encoder.push_with_views(Content::Depth(images), colours, timestamp_ns)?;
        Ok(())
    }
}

fn nanoseconds(time: Duration) -> Result<u64, Error> {
    u64::try_from(time.as_nanos()).map_err(|_| Error::new(ErrorKind::Frame, "a time is at most 584 years"))
}

impl<W: Write> std::fmt::Debug for Writer<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Writer").finish_non_exhaustive()
    }
}

/// Counts what is written.
pub(crate) struct Counted<W> {
    pub(crate) sink: W,
    pub(crate) bytes: u64,
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.sink.write(bytes)?;
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.sink.flush()
    }
}
