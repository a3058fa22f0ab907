//! The baselines on captures: the numbers of `docs/design/017-baselines.md`. Run with `--nocapture` to see them.

use isv_baseline::{BlockBasis, BlockMoments, Draco, TangEncoder, TangFrame, TangSettings, simplify};
use isv_encode::{Encoder, EncoderSettings};
use isv_format::{FrameRate, PaperParameters, Profile, StreamHeader};
use isv_ingest::{MeshIngest, SignMode, decide_sign, ingest_mesh};
use isv_kernels::quant::StepSize;
use isv_metrics::{CompareOptions, compare};
use isv_testkit::{Need, skip};
use isv_volume::{BlockEdge, Grid, SparseVolume, Truncation, VoxelSize};

mod support;

/// Frames of each sequence that are looked at.
const FRAMES: usize = 8;

fn grid() -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(0.005).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    }
}

/// The first frames of a sequence as volumes, if the data is there.
fn volumes(sequence: &str, frames: usize) -> Option<Vec<SparseVolume>> {
    let volume = |frame| {
        let mesh = support::load(sequence, frame)?;
        let (decision, _) = decide_sign(&mesh, SignMode::Paper);
        Some(ingest_mesh(&mesh, &MeshIngest::new(grid()), decision).unwrap())
    };
    (0..frames).map(volume).collect()
}

fn moments(volumes: &[SparseVolume]) -> BlockMoments {
    let mut moments = BlockMoments::new(&grid()).unwrap();
    volumes.iter().for_each(|volume| moments.add(volume));
    moments
}

fn rms(a: &SparseVolume, b: &SparseVolume) -> f64 {
    let squares = a.samples().zip(b.samples()).map(|(a, b)| f64::from(a - b).powi(2));
    (squares.sum::<f64>() / a.sample_count() as f64).sqrt()
}

#[test]
fn energy_compaction_of_dct_and_klt() {
    let Some(dancer) = volumes("dancer", FRAMES) else { return };
    let [Some(thomas), Some(liam)] = ["thomas", "liam"].map(|name| volumes(name, FRAMES)) else { return };
    let own = moments(&dancer);
    let mut others = moments(&thomas);
    others.merge(&moments(&liam));
    let bases = [BlockBasis::dct(BlockEdge::E8), others.klt().unwrap(), own.klt().unwrap()];
    let [fixed, cross, scene] = bases.map(|basis| own.energy_shares(&basis).unwrap());
    for k in [1, 4, 8, 16, 27, 48, 64, 128] {
        let [f, c, s] = [&fixed, &cross, &scene].map(|shares| 100.0 * shares[k]);
        println!("K {k:3}: DCT {f:.3} %, cross-scene {:+.3}, scene-specific {:+.3} points", c - f, s - f);
        assert!(s >= f && s >= c, "the best there is");
    }
    assert!(fixed[48] > 0.98 && scene[48] - fixed[48] < 0.02, "as the paper's Fig. 4: little to gain at 48");
}

/// Under the DCT and with one step for DC and AC, isv and this codec are the same codec but for the arithmetic.
#[test]
fn under_the_dct_it_is_isv_intra() {
    let Some(volumes) = volumes("dancer", 1) else { return };
    for step in [1024, 2048, 4096] {
        let header = StreamHeader::new(
            Profile::Paper(PaperParameters { coefficients: 48, dc_step: step, ac_step: step }),
            grid(),
            FrameRate::DEFAULT,
        );
        let mut isv = Encoder::new(&header, EncoderSettings { gop: 1, ..EncoderSettings::default() });
        let isv_bytes = isv.encode(&volumes[0]).payload().to_bytes().len();
        let settings = TangSettings { grid: grid(), coefficients: 48, step: StepSize::new(step).unwrap() };
        let mut tang = TangEncoder::new(&BlockBasis::dct(BlockEdge::E8), settings);
        let tang_bytes = tang.encode(&volumes[0]).bytes.len();
        let [isv, tang] = [isv.reconstruction().cloned(), tang.reconstruction()]
            .map(|decoded| rms(&volumes[0], &decoded.unwrap()));
        println!(
            "step {step}: isv {isv_bytes} bytes, rms {isv:.2} codes; here {tang_bytes} bytes, {tang:.2}"
        );
        assert!((tang_bytes as f64 / isv_bytes as f64 - 1.0).abs() < 0.01);
        assert!((tang / isv - 1.0).abs() < 0.01);
    }
}

fn total(frames: &[TangFrame]) -> usize {
    frames.iter().map(|frame| frame.bytes.len()).sum()
}

/// Models kept from frame to frame against models that begin afresh, under both transforms.
#[test]
fn models_that_are_kept_save_bytes() {
    let Some(volumes) = volumes("dancer", FRAMES) else { return };
    for (name, basis) in [("DCT", BlockBasis::dct(BlockEdge::E8)), ("KLT", moments(&volumes).klt().unwrap())]
    {
        for step in [1024, 4096] {
            let settings =
                TangSettings { grid: grid(), coefficients: 48, step: StepSize::new(step).unwrap() };
            let mut keeping = TangEncoder::new(&basis, settings);
            let mut errors = 0.0;
            let mut kept = Vec::new();
            for volume in &volumes {
                kept.push(keeping.encode(volume));
                errors += rms(volume, &keeping.reconstruction().unwrap()) / FRAMES as f64;
            }
            let fresh: Vec<_> =
                volumes.iter().map(|volume| TangEncoder::new(&basis, settings).encode(volume)).collect();
            let [kept_bytes, fresh_bytes] = [&kept, &fresh].map(|frames| total(frames) / FRAMES);
            let coefficients = kept.iter().map(|f| f.bytes_coefficients).sum::<usize>() / FRAMES;
            println!(
                "{name} step {step}: kept {kept_bytes} bytes a frame ({coefficients} of coefficients), fresh \
                 {fresh_bytes}, rms {errors:.2} codes"
            );
            assert!(kept_bytes < fresh_bytes);
        }
    }
}

/// The anchors: simplification and 10-bit Draco at 30 frames a second.
#[test]
fn simplified_draco_is_as_strong_as_it_was_measured_before() {
    let Some(draco) = Draco::find() else { return skip(Need::Draco, "draco_encoder is not installed") };
    for (share, bits, most_mbps, most_mm) in [
        (1.0, 10, f64::MAX, 0.4),
        (0.5, 10, f64::MAX, 0.45),
        (0.25, 10, 2.5, 0.46),
        (0.1, 10, 1.2, 0.95),
        (0.05, 10, 0.7, 1.4),
    ] {
        let (mut bytes, mut error_mm, frames) = (0, 0.0, 4);
        for frame in 0..frames {
            let Some(mesh) = support::load("dancer", frame) else { return };
            let simplified = if share < 1.0 { simplify(&mesh, share).unwrap() } else { mesh.clone() };
            let encoded = draco.encode(&simplified, bits).unwrap();
            let decoded = draco.decode(&encoded.output).unwrap().output;
            bytes += encoded.output.len();
            error_mm += compare(&mesh, &decoded, &CompareOptions::default()).unwrap().p2s_mean_mm.unwrap();
        }
        let mbps = (bytes * 8 * 30) as f64 / frames as f64 / 1e6;
        let error_mm = error_mm / frames as f64;
        println!("dancer to {share}, {bits} bits: {mbps:.2} Mbps at {error_mm:.3} mm");
        assert!(mbps < most_mbps && error_mm < most_mm);
    }
}
