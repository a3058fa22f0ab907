//! How much memory a file may ask for.

use super::fault::GltfFault;
use std::cell::Cell;

/// Numbers that every file may ask for, so that small files may repeat a shape often.
const LEAST_LIMIT: u64 = 1 << 24;

/// Counts numbers before memory is taken for them. A file of `n` bytes may ask for 4 `n`, and for [`LEAST_LIMIT`] if that is
/// more: its own bytes hold at most `n`, but objects may share them, and an accessor may be zeros without any bytes. Never
/// more than 2^32, so that vertices can be counted in 32 bits.
#[derive(Debug)]
pub(super) struct Limit {
    limit: u64,
    taken: Cell<u64>,
}

impl Limit {
    pub(super) fn for_bytes(bytes: usize) -> Self {
        let limit = (bytes as u64).saturating_mul(4).clamp(LEAST_LIMIT, u32::MAX.into());
        Self { limit, taken: Cell::new(0) }
    }

    /// Asks for `count` elements of `size` numbers.
    pub(super) fn take(&self, count: usize, size: usize) -> Result<(), GltfFault> {
        let wanted = self.taken.get().saturating_add((count as u64).saturating_mul(size as u64));
        if wanted > self.limit {
            return Err(GltfFault::TooLarge { wanted, limit: self.limit });
        }
        self.taken.set(wanted);
        Ok(())
    }
}
