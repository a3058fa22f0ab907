//! Profile `main`: what the encoder reconstructs is what the decoder decodes, for every setting and number of threads.

mod support;

use isv_decode::volume_hash;
use isv_encode::{Band, Encoder, EncoderSettings, FrameQuality, MainSettings, Refresh};
use isv_format::MaskCoding::{Cells, Voxels};
use isv_format::Prediction;
use isv_surface::{SurfaceOptions, extract_surface};
use isv_testkit::{still_and_moving_ball, volume_of};
use isv_volume::{SparseVolume, VoxelMask};
use std::collections::BTreeMap;
use support::{ball, decode, encode, main_header};

fn settings(main: MainSettings, slices: u16) -> EncoderSettings {
    EncoderSettings { gop: 4, checksums: true, slices: Some(slices), main, ..Default::default() }
}

fn balls(truncation: u32, frames: u32) -> Vec<SparseVolume> {
    (0..frames).map(|t| ball(main_header(truncation).grid, f64::from(t))).collect()
}

/// Settings that differ in every tool.
fn variants() -> [MainSettings; 4] {
    let usual = MainSettings::default();
    [
        usual,
        MainSettings { half_voxel_vectors: false, filter: (0, 0), trials: 1, ..usual },
        MainSettings { filter: (25, 255), quality: FrameQuality::of_step(0.3), ..usual },
        MainSettings { band: Band::Full, ..usual },
    ]
}

#[test]
fn decoder_agrees_with_the_encoders_reconstruction() {
    for (truncation, slices) in [(8, 1), (2, 3), (16, 7)] {
        let volumes = balls(truncation, 6);
        for (main, masks) in variants().into_iter().flat_map(|main| [(main, Voxels), (main, Cells)]) {
            let header = main_header(truncation).with_mask_coding(masks);
            let (bytes, hashes) = encode(&header, settings(main, slices), &volumes);
            let (decoded, end) = decode(&bytes);
            end.unwrap();
            let found: Vec<u64> = decoded.iter().map(volume_hash).collect();
            assert_eq!(found, hashes, "truncation {truncation}, {slices} slices, {main:?}, {masks:?}");
        }
    }
}

/// A ball with a hole that stays beside one that moves, in both bands and with gradual refresh.
#[test]
fn masks_by_cell_draw_the_same_surface_with_fewer_bytes() {
    let usual = MainSettings::default();
    let whole = MainSettings { band: Band::Full, ..usual };
    let gradual = MainSettings { refresh: Refresh::Gradual, ..usual };
    for main in [usual, whole, gradual] {
        let coded = |masks| {
            let header = main_header(8).with_mask_coding(masks);
            let volumes = [0.0, 1.0, 2.0, 2.0, 4.0].map(|t| still_and_moving_ball(header.grid, t));
            let (bytes, hashes) = encode(&header, EncoderSettings { gop: 5, ..settings(main, 2) }, &volumes);
            let (decoded, end) = decode(&bytes);
            end.unwrap();
            assert_eq!(decoded.iter().map(volume_hash).collect::<Vec<_>>(), hashes, "{masks:?}, {main:?}");
            (bytes.len(), decoded)
        };
        let [(voxel_bytes, by_voxel), (cell_bytes, by_cell)] = [Voxels, Cells].map(coded);
        println!("{voxel_bytes} bytes by voxel, {cell_bytes} by cell");
        assert!(cell_bytes < voxel_bytes);
        for (by_voxel, by_cell) in by_voxel.iter().zip(&by_cell) {
            let [voxels, cells] = [by_voxel, by_cell].map(masked);
            assert!(0 < voxels && voxels <= cells, "{voxels} and {cells} voxels");
            let meshes =
                [by_voxel, by_cell].map(|volume| extract_surface(volume, &SurfaceOptions { normals: false }));
            assert!(meshes[0] == meshes[1], "surfaces differ");
        }
    }
}

/// A ball that stays beside one that moves, stops and goes on: what stays costs nothing.
#[test]
fn what_stands_still_is_kept() {
    for (truncation, band, masks) in
        [(8, Band::Surface, Voxels), (8, Band::Surface, Cells), (4, Band::Full, Cells)]
    {
        let header = main_header(truncation).with_mask_coding(masks);
        let volumes = [0.0, 1.0, 2.0, 2.0, 2.0, 4.0].map(|t| still_and_moving_ball(header.grid, t));
        let main = MainSettings { band, ..Default::default() };
        let settings = EncoderSettings { gop: 6, ..settings(main, 2) };
        let mut encoder = Encoder::new(&header, settings);
        let frames: Vec<_> = volumes.iter().map(|volume| encoder.encode(volume)).collect();
        let blocks: Vec<u32> = frames.iter().map(|frame| frame.payload().header.blocks).collect();
        println!("blocks coded: {blocks:?}");
        assert!(blocks[1..].iter().all(|coded| 10 * coded < 6 * blocks[0]), "about half of them stay");
        // What stopped is coded no more.
        assert_eq!(blocks[3..5], [0, 0]);
        let bytes = frames[4].payload().to_bytes().len();
        assert!(bytes < 100, "{bytes} bytes of no change");
        let (bytes, hashes) = encode(&header, settings, &volumes);
        let (decoded, end) = decode(&bytes);
        end.unwrap();
        assert_eq!(decoded.iter().map(volume_hash).collect::<Vec<_>>(), hashes);
        // Nothing changed in the fourth frame and the fifth: all is the memory of the third.
        for frame in [3, 4] {
            let shared = |block: usize| decoded[frame].shares_block(block, &decoded[frame - 1], block);
            assert_eq!(decoded[frame].coords(), decoded[frame - 1].coords());
            assert!((0..decoded[frame].block_count()).all(shared), "frame {frame}");
        }
        for (decoded, source) in decoded.iter().zip(&volumes) {
            let near = near_error(source, decoded);
            assert!(near < 0.3, "{near}");
        }
    }
}

/// Without skip cells every block is coded again, for about the same error.
#[test]
fn still_cells_save_bytes() {
    let header = main_header(8);
    let volumes: Vec<_> = (0..6).map(|t| still_and_moving_ball(header.grid, f64::from(t))).collect();
    let bytes_and_error = |tools: &str| {
        let main = MainSettings { tools: tools.parse().unwrap(), ..Default::default() };
        let bytes = encode(&header, EncoderSettings { gop: 6, ..settings(main, 1) }, &volumes).0;
        let decoded = decode(&bytes).0;
        let errors = volumes.iter().zip(&decoded).map(|(source, decoded)| near_error(source, decoded));
        (bytes.len(), errors.sum::<f64>() / 6.0)
    };
    let [(bytes, error), (all_bytes, all_error)] = ["", "still"].map(bytes_and_error);
    println!("{bytes} bytes, error {error}; {all_bytes} bytes, error {all_error} without");
    assert!(bytes < all_bytes && error < 1.1 * all_error);
}

/// Voxels that a volume's masks cover.
fn masked(volume: &SparseVolume) -> usize {
    volume.unobserved_masks().values().map(VoxelMask::count).sum()
}

#[test]
fn masks_reach_the_decoder_and_cover_only_what_was_unobserved() {
    let volumes = balls(8, 4);
    let main = MainSettings { band: Band::Full, ..Default::default() };
    let (bytes, _) = encode(&main_header(8), settings(main, 2), &volumes);
    for (source, decoded) in volumes.iter().zip(&decode(&bytes).0) {
        assert!(masked(decoded) > 0 && masked(decoded) < masked(source));
        let index = decoded.index();
        for (block, coord) in source.coords().iter().enumerate() {
            let found = index.get(*coord).expect("every block of the band is coded");
            let Some(mask) = decoded.unobserved(found as usize) else { continue };
            let wanted = source.unobserved(block).expect("nothing else is masked");
            assert!((0..512).all(|voxel| !mask.contains(voxel) || wanted.contains(voxel)));
        }
    }
}

/// Faces on voxel centres, at the first and at the last plane of blocks. What lies beyond is not crossed, and its side must not be
/// left to the rounding of samples that are 0.
#[test]
fn flat_faces_on_voxel_centres_have_no_holes() {
    let header = main_header(8);
    for (low, high) in [(-15.5, 15.5), (-16.5, 16.5), (-15.45, 15.55), (-16.0, 16.0)] {
        let centre = 0.5 * (low + high);
        let half = 0.5 * (high - low);
        // The distance to the surface of a cube is that to its nearest face, inside and near the faces.
        let distance =
            |p: [f64; 3]| p.map(|c| (c - centre).abs() - half).into_iter().fold(f64::MIN, f64::max);
        let cube = volume_of(header.grid, 4, distance, |_| false);
        for quality in [0.0, 50.0, 100.0] {
            let quality = FrameQuality::of_quality(quality);
            let mut encoder =
                Encoder::new(&header, settings(MainSettings { quality, ..Default::default() }, 1));
            encoder.encode(&cube);
            let mesh = extract_surface(encoder.reconstruction().unwrap(), &SurfaceOptions { normals: false });
            let mut edges = BTreeMap::new();
            for [a, b, c] in &mesh.triangles {
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    *edges.entry((from.min(to), from.max(to))).or_insert(0) += 1;
                }
            }
            let open = edges.values().filter(|faces| **faces != 2).count();
            assert!(!mesh.triangles.is_empty() && open == 0, "{low} to {high}: {open} open edges");
        }
    }
}

#[test]
fn finer_steps_come_closer_to_the_surface() {
    let volumes = balls(8, 3);
    let error = |(step, filter)| {
        let main = MainSettings { quality: FrameQuality::of_step(step), filter, ..Default::default() };
        let (bytes, _) = encode(&main_header(8), settings(main, 1), &volumes);
        let decoded = decode(&bytes).0;
        let errors = volumes.iter().zip(&decoded).map(|(source, decoded)| near_error(source, decoded));
        (errors.fold(0.0, f64::max), bytes.len())
    };
    // The finer the step, the less there is to filter.
    let [coarse, fine] = [(2.2, (13, 38)), (0.8, (0, 0))].map(error);
    println!("root mean square in voxels and bytes: {coarse:?}, {fine:?}");
    assert!(fine.0 < 0.7 * coarse.0 && coarse.0 < 0.3, "{coarse:?}, {fine:?}");
    assert!(fine.1 > coarse.1);
}

/// Root mean square difference in voxels of observed samples before a change of sign along x.
fn near_error(source: &SparseVolume, decoded: &SparseVolume) -> f64 {
    let index = decoded.index();
    let (mut squares, mut count) = (0.0, 0.0);
    for (block, coord) in source.coords().iter().enumerate() {
        let Some(found) = index.get(*coord) else { continue };
        for (voxel, sample) in source.block(block).iter().enumerate() {
            let crossed = voxel % 8 < 7 && (*sample < 0) != (source.block(block)[voxel + 1] < 0);
            let observed = |voxel| source.unobserved(block).is_none_or(|mask| !mask.contains(voxel));
            if crossed && observed(voxel) && observed(voxel + 1) {
                let difference = f64::from(sample - decoded.block(found as usize)[voxel]) / 256.0;
                squares += difference * difference;
                count += 1.0;
            }
        }
    }
    assert!(count > 300.0);
    f64::sqrt(squares / count)
}

#[test]
fn frames_after_the_first_take_fewer_bytes() {
    let mut encoder = Encoder::new(&main_header(8), settings(MainSettings::default(), 1));
    let sizes: Vec<_> = balls(8, 4)
        .iter()
        .map(|volume| {
            let frame = encoder.encode(volume);
            (frame.prediction(), frame.payload().to_bytes().len())
        })
        .collect();
    println!("{sizes:?}");
    assert_eq!(sizes[0].0, Prediction::None);
    assert!(sizes[1..].iter().all(|(prediction, _)| *prediction == Prediction::ThreeDof));
    assert!(sizes[1..].iter().all(|(_, bytes)| *bytes < sizes[0].1));
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let volumes = balls(8, 3);
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let bytes = encode(&main_header(8), settings(MainSettings::default(), 3), &volumes).0;
            let (decoded, end) = decode(&bytes);
            end.unwrap();
            (bytes, decoded)
        })
    };
    let one = with_threads(1);
    for threads in [2, 5] {
        assert!(one == with_threads(threads), "{threads} threads");
    }
}

#[test]
fn empty_frames_and_jumps_are_coded() {
    let header = main_header(8);
    let empty = SparseVolume::empty(header.grid);
    let [near, far] = [0.0, 40.0].map(|t| ball(header.grid, t));
    let volumes = [empty.clone(), near.clone(), empty.clone(), far.clone(), near];
    let (bytes, hashes) =
        encode(&header, EncoderSettings { gop: 9, ..settings(MainSettings::default(), 2) }, &volumes);
    let (decoded, end) = decode(&bytes);
    end.unwrap();
    assert_eq!(decoded.iter().map(volume_hash).collect::<Vec<_>>(), hashes);
    let blocks: Vec<_> = decoded.iter().map(SparseVolume::block_count).collect();
    assert!(blocks[0] == 0 && blocks[2] == 0 && blocks[1] > 0 && blocks[4] > 0, "{blocks:?}");
}
