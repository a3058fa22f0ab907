//! What each part of colour coding is worth: the rate at equal error without it.

use crate::colour_table::{Coded, Frame, code, frames};
use anyhow::Result;
use isv::raw::encode::colour::{ColourSearch, ColourSettings};

/// Error that rates are compared at: PSNR of luma at the source's points (dB).
const EQUAL_DB: f64 = 38.5;
/// Qualities that a rate at equal error is found between.
const QUALITIES: [f32; 3] = [35.0, 50.0, 65.0];
const LAYERS: u8 = 2;

/// A way to code: its name, what it changes in the settings, and whether each frame is coded without the others.
type Variant = (&'static str, fn(ColourSettings) -> ColourSettings, bool);

const VARIANTS: [Variant; 11] = [
    ("all", |settings| settings, false),
    ("each frame alone", |settings| settings, true),
    ("vectors carried over, none searched", |s| ColourSettings { search: UNSEARCHED, ..s }, false),
    ("quick search for vectors", |s| ColourSettings { search: ColourSearch::QUICK, ..s }, false),
    ("levels and vectors by error alone", |s| ColourSettings { lambda: 0.0, ..s }, false),
    ("no fit to the source's points", |s| ColourSettings { rounds: 0, ..s }, false),
    ("a fit of one round", |s| ColourSettings { rounds: 1, ..s }, false),
    ("keyframes with the steps of others", |s| ColourSettings { key_step: s.step, ..s }, false),
    ("colour differences with the step of luma", |s| ColourSettings { chroma: 1.0, ..s }, false),
    ("samples at voxels alone", |s| ColourSettings { layers: 1, ..s }, false),
    ("quarter voxels where half voxels miss much", |s| ColourSettings { layers: 3, ..s }, false),
];

/// No search: vectors are those of the frame before, or of neighbours.
const UNSEARCHED: ColourSearch = ColourSearch { cells: usize::MAX, steps: &[], enough: 0.0 };

/// Prints what sequences of a folder take without each part.
pub(crate) fn run(data: &str, sequences: &[String]) -> Result<()> {
    println!("| sequence | coded with | quality 50: Mbps | Y, dB | Mbps at {EQUAL_DB} dB | against all |");
    println!("|---|---|---|---|---|---|");
    for sequence in sequences {
        let frames = frames(&format!("{}/{sequence}", data.trim_end_matches('/')))?;
        let mut all = None;
        for (name, change, alone) in VARIANTS {
            let points = QUALITIES.map(|quality| point(change, quality, alone, &frames));
            let points: Vec<[f64; 2]> = points.into_iter().collect::<Result<_>>()?;
            let rate = rate_at(EQUAL_DB, &points);
            let ratio = rate / *all.get_or_insert(rate);
            let [mbps, psnr_db] = points[1];
            println!(
                "| {sequence} | {name} | {mbps:.3} | {psnr_db:.2} | {rate:.3} | {:+.0} % |",
                100.0 * (ratio - 1.0)
            );
        }
    }
    Ok(())
}

/// Rate (Mbps) and error (dB) of a variant at a quality.
fn point(
    change: fn(ColourSettings) -> ColourSettings,
    quality: f32,
    alone: bool,
    frames: &[Frame],
) -> Result<[f64; 2]> {
    let coded = code(change(ColourSettings::of_quality(quality, LAYERS)), frames, alone)?;
    let Coded { psnr_db, .. } = &coded;
    Ok([coded.mbps(alone), psnr_db[0]])
}

/// Rate at an error, between points of rate and error whose rate rises: rates are taken as powers of the error.
fn rate_at(wanted_db: f64, points: &[[f64; 2]]) -> f64 {
    let last = points.len() - 2;
    let segment = (0..last).find(|segment| wanted_db < points[segment + 1][1]).unwrap_or(last);
    let [[rate, db], [next_rate, next_db]] = [points[segment], points[segment + 1]];
    rate * (next_rate / rate).powf((wanted_db - db) / (next_db - db))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_lie_between_those_of_the_points() {
        let points = [[0.1, 36.0], [0.4, 38.0], [1.6, 40.0]];
        for (db, rate) in [(36.0, 0.1), (37.0, 0.2), (39.0, 0.8), (40.0, 1.6), (41.0, 3.2), (35.0, 0.05)] {
            assert!((rate_at(db, &points) - rate).abs() < 1e-9, "{db}");
        }
    }
}
