//! `--voxel auto`: the voxel size that serves the target best, by coding samples of the capture with several.

use super::{EncodeError, EncodeEvent, EncodeOptions, FrameError};
use crate::capture::{Capture, CapturedFrame, Content};
use crate::{Event, Input, Length, Observer};
use isv_encode::{
    COARSEST_STEP, Encoder, EncoderSettings, FINEST_STEP, FrameQuality, MainSettings, Preset, RateTarget,
};
use isv_format::{PacketHeader, StreamHeader};
use isv_ingest::{MeshIngest, decide_sign, ingest_mesh, turn_faces};
use isv_io::{Geometry, Unit};
use isv_metrics::{CompareOptions, compare};
use isv_surface::{SurfaceOptions, extract_surface};
use isv_volume::{Grid, TriangleMesh, VoxelSize};
use std::sync::Arc;

/// Voxels that are tried on something of a person's size, in metres, and that size.
const CANDIDATES_M: [f64; 4] = [0.005, 0.0065, 0.008, 0.01];
const PERSON_M: f64 = 1.8;
/// Steps that each is tried with, over the smallest candidate.
const STEPS: [f64; 2] = [1.2, 3.6];
/// What is no farther than this above the wanted rate or error meets it.
const MET: f64 = 1.01;
/// Frames of a sample: a keyframe and what follows it.
const SAMPLE_FRAMES: usize = 3;
/// Share of a rate that geometry gets where colour gets the rest (`docs/design/019-rate-control.md`).
const GEOMETRY_SHARE: f64 = 0.45;

/// What was chosen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Choice {
    pub(super) voxel: VoxelSize,
    /// Quality that gives the wanted error, where a quality was asked for.
    pub(super) quality: Option<FrameQuality>,
}

/// What is wanted of a stream.
#[derive(Clone, Copy, Debug)]
enum Wanted {
    /// The least error at this many bits a second.
    Rate(f64),
    /// The lowest rate at this error, in metres.
    Error(f64),
    /// The lowest rate at the error that a step has with the smallest candidate.
    ErrorOfStep(f64),
}

/// Mean error in metres and bits a second of a candidate, as powers of the step, which is in metres.
#[derive(Clone, Copy, Debug)]
struct Curve {
    voxel: VoxelSize,
    /// By the logarithm of the step: that of the rate and that of the error, each `(at 0, slope)`.
    rate: (f64, f64),
    error: (f64, f64),
}

impl Curve {
    fn through(voxel: VoxelSize, points: [(f64, f64, f64); 2]) -> Self {
        let [(x0, rate0, error0), (x1, rate1, error1)] = points.map(|(a, b, c)| (a.ln(), b.ln(), c.ln()));
        let line = |y0: f64, y1: f64| {
            let slope = (y1 - y0) / (x1 - x0);
            (y0 - slope * x0, slope)
        };
        Self { voxel, rate: line(rate0, rate1), error: line(error0, error1) }
    }

    fn at(line: (f64, f64), step: f64) -> f64 {
        (line.0 + line.1 * step.ln()).exp()
    }

    /// The step at which a value is reached, or the next one of those that rate control takes.
    fn step_at(&self, line: (f64, f64), value: f64) -> f64 {
        let voxels = ((value.ln() - line.0) / line.1).exp() / self.voxel.metres();
        voxels.clamp(FINEST_STEP, COARSEST_STEP) * self.voxel.metres()
    }
}

/// Chooses a voxel size; tells which and why.
pub(super) fn choose(
    input: &Input,
    options: &EncodeOptions,
    header: &StreamHeader,
    settings: &EncoderSettings,
    observer: &Arc<dyn Observer>,
) -> Result<Choice, EncodeError> {
    let samples = samples(input, options, observer)?;
    let first = samples.first().and_then(|sample| sample.first()).map(|frame| &frame.mesh);
    let extent_m = first.and_then(TriangleMesh::bounds).map_or(0.0, |(low, high)| (high - low).max_element());
    if extent_m == 0.0 {
        return Err(EncodeError::NoSample { name: input.name() });
    }
    // By powers of two, so that a person is one whether she stoops or reaches up.
    let scale = (extent_m / PERSON_M).log2().round().exp2();
    let mut curves = Vec::new();
    for candidate_m in CANDIDATES_M {
        // What is smaller or larger than any voxel may be is no candidate.
        let Ok(voxel) = VoxelSize::from_metres(scale * candidate_m) else { continue };
        let grid = Grid { voxel_size: voxel, ..header.grid };
        let ingest = options.fields.mesh_ingest(grid, options.profile_choice());
        let point = |over: f64| {
            let step_m = over * scale * CANDIDATES_M[0];
            measure(&samples, (ingest, options.unit), header, settings, step_m)
        };
        curves.push(Curve::through(voxel, [point(STEPS[0])?, point(STEPS[1])?]));
    }
    // Samples are coded without their colour.
    let share = if header.colour_layers.is_some() { GEOMETRY_SHARE } else { 1.0 };
    let wanted = match settings.main.target {
        RateTarget::Bitrate(bitrate) => Wanted::Rate(share * bitrate.bits_per_second),
        RateTarget::MaxError(voxels) => Wanted::Error(voxels * header.grid.voxel_size.metres()),
        RateTarget::Constant => match options.main.two_pass_rate() {
            Some(rate) => Wanted::Rate(share * rate),
            None => Wanted::ErrorOfStep(
                f64::from(settings.main.quality.step)
                    * curves.first().map_or(0.0, |curve| curve.voxel.metres()),
            ),
        },
    };
    let [Some(smallest), Some(largest)] = [curves.first(), curves.last()] else {
        return Err(EncodeError::NoSample { name: input.name() });
    };
    let (choice, point) = best(&curves, wanted);
    let length = |curve: &Curve| Length::from_metres(curve.voxel.metres());
    observer.event(&Event::Encode(EncodeEvent::VoxelChosen {
        voxel: length(&choice),
        error_mm: 1e3 * point.error,
        mbps: point.rate / 1e6,
        samples: samples.iter().map(Vec::len).sum(),
        tried: [length(smallest), length(largest)],
    }));
    let quality = matches!(wanted, Wanted::ErrorOfStep(_))
        .then(|| FrameQuality::of_step((point.step / choice.voxel.metres()) as f32));
    Ok(Choice { voxel: choice.voxel, quality })
}

/// What a candidate comes to.
#[derive(Clone, Copy, Debug)]
struct Point {
    /// In metres.
    step: f64,
    /// In bits a second.
    rate: f64,
    /// In metres.
    error: f64,
}

/// The best curve for what is wanted, and where on it.
fn best(curves: &[Curve], wanted: Wanted) -> (Curve, Point) {
    let at = |curve: &Curve| {
        let step = match wanted {
            Wanted::Rate(rate) => curve.step_at(curve.rate, rate),
            Wanted::Error(error) => curve.step_at(curve.error, error),
            Wanted::ErrorOfStep(step) => curve.step_at(curve.error, Curve::at(curves[0].error, step)),
        };
        Point { step, rate: Curve::at(curve.rate, step), error: Curve::at(curve.error, step) }
    };
    // No step may meet what is wanted: then the nearest to it is best.
    let cost = |point: &Point| {
        let (missed_by, cost) = match wanted {
            Wanted::Rate(rate) => (point.rate / rate, point.error),
            Wanted::Error(error) => (point.error / error, point.rate),
            Wanted::ErrorOfStep(step) => (point.error / Curve::at(curves[0].error, step), point.rate),
        };
        (missed_by.max(MET), cost)
    };
    let cheaper = |a: &Point, b: &Point| {
        let ((a_missed, a), (b_missed, b)) = (cost(a), cost(b));
        a_missed.total_cmp(&b_missed).then(a.total_cmp(&b))
    };
    let points = curves.iter().map(|curve| (*curve, at(curve)));
    points.min_by(|a, b| cheaper(&a.1, &b.1)).expect("there are candidates")
}

/// A frame that voxel sizes are tried on.
struct SampleFrame {
    name: String,
    mesh: TriangleMesh,
}

/// Frames that follow each other.
type Sample = Vec<SampleFrame>;

/// The first frames, and as many from the middle on, without those that have no triangle.
fn samples(
    input: &Input,
    options: &EncodeOptions,
    observer: &Arc<dyn Observer>,
) -> Result<Vec<Sample>, EncodeError> {
    let open = || Ok(Capture::open(input, &options.hints(observer)?)?);
    let capture: Capture = open()?;
    let range = capture.range(options.frames)?;
    if range.is_empty() {
        return Err(EncodeError::NoFramesToChooseBy { name: input.name() });
    }
    let mut starts = vec![range.start];
    if range.len() >= 4 * SAMPLE_FRAMES {
        starts.push(range.start + range.len() / 2);
    }
    let frame = |frame: CapturedFrame| match frame.content {
        Content::Geometry(Geometry::Mesh(mesh)) => {
            Ok(SampleFrame { name: frame.name, mesh: turn_faces(&mesh).into_owned() })
        }
        Content::Geometry(geometry) if geometry.is_empty() => {
            Ok(SampleFrame { name: frame.name, mesh: TriangleMesh::default() })
        }
        _ => Err(EncodeError::NoMesh { name: frame.name }),
    };
    let skips = options.skip_bad_frames && capture.frames_stand_alone();
    let sample = |start: usize| -> Result<Sample, EncodeError> {
        let end = range.end.min(start + SAMPLE_FRAMES);
        let opened: Result<Capture, EncodeError> = open();
        let frames = opened?.read(start..end)?;
        // What is skipped then is no reason to stop now.
        let frames = frames.filter(|frame| !skips || frame.is_ok());
        let frames = frames.map(|read| frame(read?)).collect::<Result<Vec<_>, EncodeError>>()?;
        Ok(frames.into_iter().filter(|frame| !frame.mesh.triangles.is_empty()).collect())
    };
    let samples = starts.into_iter().map(sample).collect::<Result<Vec<_>, EncodeError>>()?;
    Ok(samples.into_iter().filter(|sample| !sample.is_empty()).collect())
}

/// Step in metres, bits a second of a whole GOP and mean error in metres of the samples.
fn measure(
    samples: &[Sample],
    (ingest, unit): (MeshIngest, Unit),
    header: &StreamHeader,
    settings: &EncoderSettings,
    step_m: f64,
) -> Result<(f64, f64, f64), EncodeError> {
    let (header, voxel) = (StreamHeader { grid: ingest.grid, ..*header }, ingest.grid.voxel_size);
    let sign = decide_sign(&samples[0][0].mesh, ingest.sign).0;
    let mut settings = *settings;
    settings.main = MainSettings {
        quality: FrameQuality::of_step((step_m / voxel.metres()) as f32),
        band: settings.main.band,
        ..Preset::Realtime.settings()
    };
    let (mut bits, mut errors) = ([Vec::new(), Vec::new()], Vec::new());
    for sample in samples {
        let mut encoder = Encoder::new(&header, settings);
        for SampleFrame { name, mesh } in sample {
            let volume = ingest_mesh(mesh, &ingest, sign);
            let volume = volume.map_err(|cause| {
                let extent_m = mesh.bounds().map(|(low, high)| (high - low).to_array());
                FrameError::Ingest { name: name.clone(), cause, extent_m, unit }
            })?;
            let frame = encoder.encode(&volume);
            let bytes = PacketHeader::BYTES + frame.payload().to_bytes().len();
            bits[usize::from(!frame.keyframe)].push(8.0 * bytes as f64);
        }
        let decoded = encoder.reconstruction().expect("a sample has frames");
        let surface = extract_surface(decoded, &SurfaceOptions { normals: false });
        let options = CompareOptions { spacing_m: voxel.metres(), seed: 0 };
        let last = sample.last().expect("a sample has frames");
        // The mean, as a root mean square is ruled by what no voxel size reaches: surfaces inside others, rims of sheets.
        let distances = compare(&last.mesh, &surface, &options);
        let distances = distances.map_err(|cause| EncodeError::Compare { name: last.name.clone(), cause })?;
        errors.push(distances.p2s_mean_mm.unwrap_or(f64::NAN) / 1e3);
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let (keyframe, gop) = (mean(&bits[0]), f64::from(settings.gop));
    let other = if bits[1].is_empty() { keyframe } else { mean(&bits[1]) };
    let rate = (keyframe + (gop - 1.0) * other) / gop * header.frame_rate.per_second();
    Ok((step_m, rate, mean(&errors)))
}
