//! The calls of [`Session`] as plain functions: numbers and addresses in the instance's memory. `player/src/wasm.js` is their caller.
//!
//! Status: see [`Status`]; 0 is done, and the words of anything else are at [`isv_message`]. An address is good until the next call
//! that gives input or takes it; facts that are not there yet are 0.

#![expect(unsafe_code, reason = "an export needs a name of its own; no address is followed here")]

use crate::error::Status;
use crate::session::{Frame, Session};
use isv_format::{PacketKind, Profile, StreamHeader};
use std::cell::RefCell;

thread_local! {
    /// All state of the instance.
    static SESSION: RefCell<Session> = RefCell::default();
}

fn with<R>(call: impl FnOnce(&mut Session) -> R) -> R {
    SESSION.with_borrow_mut(call)
}

/// A fact of the stream's header.
fn header<R: Default>(fact: impl FnOnce(&StreamHeader) -> R) -> R {
    with(|session| session.header().map(fact).unwrap_or_default())
}

/// A fact of the last frame.
fn frame<R: Default>(fact: impl FnOnce(Frame) -> R) -> R {
    with(|session| session.frame().map(fact).unwrap_or_default())
}

/// Room for `bytes` bytes of input, which the next call reads; no address if that is too much.
#[unsafe(no_mangle)]
extern "C" fn isv_input(bytes: usize) -> *mut u8 {
    with(|session| {
        let room = session.input(bytes).map(<[u8]>::as_mut_ptr);
        let address = *room.as_ref().unwrap_or(&std::ptr::null_mut());
        session.report(room.map(drop));
        address
    })
}

/// Address of the words of the last error, in UTF-8.
#[unsafe(no_mangle)]
extern "C" fn isv_message() -> *const u8 {
    with(|session| session.message().as_ptr())
}

/// How long they are; 0 where the last call had no error.
#[unsafe(no_mangle)]
extern "C" fn isv_message_bytes() -> usize {
    with(|session| session.message().len())
}

/// Blocks of the frame that the last call refused because it has too many; 0 after any other call.
#[unsafe(no_mangle)]
extern "C" fn isv_refused_blocks() -> usize {
    with(|session| session.refused_blocks())
}

/// Limits the voxels of a frame, from the next [`isv_open`] on. A stream may take all of them, however few bytes it has, if `trusted`
/// is not 0.
#[unsafe(no_mangle)]
extern "C" fn isv_limit(voxels: usize, trusted: u32) {
    with(|session| session.limit(voxels, trusted != 0));
}

/// Whether colour is decoded, if that is not 0, from the next [`isv_open`] on. It is, unless this says otherwise.
#[unsafe(no_mangle)]
extern "C" fn isv_keep_colour(wanted: u32) {
    with(|session| session.keep_colour(wanted != 0));
}

/// Begins a stream. Input: the 48 bytes of its header.
#[unsafe(no_mangle)]
extern "C" fn isv_open() -> Status {
    with(|session| {
        let result = session.open();
        session.report(result)
    })
}

/// Edge of a voxel in metres.
#[unsafe(no_mangle)]
extern "C" fn isv_voxel_size() -> f64 {
    header(|header| header.grid.voxel_size.metres())
}

/// Frames a second.
#[unsafe(no_mangle)]
extern "C" fn isv_fps() -> f64 {
    header(|header| header.frame_rate.per_second())
}

/// Voxels along an edge of a block.
#[unsafe(no_mangle)]
extern "C" fn isv_block_side() -> u32 {
    header(|header| header.grid.edge.voxels() as u32)
}

/// Truncation in voxels.
#[unsafe(no_mangle)]
extern "C" fn isv_truncation() -> u32 {
    header(|header| header.grid.truncation.voxels())
}

/// 0: profile `paper`, 1: `main`.
#[unsafe(no_mangle)]
extern "C" fn isv_profile() -> u32 {
    header(|header| u32::from(header.profile == Profile::Main))
}

/// Whether vertices of surfaces have colours.
#[unsafe(no_mangle)]
extern "C" fn isv_has_colour() -> u32 {
    with(|session| u32::from(session.has_colour()))
}

/// Beginning of the index packet; -1 if the input, the last 16 bytes of a file, is no trailer.
#[unsafe(no_mangle)]
extern "C" fn isv_trailer() -> f64 {
    with(|session| session.trailer().map_or(-1.0, |at| at as f64))
}

/// Reads the index. Input: its whole packet, which begins at byte `at`.
#[unsafe(no_mangle)]
extern "C" fn isv_index(at: f64) -> Status {
    with(|session| {
        let result = session.read_index(at as u64);
        session.report(result)
    })
}

/// Frames in the index.
#[unsafe(no_mangle)]
extern "C" fn isv_index_frames() -> usize {
    with(|session| session.index().offsets.len())
}

/// Byte offset of each frame's packet.
#[unsafe(no_mangle)]
extern "C" fn isv_index_offsets() -> *const f64 {
    with(|session| session.index().offsets.as_ptr())
}

/// 1 for each frame that is a keyframe, 0 for the others.
#[unsafe(no_mangle)]
extern "C" fn isv_index_keyframes() -> *const u8 {
    with(|session| session.index().keyframes.as_ptr())
}

/// Bytes of payload after a packet's header; below 0 if it is none, and the status is the number without its sign. Input: its 24
/// bytes, which begin at byte `at`.
#[unsafe(no_mangle)]
extern "C" fn isv_packet(at: f64) -> f64 {
    with(|session| {
        let result = session.read_packet_header(at as u64).map(|header| header.payload_bytes);
        let bytes = result.as_ref().copied().map(f64::from).ok();
        let status = session.report(result.map(drop));
        bytes.unwrap_or(-f64::from(status as u32))
    })
}

/// Kind of the packet whose header was read last: 0 for a frame, 1 for a keyframe, 2 for an index. Packets to
/// skip, whose type is not known, are 3.
#[unsafe(no_mangle)]
extern "C" fn isv_packet_kind() -> u32 {
    with(|session| match session.packet_header().map(|header| header.kind) {
        Some(PacketKind::Frame { keyframe: true, .. }) => 1,
        Some(PacketKind::Index) => 2,
        Some(PacketKind::Metadata | PacketKind::Skippable { .. }) => 3,
        Some(PacketKind::Frame { .. }) | None => 0,
    })
}

/// Timestamp of the packet, in nanoseconds.
#[unsafe(no_mangle)]
extern "C" fn isv_packet_timestamp() -> f64 {
    with(|session| session.packet_header().map_or(0.0, |header| header.timestamp_ns as f64))
}

/// Decodes a frame. Input: its whole packet, which begins at byte `at`. After an error the decoder waits for a keyframe.
#[unsafe(no_mangle)]
extern "C" fn isv_decode(at: f64) -> Status {
    with(|session| {
        let result = session.decode(at as u64);
        session.report(result)
    })
}

/// Timestamp of the last frame in nanoseconds.
#[unsafe(no_mangle)]
extern "C" fn isv_timestamp() -> f64 {
    frame(|frame| frame.timestamp_ns as f64)
}

/// Whether the last frame is a keyframe.
#[unsafe(no_mangle)]
extern "C" fn isv_keyframe() -> u32 {
    frame(|frame| u32::from(frame.keyframe))
}

/// Blocks of the last frame that are not what was encoded.
#[unsafe(no_mangle)]
extern "C" fn isv_inexact_blocks() -> u32 {
    frame(|frame| frame.inexact_blocks as u32)
}

/// Whether the last frame's packet states a hash.
#[unsafe(no_mangle)]
extern "C" fn isv_states_hash() -> u32 {
    frame(|frame| u32::from(frame.stated_hash.is_some()))
}

/// The hash that it states.
#[unsafe(no_mangle)]
extern "C" fn isv_stated_hash() -> u64 {
    frame(|frame| frame.stated_hash.unwrap_or_default())
}

/// The hash of the last frame's volume, computed now.
#[unsafe(no_mangle)]
extern "C" fn isv_hash() -> u64 {
    with(|session| session.hash().unwrap_or_default())
}

/// Extracts the surface of the last frame, with normals if that is not 0.
#[unsafe(no_mangle)]
extern "C" fn isv_surface(normals: u32) -> Status {
    with(|session| {
        let result = session.extract_surface(normals != 0);
        session.report(result)
    })
}

/// Extracts the parts of the last frame's surface that changed since the last call, with normals if that is not 0, without colours.
#[unsafe(no_mangle)]
extern "C" fn isv_surface_parts(normals: u32) -> Status {
    with(|session| {
        let result = session.extract_parts(normals != 0);
        session.report(result)
    })
}

/// Whether the surface had no parts before: those of earlier frames are gone.
#[unsafe(no_mangle)]
extern "C" fn isv_parts_are_fresh() -> u32 {
    with(|session| u32::from(session.surface().is_fresh))
}

/// Parts that the surface has.
#[unsafe(no_mangle)]
extern "C" fn isv_part_count() -> usize {
    with(|session| session.surface().part_count)
}

/// Parts that changed. Their vertices, normals and triangles follow one another; a part's triangles count from its first vertex.
#[unsafe(no_mangle)]
extern "C" fn isv_changed_part_count() -> usize {
    with(|session| session.surface().changed.len())
}

/// Five numbers of each of these: x, y and z in blocks of its lowest block, its vertices, its triangles.
#[unsafe(no_mangle)]
extern "C" fn isv_changed_parts() -> *const i32 {
    with(|session| session.surface().changed.as_ptr().cast())
}

/// Parts that are gone.
#[unsafe(no_mangle)]
extern "C" fn isv_removed_part_count() -> usize {
    with(|session| session.surface().removed.len())
}

/// x, y and z in blocks of the lowest block of each of these.
#[unsafe(no_mangle)]
extern "C" fn isv_removed_parts() -> *const i32 {
    with(|session| session.surface().removed.as_ptr().cast())
}

/// Blocks of the last frame.
#[unsafe(no_mangle)]
extern "C" fn isv_frame_blocks() -> usize {
    with(|session| session.frame_blocks())
}

/// Positions of the surface's vertices in metres, x, y, z each.
#[unsafe(no_mangle)]
extern "C" fn isv_vertices() -> *const f32 {
    with(|session| session.surface().vertices.as_ptr().cast())
}

/// How many vertices there are.
#[unsafe(no_mangle)]
extern "C" fn isv_vertex_count() -> usize {
    with(|session| session.surface().vertices.len())
}

/// Unit normals, x, y, z each, one a vertex if they were wanted.
#[unsafe(no_mangle)]
extern "C" fn isv_normals() -> *const f32 {
    with(|session| session.surface().normals.as_ptr().cast())
}

/// sRGB colours, red, green, blue of 8 bits each, one a vertex if there is colour.
#[unsafe(no_mangle)]
extern "C" fn isv_colours() -> *const u8 {
    with(|session| session.surface().colours.as_ptr().cast())
}

/// Vertex indices, three a triangle.
#[unsafe(no_mangle)]
extern "C" fn isv_triangles() -> *const u32 {
    with(|session| session.surface().triangles.as_ptr().cast())
}

/// How many triangles there are.
#[unsafe(no_mangle)]
extern "C" fn isv_triangle_count() -> usize {
    with(|session| session.surface().triangles.len())
}

/// Whether the details of the blocks of the next frames are kept, if that is not 0.
#[unsafe(no_mangle)]
extern "C" fn isv_details(wanted: u32) {
    with(|session| session.keep_blocks(wanted != 0));
}

/// Blocks of the last frame whose details were kept.
#[unsafe(no_mangle)]
extern "C" fn isv_block_count() -> usize {
    with(|session| session.blocks().places.len())
}

/// Four numbers of each block: x, y and z in blocks, and what it is. Then 0 is a block that stays as it is, 1
/// one coded without the frame before, and 2 one predicted from it.
#[unsafe(no_mangle)]
extern "C" fn isv_blocks() -> *const i32 {
    with(|session| session.blocks().places.as_ptr().cast())
}

/// Bits that each block takes.
#[unsafe(no_mangle)]
extern "C" fn isv_block_bits() -> *const f32 {
    with(|session| session.blocks().bits.as_ptr())
}

/// Motion of each block in x, y and z, in metres, from where it is predicted to where it is.
#[unsafe(no_mangle)]
extern "C" fn isv_block_motion() -> *const f32 {
    with(|session| session.blocks().motion.as_ptr().cast())
}
