//! Pictures one after the other, as files that play them.

mod apng;
mod gif;

pub use apng::ApngWriter;
pub use gif::GifWriter;

use crate::picture::Picture;
use std::io;

/// How fast pictures follow each other: a number of them in a number of seconds, so that 30000/1001 is exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureRate {
    /// How many pictures.
    pub pictures: u32,
    /// In how many seconds.
    pub seconds: u32,
}

impl PictureRate {
    /// Most pictures a second of a GIF: browsers take shorter delays than 1/50 second for a mistake and play at 1/10.
    pub const FASTEST_GIF: u32 = 50;

    /// Whether a GIF can be played at this rate.
    #[must_use]
    pub fn fits_gif(self) -> bool {
        u64::from(self.pictures) <= u64::from(self.seconds) * u64::from(Self::FASTEST_GIF)
    }

    /// The rate, if both numbers are above 0.
    fn checked(self) -> io::Result<Self> {
        if self.pictures == 0 || self.seconds == 0 {
            return Err(refused(format!(
                "{} pictures in {} seconds are no rate",
                self.pictures, self.seconds
            )));
        }
        Ok(self)
    }
}

/// Refuses a picture that is not of the size of its animation.
fn check_size(picture: &Picture, size: [usize; 2]) -> io::Result<()> {
    if picture.size() == size {
        return Ok(());
    }
    let [[width, height], [wanted_width, wanted_height]] = [picture.size(), size];
    Err(refused(format!(
        "a picture of {width} x {height} pixels in an animation of {wanted_width} x {wanted_height}"
    )))
}

fn refused(why: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, why)
}
