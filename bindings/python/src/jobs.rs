//! Jobs on whole takes. Each runs on a thread of its own, while the caller's delivers what it reports and looks for signals.

use crate::files::{PySink, Raised};
use crate::options::Options;
use crate::writer::TakeSink;
use crate::{errors, threads};
use isv::raw::format::FrameRate;
use isv::raw::io::{Output, check_not_input};
use isv::raw::metrics::CompareOptions;
use isv::raw::take::capture::{Capture, Hints};
use isv::raw::take::encode::Settled;
use isv::raw::take::stream::{self, DecodeSettings, JoinedTimes, StreamInfo, StreamOutput};
use isv::raw::take::{FrameRange, Input, MemoryLimit, OpenDevice};
use isv::{Cancellation, Event, Report, SignMode, Unit, Up};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// How often a job that reports nothing is interrupted for signals.
const PATIENCE: Duration = Duration::from_millis(50);

/// Frames, empty and skipped ones, bytes, duration (s), voxel (m), shell (m).
pub(crate) type PyReport = (usize, usize, usize, u64, f64, f64, Option<f64>);

pub(crate) fn report(report: &Report) -> PyReport {
    let Report { frames, empty, skipped, bytes, duration, voxel, shell, .. } = report;
    let shell = shell.map(isv::Length::metres);
    (*frames, *empty, *skipped, *bytes, duration.as_secs_f64(), voxel.metres(), shell)
}

/// Events that came from any thread, to be logged by one that has the GIL.
#[derive(Clone, Default)]
pub(crate) struct Events(Arc<Mutex<Vec<Event>>>);

impl Events {
    pub(crate) fn handler(&self) -> impl Fn(&Event) + Send + Sync + use<> {
        let events = self.clone();
        move |event| events.push(event.clone())
    }

    fn push(&self, event: Event) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(event);
    }

    /// Hands the events to the logger `isv`.
    pub(crate) fn log(&self, py: Python<'_>) -> PyResult<()> {
        let events = std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner));
        if events.is_empty() {
            return Ok(());
        }
        let logger = py.import("logging")?.call_method1("getLogger", ("isv",))?;
        for event in events {
            let level = if event.is_warning { "warning" } else { "info" };
            logger.call_method1(level, ("%s", event.text))?;
        }
        Ok(())
    }
}

/// Progress of a job: frames done, and all frames if that is known.
type Step = (usize, Option<usize>);

/// Runs a job, with a way to report its progress. What the callback or a signal raises cancels it.
fn run<T: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    events: &Events,
    cancellation: &Cancellation,
    work: impl FnOnce(Sender<Step>) -> T + Send,
) -> PyResult<T> {
    let progress = progress.map(|callback| callback.clone().unbind());
    let deliver = |step: Option<Step>| {
        Python::attach(|py| {
            events.log(py)?;
            if let (Some(step), Some(progress)) = (step, &progress) {
                progress.call1(py, step)?;
            }
            py.check_signals()
        })
    };
    let (done, raised) = py.detach(|| {
        std::thread::scope(|scope| {
            let (sender, steps) = channel();
            let job = scope.spawn(|| threads::run(|| work(sender)));
            let mut raised = None;
            loop {
                let delivered = match steps.recv_timeout(PATIENCE) {
                    Err(RecvTimeoutError::Disconnected) => break,
                    _ if raised.is_some() => continue,
                    Ok(step) => deliver(Some(step)),
                    Err(RecvTimeoutError::Timeout) => deliver(None),
                };
                if let Err(error) = delivered {
                    cancellation.cancel();
                    raised = Some(error);
                }
            }
            (job.join(), raised)
        })
    });
    let done = done.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    match raised {
        Some(error) => Err(error),
        None => events.log(py).map(|()| done),
    }
}

/// Refuses an output that is read, or that is there and is no stream.
pub(crate) fn check_output(py: Python<'_>, inputs: &[&Path], output: &Path) -> PyResult<()> {
    stream::check_output(inputs, output).map_err(|error| errors::with_kind(py, "output", error))
}

/// Refuses an output that is read.
pub(crate) fn check_not_a_source(py: Python<'_>, input: &Path, output: &Path) -> PyResult<()> {
    check_not_input(&[input], output).map_err(|error| errors::with_kind(py, "output", error))
}

/// Encodes a capture.
#[pyfunction]
pub(crate) fn encode(
    py: Python<'_>,
    input: PathBuf,
    output: &Bound<'_, PyAny>,
    options: &Bound<'_, PyDict>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<PyReport> {
    let (raised, events, cancellation) = (Raised::default(), Events::default(), Cancellation::new());
    let options = Options::read(options)?.encode.cancellation(&cancellation).on_event(events.handler());
    options.check().map_err(|error| errors::of_library(py, error))?;
    let sink = match output.extract::<PathBuf>() {
        Ok(path) => {
            check_output(py, &[&input], &path)?;
            let file = isv::FileSink::create(&path);
            TakeSink::File(file.map_err(|error| errors::of_library(py, error))?)
        }
        Err(_) => TakeSink::Python(PySink::new(output, &raised)?),
    };
    let encoded = run(py, progress, &events, &cancellation, |steps| {
        let options = options.on_progress(move |done, total| _ = steps.send((done, total)));
        isv::take::encode_to(&input, sink, &options)
    });
    // What was raised in a file came first.
    let encoded = raised.take().map_or(encoded, Err)?;
    let (sink, done) = encoded.map_err(|error| errors::of_library(py, error))?;
    if let TakeSink::File(file) = sink {
        file.commit().map_err(|error| errors::of_library(py, error))?;
    }
    Ok(report(&done))
}

/// The frame rate of a number of frames a second.
pub(crate) fn frame_rate(fps: f64) -> PyResult<FrameRate> {
    let why = || PyValueError::new_err(format!("fps is {fps}: a rate is above 0 (frames a second)"));
    FrameRate::nearest(fps).ok_or_else(why)
}

/// Compares two captures. Returns JSON.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "each of them is one of the function in Python")]
pub(crate) fn evaluate(
    py: Python<'_>,
    reference: PathBuf,
    test: PathBuf,
    spacing: f64,
    frames: Option<(usize, Option<usize>)>,
    test_frames: Option<(usize, Option<usize>)>,
    units: [String; 2],
    origins: [Option<[f64; 3]>; 2],
    up: [String; 2],
    animations: [Option<String>; 2],
    fps: f64,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let frame_rate = frame_rate(fps)?;
    if !(spacing > 0.0 && spacing.is_finite()) {
        return Err(PyValueError::new_err(format!("spacing is {spacing}: a length is above 0 (metres)")));
    }
    let (events, cancellation, memory) = (Events::default(), Cancellation::new(), MemoryLimit::default());
    let observer: Arc<dyn isv::raw::take::Observer> = Arc::new(observer(&events));
    let hints = |side: usize| {
        let (unit, origin, up, animation) =
            (&units[side], origins[side], &up[side], animations[side].clone());
        let unit: Unit = unit.parse().map_err(|why| PyValueError::new_err(format!("units: {why}")))?;
        let up = Up::ALL.into_iter().find(|axis| axis.name() == *up);
        let up =
            up.ok_or_else(|| PyValueError::new_err("up is \"y\", \"z\", \"x\", \"-y\", \"-z\" or \"-x\""))?;
        let colours = isv::raw::io::Colours::Keep;
        let usual = Hints::in_unit(unit, memory, Arc::clone(&observer)).with_origin(origin);
        Ok::<_, PyErr>(Hints { up, colours, animation, frame_rate, ..usual })
    };
    let hints = [hints(0)?, hints(1)?];
    let ranges = [frames, test_frames].map(|frames| {
        frames.map(|(start, stop)| FrameRange { start, end: stop.unwrap_or(FrameRange::OPEN) })
    });
    let options = CompareOptions { spacing_m: spacing, ..CompareOptions::default() };
    let measured = run(py, progress, &events, &cancellation, |steps| {
        let open = |path: &Path, hints| Capture::open(&Input::from(path), hints);
        let reference = open(&reference, &hints[0]).map_err(|error| error.to_string())?;
        let test = open(&test, &hints[1]).map_err(|error| error.to_string())?;
        let mut done = 0;
        let count = || {
            done += 1;
            _ = steps.send((done, None));
        };
        let stop = &cancellation;
        let evaluation = match ranges {
            [frames, None] => {
                isv::raw::take::evaluate(reference, test, frames, &options, memory, stop, count)
            }
            [frames, of_test] => {
                let ranges =
                    [reference.range(frames), test.range(of_test)].map(|r| r.map_err(|e| e.to_string()));
                let [in_reference, in_test] = ranges;
                let ranges = [in_reference?, in_test?];
                if ranges[0].len() != ranges[1].len() {
                    return Err(format!(
                        "frames: {} of them, but test_frames has {}",
                        ranges[0].len(),
                        ranges[1].len()
                    ));
                }
                isv::raw::take::evaluate_ranges([reference, test], ranges, &options, memory, stop, count)
            }
        };
        let evaluation = evaluation.map_err(|error| error.to_string())?;
        serde_json::to_string(&evaluation.figures()).map_err(|error| error.to_string())
    })?;
    measured.map_err(|why| errors::with_kind(py, "input", why))
}

/// Lists the files of a capture's frames, in order; `None` where frames are no files of meshes or points.
#[pyfunction]
pub(crate) fn frame_files(py: Python<'_>, input: PathBuf) -> PyResult<Option<Vec<PathBuf>>> {
    let events = Events::default();
    let hints = Hints::in_unit(Unit::Metre, MemoryLimit::default(), Arc::new(observer(&events)));
    let capture = py.detach(|| Capture::open(&Input::from(input), &hints));
    let capture = capture.map_err(|error| errors::with_kind(py, "input", error))?;
    Ok(capture.frame_files().map(<[PathBuf]>::to_vec))
}

/// Decides what options leave open of a capture. Returns JSON.
#[pyfunction]
pub(crate) fn settle_options(
    py: Python<'_>,
    input: PathBuf,
    options: &Bound<'_, PyDict>,
    every: usize,
) -> PyResult<String> {
    let Some(every) = NonZero::new(every) else {
        return Err(PyValueError::new_err("every is 0: a number from 1 on"));
    };
    let (events, cancellation) = (Events::default(), Cancellation::new());
    let options = Options::read(options)?.encode.cancellation(&cancellation).on_event(events.handler());
    let settled = run(py, None, &events, &cancellation, |_| isv::take::settle(&input, every, &options))?;
    let settled = settled.map_err(|error| errors::of_library(py, error))?;
    serde_json::to_string(&settled_figures(&settled))
        .map_err(|error| PyValueError::new_err(error.to_string()))
}

/// Decisions by the names of Python's options.
fn settled_figures(settled: &Settled) -> serde_json::Value {
    let Settled { frames, header, content, sign, quality, frames_stand_alone, .. } = settled;
    let sign = sign.map(|sign| match sign {
        SignMode::Closed => "closed",
        SignMode::Sheet => "sheet",
        SignMode::Offset => "offset",
        _ => "auto",
    });
    serde_json::json!({
        "frames": [frames.start, frames.end],
        "fps": header.frame_rate.per_second(),
        "voxel": header.grid.voxel_size.metres(),
        "block": header.grid.edge.voxels(),
        "truncation": header.grid.truncation.voxels(),
        "profile": header.profile.name(),
        "color": header.colour_layers.is_some(),
        "content": content.name(),
        "sign": sign,
        "quality": quality,
        "frames_stand_alone": frames_stand_alone,
    })
}

/// Decodes a whole stream and checks it. Returns the number of frames, and of those that state a hash.
#[pyfunction]
pub(crate) fn verify(py: Python<'_>, path: PathBuf) -> PyResult<(usize, usize)> {
    let (events, cancellation) = (Events::default(), Cancellation::new());
    let (verified, checked) = run(py, None, &events, &cancellation, |_| {
        let settings = DecodeSettings {
            frames: None,
            lod: isv::raw::decode::Lod::Full,
            colour: true,
            device: OpenDevice::CPU,
            memory: MemoryLimit::default(),
            observer: Arc::new(observer(&events)),
        };
        stream::verify(&Input::from(path), &settings, || {})
    })?;
    checked.map_err(|error| errors::of_stream(py, error))?;
    Ok((verified.frames, verified.hashed))
}

/// Describes a stream. Returns JSON.
#[pyfunction]
pub(crate) fn info(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    let info = py.detach(|| StreamInfo::read(&Input::from(path)));
    let info = info.map_err(|error| errors::of_stream(py, error))?;
    serde_json::to_string(&info).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// Frames kept, orphaned and doubled, damaged places, and whether the end was there.
type PyRepaired = (usize, usize, usize, Vec<(u64, u64)>, bool);

/// Keeps what is sound of a stream.
#[pyfunction]
pub(crate) fn repair(
    py: Python<'_>,
    input: PathBuf,
    output: PathBuf,
    header_from: Option<PathBuf>,
) -> PyResult<PyRepaired> {
    let inputs: Vec<&Path> =
        [Some(&input), header_from.as_ref()].into_iter().flatten().map(|p| &**p).collect();
    check_output(py, &inputs, &output)?;
    let other = header_from.map(Input::from);
    let repaired = py.detach(|| {
        let input = Input::from(&input);
        let tracks = stream::tracks_kept_in(&output, || stream::tracks_beside(&input, None))?;
        let create = || StreamOutput::create(&output, tracks);
        // What can be decoded is found by decoding.
        threads::run(|| stream::repair(&input, other.as_ref(), MemoryLimit::default(), create))
    });
    let (file, done) = repaired.map_err(|error| errors::of_edit(py, error))?;
    commit(file)?;
    Ok((done.kept, done.orphaned, done.doubled, done.damage, done.had_end))
}

/// Puts streams one after the other. Returns the number of frames.
#[pyfunction]
pub(crate) fn join(
    py: Python<'_>,
    inputs: Vec<PathBuf>,
    output: PathBuf,
    keep_times: bool,
) -> PyResult<usize> {
    let times = if keep_times { JoinedTimes::Keep } else { JoinedTimes::Follow };
    if inputs.is_empty() {
        return Err(PyValueError::new_err("there is no stream to join"));
    }
    check_output(py, &inputs.iter().map(PathBuf::as_path).collect::<Vec<_>>(), &output)?;
    let inputs: Vec<Input> = inputs.into_iter().map(Input::from).collect();
    let events = Events::default();
    let joined = py.detach(|| {
        let observer = observer(&events);
        let beside = || Ok(stream::tracks_beside_all(&inputs, times)?.unwrap_or_default());
        let tracks = stream::tracks_kept_in(&output, beside)?;
        let create = || StreamOutput::create(&output, tracks);
        stream::join(&inputs, times, MemoryLimit::default(), &observer, create)
    });
    events.log(py)?;
    let (file, frames) = joined.map_err(|error| errors::of_edit(py, error))?;
    commit(file).map(|()| frames)
}

/// Copies frames of a stream, from a keyframe on. Returns the number of frames.
#[pyfunction]
pub(crate) fn cut(
    py: Python<'_>,
    input: PathBuf,
    output: PathBuf,
    frames: (usize, Option<usize>),
) -> PyResult<usize> {
    check_output(py, &[&input], &output)?;
    let range = FrameRange { start: frames.0, end: frames.1.unwrap_or(FrameRange::OPEN) };
    let events = Events::default();
    let copied = py.detach(|| {
        let (input, observer) = (Input::from(&input), observer(&events));
        let tracks = stream::tracks_kept_in(&output, || stream::tracks_beside(&input, Some(range)))?;
        let create = || StreamOutput::create(&output, tracks);
        stream::cut(&input, range, MemoryLimit::default(), &observer, create)
    });
    events.log(py)?;
    let (file, frames) = copied.map_err(|error| errors::of_edit(py, error))?;
    commit(file).map(|()| frames)
}

fn observer(events: &Events) -> impl Fn(&isv::raw::take::Event) + Send + Sync + use<> {
    let handler = events.handler();
    move |event| handler(&Event::from(event))
}

fn commit(file: StreamOutput<Output>) -> PyResult<()> {
    let file = file.finish().map_err(|error| PyOSError::new_err(error.to_string()))?;
    file.commit().map(drop).map_err(|error| PyOSError::new_err(error.to_string()))
}

/// Puts a stream into an MP4 file, with sound beside it. Returns the number of frames.
#[pyfunction]
pub(crate) fn mux(
    py: Python<'_>,
    input: PathBuf,
    output: PathBuf,
    sound: Option<PathBuf>,
) -> PyResult<usize> {
    let inputs: Vec<&Path> = [Some(&input), sound.as_ref()].into_iter().flatten().map(|p| &**p).collect();
    check_output(py, &inputs, &output)?;
    let muxed = py.detach(|| isv::take::mux(&input, sound.as_deref(), &output));
    muxed.map_err(|error| errors::of_library(py, error))
}

/// Takes the stream out of an MP4 file.
#[pyfunction]
pub(crate) fn demux(py: Python<'_>, input: PathBuf, output: PathBuf) -> PyResult<()> {
    check_output(py, &[&input], &output)?;
    py.detach(|| isv::take::demux(&input, &output)).map_err(|error| errors::of_library(py, error))
}
