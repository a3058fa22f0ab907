//! The track of geometry of an MP4 file as the bytes of an `.isv` file.

use crate::geometry::configuration;
use crate::{Mp4Error, Mp4File, Sample, TrackKind};
use isv_format::{IndexEntry, PacketHeader, PacketKind, StreamHeader, StreamIndex};
use std::io::{self, Read, Seek, SeekFrom};

/// A stream that lies in an MP4 file, to be read and sought in like an `.isv` file.
///
/// The bytes are those that [`crate::GeometrySink`] was given: header, packets, index and trailer. A file that was cut off ends
/// without index.
pub struct GeometryStream<S> {
    file: Mp4File<S>,
    track: usize,
    /// Bytes before the first frame.
    begin: Vec<u8>,
    /// Offset of each sample in the stream, and the end of the last one.
    offsets: Vec<u64>,
    /// Index and trailer.
    end: Vec<u8>,
    position: u64,
}

impl<S: Read + Seek> GeometryStream<S> {
    /// Reads the tables of a file.
    ///
    /// # Errors
    /// [`Mp4Error`]: no MP4 file with one track of geometry, and samples that overlap.
    pub fn open(source: S) -> Result<Self, Mp4Error> {
        let file = Mp4File::open(source)?;
        let track = file.track_of(TrackKind::Geometry)?;
        let geometry = &file.tracks()[track];
        let begin = configuration(&geometry.description.sample_entry)?.to_vec();
        let Some(header) = begin.first_chunk::<{ StreamHeader::BYTES }>() else {
            return Err(Mp4Error::malformed(0, "the box isvC is shorter than a stream header"));
        };
        StreamHeader::parse(header)?;
        let (offsets, index) = layout(&geometry.samples, begin.len() as u64)?;
        let at = *offsets.last().expect("there is one more offset than samples");
        let end = if file.is_whole() { index_bytes(&index, at) } else { Vec::new() };
        Ok(Self { file, track, begin, offsets, end, position: 0 })
    }

    /// Length of the stream (bytes).
    #[must_use]
    pub fn length(&self) -> u64 {
        self.samples_end() + self.end.len() as u64
    }

    /// The file.
    #[must_use]
    pub fn file(&self) -> &Mp4File<S> {
        &self.file
    }

    /// The file, without the place in it.
    #[must_use]
    pub fn into_file(self) -> Mp4File<S> {
        self.file
    }

    fn samples_end(&self) -> u64 {
        self.offsets[self.offsets.len() - 1]
    }

    /// Reads inside the sample that the position is in.
    fn read_sample(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let sample = self.offsets.partition_point(|offset| *offset <= self.position) - 1;
        let found = self.file.tracks()[self.track].samples[sample];
        let inside = self.position - self.offsets[sample];
        let length = buffer.len().min((u64::from(found.bytes) - inside) as usize);
        let source = self.file.source_mut();
        // A buffered source keeps its buffer where it is already there.
        let here = source.stream_position()?;
        if here != found.at + inside {
            source.seek(SeekFrom::Start(found.at + inside))?;
        }
        source.read(&mut buffer[..length])
    }
}

/// Offset of each sample in the stream, with the end of the last one, and the index of the stream.
fn layout(samples: &[Sample], begin: u64) -> Result<(Vec<u64>, StreamIndex), Mp4Error> {
    let (mut at, mut file_end) = (begin, 0);
    let (mut offsets, mut index) = (Vec::with_capacity(samples.len() + 1), StreamIndex::default());
    for sample in samples {
        // Samples that lie over each other would make a large stream of a small file.
        if sample.at < file_end || (sample.bytes as usize) < PacketHeader::BYTES {
            return Err(Mp4Error::malformed(sample.at, "a sample of geometry is no packet of its own"));
        }
        file_end = sample.at + u64::from(sample.bytes);
        offsets.push(at);
        index.frames.push(IndexEntry { at, keyframe: sample.sync });
        at += u64::from(sample.bytes);
    }
    offsets.push(at);
    Ok((offsets, index))
}

/// The index packet and the trailer of a stream whose frames end at byte `at`.
pub(crate) fn index_bytes(index: &StreamIndex, at: u64) -> Vec<u8> {
    let payload = index.to_payload();
    let header = PacketHeader::seal(PacketKind::Index, 0, 0, &payload);
    [&header[..], &payload, &StreamIndex::trailer(at)].concat()
}

impl<S: Read + Seek> Read for GeometryStream<S> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let at = self.position;
        let samples_end = self.samples_end();
        let read = if buffer.is_empty() {
            0
        } else if at < self.begin.len() as u64 {
            (&self.begin[at as usize..]).read(buffer)?
        } else if at < samples_end {
            self.read_sample(buffer)?
        } else {
            let end = usize::try_from(at - samples_end).unwrap_or(usize::MAX);
            self.end.get(end..).unwrap_or_default().read(buffer)?
        };
        self.position += read as u64;
        Ok(read)
    }
}

impl<S: Read + Seek> Seek for GeometryStream<S> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let position = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::Current(by) => self.position.checked_add_signed(by),
            SeekFrom::End(by) => self.length().checked_add_signed(by),
        };
        self.position = position.ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.position)
    }
}
