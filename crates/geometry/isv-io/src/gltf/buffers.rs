//! The bytes of buffers: of the binary chunk, of `data:` addresses, of files beside the glTF file.

use super::fault::GltfFault;
use super::schema::Buffer;
use crate::error::{Flaw, quote};
use crate::inside::inside;
use crate::regular_file;
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::percent_decode_str;
use std::borrow::Cow;
use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

/// Padding at the end of base64 is often forgotten.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// The buffers of a file. Those of the same address share their bytes, so that memory is bounded by what is on the disk.
pub(super) struct Buffers<'a> {
    sources: Vec<Cow<'a, [u8]>>,
    /// For each buffer, its place in `sources` and its length.
    buffers: Vec<(usize, usize)>,
}

impl<'a> Buffers<'a> {
    /// Loads all buffers; addresses are relative to `folder`, without which no other file is read; `binary` is the chunk of a binary
    /// file.
    pub(super) fn load(
        list: &'a [Buffer],
        folder: Option<&Path>,
        binary: Option<&'a [u8]>,
    ) -> Result<Self, Flaw> {
        let mut loaded =
            Self { sources: vec![Cow::Borrowed(binary.unwrap_or_default())], buffers: Vec::new() };
        let mut places: HashMap<&str, usize> = HashMap::new();
        for (index, buffer) in list.iter().enumerate() {
            let flaw = |fault: GltfFault| Flaw::in_object("buffer", index, fault);
            if buffer.is_fallback() {
                loaded.buffers.push((0, 0));
                continue;
            }
            let known = buffer.uri.as_deref().map_or(Some(0), |uri| places.get(uri).copied());
            let place = known.unwrap_or(loaded.sources.len());
            if let (None, Some(uri)) = (known, buffer.uri.as_deref()) {
                let bytes = fetch(uri, folder, buffer.byte_length).map_err(flaw)?;
                loaded.sources.push(Cow::Owned(bytes));
                places.insert(uri, place);
            }
            let found = loaded.sources[place].len();
            if found < buffer.byte_length {
                let promised = buffer.byte_length as u64;
                return Err(flaw(GltfFault::Truncated { part: "bytes", promised, found: found as u64 }));
            }
            loaded.buffers.push((place, buffer.byte_length));
        }
        Ok(loaded)
    }

    /// The bytes of a buffer, if there is one of the index.
    pub(super) fn get(&self, index: usize) -> Option<&[u8]> {
        self.buffers.get(index).map(|(place, length)| &self.sources[*place][..*length])
    }

    /// How many buffers there are.
    pub(super) fn len(&self) -> usize {
        self.buffers.len()
    }

    /// Bytes of all of them, each counted once.
    pub(super) fn total_bytes(&self) -> usize {
        self.sources.iter().map(|source| source.len()).sum()
    }
}

fn fetch(uri: &str, folder: Option<&Path>, least_bytes: usize) -> Result<Vec<u8>, GltfFault> {
    let refused = |why| GltfFault::Uri { uri: quote(uri.as_bytes()), why };
    if let Some(data) = data_of(uri) {
        return data.map_err(refused);
    }
    let folder = folder.ok_or(refused("is another file, and this one came without any"))?;
    let path = path_inside(folder, uri).map_err(refused)?;
    read_file(&path, least_bytes)
        .map_err(|cause| GltfFault::File { uri: quote(uri.as_bytes()), cause: cause.to_string() })
}

/// The bytes of an address that holds them, or why it does not; `None` for the address of a file.
pub(super) fn data_of(uri: &str) -> Option<Result<Vec<u8>, &'static str>> {
    let data = uri.strip_prefix("data:")?;
    let text = data.split_once(";base64,").map(|(_, text)| text);
    Some(match text {
        Some(text) => BASE64.decode(text).map_err(|_| "is broken base64"),
        None => Err("is data, but not base64"),
    })
}

/// The path that an address means. What does not lie in the folder of the glTF file or below is refused, so that opening a
/// file from elsewhere reads nothing else.
fn path_inside(folder: &Path, uri: &str) -> Result<PathBuf, &'static str> {
    let decoded = name_of(uri).map_err(|why| match why {
        REMOTE => "is absolute or remote; buffers must lie beside the file",
        why => why,
    })?;
    inside(folder, &decoded).ok_or("leaves the folder of the file; buffers must lie beside it")
}

/// Refusal of an address that is no name of a file.
const REMOTE: &str = "is absolute or remote; linked files must lie beside the file";

/// The name of a file that an address means.
pub(super) fn name_of(uri: &str) -> Result<Cow<'_, str>, &'static str> {
    let decoded = percent_decode_str(uri).decode_utf8().map_err(|_| "is not UTF-8")?;
    let scheme = decoded
        .split_once(':')
        .is_some_and(|(scheme, _)| scheme.bytes().all(|b| b.is_ascii_alphanumeric() || b"+-.".contains(&b)));
    if scheme { Err(REMOTE) } else { Ok(decoded) }
}

/// Reads a file that has at least the bytes that are wanted.
fn read_file(path: &Path, least_bytes: usize) -> io::Result<Vec<u8>> {
    let (_, length) = regular_file::open(path)?;
    if length < least_bytes as u64 {
        let message = format!("it has {length} bytes where {least_bytes} are needed");
        return Err(io::Error::new(io::ErrorKind::UnexpectedEof, message));
    }
    regular_file::read(path)
}

#[cfg(test)]
mod tests {
    use super::super::schema::BufferExtensions;
    use super::*;

    #[test]
    fn addresses_stay_in_the_folder() {
        let relative_path = |uri| path_inside(Path::new("take"), uri);
        assert_eq!(relative_path("a%20b/c.bin"), Ok(PathBuf::from("take/a b/c.bin")));
        assert!(relative_path("./c.bin").is_ok());
        for bad in [
            "/etc/passwd",
            "../c.bin",
            "a/../../c.bin",
            "%2e%2e/c.bin",
            "http://host/c.bin",
            "file:///c",
            "C:\\c",
            "%ff",
        ] {
            assert!(relative_path(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn buffers_of_one_address_share_their_bytes() {
        let uri = Some("data:application/octet-stream;base64,AQIDBA".to_owned());
        let list = [3, 4, 1].map(|byte_length| Buffer {
            uri: uri.clone(),
            byte_length,
            extensions: BufferExtensions::default(),
        });
        let buffers = Buffers::load(&list, None, Some(&[9; 10])).unwrap();
        assert_eq!((buffers.get(0).unwrap(), buffers.get(2).unwrap()), (&[1, 2, 3][..], &[1][..]));
        assert_eq!(buffers.total_bytes(), 14);
        let long = [Buffer { uri, byte_length: 5, extensions: BufferExtensions::default() }];
        assert!(Buffers::load(&long, None, None).is_err());
    }
}
