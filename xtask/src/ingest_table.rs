//! What ingest costs: time a frame, and a block, which stays the same where cost grows with the area of the surface.

use anyhow::{Context, Result};
use isv::raw::ingest::{MeshIngest, Reach, SignMode, decide_sign, ingest_mesh};
use isv::raw::io::{FrameSequence, Unit, read_mesh};
use isv::raw::volume::{BlockEdge, Grid, TriangleMesh, Truncation, VoxelSize};
use std::time::Instant;

/// Rounds over all frames; the fastest of each frame counts, as other work on the machine only ever adds.
const RUNS: usize = 5;

/// Frames of a sequence that are measured.
const FRAMES: usize = 16;

/// Sequences, voxel sizes in metres, and how they are ingested.
const ROWS: [(&str, f64, SignMode, Reach); 9] = [
    ("dancer", 0.02, SignMode::Paper, Reach::Band),
    ("dancer", 0.01, SignMode::Paper, Reach::Band),
    ("dancer", 0.005, SignMode::Paper, Reach::Band),
    ("monastery", 0.04, SignMode::Paper, Reach::Band),
    ("monastery", 0.02, SignMode::Paper, Reach::Band),
    ("monastery", 0.01, SignMode::Paper, Reach::Band),
    ("liam", 0.005, SignMode::Auto, Reach::Surface),
    ("flag", 0.005, SignMode::Auto, Reach::Surface),
    ("flag", 0.005, SignMode::Offset, Reach::Surface),
];

/// Measures the wanted sequences of a folder, or all if none is named, and prints a table.
pub(crate) fn run(data: &str, wanted: &[String]) -> Result<()> {
    println!("{} threads\n", std::thread::available_parallelism()?);
    println!(
        "| sequence | sign | reach | voxel, mm | triangles | blocks | wall, ms a frame | CPU, ms a frame | CPU, us a block |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let is_wanted = |name: &str| wanted.is_empty() || wanted.iter().any(|wanted| wanted == name);
    for (sequence, voxel_m, sign, reach) in ROWS.into_iter().filter(|row| is_wanted(row.0)) {
        let folder = format!("{}/{sequence}", data.trim_end_matches('/'));
        let paths = FrameSequence::open(&folder)?;
        let meshes: Vec<TriangleMesh> = paths
            .paths()
            .iter()
            .take(FRAMES)
            .map(|path| read_mesh(path, Unit::Metre))
            .collect::<Result<_, _>>()?;
        let voxel_size = VoxelSize::from_metres(voxel_m).context("a voxel size in range")?;
        let grid = Grid { voxel_size, edge: BlockEdge::E8, truncation: Truncation::DEFAULT };
        print_row(sequence, &MeshIngest { sign, reach, ..MeshIngest::new(grid) }, &meshes)?;
    }
    Ok(())
}

fn print_row(sequence: &str, settings: &MeshIngest, meshes: &[TriangleMesh]) -> Result<()> {
    let sign = decide_sign(meshes.first().context("a sequence without frames")?, settings.sign).0;
    let (mut wall, mut cpu, mut blocks, mut triangles) = (0.0, 0.0, 0, 0);
    for mesh in meshes {
        let (mut best_wall, mut best_cpu) = (f64::INFINITY, f64::INFINITY);
        for run in 0..RUNS {
            let (start, before) = (Instant::now(), cpu_ms());
            let volume = std::hint::black_box(ingest_mesh(mesh, settings, sign)?);
            best_wall = best_wall.min(start.elapsed().as_secs_f64() * 1e3);
            best_cpu = best_cpu.min(cpu_ms().zip(before).map_or(f64::NAN, |(after, before)| after - before));
            blocks += if run == 0 { volume.block_count() } else { 0 };
        }
        (wall, cpu, triangles) = (wall + best_wall, cpu + best_cpu, triangles + mesh.triangles.len());
    }
    let frames = meshes.len() as f64;
    println!(
        "| {sequence} | {sign:?} | {:?} | {:.0} | {:.0} | {:.0} | {:.0} | {:.0} | {:.1} |",
        settings.reach,
        settings.grid.voxel_size.metres() * 1e3,
        triangles as f64 / frames,
        blocks as f64 / frames,
        wall / frames,
        cpu / frames,
        cpu * 1e3 / blocks as f64,
    );
    Ok(())
}

/// Time that all threads of this process have run for so far, where the system says so (Linux).
fn cpu_ms() -> Option<f64> {
    let tasks = std::fs::read_dir("/proc/self/task").ok()?;
    let nanoseconds = |task: std::io::Result<std::fs::DirEntry>| -> Option<f64> {
        let stat = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        stat.split_whitespace().next()?.parse().ok()
    };
    let sum: f64 = tasks.map(nanoseconds).sum::<Option<f64>>()?;
    Some(sum * 1e-6)
}
