//! Tar archives: GNU's, and those with pax records.

use std::io;
use tar::{Builder, EntryType, Header};

/// An archive of files. One whose name is longer than a header holds has an entry before it that names it.
#[must_use]
pub fn archive<'a>(files: impl IntoIterator<Item = (&'a str, &'a [u8])>) -> Vec<u8> {
    let mut archive = Builder::new(Vec::new());
    files.into_iter().for_each(|(name, bytes)| add(&mut archive, name, bytes));
    archive.into_inner().unwrap()
}

/// Files among what is passed over: a folder that is called like a frame, a text, and a file of another system before each.
#[must_use]
pub fn with_others<'a>(files: impl IntoIterator<Item = (&'a str, &'a [u8])>) -> Vec<u8> {
    let mut archive = Builder::new(Vec::new());
    let mut folder = Header::new_gnu();
    folder.set_entry_type(EntryType::Directory);
    folder.set_size(0);
    archive.append_data(&mut folder, "take.ply", io::empty()).unwrap();
    add(&mut archive, "take/readme.txt", &[b'x'; 700]);
    for (name, bytes) in files {
        add(&mut archive, name, bytes);
        add(&mut archive, "take/._a.ply", b"resources of another system");
    }
    archive.into_inner().unwrap()
}

/// A file whose name and size pax records give; its header calls it `short.obj`.
#[must_use]
pub fn with_pax_records(name: &str, bytes: &[u8]) -> Vec<u8> {
    let mut archive = Builder::new(Vec::new());
    let size = bytes.len().to_string();
    archive.append_pax_extensions([("path", name.as_bytes()), ("size", size.as_bytes())]).unwrap();
    let mut header = Header::new_ustar();
    header.set_path("short.obj").unwrap();
    header.set_size(bytes.len() as u64);
    header.set_cksum();
    archive.append(&header, bytes).unwrap();
    archive.into_inner().unwrap()
}

/// A name longer than a header holds.
#[must_use]
pub fn long_name() -> String {
    format!("{}/c.PLY", ["folder"; 40].join("/"))
}

fn add(archive: &mut Builder<Vec<u8>>, name: &str, bytes: &[u8]) {
    let mut header = Header::new_gnu();
    header.set_size(bytes.len() as u64);
    header.set_mode(0o644);
    archive.append_data(&mut header, name, bytes).unwrap();
}
