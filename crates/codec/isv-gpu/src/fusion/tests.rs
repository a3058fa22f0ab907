//! Fusion on a GPU against fusion on the CPU.

use crate::tests::{gpu_alone, gpu_for_tests, gpu_with_segments};
use crate::{Gpu, GpuFusion};
use glam::{DVec2, DVec3};
use isv_fusion::backend::{Cpu, FusionBackend, SampledBlocks, UNKNOWN};
use isv_fusion::{Accumulator, FusionError, FusionSettings, fuse, fuse_on};
use isv_io::DepthSequence;
use isv_testkit::{Random, camera_ring, capture, look_at, render_depth, sheet, sphere};
use isv_volume::{BlockCoord, BlockEdge, DepthImage, FitError, Grid, Intrinsics, Truncation, VoxelSize};
use std::collections::BTreeSet;

const LENS: Intrinsics =
    Intrinsics { width: 160, height: 120, focal: DVec2::splat(140.0), principal: DVec2::new(79.5, 59.5) };

/// Codes by which rounding may change a sample.
const ROUNDING: i32 = 2;

fn settings(voxel_m: f64, edge: BlockEdge, truncation: u32) -> FusionSettings {
    FusionSettings::new(Grid {
        voxel_size: VoxelSize::from_metres(voxel_m).unwrap(),
        edge,
        truncation: Truncation::from_voxels(truncation).unwrap(),
    })
}

/// A ball from all sides.
fn ball() -> Vec<DepthImage> {
    let ball = sphere(0.4, 40);
    let poses = camera_ring(ball.bounds().unwrap(), &LENS);
    poses.iter().map(|pose| render_depth(&ball, &LENS, pose)).collect()
}

/// The depths of a function of column and row.
fn image(from: DVec3, to: DVec3, depth: impl Fn(f64, f64) -> f64) -> DepthImage {
    let depths = (0..LENS.pixels()).map(|i| depth((i % 160) as f64, (i / 160) as f64) as f32);
    DepthImage::new(LENS, look_at(from, to), depths.collect()).unwrap()
}

/// A wall straight before the camera.
fn wall(depth_m: f64) -> DepthImage {
    image(DVec3::ZERO, DVec3::Z, |_, _| depth_m)
}

/// How many blocks are in one of two lists alone.
fn difference(a: &[BlockCoord], b: &[BlockCoord]) -> usize {
    let set = |blocks: &[BlockCoord]| blocks.iter().map(|block| block.morton()).collect::<BTreeSet<_>>();
    set(a).symmetric_difference(&set(b)).count()
}

/// How many of some things there are, and how many are not the same.
#[derive(Debug, Default)]
struct Share {
    all: usize,
    different: usize,
}

impl Share {
    fn count(&mut self, different: bool) {
        self.all += 1;
        self.different += usize::from(different);
    }

    fn is_below(&self, bound: f64) -> bool {
        (self.different as f64) <= bound * self.all as f64
    }
}

/// Compares samples and masks of the same blocks. Where one has a voxel in another band or pixel, all of it may differ.
fn compare(ours: &SampledBlocks, cpus: &SampledBlocks) -> Share {
    assert_eq!((ours.samples.len(), ours.unobserved.len()), (cpus.samples.len(), cpus.unobserved.len()));
    let size = ours.samples.len() / ours.unobserved.len();
    let mut voxels = Share::default();
    for (voxel, (a, b)) in ours.samples.iter().zip(&cpus.samples).enumerate() {
        let [masked, truth] =
            [ours, cpus].map(|blocks| blocks.unobserved[voxel / size].contains(voxel % size));
        let near =
            a == b || ![*a, *b].contains(&UNKNOWN) && (i32::from(*a) - i32::from(*b)).abs() <= ROUNDING;
        voxels.count(masked != truth || !near);
    }
    voxels
}

/// Compares the steps of fusion on images that both backends get.
fn compare_steps(gpu: &Gpu, images: &[DepthImage], settings: &FusionSettings, what: &str) {
    let (mut ours, mut cpu) = (GpuFusion::new(gpu).unwrap(), Cpu);
    let grid = &settings.grid;
    let (views, cpu_views) = (ours.views(images, settings).unwrap(), cpu.views(images, settings).unwrap());
    for scale in [1.0, 3.7] {
        let found = ours.touched_blocks(&views, grid, scale, settings.max_blocks).unwrap().unwrap();
        let truth = cpu.touched_blocks(&cpu_views, grid, scale, settings.max_blocks).unwrap().unwrap();
        assert!(found.windows(2).all(|pair| pair[0].morton() < pair[1].morton()), "{what}: order");
        let different = difference(&found, &truth);
        println!("{what}, scale {scale}: {different} of {} blocks", truth.len());
        // A ray through a corner of a block is a matter of rounding.
        assert!(
            !truth.is_empty() && different <= 2 + truth.len() / 500,
            "{what}: {different} of {}",
            truth.len()
        );
    }
    let coords = cpu.touched_blocks(&cpu_views, grid, 1.0, settings.max_blocks).unwrap().unwrap();
    let sampled = ours.sample(&views, grid, &coords).unwrap();
    let voxels = compare(&sampled, &cpu.sample(&cpu_views, grid, &coords).unwrap());
    println!("{what}: {} of {} voxels", voxels.different, voxels.all);
    assert!(voxels.is_below(0.001), "{what}: {voxels:?}");
    assert!(sampled.samples.iter().any(|s| *s != UNKNOWN));
}

#[test]
fn blocks_and_samples_are_the_cpus() {
    let Some(gpu) = gpu_for_tests() else { return };
    let ball = ball();
    for (edge, truncation) in [(BlockEdge::E4, 4), (BlockEdge::E8, 8), (BlockEdge::E16, 16)] {
        compare_steps(&gpu, &ball, &settings(0.02, edge, truncation), &format!("ball, {edge:?}"));
    }
    // z = 2 + 0.8 x, seen under up to 70 degrees, and far from the origin.
    let far = DVec3::new(3000.3, -1000.7, 500.1);
    let slanted = image(far, far + DVec3::X, |column, _| 2.0 / (1.0 - 0.8 * (column - 79.5) / 140.0));
    compare_steps(&gpu, &[slanted], &settings(0.02, BlockEdge::E8, 8), "slanted wall");
    // A floor under grazing light, which ends where it is seen at less than 6 degrees.
    let floor = image(DVec3::ZERO, DVec3::Z, |_, row| 0.3 * 140.0 / (row - 59.0).max(0.01));
    let graze = FusionSettings { max_depth_m: 4.0, ..settings(0.02, BlockEdge::E8, 8) };
    compare_steps(&gpu, &[floor], &graze, "floor");
    // The camera is inside a block that the band reaches, and nearer to the surface than the band is wide.
    let near = image(DVec3::splat(0.01), DVec3::X, |column, _| 0.1 + column / 1000.0);
    compare_steps(&gpu, &[near], &settings(0.05, BlockEdge::E8, 8), "wall at hand");
    // Pixels that are wider than blocks.
    let wide = Intrinsics { width: 24, height: 18, principal: DVec2::new(11.5, 8.5), ..LENS };
    let wall = DepthImage::new(wide, look_at(DVec3::ZERO, DVec3::ONE), vec![1.0; 24 * 18]).unwrap();
    compare_steps(&gpu, &[wall], &settings(0.001, BlockEdge::E4, 4), "wide pixels");
}

/// Readings without rhyme or reason, of which most are alone.
#[test]
fn noise_is_fused_as_on_the_cpu() {
    let Some(gpu) = gpu_for_tests() else { return };
    let mut random = Random::new(7);
    let depth = |_| if random.signed() < -0.5 { 0.0 } else { 1.0 + 0.1 * random.signed() as f32 };
    let depths = (0..LENS.pixels()).map(depth).collect();
    let pose = look_at(random.point() * 3.0, random.point());
    let noise = DepthImage::new(LENS, pose, depths).unwrap();
    compare_steps(
        &gpu,
        &[noise],
        &FusionSettings { noise: 0.1, ..settings(0.02, BlockEdge::E8, 8) },
        "noise",
    );
}

/// A real camera's images; strips of a few rows, as segments are small.
#[test]
fn a_real_room_is_fused_as_on_the_cpu() {
    let Some(gpu) = gpu_for_tests() else { return };
    let Some(folder) = capture("room_rgbd") else { return };
    let images = DepthSequence::open(&folder).unwrap().read(20).unwrap();
    compare_steps(&gpu, &images, &settings(0.02, BlockEdge::E8, 8), "room");
}

/// Into how many parts images, blocks and tables are split changes nothing, and neither does chance.
#[test]
fn results_do_not_depend_on_the_parts() {
    let (Some(small), Some(large)) = (gpu_for_tests(), gpu_with_segments(1 << 27)) else { return };
    let (images, settings) = (ball(), settings(0.02, BlockEdge::E8, 8));
    let volumes = [&small, &small, &large]
        .map(|gpu| fuse_on(&mut GpuFusion::new(gpu).unwrap(), &images, &settings).unwrap());
    assert!(volumes[0] == volumes[1] && volumes[0] == volumes[2]);
    // And the volume is the CPU's but for a few blocks and voxels at rims.
    let truth = fuse(&images, &settings).unwrap();
    let different = difference(volumes[0].coords(), truth.coords());
    assert!(different * 200 <= truth.block_count(), "{different} of {} blocks", truth.block_count());
}

#[test]
fn accumulated_volumes_are_the_cpus() {
    let Some(gpu) = gpu_for_tests() else { return };
    let settings = settings(0.02, BlockEdge::E8, 8);
    let ours_and_cpus = |images: &[&[DepthImage]]| {
        let (mut ours, mut cpu) = (GpuFusion::new(&gpu).unwrap(), Cpu);
        let (mut sums, mut cpu_sums) = Default::default();
        for images in images {
            let cpu_views = cpu.views(images, &settings).unwrap();
            let touched = cpu.touched_blocks(&cpu_views, &settings.grid, 1.0, 100_000).unwrap().unwrap();
            cpu.accumulate(&mut cpu_sums, &cpu_views, &settings.grid, &touched).unwrap();
            let views = ours.views(images, &settings).unwrap();
            ours.accumulate(&mut sums, &views, &settings.grid, &touched).unwrap();
        }
        assert_eq!(GpuFusion::coords(&sums), Cpu::coords(&cpu_sums));
        [ours.resolve(&sums, &settings.grid).unwrap(), cpu.resolve(&cpu_sums, &settings.grid).unwrap()]
    };
    // More blocks than one part holds, found in an order that is not Morton's; and sums that forget.
    let ball = ball();
    let [later, earlier] = [&ball[..2], &ball[2..]];
    let near = [wall(0.5)];
    let frames = [vec![later, earlier, &ball], [&[&near[..]; 12][..], &[later]].concat()];
    for frames in frames {
        let [ours, cpus] = ours_and_cpus(&frames);
        let voxels = compare(&ours, &cpus);
        assert!(voxels.is_below(0.001), "{voxels:?}");
    }
    // As its users see it.
    let mut accumulator = Accumulator::with_backend(GpuFusion::new(&gpu).unwrap(), settings);
    assert_eq!(accumulator.try_volume().unwrap().block_count(), 0);
    accumulator.integrate(&ball).unwrap();
    let fused = fuse_on(&mut GpuFusion::new(&gpu).unwrap(), &ball, &settings).unwrap();
    assert!(accumulator.try_volume().unwrap() == fused);
}

#[test]
fn what_cannot_be_done_is_refused_as_on_the_cpu() {
    let Some(gpu) = gpu_for_tests() else { return };
    let mut ours = GpuFusion::new(&gpu).unwrap();
    let one = [wall(2.0)];
    let fine = FusionSettings { max_blocks: 100, ..settings(0.005, BlockEdge::E8, 8) };
    // A millionth of a metre: 10^12 rays, none of which is walked.
    let tiny = FusionSettings { max_blocks: 30_000, ..settings(1e-6, BlockEdge::E4, 8) };
    for settings in [fine, tiny] {
        let errors = [fuse_on(&mut ours, &one, &settings).unwrap_err(), fuse(&one, &settings).unwrap_err()];
        let fits = errors.map(|error| match error {
            FusionError::Fit(FitError::TooManyBlocks { blocks, voxel_that_fits_m, .. }) => {
                [blocks as f64, voxel_that_fits_m]
            }
            other => panic!("{other}"),
        });
        let same = |i: usize| (fits[0][i] / fits[1][i] - 1.0).abs() < 0.02;
        assert!(same(0) && same(1), "{fits:?}");
    }
    assert!(fuse_on(&mut ours, &one, &settings(0.04, BlockEdge::E8, 8)).is_ok());
    for (images, settings) in [(&[][..], fine), (&one, FusionSettings { max_depth_m: 1.0, ..fine })] {
        assert_eq!(fuse_on(&mut ours, images, &settings), fuse(images, &settings));
    }
    // More than a table of 1 MiB holds is not done here, but with a larger one it is.
    let many = settings(0.003, BlockEdge::E4, 8);
    let blocks = |gpu: &Gpu| {
        let mut ours = GpuFusion::new(gpu).unwrap();
        let views = ours.views(&one, &many).unwrap();
        ours.touched_blocks(&views, &many.grid, 1.0, many.max_blocks)
    };
    assert!(matches!(blocks(&gpu), Err(FusionError::Backend(_))));
    let large = gpu_with_segments(1 << 27).unwrap();
    let found = blocks(&large).unwrap().unwrap();
    let views = Cpu.views(&one, &many).unwrap();
    let truth = Cpu.touched_blocks(&views, &many.grid, 1.0, many.max_blocks).unwrap().unwrap();
    assert!(truth.len() > 1 << 16, "{} blocks fit at once", truth.len());
    assert!(found.len().abs_diff(truth.len()) * 500 < truth.len(), "{} and {}", found.len(), truth.len());
    // A row that no kernel can see.
    let wide = Intrinsics { width: 40_000, height: 1, ..LENS };
    let row = DepthImage::new(wide, look_at(DVec3::ZERO, DVec3::Z), vec![1.0; 40_000]).unwrap();
    assert!(matches!(fuse_on(&mut ours, &[row], &many), Err(FusionError::Backend(_))));
}

#[test]
fn any_depths_give_a_volume_or_an_error() {
    let Some(gpu) = gpu_for_tests() else { return };
    let (mut random, mut ours) = (Random::new(5), GpuFusion::new(&gpu).unwrap());
    for round in 0..8 {
        let spread = f64::from(round) * 5.0;
        let depths: Vec<f32> = (0..LENS.pixels())
            .map(|_| (random.signed() * spread).exp2() as f32 * random.signed() as f32)
            .collect();
        let pose = look_at(random.point() * 3.0, random.point());
        let noise = [DepthImage::new(LENS, pose, depths).unwrap()];
        let settings = FusionSettings { max_blocks: 20_000, ..settings(0.02, BlockEdge::E8, 8) };
        let [ours, cpus] = [fuse_on(&mut ours, &noise, &settings), fuse(&noise, &settings)];
        match (ours, cpus) {
            (Ok(ours), Ok(cpus)) => {
                let (a, b) = (ours.block_count(), cpus.block_count());
                assert!(a.abs_diff(b) * 50 <= b, "{a} blocks instead of {b}");
            }
            (Err(FusionError::Fit(ours)), Err(FusionError::Fit(cpus))) => {
                assert_eq!(std::mem::discriminant(&ours), std::mem::discriminant(&cpus));
            }
            (ours, cpus) => panic!("{:?} and {:?}", ours.map(|_| ()), cpus.map(|_| ())),
        }
    }
}

#[test]
fn a_lost_gpu_is_an_error() {
    let Some(gpu) = gpu_alone() else { return };
    let settings = settings(0.02, BlockEdge::E8, 8);
    let sheet = render_depth(&sheet(1.0), &LENS, &look_at(DVec3::Z * 2.0, DVec3::ZERO));
    let mut ours = GpuFusion::new(&gpu).unwrap();
    let mut accumulator = Accumulator::with_backend(GpuFusion::new(&gpu).unwrap(), settings);
    accumulator.integrate(std::slice::from_ref(&sheet)).unwrap();
    gpu.lose();
    assert!(matches!(accumulator.try_volume(), Err(FusionError::Backend(_))));
    assert!(matches!(accumulator.integrate(std::slice::from_ref(&sheet)), Err(FusionError::Backend(_))));
    assert!(matches!(fuse_on(&mut ours, &[sheet], &settings), Err(FusionError::Backend(_))));
}
