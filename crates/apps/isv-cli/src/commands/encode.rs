//! `isv encode`: a capture to a stream.

mod auto_voxel;
mod coding;
mod header;
mod ingest;
mod paper;
mod spacing;
mod target;
mod timestamps;
mod two_pass;
mod volumes;

use crate::ahead::Ahead;
use crate::backend::{self, BackendArgs};
use crate::capture::{Capture, CapturedFrame, ContentKind, Frames, Hints, invalid_points};
use crate::count;
use crate::frame_range::FrameRange;
use crate::interrupt;
use crate::length::Length;
use crate::origin;
use crate::output::{Output, check_stream_output, frames_in_words, is_pipe, say};
use crate::progress::Progress;
use crate::stats::{EncodedFrameStats, StatsFile, megabits_per_second, timed};
use crate::stream;
use crate::terms::{BandName, ProfileName, TimestampsName};
use crate::threads::use_threads;
use crate::timeline::Timeline;
use crate::up::Up;
use anyhow::{Result, bail};
use coding::{CodedFrame, Coding};
use header::HeaderArgs;
use ingest::IngestArgs;
use isv::encode::{EncodedFrame, EncoderSettings, FrameWriter, RateTarget};
use isv::format::{PacketWriter, StreamHeader};
use isv::io::Unit;
use isv::volume::Grid;
use spacing::Need;
use std::num::NonZero;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::SystemTime;
use timestamps::Timestamps;
use volumes::{IngestedFrame, Shell, VolumeMaker};

/// Encode a capture into an .isv stream
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A folder of frames, a pattern such as 'take/*.obj' or one file, in natural order of their names; a folder of depth
    /// images and calibration; an .isv file; - for frames on a pipe
    input: PathBuf,
    /// The stream to write; - for standard output. Until it is whole its name is OUT.isv.part, which opens up to its last whole
    /// frame
    #[arg(short, long, value_name = "OUT.isv")]
    output: PathBuf,
    /// Unit of the input's coordinates: m, dm, cm, mm, in, ft or us-ft
    #[arg(long, default_value_t = Unit::Metre)]
    units: Unit,
    /// The place of meshes and points, in their unit, that becomes the origin: for coordinates of a country's survey
    #[arg(long, value_name = "X,Y,Z", value_parser = origin::parse, allow_hyphen_values = true)]
    origin: Option<[f64; 3]>,
    /// Axis of the input that points up, which streams call Y. After --units and --origin, which are along the input's axes
    #[arg(long, value_enum, default_value = "y", allow_hyphen_values = true)]
    up: Up,
    /// Only these frames, counted from 0, without frame B; A.. and ..B are to the last and from the first
    #[arg(long, value_name = "A..B")]
    frames: Option<FrameRange>,
    /// A keyframe at least every this many frames; with --refresh gradual, all is refreshed in so many
    #[arg(long, value_name = "FRAMES", default_value = "30", value_parser = count::parse::<NonZero<u32>>)]
    gop: NonZero<u32>,
    #[command(flatten)]
    header: HeaderArgs,
    #[command(flatten)]
    ingest: IngestArgs,
    /// Go on after a frame that cannot be read or used, and say at the end how many there were; the others keep their
    /// time. Frames of an .isv file, which need each other, cannot be skipped
    #[arg(long)]
    skip_bad_frames: bool,
    /// What packets are stamped with
    #[arg(long, value_enum, default_value = "source")]
    timestamps: TimestampsName,
    /// Leave out points that are not finite or lie at exactly (0,0,0), as cameras write "no reading"
    #[arg(long)]
    drop_invalid_points: bool,
    /// Take frames of one shape and different scales as they are; without it, they are refused as being in different units
    #[arg(long)]
    mixed_scales: bool,
    /// Put a hash of every decoded frame into the stream, for isv verify
    #[arg(long)]
    checksums: bool,
    /// Threads to work with; without it, one a core
    #[arg(long, value_name = "N", value_parser = count::parse::<NonZero<usize>>)]
    threads: Option<NonZero<usize>>,
    #[command(flatten)]
    backend: BackendArgs,
    /// Write times and sizes of every frame to this file; ingest and encoding then take turns, so that the time of one
    /// is not also that of the other
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
}

impl Args {
    fn hints(&self) -> Result<Hints> {
        let usual = Hints::in_unit(self.units).with_origin(self.origin);
        let frame_rate = self.header.frame_rate().unwrap_or(usual.frame_rate);
        let (voxel_size, truncation) = (self.header.voxel_size()?, self.header.truncation()?);
        let dense = self.ingest.dense();
        Ok(Hints {
            voxel_size,
            truncation,
            frame_rate,
            invalid_points: invalid_points(self.drop_invalid_points),
            mixed_scales: self.mixed_scales,
            up: self.up,
            dense,
            ..usual
        })
    }

    /// A sentence on what was asked for and has no effect on such a capture.
    fn without_effect(&self, capture: &Capture) -> Option<String> {
        let content = capture.content();
        let geometry = [
            ("--units", self.units != Unit::Metre),
            ("--origin", self.origin.is_some()),
            ("--drop-invalid-points", self.drop_invalid_points),
        ];
        let of_geometry = geometry.iter().filter(|(_, given)| *given && content != ContentKind::Geometry);
        let up = (self.up != Up::Y && content == ContentKind::Volume).then_some("--up");
        let flags: Vec<_> = of_geometry
            .map(|(flag, _)| *flag)
            .chain(up)
            .chain(self.ingest.without_effect(content, capture.is_dense()))
            .collect();
        let list = flags.join(", ");
        (!flags.is_empty())
            .then(|| format!("{}: without effect on {}: {list}", capture.name(), content.name()))
    }

    fn encoder_settings(&self, header: &StreamHeader) -> EncoderSettings {
        EncoderSettings {
            motion: self.header.motion(),
            gop: self.gop.get(),
            checksums: self.checksums,
            main: self.header.target().settings(header, self.header.band()),
            ..EncoderSettings::default()
        }
    }

    /// The encoder's settings, and the header's voxel size if that is to be found out by coding. `counted`: an error if the capture
    /// cannot be read more than once. `fits`: whether the voxel size was chosen already.
    fn settings(
        &self,
        counted: Result<()>,
        header: &mut StreamHeader,
        fits: bool,
    ) -> Result<EncoderSettings> {
        let voxel_is_auto = self.header.voxel_is_auto() && !fits;
        let mut settings = self.encoder_settings(header);
        let rate = self.header.target().two_pass_rate();
        if voxel_is_auto || rate.is_some() {
            counted?;
        }
        if voxel_is_auto {
            let choice = auto_voxel::choose(self, header, &settings)?;
            header.grid.voxel_size = choice.voxel;
            settings = self.encoder_settings(header);
            settings.main.quality = choice.quality.unwrap_or(settings.main.quality);
        }
        match rate {
            Some(rate) => two_pass::settings_for_rate(self, header, settings, rate),
            None => Ok(settings),
        }
    }
}

/// The frames to encode, and what they need of a voxel if nobody gave its size. A pipe is read up to its first frame for that.
fn frames_and_need(
    args: &Args,
    capture: Capture,
    range: Range<usize>,
    grid: Grid,
) -> Result<(Frames<CapturedFrame>, Option<Need>)> {
    let is_sampled = matches!(capture.content(), ContentKind::Geometry | ContentKind::Depth);
    if !is_sampled || !args.header.voxel_is_open(&capture) {
        return Ok((capture.read(range)?, None));
    }
    if capture.frames().is_some() {
        let need = spacing::of_frames(args, &range, grid)?;
        return Ok((capture.read(range)?, need));
    }
    // On a thread of its own, so that the user can interrupt the wait.
    let mut frames = Ahead::new(capture.read(range)?);
    let first = frames.next();
    let need = first.as_ref().and_then(|frame| spacing::of_frame(args, frame.as_ref().ok()?, grid));
    Ok((Box::new(first.into_iter().chain(frames)), need))
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    check_stream_output(&[&args.input], &args.output)?;
    let capture = Capture::open(&args.input, &args.hints()?)?;
    let mut header = args.header.header(&capture)?;
    let range = capture.range(args.frames)?;
    use_threads(args.threads)?;
    interrupt::listen()?;
    let remarks: Vec<String> = capture.remarks().into_iter().chain(args.without_effect(&capture)).collect();
    let (comes_once, counted) = (capture.frames().is_none(), capture.counted().map(drop));
    let skip_bad_frames = args.skip_bad_frames && capture.frames_stand_alone();
    let keeps_times = capture.frame_rate() == Some(header.frame_rate);
    let input_bytes = capture.bytes(&range);
    let (frames, need) = frames_and_need(args, capture, range.clone(), header.grid)?;
    if let Some(need) = &need {
        // Steps of profile paper are lengths, and count in voxels.
        header.grid.voxel_size = spacing::announce(need)?;
        header.profile = args.header.profile(&header.grid)?;
    }
    let settings = args.settings(counted, &mut header, need.is_some())?;
    let progress = Arc::new(Progress::new((!comes_once).then_some(range.len()), "encoding"));
    let backend = args.backend.open()?;
    let profile = args.header.profile_name();
    let maker = args.ingest.volume_maker(
        header.grid,
        profile,
        args.header.band(),
        backend.clone(),
        Arc::clone(&progress),
        &args.hints()?,
    )?;
    let coding = Coding { measures_change: args.stats.is_some(), coder: backend.coder(&header, settings)? };
    let mut job = Job {
        header,
        frame_writer: FrameWriter::default(),
        packet_writer: PacketWriter::new(Output::create(&args.output)?, &header)?,
        stats: StatsFile::create(args.stats.as_deref(), [&args.input, &args.output])?,
        skip_bad_frames,
        target: Some(settings.main.target),
        timestamps: Timestamps::new(args.timestamps, header.frame_rate),
        keeps_times,
        timeline: Timeline::new(header.frame_rate),
        input_bytes,
        shell: Arc::clone(&maker.shell),
        first: range.start,
        frames: 0,
        empty: 0,
        skipped: 0,
    };
    if args.header.band() == Some(BandName::Full) {
        progress.note(match profile {
            ProfileName::Paper => "the whole band is kept, by profile paper: main keeps what is near the surface",
            ProfileName::Main => "profile main keeps every observed voxel, but takes some that were not observed for such: --profile paper tells them apart",
        });
    }
    for remark in remarks {
        progress.note(&remark);
    }
    let taking_turns = args.stats.is_some() || args.threads.is_some_and(|threads| threads.get() == 1);
    for frame in pipeline(frames, maker, coding, taking_turns) {
        if let Err(error) = job.take(frame, &progress) {
            drop(progress);
            if comes_once {
                job.rescue();
            }
            return Err(error);
        }
        progress.step();
    }
    drop(progress);
    job.finish(args)
}

/// The pipeline up to the writing of symbols. Reading runs ahead of everything else; making volumes runs ahead of coding them, and
/// that of writing, unless they are to take turns.
fn pipeline(
    frames: Frames<CapturedFrame>,
    maker: VolumeMaker,
    coding: Coding,
    taking_turns: bool,
) -> Box<dyn Iterator<Item = Result<CodedFrame>>> {
    match taking_turns {
        true => Box::new(coding.code_all(ingested(frames, maker))),
        false => Box::new(Ahead::new(coding.code_all(Ahead::new(ingested(frames, maker))))),
    }
}

/// Frames as volumes, read ahead.
fn ingested(
    frames: Frames<CapturedFrame>,
    mut maker: VolumeMaker,
) -> impl Iterator<Item = Result<IngestedFrame>> {
    let read = Ahead::new(frames.map(|frame| (SystemTime::now(), frame)));
    read.map(move |(read, frame)| maker.ingest(frame?, read))
}

/// The writing side.
struct Job {
    header: StreamHeader,
    frame_writer: FrameWriter,
    packet_writer: PacketWriter<Output>,
    stats: StatsFile<EncodedFrameStats>,
    skip_bad_frames: bool,
    /// What the encoder aims at, until it was said that it is out of reach.
    target: Option<RateTarget>,
    timestamps: Timestamps,
    /// Whether frames are shown when they were in the capture, which is a stream of this rate.
    keeps_times: bool,
    timeline: Timeline,
    /// Size of the input files in bytes, if it is known.
    input_bytes: Option<u64>,
    shell: Arc<Shell>,
    /// Number in the capture of the frame that the stream's time begins with.
    first: usize,
    frames: usize,
    /// Frames without a surface.
    empty: usize,
    skipped: usize,
}

impl Job {
    /// Writes a frame, or deals with what is wrong with it.
    fn take(&mut self, frame: Result<CodedFrame>, progress: &Progress) -> Result<()> {
        match frame {
            Ok(frame) => self.write(frame, progress),
            Err(error) if self.skip_bad_frames && !backend::has_failed(&error) => {
                self.skipped += 1;
                progress.note(&format!("skipped: {error:#}"));
                Ok(())
            }
            Err(error) => Err(error),
        }
    }

    /// Says once that a frame could not be brought within the error asked for.
    fn note_missed_error(&mut self, number: usize, frame: &EncodedFrame, progress: &Progress) {
        let (Some(RateTarget::MaxError(bound)), Some(error)) = (self.target, frame.surface_distance_voxels)
        else {
            return;
        };
        if error > bound {
            self.target = None;
            let voxel_m = self.header.grid.voxel_size.metres();
            let [error, bound] = [error, bound].map(|voxels| Length::from_metres(voxels * voxel_m));
            progress.note(&format!(
                "frame {number}: {error} from what was captured even with the finest step, not {bound}: smaller voxels reach it"
            ));
        }
    }

    /// A frame keeps its time if frames before it were skipped.
    fn write(&mut self, frame: CodedFrame, progress: &Progress) -> Result<()> {
        let CodedFrame {
            number,
            read,
            timestamp_ns,
            frame,
            ingest_ms,
            has_surface,
            blocks_band,
            coding_ms,
            surface_rms_voxels,
        } = frame;
        let (coded, writing_ms) = timed(|| self.frame_writer.write(frame));
        self.note_missed_error(number, &coded, progress);
        let stated = timestamp_ns.filter(|_| self.keeps_times);
        let timestamp_ns = self.timestamps.of((number - self.first) as u64, read, stated);
        self.timeline.place(timestamp_ns);
        let bytes = self.packet_writer.write_frame(coded.keyframe, timestamp_ns, &coded.payload())?;
        self.frames += 1;
        self.empty += usize::from(!has_surface);
        if self.stats.is_wanted() {
            let voxel_mm = self.header.grid.voxel_size.metres() * 1e3;
            let rms = surface_rms_voxels.expect("decoded frames are compared where statistics are wanted");
            self.stats.push(EncodedFrameStats {
                ingest_ms,
                encode_ms: coding_ms + writing_ms,
                bytes,
                bytes_blocks: coded.bytes_blocks(),
                bytes_motion: coded.bytes_motion(),
                bytes_coefficients: coded.bytes_coefficients(),
                bytes_masks: coded.bytes_masks(),
                bytes_dc: coded.bytes_dc(),
                blocks_band,
                blocks_coded: coded.payload().header.blocks as usize,
                keyframe: coded.keyframe,
                surface_rms_mm: rms * voxel_mm,
            });
        }
        Ok(())
    }

    /// Keeps the frames before a failure, beside the name that the stream was to have: what came through a pipe cannot be had again.
    fn rescue(mut self) {
        if self.frames == 0 {
            return;
        }
        let kept = self.packet_writer.sink_mut().keep();
        // On a full disk not even an index has room. What is there opens all the same.
        let _ = self.packet_writer.finish().map(Output::commit);
        if let Some(path) = kept {
            say(format_args!("{} holds the first {}", path.display(), frames_in_words(self.frames)));
        }
    }

    /// Completes the stream, which is a shorter one after Ctrl-C.
    fn finish(self, args: &Args) -> Result<()> {
        let (input, output) = (stream::name(&args.input), args.output.display());
        let frames = frames_in_words(self.frames);
        let skipped = frames_in_words(self.skipped);
        if self.frames == 0 {
            match interrupt::requested() {
                true => bail!("interrupted before the first frame"),
                false => bail!("{input}: no frame could be used, {skipped} skipped"),
            }
        }
        if self.empty == self.frames && !interrupt::requested() {
            bail!("{input}: no surface in any frame: check --units and --voxel");
        }
        let bytes = self.packet_writer.finish()?.commit()?;
        let seconds = self.timeline.end_s();
        let mbps = megabits_per_second(bytes, seconds);
        let ms = self.stats.wall_ms() / self.frames as f64;
        let ratio =
            self.input_bytes.filter(|_| !interrupt::requested()).map(|input| ratio_in_words(input, bytes));
        let shell = self.shell.get().map(|shell_mm| format!("shell {shell_mm} mm thick"));
        let more: String = [ratio, shell].into_iter().flatten().map(|more| format!(", {more}")).collect();
        let name = match is_pipe(&args.output) {
            true => "standard output".to_owned(),
            false => output.to_string(),
        };
        say(format_args!("{name}: {frames}, {bytes} bytes, {mbps:.3} Mbps, {ms:.0} ms a frame{more}"));
        if let Some((rate, most_bits)) = args.header.target().most_bits(seconds)
            && bytes as f64 * 8.0 > most_bits
        {
            let voxel = Length::from_metres(self.header.grid.voxel_size.metres());
            say(format_args!(
                "{input}: more than the {rate} that were asked for: voxels larger than {voxel} take less"
            ));
        }
        if self.skipped > 0 {
            say(format_args!("{input}: {skipped} skipped"));
        }
        self.stats.commit()?;
        if interrupt::requested() {
            bail!("interrupted: {output} is whole and holds the first {frames}");
        }
        Ok(())
    }
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
