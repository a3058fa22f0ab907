//! One stream decoded in several ways: volumes and refusals must be the same.

use crate::sealing::with_checksums;
use crate::stream::{FRAMES, LIMITS};
use isv::raw::decode::{Decoder, volume_hash};
use isv::raw::format::PacketReader;
use isv::raw::kernels::simd::{self, Instructions};
use rayon::ThreadPool;
use std::io::{self, Read};
use std::sync::LazyLock;

/// A second number of threads, beside the one of the process.
pub(crate) static TWO_THREADS: LazyLock<ThreadPool> =
    LazyLock::new(|| rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("threads can be started"));

/// Decodes a stream with scalar code on one thread from bytes that come together, and in one other way. That
/// is with a set of vector instructions, on two threads, or from bytes that come one at a time. The bytes say
/// which way, so that each input costs two decodings.
pub(crate) fn compare(bytes: &[u8]) {
    let bytes = with_checksums(bytes);
    let sets: Vec<Instructions> = Instructions::available().collect();
    assert_eq!(sets[0], Instructions::Scalar);
    let run = |instructions: Instructions, decode: &dyn Fn() -> Vec<String>| {
        simd::choose(instructions).expect("the machine has them");
        decode()
    };
    let best = sets[sets.len() - 1];
    let expected = run(Instructions::Scalar, &|| outcome(&bytes[..]));
    match crc32fast::hash(&bytes) as usize % (sets.len() + 1) {
        0 => {
            let found = run(best, &|| TWO_THREADS.install(|| outcome(&bytes[..])));
            assert_eq!(found, expected, "two threads with {best} against one with scalar code");
        }
        way if way < sets.len() => {
            let found = run(sets[way], &|| outcome(&bytes[..]));
            assert_eq!(found, expected, "{} against scalar", sets[way]);
        }
        _ => {
            let found = run(best, &|| outcome(Trickle(&bytes)));
            assert_eq!(found, expected, "a byte at a time with {best} against all with scalar code");
        }
    }
}

/// What becomes of each packet: a hash, or the words of the refusal.
fn outcome(source: impl Read) -> Vec<String> {
    let mut packets = match PacketReader::new(source) {
        Ok(packets) => packets,
        Err(error) => return vec![error.to_string()],
    };
    let header = *packets.header();
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
pub(crate) struct Trickle<'a>(pub(crate) &'a [u8]);

impl Read for Trickle<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let most = buffer.len().min(1);
        self.0.read(&mut buffer[..most])
    }
}
