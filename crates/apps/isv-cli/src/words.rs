//! What libraries report, in words: with the flags that help.

use crate::memory;
use crate::output::say;
use crate::progress::Progress;
use isv::raw::fusion::FusionError;
use isv::raw::ingest::{IngestError, NormalSides, SideEvidence, SignMode};
use isv::raw::io::{OutputError, ReadError, Unit};
use isv::raw::take::capture::Remark;
use isv::raw::take::decode::{DecodeOptionsError, DecodeTakeError, ProductError};
use isv::raw::take::encode::{CaptureError, EncodeError, EncodeEvent, FrameError, OptionsError};
use isv::raw::take::{
    DistancesError, EvaluateError, Event, Length, MemoryError, Observer, StreamError, StreamFault,
};
use isv::raw::volume::{FitError, PointsError};
use std::sync::Arc;

/// Share of the points whose side is a guess, above which that is said.
const WORTH_A_WORD: f64 = 0.05;

/// Says events on standard error.
pub(crate) fn observer() -> Arc<dyn Observer> {
    Arc::new(|event: &Event| say(event_in_words(event)))
}

/// Says events on standard error, above a progress bar.
pub(crate) fn observer_above(progress: &Arc<Progress>) -> Arc<dyn Observer> {
    let progress = Arc::clone(progress);
    Arc::new(move |event: &Event| progress.note(&event_in_words(event)))
}

fn event_in_words(event: &Event) -> String {
    let Event::Encode(event) = event else { return event.to_string() };
    let advice = match event {
        EncodeEvent::Sign { mode, .. } | EncodeEvent::PointSign { mode, .. }
            if !matches!(mode, SignMode::Auto | SignMode::Paper) =>
        {
            return event.to_string().replacen("(as asked for", "(as --sign asks", 1);
        }
        EncodeEvent::Skipped { why } => return format!("skipped: {}", encoding(why)),
        EncodeEvent::Capture { remark: Remark::VoxelTaken(_), .. } => "; --voxel is another",
        EncodeEvent::Capture { remark: Remark::WithoutPose { .. }, .. } => {
            "; --skip-bad-frames leaves them out"
        }
        EncodeEvent::Capture { remark: Remark::StillAtFirst { frames, .. }, .. } => {
            return format!("{event}; --frames {frames}.. leaves them out");
        }
        EncodeEvent::VoxelFits { .. } => "; --voxel overrules",
        EncodeEvent::Sides { sides, .. } => advice_on_sides(*sides),
        EncodeEvent::ViewpointUnused { name } => {
            return format!(
                "{name}: --viewpoint is without effect, as the points have normals: --normals estimate makes new ones"
            );
        }
        EncodeEvent::SurfaceLost { has_sheets: true, .. } => ": smaller voxels keep it",
        EncodeEvent::SurfaceLost { .. } => ": smaller voxels keep what is thin, --sign sheet what is open",
        EncodeEvent::Tiny { .. } => ": check --units",
        EncodeEvent::ErrorMissed { .. } => ": smaller voxels reach it",
        _ => "",
    };
    format!("{event}{advice}")
}

fn advice_on_sides(sides: SideEvidence) -> &'static str {
    match sides.basis {
        NormalSides::Guessed(_) => {
            ": points look scanned from the origin; --viewpoint X,Y,Z is another place"
        }
        NormalSides::Outward if sides.guessed > WORTH_A_WORD => {
            ": give --viewpoint X,Y,Z, the scanner's place"
        }
        NormalSides::Viewpoint | NormalSides::Outward => "",
    }
}

/// An error in one sentence, with the flags that help. Whether the command line is to blame.
pub(crate) fn error(error: &anyhow::Error) -> (String, bool) {
    let mut parts = Vec::new();
    for cause in error.chain() {
        if let Some(error) = cause.downcast_ref::<EncodeError>() {
            parts.push(encoding(error));
        } else if let Some(error) = cause.downcast_ref::<FrameError>() {
            parts.push(frame(error));
        } else if let Some(error) = cause.downcast_ref::<CaptureError>() {
            parts.push(capture(error));
        } else if let Some(error) = cause.downcast_ref::<StreamError>() {
            parts.push(stream(error));
        } else if let Some(error) = cause.downcast_ref::<MemoryError>() {
            parts.push(memory_error(error));
        } else if let Some(error) = cause.downcast_ref::<DecodeTakeError>() {
            parts.push(decoding(error));
        } else if let Some(error) = cause.downcast_ref::<EvaluateError>() {
            parts.push(evaluating(error));
        } else if let Some(error) = cause.downcast_ref::<OptionsError>() {
            parts.push(options(error));
        } else {
            parts.push(cause.to_string());
            continue;
        }
        // What lies behind is in the sentence.
        break;
    }
    (parts.join(": "), error.chain().any(blames_command_line))
}

fn decoding(error: &DecodeTakeError) -> String {
    match error {
        DecodeTakeError::Stream(error) => stream(error),
        DecodeTakeError::Frame {
            frame,
            cause: ProductError::Memory(cause) | ProductError::Distances(DistancesError::Memory(cause)),
        } => format!("frame {frame}: {}", memory_error(cause)),
        DecodeTakeError::Options(DecodeOptionsError::NoPoints) => {
            "--points and --spacing need --as points".to_owned()
        }
        DecodeTakeError::Options(DecodeOptionsError::NoGlb) => {
            "--glb needs an output of GLB files: -o NAME.glb or --format glb".to_owned()
        }
        DecodeTakeError::Options(DecodeOptionsError::NoMeshNormals) => {
            "--no-normals is for meshes".to_owned()
        }
        DecodeTakeError::Options(DecodeOptionsError::NoMeshFaces) => {
            "--target-faces and --simplify are for meshes".to_owned()
        }
        DecodeTakeError::Options(
            DecodeOptionsError::FormatAndName { .. }
            | DecodeOptionsError::VolumePlaced { .. }
            | DecodeOptionsError::ArraysPlaced { .. },
        ) => format!("--{error}"),
        other => other.to_string(),
    }
}

fn evaluating(error: &EvaluateError) -> String {
    match error {
        EvaluateError::Capture(error) => capture(error),
        EvaluateError::Frame(error) => frame(error),
        EvaluateError::Memory { name, cause } => format!("{name}: {}", memory_error(cause)),
        other => other.to_string(),
    }
}

fn blames_command_line(cause: &(dyn std::error::Error + 'static)) -> bool {
    let of_output = |error: &OutputError| !matches!(error, OutputError::Io { .. });
    match cause.downcast_ref() {
        Some(DecodeTakeError::Options(_)) => return true,
        Some(DecodeTakeError::Output(error)) => return of_output(error),
        Some(DecodeTakeError::Stream(error)) => return matches!(error.fault, StreamFault::NoFile),
        _ => {}
    }
    let of_capture = |error: &CaptureError| matches!(error, CaptureError::NoRegularFile { .. });
    if let Some(EvaluateError::Capture(error)) = cause.downcast_ref() {
        return of_capture(error);
    }
    let of_stream = |error: &StreamError| matches!(error.fault, StreamFault::NoFile);
    match cause.downcast_ref::<EncodeError>() {
        Some(EncodeError::Options(_)) => true,
        Some(EncodeError::Capture(CaptureError::Stream(error))) => of_stream(error),
        Some(EncodeError::Capture(error)) => of_capture(error),
        _ => {
            cause.is::<OptionsError>()
                || cause.downcast_ref().is_some_and(of_output)
                || cause.downcast_ref().is_some_and(of_capture)
                || cause.downcast_ref().is_some_and(of_stream)
        }
    }
}

fn encoding(error: &EncodeError) -> String {
    match error {
        EncodeError::Options(error) => options(error),
        EncodeError::Capture(error) => capture(error),
        EncodeError::Frame(error) => frame(error),
        EncodeError::NoSample { name } => {
            format!("{name}: --voxel auto needs frames with a surface to choose by: give a length")
        }
        EncodeError::NoFramesToChooseBy { .. } => format!("{error}: give a length, as in --voxel 5mm"),
        EncodeError::NoMesh { name } => {
            format!("{name}: --voxel auto needs meshes: give a length, as in --voxel 5mm")
        }
        EncodeError::NoSurface { .. } => format!("{error}: check --units and --voxel"),
        other => other.to_string(),
    }
}

/// Options by the names of their flags.
pub(crate) fn options(error: &OptionsError) -> String {
    let advice = |chosen: bool| if chosen { "" } else { ": add --profile paper" };
    match error {
        OptionsError::Conflict(first, second) => {
            format!("--{first} and --{second}: only one of them can be met")
        }
        OptionsError::NotInMain { chosen, .. } | OptionsError::BlockInMain { chosen, .. } => {
            format!("--{error}{}", advice(*chosen))
        }
        OptionsError::Needs(option, other) => format!("--{option} needs --{other}"),
        other => format!("--{other}"),
    }
}

fn capture(error: &CaptureError) -> String {
    match error {
        CaptureError::NoRegularFile { .. } => format!("{error}: give - a stream from a pipe"),
        CaptureError::Read(error) => read(error),
        CaptureError::Stream(error) => stream(error),
        CaptureError::Unequal { .. } => {
            format!("{error}: name the ones to compare with --frames, or the --fps of an animated file")
        }
        other => other.to_string(),
    }
}

/// Names the option that helps against points that are nowhere.
fn read(error: &ReadError) -> String {
    match error {
        ReadError::Points { cause: PointsError::NotFinite { .. }, .. } => {
            format!("{error}: --drop-invalid-points leaves such points out")
        }
        other => other.to_string(),
    }
}

fn frame(error: &FrameError) -> String {
    match error {
        FrameError::Read(error) => read(error),
        FrameError::Stream(error) => stream(error),
        FrameError::Ingest { name, cause, extent_m, unit } => {
            let is_too_large = matches!(cause, IngestError::Fit(_));
            let question =
                extent_m.filter(|_| is_too_large).and_then(|extent_m| unit_question(extent_m, *unit));
            let question = question.map(|question| format!("{question} ")).unwrap_or_default();
            format!("{name}: {question}{}", ingest(cause))
        }
        FrameError::Fusion { cause: FusionError::Fit(cause), .. } => {
            let fits = Length::from_metres(cause.voxel_that_fits_m());
            format!("{error}: try --voxel {fits}, or --max-depth to leave out what is far away")
        }
        FrameError::Memory { name, cause } => format!("{name}: {}", memory_error(cause)),
        FrameError::NoSurfaceYet { name } => {
            format!("{name}: no surface yet: isv encode makes one of points and depth images")
        }
        other => other.to_string(),
    }
}

/// Names the options to change.
fn ingest(error: &IngestError) -> String {
    match error {
        IngestError::Fit(cause @ FitError::TooManyBlocks { .. }) => {
            let fits = Length::from_metres(cause.voxel_that_fits_m());
            format!("{error}: try --voxel {fits}, or check --units")
        }
        IngestError::Fit(FitError::OutOfRange { .. }) => {
            format!("{error}: move it with --origin, or check --units")
        }
        IngestError::TooSparse { voxel_that_fits_m, .. } => {
            let fits = Length::from_metres(*voxel_that_fits_m);
            format!("{error}: try --voxel {fits}, or --sign offset for the points themselves")
        }
        IngestError::NoNormals => format!("{error}: try --normals estimate or --sign offset"),
        other => other.to_string(),
    }
}

/// Asks for another unit, where a frame of such an extent, in metres, would be of a person's size with it.
fn unit_question(extent_m: [f64; 3], unit: Unit) -> Option<String> {
    /// Sizes of what is captured most often: from a bust to a person with raised arms.
    const USUAL_M: std::ops::RangeInclusive<f64> = 0.4..=3.0;
    let size = extent_m.into_iter().fold(0.0, f64::max) / unit.metres();
    let usual = |other: &Unit| *other != unit && USUAL_M.contains(&(size * other.metres()));
    let other = [Unit::Centimetre, Unit::Millimetre, Unit::Inch].into_iter().find(usual)?;
    let [x, y, z] =
        extent_m.map(|metres| if metres < 10.0 { format!("{metres:.1}") } else { format!("{metres:.0}") });
    Some(format!("the frame is {x} x {y} x {z} m: is it --units {other}?"))
}

fn stream(error: &StreamError) -> String {
    match &error.fault {
        StreamFault::Memory(cause) => format!("{}: {}", error.name, memory_error(cause)),
        _ if error.is_beyond_memory() => format!("{error}: {}", more_memory()),
        StreamFault::OtherHeader => {
            format!("{}: its own header is sound, and not that of --header-from", error.name)
        }
        fault => format!("{error}{}", advice_on_stream(fault)),
    }
}

fn advice_on_stream(fault: &StreamFault) -> &'static str {
    match fault {
        StreamFault::NotAKeyframe { .. } => ", or code the frames anew with isv encode --frames",
        StreamFault::FalseKeyframe { .. } => ": isv repair makes an index that is right",
        StreamFault::FalseIndex => ": isv repair makes one that does",
        StreamFault::NoFirstKeyframe => ": isv repair makes a stream that does",
        StreamFault::Differs { .. } => ": code one of them anew with isv encode",
        StreamFault::Header(_) => {
            ": if a damaged header is all that is wrong, --header-from takes that of another stream"
        }
        _ => "",
    }
}

fn memory_error(error: &MemoryError) -> String {
    match (error, memory::chosen()) {
        (MemoryError::Frame { .. }, None) => format!(
            "{error} that decoders have: try larger voxels, or --max-memory with a larger amount, which then decoders need too"
        ),
        (MemoryError::Frame { .. }, Some(_)) => {
            format!("{error}: {}; larger voxels need less", more_memory())
        }
        _ => format!("{error}: {}", more_memory()),
    }
}

fn more_memory() -> String {
    match memory::chosen() {
        Some(size) => format!("that is what --max-memory {size} has room for"),
        None => "--max-memory with a larger amount allows it".to_owned(),
    }
}
