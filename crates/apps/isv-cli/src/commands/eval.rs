//! `isv eval`: how far frames are from a reference.

use crate::capture::{self, invalid_points};
use crate::cli_enums::UpName;
use crate::interrupt;
use crate::memory;
use crate::origin;
use crate::output::print;
use crate::progress::Progress;
use crate::table::table_of;
use anyhow::Result;
use comfy_table::Table;
use isv::raw::format::FrameRate;
use isv::raw::io::Unit;
use isv::raw::metrics::{ColourError, CompareOptions, GeometryError};
use isv::raw::take::capture::Hints;
use isv::raw::take::{Evaluation, FrameRange, Length, evaluate};
use std::path::PathBuf;

/// Measure the error of frames against a reference: of their geometry and of their colours
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
    /// Animation of REFERENCE, by name or number from 0: what isv encode was told
    ///
    /// Without it, the first that moves anything plays.
    #[arg(long, value_name = "NAME")]
    animation: Option<String>,
    /// Animation of TEST, by name or number from 0
    ///
    /// Without it, the first that moves anything plays.
    #[arg(long, value_name = "NAME")]
    test_animation: Option<String>,
    /// Frames A to B-1 of REFERENCE, counted from 0
    ///
    /// They are those of TEST too, unless it has just as many frames.
    #[arg(long, value_name = "A..B")]
    frames: Option<FrameRange>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let invalid_points = invalid_points(args.drop_invalid_points);
    let hints = |unit, origin, up: UpName, animation: &Option<String>| Hints {
        frame_rate: args.fps,
        animation: animation.clone(),
        up: up.into(),
        invalid_points,
        ..capture::colour_hints(unit).with_origin(origin)
    };
    let of_reference = hints(args.units, args.origin, args.up, &args.animation);
    let of_test = hints(args.test_units, args.test_origin, args.test_up, &args.test_animation);
    let reference = capture::open(&args.reference, &of_reference)?;
    let test = capture::open(&args.test, &of_test)?;
    let options = CompareOptions { spacing_m: args.spacing.metres(), ..CompareOptions::default() };
    let progress = Progress::new(None, "measuring");
    let (memory, stop) = (memory::limit(), interrupt::cancellation());
    let evaluation = evaluate(reference, test, args.frames, &options, memory, stop, || progress.step())?;
    drop(progress);
    print(&if args.json {
        serde_json::to_string_pretty(&evaluation.figures())?
    } else {
        let Evaluation { first, frames, mean, .. } = &evaluation;
        let tables = [Some(table(frames, mean, *first)), colour_table(&evaluation)];
        tables.iter().flatten().map(Table::trim_fmt).collect::<Vec<_>>().join("\n\n")
    })
}

/// What a table shows of the distances to surfaces.
#[derive(Clone, Copy)]
struct Distances {
    header: &'static str,
    /// Mean, root mean square, 99th percentile and largest, in millimetres.
    figures: fn(&GeometryError) -> [Option<f64>; 4],
}

impl Distances {
    /// Reads the distances of both directions, or of one direction if only one side is a surface.
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
fn table(frames: &[Option<GeometryError>], mean: &GeometryError, first: usize) -> Table {
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

/// One row a frame and one for the mean, if anything has colours on both sides.
fn colour_table(evaluation: &Evaluation) -> Option<Table> {
    let Evaluation { first, colours, mean_colours, .. } = evaluation;
    mean_colours.colour_y_psnr_db?;
    let mut table =
        table_of(["frame", "colour Y dB", "YCbCr dB", "both ways Y dB", "YCbCr dB", "render Y dB", "SSIM"]);
    for (number, error) in (*first..).zip(colours) {
        table.add_row(colour_row(number.to_string(), error));
    }
    table.add_row(colour_row("mean".to_owned(), mean_colours));
    Some(table)
}

fn colour_row(name: String, error: &ColourError) -> Vec<String> {
    let decibels = [
        error.colour_y_psnr_db,
        error.colour_ycc_psnr_db,
        error.colour_y_symmetric_psnr_db,
        error.colour_ycc_symmetric_psnr_db,
        error.render_y_psnr_db,
    ];
    let mut row = vec![name];
    row.extend(decibels.map(|db| cell(db, 2)));
    row.push(cell(error.render_ssim, 4));
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

#[cfg(test)]
mod tests {
    use super::*;

    fn colours(psnr: Option<f64>, ssim: Option<f64>) -> ColourError {
        ColourError { colour_y_psnr_db: psnr, render_ssim: ssim, ..ColourError::default() }
    }

    #[test]
    fn a_row_has_all_figures_of_colours() {
        let row = colour_row("3".to_owned(), &colours(Some(38.254), Some(0.93451)));
        assert_eq!(row, ["3", "38.25", "-", "-", "-", "-", "0.9345"]);
    }
}
