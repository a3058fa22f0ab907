//! `.isv` streams in MP4 files (ISO/IEC 14496-12), beside sound and picture. `docs/spec/mp4.md` is the normative description.
//!
//! ```text
//! stream bytes ─ GeometrySink ┐
//! sound, picture ─ SampleSource ┴ Mp4Writer ─> take.mp4 ─ Mp4File ─ GeometryStream ─> stream bytes
//! ```
//!
//! [`GeometrySink`] takes a stream as a writer gives it, and [`GeometryStream`] gives it back to any reader, byte for byte. So what
//! writes or reads `.isv` files does the same with MP4 files.

mod boxes;
mod ends;
mod error;
mod fragment;
mod geometry;
mod init;
mod interleave;
#[cfg(feature = "sound")]
mod opus;
mod pipe;
mod playlist;
mod reader;
mod sample_table;
mod segments;
mod sink;
#[cfg(feature = "sound")]
mod sound;
mod source;
mod stream;
mod track;
mod writer;

pub use ends::{OtherEnd, is_other_end};
pub use error::Mp4Error;
pub use geometry::codec_string;
pub use pipe::{GeometryPipe, Unwrapped};
pub use playlist::{Rung, master_playlist, media_playlist, segment_name};
pub use reader::{Mp4File, is_mp4, is_stream_name};
pub use segments::{Segment, Segments};
pub use sink::GeometrySink;
#[cfg(feature = "sound")]
pub use sound::{SoundOptions, open_sound};
pub use source::{Chained, SampleSource, SourceSample, TrackSource, Trimmed};
pub use stream::GeometryStream;
pub use track::{Edit, Sample, Track, TrackDescription, TrackKind};
pub use writer::{Mp4Writer, write_tracks};
