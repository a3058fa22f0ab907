//! `isv demo`: the whole codec on a figure of its own.

use crate::output::{Output, check_stream_output, frames_in_words, print};
use crate::progress::Progress;
use crate::stats::megabits_per_second;
use crate::table::table_of;
use anyhow::{Context, Result};
use isv::raw::encode::colour::ColourSettings;
use isv::raw::encode::{EncoderSettings, MotionMode, Preset};
use isv::raw::format::{PaperParameters, Prediction, Profile};
use isv::raw::io::{Format, check_folder_name, check_frame_output, write_mesh};
use isv_study::{CodedFigure, DecodedFigure, FigureCoder, FigureTake};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The codecs shown: the paper's best, and profile `main` under its presets.
const CODECS: [DemoCodec; 4] = [
    DemoCodec::Paper,
    DemoCodec::Main(Preset::Realtime),
    DemoCodec::Main(Preset::Balanced),
    DemoCodec::Main(Preset::Archive),
];

/// The codec whose results are written to files: what `isv encode` does by default.
const KEPT: DemoCodec = DemoCodec::Main(Preset::Balanced);

/// A codec of the demo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DemoCodec {
    /// Profile `paper`, 3-DoF motion, at its steps for people.
    Paper,
    /// Profile `main`.
    Main(Preset),
}

impl DemoCodec {
    fn name(self) -> String {
        match self {
            Self::Paper => "paper, 3dof".to_owned(),
            Self::Main(preset) => format!("main, {preset}"),
        }
    }

    fn profile(self) -> Profile {
        match self {
            // A step is in sixteenths of a code, of which a voxel of 5 mm has 256: 1 mm and 10 mm.
            Self::Paper => Profile::Paper(PaperParameters {
                coefficients: 64,
                dc_step: 16 * 256 / 5,
                ac_step: 16 * 256 * 10 / 5,
            }),
            Self::Main(_) => Profile::Main,
        }
    }

    fn settings(self) -> EncoderSettings {
        let usual = EncoderSettings { checksums: true, ..EncoderSettings::default() };
        match self {
            Self::Paper => EncoderSettings { motion: MotionMode::Fixed(Prediction::ThreeDof), ..usual },
            Self::Main(preset) => EncoderSettings { main: preset.settings(), ..usual },
        }
    }

    /// How colour is coded. Profile `paper` has none, and preset archive codes it as balanced does.
    fn colour(self) -> Option<ColourSettings> {
        match self {
            Self::Paper | Self::Main(Preset::Archive) => None,
            Self::Main(preset) => {
                Some(ColourSettings { checksums: true, ..ColourSettings::default().with_preset(preset) })
            }
        }
    }
}

/// What is written into the folder: the stream, the pictures, and the folder of the meshes.
const STREAM: &str = "figure.isv";
const PICTURES: &str = "comparison.png";
const MESHES: &str = "decoded";

/// Try it without any input: animate a figure, encode and decode it, measure the error, draw it
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder for the stream, the pictures and the meshes; made if it is not there
    #[arg(short, long, value_name = "DIR", default_value = "isv-demo")]
    output: PathBuf,
    /// How many frames, at 30 a second
    #[arg(long, value_name = "N", default_value = "24", value_parser = clap::value_parser!(u16).range(1..=300))]
    frames: u16,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let folder = args.output.display();
    check_folder_name(&args.output, "a stream, pictures and meshes")?;
    let frames = usize::from(args.frames);
    check_free(&args.output, &FigureTake::picks_among(frames))?;
    std::fs::create_dir_all(&args.output).with_context(|| format!("{folder}: cannot make this folder"))?;
    let mut take = FigureTake::new(frames);
    let coded = encode(&mut take)?;
    let mut table = table_of([
        "profile",
        "geometry Mbps",
        "colour Mbps",
        "surface RMS mm",
        "p2s mean mm",
        "colour Y dB",
        "encode ms a frame",
        "decode ms a frame",
    ]);
    for (codec, coded) in CODECS.into_iter().zip(coded) {
        let progress = Progress::new(Some(frames), "decoding");
        let decoded = take.decode(&coded.bytes, || progress.step())?;
        drop(progress);
        let mbps = |bytes: usize| format!("{:.2}", megabits_per_second(bytes as u64, take.seconds()));
        let has_colour = coded.bytes_colour > 0;
        let colour_y_psnr_db = take.colour_error(&decoded)?.colour_y_psnr_db;
        table.add_row([
            codec.name(),
            mbps(coded.bytes.len() - coded.bytes_colour),
            if has_colour { mbps(coded.bytes_colour) } else { "-".to_owned() },
            format!("{:.3}", coded.surface_rms_mm),
            format!("{:.3}", take.p2s_mean_mm(&decoded)?),
            colour_y_psnr_db.map_or("-".to_owned(), |db| format!("{db:.1}")),
            format!("{:.0}", coded.encode_ms / frames as f64),
            format!("{:.0}", decoded.decode_ms / frames as f64),
        ]);
        if codec == KEPT {
            write_files(&take, &args.output, &coded, &decoded)?;
        }
    }
    print(&format!(
        "A figure of {} triangles with a texture, {}, voxels of 5mm, decoded volumes and colours verified by hash:\n\n{}\n\n\
         Colour Y dB is the PSNR of luma at points of the decoded surface. Profile paper has no colour, and archive codes it as \
         balanced does.\n\n\
         {folder}/{STREAM}       the stream of profile {}; isv info, verify, decode, render and view read it\n\
         {folder}/{PICTURES}   frames as captured, the same frames decoded, and how far they are apart\n\
         {folder}/{MESHES}          these frames as PLY files",
        take.triangles(),
        frames_in_words(frames),
        table.trim_fmt(),
        KEPT.name(),
    ))
}

/// Animates a take and codes it by all codecs, frame after frame.
fn encode(take: &mut FigureTake) -> Result<Vec<CodedFigure>> {
    let progress = Progress::new(Some(take.frames() * CODECS.len()), "animating and encoding");
    let coder = |codec: DemoCodec| FigureCoder::new(take, codec.profile(), codec.settings(), codec.colour());
    let mut coders = CODECS.into_iter().map(coder).collect::<Result<Vec<_>, _>>()?;
    while let Some(frame) = take.animate()? {
        for coder in &mut coders {
            coder.encode(&frame)?;
            progress.step();
        }
    }
    Ok(coders.into_iter().map(FigureCoder::finish).collect::<Result<_, _>>()?)
}

/// Refuses to overwrite what isv did not write.
fn check_free(folder: &Path, picks: &[usize]) -> Result<()> {
    check_stream_output(&[], &folder.join(STREAM))?;
    check_frame_output(&folder.join(PICTURES))?;
    for frame in picks {
        check_frame_output(&folder.join(mesh_name(*frame)))?;
    }
    Ok(())
}

fn mesh_name(frame: usize) -> String {
    format!("{MESHES}/frame_{frame:04}.ply")
}

fn write_files(take: &FigureTake, folder: &Path, coded: &CodedFigure, decoded: &DecodedFigure) -> Result<()> {
    let mut stream = Output::create(&folder.join(STREAM))?;
    stream.write_all(&coded.bytes)?;
    stream.commit()?;
    let mut picture = Output::create(&folder.join(PICTURES))?;
    take.comparison(decoded).write_png(&mut picture)?;
    picture.commit()?;
    let meshes = folder.join(MESHES);
    let sentence = || format!("{}: cannot make this folder", meshes.display());
    std::fs::create_dir_all(&meshes).with_context(sentence)?;
    for (frame, mesh) in take.picks().iter().zip(&decoded.meshes) {
        write_mesh(&folder.join(mesh_name(*frame)), mesh, Format::Ply)?;
    }
    Ok(())
}
