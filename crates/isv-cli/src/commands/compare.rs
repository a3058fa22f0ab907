//! `isv compare`: a rate-distortion study of several codecs on one take.
//!
//! Each codec runs in a process of its own ([`worker`]), so that its peak memory is its own and one that fails takes nothing
//! with it. What was measured lies in the folder ([`store`]); a study that was interrupted goes on where it stopped.

mod store;
mod take;
mod worker;

use crate::capture::Hints;
use crate::failure::usage;
use crate::frame_range::FrameRange;
use crate::frame_rate;
use crate::length::Length;
use crate::output::{frames_in_words, print};
use crate::progress::Progress;
use crate::table::table_of;
use crate::terms::SignName;
use crate::threads::use_threads;
use anyhow::{Result, bail};
use isv::format::FrameRate;
use isv::ingest::MeshIngest;
use isv::io::{Unit, read_mesh};
use isv::metrics::CompareOptions;
use isv::volume::{BlockEdge, Grid, Truncation, VoxelSize};
use isv_study::{Codec, Exhibition, Metric, Record, Report, StudySettings, Take, Training};
use std::num::NonZero;
use std::path::PathBuf;
use store::Store;
use take::CapturedTake;

/// Points at which each codec is measured unless asked otherwise; also the most.
const POINTS: u8 = 5;

/// Where the scale of errors in pictures ends, in voxels.
const ERROR_RANGE_VOXELS: f64 = 0.4;

/// Study codecs side by side: rate, error, time and memory of each over its operating points
///
/// Writes results.csv, bd_rates.csv, charts and index.html into DIR. Run again after an interruption, it goes on where it
/// stopped.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Meshes: a folder of frames, a pattern, a file or an .isv
    input: String,
    /// Folder for the results; made if it is not there
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Codecs to study, separated by commas; without it all but those that lack what they need: paper-intra, paper-zero,
    /// paper-3dof, paper-6dof, paper-auto, tang-scene, tang-cross, draco, draco-50, draco-25, draco-10, draco-5
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    codecs: Vec<Codec>,
    /// Operating points of each codec, from 5
    #[arg(long, value_name = "N", default_value_t = POINTS, value_parser = clap::value_parser!(u8).range(1..=POINTS as i64))]
    points: u8,
    /// Another take for tang-cross to be trained on; may be given several times
    #[arg(long, value_name = "INPUT")]
    train: Vec<String>,
    /// Only these frames, without frame B
    #[arg(long, value_name = "A..B")]
    frames: Option<FrameRange>,
    /// Number of the frame that is drawn; without it, the one in the middle
    #[arg(long, value_name = "N")]
    picture: Option<usize>,
    /// Edge of a voxel of the codecs of volumes
    #[arg(long, value_name = "LENGTH", default_value = "5mm")]
    voxel: Length,
    /// A keyframe at least every N frames
    #[arg(long, value_name = "N", default_value = "30", value_parser = clap::value_parser!(u32).range(1..))]
    gop: u32,
    /// How to tell inside from outside
    #[arg(long, value_enum, default_value = "auto")]
    sign: SignName,
    /// Surfaces are sampled once a square of this edge where errors are measured
    #[arg(long, value_name = "LENGTH", default_value = "5mm")]
    spacing: Length,
    /// Unit of coordinates: m, dm, cm, mm or in; .isv files know theirs
    #[arg(long, default_value_t = Unit::Metre)]
    units: Unit,
    /// Frames a second
    #[arg(long, value_parser = frame_rate::parse, default_value = "30")]
    fps: FrameRate,
    /// Threads that each codec may use; all cores without it
    #[arg(long, value_name = "N")]
    threads: Option<NonZero<usize>>,
    /// Measure this codec in this process, and say each step on standard output
    #[arg(long, value_name = "NAME", hide = true)]
    worker: Option<Codec>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    use_threads(args.threads)?;
    let study = Study::new(args)?;
    if let Some(codec) = args.worker {
        return worker::run(&study, codec, usize::from(args.points));
    }
    study.store.make()?;
    let codecs = args.codecs();
    let steps = codecs.len() * usize::from(args.points) * worker::STEPS_A_FRAME * study.take.frames();
    let progress = Progress::new(Some(steps), "comparing");
    let (mut records, mut notes) = (Vec::new(), Vec::new());
    for codec in codecs {
        let done = worker::spawn(codec, &study.store, &progress)?;
        records.extend(done.records);
        for note in done.notes {
            progress.note(&note);
            notes.push(note);
        }
    }
    drop(progress);
    if records.is_empty() {
        bail!("{}: no codec could be measured", args.input);
    }
    let report = Report { take: study.title(), setting: study.setting(), records, notes };
    report.write(&args.output, study.exhibition(&report)?.as_ref())?;
    print(&format!("{}\n\n{}", summary(&report), study.outcome()))
}

impl Args {
    /// The codecs asked for; without a word, all that have what they need.
    fn codecs(&self) -> Vec<Codec> {
        if !self.codecs.is_empty() {
            let asked = Codec::ALL.into_iter().filter(|codec| self.codecs.contains(codec));
            return asked.collect();
        }
        let untrained = |codec: &Codec| *codec == Codec::Tang(Training::CrossScene) && self.train.is_empty();
        Codec::ALL.into_iter().filter(|codec| !untrained(codec)).collect()
    }
}

/// What parent and workers have in common.
struct Study {
    take: CapturedTake,
    training: Vec<CapturedTake>,
    settings: StudySettings,
    store: Store,
}

impl Study {
    fn new(args: &Args) -> Result<Self> {
        let voxel_size = VoxelSize::from_metres(args.voxel.metres())
            .map_err(|error| usage(format!("--voxel {}: {error}", args.voxel)))?;
        let hints = Hints { frame_rate: args.fps, ..Hints::in_unit(args.units) };
        let take = CapturedTake::open(&args.input, hints, args.frames)?;
        let training = args.train.iter().map(|input| CapturedTake::open(input, hints, None));
        let training = training.collect::<Result<Vec<_>>>()?;
        let picture_frame = args.picture.unwrap_or(take.frames() / 2);
        if picture_frame >= take.frames() {
            let frames = frames_in_words(take.frames());
            return Err(usage(format!("--picture {picture_frame}: the take has {frames}, counted from 0")));
        }
        let truncation = Truncation::from_voxels(8).expect("8 is in range");
        let grid = Grid { voxel_size, edge: BlockEdge::E8, truncation };
        let ingest = MeshIngest { sign: args.sign.into(), ..MeshIngest::new(grid) };
        let compare = CompareOptions { spacing_m: args.spacing.metres(), ..CompareOptions::default() };
        let settings = StudySettings { ingest, gop: args.gop, compare, picture_frame };
        let threads = args.threads.map_or(0, NonZero::get);
        let store = Store::new(&args.output, &take, &training, &settings, threads)?;
        Ok(Self { take, training, settings, store })
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

    /// The picture frame at equal rate.
    fn exhibition(&self, report: &Report) -> Result<Option<Exhibition>> {
        let Some(mbps) = report.common_mbps() else { return Ok(None) };
        let frame = self.settings.picture_frame;
        let original = self.take.mesh(frame)?;
        let mesh =
            |record| -> Result<_> { Ok((record, read_mesh(&self.store.picture(record), Unit::Metre)?)) };
        let decoded = report.near_rate(mbps).into_iter().map(mesh).collect::<Result<Vec<_>>>()?;
        let range_m = ERROR_RANGE_VOXELS * self.settings.ingest.grid.voxel_size.metres();
        Ok(Some(Exhibition::new(&original, &decoded, range_m, frame, mbps)?))
    }

    fn outcome(&self) -> String {
        let folder = self.store.folder().display();
        format!(
            "{folder}/index.html    charts, pictures and tables on one page\n\
             {folder}/results.csv   all points; bd_rates.csv has the savings, charts/ the charts as SVG and PNG"
        )
    }
}

/// One row a codec: its point nearest to the common rate, and what it saves against the first.
fn summary(report: &Report) -> String {
    let mut table = table_of([
        "codec",
        "point",
        "Mbps",
        "p2s mm",
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
    for record in report.common_mbps().map_or(Vec::new(), |mbps| report.near_rate(mbps)) {
        table.add_row([
            record.codec.clone(),
            record.point.clone(),
            format!("{:.2}", record.mbps()),
            number(record.value(Metric::PointToSurface), 3),
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
