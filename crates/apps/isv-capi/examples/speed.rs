//! Time that a C program takes to play a stream, against this library's own, one after the other:
//! `cargo run --release -p isv-capi --example speed -- TAKE.isv PLAY`
//!
//! PLAY is `play.c`, compiled and linked with the C library. Both decode all frames into vertex and index buffers, in rounds by turns.

use isv::{Mesh, Reader};
use std::error::Error;
use std::process::Command;
use std::time::Instant;

const TURNS: usize = 10;
const ROUNDS: usize = 3;

/// 28 bytes, as in `play.c`.
#[derive(Clone, Copy)]
#[repr(C)]
struct Vertex {
    position: [f32; 3],
    normal: [f32; 3],
    colour: [u8; 4],
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let stream = arguments.next().ok_or("name a stream")?;
    let program = arguments.next().ok_or("name the program that play.c became")?;
    let (mut library, mut c) = (Vec::new(), Vec::new());
    for _ in 0..TURNS {
        library.extend(play(&stream)?);
        let output = Command::new(&program).args([&stream, &ROUNDS.to_string()]).output()?;
        if !output.status.success() {
            return Err(String::from_utf8_lossy(&output.stderr).into());
        }
        for line in String::from_utf8(output.stdout)?.lines() {
            c.push(line.parse::<f64>()?);
        }
    }
    // Other work on the machine only ever adds time: the fastest round has least of it.
    for (name, of) in [("fastest", fastest as fn(&mut [f64]) -> f64), ("median", median)] {
        let (library, c) = (of(&mut library), of(&mut c));
        let more = (c / library - 1.0) * 100.0;
        println!(
            "{name} of {} rounds: library {:.1} ms, C {:.1} ms, {more:+.1} %",
            TURNS * ROUNDS,
            library * 1e3,
            c * 1e3
        );
    }
    Ok(())
}

/// Times of all rounds (s).
fn play(stream: &str) -> Result<Vec<f64>, Box<dyn Error>> {
    let mut reader = Reader::open(stream)?;
    let (mut vertices, mut indices) = (Vec::new(), Vec::new());
    let mut round = || {
        let start = Instant::now();
        reader.seek(0)?;
        while let Some(frame) = reader.next_frame()? {
            upload(&frame.mesh()?, &mut vertices, &mut indices);
        }
        Ok(start.elapsed().as_secs_f64())
    };
    (0..ROUNDS).map(|_| round()).collect()
}

fn upload(mesh: &Mesh, vertices: &mut Vec<Vertex>, indices: &mut Vec<u32>) {
    vertices.clear();
    let places = mesh.positions.iter().zip(&mesh.normals).enumerate();
    vertices.extend(places.map(|(v, (position, normal))| {
        let [red, green, blue] = mesh.colours.get(v).copied().unwrap_or([255; 3]);
        Vertex { position: *position, normal: *normal, colour: [red, green, blue, 255] }
    }));
    indices.clear();
    indices.extend_from_slice(mesh.triangles.as_flattened());
    std::hint::black_box((&vertices, &indices));
}

fn fastest(times: &mut [f64]) -> f64 {
    times.iter().copied().fold(f64::INFINITY, f64::min)
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
