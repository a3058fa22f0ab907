//! The whole program from PLY files to an `.isv` file, and back to PLY files: `cargo bench -p isv-cli`.
//!
//! A person at preset `realtime`, with one thread and with two, in turn. It is the capture `dancer` where it
//! is (`ISV_DATA`, else `../shared/data`), else the project's own figure. A frame costs the difference
//! between many frames and few. So starting the program and finding the sign of the first frame do not count.
//! Medians.

use anyhow::{Context, Result, ensure};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

const FEW: usize = 4;
const MANY: usize = 16;
const TURNS: usize = 5;

fn main() -> Result<()> {
    let scratch = tempfile::tempdir()?;
    let (name, source, voxel) = take(scratch.path())?;
    println!("{name}; {} cores\n", std::thread::available_parallelism()?);
    println!(
        "| whole program | 1 thread, ms a frame | 2 threads, ms a frame | times as fast | frames a second |\n|{}",
        "---|".repeat(5)
    );
    let stream = |frames: usize| scratch.path().join(format!("{frames}.isv"));
    let encode = |frames: usize, threads: &str| {
        let range = format!("0..{frames}");
        let stream = stream(frames);
        let output = stream.to_str().context("a path that is text")?;
        run(&[
            "encode",
            &source,
            "-o",
            output,
            "--preset",
            "realtime",
            "--voxel",
            voxel,
            "--frames",
            &range,
            "--threads",
            threads,
        ])
    };
    row("encode: PLY in, `.isv` out", encode)?;
    let decode = |frames: usize, threads: &str| {
        let (stream, meshes) = (stream(frames), scratch.path().join("meshes"));
        let [input, output] = [&stream, &meshes].map(|path| path.to_str().context("a path that is text"));
        run(&["decode", input?, "-o", output?, "--threads", threads])
    };
    row("decode: `.isv` in, PLY out", decode)
}

/// A row of the table, given how long the program takes for so many frames with so many threads.
fn row(name: &str, time: impl Fn(usize, &str) -> Result<f64>) -> Result<()> {
    let mut times = [const { Vec::new() }; 2];
    for _ in 0..TURNS {
        for (times, threads) in times.iter_mut().zip(["1", "2"]) {
            let few = time(FEW, threads)?;
            times.push((time(MANY, threads)? - few) / (MANY - FEW) as f64);
        }
    }
    let [one, two] = times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[TURNS / 2]
    });
    println!("| {name} | {one:.1} | {two:.1} | {:.2} | {:.1} |", one / two, 1e3 / two);
    Ok(())
}

/// What is coded: its name, where its frames are, and the voxel.
fn take(scratch: &Path) -> Result<(&'static str, String, &'static str)> {
    if let Some(dancer) = isv_testkit::capture("dancer") {
        return Ok(("dancer, 5 mm", dancer.to_str().context("a path that is text")?.to_owned(), "5mm"));
    }
    let voxel = isv::raw::volume::VoxelSize::from_metres(0.006)?;
    let folder = scratch.join("figure");
    std::fs::create_dir(&folder)?;
    for n in 0..MANY {
        let mesh = isv_figure::figure_mesh(n as f64 / 30.0, voxel);
        isv::raw::io::write_mesh(
            &folder.join(format!("frame_{n:04}.ply")),
            &mesh,
            isv::raw::io::Format::Ply,
        )?;
    }
    Ok(("figure, 6 mm", folder.to_str().context("a path that is text")?.to_owned(), "6mm"))
}

/// Runs the program; how long it takes, in milliseconds.
fn run(arguments: &[&str]) -> Result<f64> {
    let start = Instant::now();
    let program = Command::new(env!("CARGO_BIN_EXE_isv"))
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .output()?;
    let ms = start.elapsed().as_secs_f64() * 1e3;
    ensure!(
        program.status.success(),
        "isv {}: {}",
        arguments.join(" "),
        String::from_utf8_lossy(&program.stderr)
    );
    Ok(ms)
}
