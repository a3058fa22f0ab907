//! NumPy's array files, as `numpy.lib.format` documents them. They have a magic number, a version, a header
//! that is the text of a Python dictionary, and the elements in C order.
//!
//! Our own reader, as the header has but three fixed entries; the crate for it brings a parser of Python literals and big
//! numbers along.

use super::ArrayFlaw;
use crate::error::quote;

const MAGIC: &[u8] = b"\x93NUMPY";
/// Elements begin at a multiple of this in files that are written.
const ALIGNMENT: usize = 64;
/// NumPy arrays have no more axes.
const MAX_AXES: usize = 32;

/// A file's bytes, understood as an array whose elements are all there.
#[derive(Debug)]
pub(super) struct Array {
    bytes: Vec<u8>,
    data_at: usize,
    element: Element,
    pub(super) shape: Vec<usize>,
    /// Whether the first axis runs fastest, and not the last.
    fortran_order: bool,
}

/// Type of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Element {
    kind: Kind,
    bytes: usize,
    big_endian: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Bool,
    Signed,
    Unsigned,
    Float,
}

/// Which elements a caller can use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wanted {
    Integers,
    Floats,
    /// Floats, or signed integers that count parts of the largest one.
    Distances,
    Numbers,
}

impl Array {
    /// Understands the header and checks type, order and length.
    pub(super) fn parse(bytes: Vec<u8>, wanted: Wanted) -> Result<Self, ArrayFlaw> {
        let array = Self::parse_in_any_order(bytes, wanted)?;
        if array.fortran_order { Err(ArrayFlaw::FortranOrder) } else { Ok(array) }
    }

    /// Understands the header and checks type and length; the elements may be in Fortran order.
    pub(super) fn parse_in_any_order(bytes: Vec<u8>, wanted: Wanted) -> Result<Self, ArrayFlaw> {
        let (header, data_at) = split_header(&bytes)?;
        let not_understood = || ArrayFlaw::Header { text: quote(header) };
        let text = std::str::from_utf8(header).map_err(|_| not_understood())?;
        let entries = Literal(text).dictionary().ok_or_else(not_understood)?;
        let element = Element::parse(entries.descr, wanted)?;
        let mut promised = element.bytes as u128;
        for extent in &entries.shape {
            promised = promised.saturating_mul(*extent as u128);
        }
        let found = bytes.len() - data_at;
        if promised != found as u128 {
            return Err(ArrayFlaw::Length { promised, found });
        }
        let Entries { shape, fortran_order, .. } = entries;
        Ok(Self { bytes, data_at, element, shape, fortran_order })
    }

    /// How many elements lie between neighbours along each axis.
    pub(super) fn strides(&self) -> Vec<usize> {
        let mut strides = vec![1; self.shape.len()];
        for axis in 1..self.shape.len() {
            let (to, from) = if self.fortran_order {
                (axis, axis - 1)
            } else {
                (self.shape.len() - 1 - axis, self.shape.len() - axis)
            };
            strides[to] = strides[from] * self.shape[from];
        }
        strides
    }

    /// The largest number of a signed integer type; 1 for floats.
    pub(super) fn full_scale(&self) -> f64 {
        match self.element.kind {
            Kind::Signed => 2f64.powi(8 * self.element.bytes as i32 - 1) - 1.0,
            _ => 1.0,
        }
    }

    /// Whether elements are whole numbers.
    pub(super) fn is_integer(&self) -> bool {
        self.element.kind != Kind::Float
    }

    /// How many elements there are.
    pub(super) fn count(&self) -> usize {
        (self.bytes.len() - self.data_at) / self.element.bytes
    }

    /// An element by its place in memory, as a number; integers beyond `2^53` are rounded.
    pub(super) fn at(&self, place: usize) -> f64 {
        let size = self.element.bytes;
        self.element.number(&self.bytes[self.data_at + place * size..][..size])
    }

    /// Elements `start .. start + out.len()` in C order, as numbers; integers beyond `2^53` are rounded.
    pub(super) fn read(&self, start: usize, out: &mut [f64]) {
        let size = self.element.bytes;
        let bytes = &self.bytes[self.data_at + start * size..][..out.len() * size];
        for (value, bytes) in out.iter_mut().zip(bytes.chunks_exact(size)) {
            *value = self.element.number(bytes);
        }
    }
}

/// The shape that a header states, of which a prefix of the file may be given.
pub(super) fn shape_of(bytes: &[u8]) -> Option<Vec<usize>> {
    let (header, _) = split_header(bytes).ok()?;
    Some(Literal(std::str::from_utf8(header).ok()?).dictionary()?.shape)
}

/// The text of the header, and where the elements begin.
fn split_header(bytes: &[u8]) -> Result<(&[u8], usize), ArrayFlaw> {
    let rest = bytes.strip_prefix(MAGIC).ok_or(ArrayFlaw::NotNpy)?;
    let (&[major, minor], rest) = rest.split_first_chunk().ok_or(ArrayFlaw::HeaderEnd)?;
    let (length, rest) = match (major, minor) {
        (1, 0) => rest.split_first_chunk().map(|(n, rest)| (usize::from(u16::from_le_bytes(*n)), rest)),
        (2 | 3, 0) => rest.split_first_chunk().map(|(n, rest)| (u32::from_le_bytes(*n) as usize, rest)),
        _ => return Err(ArrayFlaw::Version { major, minor }),
    }
    .ok_or(ArrayFlaw::HeaderEnd)?;
    let header = rest.get(..length).ok_or(ArrayFlaw::HeaderEnd)?;
    Ok((header, bytes.len() - rest.len() + length))
}

impl Element {
    /// From NumPy's name: byte order, kind, bytes.
    fn parse(descr: &str, wanted: Wanted) -> Result<Self, ArrayFlaw> {
        let (fits, names): (fn(Kind) -> bool, _) = match wanted {
            Wanted::Integers => (|k| matches!(k, Kind::Signed | Kind::Unsigned), "int32 or another integer"),
            Wanted::Floats => (|k| k == Kind::Float, "float16, float32 or float64"),
            Wanted::Distances => (
                |k| matches!(k, Kind::Float | Kind::Signed),
                "float16, float32, float64 or a signed integer: distances have two signs",
            ),
            Wanted::Numbers => (|_| true, "a boolean, an integer or a float"),
        };
        let other = || ArrayFlaw::Type { found: quote(descr.as_bytes()), wanted: names };
        let [order, kind, size] = <[u8; 3]>::try_from(descr.as_bytes()).map_err(|_| other())?;
        let kind = match (kind, size) {
            (b'b', b'1') => Kind::Bool,
            (b'i', b'1' | b'2' | b'4' | b'8') => Kind::Signed,
            (b'u', b'1' | b'2' | b'4' | b'8') => Kind::Unsigned,
            (b'f', b'2' | b'4' | b'8') => Kind::Float,
            _ => return Err(other()),
        };
        if !matches!(order, b'<' | b'>' | b'|') || !fits(kind) {
            return Err(other());
        }
        Ok(Self { kind, bytes: usize::from(size - b'0'), big_endian: order == b'>' })
    }

    fn number(self, bytes: &[u8]) -> f64 {
        let bits = if self.big_endian {
            bytes.iter().fold(0, |bits, byte| bits << 8 | u64::from(*byte))
        } else {
            bytes.iter().rev().fold(0, |bits, byte| bits << 8 | u64::from(*byte))
        };
        let unused = 64 - 8 * self.bytes as u32;
        match (self.kind, self.bytes) {
            (Kind::Bool | Kind::Unsigned, _) => bits as f64,
            (Kind::Signed, _) => ((bits << unused) as i64 >> unused) as f64,
            (Kind::Float, 2) => half_to_f64(bits as u16),
            (Kind::Float, 4) => f64::from(f32::from_bits(bits as u32)),
            (Kind::Float, _) => f64::from_bits(bits),
        }
    }
}

/// Value of an IEEE 754 half.
fn half_to_f64(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff) / 1024.0);
    let magnitude = match exponent {
        0 => fraction * 2f64.powi(-14),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction) * 2f64.powi(exponent - 15),
    };
    if bits >> 15 == 0 { magnitude } else { -magnitude }
}

/// What is left of a Python literal.
struct Literal<'a>(&'a str);

/// The header's entries.
struct Entries<'a> {
    descr: &'a str,
    fortran_order: bool,
    shape: Vec<usize>,
}

impl<'a> Literal<'a> {
    /// `{'descr': '<f4', 'fortran_order': False, 'shape': (3, 4), }`, in any order, and nothing after it.
    fn dictionary(mut self) -> Option<Entries<'a>> {
        let (mut descr, mut fortran_order, mut shape) = (None, None, None);
        self.take("{")?;
        while self.take("}").is_none() {
            let key = self.string()?;
            self.take(":")?;
            match key {
                "descr" => descr = Some(self.string()?),
                "fortran_order" => fortran_order = Some(self.boolean()?),
                "shape" => shape = Some(self.shape()?),
                _ => return None,
            }
            if self.take(",").is_none() {
                self.take("}")?;
                break;
            }
        }
        let whole = self.0.trim().is_empty();
        whole.then_some(Entries { descr: descr?, fortran_order: fortran_order?, shape: shape? })
    }

    /// Passes over white space and a token, if that comes next.
    fn take(&mut self, token: &str) -> Option<()> {
        self.0 = self.0.trim_start().strip_prefix(token)?;
        Some(())
    }

    fn string(&mut self) -> Option<&'a str> {
        let rest = self.0.trim_start();
        let mark = rest.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
        let (text, rest) = rest[1..].split_once(mark)?;
        self.0 = rest;
        Some(text)
    }

    fn boolean(&mut self) -> Option<bool> {
        match self.take("True") {
            Some(()) => Some(true),
            None => self.take("False").map(|()| false),
        }
    }

    /// A tuple of whole numbers.
    fn shape(&mut self) -> Option<Vec<usize>> {
        let mut extents = Vec::new();
        self.take("(")?;
        while self.take(")").is_none() {
            self.0 = self.0.trim_start();
            let digits = self.0.find(|c: char| !c.is_ascii_digit())?;
            let (number, rest) = self.0.split_at(digits);
            extents.push(number.parse().ok().filter(|_| extents.len() < MAX_AXES)?);
            self.0 = rest;
            if self.take(",").is_none() {
                self.take(")")?;
                break;
            }
        }
        Some(extents)
    }
}

/// The bytes before the elements of an array of this type and shape in C order, format 1.0.
pub(super) fn header(descr: &str, shape: &[usize]) -> Vec<u8> {
    let extents: String = shape.iter().map(|extent| format!("{extent}, ")).collect();
    let mut text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({extents}), }}");
    let unpadded = MAGIC.len() + 4 + text.len() + 1;
    text.extend(std::iter::repeat_n(' ', unpadded.next_multiple_of(ALIGNMENT) - unpadded));
    text.push('\n');
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn file(text: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        [&bytes, text.as_bytes(), data].concat()
    }

    fn numbers(descr: &str, data: &[u8], count: usize) -> Vec<f64> {
        let text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({count},), }}\n");
        let array = Array::parse(file(&text, data), Wanted::Numbers).unwrap();
        let mut out = vec![0.0; count];
        array.read(0, &mut out);
        out
    }

    #[test]
    fn every_type_and_byte_order_is_read() {
        assert_eq!(numbers("|b1", &[0, 1], 2), [0.0, 1.0]);
        assert_eq!(numbers("|i1", &[0x80, 3], 2), [-128.0, 3.0]);
        assert_eq!(numbers("<u2", &[1, 2], 1), [513.0]);
        assert_eq!(numbers(">i4", &[0xff, 0xff, 0xff, 0xfe], 1), [-2.0]);
        assert_eq!(numbers("<i8", &(-7i64).to_le_bytes(), 1), [-7.0]);
        assert_eq!(numbers(">f4", &(-0.25f32).to_be_bytes(), 1), [-0.25]);
        assert_eq!(numbers("<f8", &0.1f64.to_le_bytes(), 1), [0.1]);
    }

    #[test]
    fn halves_have_their_values() {
        let values = [(0x3c00, 1.0), (0xc000, -2.0), (0x3555, 1365.0 / 4096.0), (0x0001, 2f64.powi(-24))];
        for (bits, value) in values.into_iter().chain([(0x7bff, 65504.0), (0xfc00, f64::NEG_INFINITY)]) {
            assert_eq!(half_to_f64(bits), value);
        }
        assert!(half_to_f64(0x7e00).is_nan());
    }

    #[test]
    fn headers_are_understood_however_they_are_written() {
        for text in [
            "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 1), }      \n",
            "{\"shape\":(2,1),\"fortran_order\":False,\"descr\":\"<f4\"}",
        ] {
            assert_eq!(Array::parse(file(text, &[0; 8]), Wanted::Floats).unwrap().shape, [2, 1]);
        }
        let scalar = "{'descr': '<f4', 'fortran_order': False, 'shape': (), }";
        assert!(Array::parse(file(scalar, &[0; 4]), Wanted::Floats).unwrap().shape.is_empty());
        let long =
            [b"\x93NUMPY\x02\x00", &(scalar.len() as u32).to_le_bytes()[..], scalar.as_bytes()].concat();
        assert!(Array::parse([long, vec![0; 4]].concat(), Wanted::Floats).is_ok());
    }

    #[test]
    fn what_cannot_be_used_is_said() {
        let parse = |text: &str, data: &[u8], wanted| Array::parse(file(text, data), wanted).unwrap_err();
        let of = |descr: &str| format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (1,), }}");
        assert_eq!(Array::parse(b"PK".to_vec(), Wanted::Floats).unwrap_err(), ArrayFlaw::NotNpy);
        assert_eq!(
            Array::parse(b"\x93NUMPY\x09\x00ab".to_vec(), Wanted::Floats).unwrap_err(),
            ArrayFlaw::Version { major: 9, minor: 0 }
        );
        assert_eq!(
            Array::parse(b"\x93NUMPY\x01\x00\xff\xff{".to_vec(), Wanted::Floats).unwrap_err(),
            ArrayFlaw::HeaderEnd
        );
        assert!(matches!(parse(&of("<i4"), &[0; 4], Wanted::Floats), ArrayFlaw::Type { .. }));
        assert!(matches!(parse(&of("<c8"), &[0; 8], Wanted::Numbers), ArrayFlaw::Type { .. }));
        assert!(matches!(parse(&of("|O"), &[0; 8], Wanted::Numbers), ArrayFlaw::Type { .. }));
        let fortran = of("<f4").replace("False", "True");
        assert_eq!(parse(&fortran, &[0; 4], Wanted::Floats), ArrayFlaw::FortranOrder);
        assert_eq!(parse(&of("<f4"), &[0; 3], Wanted::Floats), ArrayFlaw::Length { promised: 4, found: 3 });
        let huge = of("<f4").replace("(1,)", "(18446744073709551615, 18446744073709551615)");
        assert!(matches!(parse(&huge, &[], Wanted::Floats), ArrayFlaw::Length { .. }));
        assert!(matches!(parse("{'descr': [('x', '<f4')]}", &[], Wanted::Floats), ArrayFlaw::Header { .. }));
    }

    #[test]
    fn a_written_header_is_aligned_and_read_back() {
        let bytes = [header("<f4", &[2, 3]), vec![0; 24]].concat();
        assert_eq!((bytes.len() - 24) % ALIGNMENT, 0);
        assert_eq!(Array::parse(bytes, Wanted::Floats).unwrap().shape, [2, 3]);
    }

    proptest! {
        #[test]
        fn any_header_is_read_or_refused(text in "[{}'a-z0-9:<, ()FTes]{0,60}", data in prop::collection::vec(any::<u8>(), 0..20)) {
            let _ = Array::parse(file(&text, &data), Wanted::Numbers);
        }
    }
}
