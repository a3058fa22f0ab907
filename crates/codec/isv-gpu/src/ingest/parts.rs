//! Blocks in parts whose triangles fit a buffer.

use super::MASK_WORDS;
use crate::GpuError;
use std::ops::Range;

/// Triangles of a block: a workgroup that has more of them to look at keeps a driver waiting that resets devices for it.
const MOST_TRIANGLES: u32 = 1 << 20;

/// Parts of a mesh: each goes through all its triangles.
const MOST_PARTS: usize = 64;

/// Some blocks in a row, and where the lists of their triangles lie.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Part {
    pub(super) blocks: Range<usize>,
    /// Beginning of each block's list, and the end of the last one's.
    pub(super) starts: Vec<u32>,
}

impl Part {
    /// How long all lists are together.
    pub(super) fn triangles(&self) -> u64 {
        u64::from(*self.starts.last().expect("starts have an end"))
    }
}

/// Parts of blocks with so many triangles each, as large as buffers of so many bytes allow.
///
/// # Errors
/// [`GpuError::TooLarge`] if a single block has more triangles than that, [`GpuError::Unsupported`] if it has more than a million, or
/// there would be too many parts.
pub(super) fn parts(counts: &[u32], binding_bytes: u64) -> Result<Vec<Part>, GpuError> {
    let most_triangles = (binding_bytes / 4).min(u64::from(u32::MAX));
    let most_blocks = (binding_bytes / (4 * MASK_WORDS as u64)) as usize;
    let mut parts: Vec<Part> = Vec::new();
    for (block, count) in counts.iter().enumerate() {
        if *count > MOST_TRIANGLES {
            return Err(GpuError::Unsupported("a block of more than a million triangles"));
        }
        if u64::from(*count) > most_triangles {
            let (bytes, limit) = (4 * u64::from(*count), binding_bytes);
            return Err(GpuError::TooLarge { what: "the triangles of a block", bytes, limit });
        }
        let full = |part: &Part| {
            part.triangles() + u64::from(*count) > most_triangles || part.blocks.len() >= most_blocks
        };
        if parts.last().is_none_or(full) {
            if parts.len() == MOST_PARTS {
                return Err(GpuError::Unsupported("a mesh so many of whose triangles are near each block"));
            }
            parts.push(Part { blocks: block..block, starts: vec![0] });
        }
        let part = parts.last_mut().expect("there is a part");
        part.blocks.end = block + 1;
        part.starts.push((part.triangles() + u64::from(*count)) as u32);
    }
    Ok(parts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_fit_buffers() {
        // 256 triangles or 16 blocks.
        let counts: Vec<u32> = (0..100).map(|i| if i % 7 == 0 { 200 } else { i % 5 }).collect();
        let parts = parts(&counts, 1024).unwrap();
        assert!(parts.len() > 100 / 16);
        let mut next = 0;
        for part in &parts {
            assert_eq!(part.blocks.start, next);
            next = part.blocks.end;
            assert!(part.triangles() <= 256 && part.blocks.len() <= 16 && !part.blocks.is_empty());
            let lengths: Vec<u32> = part.starts.windows(2).map(|pair| pair[1] - pair[0]).collect();
            assert_eq!(lengths, counts[part.blocks.clone()]);
        }
        assert_eq!(next, 100);
    }

    #[test]
    fn a_block_with_too_many_triangles_is_an_error() {
        assert!(matches!(parts(&[3, 257], 1024), Err(GpuError::TooLarge { .. })));
        assert!(matches!(parts(&[2 * MOST_TRIANGLES], 1 << 30), Err(GpuError::Unsupported(_))));
        assert_eq!(parts(&[3, 256], 1024).unwrap().len(), 2);
        assert_eq!(parts(&[], 1024).unwrap(), []);
    }
}
