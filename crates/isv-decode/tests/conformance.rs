//! The committed streams decode to the committed hashes, or are refused as they have to be, with every instruction set that the
//! machine has. They never change: see `conformance/README.md`.

use isv_decode::{DecodeError, Decoder, Limits, volume_hash};
use isv_format::PacketReader;
use isv_kernels::simd::{self, Instructions};
use std::collections::BTreeMap;
use std::env::consts::ARCH;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../conformance")
}

/// The streams of a folder, by name.
fn streams(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let files = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path());
    let streams = files.filter(|path| path.extension().is_some_and(|extension| extension == "isv"));
    streams
        .map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), std::fs::read(&path).unwrap()))
        .collect()
}

/// The hashes of a stream's frames, and whether its index was met; or what is refused after them.
fn decode(bytes: &[u8]) -> (Vec<u64>, Result<bool, DecodeError>) {
    let mut hashes = Vec::new();
    let mut decode = || {
        let mut reader = PacketReader::new(bytes)?;
        let mut decoder = Decoder::new(reader.header().unwrap(), Limits::default());
        while let Some(packet) = reader.next_frame()? {
            hashes.push(volume_hash(decoder.decode_and_verify(&packet)?.volume));
        }
        Ok(reader.complete())
    };
    let end = decode();
    (hashes, end)
}

#[test]
fn streams_decode_to_their_hashes_with_every_instruction_set() {
    let table = std::fs::read_to_string(folder().join("hashes.txt")).unwrap();
    let mut expected: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
    for line in table.lines() {
        let [name, frame, hash] = line.split(' ').collect::<Vec<_>>().try_into().expect("three words");
        let hashes = expected.entry(name).or_default();
        assert_eq!(frame, hashes.len().to_string(), "{line}");
        hashes.push(u64::from_str_radix(hash, 16).unwrap());
    }
    let streams = streams(&folder());
    assert!(expected.keys().all(|name| streams.contains_key(*name)));
    assert!(streams.len() >= 40, "{} streams", streams.len());
    let decoded = || streams.iter().map(|(name, bytes)| (name, decode(bytes))).collect::<Vec<_>>();
    for (instructions, found) in simd::with_each(decoded) {
        for (name, (hashes, end)) in found {
            assert_eq!(end.unwrap(), !name.contains("no_index"), "{name}, {instructions}");
            // Streams without frames have no line.
            assert_eq!(&hashes, expected.get(&name[..]).unwrap_or(&Vec::new()), "{name}, {instructions}");
        }
        println!("{ARCH} with {instructions}: {} streams as committed", streams.len());
    }
    let wanted: &[&str] = match ARCH {
        "x86" | "x86_64" => &["scalar", "sse2", "sse4.2", "avx2", "avx512"],
        "aarch64" => &["scalar", "neon"],
        _ => &["scalar"],
    };
    for name in wanted {
        let set: Instructions = name.parse().unwrap();
        if !Instructions::available().any(|available| available == set) {
            println!("skipped: {name}, which this machine does not have");
        }
    }
}

#[test]
fn streams_that_must_be_refused_are_and_say_why() {
    let streams = streams(&folder().join("refused"));
    let mut listed = 0;
    for (table, must) in [("refused.txt", true), ("may_refuse.txt", false)] {
        for line in std::fs::read_to_string(folder().join(table)).unwrap().lines() {
            let [name, frames, class] = line.split(' ').collect::<Vec<_>>().try_into().expect("three words");
            let (hashes, end) = decode(&streams[name]);
            match end {
                Err(error) => {
                    assert_eq!(error.class().unwrap().name(), class, "{name}: {error}");
                    assert_eq!(hashes.len().to_string(), frames, "{name}: {error}");
                }
                Ok(_) => assert!(!must, "{name} is accepted"),
            }
            listed += 1;
        }
    }
    assert_eq!(listed, streams.len(), "every stream is listed once");
    assert!(listed >= 60, "{listed} streams");
}
