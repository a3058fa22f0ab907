//! Packets in, sparse volumes out.
//!
//! ```text
//! Packet ─ FramePayload ─ syntax: range decoder ─> FrameSymbols ─ reconstruct: prediction + inverse DCT ─> SparseVolume
//!                                                                      ▲ Reference: the volume before ────────┘
//! ```
//!
//! [`Decoder`] is the whole of it. Left of the symbols it is one, on the CPU, and sees no samples; right of them it is a
//! [`backend::Backend`], of which [`backend::Cpu`] is the reference. The encoder uses the parts: it fills a [`FrameSymbols`],
//! writes it with the mirror image of [`syntax`], and calls the same [`reconstruct`] for its own reference, so the two cannot drift
//! apart (Eq. 11).
//!
//! What lies beside this file is the paper's codec: profile `paper`, and what both profiles share. [`main_profile`] builds on it, with
//! files of the same names for the same steps.
//!
//! This crate does not read files and does not extract surfaces.

pub mod backend;
mod decoder;
mod details;
mod error;
pub mod extension;
mod hash;
pub mod main_profile;
mod parameters;
pub mod reconstruct;
mod reduced;
mod reference;
mod symbols;
pub mod syntax;

pub use decoder::{DecodedFrame, Decoder, Limits};
pub use details::{BitTally, BlockCoding, BlockDetail};
pub use error::{BackendError, DecodeError};
pub use hash::volume_hash;
pub use isv_format::RefusalClass;
pub use parameters::CodingParameters;
pub use reduced::Lod;
pub use reference::{Reference, ReferenceBlocks};
pub use symbols::FrameSymbols;
