//! The parts of a frame's payload: geometry, and colour behind it.
//!
//! ```text
//! payload with colour = geometry part, colour part, length of the colour part as u32
//! ```
//!
//! The length stands at the end, so that the geometry part is the same bytes with and without colour.

use crate::{FormatError, MAX_PAYLOAD};

/// The parts of a frame's payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PayloadParts<'a> {
    /// Geometry part, for [`FramePayload::parse`](crate::FramePayload::parse).
    pub geometry: &'a [u8],
    /// Colour part; `None` if the frame has none.
    pub colour: Option<&'a [u8]>,
}

impl<'a> PayloadParts<'a> {
    /// Size (bytes) of the length behind a colour part.
    pub const LENGTH_BYTES: usize = 4;

    /// Splits a payload that has colour. `at` is where it begins in the stream.
    pub(crate) fn split(payload: &'a [u8], at: u64) -> Result<Self, FormatError> {
        let Some((parts, length)) = payload.split_last_chunk() else {
            return Err(FormatError::malformed(at, "a frame's payload ends before the length of its colour"));
        };
        let length = u32::from_le_bytes(*length);
        let geometry_bytes = parts.len().checked_sub(length as usize).ok_or_else(|| {
            let length_at = at + parts.len() as u64;
            FormatError::malformed(
                length_at,
                format!("a colour part of {length} bytes in a payload of fewer"),
            )
        })?;
        let (geometry, colour) = parts.split_at(geometry_bytes);
        Ok(Self { geometry, colour: Some(colour) })
    }

    /// The payload as bytes.
    ///
    /// # Errors
    /// A colour part above the limit of a payload.
    pub(crate) fn join(geometry: Vec<u8>, colour: &[u8], at: u64) -> Result<Vec<u8>, FormatError> {
        let total = geometry.len() + colour.len() + Self::LENGTH_BYTES;
        if total > MAX_PAYLOAD as usize {
            return Err(FormatError::payload_above(total as u64, MAX_PAYLOAD, at));
        }
        let mut payload = geometry;
        payload.reserve(colour.len() + Self::LENGTH_BYTES);
        payload.extend(colour);
        payload.extend((colour.len() as u32).to_le_bytes());
        Ok(payload)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_roundtrip_and_geometry_stays_as_it_is() {
        for (geometry, colour) in [(&b"geometry"[..], &b"colour"[..]), (b"geometry", b""), (b"", b"colour")] {
            let payload = PayloadParts::join(geometry.to_vec(), colour, 0).unwrap();
            assert!(payload.starts_with(geometry));
            let parts = PayloadParts::split(&payload, 0).unwrap();
            assert_eq!(parts, PayloadParts { geometry, colour: Some(colour) });
        }
    }

    #[test]
    fn a_length_beyond_the_payload_is_refused_where_it_stands() {
        for length in [4, 5, 1 << 30, u32::MAX] {
            let payload = [&b"abc"[..], &length.to_le_bytes()].concat();
            let error = PayloadParts::split(&payload, 100).unwrap_err();
            assert!(matches!(error, FormatError::Malformed { at: 103, .. }), "{error}");
        }
        for payload in [&b""[..], b"abc"] {
            assert!(matches!(PayloadParts::split(payload, 7), Err(FormatError::Malformed { at: 7, .. })));
        }
    }
}
