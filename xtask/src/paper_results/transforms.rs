//! Fig. 4: how much energy the first K coefficients hold, and what is lost of the surface without the others.

use super::{markdown, mean_and_deviation, settings, write, write_chart};
use crate::takes::Sequence;
use anyhow::{Context, Result};
use isv::raw::ingest::{decide_sign, ingest_mesh};
use isv::raw::metrics::compare;
use isv::raw::surface::{SurfaceOptions, extract_surface};
use isv::raw::volume::{SparseVolume, TriangleMesh};
use isv_baseline::{BlockBasis, BlockMoments};
use isv_study::{Axis, Chart, Series, StudySettings, Take};
use std::path::Path;

/// The clip, the frames that are looked at, and those that the surface is measured on.
const CLIP: (&str, usize, usize) = ("dancer", 8, 4);

/// What the cross-scene transform is trained on: other people.
const TRAINING: [(&str, usize); 2] = [("thomas", 8), ("liam", 8)];

/// Numbers of coefficients; the paper's practical range is 27 to 64.
const COEFFICIENTS: [usize; 9] = [8, 16, 20, 27, 36, 48, 64, 96, 128];

/// A transform and what it is called.
struct Candidate {
    name: &'static str,
    colour: &'static str,
    basis: BlockBasis,
    /// Share of the energy in the first K coefficients, by K.
    shares: Vec<f64>,
    /// Chamfer and point-to-surface distance for each of [`COEFFICIENTS`]: mean and deviation over frames.
    distances: Vec<[[f64; 2]; 2]>,
}

pub(super) fn run(data: &Path, docs: &Path) -> Result<()> {
    let settings = settings(0.005, 0.005)?;
    let (clip, frames, measured) = CLIP;
    let (meshes, volumes) = read(&Sequence::open(&data.join(clip), frames)?, &settings)?;
    let scene = moments(&[&volumes], &settings)?;
    let mut others = Vec::new();
    for (name, frames) in TRAINING {
        others.push(read(&Sequence::open(&data.join(name), frames)?, &settings)?.1);
    }
    let cross = moments(&others.iter().collect::<Vec<_>>(), &settings)?;
    let candidates = [
        ("DCT", "#1450a0", BlockBasis::dct(settings.ingest.grid.edge)),
        ("cross-scene KLT", "#7bbf8e", cross.klt()?),
        ("scene KLT", "#1f7a4d", scene.klt()?),
    ];
    let mut measured_candidates = Vec::new();
    for (name, colour, basis) in candidates {
        let shares = scene.energy_shares(&basis)?;
        let distances = COEFFICIENTS
            .iter()
            .map(|k| distances(&basis, *k, &meshes[..measured], &volumes[..measured], &settings))
            .collect::<Result<_>>()?;
        measured_candidates.push(Candidate { name, colour, basis, shares, distances });
    }
    report(docs, &measured_candidates)
}

fn read(take: &dyn Take, settings: &StudySettings) -> Result<(Vec<TriangleMesh>, Vec<SparseVolume>)> {
    let (mut meshes, mut volumes, mut sign) = (Vec::new(), Vec::new(), None);
    for mesh in take.meshes().map_err(anyhow::Error::from_boxed)? {
        let mesh = mesh.map_err(anyhow::Error::from_boxed)?;
        let sign = *sign.get_or_insert_with(|| decide_sign(&mesh, settings.ingest.sign).0);
        volumes.push(ingest_mesh(&mesh, &settings.ingest, sign)?);
        meshes.push(mesh);
    }
    Ok((meshes, volumes))
}

fn moments(takes: &[&Vec<SparseVolume>], settings: &StudySettings) -> Result<BlockMoments> {
    let mut moments = BlockMoments::new(&settings.ingest.grid)?;
    takes.iter().copied().flatten().for_each(|volume| moments.add(volume));
    Ok(moments)
}

/// Chamfer and point-to-surface distance in millimetres of volumes that keep K coefficients, unquantized.
fn distances(
    basis: &BlockBasis,
    k: usize,
    meshes: &[TriangleMesh],
    volumes: &[SparseVolume],
    settings: &StudySettings,
) -> Result<[[f64; 2]; 2]> {
    let (mut chamfer, mut p2s) = (Vec::new(), Vec::new());
    for (mesh, volume) in meshes.iter().zip(volumes) {
        let surface = extract_surface(&basis.truncate(volume, k), &SurfaceOptions { normals: false });
        let error = compare(mesh, &surface, &settings.compare)?;
        chamfer.push(error.chamfer_mm);
        p2s.push(error.p2s_mean_mm.context("both are meshes")?);
    }
    Ok([mean_and_deviation(&chamfer), mean_and_deviation(&p2s)])
}

fn report(docs: &Path, candidates: &[Candidate]) -> Result<()> {
    let dct = &candidates[0].shares;
    let gains = candidates[1..].iter().map(|c| {
        let points = COEFFICIENTS.map(|k| (k as f64, 100.0 * (c.shares[k] - dct[k])));
        series(c, points.to_vec(), Vec::new())
    });
    let k_axis = || Axis::logarithmic("retained coefficients, K");
    let gain = Chart::Lines {
        title: "Energy gained over the DCT".to_owned(),
        x: k_axis(),
        y: Axis::linear("percentage points"),
        series: gains.collect(),
    };
    write_chart(docs, "fig4-energy", &gain)?;
    for (i, (file, title)) in
        [("fig4-chamfer", "Chamfer distance"), ("fig4-p2s", "Point to surface")].into_iter().enumerate()
    {
        let lines = candidates.iter().map(|c| {
            let points = COEFFICIENTS.iter().zip(&c.distances).map(|(k, d)| (*k as f64, d[i][0]));
            series(c, points.collect(), c.distances.iter().map(|d| d[i][1]).collect())
        });
        let chart = Chart::Lines {
            title: title.to_owned(),
            x: k_axis(),
            y: Axis::linear("mean distance, mm"),
            series: lines.collect(),
        };
        write_chart(docs, file, &chart)?;
    }
    write(docs, "fig4.md", &table(candidates))
}

fn series(candidate: &Candidate, points: Vec<(f64, f64)>, spread: Vec<f64>) -> Series {
    Series {
        name: candidate.name.to_owned(),
        colour: candidate.colour.to_owned(),
        dashed: false,
        labels: points.iter().map(|(k, v)| format!("K {k}: {v:.3}")).collect(),
        points,
        spread,
    }
}

fn table(candidates: &[Candidate]) -> String {
    let [dct, cross, scene] = candidates else { unreachable!("three transforms") };
    let rows = COEFFICIENTS.iter().enumerate().map(|(i, &k)| {
        let points = |c: &Candidate| format!("{:+.3}", 100.0 * (c.shares[k] - dct.shares[k]));
        let chamfer = |c: &Candidate| format!("{:.3}", c.distances[i][0][0]);
        let p2s = |c: &Candidate| format!("{:.3}", c.distances[i][1][0]);
        vec![
            k.to_string(),
            format!("{:.3}", 100.0 * dct.shares[k]),
            points(cross),
            points(scene),
            chamfer(dct),
            chamfer(cross),
            chamfer(scene),
            p2s(dct),
            p2s(cross),
            p2s(scene),
            format!("{:.0}", scene.basis.shared_bytes(k) as f64 / 1024.0),
        ]
    });
    markdown(
        &[
            "K",
            "DCT energy, %",
            "cross-scene KLT, points more",
            "scene KLT, points more",
            "Chamfer DCT, mm",
            "cross-scene",
            "scene",
            "p2s DCT, mm",
            "cross-scene",
            "scene",
            "size of a KLT, KiB",
        ],
        &rows.collect::<Vec<_>>(),
    )
}
