//! Many live viewers on one server: packets dropped, memory, latency.
//!
//! ```text
//! cargo run --release -p isv-serve --example viewers -- FILE.isv [VIEWERS] [SECONDS]
//! ```
//!
//! The server is a process of its own, so that its memory is not mixed with that of the viewers. It is fed
//! the packets of the file at the file's frame rate, over and over. Each is stamped with the time at which it
//! was written.

use futures_util::StreamExt;
use isv_format::{Packet, PacketHeader, PacketReader, StreamHeader};
use isv_serve::{Hub, HubLimits, Page, Server, Settings, Source, message};
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::SocketAddr;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tokio::net::TcpStream;
use tokio::task::JoinHandle;
use tokio_tungstenite::client_async;

/// The argument that makes this program the server.
const SERVER: &str = "--server";

type Failure = Box<dyn std::error::Error + Send + Sync>;

#[tokio::main]
async fn main() -> Result<(), Failure> {
    let args: Vec<_> = std::env::args().skip(1).collect();
    match &args[..] {
        [flag] if flag == SERVER => serve().await,
        [file, rest @ ..] => {
            let viewers = rest.first().map_or(Ok(50), |text| text.parse())?;
            let seconds = rest.get(1).map_or(Ok(10), |text| text.parse())?;
            load(file, viewers, Duration::from_secs(seconds)).await
        }
        [] => Err("name an .isv file".into()),
    }
}

/// Serves what comes on standard input, and says where.
async fn serve() -> Result<(), Failure> {
    let hub = Arc::new(Hub::new(HubLimits::default()));
    let server =
        Server::bind(Settings { page: Page::player(), live: Some(Arc::clone(&hub)), ..Settings::default() })?;
    println!("{}", server.address());
    let _feed = Source::pipe("standard input", std::io::stdin()).feed(hub, |notice| eprintln!("{notice}"));
    server.run().await;
    Ok(())
}

async fn load(file: &str, viewers: usize, time: Duration) -> Result<(), Failure> {
    let (header, packets) = read(file)?;
    let mut server = Command::new(std::env::current_exe()?)
        .arg(SERVER)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    let measured = measure(&mut server, &header, &packets, viewers, time).await;
    server.kill()?;
    server.wait()?;
    measured
}

async fn measure(
    server: &mut Child,
    header: &StreamHeader,
    packets: &[Packet],
    viewers: usize,
    time: Duration,
) -> Result<(), Failure> {
    let mut address = String::new();
    BufReader::new(server.stdout.take().ok_or("no output")?).read_line(&mut address)?;
    let address = address.trim().parse()?;
    let mut input = server.stdin.take().ok_or("no input")?;
    input.write_all(&header.to_bytes())?;
    let mut watching = Vec::new();
    for _ in 0..viewers {
        watching.push(watch(address).await?);
    }
    let (rate, all) = (header.frame_rate.per_second(), packets.to_vec());
    let (written, bytes) = tokio::task::spawn_blocking(move || feed(&mut input, &all, rate, time)).await??;
    let mut latencies_ms = Vec::new();
    let mut received = 0;
    for viewer in watching {
        let seen = viewer.await?;
        received += seen.len();
        latencies_ms.extend(seen);
    }
    let mbps = bytes as f64 * 8.0 / time.as_secs_f64() / 1e6;
    println!("{viewers} viewers, {written} packets at {rate:.0} a second, {mbps:.2} Mbps each");
    println!("dropped: {} of {}", written * viewers - received, written * viewers);
    println!("latency from writing to receiving: {}", percentiles(&mut latencies_ms));
    println!("server: {}", memory(server.id()));
    Ok(())
}

fn read(file: &str) -> Result<(StreamHeader, Vec<Packet>), Failure> {
    let bytes = fs::read(file)?;
    let mut reader = PacketReader::new(&bytes[..])?;
    let header = *reader.header();
    let mut packets = Vec::new();
    while let Some(packet) = reader.next_frame()? {
        packets.push(packet);
    }
    Ok((header, packets))
}

/// Joins; the task gives the latency of each packet in ms, up to the end of the stream.
async fn watch(address: SocketAddr) -> Result<JoinHandle<Vec<f64>>, Failure> {
    let socket = TcpStream::connect(address).await?;
    let (mut socket, _) = client_async(format!("ws://{address}/live"), socket).await?;
    // The header is there before the first packet is written, so none can be missed by joining too late.
    while !socket.next().await.ok_or("closed")??.is_binary() {}
    Ok(tokio::spawn(async move {
        let mut latencies_ms = Vec::new();
        while let Some(Ok(received)) = socket.next().await {
            let received = received.into_data();
            match received.first() {
                _ if message::is_packet(&received) => {
                    let stamp = received[9 + 12..9 + 20].try_into().expect("eight bytes");
                    latencies_ms.push((unix_ns() as f64 - u64::from_le_bytes(stamp) as f64) / 1e6);
                }
                Some(&message::END) => break,
                _ => {}
            }
        }
        latencies_ms
    }))
}

/// Writes packets in their time; returns how many packets and bytes.
fn feed(
    input: &mut ChildStdin,
    packets: &[Packet],
    rate: f64,
    time: Duration,
) -> Result<(usize, usize), Failure> {
    let start = Instant::now();
    let (mut written, mut bytes) = (0, 0);
    for packet in packets.iter().cycle() {
        let due = Duration::from_secs_f64(written as f64 / rate);
        if due >= time {
            break;
        }
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        let header =
            PacketHeader::seal(packet.header.kind, packet.header.since_keyframe, unix_ns(), &packet.payload);
        input.write_all(&[&header[..], &packet.payload].concat())?;
        written += 1;
        bytes += packet.total_bytes();
    }
    Ok((written, bytes))
}

fn unix_ns() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos() as u64
}

fn percentiles(values: &mut [f64]) -> String {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| {
        values.get(((values.len().max(1) - 1) as f64 * share) as usize).copied().unwrap_or(f64::NAN)
    };
    format!("p50 {:.1} ms, p95 {:.1} ms, p99 {:.1} ms, most {:.1} ms", at(0.5), at(0.95), at(0.99), at(1.0))
}

/// What Linux says of a process's memory.
fn memory(process: u32) -> String {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let lines = status.lines().filter(|line| line.starts_with("VmHWM") || line.starts_with("VmRSS"));
    lines.map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect::<Vec<_>>().join(", ")
}
