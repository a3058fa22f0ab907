//! One stream decoded in several ways: volumes and refusals must be the same.

use crate::sealing::with_checksums;
use crate::stream::{FRAMES, LIMITS};
use isv::decode::{Decoder, volume_hash};
use isv::format::PacketReader;
use isv::kernels::simd::{self, Instructions};
use rayon::ThreadPool;
use std::io::{self, Read};
use std::sync::LazyLock;

/// A second number of threads, beside the one of the process.
pub(crate) static TWO_THREADS: LazyLock<ThreadPool> =
    LazyLock::new(|| rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("threads can be started"));

/// Decodes a stream with scalar code and with each set of vector instructions, on one thread and on two, and from bytes that come
/// together and one at a time.
pub fn compare(bytes: &[u8]) {
    let bytes = with_checksums(bytes);
    let runs = simd::with_each(|| outcome(&bytes[..]));
    let (scalar, expected) = &runs[0];
    assert_eq!(*scalar, Instructions::Scalar);
    for (instructions, found) in &runs[1..] {
        assert_eq!(found, expected, "{instructions} against scalar");
    }
    assert_eq!(TWO_THREADS.install(|| outcome(&bytes[..])), *expected, "two threads against one");
    assert_eq!(outcome(Trickle(&bytes)), *expected, "a byte at a time against all");
}

/// What becomes of each packet: a hash, or the words of the refusal.
fn outcome(source: impl Read) -> Vec<String> {
    let mut packets = match PacketReader::new(source) {
        Ok(packets) => packets,
        Err(error) => return vec![error.to_string()],
    };
    let header = *packets.header().expect("a reader that began at the header has it");
    let mut decoder = Decoder::new(&header, LIMITS);
    let mut lines = Vec::new();
    while lines.len() < FRAMES {
        lines.push(match packets.next_frame() {
            Ok(Some(packet)) => match decoder.decode(&packet) {
                Ok(frame) => format!("{:016x} at {} ns", volume_hash(frame.volume), frame.timestamp_ns),
                Err(error) => error.to_string(),
            },
            Ok(None) => break,
            Err(error) => {
                lines.push(error.to_string());
                break;
            }
        });
    }
    lines
}

/// Gives a byte at a time.
struct Trickle<'a>(&'a [u8]);

impl Read for Trickle<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let most = buffer.len().min(1);
        self.0.read(&mut buffer[..most])
    }
}
