//! Takes from end to end: captures to streams, and streams to frames.
//!
//! ```text
//! folder, file, pipe ─ capture ─ volumes ─ coder ─ writer ─> stream ─ frames, with what was lost concealed
//! ```
//!
//! This crate puts together what the layers below do one step at a time, with what belongs to a whole take.
//! These are options and their defaults, reading ahead, times, rates that are met by coding twice, limits of
//! memory, and damage. It also chooses the device that does the arithmetic, with the CPU behind it. The
//! command line is words around this crate, and the crate `isv` its stable face.

mod cancel;
mod device;
mod event;
mod frame_range;
mod input;
mod memory;
mod memory_size;
mod prefetch;
pub mod stream;
pub mod timeline;

#[cfg(feature = "io")]
mod baked_texture;
#[cfg(feature = "io")]
mod bit_rate;
#[cfg(feature = "io")]
pub mod decode;
#[cfg(feature = "io")]
mod distances;
#[cfg(feature = "io")]
mod length;
#[cfg(feature = "io")]
pub mod metadata;
#[cfg(feature = "io")]
mod up;

#[cfg(feature = "encode")]
pub mod capture;
#[cfg(feature = "encode")]
pub mod encode;
#[cfg(feature = "encode")]
mod evaluate;
#[cfg(feature = "encode")]
mod projection;
#[cfg(feature = "encode")]
mod tile_texture;

pub use cancel::Cancellation;
pub use device::{Decoded, DecodedVolume, Device, DeviceError, DeviceVolume, OpenDevice, StreamDecoder};
pub use event::{Event, Health, Observer, left_out_in_words};
pub use frame_range::{FrameRange, FrameRangeError};
pub use input::Input;
pub use memory::{MemoryError, MemoryLimit};
pub use memory_size::MemorySize;
pub use prefetch::Prefetch;
pub use stream::{StreamError, StreamFault};

#[cfg(feature = "io")]
pub use baked_texture::{TextureSide, TextureTooSmall};
#[cfg(feature = "io")]
pub use bit_rate::BitRate;
#[cfg(feature = "io")]
pub use distances::{DistancesError, with_distances};
#[cfg(feature = "io")]
pub use length::Length;
#[cfg(feature = "io")]
pub use up::Up;

#[cfg(feature = "encode")]
pub use evaluate::{EvaluateError, Evaluation, EvaluationFigures, FrameFigures, evaluate, evaluate_ranges};
#[cfg(feature = "encode")]
pub use projection::Projection;
#[cfg(feature = "encode")]
pub use tile_texture::{Texel, add_tile_texture, texture_tiles};
