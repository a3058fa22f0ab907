//! Bytes that can be read a second time.

use std::io::{self, Read};

/// Most bytes that are asked of the source where it may give more than are needed.
const CHUNK_BYTES: usize = 1 << 16;

/// A source that keeps what was read since it was last told to forget.
#[derive(Debug)]
pub(super) struct Replay<R> {
    source: R,
    /// Bytes that were read, and room behind them: it is cleared once, not for each read, as many reads give few bytes.
    buffer: Vec<u8>,
    /// Where in `buffer` the bytes begin that may be asked for again.
    start: usize,
    /// Where in `buffer` the next byte to read is.
    next: usize,
    /// Where in `buffer` the room begins.
    end: usize,
}

impl<R: Read> Replay<R> {
    pub(super) fn new(source: R) -> Self {
        Self { source, buffer: Vec::new(), start: 0, next: 0, end: 0 }
    }

    /// What was read since [`Self::forget`].
    pub(super) fn read_so_far(&self) -> &[u8] {
        &self.buffer[self.start..self.next]
    }

    /// Gives up what was read; returns how many bytes that were.
    pub(super) fn forget(&mut self) -> usize {
        let forgotten = self.next - self.start;
        self.start = self.next;
        // The rest moves only when it is the smaller part, so that each byte is moved once or so.
        if self.start > self.end / 2 {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            (self.start, self.next) = (0, 0);
        }
        forgotten
    }

    /// Goes back to where it was last told to forget.
    pub(super) fn rewind(&mut self) {
        self.next = self.start;
    }

    /// Passes over bytes that are kept.
    pub(super) fn skip(&mut self, bytes: usize) {
        self.next = self.end.min(self.next + bytes);
    }

    /// The next bytes without reading them: `length`, unless the source ends before.
    pub(super) fn peek(&mut self, length: usize) -> io::Result<&[u8]> {
        while self.end - self.next < length && self.fill(CHUNK_BYTES)? > 0 {}
        let end = self.end.min(self.next + length);
        Ok(&self.buffer[self.next..end])
    }

    /// All that has come and was not read yet.
    pub(super) fn unread(&self) -> &[u8] {
        &self.buffer[self.next..self.end]
    }

    /// Asks the source for some bytes; returns how many came.
    fn fill(&mut self, most: usize) -> io::Result<usize> {
        let room = self.end..self.end + most;
        if self.buffer.len() < room.end {
            self.buffer.resize(room.end, 0);
        }
        let count = read_some(&mut self.source, &mut self.buffer[room])?;
        self.end += count;
        Ok(count)
    }
}

impl<R: Read> Read for Replay<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.next == self.end {
            self.fill(bytes.len().min(CHUNK_BYTES))?;
        }
        let count = bytes.len().min(self.end - self.next);
        bytes[..count].copy_from_slice(&self.buffer[self.next..self.next + count]);
        self.next += count;
        Ok(count)
    }
}

/// Waits through interruptions.
fn read_some(source: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    loop {
        match source.read(buffer) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            read => return read,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_again_until_they_are_forgotten() {
        let mut bytes = Replay::new(&b"abcdefgh"[..]);
        let mut two = [0; 2];
        bytes.read_exact(&mut two).unwrap();
        assert_eq!((&two, bytes.read_so_far()), (b"ab", &b"ab"[..]));
        bytes.rewind();
        assert_eq!(bytes.peek(3).unwrap(), b"abc");
        bytes.skip(1);
        assert_eq!(bytes.forget(), 1);
        bytes.read_exact(&mut two).unwrap();
        assert_eq!(&two, b"bc");
        bytes.rewind();
        assert_eq!(bytes.peek(1).unwrap(), b"b");
        assert_eq!(bytes.unread(), b"bcdefgh");
        assert_eq!(bytes.peek(99).unwrap(), b"bcdefgh");
        bytes.skip(99);
        assert_eq!((bytes.forget(), bytes.peek(1).unwrap()), (7, &b""[..]));
    }
}
