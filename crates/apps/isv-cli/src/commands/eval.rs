//! `isv eval`: how far frames are from a reference.

use crate::capture::{self, invalid_points};
use crate::interrupt;
use crate::matching::matching_ranges;
use crate::memory;
use crate::origin;
use crate::output::print;
use crate::progress::Progress;
use crate::table::table_of;
use crate::terms::UpName;
use anyhow::{Context, Result, bail};
use comfy_table::Table;
use isv::raw::format::FrameRate;
use isv::raw::io::{Geometry, Unit};
use isv::raw::metrics::{CompareError, CompareOptions, GeometryError, Shape, compare, summary};
use isv::raw::surface::SurfaceOptions;
use isv::raw::take::FrameRange;
use isv::raw::take::Length;
use isv::raw::take::Prefetch;
use isv::raw::take::capture::{Capture, CapturedFrame, Content, Hints};
use isv::raw::volume::TriangleMesh;
use serde::Serialize;
use std::ops::Range;
use std::path::PathBuf;

/// Measure the geometric error of frames against a reference
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Reference: a folder or pattern of meshes or points, one file, or an .isv file
    reference: PathBuf,
    /// What is measured, of the same kinds
    test: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Edge of the square of surface that each sample stands for
    #[arg(long, value_name = "LENGTH", default_value = "5mm")]
    spacing: Length,
    /// Unit of the reference: m, dm, cm, mm, in, ft or us-ft
    ///
    /// Streams know theirs.
    #[arg(help_heading = "Coordinates of the input", long, default_value_t = Unit::Metre)]
    units: Unit,
    /// Unit of what is measured
    #[arg(help_heading = "Coordinates of the input", long, default_value_t = Unit::Metre)]
    test_units: Unit,
    /// Place of the reference, in its unit, that is the origin of what is measured
    ///
    /// What isv encode was told.
    #[arg(help_heading = "Coordinates of the input", long, value_name = "X,Y,Z", value_parser = origin::parse, allow_hyphen_values = true)]
    origin: Option<[f64; 3]>,
    /// Axis of the reference that points up: what isv encode was told
    #[arg(
        help_heading = "Coordinates of the input",
        long,
        value_enum,
        default_value = "y",
        allow_hyphen_values = true
    )]
    up: UpName,
    /// Place of what is measured, in its unit, that is the origin
    ///
    /// What isv decode was told.
    #[arg(help_heading = "Coordinates of the input", long, value_name = "X,Y,Z", value_parser = origin::parse, allow_hyphen_values = true)]
    test_origin: Option<[f64; 3]>,
    /// Axis of what is measured that points up: what isv decode was told
    #[arg(
        help_heading = "Coordinates of the input",
        long,
        value_enum,
        default_value = "y",
        allow_hyphen_values = true
    )]
    test_up: UpName,
    /// Leave out points that are not finite or lie at (0,0,0)
    ///
    /// Cameras write such points for "no reading".
    #[arg(long)]
    drop_invalid_points: bool,
    /// Frames a second at which animated files are sampled
    #[arg(long, default_value = "30")]
    fps: FrameRate,
    /// Frames A to B-1 of REFERENCE, counted from 0
    ///
    /// They are those of TEST too, unless it has just as many frames.
    #[arg(long, value_name = "A..B")]
    frames: Option<FrameRange>,
}

/// What was found of a frame; nothing where both sides are empty, which is neither right nor wrong by any distance.
type Found = Option<GeometryError>;

/// The fields of the mean and `frames` are the keys of `isv eval --json`.
#[derive(Debug, Serialize)]
struct Evaluation<'a> {
    #[serde(flatten)]
    mean: GeometryError,
    frames: &'a [Found],
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let invalid_points = invalid_points(args.drop_invalid_points);
    let hints = |unit, origin, up: UpName| Hints {
        frame_rate: args.fps,
        up: up.into(),
        invalid_points,
        ..capture::hints(unit).with_origin(origin)
    };
    let reference = capture::open(&args.reference, &hints(args.units, args.origin, args.up))?;
    let test = capture::open(&args.test, &hints(args.test_units, args.test_origin, args.test_up))?;
    let [reference_range, test_range] = matching_ranges(&reference, &test, args.frames)?;
    let first = reference_range.start;
    let pairs = geometries(reference, reference_range)?.zip(geometries(test, test_range)?);
    let frames = measure(args, pairs, first)?;
    let measured: Vec<GeometryError> = frames.iter().copied().flatten().collect();
    let Some(mean) = summary(&measured) else {
        bail!("{}: no frame has anything to measure", args.reference.display())
    };
    print(&if args.json {
        serde_json::to_string_pretty(&Evaluation { mean, frames: &frames })?
    } else {
        table(&frames, &mean, first).trim_fmt()
    })
}

/// The frames of a capture as they are measured: what is a volume by its zero crossing, all else as it is. They are read
/// and decoded ahead of their use.
fn geometries(capture: Capture, range: Range<usize>) -> Result<Prefetch<Result<Geometry>>> {
    let geometry = |frame: CapturedFrame| match frame.content {
        // A file of points without points is a frame without surface, whatever the other side holds.
        Content::Geometry(geometry) if geometry.is_empty() => Ok(Geometry::Mesh(TriangleMesh::default())),
        Content::Geometry(geometry) => Ok(geometry),
        Content::Volume(volume) | Content::Decoded(volume) => {
            let surface = memory::limit().surface(&volume, SurfaceOptions { normals: false });
            Ok(Geometry::Mesh(surface.context(frame.name)?))
        }
        Content::Depth(_) => {
            bail!("{}: depth images have no surface to measure: isv encode makes one of them", frame.name)
        }
    };
    let geometries = capture.read(range)?.map(move |frame| geometry(frame?));
    Ok(Prefetch::new(geometries, interrupt::cancellation()))
}

/// Compares pairs of reference and test; `first` is the number of the first.
fn measure(
    args: &Args,
    pairs: impl Iterator<Item = (Result<Geometry>, Result<Geometry>)>,
    first: usize,
) -> Result<Vec<Found>> {
    let options = CompareOptions { spacing_m: args.spacing.metres(), ..CompareOptions::default() };
    let progress = Progress::new(None, "measuring");
    let mut frames = Vec::new();
    for (reference, test) in pairs {
        let (reference, test) = (reference?, test?);
        let number = first + frames.len();
        frames.push(match compare(shape(&reference), shape(&test), &options) {
            Err(CompareError::BothEmpty) => None,
            error => Some(error.with_context(|| {
                format!("frame {number} of {} against {}", args.test.display(), args.reference.display())
            })?),
        });
        progress.step();
    }
    Ok(frames)
}

fn shape(geometry: &Geometry) -> Shape<'_> {
    match geometry {
        Geometry::Mesh(mesh) => mesh.into(),
        Geometry::Points(points) => points.into(),
    }
}

/// What a table shows of the distances to surfaces.
#[derive(Clone, Copy)]
struct Distances {
    header: &'static str,
    /// Mean, root mean square, 99th percentile and largest, in millimetres.
    figures: fn(&GeometryError) -> [Option<f64>; 4],
}

impl Distances {
    /// Those of both directions, or of the only one where only one side is a surface.
    fn found_in(mean: &GeometryError) -> Self {
        if mean.p2s_mean_mm.is_none() && mean.ref_to_test_mean_mm.is_some() {
            let figures = |f: &GeometryError| {
                [f.ref_to_test_mean_mm, f.ref_to_test_rms_mm, f.ref_to_test_p99_mm, f.ref_to_test_max_mm]
            };
            return Self { header: "to test mm", figures };
        }
        if mean.p2s_mean_mm.is_none() && mean.test_to_ref_mean_mm.is_some() {
            let figures = |f: &GeometryError| {
                [f.test_to_ref_mean_mm, f.test_to_ref_rms_mm, f.test_to_ref_p99_mm, f.test_to_ref_max_mm]
            };
            return Self { header: "to ref mm", figures };
        }
        let figures = |f: &GeometryError| [f.p2s_mean_mm, f.p2s_rms_mm, f.p2s_p99_mm, f.hausdorff_mm];
        Self { header: "p2s mm", figures }
    }
}

/// One row a frame and one for the mean; lengths in millimetres.
fn table(frames: &[Found], mean: &GeometryError, first: usize) -> Table {
    let distances = Distances::found_in(mean);
    let header = [
        "frame",
        distances.header,
        "rms",
        "p99",
        "max",
        "normal °",
        "chamfer",
        "floor",
        "D1 dB",
        "at most",
        "D2 dB",
        "area %",
        "parts",
    ];
    let mut table = table_of(header);
    for (number, frame) in (first..).zip(frames) {
        let row = frame.as_ref().map(|frame| row(number.to_string(), frame, distances));
        table.add_row(row.unwrap_or_else(|| {
            let dashes = header.iter().skip(1).map(|_| cell(None, 0));
            [number.to_string()].into_iter().chain(dashes).collect()
        }));
    }
    table.add_row(row("mean".to_owned(), mean, distances));
    table
}

fn row(name: String, error: &GeometryError, distances: Distances) -> Vec<String> {
    let mut row = vec![name];
    row.extend((distances.figures)(error).map(|mm| cell(mm, 3)));
    row.push(cell(error.normal_error_deg, 2));
    row.extend([Some(error.chamfer_mm), error.chamfer_floor_mm].map(|mm| cell(mm, 3)));
    row.extend([error.d1_psnr_db, error.d1_ceiling_db, error.d2_psnr_db].map(|db| cell(db, 2)));
    row.push(cell(error.area_ratio.map(|ratio| 100.0 * ratio), 2));
    row.push(match (error.components_test, error.components_ref) {
        (None, None) => cell(None, 0),
        (test, reference) => format!("{} / {}", count(test), count(reference)),
    });
    row
}

/// A figure, or a dash where there is none.
fn cell(figure: Option<f64>, digits: usize) -> String {
    figure.map_or_else(|| "-".to_owned(), |figure| format!("{figure:.digits$}"))
}

/// A number of parts, which is a whole number except in a mean.
fn count(figure: Option<f64>) -> String {
    cell(figure, usize::from(figure.is_some_and(|figure| figure.fract() != 0.0)))
}
