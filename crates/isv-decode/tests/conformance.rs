//! The committed streams decode to the committed hashes, with every instruction set that the machine has. They change only when
//! the format does: see `conformance/README.md`.

use isv_decode::{Decoder, Limits, volume_hash};
use isv_format::PacketReader;
use isv_kernels::simd::{self, Instructions};
use std::env::consts::ARCH;
use std::path::{Path, PathBuf};

fn suite() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../conformance")
}

/// The streams that the table of hashes names.
fn streams(table: &str) -> Vec<(&str, Vec<u8>)> {
    let mut names: Vec<&str> = table.lines().map(|line| line.split(' ').next().unwrap()).collect();
    names.dedup();
    names.into_iter().map(|name| (name, std::fs::read(suite().join(name)).unwrap())).collect()
}

/// The table of hashes, as the decoder finds them.
fn decoded(streams: &[(&str, Vec<u8>)]) -> String {
    let mut found = String::new();
    for (name, bytes) in streams {
        let mut reader = PacketReader::new(&bytes[..]).unwrap();
        let mut decoder = Decoder::new(reader.header().unwrap(), Limits::default());
        let mut frame = 0;
        while let Some(packet) = reader.next_frame().unwrap() {
            let hash = volume_hash(decoder.decode_and_verify(&packet).unwrap().volume);
            found += &format!("{name} {frame} {hash:016x}\n");
            frame += 1;
        }
        assert!(reader.complete(), "{name}");
    }
    found
}

#[test]
fn streams_decode_to_their_hashes_with_every_instruction_set() {
    let table = std::fs::read_to_string(suite().join("hashes.txt")).unwrap();
    let streams = streams(&table);
    assert_eq!(streams.len(), 20);
    for (instructions, found) in simd::with_each(|| decoded(&streams)) {
        assert_eq!(found, table, "{instructions}");
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
