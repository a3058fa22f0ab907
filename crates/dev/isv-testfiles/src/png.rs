//! Depth images as PNG.

use png::{BitDepth, ColorType, Encoder, Filter};

/// The filters of rows.
const FILTERS: [Filter; 6] =
    [Filter::NoFilter, Filter::Sub, Filter::Up, Filter::Avg, Filter::Paeth, Filter::Adaptive];

/// A grey image of 16 bits, of so many columns; `values` are its rows one after the other.
#[must_use]
pub fn depths(columns: u32, values: &[u16]) -> Vec<u8> {
    filtered(columns, values, Filter::Adaptive)
}

/// Images with each filter, and in passes.
#[must_use]
pub fn all_kinds(columns: u32, values: &[u16]) -> Vec<Vec<u8>> {
    let mut files = FILTERS.map(|filter| filtered(columns, values, filter)).to_vec();
    files.push(interlaced(columns, values));
    files
}

fn filtered(columns: u32, values: &[u16], filter: Filter) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, columns, values.len() as u32 / columns);
    encoder.set_color(ColorType::Grayscale);
    encoder.set_depth(BitDepth::Sixteen);
    encoder.set_filter(filter);
    let data: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
    bytes
}

/// An image in seven passes, each with more of the pixels ("Adam7"), and without compression: the crate `png` writes no such
/// images.
fn interlaced(columns: u32, values: &[u16]) -> Vec<u8> {
    const PASSES: [[usize; 4]; 7] =
        [[0, 0, 8, 8], [4, 0, 8, 8], [0, 4, 4, 8], [2, 0, 4, 4], [0, 2, 2, 4], [1, 0, 2, 2], [0, 1, 1, 2]];
    let rows = values.len() as u32 / columns;
    let mut data = Vec::new();
    for [x, y, right, down] in PASSES {
        for row in values.chunks(columns as usize).skip(y).step_by(down) {
            let row: Vec<_> = row.iter().skip(x).step_by(right).flat_map(|v| v.to_be_bytes()).collect();
            // A pass without pixels has no rows either. Else a row begins with its filter: none.
            if !row.is_empty() {
                data.push(0);
                data.extend(row);
            }
        }
    }
    let mut header = [columns.to_be_bytes(), rows.to_be_bytes()].concat();
    header.extend([16, 0, 0, 0, 1]);
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    for (name, data) in [(b"IHDR", header), (b"IDAT", stored(&data)), (b"IEND", Vec::new())] {
        let named = [name, &data[..]].concat();
        bytes.extend((data.len() as u32).to_be_bytes());
        bytes.extend(&named);
        bytes.extend(crc32fast::hash(&named).to_be_bytes());
    }
    bytes
}

/// Bytes in the zlib format as one block without compression.
fn stored(bytes: &[u8]) -> Vec<u8> {
    let length = bytes.len() as u16;
    let (mut a, mut b) = (1, 0);
    for byte in bytes {
        a = (a + u32::from(*byte)) % 65521;
        b = (b + a) % 65521;
    }
    let (length, inverse) = (length.to_le_bytes(), (!length).to_le_bytes());
    [&[0x78, 1, 1], &length[..], &inverse, bytes, &(b << 16 | a).to_be_bytes()].concat()
}
