//! Animated PNG: all colours, plays in browsers.

use super::{PictureRate, check_size, refused};
use crate::picture::{Picture, into_io};
use std::io::{self, Write};

/// Writes an animated PNG that plays for ever, picture by picture; none is held. What knows only still PNG shows the
/// first picture.
pub struct ApngWriter<W: Write> {
    writer: png::Writer<W>,
    size: [usize; 2],
    /// How many pictures are still to come.
    left: u32,
}

impl<W: Write> ApngWriter<W> {
    /// Begins a file of exactly `pictures` pictures of `size`, width and height in pixels.
    ///
    /// # Errors
    /// What the writer returns, or [`io::ErrorKind::InvalidInput`] for no pictures, a size outside 1 to 2^31 - 1 or a
    /// rate of 0.
    pub fn new(to: W, size: [usize; 2], pictures: u32, rate: PictureRate) -> io::Result<Self> {
        if size.iter().any(|side| i32::try_from(*side).is_err()) {
            let [width, height] = size;
            return Err(refused(format!(
                "a PNG has 1 to {} pixels a side, not {width} x {height}",
                i32::MAX
            )));
        }
        let [width, height] = size.map(|side| side as u32);
        let mut encoder = png::Encoder::new(to, width, height);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        let [seconds, parts] = delay(rate.checked()?);
        encoder.set_animated(pictures, 0).map_err(into_io)?;
        encoder.set_frame_delay(seconds, parts).map_err(into_io)?;
        Ok(Self { writer: encoder.write_header().map_err(into_io)?, size, left: pictures })
    }

    /// Writes the next picture.
    ///
    /// # Errors
    /// What the writer returns, or [`io::ErrorKind::InvalidInput`] for a picture of another size or one too many.
    pub fn push(&mut self, picture: &Picture) -> io::Result<()> {
        check_size(picture, self.size)?;
        let Some(left) = self.left.checked_sub(1) else {
            return Err(refused("more pictures than the animation was begun with".to_owned()));
        };
        self.left = left;
        self.writer.write_image_data(picture.rgba()).map_err(into_io)
    }

    /// Ends the file.
    ///
    /// # Errors
    /// What the writer returns, or [`io::ErrorKind::InvalidInput`] if pictures are missing.
    pub fn finish(self) -> io::Result<()> {
        if self.left > 0 {
            return Err(refused(format!("an animation that lacks {} of its pictures", self.left)));
        }
        self.writer.finish().map_err(into_io)
    }
}

/// Time of a picture as a fraction of seconds. The rates in use are exact; of others, numerator and denominator are
/// halved until both have 16 bits.
fn delay(rate: PictureRate) -> [u16; 2] {
    let PictureRate { mut pictures, mut seconds } = rate;
    while pictures.max(seconds) > u32::from(u16::MAX) {
        (pictures, seconds) = (pictures / 2, seconds / 2);
    }
    // Of what is faster than any screen, or slower than any viewer, the order of magnitude is kept.
    [seconds.max(1) as u16, pictures.max(1) as u16]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_are_exact_or_close() {
        let of = |pictures, seconds| delay(PictureRate { pictures, seconds });
        assert_eq!(of(30, 1), [1, 30]);
        assert_eq!(of(30_000, 1001), [1001, 30_000]);
        assert_eq!(of(u32::MAX, 1), [1, u16::MAX]);
        let [seconds, parts] = of(2_999_999, 100_001);
        assert!((f64::from(seconds) / f64::from(parts) * 2_999_999.0 / 100_001.0 - 1.0).abs() < 1e-3);
    }
}
