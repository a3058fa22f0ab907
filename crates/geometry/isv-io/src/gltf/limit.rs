//! How much memory a file may ask for.

use super::fault::GltfFault;
use std::cell::Cell;

/// Numbers that every file may ask for, so that small files may repeat a shape often.
const LEAST_LIMIT: u64 = 1 << 24;

/// Decompressed bytes that every file may ask for, so that small files may hold regular shapes.
const LEAST_DECOMPRESSED: u64 = 1 << 24;

/// Decompressed bytes for each byte of a file. Draco makes a byte of 20 to 40 at the settings in use.
const MOST_RATIO: u64 = 64;

/// Counts numbers before memory is taken for them. A file of `n` bytes may ask for 4 `n`, and for
/// [`LEAST_LIMIT`] if that is more. Its own bytes hold at most `n`, but objects may share them, and an
/// accessor may be zeros without any bytes. Never more than 2^32, so that vertices can be counted in 32 bits.
///
/// Compressed data may become [`MOST_RATIO`] times the bytes of the file, or [`LEAST_DECOMPRESSED`]; each of these bytes allows
/// two more numbers.
#[derive(Debug)]
pub(super) struct Limit {
    limit: Cell<u64>,
    taken: Cell<u64>,
    most_decompressed: u64,
    decompressed: Cell<u64>,
}

impl Limit {
    /// The limit of a file of so many bytes. With colours a file may ask for twice as much: triangles have texture coordinates then.
    pub(super) fn for_bytes(bytes: usize, colours: bool) -> Self {
        let bytes = bytes as u64;
        let numbers = bytes.saturating_mul(if colours { 8 } else { 4 });
        Self {
            limit: Cell::new(numbers.clamp(LEAST_LIMIT, u32::MAX.into())),
            taken: Cell::new(0),
            most_decompressed: bytes.saturating_mul(MOST_RATIO).max(LEAST_DECOMPRESSED),
            decompressed: Cell::new(0),
        }
    }

    /// Asks for `count` elements of `size` numbers.
    pub(super) fn take(&self, count: usize, size: usize) -> Result<(), GltfFault> {
        let wanted = self.taken.get().saturating_add((count as u64).saturating_mul(size as u64));
        if wanted > self.limit.get() {
            return Err(GltfFault::TooLarge { wanted, limit: self.limit.get() });
        }
        self.taken.set(wanted);
        Ok(())
    }

    /// Asks for `count` elements of `size` bytes that come out of compressed data.
    pub(super) fn take_decompressed(&self, count: usize, size: usize) -> Result<(), GltfFault> {
        let bytes = (count as u64).saturating_mul(size as u64);
        let wanted = self.decompressed.get().saturating_add(bytes);
        if wanted > self.most_decompressed {
            return Err(GltfFault::Decompressed { wanted, limit: self.most_decompressed });
        }
        self.decompressed.set(wanted);
        self.limit.set(self.limit.get().saturating_add(2 * bytes).min(u32::MAX.into()));
        Ok(())
    }

    /// Bytes that may still come out of compressed data.
    pub(super) fn decompressed_left(&self) -> u64 {
        self.most_decompressed - self.decompressed.get()
    }
}
