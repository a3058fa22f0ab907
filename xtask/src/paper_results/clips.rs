//! Fig. 8 and Table 1: `isv compare` on each clip, and what of it belongs into the documents.

use super::{markdown, write};
use anyhow::{Context, Result, ensure};
use std::fs;
use std::path::Path;
use std::process::Command;

/// A clip and how it is studied. People as in the paper; large scenes at coarser voxels and with coarser samples.
struct Clip {
    name: &'static str,
    frames: &'static str,
    voxel: &'static str,
    spacing: &'static str,
    more: &'static [&'static str],
}

const PERSON: Clip = Clip { name: "", frames: "0..10", voxel: "5mm", spacing: "5mm", more: &[] };

/// Codecs of open surfaces. Published ones make shells of them, and profile `main` single sheets.
const OPEN: &[&str] = &[
    "--points=3",
    "--codecs=paper-intra,paper-zero,paper-3dof,main-balanced,draco,draco-50,draco-25,draco-10",
];

const CLIPS: [Clip; 5] = [
    Clip { name: "dancer", frames: "0..16", ..PERSON },
    Clip { name: "thomas", ..PERSON },
    Clip { name: "liam", ..PERSON },
    Clip { name: "flag", frames: "0..4", more: OPEN, ..PERSON },
    Clip { name: "monastery", frames: "0..3", voxel: "8cm", spacing: "10cm", more: OPEN },
];

/// Codecs of Table 1, each at its middle point: the paper's own steps, and Draco at the bits that are near to a voxel.
const COSTS: &[&str] = &["--points=1", "--codecs=paper-zero,paper-3dof,paper-6dof,tang-scene,draco,draco-25"];

/// Clips of Table 1: people, and a scene whose samples are coarse as only time and memory are looked at.
const TIMED: [Clip; 3] = [
    Clip { name: "dancer", frames: "0..16", more: COSTS, ..PERSON },
    Clip { name: "liam", more: COSTS, ..PERSON },
    Clip {
        name: "monastery",
        frames: "0..3",
        voxel: "2cm",
        spacing: "20cm",
        more: &["--points=1", "--codecs=paper-zero,paper-3dof,draco,draco-25"],
    },
];

/// Takes of people, each of which the cross-scene transform of the others is trained on.
const PEOPLE: [&str; 3] = ["dancer", "thomas", "liam"];

/// Charts of Fig. 8, by the names of their files.
const CHARTS: [&str; 4] = ["p2s_mean_mm", "chamfer_mm", "d1_psnr_db", "d2_psnr_db"];

/// Fig. 8.
pub(super) fn run(data: &Path, docs: &Path, work: &Path) -> Result<()> {
    for clip in &CLIPS {
        let folder = work.join(clip.name);
        study(clip, data, &folder)?;
        for name in ["results.csv", "bd_rates.csv"] {
            copy(&folder.join(name), docs, &format!("fig8-{}-{name}", clip.name))?;
        }
        for chart in CHARTS {
            let name = format!("fig8-{}-{chart}.svg", clip.name);
            copy(&folder.join("charts").join(format!("{chart}.svg")), docs, &name)?;
        }
    }
    Ok(())
}

/// Table 1: nothing else may run on the machine meanwhile.
pub(super) fn run_table(data: &Path, docs: &Path, work: &Path) -> Result<()> {
    let mut costs = Vec::new();
    for clip in &TIMED {
        let folder = work.join(format!("table1-{}", clip.name));
        study(clip, data, &folder)?;
        costs.extend(cost_rows(clip.name, &fs::read_to_string(folder.join("results.csv"))?)?);
    }
    let header = [
        "clip",
        "codec",
        "point",
        "Mbps",
        "point to surface, mm",
        "prepare, ms",
        "encode, ms",
        "decode to mesh, ms",
        "memory to encode, MB",
        "to decode, MB",
    ];
    write(docs, "table1.md", &markdown(&header, &costs))
}

/// Runs `isv compare` on a clip.
fn study(clip: &Clip, data: &Path, folder: &Path) -> Result<()> {
    isv(&["compare", "--spacing", clip.spacing, "--voxel", clip.voxel], |command| {
        command.arg(data.join(clip.name)).arg("--output").arg(folder).args(clip.more);
        command.args(["--frames", clip.frames]);
        if PEOPLE.contains(&clip.name) {
            for other in PEOPLE.iter().filter(|other| **other != clip.name) {
                command.arg("--train").arg(data.join(other));
            }
        }
    })
}

/// Runs `isv`, built for release.
fn isv(words: &[&str], complete: impl FnOnce(&mut Command)) -> Result<()> {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.args(["run", "--release", "--quiet", "--package", "isv-cli", "--"]).args(words);
    complete(&mut command);
    println!("{command:?}");
    let status = command.status().context("cannot run cargo")?;
    ensure!(status.success(), "isv {} failed", words[0]);
    Ok(())
}

fn copy(from: &Path, docs: &Path, name: &str) -> Result<()> {
    let text = fs::read_to_string(from).with_context(|| format!("{}: cannot read", from.display()))?;
    write(docs, name, &text)
}

/// The rows of Table 1 in a `results.csv`.
fn cost_rows(clip: &str, csv: &str) -> Result<Vec<Vec<String>>> {
    let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().context("a table has a header")?;
    let column = |name: &str| {
        header
            .iter()
            .position(|cell| *cell == name)
            .with_context(|| format!("no column {name} in results.csv"))
    };
    let numbers = [
        (column("mbps")?, 1.0, 2),
        (column("p2s_mean_mm")?, 1.0, 3),
        (column("prepare_ms")?, 1.0, 0),
        (column("encode_ms")?, 1.0, 0),
        (column("decode_ms")?, 1.0, 0),
        (column("encode_peak_bytes")?, 1e-6, 0),
        (column("decode_peak_bytes")?, 1e-6, 0),
    ];
    let cells = |row: Vec<&str>| {
        let mut cells = vec![clip.to_owned(), row[0].to_owned(), row[1].to_owned()];
        for (column, scale, digits) in numbers {
            cells.push(
                row[column].parse::<f64>().map_or("-".to_owned(), |v| format!("{:.digits$}", v * scale)),
            );
        }
        cells
    };
    Ok(lines.map(cells).collect())
}
