//! Pictures as pixels and files.

use std::io::{self, Write};

/// Pixels between and around the pictures of a contact sheet.
const GAP: usize = 8;

/// An image of RGBA pixels, 8 bits each, alpha not multiplied in; rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    size: [usize; 2],
    rgba: Vec<u8>,
}

impl Picture {
    /// A picture of one colour. `size` is width and height in pixels.
    #[must_use]
    pub fn filled(size: [usize; 2], rgba: [u8; 4]) -> Self {
        Self { size, rgba: rgba.repeat(size[0] * size[1]) }
    }

    /// Width and height in pixels.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// All pixels, four bytes each, row after row.
    #[must_use]
    pub fn rgba(&self) -> &[u8] {
        &self.rgba
    }

    /// Mutable access to [`Self::rgba`].
    pub fn rgba_mut(&mut self) -> &mut [u8] {
        &mut self.rgba
    }

    /// The pixel in column x of row y.
    ///
    /// # Panics
    /// Outside the picture.
    #[must_use]
    pub fn pixel(&self, x: usize, y: usize) -> [u8; 4] {
        assert!(x < self.size[0] && y < self.size[1], "pixel ({x}, {y}) of {:?}", self.size);
        let at = (y * self.size[0] + x) * 4;
        [0, 1, 2, 3].map(|channel| self.rgba[at + channel])
    }

    /// Copies a picture into this one, its top left corner at `(x, y)`, alpha included.
    ///
    /// # Panics
    /// If it does not fit.
    pub fn paste(&mut self, other: &Picture, x: usize, y: usize) {
        let [width, height] = other.size;
        assert!(x + width <= self.size[0] && y + height <= self.size[1], "a pasted picture must fit");
        for row in 0..height {
            let from = &other.rgba[row * width * 4..][..width * 4];
            self.rgba[((y + row) * self.size[0] + x) * 4..][..width * 4].copy_from_slice(from);
        }
    }

    /// The part of this picture, of a width and height in pixels, whose top left corner lies at `(x, y)`.
    ///
    /// # Panics
    /// If it reaches beyond this picture.
    #[must_use]
    pub fn part(&self, [x, y]: [usize; 2], size: [usize; 2]) -> Picture {
        assert!(x + size[0] <= self.size[0] && y + size[1] <= self.size[1], "a part lies inside");
        let rows = self.rgba.chunks_exact(self.size[0] * 4).skip(y).take(size[1]);
        Self { size, rgba: rows.flat_map(|row| &row[x * 4..][..size[0] * 4]).copied().collect() }
    }

    /// Mixes a colour into a pixel by a coverage of 0 to 255; pixels outside the picture are left alone.
    pub(crate) fn lay_over(&mut self, [x, y]: [usize; 2], rgb: [u8; 3], coverage: u8) {
        if x >= self.size[0] || y >= self.size[1] {
            return;
        }
        let pixel = &mut self.rgba[(y * self.size[0] + x) * 4..][..4];
        if pixel[3] == 0 && coverage > 0 {
            // Nothing has no colour to mix with.
            pixel[..3].copy_from_slice(&rgb);
        }
        let [own, behind] = [u32::from(coverage), u32::from(255 - coverage)];
        for (place, channel) in pixel.iter_mut().zip(rgb) {
            *place = ((u32::from(channel) * own + u32::from(*place) * behind + 127) / 255) as u8;
        }
        pixel[3] = pixel[3].max(coverage);
    }

    /// This picture with another under it, each in the middle of the wider one's width. What is beside them
    /// takes the colour of this picture's top left pixel.
    ///
    /// # Panics
    /// If this picture has no pixels.
    #[must_use]
    pub fn above(&self, other: &Picture) -> Picture {
        let width = self.size[0].max(other.size[0]);
        let mut both = Picture::filled([width, self.size[1] + other.size[1]], self.pixel(0, 0));
        both.paste(self, (width - self.size[0]) / 2, 0);
        both.paste(other, (width - other.size[0]) / 2, self.size[1]);
        both
    }

    /// Writes the picture as a PNG file, which says by whom it was made. Without a transparent pixel the file has no alpha.
    ///
    /// # Errors
    /// What the writer returns, or [`io::ErrorKind::InvalidInput`] for a picture without pixels.
    pub fn write_png(&self, to: impl Write) -> io::Result<()> {
        let [width, height] = self.size.map(|s| s as u32);
        let mut encoder = png::Encoder::new(to, width, height);
        let is_opaque = self.rgba.chunks_exact(4).all(|pixel| pixel[3] == 255);
        encoder.set_color(if is_opaque { png::ColorType::Rgb } else { png::ColorType::Rgba });
        encoder.set_depth(png::BitDepth::Eight);
        encoder.add_text_chunk("Comment".to_owned(), "made by isv".to_owned()).map_err(into_io)?;
        let mut writer = encoder.write_header().map_err(into_io)?;
        if is_opaque {
            let rgb: Vec<u8> = self.rgba.chunks_exact(4).flat_map(|pixel| &pixel[..3]).copied().collect();
            writer.write_image_data(&rgb).map_err(into_io)?;
        } else {
            writer.write_image_data(&self.rgba).map_err(into_io)?;
        }
        writer.finish().map_err(into_io)
    }
}

pub(crate) fn into_io(error: png::EncodingError) -> io::Error {
    match error {
        png::EncodingError::IoError(error) => error,
        other => io::Error::new(io::ErrorKind::InvalidInput, other),
    }
}

/// Pictures in rows of `columns`, each centred in a cell as large as the largest, with small gaps. The gaps take the
/// colour of the first picture's top left pixel.
///
/// # Panics
/// If there are no pictures or no columns.
#[must_use]
pub fn contact_sheet(pictures: &[Picture], columns: usize) -> Picture {
    let cell = [0, 1].map(|axis| pictures.iter().map(|p| p.size[axis]).max().expect("at least one picture"));
    let columns = columns.min(pictures.len());
    let counts = [columns, pictures.len().div_ceil(columns)];
    let size = [0, 1].map(|axis| counts[axis] * (cell[axis] + GAP) + GAP);
    let mut sheet = Picture::filled(size, pictures[0].pixel(0, 0));
    for (i, picture) in pictures.iter().enumerate() {
        let place = [i % columns, i / columns];
        let [x, y] =
            [0, 1].map(|axis| GAP + place[axis] * (cell[axis] + GAP) + (cell[axis] - picture.size[axis]) / 2);
        sheet.paste(picture, x, y);
    }
    sheet
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_decodes_back() {
        let mut picture = Picture::filled([3, 2], [1, 2, 3, 255]);
        picture.paste(&Picture::filled([1, 1], [200, 100, 50, 7]), 2, 1);
        let mut file = Vec::new();
        picture.write_png(&mut file).unwrap();
        let mut reader = png::Decoder::new(io::Cursor::new(file)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, picture.rgba());
        assert_eq!(picture.pixel(2, 1), [200, 100, 50, 7]);
    }

    #[test]
    fn an_opaque_picture_has_no_alpha_in_its_file() {
        let mut picture = Picture::filled([3, 2], [1, 2, 3, 255]);
        picture.paste(&Picture::filled([1, 1], [200, 100, 50, 255]), 2, 1);
        let mut file = Vec::new();
        picture.write_png(&mut file).unwrap();
        let mut reader = png::Decoder::new(io::Cursor::new(file)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        assert_eq!(reader.next_frame(&mut pixels).unwrap().color_type, png::ColorType::Rgb);
        assert_eq!((pixels.len(), &pixels[15..]), (18, &[200, 100, 50][..]));
    }

    #[test]
    fn a_part_has_the_pixels_of_its_place() {
        let mut picture = Picture::filled([5, 4], [1, 2, 3, 255]);
        picture.paste(&Picture::filled([1, 1], [9, 9, 9, 255]), 3, 2);
        let part = picture.part([2, 1], [3, 2]);
        assert_eq!(part.size(), [3, 2]);
        assert_eq!((part.pixel(1, 1), part.pixel(0, 0)), ([9, 9, 9, 255], [1, 2, 3, 255]));
    }

    #[test]
    fn a_picture_without_pixels_is_an_error() {
        assert!(Picture::filled([0, 4], [0; 4]).write_png(io::sink()).is_err());
    }

    #[test]
    fn contact_sheet_fills_rows() {
        let colour = |c| [c, c, c, 255];
        let pictures = [Picture::filled([10, 4], colour(1)), Picture::filled([10, 4], colour(2)), {
            Picture::filled([4, 4], colour(3))
        }];
        let sheet = contact_sheet(&pictures, 2);
        assert_eq!(sheet.size(), [2 * 10 + 3 * GAP, 2 * 4 + 3 * GAP]);
        assert_eq!(sheet.pixel(GAP + 10 + GAP, GAP), colour(2));
        assert_eq!(sheet.pixel(GAP + 3, 2 * GAP + 4), colour(3));
        assert_eq!(sheet.pixel(GAP + 2, 2 * GAP + 4), colour(1));
    }
}
