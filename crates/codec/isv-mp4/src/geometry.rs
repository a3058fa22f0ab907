//! The track of geometry: its sample entry, its timescale, the name of its codec.

use crate::boxes::{boxes, find, write_box};
use crate::{Mp4Error, TrackDescription, TrackKind};
use isv_format::{FrameRate, Profile, StreamHeader};

/// Type of the sample entry.
pub(crate) const SAMPLE_ENTRY: [u8; 4] = *b"isv1";
/// Type of the box that holds the stream's first bytes.
const CONFIGURATION: [u8; 4] = *b"isvC";
/// Bytes of a sample entry before its boxes: reserved, data reference index, compressor name.
const FIELDS: usize = 6 + 2 + 32;
/// Least units of time a second.
const FINEST: u32 = 10_000;

/// Describes the track of a stream. `configuration` holds the bytes of the stream before its first frame.
pub(crate) fn describe(header: &StreamHeader, configuration: &[u8]) -> TrackDescription {
    let mut entry = Vec::new();
    write_box(&mut entry, &SAMPLE_ENTRY, |out| {
        out.extend([0, 0, 0, 0, 0, 0, 0, 1]);
        let mut name = [0; 32];
        name[..4].copy_from_slice(b"\x03isv");
        out.extend(name);
        write_box(out, &CONFIGURATION, |out| out.extend(configuration));
    });
    TrackDescription::new(TrackKind::Geometry, timescale(header.frame_rate), entry)
}

/// Units of time a second in which a frame of this rate has a whole duration.
fn timescale(rate: FrameRate) -> u32 {
    rate.numerator.checked_mul(FINEST.div_ceil(rate.numerator)).unwrap_or(rate.numerator)
}

/// Finds the bytes of a stream before its first frame in a sample entry.
pub(crate) fn configuration(entry: &[u8]) -> Result<&[u8], Mp4Error> {
    let lacks = || Mp4Error::malformed(0, "the sample entry of geometry has no box isvC");
    let inside = entry.get(8 + FIELDS..).ok_or_else(lacks)?;
    find(&boxes(inside, 0)?, &CONFIGURATION).map(|found| found.body).ok_or_else(lacks)
}

/// Name of the codec as manifests state it (RFC 6381): `isv1`, number of the profile, version of the format.
#[must_use]
pub fn codec_string(header: &StreamHeader) -> String {
    let profile = match header.profile {
        Profile::Paper(_) => 0,
        Profile::Main => 1,
    };
    format!("isv1.{profile}.{}", header.version.number())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_have_whole_durations() {
        for (numerator, denominator, expected) in
            [(30, 1, 10_020), (30_000, 1001, 30_000), (25, 2, 10_000), (1, 7, 10_000)]
        {
            let rate = FrameRate { numerator, denominator };
            assert_eq!(timescale(rate), expected);
            assert_eq!(u64::from(timescale(rate)) * u64::from(denominator) % u64::from(numerator), 0);
        }
        assert_eq!(timescale(FrameRate { numerator: u32::MAX, denominator: 1 }), u32::MAX);
    }
}
