//! The points in a PCD file: `x y z` and, if all three are there, `normal_x normal_y normal_z`; other fields are skipped.

use super::header::{Encoding, Field, Header, Kind, READ};
use super::lzf;
use crate::cloud_builder::{CloudBuilder, check_compressed};
use crate::error::{Flaw, Malformation, quote};
use crate::text::{self, parse_float};
use glam::DVec3;
use isv_volume::PointCloud;

/// Parses a PCD file in memory. Bytes after the last point are ignored, as other readers do.
///
/// Of an organised cloud, which is an image whose pixels are points, those without a reading are dropped: any of
/// their coordinates is NaN.
pub(crate) fn parse(bytes: &[u8]) -> Result<PointCloud, Flaw> {
    let bytes = &text::decode(bytes);
    let header = Header::parse(bytes)?;
    let mut points = Points::new(&header).map_err(|why| Flaw::at_line(header.lines, why))?;
    let body = &bytes[header.body_offset..];
    match header.encoding {
        Encoding::Ascii => points.read_text(body)?,
        Encoding::Binary => points.read_rows(body)?,
        Encoding::BinaryCompressed => points.read_columns(body)?,
    }
    Ok(points.cloud.finish(header.viewpoint))
}

struct Points<'a> {
    header: &'a Header,
    /// The fields of x, y, z and of the normal.
    columns: [Option<usize>; 6],
    cloud: CloudBuilder,
}

impl<'a> Points<'a> {
    fn new(header: &'a Header) -> Result<Self, Malformation> {
        let mut columns = READ.map(|name| header.find(name));
        if columns[..3].contains(&None) {
            return Err(Malformation::Missing { what: "fields x, y and z" });
        }
        let normals = !columns[3..].contains(&None);
        if !normals {
            columns[3..].fill(None);
        }
        Ok(Self { header, columns, cloud: CloudBuilder::new(normals, 0) })
    }

    /// Takes a point's x, y, z and normal.
    fn push(&mut self, values: [f64; 6]) {
        let [x, y, z, nx, ny, nz] = values;
        let position = DVec3::new(x, y, z);
        if !(self.header.organised && position.is_nan()) {
            self.cloud.push(position, DVec3::new(nx, ny, nz));
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
            let values = text_row(line, starts, words_of_a_point);
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
    fn values<'b>(&self, bytes_of: impl Fn(usize) -> &'b [u8]) -> [f64; 6] {
        self.columns
            .map(|column| column.map_or(0.0, |index| value(&self.header.fields[index], bytes_of(index))))
    }

    fn truncated(&self, found: u64, body_bytes: usize) -> Flaw {
        let why = Malformation::Truncated { rows: "points".to_owned(), promised: self.header.points, found };
        Flaw::at_byte(self.header.body_offset + body_bytes, why)
    }
}

/// The values of a point from a line of `words` words; `starts` tells which ones.
fn text_row(line: &[u8], starts: [Option<u64>; 6], words: u64) -> Result<[f64; 6], Malformation> {
    let mut values = [0.0; 6];
    let mut found = 0;
    for word in text::words(line) {
        if let Some(slot) = starts.iter().position(|start| *start == Some(found)) {
            values[slot] = parse_float(word).ok_or_else(|| Malformation::Number { text: quote(word) })?;
        }
        found += 1;
    }
    if found == words { Ok(values) } else { Err(Malformation::LineLength { too_many: found > words }) }
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
