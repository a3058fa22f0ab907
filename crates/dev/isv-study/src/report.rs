//! Records to curves, deltas, charts and files.

use crate::bjontegaard::{Delta, RatePoint, delta};
use crate::chart::{Axis, Chart, Series};
use crate::picture::CodecPictures;
use crate::{Codec, Metric, Record, StudyError, page, table};
use isv::raw::io::AtomicFile;
use std::fmt;
use std::io::{self, Write};
use std::path::Path;

/// A study as far as it has come.
#[derive(Clone, Debug)]
pub struct Report {
    /// Name of the take.
    pub take: String,
    /// What all codecs of volumes share, for the head of the page.
    pub setting: String,
    /// Points of each codec together, fine to coarse; codecs in the order of legends.
    pub records: Vec<Record>,
    /// What a reader must know: what was left out and why, what errors include.
    pub notes: Vec<String>,
}

/// What one codec saves against another.
#[derive(Clone, Debug, PartialEq)]
pub struct DeltaRow {
    /// By which measure of quality.
    pub metric: Metric,
    /// The codec compared with.
    pub anchor: String,
    /// The codec compared.
    pub test: String,
    /// By how much.
    pub delta: Delta,
}

/// Names and colours of the parts of a stream, in the order of [`crate::BytesByKind::named`].
const KIND_COLOURS: [&str; 7] = ["#54778f", "#a7bccb", "#d1603d", "#e5b53b", "#3a8f6b", "#9a9a9a", "#8b5fbf"];

/// Colours of codecs by family. isv's paper profile is blue and violet, its main profile crimson, trained transforms green.
/// Draco goes from dark red to yellow, with video it is sky blue, gltfpack is brown, MPEG's codecs are teal, black and olive.
const CODEC_COLOURS: [(&str, &str); 23] = [
    ("paper-intra", "#8fb8de"),
    ("paper-zero", "#5b8fc7"),
    ("paper-3dof", "#1450a0"),
    ("paper-6dof", "#6a4fb3"),
    ("paper-auto", "#0b2545"),
    ("main-realtime", "#d977a8"),
    ("main-balanced", "#b3145f"),
    ("main-archive", "#5c0a33"),
    ("tang-scene", "#1f7a4d"),
    ("tang-cross", "#7bbf8e"),
    ("draco", "#7f1d1d"),
    ("draco-50", "#b8322a"),
    ("draco-25", "#de5a2c"),
    ("draco-10", "#ef8e2e"),
    ("draco-5", "#e8bf45"),
    ("draco-video", "#0288d1"),
    ("draco-video-25", "#81d4fa"),
    ("gltfpack", "#5d4037"),
    ("gltfpack-25", "#a1887f"),
    ("tmc13-octree", "#80cbc4"),
    ("tmc13-trisoup", "#00796b"),
    ("tmc2", "#212121"),
    ("vdmc", "#827717"),
];

impl Report {
    /// Names of the codecs that have records, in order.
    #[must_use]
    pub fn codecs(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.records.iter().map(|r| r.codec.as_str()).collect();
        names.dedup();
        names
    }

    fn records_of<'a>(&'a self, codec: &'a str) -> impl Iterator<Item = &'a Record> {
        self.records.iter().filter(move |record| record.codec == codec)
    }

    /// Whether any codec has colour that could be compared.
    #[must_use]
    pub fn has_colour(&self) -> bool {
        self.records.iter().any(|record| record.value(Metric::ColourY).is_some())
    }

    /// The measures that there are: those of geometry, and those of colour if there is any.
    #[must_use]
    pub fn metrics(&self) -> Vec<Metric> {
        let colour = if self.has_colour() { &Metric::COLOUR[..] } else { &[] };
        Metric::ALL.iter().chain(colour).copied().collect()
    }

    /// A codec's points, rate in megabits a second: that of geometry, of colour or of both, as the measure is.
    #[must_use]
    pub fn curve(&self, codec: &str, metric: Metric) -> Vec<RatePoint> {
        let point = |record: &Record| {
            record
                .value(metric)
                .map(|v| RatePoint { rate: record.mbps_for(metric), quality_db: metric.quality_db(v) })
        };
        self.records_of(codec).filter_map(point).collect()
    }

    /// Each codec against each other, by each metric.
    #[must_use]
    pub fn deltas(&self) -> Vec<DeltaRow> {
        let codecs = self.codecs();
        let mut rows = Vec::new();
        for metric in self.metrics() {
            for anchor in &codecs {
                for test in codecs.iter().filter(|test| *test != anchor) {
                    let delta = delta(&self.curve(anchor, metric), &self.curve(test, metric));
                    rows.push(DeltaRow {
                        metric,
                        anchor: (*anchor).to_owned(),
                        test: (*test).to_owned(),
                        delta,
                    });
                }
            }
        }
        rows
    }

    /// Whether a codec gives points back.
    #[must_use]
    pub fn has_points(&self) -> bool {
        self.records.iter().any(|record| record.value(Metric::PointToSurface).is_none())
    }

    /// What readers must know of the programs of other codecs, each thing once.
    #[must_use]
    pub fn program_notes(&self) -> Vec<&str> {
        let mut notes: Vec<_> = self
            .records
            .iter()
            .flat_map(|record| &record.programs)
            .filter_map(|p| p.note.as_deref())
            .collect();
        notes.sort_unstable();
        notes.dedup();
        notes
    }

    /// All charts, each with the name of its files.
    #[must_use]
    pub fn charts(&self) -> Vec<(&'static str, Chart)> {
        let mut charts: Vec<_> = self.metrics().into_iter().map(|m| (m.key(), self.rate_chart(m))).collect();
        charts.push((
            "encode_ms",
            self.time_chart("Rate against time to encode", |r| r.prepare_ms.median + r.encode_ms.median),
        ));
        charts.push(("decode_ms", self.time_chart("Rate against time to decode", |r| r.decode_ms.median)));
        charts.extend(self.kinds_chart().map(|chart| ("kinds", chart)));
        charts
    }

    /// Rate against a measure of error.
    #[must_use]
    pub fn rate_chart(&self, metric: Metric) -> Chart {
        let y = if metric.higher_is_better() {
            Axis::linear(metric.axis())
        } else {
            Axis::logarithmic(metric.axis())
        };
        let series = self.series(|record| record.value(metric).map(|value| (record.mbps_for(metric), value)));
        let rate = match (metric, self.has_colour()) {
            (Metric::RenderY, _) => "rate of geometry and colour, Mbps",
            (Metric::ColourY, _) => "rate of colour, Mbps",
            (_, true) => "rate of geometry, Mbps",
            (_, false) => "rate, Mbps",
        };
        // A codec without colour has no place in the legend of a chart of it.
        let series =
            series.into_iter().filter(|one| !metric.is_of_colour() || !one.points.is_empty()).collect();
        Chart::Lines { title: metric.title().to_owned(), x: Axis::logarithmic(rate), y, series }
    }

    fn time_chart(&self, title: &str, ms: fn(&Record) -> f64) -> Chart {
        let series = self.series(|record| Some((ms(record), record.geometry_mbps())));
        let (x, y) = (Axis::logarithmic("median time, ms a frame"), Axis::logarithmic("rate, Mbps"));
        Chart::Lines { title: title.to_owned(), x, y, series }
    }

    /// What the bits say, at the middle point of each codec that tells; none if none does.
    fn kinds_chart(&self) -> Option<Chart> {
        let mut bars = Vec::new();
        let mut names = Vec::new();
        for codec in self.codecs() {
            let told: Vec<_> = self.records_of(codec).filter_map(|r| r.kinds.map(|k| (r, k))).collect();
            let Some((record, kinds)) = told.get(told.len() / 2) else { continue };
            names = kinds.named().map(|(name, _)| name.to_owned()).to_vec();
            let heights = kinds.named().map(|(_, bytes)| record.per_second(bytes));
            // Colour comes last, and is left out where nobody has any.
            let shown = if self.has_colour() { heights.len() } else { heights.len() - 1 };
            bars.push((codec.to_owned(), heights[..shown].to_vec()));
            names.truncate(shown);
        }
        let parts = names.into_iter().zip(KIND_COLOURS.map(str::to_owned)).collect();
        let (title, y) = ("Bits by kind, middle point".to_owned(), "Mbps".to_owned());
        (!bars.is_empty()).then_some(Chart::Bars { title, y, parts, bars })
    }

    /// One line a codec, through the points that a record gives.
    fn series(&self, point: impl Fn(&Record) -> Option<(f64, f64)>) -> Vec<Series> {
        let line = |codec: &str| {
            let with_points: Vec<_> =
                self.records_of(codec).filter_map(|r| point(r).map(|p| (r.point.clone(), p))).collect();
            let (labels, points) = with_points.into_iter().unzip();
            Series {
                name: codec.to_owned(),
                colour: colour(codec).to_owned(),
                dashed: codec.parse::<Codec>().is_ok_and(|codec| !codec.programs().is_empty()),
                points,
                labels,
                spread: Vec::new(),
            }
        };
        self.codecs().into_iter().map(line).collect()
    }

    /// Each codec's point nearest to the level that most codecs have a point near to. The distances from it to each codec's
    /// nearest point, as ratios, have the smallest sum. None without records.
    #[must_use]
    pub fn peers(&self, alike: Alike) -> Option<Peers<'_>> {
        let levels = self.records.iter().filter_map(|record| alike.level(record));
        let peers = levels.map(|level| self.near(alike, level));
        peers.min_by(|a, b| a.spread().total_cmp(&b.spread()))
    }

    /// The peers of all kinds, without those that are the same points again.
    #[must_use]
    pub fn all_peers(&self) -> Vec<Peers<'_>> {
        let mut kinds: Vec<Peers> = Vec::new();
        for peers in Alike::ALL.into_iter().filter_map(|alike| self.peers(alike)) {
            if !kinds.iter().any(|kind| kind.records == peers.records) {
                kinds.push(peers);
            }
        }
        kinds
    }

    /// Each codec's point nearest to a level, by ratio.
    fn near(&self, alike: Alike, level: f64) -> Peers<'_> {
        let distance = |record: &&Record| ratio(alike.level(record), level);
        let nearest = |codec| {
            let records = self.records_of(codec).filter(|record| alike.level(record).is_some());
            records.min_by(|a, b| distance(a).total_cmp(&distance(b)))
        };
        Peers { alike, level, records: self.codecs().into_iter().filter_map(nearest).collect() }
    }

    /// Writes tables, charts and the page into a folder that is there. Files are `results.csv`, `bd_rates.csv`,
    /// `charts/*.svg` and `.png`, `index.html`, and the contact sheets that there are.
    ///
    /// # Errors
    /// Files that cannot be written, charts that cannot be drawn.
    pub fn write(
        &self,
        folder: &Path,
        pictures: &[CodecPictures],
        sheets: &[SheetFile],
    ) -> Result<(), StudyError> {
        let deltas = self.deltas();
        write_file(&folder.join("results.csv"), table::results(&self.records).as_bytes())?;
        write_file(&folder.join("bd_rates.csv"), table::deltas(&deltas).as_bytes())?;
        write_file(&folder.join("programs.csv"), table::programs(&self.records).as_bytes())?;
        let charts_folder = folder.join("charts");
        let named =
            |cause: io::Error| io::Error::new(cause.kind(), format!("{}: {cause}", charts_folder.display()));
        std::fs::create_dir_all(&charts_folder).map_err(named)?;
        let charts = self.charts();
        for (name, chart) in &charts {
            write_file(&charts_folder.join(format!("{name}.svg")), chart.svg().as_bytes())?;
            write_file(&charts_folder.join(format!("{name}.png")), &chart.png()?)?;
        }
        for sheet in sheets {
            write_file(&folder.join(sheet.alike.sheet_name()), &sheet.png)?;
        }
        let page = page::html(self, &deltas, &charts, pictures, sheets);
        write_file(&folder.join("index.html"), page.as_bytes())
    }
}

/// What the points of codecs are alike in where pictures of them stand side by side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alike {
    /// Rate of geometry (Mbps).
    Rate,
    /// Mean distance of decoded points to the source (mm), which all codecs have.
    Error,
}

impl Alike {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Rate, Self::Error];

    fn level(self, record: &Record) -> Option<f64> {
        let level = match self {
            Self::Rate => Some(record.geometry_mbps()),
            Self::Error => record.value(Metric::DecodedToSource),
        };
        level.filter(|level| *level > 0.0)
    }

    /// File of the contact sheet in the folder of a study.
    #[must_use]
    pub fn sheet_name(self) -> &'static str {
        match self {
            Self::Rate => "sheet.png",
            Self::Error => "sheet_error.png",
        }
    }
}

impl fmt::Display for Alike {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rate => "rate",
            Self::Error => "error",
        })
    }
}

/// One point of each codec, all near to one level.
#[derive(Clone, Debug)]
pub struct Peers<'a> {
    /// What they are alike in.
    pub alike: Alike,
    /// The level, in the unit of `alike`.
    pub level: f64,
    /// The points.
    pub records: Vec<&'a Record>,
}

impl Peers<'_> {
    /// Sum of the distances to the level.
    fn spread(&self) -> f64 {
        self.records.iter().map(|record| ratio(self.alike.level(record), self.level)).sum()
    }

    /// The level with its unit.
    #[must_use]
    pub fn level_text(&self) -> String {
        match self.alike {
            Alike::Rate => format!("{:.2} Mbps", self.level),
            Alike::Error => format!("{:.2} mm", self.level),
        }
    }
}

/// Distance of two levels as a ratio: its logarithm, without the sign.
fn ratio(level: Option<f64>, other: f64) -> f64 {
    level.map_or(f64::INFINITY, |level| (level / other).ln().abs())
}

/// A contact sheet as a PNG file.
#[derive(Clone, Debug)]
pub struct SheetFile {
    /// What its columns are alike in.
    pub alike: Alike,
    /// Bytes of the file.
    pub png: Vec<u8>,
}

/// The colour of a codec's line.
pub(crate) fn colour(codec: &str) -> &'static str {
    CODEC_COLOURS.iter().find(|(name, _)| *name == codec).map_or("#444444", |(_, colour)| colour)
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), StudyError> {
    let mut file = AtomicFile::create(path).map_err(io::Error::from)?;
    file.write_all(bytes)?;
    Ok(file.commit().map_err(io::Error::from)?)
}
