//! Lines of text in pictures.

use crate::picture::Picture;
use crate::style::Background;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, RasterizedChar, get_raster, get_raster_width};

/// Height of text for pictures narrower than a number of pixels, and for all that are wider.
const HEIGHTS: [(usize, RasterHeight); 3] =
    [(512, RasterHeight::Size16), (900, RasterHeight::Size20), (1600, RasterHeight::Size24)];
const LARGEST: RasterHeight = RasterHeight::Size32;

/// Letters of one size, all equally wide.
#[derive(Clone, Copy)]
pub(crate) struct Font {
    height: RasterHeight,
}

impl Font {
    /// The size of text that suits pictures of a width.
    pub(crate) fn for_width(width: usize) -> Self {
        let found = HEIGHTS.iter().find(|(below, _)| width < *below);
        Self { height: found.map_or(LARGEST, |(_, height)| *height) }
    }

    /// Height of a line in pixels.
    pub(crate) fn height(self) -> usize {
        self.height.val()
    }

    /// Width of a text in pixels.
    pub(crate) fn width(self, text: &str) -> usize {
        self.width_of(text.chars().count())
    }

    /// Width of so many letters in pixels.
    fn width_of(self, letters: usize) -> usize {
        letters * get_raster_width(FontWeight::Regular, self.height)
    }

    /// Writes a text, its top left corner at `(x, y)`; what lies outside the picture is left out.
    pub(crate) fn write(self, picture: &mut Picture, text: &str, [x, y]: [usize; 2], ink: [u8; 3]) {
        let step = self.width("0");
        for (i, letter) in text.chars().enumerate() {
            for (row, coverages) in self.letter(letter).rows().enumerate() {
                for (column, &coverage) in coverages.iter().enumerate() {
                    picture.lay_over([x + i * step + column, y + row], ink, coverage);
                }
            }
        }
    }

    /// The picture of a letter; a question mark for what is not ASCII.
    fn letter(self, letter: char) -> RasterizedChar {
        let raster = |letter| get_raster(letter, FontWeight::Regular, self.height);
        raster(letter).or_else(|| raster('?')).expect("the font has the printable characters of ASCII")
    }
}

/// A line of text in the middle of a strip of a width, for a place under a picture. Characters that are not printable
/// ASCII become question marks; what does not fit into the width is cut off.
#[must_use]
pub fn text_line(text: &str, width: usize, background: Background) -> Picture {
    let font = Font::for_width(width);
    let padding = font.height() / 4;
    let mut strip = Picture::filled([width, font.height() + 2 * padding], background.rgba());
    let left = width.saturating_sub(font.width(text)) / 2;
    font.write(&mut strip, text, [left, padding], background.ink());
    strip
}

/// Whether a [`text_line`] of this width holds a text of so many letters.
#[must_use]
pub fn text_fits(letters: usize, width: usize) -> bool {
    Font::for_width(width).width_of(letters) <= width
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stands_in_the_middle_in_its_ink() {
        let strip = text_line("HH", 100, Background::Light);
        let inked = |x: usize, y: usize| strip.pixel(x, y) != Background::Light.rgba();
        let columns: Vec<usize> = (0..100).filter(|x| (0..strip.size()[1]).any(|y| inked(*x, y))).collect();
        let (first, last) = (columns[0], columns[columns.len() - 1]);
        assert!(first.abs_diff(99 - last) <= 2, "{first} {last}");
        let darkest = strip.rgba().chunks(4).min_by_key(|p| p[0]).unwrap();
        assert!((60..64).contains(&darkest[0]) && darkest[3] == 255, "{darkest:?}");
    }

    #[test]
    fn text_that_does_not_fit_or_is_not_ascii_is_no_failure() {
        let long = text_line(&"\u{1F600}\nabc".repeat(100), 30, Background::Dark);
        assert_eq!(long.size()[0], 30);
        assert_eq!(text_line("abc", 0, Background::Dark).size()[0], 0);
        assert_eq!(text_line("é", 40, Background::Light), text_line("?", 40, Background::Light));
    }

    #[test]
    fn text_on_nothing_is_as_opaque_as_its_letters() {
        let strip = text_line("H", 40, Background::Transparent);
        let most = strip.rgba().chunks(4).map(|p| p[3]).max().unwrap();
        assert!(most > 200);
        assert_eq!(strip.pixel(0, 0), [0; 4]);
    }
}
