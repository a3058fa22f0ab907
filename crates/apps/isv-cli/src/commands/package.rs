//! `isv package`: a take in several rates with the player, as files for any web host.

use super::encode::{CaptureArgs, Passes};
use crate::cli_enums::LodName;
use crate::count;
use crate::interrupt;
use crate::output::{quoted, say};
use crate::progress::Progress;
use crate::stats::megabits_per_second;
use crate::threads::use_threads;
use crate::{memory, stream, words};
use anyhow::{Context, Result, bail};
use isv::raw::decode::Lod;
use isv::raw::encode::Band;
use isv::raw::format::StreamHeader;
use isv::raw::io::{Geometry, check_folder_name};
use isv::raw::mp4::{
    Mp4File, Rung, Segment, Segments, TrackKind, Trimmed, codec_string, is_stream_name, master_playlist,
    media_playlist, segment_name, write_tracks,
};
use isv::raw::take::capture::{Capture, Content, ContentKind};
use isv::raw::take::encode::{EncodeOptions, Job, ProfileChoice, VoxelChoice};
use isv::raw::take::stream::{Container, StreamOutput, StreamSummary, Tracks, mux};
use isv::raw::take::{BitRate, FrameRange, Input, Length, MemorySize};
use isv_serve::{ExportFolder, Page, PageOptions};
use std::fs::File;
use std::io::{BufReader, BufWriter, IntoInnerError};
use std::num::NonZero;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

/// Name of the playlist that the page opens.
const MASTER: &str = "master.m3u8";
/// Most rungs: below a hundredth of the best rate nothing is worth watching.
const MOST_RUNGS: usize = 8;

/// Encode a take in several rates, each half of the one before, and write them with the player for any web host
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    capture: CaptureArgs,
    /// Folder to write: new, empty, or that of an earlier run
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Number of rates, 1 to 8
    ///
    /// The best has the quality or rate that is asked for. A stream whose keyframes come regularly is itself the best.
    #[arg(long, value_name = "N", default_value = "3", value_parser = count::parse::<NonZero<usize>>)]
    rungs: NonZero<usize>,
    /// How many times larger the voxels of lower rates may get: 1, 2 or 4
    ///
    /// A rate of a quarter has voxels twice as large, one of a sixteenth voxels four times as large. With 1, all
    /// rates have the same voxels. The lowest rates then may not be reached. Meshes without --voxel get the size
    /// that serves each rate best.
    #[arg(long, value_enum, default_value = "4", value_name = "N")]
    lod: LodName,
}

/// A rate of the take, in a file of its own.
struct CodedRung {
    segments: Segments<BufReader<File>>,
    header: StreamHeader,
    bytes: u64,
    seconds: f64,
    /// The time (ns) of sound that belongs to it; `None` for all.
    part: Option<Range<u64>>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let rungs = args.rungs.get();
    if rungs > MOST_RUNGS {
        bail!("--rungs: 1 to {MOST_RUNGS}, not {rungs}");
    }
    check_folder_name(&args.output, "the files of a page")?;
    use_threads(args.capture.threads)?;
    interrupt::listen()?;
    let mut folder = ExportFolder::create(&args.output)?;
    let input = Input::from_argument(&args.capture.input);
    let mut options = EncodeOptions { fixed_gop: true, ..args.capture.options() };
    let may_copy = !is_asked_for(&options);
    // Groups of pictures that stand alone meet a rate in two passes.
    if options.main.bitrate.is_some() && options.main.passes.is_none() {
        options.main.passes = Some(2);
    }
    // What later steps need is looked at before hours of encoding.
    if rungs > 1 {
        check_rates(&input, &options)?;
        // The whole band alone would ask for another profile than a rate.
        options.profile = Some(ProfileChoice::Main);
    }
    drop(args.capture.open_tracks(&input, None, "sound.mp4".as_ref())?);
    let best = match regular_gop(&input)? {
        Some(gop) if may_copy => {
            options.gop = gop;
            copied(&input, gop)?
        }
        _ => encoded(args, &input, &options, 1)?,
    };
    let best_bits = best.bytes as f64 * 8.0 / best.seconds.max(f64::MIN_POSITIVE);
    let best_voxel_m = best.header.grid.voxel_size.metres();
    let mut coded = vec![best];
    for rung in 1..rungs {
        let bits = best_bits / f64::from(1u32 << rung);
        let larger = larger_voxels(rung, args.lod.into());
        let options = lower(&options, &input, bits, Length::from_metres(best_voxel_m * larger))?;
        coded.push(encoded(args, &input, &options, rung + 1)?);
    }
    check_aligned(&coded)?;
    let tracks = args.capture.open_tracks(&input, coded[0].part.clone(), "sound.mp4".as_ref())?;
    let sound = sound(tracks, coded[0].seconds)?;
    let master = write_ladder(&mut folder, &mut coded, sound)?;
    folder.write(MASTER, master.as_bytes())?;
    let options = PageOptions { up: None, max_memory: memory::chosen().map(MemorySize::bytes) };
    for (path, bytes) in Page::player().export(&[MASTER.to_owned()], &options) {
        folder.write(path, &bytes)?;
    }
    if interrupt::requested() {
        bail!("interrupted: nothing was written");
    }
    folder.commit()?;
    let rates: Vec<_> =
        coded.iter().map(|rung| format!("{:.3}", megabits_per_second(rung.bytes, rung.seconds))).collect();
    say(format_args!(
        "{}: {} Mbps: put it on a web server, or try it with python3 -m http.server -d {}",
        args.output.display(),
        rates.join(", "),
        quoted(&args.output)
    ));
    Ok(())
}

/// Refuses lower rates where there can be none.
fn check_rates(input: &Input, options: &EncodeOptions) -> Result<()> {
    if options.profile == Some(ProfileChoice::Paper) {
        bail!("profile paper has no rate control: --rungs 1 writes its one rate");
    }
    if input.path().is_none() {
        bail!("{}: the input is read once for each rate, which a pipe cannot be: --rungs 1", input.name());
    }
    Ok(())
}

/// Whether anything is asked for that a stream which is copied would not have.
fn is_asked_for(options: &EncodeOptions) -> bool {
    let usual = EncodeOptions {
        fixed_gop: options.fixed_gop,
        takes_turns: options.takes_turns,
        skip_bad_frames: options.skip_bad_frames,
        memory: options.memory,
        ..EncodeOptions::default()
    };
    *options != usual
}

/// The distance from one keyframe of a stream to the next, if it is the same everywhere; `None` of what is no stream.
fn regular_gop(input: &Input) -> Result<Option<NonZero<u32>>> {
    if input.path().is_none_or(|path| !is_stream_name(path)) {
        return Ok(None);
    }
    let packets = StreamSummary::read(input)?.packets;
    let keyframes: Vec<_> = (0..packets.len()).filter(|frame| packets[*frame].keyframe).collect();
    let gop = keyframes.get(1).copied().unwrap_or(packets.len());
    let is_regular = keyframes.iter().enumerate().all(|(number, frame)| *frame == number * gop);
    Ok(u32::try_from(gop).ok().filter(|_| is_regular).and_then(NonZero::new))
}

/// How many times larger the voxels of a lower rate are than those of the best. A surface has samples by the square
/// of that, so that each sample keeps its bits.
fn larger_voxels(rung: usize, most: Lod) -> f64 {
    2f64.powf(rung as f64 / 2.0).min(f64::from(most.voxels()))
}

/// The options of a lower rate (bits a second): it is met in two passes, with voxels that suit it.
fn lower(options: &EncodeOptions, input: &Input, bits: f64, voxel: Length) -> Result<EncodeOptions> {
    let mut lower = options.clone();
    lower.main.bitrate = Some(BitRate::from_bits_per_second(bits));
    (lower.main.quality, lower.main.max_error, lower.main.passes) = (None, None, Some(2));
    lower.colour.quality = None;
    let silent = words::observer();
    let capture = Capture::open(input, &options.hints(&silent)?)?;
    // What is kept away from the surface is known on the grid of the input alone.
    if options.band == Some(Band::Full) {
        return Ok(lower);
    }
    let is_free = matches!(options.voxel, VoxelChoice::Fit | VoxelChoice::Auto);
    // Samples of meshes are coded with several sizes, and the best is taken.
    lower.voxel = match is_free && is_of_meshes(capture, options.frames)? {
        true => VoxelChoice::Auto,
        false => VoxelChoice::Edge(voxel),
    };
    Ok(lower)
}

/// Whether the first frame is a mesh. One that cannot be read is refused, or left out, when the rate is coded.
fn is_of_meshes(capture: Capture, frames: Option<FrameRange>) -> Result<bool> {
    if capture.content() != ContentKind::Geometry {
        return Ok(false);
    }
    let first = capture.range(frames)?.start;
    let content = capture.read(first..first + 1)?.next().and_then(Result::ok).map(|frame| frame.content);
    Ok(matches!(content, Some(Content::Geometry(Geometry::Mesh(mesh))) if !mesh.triangles.is_empty()))
}

/// Codes the take into an MP4 file without a name.
fn encoded(args: &Args, input: &Input, options: &EncodeOptions, rung: usize) -> Result<CodedRung> {
    let progress = Arc::new(Progress::new(None, format!("rate {rung}")));
    let observer = words::observer_above(&progress);
    let capture = Capture::open(input, &options.hints(&observer)?)?;
    let header = options.header(capture.grid(), capture.frame_rate())?;
    let times = args.capture.times(&capture, header.frame_rate);
    let open = || args.capture.backend.open(&*observer);
    let job = Job::prepare(capture, options, open, &observer, &mut Passes::default())?;
    if let Some(frames) = job.frames() {
        progress.expect(frames);
    }
    let mut first = None;
    let done = job.run(unnamed()?, |report| {
        first = first.or(report.map(|report| report.number));
        progress.step();
    });
    progress.clear();
    let (writer, report) = done.map_err(|unfinished| unfinished.error)?;
    if report.is_cancelled {
        bail!("interrupted: nothing was written");
    }
    let output = writer.finish()?.finish()?;
    let part = times.zip(first).map(|(times, first)| args.capture.part(&times, first));
    Ok(CodedRung { part, ..CodedRung::new(output, report.header, report.seconds, options.gop)? })
}

/// Puts a stream as it is into an MP4 file without a name.
fn copied(input: &Input, gop: NonZero<u32>) -> Result<CodedRung> {
    let summary = StreamSummary::read(input)?;
    let observer = words::observer();
    let create = || unnamed().map_err(std::io::Error::other);
    let (output, _) = mux(input, memory::limit(), &*observer, create).map_err(stream::edit_error)?;
    CodedRung::new(output, summary.header, summary.duration_s, gop)
}

/// An MP4 file of geometry alone that goes away with the program.
fn unnamed() -> Result<StreamOutput<BufWriter<File>>> {
    let file = tempfile::tempfile().context("the folder for temporary files")?;
    Ok(StreamOutput::new(BufWriter::new(file), Container::Mp4, Tracks::new())?)
}

impl CodedRung {
    fn new(output: BufWriter<File>, header: StreamHeader, seconds: f64, gop: NonZero<u32>) -> Result<Self> {
        let file = output.into_inner().map_err(IntoInnerError::into_error)?;
        let length = NonZero::new(gop.get() as usize);
        let segments = Segments::new(Mp4File::open(BufReader::new(file))?, length)?;
        let track = &segments.file().tracks()[0];
        // The stream's: boxes around it are the same in all rates.
        let bytes = track.bytes() + track.description.sample_entry.len() as u64;
        Ok(Self { segments, header, bytes, seconds, part: None })
    }
}

/// Makes sure that a player may go from any rate to any other at each segment.
fn check_aligned(rungs: &[CodedRung]) -> Result<()> {
    let lists: Vec<_> = rungs.iter().map(|rung| rung.segments.list()).collect();
    match lists.iter().all(|list| *list == lists[0]) {
        true => Ok(()),
        false => bail!("the rates do not have the same frames: was the capture changed meanwhile?"),
    }
}

/// The first sound, in an MP4 file of its own, as long as geometry; `None` if there is none.
fn sound(tracks: Tracks, seconds: f64) -> Result<Option<Segments<BufReader<File>>>> {
    let (mut sounds, others): (Tracks, Tracks) =
        tracks.into_iter().partition(|track| track.description().kind == TrackKind::Sound);
    let left_out = others.len() + sounds.len().saturating_sub(1);
    if left_out > 0 {
        say(format_args!("{left_out} tracks of sound and picture are left out: a ladder has one of sound"));
    }
    if sounds.is_empty() {
        return Ok(None);
    }
    let end_ns = (seconds * 1e9).ceil() as u64;
    let sound = Box::new(Trimmed::new(sounds.swap_remove(0), 0, end_ns));
    let file = tempfile::tempfile().context("the folder for temporary files")?;
    let output = write_tracks(BufWriter::new(file), vec![sound])?;
    let file = output.into_inner().map_err(IntoInnerError::into_error)?;
    Ok(Some(Segments::new(Mp4File::open(BufReader::new(file))?, None)?))
}

/// Writes all segments and their playlists, and returns the playlist of all.
fn write_ladder(
    folder: &mut ExportFolder,
    rungs: &mut [CodedRung],
    mut sound: Option<Segments<BufReader<File>>>,
) -> Result<String> {
    let sound_peak = match &mut sound {
        Some(sound) => write_segments(folder, "sound", sound, false)?,
        None => Rates::default(),
    };
    let sound_codec = sound.as_ref().map(|sound| sound.file().tracks()[0].description.codec_string());
    let mut listed = Vec::new();
    for (number, rung) in rungs.iter_mut().enumerate() {
        let name = format!("rung-{number}");
        let rates = write_segments(folder, &name, &mut rung.segments, true)?;
        let codecs = std::iter::once(codec_string(&rung.header)).chain(sound_codec.clone());
        listed.push(Rung {
            uri: format!("{name}/stream.m3u8"),
            peak_bits: rates.peak_bits + sound_peak.peak_bits,
            mean_bits: rates.mean_bits + sound_peak.mean_bits,
            codecs: codecs.collect::<Vec<_>>().join(","),
            frame_rate: rung.header.frame_rate.per_second(),
        });
    }
    Ok(master_playlist(&listed, sound.is_some().then_some("sound/stream.m3u8")))
}

/// Bits a second of segments.
#[derive(Clone, Copy, Default)]
struct Rates {
    peak_bits: u64,
    mean_bits: u64,
}

/// Writes the segments of a track into a folder, with their playlist.
fn write_segments(
    folder: &mut ExportFolder,
    name: &str,
    segments: &mut Segments<BufReader<File>>,
    is_geometry: bool,
) -> Result<Rates> {
    let list: Vec<Segment> = segments.list();
    folder.write(&format!("{name}/init.mp4"), &segments.init())?;
    let (mut peak, mut bits, mut seconds) = (0f64, 0f64, 0f64);
    for (number, segment) in list.iter().enumerate() {
        let bytes = segments.read(number)?;
        folder.write(&format!("{name}/{}", segment_name(number)), &bytes)?;
        let size = bytes.len() as f64 * 8.0;
        // The last one may be a frame long, of which a rate says nothing.
        let lasts = segment.duration_s.max(list[0].duration_s / 2.0).max(f64::MIN_POSITIVE);
        peak = peak.max(size / lasts);
        (bits, seconds) = (bits + size, seconds + segment.duration_s);
    }
    folder.write(&format!("{name}/stream.m3u8"), media_playlist(&list, is_geometry).as_bytes())?;
    let mean = if seconds > 0.0 { bits / seconds } else { 0.0 };
    Ok(Rates { peak_bits: peak.ceil() as u64, mean_bits: mean.ceil() as u64 })
}
