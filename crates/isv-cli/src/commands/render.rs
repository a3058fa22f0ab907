//! `isv render`: pictures of frames.

use crate::capture::{Capture, Hints};
use crate::failure::usage;
use crate::frame_range::FrameRange;
use crate::frame_rate;
use crate::output::Output;
use crate::progress::Progress;
use anyhow::{Result, bail};
use isv::format::FrameRate;
use isv::io::Unit;
use isv::volume::TriangleMesh;
use isv_render::{Camera, Picture, Style, contact_sheet, render};
use std::num::NonZero;
use std::path::PathBuf;

/// Edge in pixels of a picture that stands alone, and of one in a contact sheet.
const DEFAULT_SIZES: [usize; 2] = [1024, 384];

/// Largest edge in pixels that can be asked for.
const MAX_SIZE: u64 = 16_384;

/// Most pixels of all pictures together: 1 GiB as RGBA.
const MAX_PIXELS: usize = 1 << 28;

/// Draw a frame, or a contact sheet of several, shaded by normal
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A folder, a pattern, a mesh file or an .isv file
    input: String,
    /// The picture to write; - for standard output
    #[arg(short, long, value_name = "OUT.png")]
    output: PathBuf,
    /// The frame to draw, counted from 0; the first without it
    #[arg(long, value_name = "N", conflicts_with = "frames")]
    frame: Option<usize>,
    /// Draw a contact sheet of these frames, without frame B
    #[arg(long, value_name = "A..B")]
    frames: Option<FrameRange>,
    /// Columns of the contact sheet; without it, about as many as rows
    #[arg(long, value_name = "N", requires = "frames")]
    columns: Option<NonZero<usize>>,
    /// Edge of each picture in pixels; without it, 1024, or 384 in a contact sheet
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u64).range(1..=MAX_SIZE))]
    size: Option<u64>,
    /// Turn of the camera about the up axis (y): 0 looks from +z, 90 from +x
    #[arg(long, value_name = "DEGREES", default_value = "0", allow_negative_numbers = true)]
    yaw: f64,
    /// Height of the camera above the horizon
    #[arg(long, value_name = "DEGREES", default_value = "0", allow_negative_numbers = true)]
    pitch: f64,
    /// Frames a second at which an animated file is sampled
    #[arg(long, value_parser = frame_rate::parse, default_value = "30")]
    fps: FrameRate,
    /// Unit of the input's coordinates: m, dm, cm, mm or in; .isv files know theirs
    #[arg(long, default_value_t = Unit::Metre)]
    units: Unit,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let source = Capture::open(&args.input, &Hints { frame_rate: args.fps, ..Hints::in_unit(args.units) })?;
    let one = args.frame.unwrap_or(0);
    let range = args.frames.unwrap_or(FrameRange { start: one, end: one.saturating_add(1) });
    let size = args.picture_size(range.count())?;
    let frames = source.range(Some(range))?;
    let mut output = Output::create(&args.output)?;
    let meshes = source.meshes(frames)?.collect::<Result<Vec<_>>>()?;
    let mut pictures = args.draw(&meshes, size)?;
    let picture = if args.frames.is_some() {
        let columns = args.columns.map_or((pictures.len() as f64).sqrt().ceil() as usize, NonZero::get);
        contact_sheet(&pictures, columns)
    } else {
        pictures.swap_remove(0)
    };
    picture.write_png(&mut output)?;
    output.commit()?;
    Ok(())
}

impl Args {
    /// Edge of each picture, once it is sure that `count` of them fit into memory.
    fn picture_size(&self, count: usize) -> Result<usize> {
        let default = DEFAULT_SIZES[usize::from(self.frames.is_some())];
        let size = self.size.map_or(default, |size| size as usize);
        match count.checked_mul(size * size) {
            Some(pixels) if pixels <= MAX_PIXELS => Ok(size),
            _ => Err(usage(format!(
                "{count} pictures of {size} x {size} pixels are too many for one file: take fewer or a smaller --size"
            ))),
        }
    }

    /// Draws all meshes through one camera.
    fn draw(&self, meshes: &[TriangleMesh], size: usize) -> Result<Vec<Picture>> {
        let bounds = meshes
            .iter()
            .filter_map(TriangleMesh::bounds)
            .reduce(|(low, high), (other_low, other_high)| (low.min(other_low), high.max(other_high)));
        let Some(bounds) = bounds else { bail!("{}: no surface to draw", self.input) };
        let camera = Camera::fitting(bounds, [size, size]).from_direction(self.yaw, self.pitch);
        let progress = Progress::new(Some(meshes.len()), "drawing");
        let draw = |mesh| {
            let picture = render(mesh, &camera, &Style::default());
            progress.step();
            picture
        };
        Ok(meshes.iter().map(draw).collect())
    }
}
