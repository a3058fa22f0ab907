//! A whole stream to files.

use super::files::FrameFiles;
use super::product::{Product, Recipe};
use super::reduction::Reduction;
use super::{DecodeOptions, DecodeTakeError, OutputFormat, Reductions};
use crate::baked_texture::TextureBaker;
use crate::stream::{self, AfterLoss, ConcealingFrames, DecodeSettings, StreamFrame, StreamFrames, timed};
use crate::{Cancellation, DeviceError, Input, Observer, OpenDevice, Prefetch, StreamError, Up};
use isv_decode::colour::ColourFrame;
use isv_format::StreamHeader;
use isv_surface::SurfaceOptions;
use rayon::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// A stream, and all that is decided before its first frame is decoded.
pub struct Job {
    name: String,
    frames: StreamFrameIterator,
    recipe: Recipe,
    baker: Option<TextureBaker>,
    files: FrameFiles,
    takes_turns: bool,
    cancellation: Cancellation,
    observer: Arc<dyn Observer>,
}

/// Result of decoding a frame.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct DecodedFrameReport {
    /// Number in the stream.
    pub number: usize,
    /// Time from packet to volume (ms).
    pub decode_ms: f64,
    /// Time from volume to mesh or points (ms); nearly 0 for volumes.
    pub surface_ms: f64,
    /// Time to write it (ms).
    pub write_ms: f64,
}

/// Result of decoding a stream.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DecodedReport {
    /// Frames written.
    pub frames: usize,
    /// Meshes that were to have fewer faces.
    pub reductions: Reductions,
    /// Whether the job was cancelled, so that the first frames alone were written.
    pub is_cancelled: bool,
}

/// A stream that could not be decoded to its end.
#[derive(Debug)]
pub struct Unfinished {
    /// Cause of the failure.
    pub error: DecodeTakeError,
    /// Frames before it that are in the folder of the output.
    pub written: usize,
}

impl From<DecodeTakeError> for Unfinished {
    fn from(error: DecodeTakeError) -> Self {
        Self { error, written: 0 }
    }
}

type StreamFrameIterator = Box<dyn Iterator<Item = Result<StreamFrame, StreamError>> + Send>;

impl Job {
    /// Opens a stream and checks the options against it. Nothing is written yet.
    ///
    /// # Errors
    /// See [`DecodeTakeError`].
    pub fn prepare(
        input: &Input,
        output: &Path,
        options: &DecodeOptions,
        open_device: impl FnOnce() -> Result<OpenDevice, DeviceError>,
        observer: &Arc<dyn Observer>,
        cancellation: &Cancellation,
    ) -> Result<Self, DecodeTakeError> {
        let (form, format) = options.settle(output)?;
        let settings = DecodeSettings {
            frames: options.frames,
            lod: options.lod,
            // OpenVDB files have fields alone.
            colour: format != OutputFormat::Vdb && !options.drop_colour,
            device: open_device()?,
            memory: options.memory,
            observer: Arc::clone(observer),
        };
        let source = Source::open(input, &settings, options.after_loss)?;
        let header = *source.header();
        if options.texture.is_some() && !header.colour_layers.is_some() {
            return Err(DecodeTakeError::NoColour { name: input.name() });
        }
        let baker = options.texture.map(TextureBaker::new);
        // A pipe is not read twice: its axes are those of most streams.
        let is_file = input.path().is_some_and(Path::is_file);
        let described = if is_file { stream::metadata(input)? } else { None };
        let up = described.map_or(Up::Y, |described| described.up_axis());
        let recipe = options.recipe(&header, form, format, up, &**observer)?;
        let frames = source.frames(recipe.surface())?;
        let glb = options.glb.unwrap_or_default();
        let files = FrameFiles::new(output, format, glb, recipe.placed, header.frame_rate)?;
        let (cancellation, observer) = (cancellation.clone(), Arc::clone(observer));
        let (name, takes_turns) = (input.name(), options.takes_turns);
        Ok(Self { name, frames, recipe, baker, files, takes_turns, cancellation, observer })
    }

    /// Decodes and writes all frames. `on_frame` gets a report of each.
    ///
    /// # Errors
    /// [`Unfinished`]: what went wrong, and how much was written before.
    pub fn run(self, mut on_frame: impl FnMut(DecodedFrameReport)) -> Result<DecodedReport, Unfinished> {
        let Self { name, frames, recipe, baker, mut files, takes_turns, cancellation, observer } = self;
        let mut reductions = Reductions::default();
        for frame in products(frames, recipe, baker, takes_turns, &cancellation) {
            let written = frame.and_then(|frame| {
                let MadeFrame { number, timestamp_ns, product, reduction, decode_ms, surface_ms, .. } = frame;
                reductions.add(number, reduction);
                let (written, write_ms) = timed(|| files.take(number, timestamp_ns, product, &*observer));
                written?;
                Ok(DecodedFrameReport { number, decode_ms, surface_ms, write_ms })
            });
            match written {
                Ok(report) => on_frame(report),
                Err(error) => {
                    let written = if files.is_folder() { files.taken() } else { 0 };
                    return Err(Unfinished { error, written });
                }
            }
        }
        let (frames, is_cancelled) = (files.taken(), cancellation.is_cancelled());
        match (frames, is_cancelled) {
            (0, true) => return Err(DecodeTakeError::CancelledBeforeFirstFrame { name }.into()),
            (0, false) => return Err(DecodeTakeError::NoFrames { name }.into()),
            _ => files.finish(&*observer)?,
        }
        Ok(DecodedReport { frames, reductions, is_cancelled })
    }
}

/// Source of frames.
enum Source {
    /// A stream that is to be whole.
    Whole(Box<StreamFrames>),
    /// One that may have losses.
    Lossy(Box<ConcealingFrames>),
}

impl Source {
    fn open(input: &Input, settings: &DecodeSettings, after_loss: AfterLoss) -> Result<Self, StreamError> {
        Ok(match after_loss {
            AfterLoss::Stop => Self::Whole(Box::new(StreamFrames::open(input, settings)?)),
            AfterLoss::Hold => Self::Lossy(Box::new(ConcealingFrames::open(input, settings)?)),
        })
    }

    fn header(&self) -> &StreamHeader {
        match self {
            Self::Whole(frames) => frames.header(),
            Self::Lossy(frames) => frames.header(),
        }
    }

    /// The frames, with their surfaces where a device makes these.
    fn frames(self, surface: Option<SurfaceOptions>) -> Result<StreamFrameIterator, StreamError> {
        Ok(match (self, surface) {
            (Self::Whole(frames), Some(options)) => Box::new(frames.with_surfaces(options)?),
            (Self::Whole(frames), None) => frames,
            (Self::Lossy(frames), Some(options)) => Box::new(frames.with_surfaces(options)?),
            (Self::Lossy(frames), None) => frames,
        })
    }
}

/// A frame ready to be written.
struct MadeFrame {
    number: usize,
    timestamp_ns: u64,
    product: Product,
    /// Colour of the frame, if it has any.
    colour: Option<Arc<ColourFrame>>,
    /// What became of a mesh that was to have fewer faces.
    reduction: Option<Reduction>,
    decode_ms: f64,
    surface_ms: f64,
}

/// The pipeline up to writing: the next frame is decoded while the surface of one is extracted and one is written.
fn products(
    frames: StreamFrameIterator,
    recipe: Recipe,
    mut baker: Option<TextureBaker>,
    takes_turns: bool,
    cancellation: &Cancellation,
) -> Box<dyn Iterator<Item = Result<MadeFrame, DecodeTakeError>>> {
    let make = move |frame: Result<StreamFrame, StreamError>| {
        let StreamFrame { number, timestamp_ns, volume, coded_blocks, surface, colour, decode_ms } = frame?;
        let (made, surface_ms) =
            timed(|| recipe.make(volume, coded_blocks.as_ref(), surface, colour.as_deref()));
        let (product, reduction) = made.map_err(|cause| DecodeTakeError::Frame { frame: number, cause })?;
        Ok(MadeFrame { number, timestamp_ns, product, colour, reduction, decode_ms, surface_ms })
    };
    let finish = move |frame: Result<MadeFrame, DecodeTakeError>| {
        let MadeFrame { number, timestamp_ns, product, colour, reduction, decode_ms, surface_ms } = frame?;
        let (finished, finish_ms) = timed(|| recipe.finish(product, colour.as_deref(), baker.as_mut()));
        let product = finished.map_err(|cause| DecodeTakeError::Frame { frame: number, cause })?;
        let surface_ms = surface_ms + finish_ms;
        Ok(MadeFrame { number, timestamp_ns, product, colour: None, reduction, decode_ms, surface_ms })
    };
    if takes_turns {
        let cancellation = cancellation.clone();
        return Box::new(frames.take_while(move |_| !cancellation.is_cancelled()).map(make).map(finish));
    }
    let frames = Prefetch::new(frames, cancellation);
    if recipe.budget.is_some() {
        // A mesh is simplified on one core: as many frames are at it as there are cores.
        let batches = Batches { frames, size: rayon::current_num_threads() };
        let made = batches.flat_map(move |batch| batch.into_par_iter().map(&make).collect::<Vec<_>>());
        return Box::new(Prefetch::new(made.map(finish), cancellation));
    }
    Box::new(Prefetch::new(frames.map(make).map(finish), cancellation))
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
