//! Decoding at reduced resolution against a full decode.

mod support;

use isv_decode::{Decoder, Limits, Lod};
use isv_encode::{EncoderSettings, MotionMode};
use isv_format::{PacketReader, Prediction, StreamHeader};
use isv_surface::{SurfaceOptions, extract_surface};
use isv_volume::{SparseVolume, VoxelSize};
use support::{ball, encode, header, main_header};

const LODS: [Lod; 3] = [Lod::Full, Lod::Half, Lod::Quarter];

fn stream(header: &StreamHeader, motion: Prediction, frames: usize) -> Vec<u8> {
    let volumes: Vec<_> = (0..frames).map(|t| ball(header.grid, t as f64)).collect();
    let settings =
        EncoderSettings { motion: MotionMode::Fixed(motion), checksums: true, ..Default::default() };
    encode(header, settings, &volumes).0
}

fn decode(bytes: &[u8], lod: Lod) -> Vec<SparseVolume> {
    let mut reader = PacketReader::new(bytes).unwrap();
    let mut decoder = Decoder::with_lod(reader.header(), Limits::default(), lod).unwrap();
    let mut volumes = Vec::new();
    while let Some(packet) = reader.next_frame().unwrap() {
        let frame = decoder.decode_and_verify(&packet).unwrap();
        assert_eq!(frame.stated_hash.is_some(), lod == Lod::Full);
        volumes.push(frame.volume.clone());
    }
    volumes
}

/// Sum of the samples of a full decode within each voxel of a reduced one, and how many of them are observed: `(sum, observed)`.
/// The order is that of the reduced volume's blocks and voxels.
fn sums(full: &SparseVolume, reduced: &SparseVolume, lod: Lod) -> Vec<(i32, usize)> {
    let (n, size) = (full.grid().edge.voxels(), lod.voxels() as i32);
    let index = reduced.index();
    let mut sums = vec![(0, 0); reduced.sample_count()];
    for (block, coord) in full.coords().iter().enumerate() {
        for (voxel, sample) in full.block(block).iter().enumerate() {
            let local = [voxel % n, voxel / n % n, voxel / n / n];
            let at: [i32; 3] =
                std::array::from_fn(|a| (coord.to_array()[a] * n as i32 + local[a] as i32).div_euclid(size));
            let group = index.get(at.map(|c| c.div_euclid(n as i32)).into()).expect("a block around each");
            let [x, y, z] = at.map(|c| c.rem_euclid(n as i32) as usize);
            let entry = &mut sums[group as usize * n.pow(3) + full.grid().edge.voxel_index(x, y, z)];
            entry.0 += i32::from(*sample);
            entry.1 += usize::from(full.unobserved(block).is_none_or(|mask| !mask.contains(voxel)));
        }
    }
    sums
}

/// Root mean square difference, in reduced voxels, from the full decode averaged down, within 0.9 voxel of the surface.
fn drift(full: &SparseVolume, reduced: &SparseVolume, lod: Lod) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for (sample, (sum, observed)) in reduced.samples().zip(sums(full, reduced, lod)) {
        let mean = f64::from(sum) / (256.0 * f64::from(lod.voxels()).powi(4));
        if observed == lod.voxels().pow(3) as usize && mean.abs() < 0.9 {
            squares += (f64::from(sample) / 256.0 - mean).powi(2);
            count += 1.0;
        }
    }
    assert!(count > 100.0);
    (squares / count).sqrt()
}

#[test]
fn full_detail_is_the_plain_decoder() {
    let header = header(8, 8, 64);
    let bytes = stream(&header, Prediction::SixDof, 3);
    assert_eq!(decode(&bytes, Lod::Full), support::decode(&bytes).0);
}

#[test]
fn reduced_decodes_stay_close_to_the_full_one() {
    for (edge, motion, half, quarter) in [
        (8, Prediction::ThreeDof, 0.06, 0.12),
        (8, Prediction::SixDof, 0.07, 0.15),
        (8, Prediction::ZeroMotion, 0.06, 0.12),
        (16, Prediction::ThreeDof, 0.06, 0.12),
        // At a quarter a block of 4 is one sample, and the filter reaches beyond the neighbourhood.
        (4, Prediction::ThreeDof, 0.08, 0.4),
    ] {
        let header = header(edge, 8, if edge == 4 { 30 } else { 100 });
        let bytes = stream(&header, motion, 12);
        let full = decode(&bytes, Lod::Full);
        for (lod, bound) in [(Lod::Half, half), (Lod::Quarter, quarter)] {
            let reduced = decode(&bytes, lod);
            let drifts: Vec<f64> = full.iter().zip(&reduced).map(|(f, r)| drift(f, r, lod)).collect();
            println!("edge {edge}, {motion:?}, {lod:?}: {drifts:.3?}");
            assert!(
                drifts.iter().all(|drift| *drift < bound),
                "edge {edge}, {motion:?}, {lod:?}: {drifts:?}"
            );
        }
    }
}

#[test]
fn grids_and_masks_are_as_documented() {
    for (edge, truncation) in [(8, 8), (8, 5), (4, 2), (16, 16)] {
        let header = header(edge, truncation, 64);
        let bytes = stream(&header, Prediction::ThreeDof, 2);
        let full = decode(&bytes, Lod::Full);
        for lod in [Lod::Half, Lod::Quarter] {
            let reduced = &decode(&bytes, lod)[1];
            let (grid, size) = (reduced.grid(), lod.voxels());
            assert_eq!(grid.edge, header.grid.edge);
            assert_eq!(grid.voxel_size.metres(), 0.005 * f64::from(size));
            assert_eq!(grid.truncation.voxels(), truncation.div_ceil(size).max(2));
            let limit = (truncation * 256 / size) as i16;
            assert!(reduced.samples().all(|s| s.abs() <= limit), "clamped at the stream's truncation");
            let n = grid.edge.block_voxels();
            for (voxel, (_, observed)) in sums(&full[1], reduced, lod).into_iter().enumerate() {
                let hidden = reduced.unobserved(voxel / n).is_some_and(|mask| mask.contains(voxel % n));
                assert_eq!(hidden, 2 * observed <= size.pow(3) as usize);
            }
        }
    }
}

#[test]
fn surfaces_of_reduced_decodes_lie_on_the_full_one() {
    let header = header(8, 8, 64);
    let bytes = stream(&header, Prediction::ThreeDof, 6);
    let surface = |lod| extract_surface(&decode(&bytes, lod)[5], &SurfaceOptions::default());
    let area = surface(Lod::Full).area();
    for (lod, tolerance) in [(Lod::Half, 0.06), (Lod::Quarter, 0.12)] {
        let ratio = surface(lod).area() / area;
        assert!((ratio - 1.0).abs() < tolerance, "{lod:?}: {ratio} of the area");
    }
}

#[test]
fn threads_change_nothing() {
    let header = header(8, 8, 64);
    let bytes = stream(&header, Prediction::SixDof, 4);
    for lod in LODS {
        let with_threads = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| decode(&bytes, lod))
        };
        assert!(with_threads(1) == with_threads(3));
    }
}

#[test]
fn voxels_beyond_a_kilometre_are_refused() {
    let mut header = header(8, 8, 64);
    header.grid.voxel_size = VoxelSize::from_metres(400.0).unwrap();
    assert!(Decoder::with_lod(&header, Limits::default(), Lod::Half).is_ok());
    assert!(Decoder::with_lod(&header, Limits::default(), Lod::Quarter).is_err());
    assert_eq!([1, 2, 4].map(Lod::from_voxels), LODS.map(Some));
    assert_eq!([0, 3, 8].map(Lod::from_voxels), [None; 3]);
}

#[test]
fn profile_main_is_a_full_decode_sampled_down() {
    let bytes = stream(&main_header(8), Prediction::ThreeDof, 3);
    let full = decode(&bytes, Lod::Full);
    for lod in [Lod::Half, Lod::Quarter] {
        for (full, reduced) in full.iter().zip(decode(&bytes, lod)) {
            let drift = drift(full, &reduced, lod);
            // Half a code of rounding.
            assert!(drift < 0.002, "{lod:?}: {drift} voxels");
        }
    }
}
