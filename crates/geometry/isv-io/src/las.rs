//! LAS and LAZ, the lidar files of the ASPRS "LAS Specification 1.4 - R15" and its predecessors back to 1.0.
//!
//! A header says how many records there are, how long they are and how their integers become coordinates; a
//! record is a point. In LAZ the records are compressed, as a variable length record of the header says; that
//! is left to the crate `laz`. The header is read here. Twelve numbers of it are needed, and every count
//! among them is held against the length of the file before it is believed.

mod gps_times;
mod header;
mod laszip;

use crate::cloud_builder::{CloudBuilder, check_compressed};
use crate::error::{Flaw, Malformation};
use crate::raw_colours::Scale;
use glam::DVec3;
use header::{Header, u16_at};
use isv_volume::PointCloud;

/// Parses a LAS or LAZ file in memory; which of the two, its header tells. Points marked as withheld, which the
/// specification calls synonymous with deleted, are dropped. There are no normals and no viewpoint. Colours of 16 bits are read if they
/// are asked for; they have 8 bits if none of the file is larger than 255.
pub(crate) fn parse(bytes: &[u8], keeps_colours: bool) -> Result<PointCloud, Flaw> {
    let header = Header::parse(bytes)?;
    let colours = colours_at(header.format).filter(|_| keeps_colours);
    let cloud = CloudBuilder::new(false, 0).with_colours(colours.map(|_| Scale::Short));
    let mut points = Points { cloud, colours, header: &header };
    if header.compressed {
        check_compressed(header.points, bytes.len()).map_err(|why| Flaw::at_byte(bytes.len(), why))?;
        laszip::decompress(bytes, &header, colours.is_some(), |record| points.push(record))?;
    } else {
        let records = &bytes[header.points_offset..];
        let found = (records.len() / header.record_bytes) as u64;
        if found < header.points {
            let (rows, promised) = ("points".to_owned(), header.points);
            let why = Malformation::Truncated { rows, promised, found };
            return Err(Flaw::at_byte(bytes.len(), why));
        }
        let records = records.chunks_exact(header.record_bytes).take(header.points as usize);
        records.for_each(|record| points.push(record));
    }
    let mut cloud = points.cloud.finish(None);
    // Many programs write formats with colours and leave them zero.
    if cloud.colours.iter().all(|colour| *colour == [0; 3]) {
        cloud.colours.clear();
    }
    Ok(cloud)
}

/// Place of red, green and blue in the records of a point format that has them.
fn colours_at(format: u8) -> Option<usize> {
    match format {
        2 => Some(20),
        3 | 5 => Some(28),
        7 | 8 | 10 => Some(30),
        _ => None,
    }
}

/// Whether the point format has colours.
pub(crate) fn has_colours(start: &[u8]) -> bool {
    start.starts_with(b"LASF") && start.get(104).is_some_and(|format| colours_at(format & 0x3f).is_some())
}

/// GPS time of the first point, in seconds, where the point format has one. A compressed point is written as it is where a chunk starts,
/// behind the place of the table of chunks.
pub(crate) fn first_time_s(bytes: &[u8]) -> Option<f64> {
    let header = Header::parse(bytes).ok().filter(|header| header.points > 0)?;
    let offset = match header.format {
        1 | 3 | 4 | 5 => 20,
        6..=10 => 22,
        _ => return None,
    };
    let start = header.points_offset + if header.compressed { size_of::<i64>() } else { 0 };
    let time = bytes.get(start..)?.get(offset..)?.first_chunk()?;
    Some(f64::from_le_bytes(*time))
}

struct Points<'a> {
    header: &'a Header,
    /// Place of the colour in a record, if it is asked for.
    colours: Option<usize>,
    cloud: CloudBuilder,
}

impl Points<'_> {
    /// Takes a record: X, Y and Z are its first twelve bytes in every point format, the mark its sixteenth.
    fn push(&mut self, record: &[u8]) {
        let withheld = if self.header.format < 6 { 1 << 7 } else { 1 << 2 };
        if record[15] & withheld == 0 {
            let raw = [0, 4, 8].map(|at| i32::from_le_bytes([0, 1, 2, 3].map(|byte| record[at + byte])));
            let raw = DVec3::from(raw.map(f64::from));
            self.cloud.push(raw * self.header.scale + self.header.offset, DVec3::ZERO);
            if let Some(at) = self.colours {
                self.cloud.push_colour([0, 2, 4].map(|channel| u16_at(record, at + channel).into()));
            }
        }
    }
}
