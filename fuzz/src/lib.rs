//! What the fuzz targets do with bytes. None of it may panic, hang, or take memory that the bytes do not justify.

use isv::decode::{Decoder, Limits};
use isv::format::PacketReader;
use isv::io::{Unit, parse_geometry};
use std::path::Path;

/// Reads a file of meshes or points; the name tells its format. What is read passes its own checks.
pub fn read_geometry(name: &str, bytes: &[u8]) {
    if let Ok(geometry) = parse_geometry(Path::new(name), bytes, Unit::Metre) {
        assert!(geometry.bounds().is_some());
    }
}

/// Decodes a stream as far as it goes.
pub fn decode_stream(bytes: &[u8]) {
    let Ok(mut packets) = PacketReader::new(bytes) else { return };
    let header = *packets.header().expect("a reader that began at the header has it");
    let mut decoder = Decoder::new(&header, Limits::default());
    while let Ok(Some(packet)) = packets.next_frame() {
        if decoder.decode(&packet).is_err() {
            return;
        }
    }
}
