//! `isv decode`: a stream to meshes.

use crate::failure::usage;
use crate::frame_range::FrameRange;
use crate::output::{Output, frames_in_words, is_pipe};
use crate::progress::Progress;
use crate::stats::{DecodedFrameStats, StatsFile, timed};
use crate::stream::{self, StreamFrames};
use crate::terms::FormName;
use crate::threads::use_threads;
use anyhow::{Context, Result, anyhow, bail};
use isv::io::{Format, write_mesh, write_mesh_to};
use isv::surface::{SurfaceOptions, extract_surface};
use isv::volume::TriangleMesh;
use std::num::NonZero;
use std::path::{Path, PathBuf};

/// Decode an .isv stream into mesh files
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The stream; - for standard input
    #[arg(value_name = "IN.isv")]
    input: PathBuf,
    /// A folder for frame_0000.ply and so on; for one frame, also a .ply or .obj file, or - for standard output
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// What to make of each frame
    #[arg(long = "as", value_enum, default_value = "mesh")]
    form: FormName,
    /// Mesh format, ply or obj; without it, that of the output's name, or else ply
    #[arg(long)]
    format: Option<Format>,
    /// Write vertex normals
    #[arg(long)]
    normals: bool,
    /// Only these frames, counted from 0, without frame B
    #[arg(long, value_name = "A..B")]
    frames: Option<FrameRange>,
    /// Threads to work with; without it, one a core
    #[arg(long, value_name = "N")]
    threads: Option<NonZero<usize>>,
    /// Write times of every frame to this file
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let mut sink = MeshSink::new(&args.output, args.format)?;
    use_threads(args.threads)?;
    let mut frames = StreamFrames::open(&args.input, args.frames)?;
    let mut stats = StatsFile::create(args.stats.as_deref())?;
    let progress = Progress::new(args.frames.map(FrameRange::count), "decoding");
    let options = SurfaceOptions { normals: args.normals };
    let FormName::Mesh = args.form;
    let done = frames.by_ref().try_for_each(|frame| {
        let frame = frame?;
        let (mesh, surface_ms) = timed(|| extract_surface(&frame.volume, &options));
        let (written, write_ms) = timed(|| sink.take(frame.number, mesh));
        written?;
        stats.push(DecodedFrameStats { decode_ms: frame.decode_ms, surface_ms, write_ms });
        progress.step();
        Ok(())
    });
    drop(progress);
    done.map_err(|error| sink.account_for(error))?;
    if args.frames.is_none() && !frames.complete() {
        let name = stream::name(&args.input);
        eprintln!("{name}: ends without an index: it may have been cut after its last whole frame");
    }
    let count = sink.finish().with_context(|| stream::name(&args.input))?;
    eprintln!("{}, {:.0} ms a frame", frames_in_words(count), stats.wall_ms() / count as f64);
    stats.commit()
}

/// Where meshes go.
#[derive(Debug)]
struct MeshSink {
    path: PathBuf,
    format: Format,
    /// Whether the path is a folder of many frames, not the one mesh.
    is_folder: bool,
    /// The one mesh, kept until it is sure that there is no other.
    single: Option<TriangleMesh>,
    taken: usize,
}

impl MeshSink {
    fn new(path: &Path, format: Option<Format>) -> Result<Self> {
        let of_name = Format::of_path(path).filter(|_| !path.is_dir());
        if let (Some(asked), Some(named)) = (format, of_name)
            && asked != named
        {
            let path = path.display();
            return Err(usage(format!("--format {asked} does not fit the output's name, {path}")));
        }
        Ok(Self {
            path: path.to_owned(),
            format: format.or(of_name).unwrap_or(Format::Ply),
            is_folder: of_name.is_none() && !is_pipe(path),
            single: None,
            taken: 0,
        })
    }

    /// Takes the next frame. The folder is made for the first one, so that a stream that cannot be decoded leaves none.
    fn take(&mut self, number: usize, mesh: TriangleMesh) -> Result<()> {
        let path = self.path.display();
        if self.is_folder {
            if self.taken == 0 && !self.path.is_dir() {
                std::fs::create_dir(&self.path)
                    .with_context(|| format!("{path}: cannot make this folder"))?;
            }
            let file = self.path.join(format!("frame_{number:04}.{}", self.format));
            write_mesh(&file, &mesh, self.format)?;
        } else if self.single.replace(mesh).is_some() {
            bail!(
                "{path}: takes one frame, but there are more: name a folder, or one frame as in --frames 0..1"
            );
        }
        self.taken += 1;
        Ok(())
    }

    /// Writes the one mesh; returns how many frames were written in all.
    fn finish(self) -> Result<usize> {
        if self.taken == 0 {
            bail!("no frames in this stream");
        }
        if let Some(mesh) = &self.single {
            let mut output = Output::create(&self.path)?;
            write_mesh_to(&mut output, mesh, self.format)?;
            output.commit()?;
        }
        Ok(self.taken)
    }

    /// Adds to an error what has been written in spite of it.
    fn account_for(&self, error: anyhow::Error) -> anyhow::Error {
        if !self.is_folder || self.taken == 0 {
            return error;
        }
        let before = frames_in_words(self.taken);
        anyhow!("{error:#}: {before} before this went to {}", self.path.display())
    }
}
