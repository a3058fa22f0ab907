//! The session on this machine: what `player/test` asks of the module, where faults are easier to find.

use super::*;
use isv_decode::colour::surface_colours;
use isv_encode::colour::{ColourEncoder, ColourSettings};
use isv_encode::{Encoder, EncoderSettings};
use isv_format::{ColourLayers, FrameRate, PacketWriter, Profile};
use isv_volume::{BlockEdge, ColourSample, Grid, Truncation, VoxelSize};
use std::path::{Path, PathBuf};

fn conformance() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../conformance")
}

fn stream(name: &str) -> Vec<u8> {
    std::fs::read(conformance().join(name)).unwrap()
}

/// The packets of a stream and where they begin.
fn packets(stream: &[u8]) -> Vec<(u64, &[u8])> {
    let mut reader = PacketReader::new(stream).unwrap();
    let mut packets = Vec::new();
    while let Some(packet) = reader.next_packet().unwrap() {
        let at = packet.at as usize;
        packets.push((packet.at, &stream[at..at + packet.total_bytes()]));
    }
    packets
}

fn give(session: &mut Session, bytes: &[u8]) {
    session.input(bytes.len()).unwrap().copy_from_slice(bytes);
}

fn opened(stream: &[u8]) -> Session {
    let mut session = Session::default();
    give(&mut session, &stream[..StreamHeader::BYTES]);
    session.open().unwrap();
    session
}

/// What decoding a packet says.
fn decode(session: &mut Session, (at, bytes): (u64, &[u8])) -> Status {
    give(session, bytes);
    let result = session.decode(at);
    session.report(result)
}

#[test]
fn streams_decode_to_their_hashes() {
    let table = std::fs::read_to_string(conformance().join("hashes.txt")).unwrap();
    let mut names: Vec<&str> = table.lines().map(|line| line.split(' ').next().unwrap()).collect();
    names.dedup();
    let mut found = String::new();
    for name in names {
        let stream = stream(name);
        let mut session = opened(&stream);
        let packets = packets(&stream);
        let has_index = !name.contains("no_index");
        let (frames, index) = packets.split_at(packets.len() - usize::from(has_index));
        for (number, packet) in frames.iter().enumerate() {
            assert_eq!(decode(&mut session, *packet), Status::Done, "{name}: {}", session.message());
            found += &format!("{name} {number} {:016x}\n", session.hash().unwrap());
            let stated = session.frame().unwrap().stated_hash;
            assert!(stated.is_none_or(|stated| Some(stated) == session.hash()));
        }
        let Some(index) = index.first() else { continue };
        give(&mut session, index.1);
        session.read_index(index.0).unwrap();
        let starts: Vec<f64> = frames.iter().map(|(at, _)| *at as f64).collect();
        assert_eq!(session.index().offsets, starts);
        assert_eq!(session.index().keyframes[0], 1);
        give(&mut session, &stream[stream.len() - StreamIndex::TRAILER_BYTES..]);
        assert_eq!(session.trailer(), Some(index.0));
    }
    assert_eq!(found, table);
}

#[test]
fn the_surface_is_that_of_the_volume_in_single_precision() {
    let stream = stream("main_inter.isv");
    let mut session = opened(&stream);
    let packets = packets(&stream);
    assert_eq!(decode(&mut session, packets[0]), Status::Done);
    for normals in [true, false, true] {
        session.extract_surface(normals).unwrap();
        let options = isv_surface::SurfaceOptions { normals };
        let mesh = isv_surface::extract_surface(session.volume().unwrap(), &options);
        let surface = session.surface();
        assert!(!mesh.triangles.is_empty());
        let rounded: Vec<_> = mesh.vertices.iter().map(|vertex| vertex.as_vec3().to_array()).collect();
        assert_eq!(surface.vertices, rounded);
        assert_eq!(surface.normals.len(), mesh.normals.len());
        assert_eq!(surface.triangles, mesh.triangles);
    }
}

#[test]
fn parts_that_changed_make_up_the_surface() {
    let stream = stream("main_inter.isv");
    let mut session = opened(&stream);
    let mut parts = std::collections::BTreeMap::new();
    let packets = packets(&stream);
    let (_index, frames) = packets.split_last().unwrap();
    assert!(frames.len() > 1);
    for (number, packet) in frames.iter().enumerate() {
        assert_eq!(decode(&mut session, *packet), Status::Done, "{}", session.message());
        session.extract_parts(true).unwrap();
        let Surface { changed, removed, vertices, normals, triangles, part_count, is_fresh, .. } =
            session.surface();
        assert_eq!(*is_fresh, number == 0);
        removed.iter().for_each(|place| assert!(parts.remove(place).is_some()));
        let (mut vertex, mut triangle) = (0, 0);
        for [x, y, z, vertex_count, triangle_count] in changed.iter().copied() {
            let corner = |v: u32| (vertices[vertex + v as usize], normals[vertex + v as usize]);
            let own = &triangles[triangle..triangle + triangle_count as usize];
            let corners: Vec<_> = own.iter().map(|triangle| triangle.map(corner)).collect();
            parts.insert([x, y, z], corners);
            vertex += vertex_count as usize;
            triangle += triangle_count as usize;
        }
        assert_eq!((vertex, triangle, parts.len()), (vertices.len(), triangles.len(), *part_count));
        let mut in_parts: Vec<_> = parts.values().flatten().map(bits).collect();
        session.extract_surface(true).unwrap();
        let Surface { vertices, normals, triangles, .. } = session.surface();
        let corner = |v: u32| (vertices[v as usize], normals[v as usize]);
        let mut whole: Vec<_> = triangles.iter().map(|triangle| bits(&triangle.map(corner))).collect();
        in_parts.sort_unstable();
        whole.sort_unstable();
        assert!(in_parts == whole, "frame {number}");
    }
    assert!(parts.len() > 1);
    give(&mut session, &stream[..StreamHeader::BYTES]);
    session.open().unwrap();
    assert_eq!(decode(&mut session, packets[0]), Status::Done);
    session.extract_parts(true).unwrap();
    assert!(session.surface().is_fresh);
}

/// The corners of a triangle with their normals, to the last bit.
fn bits(corners: &[([f32; 3], [f32; 3]); 3]) -> Vec<u32> {
    corners.iter().flat_map(|(vertex, normal)| [*vertex, *normal].concat()).map(f32::to_bits).collect()
}

#[test]
fn a_surface_that_is_too_large_leaves_no_parts() {
    let stream = stream("main_inter.isv");
    let mut session = opened(&stream);
    assert_eq!(decode(&mut session, packets(&stream)[0]), Status::Done);
    session.extract_parts(false).unwrap();
    let changed = session.surface().changed.clone();
    session.limit(1, true);
    assert_eq!(decode(&mut session, packets(&stream)[1]), Status::Done);
    let result = session.extract_parts(false);
    assert_eq!(session.report(result), Status::Limit);
    session.limit(DEFAULT_VOXELS, true);
    assert_eq!(decode(&mut session, packets(&stream)[0]), Status::Done);
    session.extract_parts(false).unwrap();
    assert!(session.surface().is_fresh && session.surface().changed == changed);
}

/// A stream of a ball that moves, in colours of places, with a keyframe every third frame.
fn coloured_stream(frames: u32) -> Vec<u8> {
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(0.005).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::from_voxels(4).unwrap(),
    };
    let header =
        StreamHeader::new(Profile::Main, grid, FrameRate::DEFAULT).with_colour(ColourLayers::HalfVoxels);
    let mut encoder =
        Encoder::new(&header, EncoderSettings { gop: 3, checksums: true, ..Default::default() });
    let mut colour_encoder = ColourEncoder::new(ColourSettings { checksums: true, ..Default::default() });
    let mut writer = PacketWriter::new(Vec::new(), &header).unwrap();
    for t in 0..frames {
        let frame = encoder.encode(&isv_testkit::ball(grid, f64::from(t)));
        let decoded = encoder.reconstruction().unwrap();
        let mesh = isv_surface::extract_surface(decoded, &isv_surface::SurfaceOptions { normals: true });
        let seen = mesh.vertices.iter().zip(&mesh.normals).map(|(vertex, normal)| {
            let [x, y, _] = vertex.to_array();
            let colour = [200.0, 60.0 + 500.0 * x as f32, 128.0 + 600.0 * y as f32];
            let (position, normal) = (vertex.as_vec3().to_array(), normal.as_vec3().to_array());
            ColourSample { position, normal, colour, weight: 1.0 }
        });
        let seen: Vec<_> = seen.collect();
        let colour = colour_encoder.encode(decoded, &seen, frame.keyframe).bytes;
        writer.write_coloured_frame(frame.keyframe, 0, &frame.payload(), Some(&colour)).unwrap();
    }
    writer.finish().unwrap()
}

#[test]
fn vertices_have_the_colours_of_the_surface() {
    let stream = coloured_stream(3);
    let mut session = opened(&stream);
    assert!(session.has_colour());
    for packet in &packets(&stream)[..3] {
        assert_eq!(decode(&mut session, *packet), Status::Done, "{}", session.message());
        session.extract_surface(true).unwrap();
        let options = isv_surface::SurfaceOptions { normals: true };
        let mesh = isv_surface::extract_surface(session.volume().unwrap(), &options);
        let colour = session.stream.as_ref().unwrap().decoder.colour().unwrap();
        let expected = surface_colours(colour, session.volume().unwrap().grid(), &mesh.vertices);
        assert_eq!(session.surface().colours, expected);
        let reddish = expected.iter().filter(|[red, ..]| red.abs_diff(200) < 12).count();
        assert!(10 * reddish > 9 * expected.len(), "{reddish} of {}", expected.len());
    }
}

#[test]
fn frames_after_a_lost_colour_are_refused_until_a_keyframe() {
    let stream = coloured_stream(6);
    let packets = packets(&stream);
    let mut session = opened(&stream);
    assert_eq!(decode(&mut session, packets[0]), Status::Done);
    assert_eq!(decode(&mut session, packets[2]), Status::NeedsKeyframe);
    assert_eq!(decode(&mut session, packets[3]), Status::Done, "{}", session.message());
    session.extract_surface(false).unwrap();
    let late = session.surface().colours.clone();
    let mut whole = opened(&stream);
    for packet in &packets[..4] {
        assert_eq!(decode(&mut whole, *packet), Status::Done);
    }
    whole.extract_surface(false).unwrap();
    assert_eq!(late, whole.surface().colours);
}

#[test]
fn streams_without_colour_and_colour_that_is_not_wanted_give_none() {
    let stream = stream("version_2_colour_absent.isv");
    let mut session = opened(&stream);
    assert_eq!(decode(&mut session, packets(&stream)[0]), Status::Done);
    session.extract_surface(false).unwrap();
    let surface = session.surface();
    assert_eq!(surface.colours, vec![[128; 3]; surface.vertices.len()], "no frame has colour");
    let mut session = Session::default();
    session.keep_colour(false);
    let plain = std::fs::read(conformance().join("main_inter.isv")).unwrap();
    for stream in [coloured_stream(1), plain] {
        give(&mut session, &stream[..StreamHeader::BYTES]);
        session.open().unwrap();
        assert!(!session.has_colour());
        assert_eq!(decode(&mut session, packets(&stream)[0]), Status::Done);
        session.extract_surface(false).unwrap();
        assert!(!session.surface().vertices.is_empty() && session.surface().colours.is_empty());
    }
}

#[test]
fn after_a_damaged_packet_the_decoder_goes_on_at_a_keyframe() {
    let stream = stream("main_inter.isv");
    let packets = packets(&stream);
    let mut session = opened(&stream);
    assert_eq!(decode(&mut session, packets[1]), Status::NeedsKeyframe);
    assert_eq!(decode(&mut session, packets[0]), Status::Done);
    let mut damaged = packets[1].1.to_vec();
    *damaged.last_mut().unwrap() ^= 1;
    assert_eq!(decode(&mut session, (packets[1].0, &damaged)), Status::Malformed);
    assert!(session.message().contains("checksum"), "{}", session.message());
    assert!(session.frame().is_none() && session.hash().is_none());
    let result = session.extract_surface(false);
    assert_eq!(session.report(result), Status::Order);
    assert_eq!(decode(&mut session, packets[2]), Status::NeedsKeyframe);
    assert_eq!(decode(&mut session, packets[0]), Status::Done);
    assert_eq!(session.message(), "");
}

#[test]
fn packets_that_are_cut_or_too_long_are_refused() {
    let stream = stream("intra.isv");
    let (at, packet) = packets(&stream)[0];
    let mut session = opened(&stream);
    for length in (0..packet.len()).step_by(7) {
        assert_eq!(decode(&mut session, (at, &packet[..length])), Status::Malformed, "{length} bytes");
        assert!(!session.message().is_empty());
    }
    let longer = [packet, &[0]].concat();
    assert_eq!(decode(&mut session, (at, &longer)), Status::Malformed);
    assert_eq!(decode(&mut session, (at, packet)), Status::Done);
    give(&mut session, packet);
    let result = session.read_index(at);
    assert_eq!(session.report(result), Status::Malformed);
}

#[test]
fn calls_in_the_wrong_order_are_errors() {
    let stream = stream("intra.isv");
    let packet = packets(&stream)[0];
    let mut session = Session::default();
    assert_eq!(decode(&mut session, packet), Status::Order);
    assert!(session.header().is_none() && session.frame().is_none() && session.packet_header().is_none());
    give(&mut session, &[0; 48]);
    let result = session.open();
    assert_eq!(session.report(result), Status::Malformed);
    let mut session = opened(&stream);
    let result = session.extract_surface(true);
    assert_eq!(session.report(result), Status::Order);
}

#[test]
fn frames_surfaces_and_input_above_the_limits_are_refused() {
    let stream = stream("main_inter.isv");
    let packet = packets(&stream)[0];
    let mut session = opened(&stream);
    assert_eq!(decode(&mut session, packet), Status::Done);
    let voxels = session.volume().unwrap().sample_count();
    session.extract_surface(false).unwrap();
    let vertices = session.surface().vertices.len();
    let with_limit = |limit| {
        let mut session = Session::default();
        session.limit(limit, false);
        give(&mut session, &stream[..StreamHeader::BYTES]);
        session.open().unwrap();
        session
    };
    let mut enough = with_limit(voxels);
    assert_eq!(decode(&mut enough, packet), Status::Done);
    enough.limit(VOXELS_A_VERTEX * vertices, false);
    enough.extract_surface(false).unwrap();
    enough.limit(VOXELS_A_VERTEX * (vertices - 1), false);
    let result = enough.extract_surface(false);
    assert_eq!(enough.report(result), Status::Limit);
    assert!(enough.surface().vertices.is_empty() && enough.surface().triangles.is_empty());
    let mut too_small = with_limit(voxels - 1);
    assert_eq!(decode(&mut too_small, packet), Status::Limit);
    assert_eq!(too_small.refused_blocks(), voxels / 512);
    give(&mut too_small, &stream[..StreamHeader::BYTES]);
    let opened = too_small.open();
    too_small.report(opened);
    assert_eq!(too_small.refused_blocks(), 0, "of the last call only");
    let mut least = with_limit(0);
    assert!(least.input(LEAST_INPUT).is_ok());
    let result = least.input(LEAST_INPUT + 1).map(drop);
    assert_eq!(least.report(result), Status::Limit);
    assert!(least.input.is_empty());
    least.limit(usize::MAX, false);
    assert_eq!(least.voxels, MOST_VOXELS);
}

#[test]
fn blocks_are_told_of_where_that_is_wanted() {
    let stream = stream("main_still_cells.isv");
    let packets = packets(&stream);
    let mut session = opened(&stream);
    assert_eq!(decode(&mut session, packets[0]), Status::Done);
    assert!(session.blocks().places.is_empty());
    session.keep_blocks(true);
    assert_eq!(decode(&mut session, packets[1]), Status::Done);
    let Blocks { places, bits, motion } = session.blocks();
    assert!((bits.len(), motion.len()) == (places.len(), places.len()));
    for coding in [0, 2] {
        assert!(places.iter().any(|place| place[3] == coding), "{coding}");
    }
    for (place, (bits, motion)) in places.iter().zip(bits.iter().zip(motion)) {
        assert!(place[3] == 2 || *motion == [0.0; 3]);
        assert!(place[3] != 0 || *bits == 0.0);
    }
    assert_eq!(decode(&mut session, packets[1]), Status::NeedsKeyframe);
    assert!(session.blocks().places.is_empty());
}
