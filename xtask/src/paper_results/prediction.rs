//! Fig. 10: every frame alone, zero-motion, 3-DoF and 6-DoF at K = 48, and what motion vectors take.

use super::{markdown, measure_at, settings, write, write_chart};
use crate::takes::Sequence;
use anyhow::{Context, Result};
use isv_study::{Chart, Metric, Record};
use std::path::Path;

/// Clip, frames, edge of a voxel and spacing of samples in metres. Steps are the paper's 1 mm and 10 mm at voxels of 5 mm,
/// in proportion elsewhere.
const CLIPS: [(&str, usize, f64, f64); 4] = [
    ("dancer", 16, 0.005, 0.005),
    ("thomas", 10, 0.005, 0.005),
    ("liam", 16, 0.005, 0.005),
    ("monastery", 4, 0.02, 0.2),
];

const CODECS: [&str; 4] = ["paper-intra", "paper-zero", "paper-3dof", "paper-6dof"];

/// Bits of the P-frames of a clip under one kind of prediction, in megabits a second.
struct Rates {
    total: f64,
    motion: f64,
}

pub(super) fn run(data: &Path, docs: &Path) -> Result<()> {
    let mut rows = Vec::new();
    for (clip, frames, voxel_m, spacing_m) in CLIPS {
        let settings = settings(voxel_m, spacing_m)?;
        let take = Sequence::open(&data.join(clip), frames)?;
        let mut bars = Vec::new();
        let mut totals = Vec::new();
        for codec in CODECS {
            let record = measure_at(codec, 2.0 * voxel_m, 0.2 * voxel_m, &take, &settings)?;
            let rates = rates(&record)?;
            totals.push(rates.total);
            let saved = |against: usize| match totals.get(against) {
                Some(before) if against < totals.len() - 1 => {
                    format!("{:+.0} %", 100.0 * (rates.total / before - 1.0))
                }
                _ => String::new(),
            };
            let p2s = record.value(Metric::PointToSurface).context("both are meshes")?;
            rows.push(vec![
                clip.to_owned(),
                codec.to_owned(),
                format!("{:.2}", rates.total),
                saved(0),
                saved(1),
                format!("{:.0} %", 100.0 * rates.motion / rates.total),
                format!("{p2s:.3}"),
            ]);
            bars.push((codec.to_owned(), vec![rates.total - rates.motion, rates.motion]));
        }
        let part = |name: &str, colour: &str| (name.to_owned(), colour.to_owned());
        let parts = vec![part("residual and blocks", "#3a8f6b"), part("motion", "#d1603d")];
        let title = format!("{clip}, K 48");
        let chart = Chart::Bars { title, y: "Mbps of P-frames".to_owned(), parts, bars };
        write_chart(docs, &format!("fig10-{clip}"), &chart)?;
    }
    let header = [
        "clip",
        "prediction",
        "P-frames, Mbps",
        "against intra",
        "against zero-motion",
        "motion",
        "point to surface, mm",
    ];
    write(docs, "fig10.md", &markdown(&header, &rows))
}

fn rates(record: &Record) -> Result<Rates> {
    let kinds = record.kinds.context("isv tells what its bytes say")?;
    let frames = (record.frames() - 1) as f64;
    let mbps = |bytes: f64| bytes * 8.0 * record.frames_per_second / frames / 1e6;
    // The keyframe has no motion.
    let bytes = record.frame_bytes[1..].iter().sum::<u64>() as f64;
    Ok(Rates { total: mbps(bytes), motion: mbps(kinds.motion) })
}
