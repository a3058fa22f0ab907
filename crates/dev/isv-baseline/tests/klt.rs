//! Learned transforms on volumes of known shapes.

use isv_baseline::{BlockBasis, BlockMoments, TrainingError};
use isv_testkit::ball;
use isv_volume::{BlockEdge, Grid, SparseVolume, Truncation, VoxelSize};

fn grid(edge: BlockEdge) -> Grid {
    Grid { voxel_size: VoxelSize::from_metres(0.005).unwrap(), edge, truncation: Truncation::DEFAULT }
}

fn volumes(edge: BlockEdge) -> [SparseVolume; 3] {
    [0.0, 3.0, 7.0].map(|t| ball(grid(edge), t))
}

fn moments(volumes: &[SparseVolume]) -> BlockMoments {
    let mut moments = BlockMoments::new(volumes[0].grid()).unwrap();
    volumes.iter().for_each(|volume| moments.add(volume));
    moments
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// All coefficients of all blocks of a volume, in double precision.
fn spectra(basis: &BlockBasis, volume: &SparseVolume) -> Vec<Vec<f64>> {
    let centred = |block: usize| -> Vec<f64> {
        volume.block(block).iter().zip(basis.mean()).map(|(s, m)| f64::from(*s) - m).collect()
    };
    let voxels = volume.grid().edge.block_voxels();
    (0..volume.block_count())
        .map(|block| (0..voxels).map(|k| dot(basis.row(k), &centred(block))).collect())
        .collect()
}

#[test]
fn bases_are_orthonormal() {
    for edge in [BlockEdge::E4, BlockEdge::E8] {
        for basis in [BlockBasis::dct(edge), moments(&volumes(edge)).klt().unwrap()] {
            for i in 0..edge.block_voxels() {
                for j in 0..=i {
                    let product = dot(basis.row(i), basis.row(j));
                    let expected = if i == j { 1.0 } else { 0.0 };
                    assert!((product - expected).abs() < 1e-9, "rows {i} and {j}: {product}");
                }
            }
        }
    }
}

#[test]
fn the_klt_decorrelates_what_it_was_trained_on() {
    let volumes = volumes(BlockEdge::E4);
    let basis = moments(&volumes).klt().unwrap();
    let spectra: Vec<Vec<f64>> = volumes.iter().flat_map(|v| spectra(&basis, v)).collect();
    let covariance =
        |i: usize, j: usize| spectra.iter().map(|s| s[i] * s[j]).sum::<f64>() / spectra.len() as f64;
    let variances: Vec<f64> = (0..64).map(|k| covariance(k, k)).collect();
    assert!(variances.windows(2).all(|w| w[0] >= w[1] - 1e-6), "largest first: {variances:?}");
    for i in 0..64 {
        let mean = spectra.iter().map(|s| s[i]).sum::<f64>() / spectra.len() as f64;
        assert!(mean.abs() < 1e-6, "coefficient {i} is {mean} on average");
        for j in 0..i {
            assert!(covariance(i, j).abs() < 1e-9 * variances[0], "coefficients {i} and {j}");
        }
    }
}

#[test]
fn no_transform_compacts_the_training_blocks_better() {
    for edge in [BlockEdge::E4, BlockEdge::E8] {
        let volumes = volumes(edge);
        let moments = moments(&volumes);
        let learned = moments.energy_shares(&moments.klt().unwrap()).unwrap();
        let fixed = moments.energy_shares(&BlockBasis::dct(edge)).unwrap();
        assert_eq!(learned.len(), edge.block_voxels() + 1);
        for (k, (l, f)) in learned.iter().zip(&fixed).enumerate() {
            assert!(*l >= f - 1e-9, "{l} below {f} at {k}");
        }
        assert!(learned[8] > fixed[8] + 1e-4, "and better where few are kept");
        assert!(learned.windows(2).chain(fixed.windows(2)).all(|w| w[1] >= w[0] - 1e-12));
        for shares in [learned, fixed] {
            assert!((shares.last().unwrap() - 1.0).abs() < 1e-9);
        }
    }
}

#[test]
fn energy_shares_are_the_errors_of_reconstructions() {
    let volumes = volumes(BlockEdge::E4);
    let trained = moments(&volumes[..1]).klt().unwrap();
    let test = &volumes[2];
    let moments = moments(std::slice::from_ref(test));
    let own_mean = moments.klt().unwrap().mean().to_vec();
    let centred = test.samples().enumerate().map(|(i, s)| f64::from(s) - own_mean[i % 64]);
    let energy: f64 = centred.map(|s| s * s).sum();
    for basis in [trained, BlockBasis::dct(BlockEdge::E4)] {
        let shares = moments.energy_shares(&basis).unwrap();
        for k in [1, 4, 20] {
            let error: f64 = spectra(&basis, test).iter().flat_map(|s| &s[k..]).map(|c| c * c).sum();
            assert!((shares[k] - (1.0 - error / energy)).abs() < 1e-9, "{k}: {}", shares[k]);
            let truncated = basis.truncate(test, k);
            let pairs = test.samples().zip(truncated.samples());
            let error: f64 = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum();
            let share = 1.0 - error / energy;
            assert!(share >= shares[k] - 1e-4, "clamped, so no worse: {share} for {}", shares[k]);
        }
    }
}

#[test]
fn all_coefficients_give_the_samples_back() {
    for edge in [BlockEdge::E4, BlockEdge::E8] {
        let volumes = volumes(edge);
        for basis in [BlockBasis::dct(edge), moments(&volumes[..1]).klt().unwrap()] {
            assert_eq!(basis.truncate(&volumes[1], edge.block_voxels()), volumes[1]);
        }
    }
}

#[test]
fn moments_depend_on_the_blocks_alone() {
    let volumes = volumes(BlockEdge::E8);
    let all = moments(&volumes);
    let mut merged = moments(&volumes[2..]);
    merged.merge(&moments(&volumes[..2]));
    assert_eq!(merged, all);
    for threads in [1, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (moments, basis) = pool.install(|| {
            let moments = moments(&volumes);
            let basis = moments.klt().unwrap();
            (moments, basis)
        });
        assert_eq!(moments, all);
        assert_eq!(basis, all.klt().unwrap());
    }
}

#[test]
fn what_cannot_be_learned_is_refused() {
    let nothing = BlockMoments::new(&grid(BlockEdge::E8)).unwrap();
    assert_eq!(nothing.klt(), Err(TrainingError::NoBlocks));
    assert_eq!(nothing.energy_shares(&BlockBasis::dct(BlockEdge::E8)), Err(TrainingError::NoBlocks));
    assert_eq!(BlockMoments::new(&grid(BlockEdge::E16)), Err(TrainingError::BlockTooLarge));
}
