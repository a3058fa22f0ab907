//! Streams of version 2. Colour parts go where their frames go, and packets of unknown types are left out of
//! copies. Those that must be known stop every command.

mod support;

use isv::raw::decode::{Decoder, Limits};
use isv::raw::encode::colour::{ColourEncoder, ColourSettings};
use isv::raw::format::{
    ColourLayers, FramePayload, PacketHeader, PacketKind, PacketReader, PacketWriter, StreamHeader,
};
use isv::raw::volume::ColourSample;
use serde_json::Value;
use support::{ENCODE, Workspace};

const FRAMES: usize = 9;
/// Types that readers may skip and must know.
const SKIPPABLE: u8 = 0xa0;
const NEEDED: u8 = 0x20;

fn coloured_header(stream: &[u8]) -> StreamHeader {
    PacketReader::new(stream).unwrap().header().with_colour(ColourLayers::HalfVoxels)
}

/// Adds a colour part to each frame of a stream. Each block has one coloured point.
fn coloured(stream: &[u8]) -> Vec<u8> {
    let header = coloured_header(stream);
    let mut reader = PacketReader::new(stream).unwrap();
    let mut writer = PacketWriter::new(Vec::new(), &header).unwrap();
    let mut decoder = Decoder::new(&header, Limits::default());
    let mut encoder = ColourEncoder::new(ColourSettings::default());
    while let Some(packet) = reader.next_frame().unwrap() {
        let geometry = FramePayload::parse(&packet.payload, 0, true, &header.profile).unwrap();
        let (keyframe, time) = (packet.is_keyframe(), packet.header.timestamp_ns);
        let volume = decoder.decode(&packet).unwrap().volume;
        let samples = volume.coords().iter().enumerate().map(|(block, coord)| {
            let position = volume.grid().voxel_centre_m(*coord, [4; 3]).as_vec3().to_array();
            let colour = [10, 20, 30].map(|step| (block * step % 256) as f32);
            ColourSample { position, normal: [0.0; 3], colour, weight: 1.0 }
        });
        let colour = encoder.encode(volume, &samples.collect::<Vec<_>>(), keyframe);
        writer.write_coloured_frame(keyframe, time, &geometry, Some(&colour.bytes)).unwrap();
    }
    writer.finish().unwrap()
}

fn unknown(code: u8) -> Vec<u8> {
    let payload = b"nobody knows";
    [&PacketHeader::seal(PacketKind::Skippable { code }, 3, 4, payload)[..], payload].concat()
}

/// The stream up to its index, with a packet of an unknown type before its third frame and one behind its last.
fn with_unknown(stream: &[u8], code: u8) -> Vec<u8> {
    let mut reader = PacketReader::new(stream).unwrap();
    let mut out = stream[..StreamHeader::BYTES].to_vec();
    for frame in 0..FRAMES {
        let packet = reader.next_frame().unwrap().unwrap();
        if frame == 2 {
            out.extend(unknown(code));
        }
        out.extend(packet.to_bytes());
    }
    [out, unknown(code)].concat()
}

/// The colour parts of a stream.
fn colours(stream: &[u8]) -> Vec<Vec<u8>> {
    let mut reader = PacketReader::new(stream).unwrap();
    std::iter::from_fn(|| reader.next_frame().unwrap())
        .map(|packet| packet.colour().unwrap().unwrap().to_vec())
        .collect()
}

fn info(work: &Workspace, stream: &str) -> Value {
    work.isv(&["info", stream, "--json"]).json()
}

/// A workspace with `take.isv` of version 1, the same with colour as `colour.isv`, and with packets to skip as `skip.isv`.
fn workspace() -> Workspace {
    let work = Workspace::with_figure(FRAMES);
    work.isv(&[&ENCODE[..], &["--masks", "voxels"]].concat()).done();
    let bytes = coloured(&work.read("take.isv"));
    work.write("skip.isv", with_unknown(&bytes, SKIPPABLE));
    work.write("needed.isv", with_unknown(&bytes, NEEDED));
    work.write("colour.isv", bytes);
    work
}

#[test]
fn streams_with_colour_decode_verify_and_are_described() {
    let work = workspace();
    for stream in ["take.isv", "colour.isv", "skip.isv"] {
        work.isv(&["decode", stream, "-o", &stream.replace(".isv", ""), "--no-colour"]).done();
    }
    for name in work.names("take") {
        let whole = work.read(&format!("take/{name}"));
        assert!(whole == work.read(&format!("colour/{name}")) && whole == work.read(&format!("skip/{name}")));
    }
    work.isv(&["decode", "colour.isv", "-o", "painted"]).done();
    let header = |path: &str| String::from_utf8_lossy(&work.read(path)[..300]).into_owned();
    for name in work.names("painted") {
        assert!(header(&format!("painted/{name}")).contains("property uchar red"), "{name}");
        assert!(!header(&format!("colour/{name}")).contains("uchar red"), "{name}");
    }
    let said = work.isv(&["verify", "colour.isv"]).done();
    assert!(String::from_utf8_lossy(said.stdout()).contains("9 of them by hash"));
    let (plain, info) = (info(&work, "take.isv"), info(&work, "colour.isv"));
    assert_eq!((&plain["format_version"], &info["format_version"]), (&1.into(), &2.into()));
    assert_eq!((&plain["colour_layers"], &info["colour_layers"]), (&0.into(), &2.into()));
    let parts = colours(&work.read("colour.isv"));
    let total: usize = parts.iter().map(Vec::len).sum();
    assert_eq!((&plain["bytes_colour"], &info["bytes_colour"]), (&0.into(), &total.into()));
    assert_eq!(plain["bytes_geometry"], info["bytes_geometry"]);
    assert_eq!(info["packets"][3]["bytes_colour"], parts[3].len());
    assert_eq!(info["packets"][3]["bytes_geometry"], plain["packets"][3]["bytes_geometry"]);
    let text = work.isv(&["info", "colour.isv"]).done();
    let text = String::from_utf8_lossy(text.stdout()).into_owned();
    assert!(text.contains("version 2") && text.contains(&format!("2 layers, {total} bytes")), "{text}");
    let text = work.isv(&["info", "take.isv"]).done();
    assert!(!String::from_utf8_lossy(text.stdout()).contains("colour"));
    assert_eq!(self::info(&work, "skip.isv")["unknown_packets"], 2);
}

#[test]
fn copies_keep_colour_and_leave_out_unknown_packets_and_say_so() {
    let work = workspace();
    let expected = colours(&work.read("colour.isv"));
    work.isv(&["cut", "colour.isv", "3..", "-o", "b.isv"]).done();
    assert_eq!(colours(&work.read("b.isv")), expected[3..]);
    let run = work.isv(&["cut", "skip.isv", "0..3", "-o", "a.isv"]).done();
    assert!(
        run.stderr().contains("skip.isv: 1 packet of a type that only a newer isv knows"),
        "{}",
        run.stderr()
    );
    work.isv(&["join", "a.isv", "b.isv", "-o", "joined.isv"]).done();
    assert!(work.read("joined.isv") == work.read("colour.isv"));
    let run = work.isv(&["join", "skip.isv", "-o", "again.isv"]).done();
    assert!(run.stderr().contains("skip.isv: 2 packets of types"), "{}", run.stderr());
    let run = work.isv(&["repair", "skip.isv", "-o", "mended.isv"]).done();
    let said = String::from_utf8_lossy(run.stdout()).into_owned();
    assert!(
        said.contains("9 frames kept, 2 packets of types that only a newer isv knows are left out"),
        "{said}"
    );
    for copy in ["again.isv", "mended.isv"] {
        assert!(work.read(copy) == work.read("colour.isv"), "{copy}");
    }
}

#[test]
fn masks_are_by_cell_unless_every_voxel_counts() {
    let work = Workspace::with_figure(1);
    let masks = |more: &[&str]| {
        work.isv(&[&ENCODE[..], more].concat()).done();
        info(&work, "take.isv")["masks"].clone()
    };
    assert_eq!(masks(&[]), "cells");
    assert_eq!(masks(&["--masks", "voxels"]), "voxels");
    assert_eq!(masks(&["--profile", "main", "--band", "full"]), "voxels");
    assert_eq!(masks(&["--profile", "main", "--band", "full", "--masks", "cells"]), "cells");
    work.isv(&[&ENCODE[..], &["--profile", "paper", "--masks", "cells"]].concat()).fails(2, &["masks"]);
}

#[test]
fn streams_of_other_versions_and_layers_are_not_joined() {
    let work = workspace();
    work.isv(&["join", "take.isv", "colour.isv", "-o", "x.isv"])
        .fails(1, &["colour.isv: has another number of colour layers than take.isv"]);
    let mut header = *PacketReader::new(&work.read("take.isv")[..]).unwrap().header();
    header.version = coloured_header(&work.read("take.isv")).version;
    work.write(
        "second.isv",
        [&header.to_bytes()[..], &work.read("take.isv")[StreamHeader::BYTES..]].concat(),
    );
    work.isv(&["join", "take.isv", "second.isv", "-o", "x.isv"])
        .fails(1, &["second.isv: has another format version than take.isv"]);
    assert!(!work.path("x.isv").exists());
}

#[test]
fn what_must_be_known_stops_every_command() {
    let work = workspace();
    let newer = ["packet type 32 at byte", "is not known: use a newer isv"];
    for args in [
        &["verify", "needed.isv"][..],
        &["info", "needed.isv"],
        &["decode", "needed.isv", "-o", "frames_out"],
        &["decode", "needed.isv", "-o", "frames_held", "--after-loss", "hold"],
        &["join", "needed.isv", "-o", "x.isv"],
        &["repair", "needed.isv", "-o", "x.isv"],
    ] {
        work.isv(args).fails(1, &newer);
    }
}
