//! Whole takes: a capture in, a stream out.

use crate::writer::Counted;
use crate::{EncodeOptions, Error, ErrorKind, Report};
use isv_io::AtomicFile;
use isv_take::capture::Capture;
use isv_take::encode::{Job, Watch};
use isv_take::{Cancellation, Input};
use std::path::Path;

/// Encodes a capture into a stream.
///
/// `input` is a folder of frames, a pattern such as `take/*.obj` or one file, a folder of depth images and calibration, of volumes, or
/// an `.isv` file. The output has its name once it is whole; a file that is there is replaced then.
///
/// # Errors
/// See [`Error::kind`]. Nothing is left of an output that is not whole.
pub fn encode(
    input: impl AsRef<Path>,
    output: impl AsRef<Path>,
    options: &EncodeOptions,
) -> Result<Report, Error> {
    options.check()?;
    let observer = options.observer();
    let capture = Capture::open(&Input::from(input), &options.raw.hints(&observer)?);
    let capture = capture.map_err(|error| Error::new(ErrorKind::Input, error))?;
    let open_device = || options.open_device(&*observer);
    let mut passes = Passes(&options.cancellation);
    let job = Job::prepare(capture, &options.raw, open_device, &observer, &mut passes)?;
    let (total, mut done) = (job.frames(), 0);
    let sink = Counted { sink: AtomicFile::create(output.as_ref())?, bytes: 0 };
    let coded = job.run(sink, |_| {
        done += 1;
        if let Some(progress) = &options.progress {
            progress(done, total);
        }
    });
    let (writer, report) = coded.map_err(|unfinished| unfinished.error)?;
    let Counted { sink, bytes } = writer.finish().map_err(|error| Error::new(ErrorKind::Output, error))?;
    sink.commit()?;
    Ok(Report::new(&report, bytes))
}

/// Passes that look for settings: nobody follows them, but they can be cancelled.
struct Passes<'a>(&'a Cancellation);

impl Watch for Passes<'_> {
    fn begin(&mut self, _frames: usize) {}

    fn step(&mut self) {}

    fn cancellation(&self) -> &Cancellation {
        self.0
    }
}
