//! `isv decode`: a stream to meshes, points or volumes.

mod budget;
mod product;
mod sink;
mod target_frame;

use crate::backend::BackendArgs;
use crate::count;
use crate::failure::usage;
use crate::interrupt;
use crate::output::{frames_in_words, say};
use crate::progress::Progress;
use crate::stats::{DecodedFrameStats, StatsFile};
use crate::stream;
use crate::terms::{AfterLossName, FormName, GlbName, LodName};
use crate::threads::use_threads;
use crate::words;
use anyhow::{Context, Result, anyhow, bail};
use budget::{BudgetArgs, Reduction, Reductions};
use isv::raw::decode::Lod;
use isv::raw::format::StreamHeader;
use isv::raw::io::Format;
use isv::raw::surface::SurfaceOptions;
use isv::raw::take::FrameRange;
use isv::raw::take::Length;
use isv::raw::take::Prefetch;
use isv::raw::take::stream::timed;
use isv::raw::take::stream::{ConcealingFrames, StreamFrame, StreamFrames};
use isv::raw::take::{Input, StreamError};
use product::{OutputFormat, Product, Recipe};
use rayon::prelude::*;
use sink::Sink;
use std::num::NonZero;
use std::path::PathBuf;
use target_frame::TargetFrameArgs;

/// Decode an .isv stream into meshes, points or volumes
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The stream; - for standard input
    #[arg(value_name = "IN.isv")]
    input: PathBuf,
    /// Folder or file to write; - for standard output
    ///
    /// A folder gets frame_0000.ply and so on. A file holds one frame, or as .glb an animation of all. Standard
    /// output takes one frame, or any number as PLY.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// What to make of each frame [default: what the format is for, else mesh]
    #[arg(help_heading = "Output", long = "as", value_enum)]
    form: Option<FormName>,
    /// File format [default: that of the output's name, else ply or npy]
    ///
    /// Meshes are written as ply, obj, stl or glb, points as ply, pcd or xyz, volumes as npy or vdb.
    #[arg(help_heading = "Output", long)]
    format: Option<OutputFormat>,
    /// Write vertex normals with meshes
    ///
    /// GLB files and points always have theirs.
    #[arg(help_heading = "Meshes", long)]
    normals: bool,
    /// Encoding of meshes in GLB files [default: plain]
    #[arg(help_heading = "Meshes", long, value_enum, value_name = "ENCODING")]
    glb: Option<GlbName>,
    /// Leave vertex normals out of GLB files
    #[arg(help_heading = "Meshes", long, conflicts_with = "normals")]
    no_normals: bool,
    #[command(flatten)]
    budget: BudgetArgs,
    #[command(flatten)]
    target_frame: TargetFrameArgs,
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
    #[command(flatten)]
    backend: BackendArgs,
    /// Write the times of every frame to this file
    #[arg(help_heading = "Running", long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let (form, format) = OutputFormat::settle(args.form, args.format, &args.output)?;
    if form != FormName::Points && (args.points.is_some() || args.spacing.is_some()) {
        return Err(usage("--points and --spacing need --as points"));
    }
    if args.glb.is_some() && format != OutputFormat::Geometry(Format::Glb) {
        return Err(usage("--glb needs an output of GLB files: -o NAME.glb or --format glb"));
    }
    if form != FormName::Mesh && args.no_normals {
        return Err(usage("--no-normals is for meshes"));
    }
    let budget = args.budget.budget(form)?;
    use_threads(args.threads)?;
    let source = Source::open(args)?;
    // From here on somebody looks whether Ctrl-C came.
    interrupt::listen()?;
    let header = *source.header();
    let density = product::density(args.points, args.spacing, args.voxel_m(&header));
    let target_frame = args.target_frame.target_frame(form, format, args.voxel_m(&header))?;
    let recipe = Recipe {
        form,
        normals: args.wants_normals(format),
        density,
        profile: header.profile,
        budget,
        target_frame,
    };
    let frames = source.frames(recipe.surface())?;
    let mut stats = StatsFile::create(args.stats.as_deref(), [&args.input, &args.output])?;
    let mut sink = Sink::new(&args.output, format, target_frame, header.frame_rate)?.with_glb(args.glb);
    let progress = Progress::new(args.frames.and_then(FrameRange::count), "decoding");
    let mut reductions = Reductions::default();
    let done = products(frames, recipe, args.taking_turns()).try_for_each(|frame| {
        let DecodedFrame { number, timestamp_ns, product, reduction, decode_ms, surface_ms } = frame?;
        reductions.add(number, reduction);
        let (written, write_ms) = timed(|| sink.take(number, timestamp_ns, product));
        written?;
        stats.push(DecodedFrameStats { decode_ms, surface_ms, write_ms });
        progress.step();
        Ok(())
    });
    drop(progress);
    done.map_err(|error| {
        let is_loss = stream::fault(&error).is_some_and(|fault| fault.is_loss() && !fault.is_cut());
        let error = sink.account_for(error);
        match is_loss {
            true => anyhow!("{}: --after-loss hold goes on behind it", words::error(&error).0),
            false => error,
        }
    })?;
    let count = sink.finish().with_context(|| stream::name(&args.input))?;
    if let Some(budget) = &budget {
        reductions.say(budget);
    }
    say(format_args!("{}, {:.0} ms a frame", frames_in_words(count), stats.wall_ms() / count as f64));
    stats.commit()?;
    if interrupt::requested() {
        bail!("interrupted: {} holds the first {}", args.output.display(), frames_in_words(count));
    }
    Ok(())
}

impl Args {
    /// Edge of a decoded voxel.
    fn voxel_m(&self, header: &StreamHeader) -> f64 {
        header.grid.voxel_size.metres() * f64::from(Lod::from(self.lod).voxels())
    }

    /// Whether meshes get vertex normals: GLB files are for viewers, which shade flat without them.
    fn wants_normals(&self, format: OutputFormat) -> bool {
        self.normals || (format == OutputFormat::Geometry(Format::Glb) && !self.no_normals)
    }

    /// Whether each frame is finished before the next is decoded.
    fn taking_turns(&self) -> bool {
        self.stats.is_some() || self.threads.is_some_and(|threads| threads.get() == 1)
    }
}

/// Where frames come from.
enum Source {
    /// A stream that is to be whole.
    Whole(Box<StreamFrames>),
    /// One that may have losses.
    Lossy(Box<ConcealingFrames>),
}

impl Source {
    fn open(args: &Args) -> Result<Self> {
        let input = Input::from_argument(&args.input);
        let settings = args.backend.decode_settings(args.frames, args.lod.into())?;
        Ok(match args.after_loss {
            AfterLossName::Stop => Self::Whole(Box::new(StreamFrames::open(&input, &settings)?)),
            AfterLossName::Hold => Self::Lossy(Box::new(ConcealingFrames::open(&input, &settings)?)),
        })
    }

    fn header(&self) -> &StreamHeader {
        match self {
            Self::Whole(frames) => frames.header(),
            Self::Lossy(frames) => frames.header(),
        }
    }

    /// The frames, with their surfaces where a backend makes these.
    fn frames(self, surface: Option<SurfaceOptions>) -> Result<StreamFrameIterator> {
        Ok(match (self, surface) {
            (Self::Whole(frames), Some(options)) => Box::new(frames.with_surfaces(options)?),
            (Self::Whole(frames), None) => frames,
            (Self::Lossy(frames), Some(options)) => Box::new(frames.with_surfaces(options)?),
            (Self::Lossy(frames), None) => frames,
        })
    }
}

type StreamFrameIterator = Box<dyn Iterator<Item = Result<StreamFrame, StreamError>> + Send>;

/// A frame ready to be written.
struct DecodedFrame {
    number: usize,
    timestamp_ns: u64,
    product: Product,
    /// What became of a mesh that was to have fewer faces.
    reduction: Option<Reduction>,
    decode_ms: f64,
    surface_ms: f64,
}

/// The pipeline up to writing: the next frame is decoded while the surface of one is extracted and one is written.
fn products(
    frames: StreamFrameIterator,
    recipe: Recipe,
    taking_turns: bool,
) -> Box<dyn Iterator<Item = Result<DecodedFrame>>> {
    let make = move |frame: Result<StreamFrame, StreamError>| {
        let StreamFrame { number, timestamp_ns, volume, coded_blocks, surface, decode_ms } = frame?;
        let (made, surface_ms) = timed(|| recipe.make(volume, coded_blocks.as_ref(), surface));
        let (product, reduction) = made.with_context(|| format!("frame {number}"))?;
        Ok(DecodedFrame { number, timestamp_ns, product, reduction, decode_ms, surface_ms })
    };
    let stop = interrupt::cancellation();
    if taking_turns {
        Box::new(frames.take_while(|_| !interrupt::requested()).map(make))
    } else if recipe.budget.is_some() {
        // A mesh is simplified on one core: as many frames are at it as there are cores.
        let batches = Batches { frames: Prefetch::new(frames, stop), size: rayon::current_num_threads() };
        let made = batches.flat_map(move |batch| batch.into_par_iter().map(&make).collect::<Vec<_>>());
        Box::new(Prefetch::new(made, stop))
    } else {
        Box::new(Prefetch::new(Prefetch::new(frames, stop).map(make), stop))
    }
}

/// Frames in groups, which are worked on at the same time.
struct Batches<I> {
    frames: I,
    /// Frames of a group, but for the last one.
    size: usize,
}

impl<T, I: Iterator<Item = T>> Iterator for Batches<I> {
    type Item = Vec<T>;

    fn next(&mut self) -> Option<Vec<T>> {
        let batch: Vec<T> = self.frames.by_ref().take(self.size).collect();
        (!batch.is_empty()).then_some(batch)
    }
}
