//! Files of pictures.

use crate::{ApngWriter, GifWriter, Picture, PictureRate};
use std::fmt;
use std::io::{self, Write};
use std::path::Path;

/// A kind of picture file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// A still: one picture, or a contact sheet of several.
    Png,
    /// An animation, 256 colours a picture.
    Gif,
    /// An animation in all colours.
    Apng,
}

impl PictureFormat {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::Png, Self::Gif, Self::Apng];

    /// The kind of picture that a file of this name is.
    #[must_use]
    pub fn of_path(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?;
        Self::ALL.into_iter().find(|format| extension.eq_ignore_ascii_case(format.extension()))
    }

    /// The usual ending of its files, and its name.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Gif => "gif",
            Self::Apng => "apng",
        }
    }

    /// Whether its pictures follow each other in time.
    #[must_use]
    pub fn is_moving(self) -> bool {
        self != Self::Png
    }
}

impl fmt::Display for PictureFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.extension())
    }
}

/// A file of pictures. Animations are written as they come, a still at the end.
pub enum PictureFile<W: Write> {
    /// A still, and its pictures so far.
    Still {
        /// Destination of the PNG.
        output: W,
        /// Pictures so far, to be joined at the end.
        pictures: Vec<Picture>,
    },
    /// An animation of 256 colours.
    Gif(GifWriter<W>),
    /// An animation in all colours.
    Apng(ApngWriter<W>),
}

impl<W: Write> PictureFile<W> {
    /// Begins a file of `count` pictures of one size (width and height in pixels).
    ///
    /// # Errors
    /// Errors of the output, and more than 2^32 pictures of an animated PNG.
    pub fn new(
        format: PictureFormat,
        output: W,
        size: [usize; 2],
        count: usize,
        rate: PictureRate,
    ) -> io::Result<Self> {
        Ok(match format {
            PictureFormat::Png => Self::Still { output, pictures: Vec::new() },
            PictureFormat::Gif => Self::Gif(GifWriter::new(output, size, rate)?),
            PictureFormat::Apng => {
                let too_many = |_| io::Error::other("an animated PNG counts its pictures in 32 bits");
                let count = u32::try_from(count).map_err(too_many)?;
                Self::Apng(ApngWriter::new(output, size, count, rate)?)
            }
        })
    }

    /// Adds a picture.
    ///
    /// # Errors
    /// Errors of the output.
    pub fn push(&mut self, picture: Picture) -> io::Result<()> {
        match self {
            Self::Still { pictures, .. } => pictures.push(picture),
            Self::Gif(writer) => writer.push(&picture)?,
            Self::Apng(writer) => writer.push(&picture)?,
        }
        Ok(())
    }

    /// Ends the file. A still is made of all pictures by `join`.
    ///
    /// # Errors
    /// Errors of the output.
    pub fn finish(self, join: impl FnOnce(Vec<Picture>) -> Picture) -> io::Result<()> {
        match self {
            Self::Still { mut output, pictures } => join(pictures).write_png(&mut output)?,
            Self::Gif(writer) => writer.finish()?,
            Self::Apng(writer) => writer.finish()?,
        }
        Ok(())
    }
}
