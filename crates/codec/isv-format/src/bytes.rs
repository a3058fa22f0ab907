//! Little-endian fields in and out of byte slices.

use crate::FormatError;

/// Takes fields off the front of a structure whose bytes are all there, and which begins at byte `at` of the stream.
pub(crate) struct ByteReader<'a> {
    bytes: &'a [u8],
    at: u64,
    inside: &'static str,
}

impl<'a> ByteReader<'a> {
    pub(crate) fn new(bytes: &'a [u8], at: u64, inside: &'static str) -> Self {
        Self { bytes, at, inside }
    }

    /// Offset in the stream of the next byte.
    pub(crate) fn at(&self) -> u64 {
        self.at
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    pub(crate) fn take(&mut self, count: usize) -> Result<&'a [u8], FormatError> {
        let Some((taken, rest)) = self.bytes.split_at_checked(count) else {
            // The structure is whole, or its checksum would be wrong: it is too short for what it states.
            let at = self.at + self.bytes.len() as u64;
            return Err(FormatError::malformed(at, format!("{} ends too early", self.inside)));
        };
        self.bytes = rest;
        self.at += count as u64;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], FormatError> {
        Ok(self.take(N)?.try_into().expect("take returns as many bytes as asked"))
    }

    pub(crate) fn u8(&mut self) -> Result<u8, FormatError> {
        Ok(self.array::<1>()?[0])
    }

    pub(crate) fn u16(&mut self) -> Result<u16, FormatError> {
        Ok(u16::from_le_bytes(self.array()?))
    }

    pub(crate) fn u32(&mut self) -> Result<u32, FormatError> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(crate) fn u64(&mut self) -> Result<u64, FormatError> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    /// An unsigned number of up to 32 bits: 7 bits a byte, lowest first, the top bit set on all but the last byte.
    pub(crate) fn varint(&mut self) -> Result<u32, FormatError> {
        let (at, mut value) = (self.at, 0u64);
        for shift in (0..35).step_by(7) {
            let byte = self.u8()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return u32::try_from(value).map_err(|_| FormatError::malformed(at, "number above 32 bits"));
            }
        }
        Err(FormatError::malformed(at, "number longer than 5 bytes"))
    }
}

/// Mirror of [`ByteReader::varint`].
pub(crate) fn put_varint(out: &mut Vec<u8>, mut value: u32) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn varint_roundtrips_and_refuses_more_than_32_bits() {
        for value in [0, 1, 127, 128, 300, 1 << 21, u32::MAX] {
            let mut bytes = Vec::new();
            put_varint(&mut bytes, value);
            let mut reader = ByteReader::new(&bytes, 0, "test");
            assert_eq!(reader.varint().unwrap(), value);
            assert!(reader.is_empty());
        }
        for bytes in [&[0xff, 0xff, 0xff, 0xff, 0x10][..], &[0x80; 6], &[0x80]] {
            assert!(ByteReader::new(bytes, 0, "test").varint().is_err());
        }
    }
}
