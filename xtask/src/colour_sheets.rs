//! Contact sheets of a textured take beside its streams at several rates.

use anyhow::{Context, Result};
use isv::EncodeOptions;
use isv::raw::io::{AtomicFile, Colours, Unit};
use isv::raw::metrics::CompareOptions;
use isv::raw::take::capture::{Capture, Hints};
use isv::raw::take::stream::StreamSummary;
use isv::raw::take::{Cancellation, Event, Input, MemoryLimit, evaluate};
use isv_study::{CapturedTake, Sheet, SheetStream, Take};
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

/// Qualities of geometry and colour: about 0.3, 0.6 and 1.2 Mbps of `liam_textured`.
const QUALITIES: [f32; 3] = [30.0, 48.0, 62.0];

/// End of the scale of distances.
const ERROR_RANGE_M: f64 = 0.005;

/// Draws a take beside its streams into `NAME.png` of a folder, where the streams are kept too, and prints rates and errors.
pub(crate) fn run(data: &Path, sequence: &str, out: &Path, yaw_degrees: f64) -> Result<()> {
    let input = data.join(sequence);
    let silent = Arc::new(|_: &Event| ());
    let hints =
        Hints { colours: Colours::Keep, ..Hints::in_unit(Unit::Metre, MemoryLimit::default(), silent) };
    let source = CapturedTake::open(&input, hints.clone(), None)?;
    let frames = vec![0, source.frames() / 2, source.frames() - 1];
    std::fs::create_dir_all(out).with_context(|| format!("{}: cannot make this folder", out.display()))?;
    println!(
        "| quality | geometry, Mbps | colour, Mbps | point to surface, mm | Y at the surface, dB | Y in pictures, dB | SSIM |"
    );
    println!("|---|---|---|---|---|---|---|");
    let mut streams = Vec::new();
    for quality in QUALITIES {
        let path = out.join(format!("{sequence}-{quality}.isv"));
        let options = EncodeOptions::quality(quality).colour_quality(quality);
        isv::take::encode(&input, &path, &options)?;
        streams.push(stream(&input, &path, quality, &frames, &hints)?);
    }
    let meshes = frames.iter().map(|frame| source.mesh(*frame)).collect::<Result<_, _>>()?;
    let sheet = Sheet { frames, source: meshes, streams, close_up: 1, yaw_degrees, range_m: ERROR_RANGE_M };
    let mut file = AtomicFile::create(&out.join(format!("{sequence}.png")))?;
    file.write_all(&sheet.png()?)?;
    Ok(file.commit()?)
}

/// Measures a stream, prints its row, and decodes the frames of the sheet.
fn stream(input: &Path, path: &Path, quality: f32, frames: &[usize], hints: &Hints) -> Result<SheetStream> {
    let [geometry, colour] = mbps(path)?;
    let open = |path: &Path| Capture::open(&Input::from_argument(path), hints);
    let options = CompareOptions::default();
    let (memory, stop) = (MemoryLimit::default(), Cancellation::new());
    let evaluation = evaluate(open(input)?, open(path)?, None, &options, memory, &stop, || ())?;
    let (error, colours) = (evaluation.mean, evaluation.mean_colours);
    let mm = error.p2s_mean_mm.context("both are surfaces")?;
    let y_db = colours.colour_y_psnr_db.context("both have colour")?;
    let [render_db, ssim] = [colours.render_y_psnr_db, colours.render_ssim].map(Option::unwrap_or_default);
    println!(
        "| {quality} | {geometry:.2} | {colour:.2} | {mm:.2} | {y_db:.1} | {render_db:.1} | {ssim:.3} |"
    );
    let take = CapturedTake::open(path, hints.clone(), None)?;
    let rate = format!("{:.2} Mbps: {geometry:.2} + {colour:.2}", geometry + colour);
    Ok(SheetStream {
        lines: [format!("quality {quality}"), rate, format!("{mm:.2} mm, Y {y_db:.1} dB")],
        meshes: frames.iter().map(|frame| take.mesh(*frame)).collect::<Result<_, _>>()?,
    })
}

/// Rates of geometry and of colour (megabits a second) of a stream with all its bytes.
fn mbps(path: &Path) -> Result<[f64; 2]> {
    let summary = StreamSummary::read(&Input::from_argument(path))?;
    let colour = summary.packets.iter().map(|packet| packet.bytes_colour as u64).sum::<u64>();
    Ok([summary.bytes - colour, colour].map(|bytes| bytes as f64 * 8e-6 / summary.duration_s))
}
