//! Whole takes: a capture in and a stream out, or a stream in and files out.

use crate::{DecodeOptions, Error, ErrorKind};
use isv_io::AtomicFile;
use isv_take::stream::{self, Container, StreamOutput};
use isv_take::{Event, FrameRange, Input, MemoryLimit};
use std::io;
use std::path::Path;

#[cfg(feature = "encode")]
use crate::{EncodeOptions, FileSink, Report, writer::Counted};
#[cfg(feature = "encode")]
use isv_take::{
    Cancellation,
    capture::Capture,
    encode::{Job, Settled, Watch},
};
#[cfg(feature = "encode")]
use std::{io::Write, num::NonZero};

/// Result of decoding a stream to files.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DecodeReport {
    /// Frames written.
    pub frames: usize,
    /// Largest distance found (m) between a mesh with fewer faces and the decoded surface; 0 where no faces were taken away.
    pub simplify_error_m: f64,
    /// Whether the job was cancelled, so that the first frames alone were written.
    pub is_cancelled: bool,
}

/// Decodes a stream to files.
///
/// `output` is a folder, which gets `frame_0000.ply` and so on, or a file of one frame, or a `.glb`, `.usdc` or `.usda` file of all.
/// Files there that isv did not write are not replaced.
///
/// # Errors
/// See [`Error::kind`]. Files of a folder from before the error stay, each of them whole.
pub fn decode(
    input: impl AsRef<Path>,
    output: impl AsRef<Path>,
    options: &DecodeOptions,
) -> Result<DecodeReport, Error> {
    let output = output.as_ref();
    options.check(output)?;
    let observer = options.job.observer();
    let open_device = || options.open_device(&*observer);
    let (raw, cancellation) = (&options.raw, &options.job.cancellation);
    let input = Input::from(input);
    let job = isv_take::decode::Job::prepare(&input, output, raw, open_device, &observer, cancellation)?;
    let (total, mut done) = (raw.frames.and_then(FrameRange::count), 0);
    let report = job.run(|_| {
        done += 1;
        if let Some(progress) = &options.job.progress {
            progress(done, total);
        }
    });
    let report = report.map_err(|unfinished| unfinished.error)?;
    let simplify_error_m = report.reductions.worst.0;
    Ok(DecodeReport { frames: report.frames, simplify_error_m, is_cancelled: report.is_cancelled })
}

/// Puts a stream into an MP4 file, with sound beside it, and returns the number of frames.
///
/// `input` is an `.isv` or MP4 file; tracks beside its stream stay. `sound` is an MP4 file, or with feature `sound` an MP3, Ogg, FLAC or WAV
/// file; waveforms are coded with Opus. The output has its name once it is whole.
///
/// # Errors
/// [`ErrorKind::Input`](crate::ErrorKind::Input) or [`ErrorKind::Stream`](crate::ErrorKind::Stream) for what is read,
/// [`ErrorKind::Output`](crate::ErrorKind::Output) for what is written.
pub fn mux(input: impl AsRef<Path>, sound: Option<&Path>, output: impl AsRef<Path>) -> Result<usize, Error> {
    let input = Input::from(input);
    let mut tracks = stream::tracks_beside(&input, None)?;
    if let Some(path) = sound {
        let named = |error| Error::new(ErrorKind::Input, format!("{}: {error}", path.display()));
        tracks.push(stream::sound_of(path).map_err(named)?);
    }
    let output = output.as_ref();
    let create = || {
        let file = AtomicFile::create(output).map_err(io::Error::other)?;
        StreamOutput::new(file, Container::Mp4, tracks).map_err(io::Error::other)
    };
    let (file, frames) = stream::mux(&input, MemoryLimit::default(), &|_: &Event| {}, create)?;
    file.commit()?;
    Ok(frames)
}

/// Takes the stream out of an MP4 file, byte for byte. The output has its name once it is whole.
///
/// # Errors
/// As of [`mux`].
pub fn demux(input: impl AsRef<Path>, output: impl AsRef<Path>) -> Result<(), Error> {
    let create = || AtomicFile::create(output.as_ref()).map_err(io::Error::other);
    let file = stream::demux(&Input::from(input), create)?;
    file.commit()?;
    Ok(())
}

/// Encodes a capture into a stream.
///
/// `input` is a folder of frames, a pattern such as `take/*.obj` or one file, a folder of depth images and calibration, of volumes, or
/// an `.isv` file. The output has its name once it is whole; a file that is there is replaced then.
///
/// # Errors
/// See [`Error::kind`]. Nothing is left of an output that is not whole.
#[cfg(feature = "encode")]
pub fn encode(
    input: impl AsRef<Path>,
    output: impl AsRef<Path>,
    options: &EncodeOptions,
) -> Result<Report, Error> {
    let (file, report) = encode_with(input.as_ref(), options, || FileSink::create(output.as_ref()))?;
    file.commit()?;
    Ok(report)
}

/// Encodes a capture into a sink. `input` is what [`encode`] takes.
///
/// # Errors
/// See [`Error::kind`]. What the sink got by then is a stream without an end.
#[cfg(feature = "encode")]
pub fn encode_to<W: Write>(
    input: impl AsRef<Path>,
    sink: W,
    options: &EncodeOptions,
) -> Result<(W, Report), Error> {
    encode_with(input.as_ref(), options, || Ok(sink))
}

#[cfg(feature = "encode")]
fn encode_with<W: Write>(
    input: &Path,
    options: &EncodeOptions,
    create: impl FnOnce() -> Result<W, Error>,
) -> Result<(W, Report), Error> {
    options.check()?;
    let observer = options.job.observer();
    let capture = Capture::open(&Input::from(input), &options.raw.hints(&observer)?);
    let capture = capture.map_err(|error| Error::new(ErrorKind::Input, error))?;
    let open_device = || options.open_device(&*observer);
    let mut passes = Passes(&options.job.cancellation);
    let job = Job::prepare(capture, &options.raw, open_device, &observer, &mut passes)?;
    let (total, mut done) = (job.frames(), 0);
    let sink = Counted { sink: create()?, bytes: 0 };
    let coded = job.run(sink, |_| {
        done += 1;
        if let Some(progress) = &options.job.progress {
            progress(done, total);
        }
    });
    let (writer, report) = coded.map_err(|unfinished| unfinished.error)?;
    let Counted { sink, bytes } = writer.finish().map_err(|error| Error::new(ErrorKind::Output, error))?;
    Ok((sink, Report::new(&report, bytes)))
}

/// Decides what options leave open of a capture, as encoding it would, for pieces of it that are encoded apart. Meshes are looked at
/// every so many frames.
///
/// # Errors
/// See [`Error::kind`].
#[cfg(feature = "encode")]
pub fn settle(
    input: impl AsRef<Path>,
    every: NonZero<usize>,
    options: &EncodeOptions,
) -> Result<Settled, Error> {
    options.check()?;
    let observer = options.job.observer();
    let mut passes = Passes(&options.job.cancellation);
    let input = Input::from(input.as_ref());
    Ok(isv_take::encode::settle(&input, &options.raw, every.get(), &observer, &mut passes)?)
}

/// Passes that look for settings: nobody follows them, but they can be cancelled.
#[cfg(feature = "encode")]
struct Passes<'a>(&'a Cancellation);

#[cfg(feature = "encode")]
impl Watch for Passes<'_> {
    fn begin(&mut self, _frames: usize) {}

    fn step(&mut self) {}

    fn cancellation(&self) -> &Cancellation {
        self.0
    }
}
