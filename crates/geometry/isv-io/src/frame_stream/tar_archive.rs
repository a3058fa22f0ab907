//! The files of a tar archive, in order: IEEE Std 1003.1, "ustar Interchange Format" and "pax Interchange Format", and
//! GNU's long names. Fields of a header are read by the crate `tar`; its own reader of archives can only be borrowed from.

use super::{FrameStreamError, MAX_FRAME_BYTES};
use crate::Format;
use std::io::{self, Read};
use std::path::PathBuf;
use tar::{EntryType, Header, PaxExtensions};

const BLOCK_BYTES: u64 = 512;

/// Most bytes of an entry that only describes the next one: a name, or pax records.
const MAX_DESCRIPTION_BYTES: u64 = 1 << 20;

pub(super) struct TarArchive<R> {
    reader: R,
    /// The block of the last header, for messages.
    header: u64,
    /// The block that comes next.
    next: u64,
    /// The format of the frames so far.
    format: Option<Format>,
}

/// What entries before a file said of it, instead of its header.
#[derive(Default)]
struct Described {
    name: Option<Vec<u8>>,
    size: Option<u64>,
}

impl<R: Read> TarArchive<R> {
    pub(super) fn new(reader: R) -> Self {
        Self { reader, header: 0, next: 0, format: None }
    }

    /// The next frame's name and bytes; none at the end of the archive.
    pub(super) fn next_file(&mut self) -> Result<Option<(PathBuf, Vec<u8>)>, FrameStreamError> {
        let mut described = Described::default();
        while let Some(header) = self.next_header()? {
            let size = header.entry_size().map_err(|_| self.damaged())?;
            match header.entry_type() {
                EntryType::XHeader => self.read_pax(size, &mut described)?,
                EntryType::GNULongName => described.name = Some(self.read_description(size)?),
                // Names of link targets, and records of the whole archive.
                EntryType::GNULongLink | EntryType::XGlobalHeader => self.skip(size)?,
                // A file with holes has parts in places that only its own kind of header tells.
                EntryType::GNUSparse => return Err(self.damaged()),
                kind => {
                    let Described { name, size: described_size } = std::mem::take(&mut described);
                    let name = name.unwrap_or_else(|| header.path_bytes().into_owned());
                    let path = PathBuf::from(String::from_utf8_lossy(&name).into_owned());
                    let size = described_size.unwrap_or(size);
                    let is_file = matches!(kind, EntryType::Regular | EntryType::Continuous);
                    match frame_format(&path).filter(|_| is_file) {
                        Some(format) => return self.read_frame(path, format, size).map(Some),
                        None => self.skip(size)?,
                    }
                }
            }
        }
        if self.format.is_none() { Err(FrameStreamError::NoFrames) } else { Ok(None) }
    }

    /// The next header; none at the block of zeros that ends the archive.
    fn next_header(&mut self) -> Result<Option<Header>, FrameStreamError> {
        let mut header = Header::new_old();
        (self.header, self.next) = (self.next, self.next + 1);
        self.reader.read_exact(header.as_mut_bytes()).map_err(|cause| match cause.kind() {
            io::ErrorKind::UnexpectedEof => FrameStreamError::CutArchive,
            _ => cause.into(),
        })?;
        if header.as_bytes().iter().all(|byte| *byte == 0) {
            return Ok(None);
        }
        // The sum of all bytes, those of the field that holds it taken as blanks.
        let (before, rest) = header.as_bytes().split_at(148);
        let sum: u32 = before.iter().chain(&rest[8..]).map(|byte| u32::from(*byte)).sum();
        if header.cksum().ok() != Some(sum + 8 * u32::from(b' ')) {
            return Err(self.damaged());
        }
        Ok(Some(header))
    }

    fn read_frame(
        &mut self,
        path: PathBuf,
        format: Format,
        size: u64,
    ) -> Result<(PathBuf, Vec<u8>), FrameStreamError> {
        let before = *self.format.get_or_insert(format);
        if before != format {
            return Err(FrameStreamError::MixedFormats { path, before });
        }
        if size > MAX_FRAME_BYTES {
            return Err(FrameStreamError::TooLarge { path });
        }
        let bytes = self.read_data(size)?;
        match size - bytes.len() as u64 {
            0 => Ok((path, bytes)),
            missing => Err(FrameStreamError::CutFrame { path, missing }),
        }
    }

    /// An entry's bytes and what fills its last block; fewer if the archive ends before.
    fn read_data(&mut self, size: u64) -> Result<Vec<u8>, FrameStreamError> {
        let mut bytes = Vec::new();
        self.reader.by_ref().take(size).read_to_end(&mut bytes)?;
        io::copy(&mut self.reader.by_ref().take(size.next_multiple_of(BLOCK_BYTES) - size), &mut io::sink())?;
        self.next += size.div_ceil(BLOCK_BYTES);
        Ok(bytes)
    }

    fn read_description(&mut self, size: u64) -> Result<Vec<u8>, FrameStreamError> {
        if size > MAX_DESCRIPTION_BYTES {
            return Err(self.damaged());
        }
        let mut text = self.read_data(size)?;
        if (text.len() as u64) < size {
            return Err(FrameStreamError::CutArchive);
        }
        // GNU ends names with a zero.
        text.truncate(text.iter().position(|byte| *byte == 0).unwrap_or(text.len()));
        Ok(text)
    }

    fn read_pax(&mut self, size: u64, described: &mut Described) -> Result<(), FrameStreamError> {
        let records = self.read_description(size)?;
        for record in PaxExtensions::new(&records) {
            let record = record.map_err(|_| self.damaged())?;
            match record.key_bytes() {
                b"path" => described.name = Some(record.value_bytes().to_vec()),
                b"size" => {
                    let size = record.value().ok().and_then(|text| text.parse().ok());
                    described.size = Some(size.ok_or_else(|| self.damaged())?);
                }
                key if key.starts_with(b"GNU.sparse.") => return Err(self.damaged()),
                _ => {}
            }
        }
        Ok(())
    }

    fn skip(&mut self, size: u64) -> Result<(), FrameStreamError> {
        let blocks = size.div_ceil(BLOCK_BYTES);
        let padded = blocks.checked_mul(BLOCK_BYTES).ok_or_else(|| self.damaged())?;
        let skipped = io::copy(&mut self.reader.by_ref().take(padded), &mut io::sink())?;
        self.next += blocks;
        if skipped < padded { Err(FrameStreamError::CutArchive) } else { Ok(()) }
    }

    fn damaged(&self) -> FrameStreamError {
        FrameStreamError::DamagedArchive { block: self.header }
    }
}

/// The format of a frame; none if the name is not that of one, or hidden.
fn frame_format(path: &std::path::Path) -> Option<Format> {
    let hidden = path.file_name()?.as_encoded_bytes().starts_with(b".");
    Format::of_path(path).filter(|_| !hidden)
}
