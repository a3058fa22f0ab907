//! Code that both profiles share: blocks of a frame without their samples, details for pictures, the hash, and the syntax of block sets and
//! masks.

mod blocks;
mod details;
mod hash;
pub mod syntax;

pub use blocks::ReferenceBlocks;
pub(crate) use blocks::{fill, stitch};
pub(crate) use details::Details;
pub use details::{BitTally, BlockCoding, BlockDetail};
pub use hash::volume_hash;
