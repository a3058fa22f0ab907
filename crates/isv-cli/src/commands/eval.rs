//! `isv eval`: how far frames are from a reference.

use crate::capture::{Capture, Hints};
use crate::frame_range::FrameRange;
use crate::frame_rate;
use crate::length::Length;
use crate::output::print;
use crate::progress::Progress;
use crate::table::table_of;
use anyhow::{Context, Result, bail};
use comfy_table::Table;
use isv::format::FrameRate;
use isv::io::Unit;
use isv::metrics::{CompareOptions, GeometryError, compare, summary};
use isv::volume::TriangleMesh;
use serde::Serialize;
use std::ops::Range;

/// Measure the geometric error of frames against a reference
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// What is right: a folder, a pattern, a mesh file or an .isv file
    reference: String,
    /// What is measured, of the same kinds
    test: String,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Surfaces are sampled once a square of this edge
    #[arg(long, value_name = "LENGTH", default_value = "5mm")]
    spacing: Length,
    /// Unit of the reference's coordinates: m, dm, cm, mm or in; .isv files know theirs
    #[arg(long, default_value_t = Unit::Metre)]
    units: Unit,
    /// Unit of the measured coordinates
    #[arg(long, default_value_t = Unit::Metre)]
    test_units: Unit,
    /// Frames a second at which animated files are sampled
    #[arg(long, value_parser = frame_rate::parse, default_value = "30")]
    fps: FrameRate,
    /// Only these frames of REFERENCE, and of TEST unless it has just as many
    #[arg(long, value_name = "A..B")]
    frames: Option<FrameRange>,
}

/// The fields of the mean and `frames` are the keys of `isv eval --json`.
#[derive(Debug, Serialize)]
struct Evaluation<'a> {
    #[serde(flatten)]
    mean: GeometryError,
    frames: &'a [GeometryError],
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let reference =
        Capture::open(&args.reference, &Hints { frame_rate: args.fps, ..Hints::in_unit(args.units) })?;
    let test = Capture::open(&args.test, &Hints { frame_rate: args.fps, ..Hints::in_unit(args.test_units) })?;
    let [reference_range, test_range] = matching_ranges(&reference, &test, args.frames)?;
    let first = reference_range.start;
    let frames = measure(args, reference.meshes(reference_range)?.zip(test.meshes(test_range)?), first)?;
    let Some(mean) = summary(&frames) else { bail!("{}: no frames to measure", args.reference) };
    print(&if args.json {
        serde_json::to_string_pretty(&Evaluation { mean, frames: &frames })?
    } else {
        table(&frames, &mean, first).trim_fmt()
    })
}

/// Which frames of the two are compared with each other.
fn matching_ranges(
    reference: &Capture,
    test: &Capture,
    frames: Option<FrameRange>,
) -> Result<[Range<usize>; 2]> {
    let [in_reference, in_test] = [reference.counted()?, test.counted()?];
    let reference_range = reference.range(frames)?;
    // A test made from the range alone has only its frames; it could not hold the range, unless that begins at 0.
    let test_range = if in_test == reference_range.len() { 0..in_test } else { test.range(frames)? };
    if test_range.len() != reference_range.len() {
        bail!(
            "{} has {in_test} frames but {} has {in_reference}: name the ones to compare with --frames, or the --fps of an animated file",
            test.name(),
            reference.name(),
        );
    }
    Ok([reference_range, test_range])
}

/// Compares pairs of reference and test; `first` is the number of the first.
fn measure(
    args: &Args,
    pairs: impl Iterator<Item = (Result<TriangleMesh>, Result<TriangleMesh>)>,
    first: usize,
) -> Result<Vec<GeometryError>> {
    let options = CompareOptions { spacing_m: args.spacing.metres(), ..CompareOptions::default() };
    let progress = Progress::new(None, "measuring");
    let mut frames = Vec::new();
    for (reference, test) in pairs {
        let (reference, test) = (reference?, test?);
        let number = first + frames.len();
        let error = compare(&reference, &test, &options)
            .with_context(|| format!("frame {number} of {} against {}", args.test, args.reference))?;
        frames.push(error);
        progress.step();
    }
    Ok(frames)
}

/// One row a frame and one for the mean; lengths in millimetres.
fn table(frames: &[GeometryError], mean: &GeometryError, first: usize) -> Table {
    let mut table = table_of([
        "frame",
        "p2s mean mm",
        "p2s rms",
        "p2s p99",
        "hausdorff",
        "chamfer mm",
        "its floor",
        "area",
        "components",
    ]);
    for (i, frame) in frames.iter().enumerate() {
        table.add_row(row((first + i).to_string(), frame));
    }
    table.add_row(row("mean".to_owned(), mean));
    table
}

fn row(name: String, error: &GeometryError) -> Vec<String> {
    let lengths = [
        error.p2s_mean_mm,
        error.p2s_rms_mm,
        error.p2s_p99_mm,
        error.hausdorff_mm,
        error.chamfer_mm,
        error.chamfer_floor_mm,
    ];
    let mut row = vec![name];
    row.extend(lengths.map(|mm| format!("{mm:.3}")));
    row.push(format!("{:.2} %", 100.0 * error.area_ratio));
    let round = |count: f64| (count * 10.0).round() / 10.0;
    row.push(format!("{} / {}", round(error.components_test), round(error.components_ref)));
    row
}
