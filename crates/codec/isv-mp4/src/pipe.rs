//! The track of geometry of an MP4 file that comes through a pipe, as the bytes of an `.isv` file.

use crate::geometry::configuration;
use crate::reader::{OpenTrack, is_mp4, read_fragment, read_header, read_movie, read_table};
use crate::stream::index_bytes;
use crate::{Mp4Error, Sample, TrackKind};
use isv_format::{IndexEntry, StreamHeader, StreamIndex};
use std::collections::VecDeque;
use std::io::{self, Chain, Cursor, Read};

/// Bytes that tell an MP4 file.
const SNIFFED: u64 = 8;

/// A stream that lies in a fragmented MP4 file, read as it comes. The samples of a fragment lie behind its `moof`.
pub struct GeometryPipe<R> {
    source: R,
    /// Bytes of the file that were read.
    at: u64,
    /// End of the box that the next bytes are in.
    box_end: u64,
    tracks: Option<Vec<OpenTrack>>,
    /// Number of the track of geometry.
    track: usize,
    /// Samples that are still to come.
    samples: VecDeque<Sample>,
    /// End of the sample that the next bytes are in, in the file.
    sample_end: u64,
    /// Bytes of the stream that are no sample's.
    ready: Cursor<Vec<u8>>,
    index: StreamIndex,
    /// Bytes of the stream up to the end of the last sample that was begun.
    length: u64,
    ended: bool,
}

/// Bytes of a stream, whether they come as such or in an MP4 file. None is read before the first is asked for.
pub struct Unwrapped<R>(Form<R>);

enum Form<R> {
    /// Nothing was read.
    Unknown(R),
    Plain(Begun<R>),
    Mp4(Box<GeometryPipe<Begun<R>>>),
    /// The source failed.
    Failed,
}

/// A source of which some bytes were read.
type Begun<R> = Chain<Cursor<Vec<u8>>, R>;

impl<R: Read> Unwrapped<R> {
    /// Reads from a source.
    pub fn new(source: R) -> Self {
        Self(Form::Unknown(source))
    }

    /// Tells by its first bytes what a source holds.
    fn open(mut source: R) -> io::Result<Form<R>> {
        let mut begin = Vec::new();
        source.by_ref().take(SNIFFED).read_to_end(&mut begin)?;
        let is_mp4 = is_mp4(&begin);
        let whole = Cursor::new(begin).chain(source);
        Ok(if is_mp4 { Form::Mp4(Box::new(GeometryPipe::new(whole))) } else { Form::Plain(whole) })
    }
}

impl<R: Read> Read for Unwrapped<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            match &mut self.0 {
                Form::Unknown(_) => {
                    let Form::Unknown(source) = std::mem::replace(&mut self.0, Form::Failed) else {
                        continue;
                    };
                    self.0 = Self::open(source)?;
                }
                Form::Plain(source) => return source.read(buffer),
                Form::Mp4(source) => return source.read(buffer),
                Form::Failed => return Err(io::ErrorKind::BrokenPipe.into()),
            }
        }
    }
}

impl<R: Read> GeometryPipe<R> {
    /// Reads from a source. No byte is read before the first is asked for.
    pub fn new(source: R) -> Self {
        Self {
            source,
            at: 0,
            box_end: 0,
            tracks: None,
            track: 0,
            samples: VecDeque::new(),
            sample_end: 0,
            ready: Cursor::new(Vec::new()),
            index: StreamIndex::default(),
            length: 0,
            ended: false,
        }
    }

    /// Goes on to the next bytes of the stream, or to its end.
    fn advance(&mut self) -> Result<(), Mp4Error> {
        if let Some(sample) = self.samples.front().copied()
            && sample.at < self.box_end
        {
            if sample.at < self.at {
                return Err(Mp4Error::malformed(
                    sample.at,
                    "a sample of geometry is not behind the one before",
                ));
            }
            self.skip_to(sample.at)?;
            self.samples.pop_front();
            self.sample_end = sample.at.saturating_add(sample.bytes.into());
            self.index.frames.push(IndexEntry { at: self.length, keyframe: sample.sync });
            self.length += u64::from(sample.bytes);
            return Ok(());
        }
        self.skip_to(self.box_end)?;
        let Some((kind, header_bytes, size)) = read_header(&mut self.source, self.at, u64::MAX)? else {
            return self.end();
        };
        if self.at == 0 && kind != *b"ftyp" {
            return Err(Mp4Error::NotMp4);
        }
        let begin = self.at;
        self.at += header_bytes;
        self.box_end = begin.saturating_add(size);
        match &kind {
            b"moov" if self.tracks.is_none() => {
                let Some(body) = self.table()? else { return self.cut() };
                let tracks = read_movie(&body, begin)?;
                let is_geometry = |open: &OpenTrack| open.track.description.kind == TrackKind::Geometry;
                self.track = tracks.iter().position(is_geometry).ok_or(Mp4Error::NoGeometry)?;
                let geometry = &tracks[self.track].track;
                if !geometry.samples.is_empty() {
                    let what = "an MP4 file that is not fragmented cannot be read through a pipe";
                    return Err(Mp4Error::Unsupported(what.to_owned()));
                }
                let configuration = configuration(&geometry.description.sample_entry)?.to_vec();
                if configuration.len() < StreamHeader::BYTES {
                    return Err(Mp4Error::malformed(begin, "the box isvC is shorter than a stream header"));
                }
                self.length = configuration.len() as u64;
                self.ready = Cursor::new(configuration);
                self.tracks = Some(tracks);
            }
            b"moof" => {
                let Some(body) = self.table()? else { return self.cut() };
                let tracks = self.tracks.as_mut().ok_or(Mp4Error::NoMovie)?;
                read_fragment(tracks, &body, begin, self.box_end)?;
                // What is listed is not needed again.
                for (track, open) in tracks.iter_mut().enumerate() {
                    let samples = std::mem::take(&mut open.track.samples);
                    if track == self.track {
                        self.samples.extend(samples);
                    }
                }
            }
            // The last box of a fragmented file: nobody needs to wait for the end of the bytes.
            b"mfra" => {
                self.skip_to(self.box_end)?;
                return self.end();
            }
            _ => {}
        }
        Ok(())
    }

    /// The body of the box, a table; `None` if the bytes end inside.
    fn table(&mut self) -> Result<Option<Vec<u8>>, Mp4Error> {
        let body = read_table(&mut self.source, self.box_end - self.at, true)?;
        self.at = self.box_end;
        Ok(body)
    }

    /// Passes over bytes up to a place in the file, or to the end of all bytes.
    fn skip_to(&mut self, to: u64) -> Result<(), Mp4Error> {
        let skipped = to.saturating_sub(self.at);
        let found = io::copy(&mut self.source.by_ref().take(skipped), &mut io::sink())?;
        self.at += found;
        Ok(())
    }

    /// The file has ended. It is whole if no sample lacks.
    fn end(&mut self) -> Result<(), Mp4Error> {
        self.ended = true;
        if self.tracks.is_none() {
            return Err(if self.at == 0 { Mp4Error::NotMp4 } else { Mp4Error::NoMovie });
        }
        if self.at == self.box_end && self.samples.is_empty() {
            self.ready = Cursor::new(index_bytes(&self.index, self.length));
        }
        Ok(())
    }

    fn cut(&mut self) -> Result<(), Mp4Error> {
        self.ended = true;
        Ok(())
    }
}

impl<R: Read> Read for GeometryPipe<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let read = self.ready.read(buffer)?;
            if read > 0 || buffer.is_empty() {
                return Ok(read);
            }
            if self.at < self.sample_end {
                let length = (self.sample_end - self.at).min(buffer.len() as u64) as usize;
                let read = self.source.read(&mut buffer[..length])?;
                self.at += read as u64;
                self.ended |= read == 0;
                if read > 0 {
                    return Ok(read);
                }
            }
            if self.ended {
                return Ok(0);
            }
            self.advance().map_err(|error| match error {
                Mp4Error::Io(error) => error,
                other => io::Error::new(io::ErrorKind::InvalidData, other),
            })?;
        }
    }
}
