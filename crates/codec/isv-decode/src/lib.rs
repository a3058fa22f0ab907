//! Packets in, sparse volumes out.
//!
//! ```text
//! Packet ─ FramePayload ─ syntax: range decoder ─> FrameSymbols ─ reconstruct: prediction + inverse DCT ─> SparseVolume
//!                                                                      ▲ Reference: the volume before ────────┘
//! ```
//!
//! [`Decoder`] is the whole of it. Left of the symbols there is one decoder, on the CPU, and it sees no samples. Right of them
//! the work is that of a [`backend::Backend`], of which [`backend::Cpu`] is the reference. The encoder uses the parts. It fills a
//! frame's symbols and writes them with the mirror image of `syntax`. For its own reference it calls the same `reconstruct`, so
//! the two cannot drift apart (Eq. 11).
//!
//! [`main`] is the product's profile, [`paper`] the one that it is measured against. Files of the same names have the same steps. What both
//! have is in [`shared`].
//!
//! This crate does not read files and does not extract surfaces.

pub mod backend;
pub mod colour;
mod decoder;
mod error;
// A file src/main.rs would be a program.
#[path = "main/mod.rs"]
pub mod main;
pub mod paper;
mod reduced;
pub mod shared;

pub use decoder::{DecodedFrame, Decoder, Limits};
pub use error::{BackendError, DecodeError};
pub use isv_format::RefusalClass;
pub use reduced::Lod;
pub use shared::{BitTally, BlockCoding, BlockDetail, ReferenceBlocks, volume_hash};
