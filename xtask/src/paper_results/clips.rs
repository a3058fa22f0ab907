//! Fig. 8 and Table 1: `isv compare` on each clip, and what of it belongs into the documents.

use super::{markdown, write};
use anyhow::{Context, Result, ensure};
use std::fs;
use std::path::Path;
use std::process::Command;

/// A clip and how it is studied. People as in the paper; large scenes at coarser voxels, with samples as coarse.
struct Clip {
    name: &'static str,
    frames: &'static str,
    voxel: &'static str,
    spacing: &'static str,
    /// Takes that the cross-scene transform is trained on: of the same kind, as in the paper.
    training: &'static [&'static str],
}

const CLIPS: [Clip; 5] = [
    Clip { name: "dancer", frames: "0..16", voxel: "5mm", spacing: "5mm", training: &["thomas", "liam"] },
    Clip { name: "thomas", frames: "0..10", voxel: "5mm", spacing: "5mm", training: &["dancer", "liam"] },
    Clip { name: "liam", frames: "0..10", voxel: "5mm", spacing: "5mm", training: &["dancer", "thomas"] },
    Clip { name: "flag", frames: "0..10", voxel: "5mm", spacing: "5mm", training: &[] },
    Clip { name: "monastery", frames: "0..3", voxel: "2cm", spacing: "2cm", training: &[] },
];

/// Charts of Fig. 8, by the names of their files.
const CHARTS: [&str; 4] = ["p2s_mean_mm", "chamfer_mm", "d1_psnr_db", "d2_psnr_db"];

/// Codecs and points of Table 1, where the clip has them: the paper's own step, and what is near to it in error.
const TABLE: [(&str, &str); 5] = [
    ("draco", "10-bit"),
    ("draco-25", "10-bit"),
    ("tang-scene", "k64-step10mm"),
    ("paper-3dof", "k64-ac10mm"),
    ("paper-6dof", "k64-ac10mm"),
];

/// The same for scenes, whose steps and bits are in proportion to voxels and size.
const TABLE_OF_SCENES: [(&str, &str); 5] = [
    ("draco", "12-bit"),
    ("draco-25", "12-bit"),
    ("tang-scene", "k64-step40mm"),
    ("paper-3dof", "k64-ac40mm"),
    ("paper-6dof", "k64-ac40mm"),
];

pub(super) fn run(data: &Path, docs: &Path, work: &Path) -> Result<()> {
    let mut costs = Vec::new();
    for clip in &CLIPS {
        let folder = work.join(clip.name);
        study(clip, data, &folder)?;
        for name in ["results.csv", "bd_rates.csv"] {
            copy(&folder.join(name), docs, &format!("fig8-{}-{name}", clip.name))?;
        }
        for chart in CHARTS {
            copy(
                &folder.join("charts").join(format!("{chart}.svg")),
                docs,
                &format!("fig8-{}-{chart}.svg", clip.name),
            )?;
        }
        let table = fs::read_to_string(folder.join("results.csv"))?;
        costs.extend(cost_rows(clip.name, &table)?);
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

/// Runs `isv compare`, built for release, in a process of its own.
fn study(clip: &Clip, data: &Path, folder: &Path) -> Result<()> {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.args(["run", "--release", "--quiet", "--package", "isv-cli", "--", "compare"]);
    command.arg(data.join(clip.name)).arg("--output").arg(folder);
    command.args(["--frames", clip.frames, "--voxel", clip.voxel, "--spacing", clip.spacing]);
    for training in clip.training {
        command.arg("--train").arg(data.join(training));
    }
    println!("{}: isv compare", clip.name);
    let status = command.status().context("cannot run cargo")?;
    ensure!(status.success(), "{}: isv compare failed", clip.name);
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
    let wanted = |row: &Vec<&str>| {
        TABLE.iter().chain(&TABLE_OF_SCENES).any(|(codec, point)| row[0] == *codec && row[1] == *point)
    };
    let cells = |row: Vec<&str>| {
        let mut cells = vec![clip.to_owned(), row[0].to_owned(), row[1].to_owned()];
        for (column, scale, digits) in numbers {
            cells.push(
                row[column].parse::<f64>().map_or("-".to_owned(), |v| format!("{:.digits$}", v * scale)),
            );
        }
        cells
    };
    Ok(lines.filter(wanted).map(cells).collect())
}
