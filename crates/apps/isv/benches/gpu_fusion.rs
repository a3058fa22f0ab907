//! What fusing depth images takes for each frame: `cargo bench -p isv --features gpu --bench gpu_fusion`.
//!
//! On the CPU and on the best GPU that there is, be it one in software, or the one whose name has `ISV_GPU` in it. Captures are where
//! `ISV_DATA` says, else in `../shared/data`: a person seen by eight cameras, and a room by one. What the steps do not add up to is
//! finishing, on the CPU for both. The first frame is not counted.

use anyhow::{Context, Result};
use isv::raw::fusion::backend::{Cpu, FusionBackend};
use isv::raw::fusion::{FusionSettings, fuse_on};
use isv::raw::gpu::{Gpu, GpuChoice, GpuFusion};
use isv::raw::io::{DepthSequence, FrameSequence, Unit, read_mesh};
use isv::raw::volume::{BlockEdge, DepthImage, Grid, Intrinsics, Truncation, VoxelSize};
use isv_testkit::{camera_ring, capture, render_depth};
use std::path::Path;
use std::time::Instant;

/// Frames of a take, the first of which is not counted.
const FRAMES: usize = 6;
/// A common depth camera: 640 x 576 pixels, 65 by 60 degrees.
const FOCAL: f64 = 504.0;

/// What is timed.
const STEPS: [&str; 4] = ["planes", "blocks", "samples", "all, volume finished"];

fn main() -> Result<()> {
    let name = std::env::var("ISV_GPU").ok();
    let gpu = match Gpu::open(&GpuChoice { name, software: true, ..GpuChoice::default() }) {
        Ok(gpu) => gpu,
        Err(error) => {
            println!("skipped: {error}");
            return Ok(());
        }
    };
    println!("{} ({}, {})", gpu.report().name, gpu.report().kind, gpu.report().driver);
    if let Some(dancer) = capture("dancer") {
        let paths = FrameSequence::open(&dancer)?;
        let frames = paths.paths().iter().take(FRAMES).map(|path| eight_cameras(path));
        measure("dancer, 8 cameras", 0.005, &frames.collect::<Result<Vec<_>>>()?, &gpu)?;
    }
    if let Some(room) = capture("room_rgbd") {
        let sequence = DepthSequence::open(&room)?;
        let frames = (0..FRAMES).map(|frame| Ok(sequence.read(frame)?));
        measure("room_rgbd, 1 camera", 0.01, &frames.collect::<Result<Vec<_>>>()?, &gpu)?;
    }
    Ok(())
}

/// A mesh from all sides.
fn eight_cameras(path: &Path) -> Result<Vec<DepthImage>> {
    let lens = Intrinsics {
        width: 640,
        height: 576,
        focal: glam::DVec2::splat(FOCAL),
        principal: glam::DVec2::new(319.5, 287.5),
    };
    let mesh = read_mesh(path, Unit::Metre)?;
    let poses = camera_ring(mesh.bounds().context("a mesh has vertices")?, &lens);
    Ok(poses.iter().map(|pose| render_depth(&mesh, &lens, pose)).collect())
}

/// Measures a take on both.
fn measure(name: &str, voxel_m: f64, frames: &[Vec<DepthImage>], gpu: &Gpu) -> Result<()> {
    let settings = FusionSettings::new(Grid {
        voxel_size: VoxelSize::from_metres(voxel_m)?,
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    });
    let cpu = steps(&mut Cpu, frames, &settings, || Ok(()))?;
    let mut fusion = GpuFusion::new(gpu)?;
    let on_gpu = steps(&mut fusion, frames, &settings, || Ok(gpu.wait()?))?;
    println!("\n## {name}, {} mm\n\n| ms a frame | CPU | GPU |\n|---|---|---|", voxel_m * 1e3);
    for (step, (cpu, gpu)) in STEPS.iter().zip(cpu.iter().zip(on_gpu)) {
        println!("| {step} | {cpu:.2} | {gpu:.2} |");
    }
    gpu.start_timing();
    fuse_on(&mut fusion, &frames[0], &settings)?;
    println!("\n| kernel | ms of the first frame | dispatches |\n|---|---|---|");
    for (kernel, time) in gpu.take_times() {
        println!("| {kernel} | {:.3} | {} |", time.nanoseconds / 1e6, time.dispatches);
    }
    println!("\nmost memory of the GPU: {} MB", gpu.memory().peak.div_ceil(1_000_000));
    Ok(())
}

/// Medians of the steps.
fn steps<B: FusionBackend>(
    backend: &mut B,
    frames: &[Vec<DepthImage>],
    settings: &FusionSettings,
    wait: impl Fn() -> Result<()>,
) -> Result<[f64; 4]> {
    let (grid, mut times) = (&settings.grid, [const { Vec::new() }; 4]);
    for images in frames {
        let start = Instant::now();
        let views = backend.views(images, settings)?;
        wait()?;
        let planes = start.elapsed();
        let coords = backend.touched_blocks(&views, grid, 1.0, settings.max_blocks)?;
        let coords = coords.context("no more blocks than allowed")?;
        let blocks = start.elapsed();
        drop(backend.sample(&views, grid, &coords)?);
        let samples = start.elapsed();
        let start = Instant::now();
        fuse_on(backend, images, settings)?;
        let all = start.elapsed();
        for (times, time) in times.iter_mut().zip([planes, blocks - planes, samples - blocks, all]) {
            times.push(time.as_secs_f64() * 1e3);
        }
    }
    Ok(times.map(|mut times| {
        times.remove(0);
        times.sort_unstable_by(f64::total_cmp);
        times[times.len() / 2]
    }))
}
