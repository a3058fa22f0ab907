//! A decoder with all that it was given and has found.

mod blocks;
mod surface;
#[cfg(test)]
mod tests;

use crate::error::{SessionError, Status};
use isv_decode::colour::ColourFrame;
use isv_decode::{DecodedFrame, Decoder, Limits, volume_hash};
use isv_format::{Packet, PacketHeader, PacketReader, StreamHeader, StreamIndex};
use isv_volume::SparseVolume;
use std::sync::Arc;

pub(crate) use blocks::Blocks;
pub(crate) use surface::Surface;

/// Most voxels in a frame unless the player says otherwise: 131,072 blocks of 8. Memory stays below a gigabyte with them.
const DEFAULT_VOXELS: usize = 1 << 26;
/// No more than this may be allowed: there are 4 GiB of addresses.
const MOST_VOXELS: usize = 1 << 28;
/// Input that may always be given, for headers and indexes.
const LEAST_INPUT: usize = 16 << 20;
/// Bytes of a voxel that was not compressed: no frame needs more.
const BYTES_A_VOXEL: usize = 2;
/// Voxels for each vertex of a surface: a plane through every block of 8 has as many.
const VOXELS_A_VERTEX: usize = 8;

/// A decoder of one stream at a time, its input and its output.
#[derive(Debug)]
pub(crate) struct Session {
    voxels: usize,
    /// Whether a stream may take all of its voxels, however few bytes it has.
    trusted: bool,
    input: Vec<u8>,
    message: String,
    /// Blocks of the frame that was refused because it has too many; 0 after any other call.
    refused_blocks: usize,
    stream: Option<Stream>,
    index: Index,
    packet: Option<PacketHeader>,
    surface: Surface,
    wants_colour: bool,
    wants_blocks: bool,
    blocks: Blocks,
}

/// A stream that was opened.
#[derive(Debug)]
struct Stream {
    header: StreamHeader,
    decoder: Decoder,
    /// Whether it has colour that is wanted.
    has_colour: bool,
    /// What the last frame says beside its volume; nothing after an error.
    frame: Option<Frame>,
}

/// What is said of a decoded frame beside its volume.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub(crate) timestamp_ns: u64,
    pub(crate) keyframe: bool,
    pub(crate) stated_hash: Option<u64>,
    pub(crate) inexact_blocks: usize,
}

/// Places of the frames of the stream, as the player takes them.
#[derive(Debug, Default)]
pub(crate) struct Index {
    /// Byte offset of each frame's packet.
    pub(crate) offsets: Vec<f64>,
    /// 1 for each keyframe, 0 for the others.
    pub(crate) keyframes: Vec<u8>,
}

impl Default for Session {
    fn default() -> Self {
        Self {
            voxels: DEFAULT_VOXELS,
            trusted: false,
            input: Vec::new(),
            message: String::new(),
            refused_blocks: 0,
            stream: None,
            index: Index::default(),
            packet: None,
            surface: Surface::default(),
            wants_colour: true,
            wants_blocks: false,
            blocks: Blocks::default(),
        }
    }
}

impl Session {
    /// Limits the voxels of a frame, blocks times voxels a block, from the next [`Self::open`] on. From now
    /// on it limits, in proportion, the vertices of a surface and the bytes of input. A `trusted` stream may
    /// take all of them, however few bytes it has.
    pub(crate) fn limit(&mut self, voxels: usize, trusted: bool) {
        self.voxels = voxels.min(MOST_VOXELS);
        self.trusted = trusted;
    }

    /// Room for input, which the next call reads; nothing if it is too much.
    pub(crate) fn input(&mut self, bytes: usize) -> Result<&mut [u8], SessionError> {
        let limit = (BYTES_A_VOXEL * self.voxels).max(LEAST_INPUT);
        let more = bytes.saturating_sub(self.input.len());
        if bytes > limit || self.input.try_reserve_exact(more).is_err() {
            self.input.clear();
            return Err(SessionError::Input { bytes, limit });
        }
        self.input.resize(bytes, 0);
        Ok(&mut self.input)
    }

    /// Begins a stream. Input: its header.
    pub(crate) fn open(&mut self) -> Result<(), SessionError> {
        self.stream = None;
        self.surface = Surface::default();
        self.blocks.clear();
        let header = StreamHeader::parse(self.input_as("a stream header")?)?;
        let voxels_per_byte = if self.trusted { usize::MAX } else { Limits::VOXELS_PER_BYTE };
        let limits = Limits { frame_voxels: self.voxels, voxels_per_byte };
        let mut decoder = Decoder::new(&header, limits);
        decoder.recover(true);
        let has_colour = self.wants_colour && header.colour_layers.is_some();
        decoder.keep_colour(has_colour);
        self.stream = Some(Stream { header, decoder, has_colour, frame: None });
        Ok(())
    }

    /// The header of the stream.
    pub(crate) fn header(&self) -> Option<&StreamHeader> {
        self.stream.as_ref().map(|stream| &stream.header)
    }

    /// Whether the stream has colour that is wanted: then vertices of surfaces have colours.
    pub(crate) fn has_colour(&self) -> bool {
        self.stream.as_ref().is_some_and(|stream| stream.has_colour)
    }

    /// The header of the stream, without which packets have no meaning.
    fn stream_header(&self) -> Result<&StreamHeader, SessionError> {
        self.header().ok_or(SessionError::Order("a packet before the stream's header"))
    }

    /// Beginning of the index packet, if the stream ends with a trailer. Input: its last 16 bytes.
    pub(crate) fn trailer(&self) -> Option<u64> {
        StreamIndex::parse_trailer(self.input_as("a trailer").ok()?)
    }

    /// Reads the index. Input: its packet, which begins at byte `at`.
    pub(crate) fn read_index(&mut self, at: u64) -> Result<(), SessionError> {
        self.index = Index::default();
        let packet = self.whole_packet(at)?;
        if packet.header.kind != isv_format::PacketKind::Index {
            return Err(SessionError::NoIndex { at });
        }
        let index = StreamIndex::parse(&packet.payload, at)?;
        self.index.offsets = index.frames.iter().map(|frame| frame.at as f64).collect();
        self.index.keyframes = index.frames.iter().map(|frame| u8::from(frame.keyframe)).collect();
        Ok(())
    }

    /// The index that was read last.
    pub(crate) fn index(&self) -> &Index {
        &self.index
    }

    /// Reads the header of a packet that begins at byte `at`. Input: its 24 bytes.
    pub(crate) fn read_packet_header(&mut self, at: u64) -> Result<&PacketHeader, SessionError> {
        self.packet = None;
        let header = PacketHeader::parse(self.input_as("a packet header")?, at, self.stream_header()?)?;
        Ok(self.packet.insert(header))
    }

    /// The packet header that was read last.
    pub(crate) fn packet_header(&self) -> Option<&PacketHeader> {
        self.packet.as_ref()
    }

    /// Decodes a frame. Input: its packet, which begins at byte `at`. After an error the decoder waits for a keyframe, or for a resilient frame.
    pub(crate) fn decode(&mut self, at: u64) -> Result<(), SessionError> {
        let packet = self.whole_packet(at);
        let stream = self.stream.as_mut().ok_or(SessionError::Order("a frame before the stream's header"))?;
        stream.frame = None;
        self.blocks.clear();
        let packet = packet?;
        stream.decoder.keep_details(self.wants_blocks);
        let decoded = stream.decoder.decode(&packet)?;
        let DecodedFrame { timestamp_ns, keyframe, stated_hash, inexact_blocks, .. } = decoded;
        stream.frame = Some(Frame { timestamp_ns, keyframe, stated_hash, inexact_blocks });
        self.blocks.set(stream.decoder.details(), stream.header.grid.voxel_size.metres());
        Ok(())
    }

    /// Sets whether colour is decoded, from the next [`Self::open`] on. It is, unless this says otherwise.
    pub(crate) fn keep_colour(&mut self, wanted: bool) {
        self.wants_colour = wanted;
    }

    /// Whether to keep how the blocks of the next frames are coded.
    pub(crate) fn keep_blocks(&mut self, wanted: bool) {
        self.wants_blocks = wanted;
    }

    /// How the blocks of the last frame are coded, if that was wanted.
    pub(crate) fn blocks(&self) -> &Blocks {
        &self.blocks
    }

    /// What the last frame says beside its volume; nothing before the first and after an error.
    pub(crate) fn frame(&self) -> Option<Frame> {
        self.stream.as_ref()?.frame
    }

    /// The hash of the last frame's volume.
    pub(crate) fn hash(&self) -> Option<u64> {
        self.volume().map(volume_hash)
    }

    /// Extracts the surface of the last frame, with the colours of its vertices if the stream has colour. A frame whose colour is missing
    /// is grey.
    pub(crate) fn extract_surface(&mut self, normals: bool) -> Result<(), SessionError> {
        // Named field by field, so that the surface can be written while the volume is read.
        let stream = self.stream.as_ref().filter(|stream| stream.frame.is_some());
        let volume = stream.and_then(|stream| stream.decoder.volume());
        let volume = volume.ok_or(SessionError::Order("a surface before a frame was decoded"))?;
        let grey = ColourFrame::default();
        let painted = stream.filter(|stream| stream.has_colour);
        let colour = painted.map(|stream| stream.decoder.colour().map_or(&grey, Arc::as_ref));
        Ok(self.surface.extract(volume, colour, normals, self.voxels / VOXELS_A_VERTEX)?)
    }

    /// Extracts the parts of the last frame's surface that changed since the last call, without colours. A stream that is opened begins
    /// without parts.
    pub(crate) fn extract_parts(&mut self, normals: bool) -> Result<(), SessionError> {
        let stream = self.stream.as_ref().filter(|stream| stream.frame.is_some());
        let volume = stream.and_then(|stream| stream.decoder.volume());
        let volume = volume.ok_or(SessionError::Order("a surface before a frame was decoded"))?;
        Ok(self.surface.extract_parts(volume, normals, self.voxels / VOXELS_A_VERTEX)?)
    }

    /// Blocks of the last frame.
    pub(crate) fn frame_blocks(&self) -> usize {
        self.volume().map_or(0, |volume| volume.coords().len())
    }

    /// The surface that was extracted last.
    pub(crate) fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Keeps the words of an error, and says what it means.
    pub(crate) fn report(&mut self, result: Result<(), SessionError>) -> Status {
        self.message.clear();
        self.refused_blocks = 0;
        match result {
            Ok(()) => Status::Done,
            Err(error) => {
                self.message = error.to_string();
                self.refused_blocks = error.refused_blocks();
                error.status()
            }
        }
    }

    /// The words of the last error; empty where the last call had none.
    pub(crate) fn message(&self) -> &str {
        &self.message
    }

    /// Blocks of the frame that the last call refused because it has too many; 0 after any other call.
    pub(crate) fn refused_blocks(&self) -> usize {
        self.refused_blocks
    }

    fn volume(&self) -> Option<&SparseVolume> {
        self.stream.as_ref().filter(|stream| stream.frame.is_some())?.decoder.volume()
    }

    /// The input, which should be as long as `what` is.
    fn input_as<const BYTES: usize>(&self, what: &'static str) -> Result<&[u8; BYTES], SessionError> {
        let found = self.input.len();
        self.input[..].try_into().map_err(|_| SessionError::Length { what, expected: BYTES, found })
    }

    /// The input as a packet that begins at byte `at`, its checksum verified.
    fn whole_packet(&self, at: u64) -> Result<Packet, SessionError> {
        let found = self.input.len();
        let packet = PacketReader::at_packet(&self.input[..], at, self.stream_header()?).next_packet()?;
        let expected = packet.as_ref().map_or(PacketHeader::BYTES, Packet::total_bytes);
        packet.filter(|_| found == expected).ok_or(SessionError::Length { what: "a packet", expected, found })
    }
}
