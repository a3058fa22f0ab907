//! `isv decode`: a stream to meshes, points or volumes.

use crate::backend::BackendArgs;
use crate::cli_enums::{AfterLossName, FormName, GlbName, LodName, UpName};
use crate::count;
use crate::interrupt;
use crate::origin;
use crate::output::{frames_in_words, say};
use crate::progress::Progress;
use crate::stats::{DecodedFrameStats, StatsFile};
use crate::threads::use_threads;
use crate::{memory, stream, words};
use anyhow::{Result, anyhow, bail};
use isv::raw::io::Unit;
use isv::raw::simplify::Budget;
use isv::raw::take::decode::{DecodeOptions, DecodedFrameReport, Job, OutputFormat, Reductions, Unfinished};
use isv::raw::take::{FrameRange, Input, Length, TextureSide};
use std::num::NonZero;
use std::path::PathBuf;

/// Decode an .isv stream into meshes, points or volumes
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The stream; - for standard input
    #[arg(value_name = "IN.isv")]
    input: PathBuf,
    /// Folder or file to write; - for standard output
    ///
    /// A folder gets frame_0000.ply and so on. A file holds one frame, or as .glb, .usdc or .usda an animation of
    /// all. Standard output takes one frame, or any number as PLY.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// What to make of each frame [default: what the format is for, else mesh]
    #[arg(help_heading = "Output", long = "as", value_enum)]
    form: Option<FormName>,
    /// File format [default: that of the output's name, else ply or npy]
    ///
    /// Meshes are written as ply, obj, stl, glb, usda (USD as text) or usdc (binary USD). Points are written as ply, pcd or
    /// xyz, volumes as npy or vdb. A .usd file is binary, or text with --format usda.
    #[arg(help_heading = "Output", long)]
    format: Option<OutputFormat>,
    /// Write vertex normals with meshes
    ///
    /// GLB and USD files and points always have theirs.
    #[arg(help_heading = "Meshes", long)]
    normals: bool,
    /// Encoding of meshes in GLB files [default: plain]
    #[arg(help_heading = "Meshes", long, value_enum, value_name = "ENCODING")]
    glb: Option<GlbName>,
    /// Bake colour into a texture of N x N texels: glb, obj
    ///
    /// Instead of colours of vertices, meshes get texture coordinates and an image, in GLB files as PNG, beside OBJ files with an MTL
    /// file. A patch of surface keeps its place in the texture from frame to frame where it can. GLB unless --format or the output's
    /// name says obj. N is 64 to 8192.
    #[arg(help_heading = "Meshes", long, value_name = "N", value_parser = texture_side)]
    texture: Option<TextureSide>,
    /// Leave vertex normals out of GLB and USD files
    #[arg(help_heading = "Meshes", long, conflicts_with = "normals")]
    no_normals: bool,
    /// Most faces of each mesh
    ///
    /// Edges are collapsed where that changes the surface least. isv says how far the result is from the decoded
    /// surface, and whether a mesh kept more faces because its parts cannot have fewer. With --simplify too, the
    /// first limit that is reached counts.
    #[arg(help_heading = "Meshes", long, value_name = "N", value_parser = count::parse::<NonZero<usize>>)]
    target_faces: Option<NonZero<usize>>,
    /// Collapse edges as long as the surface stays within this distance
    ///
    /// The distance is measured both ways from the decoded surface.
    #[arg(help_heading = "Meshes", long, value_name = "LENGTH")]
    simplify: Option<Length>,
    /// Unit of the output's coordinates: m, dm, cm, mm, in, ft or us-ft
    #[arg(help_heading = "Coordinates of the output", long, default_value_t = Unit::Metre)]
    units: Unit,
    /// Place of the stream's origin in the output: what isv encode was told
    ///
    /// It is in the unit of the output. Restores survey coordinates. PLY, OBJ and PCD files hold them in double precision
    /// where single precision would lose more than 0.1 mm or a tenth of a voxel. A GLB file moves its nodes. STL files can
    /// do neither, and isv says so.
    #[arg(help_heading = "Coordinates of the output", long, value_name = "X,Y,Z", value_parser = origin::parse, allow_hyphen_values = true)]
    origin: Option<[f64; 3]>,
    /// Axis of the output that points up; streams are Y up
    #[arg(
        help_heading = "Coordinates of the output",
        long,
        value_enum,
        default_value = "y",
        allow_hyphen_values = true
    )]
    up: UpName,
    /// Number of points a frame
    #[arg(help_heading = "Points", long, value_name = "N", conflicts_with = "spacing", value_parser = count::parse::<NonZero<usize>>)]
    points: Option<NonZero<usize>>,
    /// Edge of the square of surface that each point stands for [default: a voxel]
    #[arg(help_heading = "Points", long, value_name = "LENGTH")]
    spacing: Option<Length>,
    /// Level of detail: 2 and 4 decode at half and a quarter of the resolution
    #[arg(help_heading = "Output", long, value_enum, default_value = "1")]
    lod: LodName,
    /// Frames A to B-1, counted from 0; either end may be left out
    #[arg(help_heading = "Output", long, value_name = "A..B")]
    frames: Option<FrameRange>,
    /// What to do where packets are damaged or missing
    #[arg(help_heading = "Running", long, value_enum, default_value = "stop")]
    after_loss: AfterLossName,
    /// Number of threads [default: one a core]
    #[arg(help_heading = "Running", long, value_name = "N", value_parser = count::parse::<NonZero<usize>>)]
    threads: Option<NonZero<usize>>,
    /// Leave colour out
    #[arg(help_heading = "Output", long)]
    no_colour: bool,
    #[command(flatten)]
    backend: BackendArgs,
    /// Write the times of every frame to this file
    #[arg(help_heading = "Running", long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
}

impl Args {
    fn options(&self) -> DecodeOptions {
        DecodeOptions {
            form: self.form.map(Into::into),
            format: self.format,
            normals: if self.no_normals { Some(false) } else { self.normals.then_some(true) },
            glb: self.glb.map(Into::into),
            target_faces: self.target_faces,
            simplify: self.simplify,
            points: self.points,
            spacing: self.spacing,
            unit: self.units,
            origin: self.origin,
            up: self.up.into(),
            lod: self.lod.into(),
            frames: self.frames,
            after_loss: self.after_loss.into(),
            memory: memory::limit(),
            drop_colour: self.no_colour,
            texture: self.texture,
            takes_turns: self.stats.is_some() || self.threads.is_some_and(|threads| threads.get() == 1),
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let options = args.options();
    // What is wrong with the command line comes before what is wrong with the stream.
    options.settle(&args.output)?;
    use_threads(args.threads)?;
    let (input, observer) = (Input::from_argument(&args.input), words::observer());
    let open_device = || args.backend.open_for(options.lod, &*observer);
    let job =
        Job::prepare(&input, &args.output, &options, open_device, &observer, interrupt::cancellation())?;
    // From here on somebody looks whether Ctrl-C came.
    interrupt::listen()?;
    let mut stats = StatsFile::create(args.stats.as_deref(), [&args.input, &args.output])?;
    let progress = Progress::new(args.frames.and_then(FrameRange::count), "decoding");
    let done = job.run(|DecodedFrameReport { decode_ms, surface_ms, write_ms, .. }| {
        stats.push(DecodedFrameStats { decode_ms, surface_ms, write_ms });
        progress.step();
    });
    drop(progress);
    let report = done.map_err(|unfinished| in_words(args, unfinished))?;
    if let Some(budget) = options.budget() {
        say_reductions(&report.reductions, &budget);
    }
    let frames = frames_in_words(report.frames);
    say(format_args!("{frames}, {:.0} ms a frame", stats.wall_ms() / report.frames as f64));
    stats.commit()?;
    if report.is_cancelled {
        bail!("interrupted: {} holds the first {frames}", args.output.display());
    }
    Ok(())
}

/// Reads the size of a texture.
fn texture_side(text: &str) -> Result<TextureSide, String> {
    let side = text.parse().ok().and_then(TextureSide::from_texels);
    side.ok_or_else(|| {
        format!("a texture has {} to {} texels along a side", TextureSide::MIN, TextureSide::MAX)
    })
}

/// An error with what has been written in spite of it, and what goes on behind it.
fn in_words(args: &Args, Unfinished { error, written }: Unfinished) -> anyhow::Error {
    let error = anyhow::Error::from(error);
    let is_loss = stream::fault(&error).is_some_and(|fault| fault.is_loss() && !fault.is_cut());
    if written == 0 && !is_loss {
        return error;
    }
    let mut sentence = words::error(&error).0;
    if written > 0 {
        let (before, folder) = (frames_in_words(written), args.output.display());
        sentence += &format!(": {before} before this went to {folder}");
    }
    if is_loss {
        sentence += ": --after-loss hold goes on behind it";
    }
    anyhow!(sentence)
}

/// Says what was reached of a budget, and what was not.
fn say_reductions(reductions: &Reductions, budget: &Budget) {
    let Reductions { frames, faces_before, faces, worst, left, .. } = reductions;
    if *frames == 0 {
        return;
    }
    let [before, faces] = [faces_before, faces].map(|faces| faces / frames);
    let (error_m, number) = worst;
    let error_mm = error_m * 1e3;
    say(format_args!(
        "{faces} of {before} faces a frame left, largest error found {error_mm:.3} mm (frame {number})"
    ));
    let Some(target) = budget.faces else { return };
    let missed = left.iter().filter(|faces| **faces > target).count();
    if missed > 0 {
        let (frames, verb) = (frames_in_words(missed), if missed == 1 { "has" } else { "have" });
        let why = match budget.max_error_m {
            Some(error_m) => format!("--simplify {} allows no more", Length::from_metres(error_m)),
            None => "their parts and borders cannot have fewer".to_owned(),
        };
        say(format_args!("{frames} {verb} more than the {target} faces of --target-faces: {why}"));
    }
}
