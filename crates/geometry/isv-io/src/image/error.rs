//! Faults of images.

use super::{MAX_IMAGE_PIXELS, MAX_IMAGE_SIDE};
use crate::error::{library_text, quote};
use std::fmt::Display;
use thiserror::Error;

/// An image that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("image `{name}`: {fault}")]
pub struct ImageError {
    /// The image's name as the mesh's file gives it, shortened.
    pub name: String,
    /// Cause of the failure.
    pub fault: ImageFault,
}

/// Reason why an image cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ImageFault {
    /// A file that is not there or cannot be read.
    #[error("cannot be read: {cause}")]
    File {
        /// Text of the operating system.
        cause: String,
    },
    /// A name that is not opened.
    #[error("its name {why}")]
    Name {
        /// Reason why the name is not opened.
        why: &'static str,
    },
    /// A format that is none of those that are read.
    #[error("not a PNG, JPEG, WebP or KTX2 image")]
    Unknown,
    /// A variant of a format that is not read.
    #[error("{variant} cannot be read; save it as PNG or JPEG")]
    Variant {
        /// The variant.
        variant: &'static str,
    },
    /// An image beyond [`MAX_IMAGE_SIDE`] or [`MAX_IMAGE_PIXELS`], or of no pixels.
    #[error("{width} x {height} pixels; the limit is {MAX_IMAGE_SIDE} a side and {MAX_IMAGE_PIXELS} in all")]
    Size {
        /// Width in pixels.
        width: u64,
        /// Height in pixels.
        height: u64,
    },
    /// An image with more pixels than a file of its size can need.
    #[error("{bytes} bytes cannot hold {width} x {height} pixels")]
    Dense {
        /// Bytes of the file.
        bytes: u64,
        /// Width in pixels.
        width: u64,
        /// Height in pixels.
        height: u64,
    },
    /// Images of one mesh that have too many pixels together.
    #[error("the images of its mesh have more than {limit} pixels in all")]
    Total {
        /// The most that a mesh may have.
        limit: u64,
    },
    /// A damaged file, or one of a variant that its decoder does not know.
    #[error("not a readable {format} image: {why}")]
    Damaged {
        /// Name of the format.
        format: &'static str,
        /// Text of the decoder, in one line.
        why: String,
    },
}

impl ImageFault {
    /// Names the image of a fault.
    pub(crate) fn of_image(self, name: &str) -> ImageError {
        ImageError { name: quote(name.as_bytes()), fault: self }
    }

    /// A fault that a decoder reports.
    pub(super) fn damaged(format: &'static str, why: &dyn Display) -> Self {
        Self::Damaged { format, why: library_text(why) }
    }
}
