//! Delay of a live stream on one machine: `cargo bench -p isv-cli --bench live_delay -- [FPS]...`.
//!
//! Captured frames, PLY files in memory, go to `isv encode -` at their frame rate. What it writes goes to `isv serve --live -`, and from
//! there over a WebSocket to a viewer that decodes each frame and extracts its surface. Delay begins where a frame is captured: where its
//! first byte is due to be written. The capture `dancer` at 5 mm where it is (`ISV_DATA`, else `../shared/data`), else the project's own
//! figure. Preset `realtime`. The first second does not count.

use anyhow::{Context, Result, ensure};
use futures_util::StreamExt;
use isv_serve::message;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::SocketAddr;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Length of a measurement.
const SECONDS: f64 = 8.0;
/// What is left out at its beginning.
const WARM_UP_S: f64 = 1.0;

fn main() -> Result<()> {
    // Cargo adds a flag of its own.
    let given = std::env::args().skip(1).filter(|text| !text.starts_with("--"));
    let mut rates = given.map(|text| text.parse().context(text)).collect::<Result<Vec<f64>>>()?;
    if rates.is_empty() {
        rates = vec![10.0, 15.0, 30.0];
    }
    let (name, frames, voxel) = take()?;
    println!("{name}, preset realtime; {} cores\n", thread::available_parallelism()?);
    println!(
        "| frames a second | captured to sent, ms | captured to surface, ms | 95 % | most | frames lost |\n|{}",
        "---|".repeat(6)
    );
    rates.iter().try_for_each(|rate| row(&frames, voxel, *rate))
}

/// A row of the table, at a frame rate.
fn row(frames: &[Vec<u8>], voxel: &str, fps: f64) -> Result<()> {
    let rate = fps.to_string();
    let mut encoder =
        program(&["encode", "-", "-o", "-", "--preset", "realtime", "--voxel", voxel, "--fps", &rate])
            .stdin(Stdio::piped())
            .spawn()?;
    let packets = encoder.stdout.take().context("its output")?;
    let mut server = program(&["serve", "--live", "-", "--bind", "127.0.0.1:0"]).stdin(packets).spawn()?;
    let measured = measure(&mut encoder, &mut server, frames, fps);
    for process in [&mut encoder, &mut server] {
        // They have ended, unless something went wrong.
        let _ = process.kill();
        process.wait()?;
    }
    let Measured { mut sent_ms, mut shown_ms, lost } = measured?;
    let ([sent, ..], [shown, late, most]) = (percentiles(&mut sent_ms)?, percentiles(&mut shown_ms)?);
    println!("| {fps} | {sent:.0} | {shown:.0} | {late:.0} | {most:.0} | {lost} |");
    Ok(())
}

struct Measured {
    /// Delays in milliseconds, from when a frame was captured.
    sent_ms: Vec<f64>,
    shown_ms: Vec<f64>,
    lost: usize,
}

fn measure(encoder: &mut Child, server: &mut Child, frames: &[Vec<u8>], fps: f64) -> Result<Measured> {
    let mut line = String::new();
    BufReader::new(server.stdout.take().context("its output")?).read_line(&mut line)?;
    let address = line.trim_start_matches("http://").split('/').next().context("an address")?.parse()?;
    let (messages, arriving) = channel();
    let (arrived, arrivals) = channel();
    let receiver = thread::spawn(move || receive(address, &messages, &arrived));
    let feeder = feed(encoder.stdin.take().context("its input")?, frames, fps);
    let mut reader = isv::Reader::from_read("live", Messages { arriving, left: Vec::new(), read: 0 });
    let mut shown = Vec::new();
    while let Some(frame) = reader.next_frame()? {
        let mesh = frame.mesh()?;
        ensure!(!mesh.triangles.is_empty(), "a frame without a surface");
        shown.push((frame.timestamp().as_secs_f64() * fps, unix_ms()));
    }
    let captured = feeder.join().expect("it does not panic")?;
    receiver.join().expect("it does not panic")?;
    let sent: Vec<f64> = arrivals.into_iter().collect();
    let mut measured =
        Measured { sent_ms: Vec::new(), shown_ms: Vec::new(), lost: captured.len() - shown.len() };
    for ((number, shown), sent) in shown.into_iter().zip(sent) {
        let number = number.round() as usize;
        if number as f64 >= WARM_UP_S * fps {
            measured.sent_ms.push(sent - captured[number]);
            measured.shown_ms.push(shown - captured[number]);
        }
    }
    Ok(measured)
}

/// Writes frames in their time, to and fro; gives when each was captured.
fn feed(mut input: ChildStdin, frames: &[Vec<u8>], fps: f64) -> JoinHandle<io::Result<Vec<f64>>> {
    let frames = frames.to_vec();
    thread::spawn(move || {
        let (start, start_ms) = (Instant::now(), unix_ms());
        let mut captured = Vec::new();
        let and_back = frames.iter().chain(frames[1..frames.len() - 1].iter().rev());
        for frame in and_back.cycle().take((SECONDS * fps) as usize) {
            let due = captured.len() as f64 / fps;
            thread::sleep(Duration::from_secs_f64(due).saturating_sub(start.elapsed()));
            captured.push(start_ms + 1e3 * due);
            input.write_all(frame)?;
        }
        Ok(captured)
    })
}

/// Passes on the header and the packets of a live stream, and when the server had each packet.
fn receive(address: SocketAddr, messages: &Sender<Vec<u8>>, arrived: &Sender<f64>) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let socket = tokio::net::TcpStream::connect(address).await?;
        let (mut socket, _) = tokio_tungstenite::client_async(format!("ws://{address}/live"), socket).await?;
        while let Some(received) = socket.next().await {
            let received = received?.into_data();
            let passed = match received.first() {
                Some(&message::HEADER) => messages.send(received[1..].to_vec()),
                Some(&message::END) => break,
                _ if message::is_packet(&received) => {
                    let (time, packet) = received[1..].split_first_chunk().context("a time")?;
                    arrived.send(f64::from_le_bytes(*time))?;
                    messages.send(packet.to_vec())
                }
                _ => Ok(()),
            };
            passed?;
        }
        Ok(())
    })
}

/// The bytes of messages, as they come.
struct Messages {
    arriving: Receiver<Vec<u8>>,
    left: Vec<u8>,
    /// Bytes of `left` that were read.
    read: usize,
}

impl Read for Messages {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.read == self.left.len() {
            (self.left, self.read) = (self.arriving.recv().unwrap_or_default(), 0);
        }
        let count = (&self.left[self.read..]).read(into)?;
        self.read += count;
        Ok(count)
    }
}

/// What is coded: its name, its frames as PLY files, and the voxel.
fn take() -> Result<(&'static str, Vec<Vec<u8>>, &'static str)> {
    if let Some(dancer) = isv_testkit::capture("dancer") {
        let mut paths =
            std::fs::read_dir(dancer)?.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<_>>>()?;
        paths.retain(|path| path.extension().is_some_and(|extension| extension == "ply"));
        paths.sort();
        let frames = paths.iter().map(std::fs::read).collect::<io::Result<Vec<_>>>()?;
        return Ok(("dancer, 5 mm", frames, "5mm"));
    }
    let voxel = isv::raw::volume::VoxelSize::from_metres(0.006)?;
    let frame = |n: u32| {
        let mesh = isv_figure::figure_mesh(f64::from(n) / 30.0, voxel);
        let mut bytes = Vec::new();
        isv::raw::io::write_mesh_to(&mut bytes, &mesh, isv::raw::io::Format::Ply)?;
        Ok(bytes)
    };
    Ok(("figure, 6 mm", (0..16).map(frame).collect::<Result<_>>()?, "6mm"))
}

/// The program, its output piped.
fn program(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_isv"));
    command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::null());
    command
}

fn unix_ms() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64() * 1e3
}

/// Half of the values, 95 % and all are up to these.
fn percentiles(values: &mut [f64]) -> Result<[f64; 3]> {
    ensure!(!values.is_empty(), "no frame came");
    values.sort_by(f64::total_cmp);
    Ok([0.5, 0.95, 1.0].map(|share| values[((values.len() - 1) as f64 * share) as usize]))
}
