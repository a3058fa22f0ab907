//! GIF: plays everywhere, 256 colours a picture.

use super::{PictureRate, check_size, refused};
use crate::palette::Indexed;
use crate::picture::Picture;
use gif::{DisposalMethod, Encoder, EncodingError, Frame, Repeat};
use std::borrow::Cow;
use std::io::{self, Write};

/// Writes an animated GIF that plays for ever, picture by picture; none is held.
///
/// Each picture has its own palette. Delays are whole hundredths of a second, rounded so that they do not drift from the
/// rate. Pixels less than half covered are transparent, all others opaque.
pub struct GifWriter<W: Write> {
    encoder: Encoder<W>,
    size: [usize; 2],
    rate: PictureRate,
    pictures: u64,
}

impl<W: Write> GifWriter<W> {
    /// Begins a file of pictures of `size`, width and height in pixels.
    ///
    /// # Errors
    /// What the writer returns, or [`io::ErrorKind::InvalidInput`] for a size outside 1 to 65535 or a rate of 0 or above
    /// 50 pictures a second.
    pub fn new(to: W, size: [usize; 2], rate: PictureRate) -> io::Result<Self> {
        let rate = rate.checked()?;
        if !rate.fits_gif() {
            return Err(refused(format!(
                "a GIF plays at most {} pictures a second",
                PictureRate::FASTEST_GIF
            )));
        }
        let sides = size.map(|side| u16::try_from(side).ok().filter(|side| *side > 0));
        let [Some(width), Some(height)] = sides else {
            let [width, height] = size;
            return Err(refused(format!(
                "a GIF has 1 to {} pixels a side, not {width} x {height}",
                u16::MAX
            )));
        };
        let mut encoder = Encoder::new(to, width, height, &[]).map_err(into_io)?;
        encoder.set_repeat(Repeat::Infinite).map_err(into_io)?;
        Ok(Self { encoder, size, rate, pictures: 0 })
    }

    /// Writes the next picture.
    ///
    /// # Errors
    /// What the writer returns, or [`io::ErrorKind::InvalidInput`] for a picture of another size.
    pub fn push(&mut self, picture: &Picture) -> io::Result<()> {
        check_size(picture, self.size)?;
        let Indexed { palette, indices, transparent } = Indexed::new(picture);
        let [width, height] = self.size.map(|side| side as u16);
        let frame = Frame {
            width,
            height,
            buffer: Cow::Owned(indices),
            palette: Some(palette.into_flattened()),
            transparent,
            delay: self.delay(),
            // What is transparent shows what was there before, unless that is taken away.
            dispose: if transparent.is_some() { DisposalMethod::Background } else { DisposalMethod::Keep },
            ..Frame::default()
        };
        self.pictures += 1;
        self.encoder.write_frame(&frame).map_err(into_io)
    }

    /// Ends the file.
    ///
    /// # Errors
    /// What the writer returns, or [`io::ErrorKind::InvalidInput`] if there was no picture.
    pub fn finish(self) -> io::Result<()> {
        if self.pictures == 0 {
            return Err(refused("an animation without pictures".to_owned()));
        }
        self.encoder.into_inner().map_err(into_io)?.flush()
    }

    /// Hundredths of a second from this picture to the next.
    fn delay(&self) -> u16 {
        let time = |picture: u64| {
            let [pictures, seconds] = [self.rate.pictures, self.rate.seconds].map(u128::from);
            (u128::from(picture) * 100 * seconds + pictures / 2) / pictures
        };
        u16::try_from(time(self.pictures + 1) - time(self.pictures)).unwrap_or(u16::MAX)
    }
}

fn into_io(error: EncodingError) -> io::Error {
    match error {
        EncodingError::Io(error) => error,
        other => io::Error::new(io::ErrorKind::InvalidInput, other),
    }
}
