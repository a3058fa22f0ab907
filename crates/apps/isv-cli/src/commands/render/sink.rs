//! Where pictures go, one after the other.

use super::format::PictureFormat;
use crate::output::Output;
use anyhow::{Context, Result};
use isv_render::{ApngWriter, GifWriter, Picture, PictureRate};

/// A file of pictures. Animations are written as they come, a still at the end.
pub(super) enum PictureSink<'a> {
    Still { output: &'a mut Output, pictures: Vec<Picture> },
    Gif(GifWriter<&'a mut Output>),
    Apng(ApngWriter<&'a mut Output>),
}

impl<'a> PictureSink<'a> {
    /// Begins a file of `count` pictures of one size.
    pub(super) fn new(
        format: PictureFormat,
        output: &'a mut Output,
        size: [usize; 2],
        count: usize,
        rate: PictureRate,
    ) -> Result<Self> {
        Ok(match format {
            PictureFormat::Png => Self::Still { output, pictures: Vec::new() },
            PictureFormat::Gif => Self::Gif(GifWriter::new(output, size, rate)?),
            PictureFormat::Apng => {
                let count = u32::try_from(count).context("an animated PNG counts its pictures in 32 bits")?;
                Self::Apng(ApngWriter::new(output, size, count, rate)?)
            }
        })
    }

    pub(super) fn push(&mut self, picture: Picture) -> Result<()> {
        match self {
            Self::Still { pictures, .. } => pictures.push(picture),
            Self::Gif(writer) => writer.push(&picture)?,
            Self::Apng(writer) => writer.push(&picture)?,
        }
        Ok(())
    }

    /// Ends the file. A still is made of all pictures by `join`.
    pub(super) fn finish(self, join: impl FnOnce(Vec<Picture>) -> Picture) -> Result<()> {
        match self {
            Self::Still { output, pictures } => join(pictures).write_png(output)?,
            Self::Gif(writer) => writer.finish()?,
            Self::Apng(writer) => writer.finish()?,
        }
        Ok(())
    }
}
