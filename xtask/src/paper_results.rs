//! The paper's figures and its table again, on our own clips: CSV, SVG and Markdown into `docs/results`.

mod clips;
mod prediction;
mod steps;
mod transforms;

use anyhow::{Context, Result};
use isv::raw::ingest::{MeshIngest, SignMode};
use isv::raw::metrics::CompareOptions;
use isv::raw::volume::{BlockEdge, Grid, Truncation, VoxelSize};
use isv_study::{Chart, Codec, OperatingPoint, Record, StudySettings, Subject, Take, Tools};
use std::fs;
use std::path::Path;

/// Which part of the results to make.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Part {
    /// Fig. 4: DCT against trained transforms
    Fig4,
    /// Fig. 5: sweep of the AC step at K = 48
    Fig5,
    /// Fig. 8: rate and distortion of all codecs on all clips
    Fig8,
    /// Fig. 10: kinds of prediction at K = 48
    Fig10,
    /// Table 1: time and memory; needs a machine that does nothing else
    Table1,
}

/// Makes one part, or all.
pub(crate) fn run(data: &Path, docs: &Path, work: &Path, part: Option<Part>) -> Result<()> {
    fs::create_dir_all(docs).with_context(|| format!("{}: cannot make this folder", docs.display()))?;
    let wanted = |this| part.is_none_or(|part| part == this);
    if wanted(Part::Fig4) {
        transforms::run(data, docs)?;
    }
    if wanted(Part::Fig5) {
        steps::run(data, docs)?;
    }
    if wanted(Part::Fig10) {
        prediction::run(data, docs)?;
    }
    if wanted(Part::Fig8) {
        clips::run(data, docs, work)?;
    }
    if wanted(Part::Table1) {
        clips::run_table(data, docs, work)?;
    }
    Ok(())
}

/// Settings of the paper: blocks of 8 voxels, keyframes only where a sequence begins.
fn settings(voxel_m: f64, spacing_m: f64) -> Result<StudySettings> {
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(voxel_m)?,
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    };
    let compare = CompareOptions { spacing_m, ..CompareOptions::default() };
    let ingest = MeshIngest { sign: SignMode::Paper, ..MeshIngest::new(grid) };
    Ok(StudySettings { ingest, gop: 300, compare, picture_frame: 0, first_frame: 0 })
}

/// Measures the paper's codec with K = 48.
fn measure_at(
    codec: &str,
    ac_step_m: f64,
    dc_step_m: f64,
    take: &dyn Take,
    settings: &StudySettings,
) -> Result<Record> {
    let codec: Codec = codec.parse()?;
    let point = OperatingPoint::Steps { coefficients: 48, dc_step_m, ac_step_m };
    let subject =
        Subject::prepare(codec, take, &[], settings, &Tools::default())?.context("isv needs no program")?;
    Ok(subject.measure(point, &mut || ())?.record)
}

fn write(docs: &Path, name: &str, text: &str) -> Result<()> {
    let path = docs.join(name);
    println!("{}", path.display());
    fs::write(&path, text).with_context(|| format!("{}: cannot write", path.display()))
}

fn write_chart(docs: &Path, name: &str, chart: &Chart) -> Result<()> {
    write(docs, &format!("{name}.svg"), &chart.svg())
}

/// A Markdown table.
fn markdown(header: &[&str], rows: &[Vec<String>]) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let header: Vec<String> = header.iter().map(|cell| (*cell).to_owned()).collect();
    let rule = format!("|{}\n", "---|".repeat(header.len()));
    line(&header) + &rule + &rows.iter().map(|row| line(row)).collect::<String>()
}

/// Mean and standard deviation.
fn mean_and_deviation(values: &[f64]) -> [f64; 2] {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
    [mean, variance.sqrt()]
}
