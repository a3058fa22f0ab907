//! PLY files one after another. Each says how long it is, but only to who reads all of it.

use super::{FrameStreamError, MAX_FRAME_BYTES};
use crate::linked::Linked;
use crate::text::UTF8_MARK;
use crate::{Colours, Geometry, ply};
use std::io::{self, Read};
use std::path::PathBuf;

/// Bytes read at most before a file is looked for in them.
const MOST_READ: usize = 1 << 16;

pub(super) struct PlyFiles<R> {
    reader: R,
    /// What was read; the next file starts at `start`.
    buffer: Vec<u8>,
    start: usize,
    /// What is known of that file.
    arriving: ply::Arriving,
    /// Whether the reader has no more.
    ended: bool,
    frames: usize,
}

impl<R: Read> PlyFiles<R> {
    pub(super) fn new(reader: R) -> Self {
        Self {
            reader,
            buffer: Vec::new(),
            start: 0,
            arriving: ply::Arriving::default(),
            ended: false,
            frames: 0,
        }
    }

    /// The next frame as it is in its file, as soon as its last byte is there; none at the end.
    pub(super) fn next_frame(
        &mut self,
        colours: Colours,
    ) -> Result<Option<(PathBuf, Geometry)>, FrameStreamError> {
        let path = PathBuf::from(format!("frame_{:06}.ply", self.frames));
        loop {
            self.skip_space();
            let file = &self.buffer[self.start..];
            if file.is_empty() && self.ended {
                return Ok(None);
            }
            let mut linked = Linked::new(None);
            let linked = (colours == Colours::Keep).then_some(&mut linked);
            let parsed = self.arriving.parse(file, self.ended, linked);
            if let Some((geometry, length)) = parsed.map_err(|flaw| flaw.in_file(&path))? {
                self.arriving = ply::Arriving::default();
                self.start += length;
                self.frames += 1;
                return Ok(Some((path, geometry)));
            }
            if file.len() as u64 > MAX_FRAME_BYTES {
                return Err(FrameStreamError::TooLarge { path });
            }
            self.read_more()?;
        }
    }

    /// Passes over white space, and over the byte order mark that a file may start with.
    fn skip_space(&mut self) {
        let file = &self.buffer[self.start..];
        let text = file.trim_ascii_start();
        let text = text.strip_prefix(UTF8_MARK).unwrap_or(text);
        self.start += file.len() - text.len();
    }

    /// Takes what is there, and waits only where nothing is.
    fn read_more(&mut self) -> io::Result<()> {
        self.buffer.drain(..self.start);
        self.start = 0;
        let length = self.buffer.len();
        self.buffer.resize(length + MOST_READ, 0);
        let read = loop {
            match self.reader.read(&mut self.buffer[length..]) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                read => break read,
            }
        };
        self.buffer.truncate(length + *read.as_ref().unwrap_or(&0));
        self.ended = read? == 0;
        Ok(())
    }
}
