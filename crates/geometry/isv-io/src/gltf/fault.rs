//! What can be wrong with a glTF file.

use super::animation::MAX_DURATION_S;
use thiserror::Error;

/// How a file breaks glTF 2.0, or what of it is not read. Texts quoted from the file are shortened.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum GltfFault {
    /// The file starts with neither `glTF` nor a JSON object.
    #[error("not a glTF file: it starts with neither `glTF` nor `{{`")]
    NotGltf,
    /// A file of another version.
    #[error("glTF of version {version}; only version 2 can be read")]
    Version {
        /// The version.
        version: u32,
    },
    /// A part of a binary file is cut, or a buffer is shorter than it should be.
    #[error("truncated: its {part} should have {promised} bytes, {found} are there")]
    Truncated {
        /// What is cut.
        part: &'static str,
        /// Bytes that should be there.
        promised: u64,
        /// Bytes that are.
        found: u64,
    },
    /// The first chunk of a binary file is of another type.
    #[error("the first chunk of a binary glTF file must be its JSON")]
    NoJsonChunk,
    /// The JSON is broken, or not what glTF 2.0 has there.
    #[error("its JSON cannot be understood: {text}")]
    Json {
        /// What the parser said.
        text: String,
    },
    /// Something that changes the geometry in ways that are not known here; compression above all.
    #[error("uses the extension {extension}, which cannot be read; save the file without it")]
    Extension {
        /// Name of the extension.
        extension: String,
    },
    /// Compressed data that cannot be decoded.
    #[error("its {codec} data cannot be decoded: {why}")]
    Compressed {
        /// The name of the compression.
        codec: &'static str,
        /// What the decoder said.
        why: String,
    },
    /// Compressed data that becomes more than a file of its size can need.
    #[error("decompresses to {wanted} bytes in all, the limit for a file of this size is {limit}")]
    Decompressed {
        /// Bytes with this.
        wanted: u64,
        /// The most that is accepted.
        limit: u64,
    },
    /// An index of an object that is not there.
    #[error("names {kind} {index} of {count}")]
    NoSuch {
        /// What kind of object.
        kind: &'static str,
        /// Index, from 0.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// An accessor that cannot serve as what it is used for.
    #[error("holds {found} where {wanted} is needed")]
    AccessorType {
        /// What is needed, such as `VEC3`.
        wanted: &'static str,
        /// What the file has.
        found: String,
    },
    /// A range of bytes that leaves what it is a part of.
    #[error("reaches to byte {end} of {bytes}")]
    PastEnd {
        /// End of the range.
        end: u64,
        /// How many bytes there are.
        bytes: u64,
    },
    /// Elements that overlap.
    #[error("has a byteStride of {stride} for elements of {bytes} bytes")]
    Stride {
        /// Bytes from one element to the next.
        stride: u64,
        /// Bytes of an element.
        bytes: u64,
    },
    /// Lists that belong together and do not have the same length.
    #[error("has {found} elements where {wanted} are needed")]
    Count {
        /// How many are needed.
        wanted: u64,
        /// How many there are.
        found: u64,
    },
    /// More elements than a file of its size can need.
    #[error("asks for {wanted} numbers in memory, the limit for a file of this size is {limit}")]
    TooLarge {
        /// How many are asked for, in all.
        wanted: u64,
        /// The most that is accepted.
        limit: u64,
    },
    /// A vertex or joint index past the last.
    #[error("names {kind} {index}, the last one is {last}")]
    Index {
        /// `vertex` or `joint`.
        kind: &'static str,
        /// The index.
        index: u32,
        /// The largest that is allowed.
        last: u32,
    },
    /// A buffer's address that is not opened: absolute, remote, above the file's folder, or broken.
    #[error("its address `{uri}` {why}")]
    Uri {
        /// The address, shortened.
        uri: String,
        /// Why it is not opened.
        why: &'static str,
    },
    /// A buffer's file that cannot be read.
    #[error("its file `{uri}` cannot be read: {cause}")]
    File {
        /// The address, shortened.
        uri: String,
        /// What the operating system said.
        cause: String,
    },
    /// A node that is a child twice.
    #[error("is a child of more than one node")]
    TwoParents,
    /// A node that is its own ancestor.
    #[error("is its own ancestor")]
    Cycle,
    /// Times of keyframes that are none, go backwards or are not finite.
    #[error("has times that are not finite numbers in rising order")]
    Times,
    /// A keyframe beyond [`MAX_DURATION_S`].
    #[error("has a keyframe at {seconds} s, the limit is {MAX_DURATION_S} s")]
    Duration {
        /// The time, rounded.
        seconds: u64,
    },
    /// The scene has no triangles.
    #[error("no mesh with triangles in the scene")]
    NoMeshes,
    /// A texture without an image, or an image without bytes.
    #[error("has no image that can be read")]
    NoImage,
    /// An animation was asked for that is not there.
    #[error("animation {index} asked for, but there are {count}")]
    NoSuchAnimation {
        /// Index, from 0.
        index: usize,
        /// How many there are.
        count: usize,
    },
}
