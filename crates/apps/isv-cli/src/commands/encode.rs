//! `isv encode`: a capture to a stream.

mod colour;
mod describe;
mod header;
mod ingest;
mod paper;
mod target;

use crate::backend::BackendArgs;
use crate::capture::invalid_points;
use crate::cli_enums::{TimestampsName, UpName};
use crate::count;
use crate::failure::usage;
use crate::interrupt;
use crate::origin;
use crate::output::{Output, check_stream_output, frames_in_words, is_pipe, say};
use crate::progress::Progress;
use crate::stats::{EncodedFrameStats, StatsFile, megabits_per_second};
use crate::stream::{self, StreamOutput};
use crate::threads::use_threads;
use crate::tracks::{FromFirstFrame, TrackArgs};
use crate::{memory, words};
use anyhow::{Result, bail};
use colour::ColourArgs;
use describe::DescribeArgs;
use header::HeaderArgs;
use ingest::IngestArgs;
use isv::raw::encode::Band;
use isv::raw::format::FrameRate;
use isv::raw::io::Unit;
use isv::raw::take::capture::{Capture, CaptureTimes, ContentKind};
use isv::raw::take::encode::{
    EncodeOptions, FrameReport, Job, ProfileChoice, Report, Unfinished, UnfinishedStream, Watch,
};
use isv::raw::take::stream::{Container, Tracks, tracks_beside};
use isv::raw::take::{Cancellation, FrameRange, Input, Length};
use std::iter;
use std::num::NonZero;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// Encode a capture into an .isv stream
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    capture: CaptureArgs,
    /// Stream to write, an .isv or .mp4 file; - for standard output
    ///
    /// While encoding, the file is called OUT.isv.part. If the encoder is killed, that file still plays up to its
    /// last complete frame.
    #[arg(short, long, value_name = "OUT.isv")]
    output: PathBuf,
    /// Write times and sizes of every frame to this file
    ///
    /// Stages then take turns, so that the time of one is not also that of another.
    #[arg(help_heading = "Running", long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
}

/// A capture, and how it is encoded.
#[derive(Debug, clap::Args)]
pub(crate) struct CaptureArgs {
    /// Capture: a folder, a pattern such as 'take/*.obj', a file, or - for a pipe
    ///
    /// Frames are meshes, points, volumes, or depth images with their calibration, in natural order of their names; or an .isv or
    /// MP4 file.
    pub(super) input: PathBuf,
    /// Unit of the input's coordinates: m, dm, cm, mm, in, ft or us-ft
    #[arg(help_heading = "Coordinates of the input", long, default_value_t = Unit::Metre)]
    units: Unit,
    /// Place of meshes and points, in their unit, that becomes the origin
    ///
    /// For coordinates of a survey, which lie far from the origin.
    #[arg(help_heading = "Coordinates of the input", long, value_name = "X,Y,Z", value_parser = origin::parse, allow_hyphen_values = true)]
    origin: Option<[f64; 3]>,
    /// Axis of the input that points up; streams are Y up
    ///
    /// --units and --origin are along the axes of the input, before it is turned.
    #[arg(
        help_heading = "Coordinates of the input",
        long,
        value_enum,
        default_value = "y",
        allow_hyphen_values = true
    )]
    up: UpName,
    /// Frames A to B-1, counted from 0; either end may be left out
    #[arg(help_heading = "Input", long, value_name = "A..B")]
    pub(super) frames: Option<FrameRange>,
    /// Animation of a glTF file, by name or number from 0
    ///
    /// Without it, the first that moves anything plays.
    #[arg(help_heading = "Input", long, value_name = "NAME")]
    animation: Option<String>,
    /// Most frames from a keyframe to the next
    ///
    /// With --refresh gradual, all of a frame is refreshed within so many frames.
    #[arg(help_heading = "Stream", long, value_name = "FRAMES", default_value = "30", value_parser = count::parse::<NonZero<u32>>)]
    gop: NonZero<u32>,
    /// Code every --gop frames by themselves
    ///
    /// Parts of a take that begin at multiples of --gop then have the same bytes as in the stream of the whole. Encode them
    /// with --frames and --time-origin, and put them together with `isv join --keep-times`.
    #[arg(help_heading = "Stream", long)]
    fixed_gop: bool,
    /// Frame at which the stream's time begins [default: the first]
    ///
    /// A frame before the first of --frames leaves a stream that begins later than at 0, for `isv join --keep-times`.
    #[arg(help_heading = "Stream", long, value_name = "FRAME")]
    time_origin: Option<usize>,
    #[command(flatten)]
    header: HeaderArgs,
    #[command(flatten)]
    ingest: IngestArgs,
    #[command(flatten)]
    colour: ColourArgs,
    /// Leave out frames that cannot be read or used
    ///
    /// The others keep their times, and isv says at the end how many were left out. Frames of an .isv file need
    /// each other and cannot be left out.
    #[arg(help_heading = "Input", long)]
    skip_bad_frames: bool,
    /// What packets are stamped with
    #[arg(help_heading = "Stream", long, value_enum, default_value = "source")]
    timestamps: TimestampsName,
    /// Leave out points that are not finite or lie at (0,0,0)
    ///
    /// Cameras write such points for "no reading".
    #[arg(help_heading = "Input", long)]
    drop_invalid_points: bool,
    /// Take frames of one shape and different scales as they are
    ///
    /// Without it, they are refused as being in different units.
    #[arg(help_heading = "Input", long)]
    mixed_scales: bool,
    /// Put a hash of every decoded frame into the stream, for isv verify
    #[arg(help_heading = "Stream", long)]
    checksums: bool,
    /// Number of threads [default: one a core]
    #[arg(help_heading = "Running", long, value_name = "N", value_parser = count::parse::<NonZero<usize>>)]
    pub(super) threads: Option<NonZero<usize>>,
    #[command(flatten)]
    describe: DescribeArgs,
    #[command(flatten)]
    tracks: TrackArgs,
    #[command(flatten)]
    pub(super) backend: BackendArgs,
}

impl Args {
    fn options(&self) -> EncodeOptions {
        let options = self.capture.options();
        let is_measured = self.stats.is_some();
        EncodeOptions {
            takes_turns: options.takes_turns || is_measured,
            measures_change: is_measured,
            ..options
        }
    }

    /// Refuses sound and picture for a file that can have none.
    fn check_tracks(&self) -> Result<()> {
        match Container::of(&self.output) == Container::Mp4 || self.capture.tracks.is_empty() {
            true => Ok(()),
            false => Err(usage(format!(
                "--audio and --video: an .isv file has no sound and no picture: name the output {}",
                self.output.with_extension("mp4").display()
            ))),
        }
    }
}

impl CaptureArgs {
    /// The files that are read: the capture, then sound and picture.
    pub(super) fn files(&self) -> Vec<&Path> {
        iter::once(self.input.as_path()).chain(self.tracks.files()).collect()
    }

    /// What the flags choose.
    pub(super) fn options(&self) -> EncodeOptions {
        self.header.options(EncodeOptions {
            frames: self.frames,
            animation: self.animation.clone(),
            unit: self.units,
            origin: self.origin,
            up: self.up.into(),
            invalid_points: invalid_points(self.drop_invalid_points),
            mixed_scales: self.mixed_scales,
            dense: self.ingest.dense(),
            fields: self.ingest.options(),
            gop: self.gop,
            fixed_gop: self.fixed_gop,
            time_origin: self.time_origin,
            colour: self.colour.options(),
            metadata: self.describe.options(),
            checksums: self.checksums,
            timestamps: self.timestamps.into(),
            skip_bad_frames: self.skip_bad_frames,
            takes_turns: self.threads.is_some_and(|threads| threads.get() == 1),
            memory: memory::limit(),
            ..EncodeOptions::default()
        })
    }

    /// When the frames of a capture are shown; `None` where no sound and no picture is asked for.
    pub(super) fn times(&self, capture: &Capture, rate: FrameRate) -> Option<CaptureTimes> {
        (!self.tracks.is_empty()).then(|| capture.times(rate, self.timestamps.into()))
    }

    /// The time (ns) of sound and picture that belongs to the frames that are asked for, from frame `first` on.
    pub(super) fn part(&self, times: &CaptureTimes, first: usize) -> Range<u64> {
        let end = self.frames.map(|frames| frames.end).filter(|end| *end != FrameRange::OPEN);
        times.of_ns(first)..end.map_or(u64::MAX, |end| times.of_ns(end))
    }

    /// The tracks beside the stream: those of an MP4 file that is coded anew, and those asked for, of which a part (ns) is wanted.
    pub(super) fn open_tracks(
        &self,
        input: &Input,
        part: Option<Range<u64>>,
        output: &Path,
    ) -> Result<Tracks> {
        let kept = tracks_beside(input, self.frames)?;
        let mut tracks = stream::kept_tracks(kept, &input.name(), output);
        tracks.extend(self.tracks.open(part)?);
        Ok(tracks)
    }

    /// A sentence on what was asked for and has no effect on such a capture.
    pub(super) fn without_effect(&self, capture: &Capture) -> Option<String> {
        let content = capture.content();
        let geometry = [
            ("--units", self.units != Unit::Metre),
            ("--origin", self.origin.is_some()),
            ("--drop-invalid-points", self.drop_invalid_points),
        ];
        let of_geometry = geometry.iter().filter(|(_, given)| *given && content != ContentKind::Geometry);
        let up = (self.up != UpName::Y && content == ContentKind::Volume).then_some("--up");
        let flags: Vec<_> = of_geometry
            .map(|(flag, _)| *flag)
            .chain(up)
            .chain(self.ingest.without_effect(content, capture.is_dense()))
            .collect();
        let list = flags.join(", ");
        (!flags.is_empty())
            .then(|| format!("{}: without effect on {}: {list}", capture.name(), content.name()))
    }
}

/// A bar for each pass that looks for settings.
#[derive(Default)]
pub(super) struct Passes(Option<Progress>);

impl Watch for Passes {
    fn begin(&mut self, frames: usize) {
        self.0 = Some(Progress::new(Some(frames), "measuring"));
    }

    fn step(&mut self) {
        self.0.iter().for_each(Progress::step);
    }

    fn cancellation(&self) -> &Cancellation {
        interrupt::cancellation()
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let flags = &args.capture;
    check_stream_output(&flags.files(), &args.output)?;
    args.check_tracks()?;
    let (input, options) = (Input::from_argument(&flags.input), args.options());
    let progress = Arc::new(Progress::new(None, "encoding"));
    let observer = words::observer_above(&progress);
    let capture = Capture::open(&input, &options.hints(&observer)?)?;
    // Wrong flags are told before anything is read.
    let header = options.header(capture.grid(), capture.frame_rate())?;
    let times = flags.times(&capture, header.frame_rate);
    let first = capture.range(flags.frames)?.start;
    use_threads(flags.threads)?;
    interrupt::listen()?;
    let without_effect = flags.without_effect(&capture);
    let job = Job::prepare(
        capture,
        &options,
        || flags.backend.open(&*observer),
        &observer,
        &mut Passes::default(),
    )?;
    if let Some(frames) = job.frames() {
        progress.expect(frames);
    }
    let voxel_m = job.header().grid.voxel_size.metres();
    let part = times.as_ref().map(|times| flags.part(times, first));
    let begin = Arc::new(OnceLock::new());
    let tracks = flags.open_tracks(&input, part, &args.output)?.into_iter();
    let tracks: Tracks = tracks.map(|track| Box::new(FromFirstFrame::new(track, &begin)) as _).collect();
    let has_tracks = !tracks.is_empty();
    let output = StreamOutput::create(&args.output, tracks)?;
    let mut stats = StatsFile::create(args.stats.as_deref(), [&flags.input, &args.output])?;
    if options.band == Some(Band::Full) {
        progress.note(match options.profile_choice() {
            ProfileChoice::Paper => "the whole band is kept, by profile paper: main keeps what is near the surface",
            ProfileChoice::Main => "profile main keeps every observed voxel, but takes some that were not observed for such: --profile paper tells them apart",
        });
    }
    if let Some(sentence) = without_effect {
        progress.note(&sentence);
    }
    let done = job.run(output, |report| {
        if let (Some(report), Some(times)) = (&report, &times) {
            // Frames before it may have been left out.
            begin.get_or_init(|| times.of_ns(report.number).saturating_sub(times.of_ns(first)));
        }
        if let Some(report) = report.filter(|_| stats.is_wanted()) {
            stats.push(frame_stats(&report));
        }
        progress.step();
    });
    progress.clear();
    let (writer, report) = match done {
        Ok(done) => done,
        Err(unfinished) => {
            let Unfinished { error, stream } = *unfinished;
            stream.filter(|stream| stream.comes_once).into_iter().for_each(rescue);
            return Err(error.into());
        }
    };
    let output = stream::finish(writer.finish()?, &args.output)?;
    finish(args, &options, (output, has_tracks), &report, voxel_m, stats)
}

fn frame_stats(report: &FrameReport) -> EncodedFrameStats {
    let FrameReport { coded, .. } = report;
    let rms_m = report.surface_rms_m.expect("decoded frames are compared where statistics are wanted");
    EncodedFrameStats {
        ingest_ms: report.ingest_ms,
        encode_ms: report.encode_ms,
        colour_ms: report.colour_ms,
        bytes: report.bytes,
        bytes_colour: report.bytes_colour,
        bytes_blocks: coded.bytes_blocks(),
        bytes_motion: coded.bytes_modes(),
        bytes_coefficients: coded.bytes_coefficients(),
        bytes_masks: coded.bytes_masks(),
        bytes_dc: coded.bytes_dc(),
        blocks_band: report.blocks_band,
        blocks_coded: coded.payload().header.blocks as usize,
        keyframe: coded.keyframe,
        surface_rms_mm: rms_m * 1e3,
    }
}

/// Keeps the frames before a failure, beside the name that the stream was to have: what came through a pipe cannot be had again.
fn rescue(stream: UnfinishedStream<StreamOutput>) {
    let UnfinishedStream { mut writer, frames, .. } = stream;
    if frames == 0 {
        return;
    }
    let kept = writer.sink_mut().sink_mut().and_then(Output::keep);
    // On a full disk not even an index has room. What is there opens all the same.
    let finish = |stream: StreamOutput| -> Result<Output> { Ok(stream.finish()?) };
    let _ = writer.finish().map_err(Into::into).and_then(finish).map(Output::commit);
    if let Some(path) = kept {
        say(format_args!("{} holds the first {}", path.display(), frames_in_words(frames)));
    }
}

/// Completes the stream, which is a shorter one after Ctrl-C. `has_tracks`: whether sound or picture lies beside it, which its rate does
/// not count.
fn finish(
    args: &Args,
    options: &EncodeOptions,
    (file, has_tracks): (Output, bool),
    report: &Report,
    voxel_m: f64,
    stats: StatsFile<EncodedFrameStats>,
) -> Result<()> {
    let (input, output) = (Input::from_argument(&args.capture.input).name(), args.output.display());
    let frames = frames_in_words(report.frames);
    let bytes = file.commit()?;
    let stream_bytes = if has_tracks { report.bytes } else { bytes };
    let mbps = megabits_per_second(stream_bytes, report.seconds);
    let without = if has_tracks { " without sound and picture" } else { "" };
    let ms = stats.wall_ms() / report.frames as f64;
    let ratio =
        report.input_bytes.filter(|_| !report.is_cancelled).map(|input| ratio_in_words(input, stream_bytes));
    let shell = report.shell_mm.map(|shell_mm| format!("shell {shell_mm} mm thick"));
    let more: String = [ratio, shell].into_iter().flatten().map(|more| format!(", {more}")).collect();
    let name = if is_pipe(&args.output) { "standard output".to_owned() } else { output.to_string() };
    say(format_args!("{name}: {frames}, {bytes} bytes, {mbps:.3} Mbps{without}, {ms:.0} ms a frame{more}"));
    if let Some((rate, most_bits)) = options.main.most_bits(report.seconds)
        && stream_bytes as f64 * 8.0 > most_bits
    {
        let voxel = Length::from_metres(voxel_m);
        say(format_args!(
            "{input}: more than the {rate} that were asked for: voxels larger than {voxel} take less"
        ));
    }
    if report.skipped > 0 {
        say(format_args!("{input}: {} skipped", frames_in_words(report.skipped)));
    }
    stats.commit()?;
    if report.is_cancelled {
        bail!("interrupted: {output} is whole and holds the first {frames}");
    }
    Ok(())
}

/// How large a stream is beside what it was made from.
fn ratio_in_words(input: u64, output: u64) -> String {
    let size = size_in_words(input);
    let ratio = input as f64 / output as f64;
    match ratio {
        10.0.. => format!("1/{ratio:.0} of the input's {size}"),
        1.0.. => format!("1/{ratio:.1} of the input's {size}"),
        _ => format!("{:.1} times the input's {size}", 1.0 / ratio),
    }
}

/// Bytes in a unit of thousands, with two digits or more.
fn size_in_words(bytes: u64) -> String {
    let mut size = bytes as f64;
    for unit in ["bytes", "kB", "MB", "GB"] {
        if size < 999.5 {
            return match unit {
                "bytes" => format!("{bytes} bytes"),
                _ if size < 9.95 => format!("{size:.1} {unit}"),
                _ => format!("{size:.0} {unit}"),
            };
        }
        size /= 1e3;
    }
    format!("{size:.1} TB")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_said_as_people_say_them() {
        assert_eq!(ratio_in_words(7_700_000, 48_000), "1/160 of the input's 7.7 MB");
        assert_eq!(ratio_in_words(1_000_000, 300_000), "1/3.3 of the input's 1.0 MB");
        assert_eq!(ratio_in_words(500, 2000), "4.0 times the input's 500 bytes");
        assert_eq!(size_in_words(999_499), "999 kB");
        assert_eq!(size_in_words(999_500), "1.0 MB");
        assert_eq!(size_in_words(2_500_000_000_000), "2.5 TB");
    }
}
