//! Boxes as bytes: containers written around boxes of the library, and boxes found without parsing what is in them.

use crate::Mp4Error;
use mp4_atom::{Decode, DecodeMaybe, Encode, Header};

/// Type of a box.
pub(crate) type Kind = [u8; 4];

/// Writes a box around what `body` writes.
pub(crate) fn write_box(out: &mut Vec<u8>, kind: &Kind, body: impl FnOnce(&mut Vec<u8>)) {
    let at = out.len();
    out.extend([0; 4]);
    out.extend(kind);
    body(out);
    let size = u32::try_from(out.len() - at).expect("boxes of tables are below 4 GiB");
    out[at..at + 4].copy_from_slice(&size.to_be_bytes());
}

/// Writes a full box, of version 0 and without flags, around what `body` writes.
pub(crate) fn write_full_box(out: &mut Vec<u8>, kind: &Kind, body: impl FnOnce(&mut Vec<u8>)) {
    write_box(out, kind, |out| {
        out.extend([0; 4]);
        body(out);
    });
}

/// Writes a box that the library knows.
pub(crate) fn put(out: &mut Vec<u8>, atom: &impl Encode) {
    atom.encode(out).expect("every field is in its range");
}

/// A box in bytes.
#[derive(Clone, Copy)]
pub(crate) struct RawBox<'a> {
    pub kind: Kind,
    /// Header and body.
    pub whole: &'a [u8],
    pub body: &'a [u8],
}

/// The boxes that bytes consist of. `at` is where they begin in the file.
pub(crate) fn boxes(bytes: &[u8], at: u64) -> Result<Vec<RawBox<'_>>, Mp4Error> {
    let (mut found, mut rest) = (Vec::new(), bytes);
    loop {
        let (begin, mut behind) = (rest, rest);
        let offset = at + (bytes.len() - rest.len()) as u64;
        let broken = |what: &str| Mp4Error::malformed(offset, what);
        // Some writers end a container with fewer bytes than a header has.
        let Some(header) = <Header as DecodeMaybe>::decode_maybe(&mut behind)
            .map_err(|_| broken("a box of a wrong size"))?
        else {
            return Ok(found);
        };
        let size = header.size.unwrap_or(behind.len());
        let body = behind.get(..size).ok_or_else(|| broken("a box reaches beyond the one around it"))?;
        let whole = &begin[..begin.len() - behind.len() + size];
        found.push(RawBox { kind: header.kind.into(), whole, body });
        rest = &behind[size..];
    }
}

/// The first box of a type.
pub(crate) fn find<'a>(boxes: &[RawBox<'a>], kind: &Kind) -> Option<RawBox<'a>> {
    boxes.iter().find(|one| one.kind == *kind).copied()
}

/// Parses a box that the library knows.
pub(crate) fn parse<T: Decode>(found: RawBox<'_>, at: u64) -> Result<T, Mp4Error> {
    T::decode(&mut &found.whole[..]).map_err(|error| {
        let name = String::from_utf8_lossy(&found.kind).into_owned();
        Mp4Error::malformed(at, format!("box {name}: {error}"))
    })
}
