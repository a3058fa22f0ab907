//! `isv compare`: a rate-distortion study of several codecs on one take.
//!
//! Each point of each codec is measured by this program run again, as [`worker`] says.

use crate::capture;
use crate::cli_enums::SignName;
use crate::count;
use crate::failure::usage;
use crate::origin;
use crate::output::print;
use crate::progress::Progress;
use crate::table::table_of;
use crate::threads::use_threads;
use anyhow::{Context, Result, bail};
use isv::raw::format::FrameRate;
use isv::raw::ingest::{MeshIngest, SignDecision, SignMode, decide_sign};
use isv::raw::io::{Colours, ReadOptions, Unit, check_folder_name, read_geometry, read_geometry_as};
use isv::raw::metrics::CompareOptions;
use isv::raw::take::FrameRange;
use isv::raw::take::Length;
use isv::raw::take::capture::Hints;
use isv::raw::take::encode::default_grid;
use isv::raw::volume::{Grid, TriangleMesh, VoxelSize};
use isv_study::worker::{self, Outcome};
use isv_study::{
    Alike, CapturedTake, Codec, CodecPictures, Metric, OperatingPoint, Peers, Record, Report, Scale, Sheet,
    SheetFile, SheetStream, Store, StudyError, StudySettings, Take, Tools, Training, drawable,
};
use std::ffi::OsString;
use std::num::NonZero;
use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

/// Points at which each codec is measured unless asked otherwise; also the most.
const POINTS: u8 = 5;

/// Most streams of the contact sheet.
const SHEET_STREAMS: usize = 5;

/// End of the scale of errors in pictures, in voxels.
const ERROR_RANGE_VOXELS: f64 = 0.4;

/// Study codecs side by side: rate, error, time and memory of each over its operating points
///
/// Writes results.csv, bd_rates.csv, charts, a contact sheet and index.html into DIR. Run again after an interruption, it
/// goes on where it stopped. Colour is compared where the input and the codec have it. Profile main, draco-video, tmc13 and
/// tmc2 keep it.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Meshes: a folder of frames, a pattern, a file or an .isv
    input: PathBuf,
    /// Folder for the results; made if it is not there
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Codecs to study, separated by commas [default: all that can run]
    ///
    /// Savings are summed up against the first. isv's own codecs are paper-intra, paper-zero, paper-3dof, paper-6dof,
    /// paper-auto, main-realtime, main-balanced and main-archive. Trained transforms are tang-scene and tang-cross. The others
    /// are draco, draco-50, draco-25, draco-10, draco-5, draco-video, draco-video-25, gltfpack, gltfpack-25, tmc13-octree,
    /// tmc13-trisoup, tmc2 and vdmc. A number is the share of faces (%) that simplification leaves. draco-video codes
    /// textures as H.264 beside Draco's meshes.
    ///
    /// Codecs from draco on run programs of others: Draco, ffmpeg (x264), gltfpack (meshoptimizer), tmc13 (MPEG G-PCC),
    /// tmc2 (MPEG V-PCC) and vdmc (MPEG V-DMC). A codec without its programs is left out with a note.
    #[arg(help_heading = "Codecs", long, value_name = "NAME,..", value_delimiter = ',')]
    codecs: Vec<Codec>,
    /// Path of another codec's program [default: found on the PATH]
    ///
    /// May be given several times. Names are draco_encoder, draco_decoder, ffmpeg, gltfpack, tmc3, PccAppEncoder,
    /// PccAppDecoder, encode and decode (V-DMC). TMC2 and V-DMC need the folder cfg of their source beside the program or
    /// up to 3 folders above.
    #[arg(help_heading = "Other codecs", long = "tool", value_name = "NAME=PATH", value_parser = tool_parser)]
    tools: Vec<(String, PathBuf)>,
    /// End another codec's program after this time [default: 10 min to 4 h]
    ///
    /// TMC2 and V-DMC code a whole take in one run.
    #[arg(help_heading = "Other codecs", long, value_name = "SECONDS", value_parser = clap::value_parser!(u32).range(1..))]
    tool_limit: Option<u32>,
    /// Operating points of each codec, from 5
    #[arg(help_heading = "Codecs", long, value_name = "N", default_value_t = POINTS, value_parser = clap::value_parser!(u8).range(1..=POINTS as i64))]
    points: u8,
    /// Another take for tang-cross to be trained on; may be given several times
    #[arg(help_heading = "Codecs", long, value_name = "INPUT")]
    train: Vec<PathBuf>,
    /// Only these frames, without frame B
    #[arg(help_heading = "Input", long, value_name = "A..B")]
    frames: Option<FrameRange>,
    /// Animation of a glTF file, by name or number from 0
    ///
    /// Without it, the first that moves anything plays.
    #[arg(help_heading = "Input", long, value_name = "NAME")]
    animation: Option<String>,
    /// Number of the frame that is drawn [default: the one in the middle]
    #[arg(help_heading = "Input", long, value_name = "N")]
    picture: Option<usize>,
    /// Turn of the camera of the contact sheet about the up axis: 0 looks from +z
    #[arg(long, value_name = "DEGREES", default_value = "0", allow_negative_numbers = true)]
    yaw: f64,
    /// Edge of a voxel of the codecs of volumes
    #[arg(help_heading = "Codecs", long, value_name = "LENGTH", default_value = "5mm")]
    voxel: Length,
    /// A keyframe at least every N frames
    #[arg(help_heading = "Codecs", long, value_name = "N", default_value = "30", value_parser = clap::value_parser!(u32).range(1..))]
    gop: u32,
    /// How to tell inside from outside
    #[arg(help_heading = "Codecs", long, value_enum, default_value = "auto")]
    sign: SignName,
    /// Edge of the square of surface that each sample stands for
    #[arg(long, value_name = "LENGTH", default_value = "5mm")]
    spacing: Length,
    /// Unit of coordinates: m, dm, cm, mm, in, ft or us-ft
    #[arg(help_heading = "Coordinates of the input", long, default_value_t = Unit::Metre)]
    units: Unit,
    /// Place of the meshes, in their unit, that becomes the origin
    ///
    /// It holds for the meshes of --train too.
    #[arg(help_heading = "Coordinates of the input", long, value_name = "X,Y,Z", value_parser = origin::parse, allow_hyphen_values = true)]
    origin: Option<[f64; 3]>,
    /// Frames a second
    #[arg(long, default_value = "30")]
    fps: FrameRate,
    /// Threads that each codec may use [default: one a core]
    #[arg(help_heading = "Running", long, value_name = "N", value_parser = count::parse::<NonZero<usize>>)]
    threads: Option<NonZero<usize>>,
    /// Measure one point of one codec in this process
    ///
    /// Each step is said on standard output. For `isv compare` itself.
    #[arg(long, value_name = "CODEC:POINT", hide = true, value_parser = worker_parser)]
    worker: Option<(Codec, usize)>,
}

/// Name and path of a program.
fn tool_parser(text: &str) -> Result<(String, PathBuf), String> {
    let (name, path) = text.split_once('=').ok_or_else(|| "a name, = and a path".to_owned())?;
    let (name, path) = (name.to_owned(), PathBuf::from(path));
    Tools::default().set(&name, &path).map_err(|error| error.to_string())?;
    Ok((name, path))
}

/// A codec and the place of one of its points.
fn worker_parser(text: &str) -> Result<(Codec, usize), String> {
    let parse = |(codec, point): (&str, &str)| Some((codec.parse().ok()?, point.parse().ok()?));
    text.split_once(':').and_then(parse).ok_or_else(|| "a codec, a colon and a number".to_owned())
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    check_folder_name(&args.output, "a study: CSV, charts and a page")?;
    use_threads(args.threads)?;
    let study = Study::new(args)?;
    if let Some((codec, point)) = args.worker {
        let Study { take, training, settings, store, .. } = &study;
        let point = study.points(codec)[point];
        return Ok(worker::run(take, training, settings, store, codec, point, &args.tools())?);
    }
    study.store.make().map_err(|error| match error {
        StudyError::Output(error) => error.into(),
        other => anyhow::Error::from(other),
    })?;
    let codecs = args.codecs();
    let steps = codecs.len() * usize::from(args.points) * worker::STEPS_A_FRAME * study.take.frames();
    let progress = Progress::new(Some(steps), "comparing");
    let (mut records, mut notes) = (Vec::new(), study.notes());
    notes.iter().for_each(|note| progress.note(note));
    for codec in codecs {
        for (index, point) in study.points(codec).into_iter().enumerate() {
            if let Some(record) = study.store.find(codec, &point) {
                (0..worker::STEPS_A_FRAME * record.frames()).for_each(|_| progress.step());
                records.push(record);
                continue;
            }
            match worker::spawn(this_program_as_worker(codec, index)?, codec, &point, || progress.step())? {
                Outcome::Kept => records.extend(study.store.find(codec, &point)),
                Outcome::Failed { sentence, at_all_points } => {
                    progress.note(&sentence);
                    notes.push(sentence);
                    if at_all_points {
                        break;
                    }
                }
            }
        }
    }
    if records.is_empty() {
        drop(progress);
        bail!("{}: no codec could be measured", args.input.display());
    }
    let mut report = Report { take: study.title(), setting: study.setting(), records, notes: Vec::new() };
    let (mut pictures, mut sheets) = (Vec::new(), Vec::new());
    for peers in report.all_peers() {
        let alike = peers.alike;
        let results = [
            study.pictures(&peers).map(|drawn| pictures.push(drawn)).map_err(|error| ("pictures", error)),
            study.sheet(&peers).map(|drawn| sheets.extend(drawn)).map_err(|error| ("contact sheet", error)),
        ];
        for (what, error) in results.into_iter().filter_map(Result::err) {
            notes.push(format!("no {what} at equal {alike}: {error:#}"));
            progress.note(&notes[notes.len() - 1]);
        }
    }
    report.notes = notes;
    drop(progress);
    report.write(&args.output, &pictures, &sheets)?;
    print(&format!(
        "{}\n{}\n\n{}",
        summary(&report),
        study.word_on_colour(&report),
        study.outcome(!sheets.is_empty())
    ))
}

/// This program with its arguments, and the word that makes it a worker behind the command's name, before any that might end options.
fn this_program_as_worker(codec: Codec, point: usize) -> Result<Command> {
    let program = std::env::current_exe().context("cannot find this program")?;
    let mut arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    let name = arguments.iter().position(|argument| argument == "compare").context("no command's name")?;
    arguments.insert(name + 1, format!("--worker={codec}:{point}").into());
    let mut command = Command::new(program);
    command.args(arguments);
    Ok(command)
}

impl Args {
    /// The programs of other codecs.
    fn tools(&self) -> Tools {
        let mut tools = Tools::default();
        for (name, path) in &self.tools {
            tools.set(name, path).expect("checked when it was read");
        }
        if let Some(seconds) = self.tool_limit {
            tools.set_time_limit(Duration::from_secs(seconds.into()));
        }
        tools
    }

    /// The codecs asked for, in that order; without a word, all that have what they need.
    fn codecs(&self) -> Vec<Codec> {
        let untrained = |codec: &Codec| *codec == Codec::Tang(Training::CrossScene) && self.train.is_empty();
        if self.codecs.is_empty() {
            return Codec::ALL.into_iter().filter(|codec| !untrained(codec)).collect();
        }
        let mut asked = Vec::new();
        for codec in &self.codecs {
            if !asked.contains(codec) {
                asked.push(*codec);
            }
        }
        asked
    }
}

/// What parent and workers have in common.
struct Study {
    take: CapturedTake,
    training: Vec<CapturedTake>,
    settings: StudySettings,
    /// Points of each codec.
    points: usize,
    /// What operating points are in proportion to.
    scale: Scale,
    /// How published codecs make volumes of meshes, by the first frame.
    published_sign: SignDecision,
    /// Whether the take's first frame has colour.
    has_colour: bool,
    /// From where the contact sheet is drawn.
    yaw_degrees: f64,
    store: Store,
}

impl Study {
    fn new(args: &Args) -> Result<Self> {
        let voxel_size = VoxelSize::from_metres(args.voxel.metres())
            .map_err(|error| usage(format!("--voxel {}: {error}", args.voxel)))?;
        let hints = Hints { frame_rate: args.fps, ..capture::hints(args.units) }.with_origin(args.origin);
        let animation = args.animation.clone();
        let in_colour = Hints { colours: Colours::Keep, animation, ..hints.clone() };
        let take = CapturedTake::open(&args.input, in_colour, args.frames)?;
        if args.train.contains(&args.input) {
            return Err(usage(format!(
                "--train {}: a transform trained on the take itself is tang-scene",
                args.input.display()
            )));
        }
        let training = args.train.iter().map(|input| CapturedTake::open(input, hints.clone(), None));
        let training = training.collect::<Result<Vec<_>, _>>()?;
        let picture = args.picture.unwrap_or(take.range().start + take.frames() / 2);
        if !take.range().contains(&picture) {
            let range = take.range();
            return Err(usage(format!("--picture {picture}: the frames are {}..{}", range.start, range.end)));
        }
        let grid = Grid { voxel_size, ..default_grid() };
        let first = take.mesh(0)?;
        let settings = StudySettings {
            ingest: MeshIngest { sign: args.sign.into(), ..MeshIngest::new(grid) },
            gop: args.gop,
            compare: CompareOptions { spacing_m: args.spacing.metres(), ..CompareOptions::default() },
            picture_frame: picture - take.range().start,
            first_frame: take.range().start,
        };
        let store = Store::new(&args.output, &take, &training, &settings, &args.tools())?;
        let scale = Scale::new(&first, &grid);
        let published_sign = decide_sign(&first, settings.published_ingest().sign).0;
        Ok(Self {
            take,
            training,
            settings,
            points: usize::from(args.points),
            scale,
            published_sign,
            has_colour: first.appearance.is_some(),
            yaw_degrees: args.yaw,
            store,
        })
    }

    /// The points at which a codec is measured.
    fn points(&self, codec: Codec) -> Vec<OperatingPoint> {
        codec.points(self.scale, self.points)
    }

    /// What a reader of the figures must know of the take.
    fn notes(&self) -> Vec<String> {
        if self.published_sign != SignDecision::Offset {
            return Vec::new();
        }
        let voxel_m = self.settings.ingest.grid.voxel_size.metres();
        let offset = Length::from_metres(self.settings.ingest.offset_voxels * voxel_m);
        let which = match self.settings.ingest.sign {
            SignMode::Auto => "published codecs of volumes code",
            _ => "codecs of volumes code",
        };
        vec![format!(
            "the surface is open: {which} a shell {offset} away from it on both sides, and their errors are of that size whatever \
             their settings; all others code the surface itself"
        )]
    }

    /// The take's name without the folders it lies in.
    fn title(&self) -> String {
        let name = self.take.name().trim_end_matches('/');
        name.rsplit('/').next().unwrap_or(name).to_owned()
    }

    fn setting(&self) -> String {
        let voxel = Length::from_metres(self.settings.ingest.grid.voxel_size.metres());
        format!(
            "{} frames a second; voxels of {voxel}; keyframes every {} frames; {} threads; errors measured on one sample a \
             square of {}.",
            self.take.frame_rate().per_second(),
            self.settings.gop,
            rayon::current_num_threads(),
            Length::from_metres(self.settings.compare.spacing_m),
        )
    }

    /// The picture frame of points that are alike.
    fn pictures(&self, peers: &Peers) -> Result<CodecPictures> {
        let original = self.take.mesh(self.settings.picture_frame)?;
        let frame = self.settings.first_frame + self.settings.picture_frame;
        let read = |record: &&Record| read_geometry(&self.store.picture(record), Unit::Metre);
        let decoded = peers.records.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(CodecPictures::new(&original, peers, &decoded, self.error_range_m(), frame)?)
    }

    /// End of the scale of errors in pictures.
    fn error_range_m(&self) -> f64 {
        ERROR_RANGE_VOXELS * self.settings.ingest.grid.voxel_size.metres()
    }

    /// The source and those streams that are alike of which there are frames to show: those with colour first, if the take has any.
    fn sheet(&self, peers: &Peers) -> Result<Option<SheetFile>> {
        let frames = self.settings.sheet_frames(self.take.frames());
        let has_frames = |record: &&&Record| self.has_frames(record, &frames);
        let mut chosen: Vec<_> = peers.records.iter().filter(has_frames).collect();
        chosen.sort_by_key(|record| record.bytes_colour == 0);
        chosen.truncate(SHEET_STREAMS);
        if chosen.is_empty() {
            return Ok(None);
        }
        let mut streams = Vec::new();
        for record in chosen {
            streams.push(SheetStream::of_record(record, self.decoded_frames(record, &frames)?));
        }
        let source = frames.iter().map(|frame| self.take.mesh(*frame)).collect::<Result<_, _>>()?;
        let close_up = frames.iter().position(|frame| *frame == self.settings.picture_frame);
        let numbers = frames.iter().map(|frame| self.settings.first_frame + frame).collect();
        let close_up = close_up.unwrap_or_default();
        let (yaw_degrees, range_m) = (self.yaw_degrees, self.error_range_m());
        let sheet = Sheet { frames: numbers, source, streams, close_up, yaw_degrees, range_m };
        Ok(Some(SheetFile { alike: peers.alike, png: sheet.png()? }))
    }

    /// Whether the decoded frames of a record can be shown.
    fn has_frames(&self, record: &Record, frames: &[usize]) -> bool {
        self.store.stream(record).is_some()
            || frames.iter().all(|frame| self.store.sheet_frame(record, *frame).is_some())
    }

    /// Decoded frames of a record, with their colour.
    fn decoded_frames(&self, record: &Record, frames: &[usize]) -> Result<Vec<TriangleMesh>> {
        let hints = capture::colour_hints(Unit::Metre);
        if let Some(path) = self.store.stream(record) {
            let stream = CapturedTake::open(&path, hints, None)?;
            return Ok(frames.iter().map(|frame| stream.mesh(*frame)).collect::<Result<_, _>>()?);
        }
        let options = ReadOptions::new(Unit::Metre).with_colours(Colours::Keep);
        let read = |frame| {
            let path = self.store.sheet_frame(record, frame);
            let path = path.with_context(|| format!("{}: frame {frame} was not kept", record.codec))?;
            Ok(drawable(read_geometry_as(&path, &options)?, record.point_step_m))
        };
        frames.iter().map(|frame| read(*frame)).collect()
    }

    /// Explains to a reader how colour is counted, or why there is none.
    fn word_on_colour(&self, report: &Report) -> &'static str {
        match (self.has_colour, report.has_colour()) {
            (_, true) => {
                "\nMbps is the rate of geometry; colour Y dB is the PSNR of luma at the decoded surface."
            }
            (true, false) => {
                "\nNo colour was compared: the frames have colour, but none of these codecs keeps it (main-balanced does, for one)."
            }
            (false, false) => "\nNo colour was compared: the frames have none.",
        }
    }

    fn outcome(&self, has_sheets: bool) -> String {
        let folder = self.store.folder().display();
        let sheet = match has_sheets {
            true => format!(
                "\n{folder}/sheet.png     source and streams side by side at equal rate; sheet_error.png at equal error"
            ),
            false => String::new(),
        };
        format!(
            "{folder}/index.html    charts, pictures and tables on one page\n\
             {folder}/results.csv   all points; bd_rates.csv has the savings, charts/ the charts as SVG and PNG{sheet}"
        )
    }
}

/// One row a codec: its point nearest to the common rate, and what it saves against the first.
fn summary(report: &Report) -> String {
    let mut table = table_of([
        "codec",
        "point",
        "Mbps",
        "colour Mbps",
        "colour Y dB",
        "p2s mm",
        "to source mm",
        "normals deg",
        "D2 dB",
        "encode ms",
        "decode ms",
        "BD-rate",
    ]);
    let number =
        |value: Option<f64>, digits: usize| value.map_or("-".to_owned(), |v| format!("{v:.digits$}"));
    let deltas = report.deltas();
    let anchor = report.codecs()[0].to_owned();
    let saving = |record: &Record| {
        let row = deltas
            .iter()
            .find(|d| d.metric == Metric::PointToSurface && d.anchor == anchor && d.test == record.codec);
        row.and_then(|row| row.delta.rate_percent)
            .map_or("-".to_owned(), |rate| format!("{:+.1} %", rate.mean))
    };
    for record in report.peers(Alike::Rate).map_or(Vec::new(), |peers| peers.records) {
        table.add_row([
            record.codec.clone(),
            record.point.clone(),
            format!("{:.2}", record.geometry_mbps()),
            number((record.bytes_colour > 0).then(|| record.colour_mbps()), 2),
            number(record.value(Metric::ColourY), 1),
            number(record.value(Metric::PointToSurface), 3),
            number(record.value(Metric::DecodedToSource), 3),
            number(record.value(Metric::NormalError), 2),
            number(record.value(Metric::D2), 2),
            format!("{:.0}", record.prepare_ms.median + record.encode_ms.median),
            format!("{:.0}", record.decode_ms.median),
            saving(record),
        ]);
    }
    format!(
        "Each codec at its point nearest to a common rate; BD-rate against {anchor} by point-to-surface distance:\n\n{}",
        table.trim_fmt()
    )
}
