//! isv (implicit surface video): a codec for moving 3-D geometry.
//!
//! Meshes, points, depth images and signed distance fields become sparse volumes of distances, which are coded like video. What
//! comes back are meshes and fields of any topology.
//!
//! # A folder to a stream
//!
//! ```no_run
#![doc = include_str!("../examples/encode_folder.rs")]
//! ```
//!
//! # Frame by frame
//!
//! ```no_run
#![doc = include_str!("../examples/frame_by_frame.rs")]
//! ```
//!
//! # Features
//!
//! - `encode` (default): [`Writer`], [`take::encode`] and the readers of captures. Takes `io` with it.
//! - `io`: [`take::decode`] to files of meshes, points and fields. Without it this crate decodes to arrays alone, and compiles about
//!   what a decoder needs.
//! - `sound`: [`take::mux`] takes sound from MP3, Ogg, FLAC and WAV files, too.
//! - `gpu`: GPUs by Vulkan, Metal and DX12, chosen with [`Device`].
//!
//! # What is stable
//!
//! All items but those of [`raw`], which are the layers below, with no promise. No value that can be made by the others panics: what
//! is wrong is an [`Error`]. Warnings go to [`tracing`], and to a callback of whoever asks.

mod bytes;
mod error;
mod event;
mod frame;
mod mesh;
mod parts;
mod points;
pub mod raw;
mod reader;

#[cfg(feature = "io")]
mod decode_options;
#[cfg(feature = "io")]
mod job_options;
#[cfg(feature = "io")]
mod quantity;
#[cfg(feature = "io")]
pub mod take;

#[cfg(feature = "encode")]
mod encode_options;
#[cfg(feature = "encode")]
mod field;
#[cfg(feature = "encode")]
mod writer;

pub use error::{Error, ErrorKind};
pub use event::Event;
pub use frame::{Block, Frame, Volume, VolumeArrays};
pub use isv_decode::Lod;
#[cfg(feature = "io")]
pub use isv_take::metadata::{Metadata, MetadataChoice, SourceMetadata, SurfaceMetadata};
pub use isv_take::stream::AfterLoss;
pub use isv_take::{Cancellation, Device};
pub use mesh::Mesh;
pub use parts::{PartChanges, SurfaceParts};
pub use points::Points;
pub use reader::Reader;

#[cfg(feature = "io")]
pub use decode_options::DecodeOptions;
#[cfg(feature = "io")]
pub use isv_io::Unit;
#[cfg(feature = "io")]
pub use isv_take::{BitRate, Length, Up};
#[cfg(feature = "io")]
pub use quantity::Quantity;

#[cfg(feature = "encode")]
pub use encode_options::EncodeOptions;
#[cfg(feature = "encode")]
pub use field::{ColourView, DepthView};
#[cfg(feature = "encode")]
pub use isv_encode::{Preset, Refresh};
#[cfg(feature = "encode")]
pub use isv_ingest::SignMode;
#[cfg(feature = "encode")]
pub use isv_take::encode::TimestampSource;
#[cfg(feature = "encode")]
pub use writer::{FileSink, Report, Writer};
