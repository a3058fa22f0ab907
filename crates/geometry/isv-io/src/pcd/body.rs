//! The points in a PCD file: `x y z`; if all three are there, `normal_x normal_y normal_z`; and colours, if they are asked for. Other
//! fields are skipped.

use super::header::{Encoding, Field, Header, Kind, READ};
use super::lzf;
use crate::cloud_builder::{CloudBuilder, check_compressed};
use crate::error::{Flaw, Malformation, quote};
use crate::raw_colours::Scale;
use crate::text::{self, parse_float};
use glam::DVec3;
use isv_volume::PointCloud;

/// Parses a PCD file in memory. Bytes after the last point are ignored, as other readers do.
///
/// Of an organised cloud, which is an image whose pixels are points, those without a reading are dropped: any of
/// their coordinates is NaN.
pub(crate) fn parse(bytes: &[u8], keeps_colours: bool) -> Result<PointCloud, Flaw> {
    let bytes = &text::decode(bytes);
    let header = Header::parse(bytes)?;
    let mut points = Points::new(&header, keeps_colours).map_err(|why| Flaw::at_line(header.lines, why))?;
    let body = &bytes[header.body_offset..];
    match header.encoding {
        Encoding::Ascii => points.read_text(body)?,
        Encoding::Binary => points.read_rows(body)?,
        Encoding::BinaryCompressed => points.read_columns(body)?,
    }
    Ok(points.cloud.finish(header.viewpoint))
}

/// Fields that a point is read from: x, y, z, the normal and a colour. The colour is packed into the first of
/// three fields or spread over them.
const COLUMNS: usize = 9;
const COLOUR: usize = 6;

struct Points<'a> {
    header: &'a Header,
    /// The fields that are read.
    columns: [Option<usize>; COLUMNS],
    /// Whether one field has all of a colour.
    packed: bool,
    cloud: CloudBuilder,
}

impl<'a> Points<'a> {
    fn new(header: &'a Header, keeps_colours: bool) -> Result<Self, Malformation> {
        let mut columns = [None; COLUMNS];
        columns[..COLOUR].copy_from_slice(&READ.map(|name| header.find(name)));
        if columns[..3].contains(&None) {
            return Err(Malformation::Missing { what: "fields x, y and z" });
        }
        let normals = !columns[3..COLOUR].contains(&None);
        if !normals {
            columns[3..COLOUR].fill(None);
        }
        let colours = if keeps_colours { Colours::find(header) } else { None };
        let scale = colours.as_ref().map(|colours| colours.scale);
        let packed = colours.as_ref().is_some_and(|colours| colours.packed);
        columns[COLOUR..].copy_from_slice(&colours.map(|colours| colours.columns).unwrap_or_default());
        Ok(Self { header, columns, packed, cloud: CloudBuilder::new(normals, 0).with_colours(scale) })
    }

    /// Takes the values of a point.
    fn push(&mut self, values: [f64; COLUMNS]) {
        let [x, y, z, nx, ny, nz, red, green, blue] = values;
        let position = DVec3::new(x, y, z);
        if !(self.header.organised && position.is_nan()) {
            self.cloud.push(position, DVec3::new(nx, ny, nz));
            // A packed colour is an integer by now.
            self.cloud.push_colour(if self.packed {
                unpacked(red as i64 as u32)
            } else {
                [red, green, blue]
            });
        }
    }

    /// The value of a column from its word.
    fn word(&self, slot: usize, word: &[u8]) -> Result<f64, Malformation> {
        let number = parse_float(word).ok_or_else(|| Malformation::Number { text: quote(word) })?;
        let field = self.columns[slot].map(|index| &self.header.fields[index]);
        match field {
            Some(field) if self.packed && slot == COLOUR && field.kind == Kind::Float => {
                Ok((number as f32).to_bits().into())
            }
            _ => Ok(number),
        }
    }

    /// A body of text: a point a line, the values of all fields between white space.
    fn read_text(&mut self, body: &[u8]) -> Result<(), Flaw> {
        let mut starts = Vec::new();
        let mut words_of_a_point = 0u64;
        for field in &self.header.fields {
            starts.push(words_of_a_point);
            words_of_a_point += field.count as u64;
        }
        let starts = self.columns.map(|column| column.map(|field| starts[field]));
        let lines = text::lines(body).enumerate().map(|(at, line)| (at, line.trim_ascii()));
        let mut lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with(b"#"));
        for found in 0..self.header.points {
            let (at, line) = lines.next().ok_or_else(|| self.truncated(found, body.len()))?;
            let line_number = self.header.lines + 1 + at;
            let values = self.text_row(line, starts, words_of_a_point);
            self.push(values.map_err(|why| Flaw::at_line(line_number, why))?);
        }
        Ok(())
    }

    /// A binary body: point after point, field after field.
    fn read_rows(&mut self, body: &[u8]) -> Result<(), Flaw> {
        let row_bytes: u64 = self.header.fields.iter().map(Field::bytes).sum();
        let room = body.len() as u64 / row_bytes;
        if room < self.header.points {
            return Err(self.truncated(room, body.len()));
        }
        if self.header.points == 0 {
            return Ok(());
        }
        // A row lies in the body, so that its length and all in it fit.
        let row_bytes = row_bytes as usize;
        let mut offsets = Vec::new();
        let mut offset = 0;
        for field in &self.header.fields {
            offsets.push(offset);
            offset += field.size * field.count;
        }
        for row in body.chunks_exact(row_bytes).take(self.header.points as usize) {
            self.push(self.values(|field| &row[offsets[field]..]));
        }
        Ok(())
    }

    /// A compressed body: two lengths, then field after field, each for all points.
    fn read_columns(&mut self, body: &[u8]) -> Result<(), Flaw> {
        let at = self.header.body_offset;
        let ends = || Flaw::at_byte(at + body.len(), Malformation::EndsBefore { what: "compressed points" });
        let (lengths, compressed) = body.split_first_chunk::<8>().ok_or_else(ends)?;
        let length = |at: usize| u32::from_le_bytes([0, 1, 2, 3].map(|byte| lengths[at + byte])) as usize;
        let compressed = compressed.get(..length(0)).ok_or_else(ends)?;
        let row_bytes: u64 = self.header.fields.iter().map(Field::bytes).sum();
        let fit = length(4) as u64 / row_bytes;
        if fit != self.header.points {
            let why = Malformation::PointCount { said: self.header.points, found: fit };
            return Err(Flaw::at_byte(at, why));
        }
        check_compressed(self.header.points, at + body.len()).map_err(|why| Flaw::at_byte(at, why))?;
        let unreadable = || Flaw::unreadable("PCD", at + 8, &"its LZF data is damaged");
        let columns = lzf::decompress(compressed, length(4)).ok_or_else(unreadable)?;
        if self.header.points == 0 {
            return Ok(());
        }
        let points = self.header.points as usize;
        let mut starts = Vec::new();
        let mut start = 0;
        for field in &self.header.fields {
            starts.push(start);
            start += field.size * field.count * points;
        }
        for point in 0..points {
            self.push(self.values(|index| {
                let field = &self.header.fields[index];
                &columns[starts[index] + point * field.size * field.count..]
            }));
        }
        Ok(())
    }

    /// A point's values, each from the bytes that its field starts with.
    fn values<'b>(&self, bytes_of: impl Fn(usize) -> &'b [u8]) -> [f64; COLUMNS] {
        let mut values = [0.0; COLUMNS];
        for (slot, column) in self.columns.iter().enumerate() {
            let Some(index) = *column else { continue };
            let bytes = bytes_of(index);
            values[slot] = match bytes.first_chunk() {
                // As a float, a packed colour may be NaN, which would not keep its bits.
                Some(bits) if self.packed && slot == COLOUR => u32::from_le_bytes(*bits).into(),
                _ => value(&self.header.fields[index], bytes),
            };
        }
        values
    }

    /// The values of a point from a line of `words` words; `starts` tells which ones.
    fn text_row(
        &self,
        line: &[u8],
        starts: [Option<u64>; COLUMNS],
        words: u64,
    ) -> Result<[f64; COLUMNS], Malformation> {
        let mut values = [0.0; COLUMNS];
        let mut found = 0;
        for word in text::words(line) {
            if let Some(slot) = starts.iter().position(|start| *start == Some(found)) {
                values[slot] = self.word(slot, word)?;
            }
            found += 1;
        }
        if found == words { Ok(values) } else { Err(Malformation::LineLength { too_many: found > words }) }
    }

    fn truncated(&self, found: u64, body_bytes: usize) -> Flaw {
        let why = Malformation::Truncated { rows: "points".to_owned(), promised: self.header.points, found };
        Flaw::at_byte(self.header.body_offset + body_bytes, why)
    }
}

/// The fields of a colour.
struct Colours {
    columns: [Option<usize>; 3],
    packed: bool,
    scale: Scale,
}

impl Colours {
    /// One field of 32 bits, `rgb` or `rgba`, or three fields.
    fn find(header: &Header) -> Option<Self> {
        let packed = ["rgb", "rgba"].iter().find_map(|name| header.find(name));
        if let Some(field) = packed.filter(|field| header.fields[*field].size == 4) {
            return Some(Self { columns: [Some(field), None, None], packed: true, scale: Scale::Byte });
        }
        let sets = [["r", "g", "b"], ["red", "green", "blue"]];
        let mut found = sets.iter().map(|names| names.map(|name| header.find(name)));
        let columns = found.find(|columns| !columns.contains(&None))?;
        let red = columns[0].map(|index| &header.fields[index])?;
        let scale = match (red.kind, red.size) {
            (Kind::Float, _) => Scale::Unit,
            (Kind::Unsigned, 2) => Scale::Short,
            _ => Scale::Byte,
        };
        Some(Self { columns, packed: false, scale })
    }
}

/// Red, green and blue of 8 bits each, from the third byte down; the highest is alpha or nothing.
fn unpacked(bits: u32) -> [f64; 3] {
    let [blue, green, red, _] = bits.to_le_bytes();
    [red, green, blue].map(f64::from)
}

/// The number that little-endian bytes start with.
fn value(field: &Field, bytes: &[u8]) -> f64 {
    let mut wide = [0; 8];
    wide[..field.size].copy_from_slice(&bytes[..field.size]);
    let bits = u64::from_le_bytes(wide);
    match field.kind {
        Kind::Float if field.size == 4 => f32::from_bits(bits as u32).into(),
        Kind::Float => f64::from_bits(bits),
        Kind::Unsigned => bits as f64,
        Kind::Signed => {
            let unused = 64 - 8 * field.size as u32;
            ((bits << unused) as i64 >> unused) as f64
        }
    }
}
