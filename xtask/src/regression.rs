//! The table that keeps the codec from getting worse unnoticed: bytes and errors of a few frames of each clip.

use crate::takes::{Figure, Sequence};
use anyhow::{Context, Result, bail};
use isv::raw::ingest::MeshIngest;
use isv::raw::metrics::CompareOptions;
use isv::raw::volume::{BlockEdge, Grid, Truncation, VoxelSize};
use isv_study::{Codec, Metric, OperatingPoint, StudySettings, Subject, Take, Tools};
use isv_testkit::{Need, skip};
use std::fmt::Write;
use std::path::Path;

/// Largest growth that is let pass, as a share: of bytes, of point-to-surface distance, of normal error. Streams are the same on
/// any number of threads, but the encoder's searches use floating point, whose last bits differ between processors.
const TOLERANCES: [f64; 3] = [0.005, 0.01, 0.01];

/// A clip, its number of frames, its voxels and the spacing of samples in metres. The figure is the project's own: its rows
/// are there for everyone.
const CLIPS: [(&str, usize, f64, f64); 6] = [
    ("figure", 4, 0.005, 0.005),
    ("dancer", 4, 0.005, 0.005),
    ("thomas", 3, 0.005, 0.005),
    ("xbot", 2, 0.005, 0.005),
    ("flag", 3, 0.005, 0.005),
    ("monastery", 2, 0.08, 0.2),
];

/// The paper's kinds of prediction, at its steps for people, in proportion to the voxel, and profile `main` at its default.
const CODECS: [&str; 5] = ["paper-intra", "paper-zero", "paper-3dof", "paper-6dof", "main-balanced"];

const HEADER: &str = "clip,setting,frames,bytes,p2s_mean_mm,normal_error_deg";

/// One line of the table.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    clip: String,
    setting: String,
    frames: usize,
    /// Bytes of the stream, millimetres, degrees.
    values: [f64; 3],
}

impl Row {
    fn to_csv(&self) -> String {
        let Self { clip, setting, frames, values: [bytes, p2s, normals] } = self;
        format!("{clip},{setting},{frames},{bytes:.0},{p2s:.5},{normals:.4}")
    }

    fn parse(line: &str) -> Option<Self> {
        let mut cells = line.split(',');
        let mut next = || cells.next();
        let (clip, setting, frames) = (next()?.to_owned(), next()?.to_owned(), next()?.parse().ok()?);
        let values = [next()?.parse().ok()?, next()?.parse().ok()?, next()?.parse().ok()?];
        Some(Self { clip, setting, frames, values })
    }

    /// What became worse than `before` by more than it may.
    fn worsening(&self, before: &Self) -> Option<String> {
        let names = ["bytes", "p2s_mean_mm", "normal_error_deg"];
        let mut sentence = String::new();
        for i in 0..3 {
            let growth = self.values[i] / before.values[i] - 1.0;
            // What is no number is worse than any.
            if growth.is_nan() || growth > TOLERANCES[i] {
                // Writing to a string does not fail.
                let _ = write!(
                    sentence,
                    " {} {} -> {} ({:+.2} %, {:.1} % allowed);",
                    names[i],
                    before.values[i],
                    self.values[i],
                    100.0 * growth,
                    100.0 * TOLERANCES[i]
                );
            }
        }
        (!sentence.is_empty()).then(|| format!("{} {}:{sentence}", self.clip, self.setting))
    }
}

/// Measures all clips that are there and compares them with the table, or writes them into it.
pub(crate) fn run(data: &Path, table: &Path, update: bool) -> Result<()> {
    let committed = std::fs::read_to_string(table).unwrap_or_default();
    let parse =
        |line: &str| Row::parse(line).with_context(|| format!("{}: not a row: {line}", table.display()));
    let before = committed.lines().skip(1).map(parse).collect::<Result<Vec<_>>>()?;
    if before.is_empty() && !update {
        bail!("{}: no table; --update makes one", table.display());
    }
    let (mut rows, mut worse) = (Vec::new(), Vec::new());
    for (clip, frames, voxel_m, spacing_m) in CLIPS {
        let folder = data.join(clip);
        let take: Box<dyn Take> = match clip {
            "figure" => Box::new(Figure::new(frames)?),
            _ if folder.is_dir() => Box::new(Sequence::open(&folder, frames)?),
            _ => {
                skip(Need::Captures, format_args!("no data at {}", folder.display()));
                rows.extend(before.iter().filter(|row| row.clip == clip).cloned());
                continue;
            }
        };
        for codec in CODECS {
            let row = measure_row(take.as_ref(), codec, voxel_m, spacing_m)?;
            let same =
                |old: &&Row| (&old.clip, &old.setting, old.frames) == (&row.clip, &row.setting, row.frames);
            let old = before.iter().find(same);
            println!("{}{}", row.to_csv(), old.map_or(String::new(), |old| change(&row, old)));
            match old {
                Some(old) => worse.extend(row.worsening(old)),
                None if !update => bail!("{clip} {codec} is not in {}; --update adds it", table.display()),
                None => {}
            }
            rows.push(row);
        }
    }
    if update {
        let lines: Vec<_> = rows.iter().map(Row::to_csv).collect();
        return std::fs::write(table, format!("{HEADER}\n{}\n", lines.join("\n")))
            .with_context(|| format!("{}: cannot write", table.display()));
    }
    if !worse.is_empty() {
        bail!("worse than {}:\n{}\nif this is meant, --update", table.display(), worse.join("\n"));
    }
    Ok(())
}

fn measure_row(take: &dyn Take, codec: &str, voxel_m: f64, spacing_m: f64) -> Result<Row> {
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(voxel_m)?,
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    };
    let compare = CompareOptions { spacing_m, ..CompareOptions::default() };
    let settings =
        StudySettings { ingest: MeshIngest::new(grid), gop: 30, compare, picture_frame: 0, first_frame: 0 };
    let codec: Codec = codec.parse()?;
    let subject =
        Subject::prepare(codec, take, &[], &settings, &Tools::default())?.context("isv needs no program")?;
    let point = match codec {
        Codec::Main(_) => OperatingPoint::Step { step_m: 1.8 * voxel_m },
        _ => OperatingPoint::Steps { coefficients: 64, dc_step_m: 0.2 * voxel_m, ac_step_m: 2.0 * voxel_m },
    };
    let record = subject.measure(point, &mut || ())?.record;
    let value = |metric| record.value(metric).with_context(|| format!("{}: cannot be measured", take.name()));
    Ok(Row {
        clip: take.name().to_owned(),
        setting: codec.to_string(),
        frames: record.frames(),
        values: [record.bytes as f64, value(Metric::PointToSurface)?, value(Metric::NormalError)?],
    })
}

/// How a row differs from the table's.
fn change(row: &Row, old: &Row) -> String {
    let [bytes, p2s, normals] = [0, 1, 2].map(|i| 100.0 * (row.values[i] / old.values[i] - 1.0));
    format!("   ({bytes:+.2} % bytes, {p2s:+.2} % p2s, {normals:+.2} % normals)")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(values: [f64; 3]) -> Row {
        Row { clip: "figure".to_owned(), setting: "paper-3dof".to_owned(), frames: 4, values }
    }

    #[test]
    fn rows_are_read_as_they_are_written() {
        let row = row([123_456.0, 0.51234, 4.5678]);
        assert_eq!(Row::parse(&row.to_csv()), Some(row));
        assert_eq!(Row::parse("figure,paper-3dof,4,12"), None);
    }

    #[test]
    fn a_worsening_beyond_the_tolerance_is_named() {
        let before = row([1000.0, 0.5, 5.0]);
        assert_eq!(row([1004.0, 0.504, 5.04]).worsening(&before), None);
        assert_eq!(row([500.0, 0.1, 1.0]).worsening(&before), None);
        for (values, name) in [
            ([1006.0, 0.5, 5.0], "bytes 1000 -> 1006"),
            ([1000.0, 0.51, 5.0], "p2s_mean_mm"),
            ([1000.0, 0.5, 5.1], "normal_error_deg"),
        ] {
            let sentence = row(values).worsening(&before).unwrap();
            assert!(sentence.starts_with("figure paper-3dof:") && sentence.contains(name), "{sentence}");
        }
    }
}
