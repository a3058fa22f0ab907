//! Takes from end to end: captures to streams, and streams to frames.
//!
//! ```text
//! folder, file, pipe ─ capture ─ volumes ─ coder ─ writer ─> stream ─ frames, with what was lost concealed
//! ```
//!
//! What the layers below do one step at a time is put together here, with what belongs to a whole take: options and their defaults,
//! reading ahead, times, rates that are met by coding twice, limits of memory, the device that does the arithmetic and the CPU
//! behind it, damage. The command line is words around this crate, and the crate `isv` its stable face.

mod cancel;
mod device;
mod event;
mod frame_range;
mod input;
mod memory;
mod prefetch;
pub mod stream;
pub mod timeline;

#[cfg(feature = "encode")]
mod bit_rate;
#[cfg(feature = "encode")]
pub mod capture;
#[cfg(feature = "encode")]
pub mod encode;
#[cfg(feature = "encode")]
mod length;
#[cfg(feature = "encode")]
mod up;

pub use cancel::Cancellation;
pub use device::{AnyDecoder, AnyFrame, AnyVolume, Device, DeviceError, OpenDevice};
pub use event::{Event, Health, Observer};
pub use frame_range::{FrameRange, FrameRangeError};
pub use input::Input;
pub use memory::{MemoryError, MemoryLimit};
pub use prefetch::Prefetch;
pub use stream::{StreamError, StreamFault};

#[cfg(feature = "encode")]
pub use bit_rate::BitRate;
#[cfg(feature = "encode")]
pub use length::Length;
#[cfg(feature = "encode")]
pub use up::Up;
