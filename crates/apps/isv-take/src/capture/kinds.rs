//! The kinds of captures.

use super::files::{FileFrames, named_ns, scanned_ns};
use super::pipe::{self, PipedGeometry};
use super::{CapturedFrame, Content, ContentKind, Frames, Hints, default_voxel_size, stream_settings};
use crate::encode::{CaptureError, FrameError};
use crate::stream::{self, StreamFrames, StreamSummary, load_index};
use crate::timeline::Timeline;
use crate::{FrameRange, Input, Length, MemoryLimit, StreamFault};
use isv_format::{FrameRate, Profile, StreamHeader};
use isv_ingest::coded_field;
use isv_io::{
    Animation, Colours, DepthSequence, FrameSequence, FrameTimes, Saturation, SequenceError, VolumeError,
    VolumeSequence, is_depth_folder, passed_over,
};
use isv_mp4::is_stream_name;
use isv_volume::Grid;
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// What frames come from.
pub(super) enum Kind {
    /// Files of meshes or points, one a frame.
    Files(FrameSequence, Hints),
    /// A glTF file that moves, and the number of the animation that plays.
    Animation { animation: Box<Animation>, playing: usize, frame_rate: FrameRate },
    /// Depth images and the cameras that took them.
    Depth(DepthSequence),
    /// Folders of arrays, one a frame.
    Volumes {
        volumes: VolumeSequence,
        grid: Grid,
        /// Whether anybody said how large a voxel is.
        size_is_known: bool,
        /// What was taken for granted.
        notes: Vec<String>,
    },
    /// A stream in an `.isv` or MP4 file.
    Stream(PathBuf, StreamHeader, Hints),
    /// An `.isv` stream on standard input.
    PipedStream(Box<StreamFrames>),
    /// Meshes or points on standard input.
    PipedGeometry(Box<PipedGeometry>),
}

impl Kind {
    /// Finds out what an input is, and how many frames it has if that can be known. An animation is refused where there is none.
    pub(super) fn open(input: &Input, hints: &Hints) -> Result<(Option<usize>, Self), CaptureError> {
        let (frames, kind) = Self::find(input, hints)?;
        match (&hints.animation, &kind) {
            (None, _) | (_, Self::Animation { .. }) => Ok((frames, kind)),
            (Some(_), _) => Err(CaptureError::NotAnimated { name: input.name() }),
        }
    }

    fn find(input: &Input, hints: &Hints) -> Result<(Option<usize>, Self), CaptureError> {
        let Input::Path(path) = input else { return Ok((None, pipe::open(hints)?)) };
        if is_stream_name(path) {
            // It is opened more than once.
            if input.comes_once() {
                return Err(CaptureError::NoRegularFile { name: input.name() });
            }
            let (_, header) = stream::open(input, hints.memory)?;
            let frames = load_index(input)?.frames.len();
            return Ok((Some(frames), Self::Stream(path.clone(), header, hints.clone())));
        }
        if is_depth_folder(path) {
            let depth = DepthSequence::open_with(path, hints.colours)?;
            return Ok((Some(depth.frames()), Self::Depth(depth)));
        }
        match FrameSequence::open(path) {
            Ok(sequence) => Self::files(sequence, hints),
            Err(error) => match VolumeSequence::open_with(path, hints.dense) {
                Ok(volumes) => Self::volumes(volumes, hints),
                Err(_) if matches!(error, SequenceError::NoFrames { .. }) => {
                    Err(CaptureError::NoFrames(error))
                }
                Err(_) => Err(error.into()),
            },
        }
    }

    /// Files of geometry, one a frame; but one glTF file that moves is as many frames as it lasts.
    fn files(sequence: FrameSequence, hints: &Hints) -> Result<(Option<usize>, Self), CaptureError> {
        if let [path] = sequence.paths()
            && path
                .extension()
                .is_some_and(|e| e.eq_ignore_ascii_case("glb") || e.eq_ignore_ascii_case("gltf"))
        {
            let mut animation = Box::new(Animation::open_with(path, &hints.read_options())?);
            let frame_rate = hints.frame_rate;
            if let Some(playing) = select(&mut animation, hints.animation.as_deref(), path)? {
                let frames = animation.frame_count(frame_rate.per_second()) as usize;
                return Ok((Some(frames), Self::Animation { animation, playing, frame_rate }));
            }
        }
        Ok((Some(sequence.paths().len()), Self::Files(sequence, hints.clone())))
    }

    /// Volumes on their own grid.
    fn volumes(volumes: VolumeSequence, hints: &Hints) -> Result<(Option<usize>, Self), CaptureError> {
        let (grid, size_is_known) = match volumes.grid(0, None, hints.truncation) {
            Err(VolumeError::NoVoxelSize { .. }) => {
                let voxel_size = hints.voxel_size.unwrap_or(default_voxel_size());
                (volumes.grid(0, Some(voxel_size), hints.truncation), hints.voxel_size.is_some())
            }
            grid => (grid, true),
        };
        let grid = grid?;
        let notes = volumes.notes(0, &grid)?;
        Ok((Some(volumes.len()), Self::Volumes { volumes, grid, size_is_known, notes }))
    }

    pub(super) fn frame_rate(&self) -> Option<FrameRate> {
        match self {
            Self::Volumes { .. } | Self::PipedGeometry(_) => None,
            Self::Files(sequence, hints) => {
                Some(sequence.times().rate().and_then(FrameRate::nearest).unwrap_or(hints.frame_rate))
            }
            Self::Animation { frame_rate, .. } => Some(*frame_rate),
            Self::Depth(depth) => depth.fps().and_then(FrameRate::nearest),
            Self::Stream(_, header, _) => Some(header.frame_rate),
            Self::PipedStream(frames) => Some(frames.header().frame_rate),
        }
    }

    pub(super) fn grid(&self) -> Option<Grid> {
        match self {
            Self::Files(..) | Self::Animation { .. } | Self::Depth(_) | Self::PipedGeometry(_) => None,
            Self::Volumes { grid, .. } => Some(*grid),
            Self::Stream(_, header, _) => Some(header.grid),
            Self::PipedStream(frames) => Some(frames.header().grid),
        }
    }

    /// Whether its frames are dense fields.
    pub(super) fn is_dense(&self) -> bool {
        matches!(self, Self::Volumes { volumes, .. } if volumes.is_dense())
    }

    /// What its frames are.
    pub(super) fn content(&self) -> ContentKind {
        match self {
            Self::Files(..) | Self::Animation { .. } | Self::PipedGeometry(_) => ContentKind::Geometry,
            Self::Depth(_) => ContentKind::Depth,
            Self::Volumes { .. } | Self::Stream(..) | Self::PipedStream(_) => ContentKind::Volume,
        }
    }

    /// Whether its frames have colours that can be coded; `None` if that is seen in the first frame.
    pub(super) fn has_colour(&self) -> Option<bool> {
        match self {
            Self::Files(..) | Self::Animation { .. } | Self::PipedGeometry(_) => None,
            Self::Depth(depth) => Some(depth.colour_cameras() > 0),
            Self::Volumes { .. } => Some(false),
            Self::Stream(_, header, _) => Some(header.colour_layers.is_some()),
            Self::PipedStream(frames) => Some(frames.header().colour_layers.is_some()),
        }
    }

    /// What a user should know of it.
    pub(super) fn remarks(&self) -> Vec<Remark> {
        match self {
            Self::Files(sequence, _) => sequence.notes().iter().cloned().map(Remark::Note).collect(),
            Self::Depth(depth) => depth_remarks(depth),
            Self::Volumes { size_is_known, grid, notes, .. } => {
                let taken = Remark::VoxelTaken(Length::from_metres(grid.voxel_size.metres()));
                let taken = (!size_is_known).then_some(taken);
                taken.into_iter().chain(notes.iter().cloned().map(Remark::Note)).collect()
            }
            Self::Animation { animation, playing, frame_rate } => {
                let mut names = animation.names().enumerate().map(|(number, name)| label(number, name));
                let taken = names.nth(*playing).unwrap_or_default();
                let others = animation.names().enumerate().filter(|(number, _)| number != playing);
                let others: Vec<_> = others.map(|(number, name)| label(number, name)).collect();
                let still_s = animation.start_s();
                let still = (still_s >= STILL_S).then(|| Remark::StillAtFirst {
                    seconds: still_s,
                    frames: (still_s * frame_rate.per_second()) as u64,
                });
                let taken = (!others.is_empty()).then_some(Remark::Animations { taken, others });
                taken.into_iter().chain(still).collect()
            }
            _ => Vec::new(),
        }
    }

    /// What it holds and a stream does not keep. `input`: what it was found in; `colours`: how it is read.
    pub(super) fn passed_over(&self, input: &Input, colours: Colours) -> Vec<String> {
        let drops = colours == Colours::Drop;
        match (self, input) {
            (Self::Files(sequence, _), _) => {
                sequence.paths().first().map(|path| passed_over(path, colours)).unwrap_or_default()
            }
            (Self::Animation { .. }, Input::Path(path)) => passed_over(path, colours),
            (Self::Depth(_), Input::Path(path)) if drops => {
                let kept = DepthSequence::open_with(path, Colours::Keep);
                let has_colour = kept.is_ok_and(|depth| depth.colour_cameras() > 0);
                has_colour.then(|| "colour images".to_owned()).into_iter().collect()
            }
            (Self::Stream(..) | Self::PipedStream(_), _) if drops && self.has_colour() == Some(true) => {
                vec!["colour".to_owned()]
            }
            _ => Vec::new(),
        }
    }

    pub(super) fn frame_files(&self) -> Option<&[PathBuf]> {
        match self {
            Self::Files(sequence, _) => Some(sequence.paths()),
            _ => None,
        }
    }

    /// When a frame was taken, as [`Self::read`] has it with this frame as the origin (ns).
    pub(super) fn stated_ns(&self, frame: usize) -> Option<u64> {
        match self {
            Self::Files(sequence, _) if *sequence.times() != FrameTimes::Even => Some(0),
            Self::Files(sequence, _) => scanned_ns(sequence.paths().get(frame)?),
            Self::Depth(depth) => depth.timestamp_ns(frame),
            Self::Stream(..) | Self::PipedStream(_) => Some(0),
            Self::Animation { .. } | Self::Volumes { .. } | Self::PipedGeometry(_) => None,
        }
    }

    /// When each frame is shown, counted from the first (ns), as the capture says; `None` if it says nothing, and frames follow each other.
    /// `input`: what it was found in; `rate`: of frames that are numbered.
    pub(super) fn times_ns(&self, input: &Input, rate: FrameRate) -> Option<Vec<u64>> {
        let stated: Vec<u64> = match self {
            Self::Files(sequence, _) => named_ns(sequence, rate)
                .or_else(|| sequence.paths().iter().map(|path| scanned_ns(path)).collect())?,
            Self::Depth(depth) => {
                (0..depth.frames()).map(|frame| depth.timestamp_ns(frame)).collect::<Option<_>>()?
            }
            Self::Stream(..) => {
                StreamSummary::read(input).ok()?.packets.iter().map(|packet| packet.timestamp_ns).collect()
            }
            Self::Animation { .. } | Self::Volumes { .. } | Self::PipedStream(_) | Self::PipedGeometry(_) => {
                return None;
            }
        };
        let first = *stated.first()?;
        Some(stated.into_iter().map(|time| time.saturating_sub(first)).collect())
    }

    pub(super) fn frames_stand_alone(&self) -> bool {
        match self {
            Self::Files(..)
            | Self::Animation { .. }
            | Self::Depth(_)
            | Self::Volumes { .. }
            | Self::PipedGeometry(_) => true,
            Self::Stream(..) | Self::PipedStream(_) => false,
        }
    }

    /// Reads a range of frames of the capture called `name`.
    pub(super) fn read(
        self,
        name: String,
        time_origin: usize,
        range: Range<usize>,
    ) -> Result<Frames<CapturedFrame>, CaptureError> {
        Ok(match self {
            Self::Files(sequence, hints) => {
                let since_origin = sequence.select(time_origin..range.end)?;
                Box::new(FileFrames::new(&since_origin, time_origin, range.start, &hints))
            }
            Self::Animation { animation, frame_rate, .. } => Box::new(range.map(move |number| {
                let geometry = animation.geometry_at(number as f64 / frame_rate.per_second())?;
                let name = format!("{name}, frame {number}");
                let content = Content::Geometry(geometry);
                Ok(CapturedFrame::new(number, name, content))
            })),
            Self::Depth(depth) => Box::new(range.map(move |number| {
                let content = Content::Depth(depth.read(number)?);
                let views = depth.read_colours(number)?;
                let name = format!("{name}, frame {number}");
                let timestamp_ns = depth.timestamp_ns(number);
                Ok(CapturedFrame { timestamp_ns, views, ..CapturedFrame::new(number, name, content) })
            })),
            Self::Volumes { volumes, grid, .. } => Box::new(range.map(move |number| {
                let content = Content::Volume(volumes.read(number, &grid)?);
                let name = volumes.paths()[number].display().to_string();
                Ok(CapturedFrame::new(number, name, content))
            })),
            Self::Stream(path, _, hints) => {
                let input = Input::from(path);
                // All of a stream is read to its very end, where it may turn out to be cut off.
                let is_all = range == (0..load_index(&input)?.frames.len());
                let start = range.start;
                let range = FrameRange { start, end: range.end };
                let settings = stream_settings(&hints, (!is_all).then_some(range));
                let frames = StreamFrames::open(&input, &settings)?;
                Box::new(volumes_of(frames, name, timeline_from(&input, time_origin..start)?))
            }
            Self::PipedStream(frames) => {
                let timeline = Timeline::new(frames.header().frame_rate);
                let since_origin = volumes_of(frames.limited_to(time_origin..range.end), name, timeline);
                let precedes = move |frame: &Result<CapturedFrame, FrameError>| {
                    frame.as_ref().is_ok_and(|frame| frame.number < range.start)
                };
                Box::new(since_origin.skip_while(precedes))
            }
            Self::PipedGeometry(frames) => Box::new(frames.limited_to(range)),
        })
    }
}

/// A thing about a capture that its user should know.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Remark {
    /// What the reader took for granted, in a sentence.
    Note(String),
    /// Parts of the files that a stream does not keep.
    NotKept(Vec<String>),
    /// The voxel size that was taken, as the volumes do not say.
    VoxelTaken(Length),
    /// The animations of a file that has more than one.
    Animations {
        /// Name of the one that plays, or its number if it has none.
        taken: String,
        /// The others.
        others: Vec<String>,
    },
    /// An animation in which nothing moves at first, as that of a scene whose frames count from 1001.
    StillAtFirst {
        /// Time until it begins (s).
        seconds: f64,
        /// Frames until then.
        frames: u64,
    },
    /// Number of depth images without a pose close in time.
    DepthSkipped(usize),
    /// Images are undistorted.
    Undistorted,
    /// Colour images came without a calibration of their camera.
    Uncalibrated,
    /// Frames without a colour image, in a capture that has some.
    WithoutColour {
        /// Number of such frames.
        count: usize,
        /// Number of all frames.
        frames: usize,
    },
    /// The unit that time stamps are taken in, and the frame rate that follows.
    TimeUnit {
        /// Name of the unit.
        unit: &'static str,
        /// Frames a second.
        fps: Option<f64>,
    },
    /// Frames without a usable pose.
    WithoutPose {
        /// Number of such frames.
        count: usize,
        /// Number of all frames.
        frames: usize,
        /// The first such frame.
        first: usize,
    },
    /// A depth that may stand for no reading.
    Saturation(Saturation),
}

/// Time (s) that an animation may stand still at first before it is worth a word.
const STILL_S: f64 = 1.0;

/// A sentence without the names of flags.
impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Note(note) => f.write_str(note),
            Self::NotKept(parts) => write!(f, "not kept: {}", parts.join(", ")),
            Self::VoxelTaken(voxel) => write!(f, "does not say how large a voxel is: taken as {voxel}"),
            Self::Animations { taken, others } => {
                write!(f, "animation {taken} is taken; the others are {}", listed(others))
            }
            Self::StillAtFirst { seconds, frames } => {
                write!(f, "nothing moves in the first {seconds:.1} s, which are {frames} frames")
            }
            Self::DepthSkipped(count) => write!(
                f,
                "{count} depth images have no pose close in time and are left out; the others keep their times"
            ),
            Self::Undistorted => f.write_str("images are undistorted by the coefficients given"),
            Self::Uncalibrated => f.write_str(
                "colour images have no calibration and are taken as seen by the depth camera; `colour` in camera.json can say otherwise",
            ),
            Self::WithoutColour { count, frames } => {
                write!(f, "{count} of {frames} frames have no colour image and keep the colours before")
            }
            Self::TimeUnit { unit, fps } => {
                let rate = fps.map(|fps| format!(" ({fps:.3} frames a second)")).unwrap_or_default();
                write!(f, "time stamps are taken as {unit}{rate}; time_unit in camera.json can say otherwise")
            }
            Self::WithoutPose { count, frames, first } => {
                write!(f, "{count} of {frames} frames have no usable pose, the first is frame {first}")
            }
            Self::Saturation(Saturation { path, value, share, is_reading, depth_m }) => {
                write!(f, "{value} is {:.1} % of {} and counts as ", 100.0 * share, path.display())?;
                match is_reading {
                    true => write!(f, "{depth_m:.1} m: if it means no reading, add it to invalid_values"),
                    false => {
                        f.write_str("no reading: add it to invalid_values, or give [0] there to keep it")
                    }
                }
            }
        }
    }
}

/// Most animations that a sentence names.
const MOST_NAMED: usize = 12;

/// The animations in a sentence, the first of them by name.
fn listed(animations: &[String]) -> String {
    let named = animations.iter().take(MOST_NAMED).cloned().collect::<Vec<_>>().join(", ");
    match animations.len().checked_sub(MOST_NAMED) {
        None | Some(0) => named,
        Some(more) => format!("{named} and {more} more"),
    }
}

/// What an animation is called in a sentence: its name, or its number if it has none. Files may have any bytes there.
fn label(number: usize, name: &str) -> String {
    const MOST_LETTERS: usize = 40;
    match name.trim() {
        "" => number.to_string(),
        name => name.chars().filter(|letter| !letter.is_control()).take(MOST_LETTERS).collect(),
    }
}

/// Selects the animation that was asked for, by its name or its number from 0, else the first that moves anything. `None` if nothing
/// was asked for and nothing moves.
fn select(
    animation: &mut Animation,
    asked: Option<&str>,
    path: &Path,
) -> Result<Option<usize>, CaptureError> {
    let count = animation.names().len();
    let Some(asked) = asked else {
        for index in 0..count {
            animation.select(index)?;
            if animation.is_animated() {
                return Ok(Some(index));
            }
        }
        return Ok(None);
    };
    let by_name = animation.names().position(|name| name == asked);
    let by_number = || asked.parse().ok().filter(|number| *number < count);
    let Some(index) = by_name.or_else(by_number) else {
        let names: Vec<_> = animation.names().enumerate().map(|(number, name)| label(number, name)).collect();
        let (name, asked) = (path.display().to_string(), asked.to_owned());
        return Err(match names.is_empty() {
            true => CaptureError::NotAnimated { name },
            false => CaptureError::NoSuchAnimation { name, asked, others: listed(&names) },
        });
    };
    animation.select(index)?;
    Ok(Some(index))
}

fn depth_remarks(depth: &DepthSequence) -> Vec<Remark> {
    let mut remarks = Vec::new();
    if depth.skipped() > 0 {
        remarks.push(Remark::DepthSkipped(depth.skipped()));
    }
    if depth.is_undistorted() {
        remarks.push(Remark::Undistorted);
    }
    if depth.colours_are_uncalibrated() {
        remarks.push(Remark::Uncalibrated);
    }
    if let count @ 1.. = depth.frames_without_colour() {
        remarks.push(Remark::WithoutColour { count, frames: depth.frames() });
    }
    if let Some(unit) = depth.time_unit() {
        remarks.push(Remark::TimeUnit { unit, fps: depth.fps() });
    }
    if let lost @ [first, ..] = &depth.frames_without_pose()[..]
        && lost.len() < depth.frames()
    {
        remarks.push(Remark::WithoutPose { count: lost.len(), frames: depth.frames(), first: *first });
    }
    remarks.extend(depth.saturation().map(Remark::Saturation));
    remarks
}

/// A timeline that begins with some frames of a stream.
fn timeline_from(input: &Input, frames: Range<usize>) -> Result<Timeline, CaptureError> {
    if frames.is_empty() {
        return Ok(Timeline::new(stream::open(input, MemoryLimit::default())?.1.frame_rate));
    }
    let summary = StreamSummary::read(input)?;
    let mut timeline = Timeline::new(summary.header.frame_rate);
    let packets = summary.packets.get(frames).unwrap_or_default();
    packets.iter().for_each(|packet| _ = timeline.place(packet.timestamp_ns));
    Ok(timeline)
}

/// `timeline`: of the frames before.
fn volumes_of(
    frames: StreamFrames,
    name: String,
    mut timeline: Timeline,
) -> impl Iterator<Item = Result<CapturedFrame, FrameError>> {
    let is_main = frames.header().profile == Profile::Main;
    // Streams may be joined, and their clocks be set: what makes no sense is not handed on.
    frames.map(move |frame| {
        let frame = frame?;
        let (number, start_s) = (frame.number, timeline.place(frame.timestamp_ns));
        let timestamp_ns = Some((start_s * 1e9).round() as u64);
        let volume = frame.volume.into_sparse();
        let volume = volume.map_err(|error| StreamFault::from(error).in_stream(&name))?;
        // Distances that were coded away from the surface too: `--band full` in profile `main`.
        let field = frame.coded_blocks.as_ref().and_then(|coded| coded_field(&volume, coded));
        let content = match field {
            Some(field) => Content::Volume(field),
            None if is_main => Content::Decoded(volume),
            None => Content::Volume(volume),
        };
        let name = format!("{name}, frame {number}");
        Ok(CapturedFrame { timestamp_ns, colour: frame.colour, ..CapturedFrame::new(number, name, content) })
    })
}
