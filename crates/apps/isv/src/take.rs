//! Whole takes: a capture in and a stream out, or a stream in and files out.

use crate::{DecodeOptions, Error, ErrorKind};
use isv_io::{AtomicFile, Output};
use isv_take::stream::{self, Container, JoinedTimes, StreamOutput};
use isv_take::{Event, FrameRange, Input, MemoryLimit};
use std::io;
use std::ops::Range;
use std::path::Path;

#[cfg(feature = "encode")]
use isv_io::{Colours, Unit};
#[cfg(feature = "encode")]
use isv_metrics::CompareOptions;
#[cfg(feature = "encode")]
use std::sync::Arc;

#[cfg(feature = "encode")]
pub use isv_take::Evaluation;
pub use isv_take::stream::Repaired;

#[cfg(feature = "encode")]
use crate::{EncodeOptions, FileSink, Report, writer::Counted};
#[cfg(feature = "encode")]
use isv_take::{
    Cancellation, Observer,
    capture::{Capture, Hints},
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
/// [`ErrorKind::Input`] or [`ErrorKind::Stream`] for what is read,
/// [`ErrorKind::Output`] for what is written.
pub fn mux(input: impl AsRef<Path>, sound: Option<&Path>, output: impl AsRef<Path>) -> Result<usize, Error> {
    let input = Input::from(input);
    let mut tracks = stream::tracks_beside(&input, None)?;
    if let Some(path) = sound {
        let named = |error| Error::new(ErrorKind::Input, format!("{}: {error}", path.display()));
        tracks.push(stream::default_sound(path).map_err(named)?);
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

/// Copies frames of a stream, from a keyframe on, and returns their number. Nothing is coded anew.
///
/// An output that is named `.mp4` is an MP4 file, and keeps the sound of an input that is one. It has its name once it is whole.
///
/// # Errors
/// See [`mux`]; [`ErrorKind::Options`] for frames that are not there.
pub fn cut(input: impl AsRef<Path>, frames: Range<usize>, output: impl AsRef<Path>) -> Result<usize, Error> {
    let range = FrameRange { start: frames.start, end: frames.end };
    let (input, output) = (Input::from(input), output.as_ref());
    let tracks = stream::tracks_kept_in(output, || stream::tracks_beside(&input, Some(range)))?;
    let create = || StreamOutput::create(output, tracks);
    let (file, count) = stream::cut(&input, range, MemoryLimit::default(), &|_: &Event| {}, create)?;
    finished(file).map(|()| count)
}

/// Puts streams one after the other, and returns the number of frames. Nothing is coded anew.
///
/// They have the same profile, grid, frame rate, layers of colour and version. See [`cut`] on the output.
///
/// # Errors
/// See [`mux`]; [`ErrorKind::Options`] without a stream.
pub fn join(inputs: &[impl AsRef<Path>], output: impl AsRef<Path>) -> Result<usize, Error> {
    if inputs.is_empty() {
        return Err(Error::new(ErrorKind::Options, "there is no stream to join"));
    }
    let inputs: Vec<_> = inputs.iter().map(Input::from).collect();
    let output = output.as_ref();
    let times = JoinedTimes::Follow;
    let beside = || Ok(stream::tracks_beside_all(&inputs, times)?.unwrap_or_default());
    let tracks = stream::tracks_kept_in(output, beside)?;
    let create = || StreamOutput::create(output, tracks);
    let memory = MemoryLimit::default();
    let (file, count) = stream::join(&inputs, times, memory, &|_: &Event| {}, create)?;
    finished(file).map(|()| count)
}

/// Makes a stream of what is sound in a damaged, cut or unfinished one. Packets are kept byte for byte.
///
/// `header_from` is a stream of the same take, whose header stands for a damaged one. See [`cut`] on the output.
///
/// # Errors
/// See [`mux`]; [`ErrorKind::Stream`] for a stream of which no frame can be decoded.
pub fn repair(
    input: impl AsRef<Path>,
    header_from: Option<&Path>,
    output: impl AsRef<Path>,
) -> Result<Repaired, Error> {
    let (input, output) = (Input::from(input), output.as_ref());
    let tracks = stream::tracks_kept_in(output, || stream::tracks_beside(&input, None))?;
    let create = || StreamOutput::create(output, tracks);
    let other = header_from.map(Input::from);
    let (file, repaired) = stream::repair(&input, other.as_ref(), MemoryLimit::default(), create)?;
    finished(file).map(|()| repaired)
}

fn finished(output: StreamOutput<Output>) -> Result<(), Error> {
    let file = output.finish().map_err(|error| Error::new(ErrorKind::Output, error))?;
    file.commit().map(drop).map_err(|error| Error::new(ErrorKind::Output, error))
}

/// Takes the stream out of an MP4 file, byte for byte. The output has its name once it is whole.
///
/// # Errors
/// See [`mux`].
pub fn demux(input: impl AsRef<Path>, output: impl AsRef<Path>) -> Result<(), Error> {
    let create = || AtomicFile::create(output.as_ref()).map_err(io::Error::other);
    let file = stream::demux(&Input::from(input), &|_: &isv_take::Event| {}, create)?;
    file.commit()?;
    Ok(())
}

/// Measures a capture or a stream against a reference, frame by frame. Both are what [`encode`] takes, in metres and Y up.
///
/// Surfaces are sampled about every `spacing_m` (m); stored vertices are taken, too.
///
/// # Errors
/// [`ErrorKind::Options`] for a spacing that is none, [`ErrorKind::Input`] for captures
/// that cannot be read or compared.
#[cfg(feature = "encode")]
pub fn evaluate(
    reference: impl AsRef<Path>,
    test: impl AsRef<Path>,
    spacing_m: f64,
) -> Result<Evaluation, Error> {
    if !(spacing_m > 0.0 && spacing_m.is_finite()) {
        return Err(Error::new(ErrorKind::Options, format!("spacing {spacing_m}: a length is above 0 (m)")));
    }
    let memory = MemoryLimit::default();
    let observer: Arc<dyn Observer> = Arc::new(|_: &Event| {});
    let open = |path: &Path| {
        let hints =
            Hints { colours: Colours::Keep, ..Hints::in_unit(Unit::Metre, memory, Arc::clone(&observer)) };
        Capture::open(&Input::from(path), &hints).map_err(|error| Error::new(ErrorKind::Input, error))
    };
    let (reference, test) = (open(reference.as_ref())?, open(test.as_ref())?);
    let options = CompareOptions { spacing_m, ..CompareOptions::default() };
    let cancellation = Cancellation::new();
    isv_take::evaluate(reference, test, None, &options, memory, &cancellation, || {})
        .map_err(|error| Error::new(ErrorKind::Input, error))
}

/// Encodes a capture into a stream.
///
/// `input` is a folder of frames, a pattern such as `take/*.obj` or one file. It may also be a folder of
/// depth images and calibration, a folder of volumes, or an `.isv` file. The output has its name once it is
/// whole; a file that is there is replaced then.
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
