//! The committed streams decode to the committed hashes. They change only when the format does: see `conformance/README.md`.

use isv_decode::{Decoder, Limits, volume_hash};
use isv_format::PacketReader;
use std::path::Path;

#[test]
fn streams_decode_to_their_hashes() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../conformance");
    let table = std::fs::read_to_string(folder.join("hashes.txt")).unwrap();
    let mut found = String::new();
    let mut names: Vec<&str> = table.lines().map(|line| line.split(' ').next().unwrap()).collect();
    names.dedup();
    for name in &names {
        let bytes = std::fs::read(folder.join(name)).unwrap();
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
    assert_eq!(found, table);
    assert_eq!(names.len(), 20);
}
