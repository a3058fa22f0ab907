//! Fig. 5: the AC step at K = 48 and a DC step of 1 mm.

use super::{markdown, mean_and_deviation, measure_at, settings, write, write_chart};
use crate::takes::Sequence;
use anyhow::{Context, Result};
use isv_study::{Axis, Chart, Metric, Record, Series};
use std::path::Path;

const CLIP: (&str, usize) = ("dancer", 16);

const DC_STEP_M: f64 = 0.001;

/// AC steps in metres.
const AC_STEPS_M: [f64; 8] = [0.001, 0.002, 0.005, 0.010, 0.015, 0.020, 0.030, 0.040];

pub(super) fn run(data: &Path, docs: &Path) -> Result<()> {
    let settings = settings(0.005, 0.005)?;
    let take = Sequence::open(&data.join(CLIP.0), CLIP.1)?;
    let records = AC_STEPS_M
        .iter()
        .map(|step| measure_at("paper-3dof", *step, DC_STEP_M, &take, &settings))
        .collect::<Result<Vec<_>>>()?;
    let mbps = |r: &Record| -> Vec<f64> {
        // The keyframe is another kind of frame; its size would drown the spread of the others.
        r.frame_bytes[1..].iter().map(|bytes| *bytes as f64 * 8.0 * r.frames_per_second / 1e6).collect()
    };
    let errors = |r: &Record, metric: Metric| -> Vec<f64> {
        r.frame_errors.iter().filter_map(|error| metric.of(error)).collect()
    };
    for (file, title, axis, values) in [
        ("fig5-rate", "Rate of P-frames", "Mbps", records.iter().map(mbps).collect::<Vec<_>>()),
        (
            "fig5-chamfer",
            "Chamfer distance",
            "mean distance, mm",
            records.iter().map(|r| errors(r, Metric::Chamfer)).collect(),
        ),
        (
            "fig5-p2s",
            "Point to surface",
            "mean distance, mm",
            records.iter().map(|r| errors(r, Metric::PointToSurface)).collect(),
        ),
    ] {
        write_chart(docs, file, &chart(title, axis, &values))?;
    }
    let rows = AC_STEPS_M.iter().zip(&records).map(|(step, record)| {
        let cell = |values: Vec<f64>| {
            let [mean, deviation] = mean_and_deviation(&values);
            format!("{mean:.3} ± {:.3}", 2.0 * deviation)
        };
        let normals = record.value(Metric::NormalError).context("both are meshes")?;
        Ok(vec![
            format!("{}", (step * 1e6).round() / 1e3),
            cell(mbps(record)),
            cell(errors(record, Metric::Chamfer)),
            cell(errors(record, Metric::PointToSurface)),
            format!("{normals:.2}"),
        ])
    });
    let header = ["AC step, mm", "P-frames, Mbps", "Chamfer, mm", "point to surface, mm", "normals, degrees"];
    write(docs, "fig5.md", &markdown(&header, &rows.collect::<Result<Vec<_>>>()?))
}

/// Means with bars of two standard deviations, as in the paper.
fn chart(title: &str, axis: &str, values: &[Vec<f64>]) -> Chart {
    let statistics: Vec<_> = values.iter().map(|values| mean_and_deviation(values)).collect();
    let points: Vec<_> =
        AC_STEPS_M.iter().zip(&statistics).map(|(step, [mean, _])| (step * 1e3, *mean)).collect();
    let series = Series {
        name: "paper-3dof, K 48".to_owned(),
        colour: "#1450a0".to_owned(),
        dashed: false,
        labels: points.iter().map(|(step, value)| format!("{step:.0} mm: {value:.3}")).collect(),
        points,
        spread: statistics.iter().map(|[_, deviation]| 2.0 * deviation).collect(),
    };
    Chart::Lines {
        title: title.to_owned(),
        x: Axis::linear("AC step, mm"),
        y: Axis::linear(axis),
        series: vec![series],
    }
}
