//! Rate and error of colour on textured sequences, at several qualities.

use anyhow::{Context, Result};
use isv::raw::decode::colour::{ColourDecoder, ColourFrame, Reader};
use isv::raw::encode::colour::{ColourEncoder, ColourSettings, locate};
use isv::raw::encode::{Encoder, EncoderSettings, Preset};
use isv::raw::format::{FrameRate, Profile, StreamHeader};
use isv::raw::ingest::{MeshIngest, Reach, decide_sign, ingest_mesh, mesh_colours};
use isv::raw::io::{Colours, FrameSequence, Geometry, ReadOptions, Unit, read_geometry_as};
use isv::raw::take::encode::default_grid;
use isv::raw::take::stream::timed;
use isv::raw::volume::{ColourSample, SparseVolume, ycbcr_from_rgb};

/// Frames of a sequence that are measured.
const FRAMES: usize = 10;
/// Frames of a second, of which one is a keyframe.
const FRAMES_A_SECOND: f64 = 30.0;
/// Layers of samples: at voxels and at half voxels.
const LAYERS: u8 = 2;
/// Qualities that are measured.
const QUALITIES: [f32; 3] = [35.0, 50.0, 65.0];
/// Qualities that are measured without prediction from other frames.
const ALONE: [f32; 3] = [30.0, 40.0, 50.0];
/// Distance from the decoded surface (voxels) beyond which a colour of the source is not compared: inner layers lie there.
const FARTHEST: f32 = 0.25;

/// A frame as decoded, and the colours of its source.
pub(crate) struct Frame {
    volume: SparseVolume,
    colours: Vec<ColourSample>,
}

/// Codes the sequences of a folder, and prints a table of bytes and errors of their colour.
pub(crate) fn run(data: &str, sequences: &[String]) -> Result<()> {
    println!(
        "| sequence | quality | lambda | I, bytes | P, bytes | of these vectors | Mbps, one keyframe a second | Y, dB | Cb and Cr, dB | encode P, ms | decode I, ms | decode P, ms |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    for sequence in sequences {
        let frames = frames(&format!("{}/{sequence}", data.trim_end_matches('/')))?;
        let usual = ColourSettings::default().lambda;
        for (quality, lambda) in
            QUALITIES.map(|quality| (quality, usual)).into_iter().chain([(50.0, 1.5 * usual)])
        {
            let settings = ColourSettings { lambda, ..ColourSettings::of_quality(quality, LAYERS) };
            print_row(sequence, quality, settings, &frames)?;
        }
        let settings = ColourSettings::of_quality(50.0, LAYERS).with_preset(Preset::Realtime);
        print_row(&format!("{sequence}, preset realtime"), 50.0, settings, &frames)?;
        for quality in ALONE {
            let settings = ColourSettings::of_quality(quality, LAYERS);
            print_row_alone(sequence, quality, settings, &frames)?;
        }
    }
    Ok(())
}

/// The first frames of a sequence: geometry at the defaults (5 mm, quality 50), as decoders have it.
pub(crate) fn frames(folder: &str) -> Result<Vec<Frame>> {
    let grid = default_grid();
    let header = StreamHeader::new(Profile::Main, grid, FrameRate::DEFAULT);
    let mut encoder = Encoder::new(&header, EncoderSettings::default());
    let ingest = MeshIngest { reach: Reach::Surface, ..MeshIngest::new(grid) };
    let options = ReadOptions::new(Unit::Metre).with_colours(Colours::Keep);
    let frame = |path: &std::path::PathBuf| {
        let Geometry::Mesh(mesh) = read_geometry_as(path, &options)? else {
            anyhow::bail!("{}: no mesh", path.display());
        };
        let sign = decide_sign(&mesh, ingest.sign).0;
        encoder.encode(&ingest_mesh(&mesh, &ingest, sign)?);
        let volume = encoder.reconstruction().context("a frame was coded")?.clone();
        let spacing_m = grid.voxel_size.metres() / f64::from(1 << LAYERS);
        Ok(Frame { volume, colours: mesh_colours(&mesh, spacing_m) })
    };
    FrameSequence::open(folder)?.paths().iter().take(FRAMES).map(frame).collect()
}

/// Bytes and errors of a sequence.
pub(crate) struct Coded {
    /// Bytes of each frame.
    pub(crate) bytes: Vec<f64>,
    /// Bytes of modes and vectors in all frames but the first.
    vectors: usize,
    /// PSNR of Y, and of Cb and Cr (dB).
    pub(crate) psnr_db: [f64; 2],
    /// Time that encoding each frame took, and that decoding did (ms).
    times_ms: Vec<[f64; 2]>,
}

impl Coded {
    /// Rate (Mbps) with one keyframe a second, or of frames that are coded each `alone`.
    pub(crate) fn mbps(&self, alone: bool) -> f64 {
        let mean = |bytes: &[f64]| bytes.iter().sum::<f64>() / bytes.len().max(1) as f64;
        let Some((first, others)) = self.bytes.split_first().filter(|_| !alone) else {
            return FRAMES_A_SECOND * mean(&self.bytes) * 8e-6;
        };
        (first + (FRAMES_A_SECOND - 1.0) * mean(others)) * 8e-6
    }
}

/// Codes and decodes frames. `alone`: each without the others.
pub(crate) fn code(settings: ColourSettings, frames: &[Frame], alone: bool) -> Result<Coded> {
    let (mut encoder, mut decoder) = (ColourEncoder::new(settings), ColourDecoder::new(settings.layers));
    let (mut bytes, mut vectors, mut times_ms) = (Vec::new(), 0, Vec::new());
    let (mut squares, mut points) = ([0.0; 3], 0.0);
    for (number, Frame { volume, colours }) in frames.iter().enumerate() {
        // Every so many colours are as if they lay as far apart as the settings say.
        let thinner = (settings.spacing / ColourSettings::default().spacing).powi(2).round() as usize;
        let seen: Vec<ColourSample> = colours.iter().step_by(thinner).copied().collect();
        let (coded, encode_ms) = timed(|| encoder.encode(volume, &seen, alone || number == 0));
        let (decoded, decode_ms) = timed(|| decoder.decode(volume, &coded.bytes, 0, true));
        let decoded = decoded?;
        times_ms.push([encode_ms, decode_ms]);
        let (of_frame, count) = squared_errors(decoded, volume, colours);
        (0..3).for_each(|channel| squares[channel] += of_frame[channel]);
        points += count;
        bytes.push(coded.bytes.len() as f64);
        vectors += if number == 0 { 0 } else { coded.mode_bytes };
    }
    let psnr_db = |squares: f64| 10.0 * (255.0f64.powi(2) * points / squares).log10();
    let psnr_db = [psnr_db(squares[0]), psnr_db((squares[1] + squares[2]) / 2.0)];
    Ok(Coded { bytes, vectors, psnr_db, times_ms })
}

fn print_row(sequence: &str, quality: f32, settings: ColourSettings, frames: &[Frame]) -> Result<()> {
    let coded = code(settings, frames, false)?;
    let mbps = coded.mbps(false);
    let Coded { bytes, vectors, psnr_db, times_ms } = coded;
    let (first, others) = bytes.split_first().context("a sequence without frames")?;
    let (first_ms, others_ms) = times_ms.split_first().context("a sequence without frames")?;
    let median = |step: usize| {
        let mut times: Vec<f64> = others_ms.iter().map(|times| times[step]).collect();
        times.sort_unstable_by(f64::total_cmp);
        times.get(times.len() / 2).copied().unwrap_or(0.0)
    };
    let predicted = others.iter().sum::<f64>() / others.len().max(1) as f64;
    println!(
        "| {sequence} | {quality} | {:.2} | {first:.0} | {predicted:.0} | {:.0} | {:.3} | {:.2} | {:.2} | {:.0} | {:.0} | {:.0} |",
        settings.lambda,
        vectors as f64 / others.len().max(1) as f64,
        mbps,
        psnr_db[0],
        psnr_db[1],
        median(0),
        first_ms[1],
        median(1),
    );
    Ok(())
}

/// Prints what frames take that are coded each by itself.
fn print_row_alone(sequence: &str, quality: f32, settings: ColourSettings, frames: &[Frame]) -> Result<()> {
    let coded = code(settings, frames, true)?;
    let mbps = coded.mbps(true);
    let Coded { bytes, psnr_db, .. } = coded;
    let mean = bytes.iter().sum::<f64>() / bytes.len().max(1) as f64;
    println!(
        "| {sequence}, each frame alone | {quality} | {:.2} | {mean:.0} | | | {:.3} | {:.2} | {:.2} | | | |",
        settings.lambda, mbps, psnr_db[0], psnr_db[1],
    );
    Ok(())
}

/// Squared errors of Y, Cb and Cr at the source's own points near the decoded surface, and how many points these are.
fn squared_errors(frame: &ColourFrame, volume: &SparseVolume, colours: &[ColourSample]) -> ([f64; 3], f64) {
    let mut reader = Reader::new(frame);
    let (mut squares, mut count) = ([0.0; 3], 0.0);
    for sample in colours {
        let Some((position, normal, distance)) = locate(&mut reader, volume.grid(), sample) else { continue };
        if distance > FARTHEST {
            continue;
        }
        let Some(found) = reader.read(position, normal, LAYERS - 1) else { continue };
        let wanted = ycbcr_from_rgb(sample.colour);
        (0..3).for_each(|c| squares[c] += (f64::from(found[c]) / 64.0 - wanted[c]).powi(2));
        count += 1.0;
    }
    (squares, count)
}
