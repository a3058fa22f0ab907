//! The encoder's inner loops give the same bits with every instruction set that the machine has.

use isv_encode::probe;
use isv_kernels::simd;
use isv_testkit::{Random, volume_of};
use isv_volume::{BlockEdge, Grid, SparseVolume, Truncation, VoxelSize};
use proptest::prelude::*;

/// A rough ball somewhere near the origin.
fn rough_ball(seed: u64, roughness: f64) -> SparseVolume {
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(0.005).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    };
    let mut random = Random::new(seed);
    let (centre, waves) = (random.point() * 2.0, random.point() + 1.5);
    let distance = |[x, y, z]: [f64; 3]| {
        let [x, y, z] = [x - centre.x, y - centre.y, z - centre.z];
        let lumps = (waves.x * x).sin() + (waves.y * y).sin() * (waves.z * z).cos();
        (x * x + y * y + z * z).sqrt() - 9.0 - roughness * lumps
    };
    volume_of(grid, 3, distance, |_| false)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn pursuit(seed: u64, roughness in 0.0..1.5) {
        let [before, volume] = [seed, seed ^ 1].map(|seed| rough_ball(seed, roughness));
        let results = simd::with_each(|| probe::pursuit(&before, &volume, &mut |work| work()));
        prop_assert!(results[0].1.as_flattened().iter().any(|level| *level != 0));
        for (instructions, levels) in &results {
            prop_assert!(*levels == results[0].1, "{instructions}");
        }
    }

    #[test]
    fn normal_equations(seed: u64, roughness in 0.0..1.5) {
        let [before, volume] = [seed, seed ^ 1].map(|seed| rough_ball(seed, roughness));
        let results = simd::with_each(|| probe::normal_equations(&before, &volume, &mut |work| work()));
        prop_assert!(!results[0].1.is_empty());
        for (instructions, equations) in &results {
            prop_assert!(*equations == results[0].1, "{instructions}");
        }
    }
}
