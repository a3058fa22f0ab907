//! Development commands.
//!
//! - `cargo run --release -p xtask -- paper-table FOLDER [FRAMES]` measures the paper's profile on a mesh sequence, every
//!   byte counted, and prints the table that the README quotes.
//! - `cargo run --release -p xtask -- lod-table FOLDER [FRAMES]` measures decoding at reduced resolution on a mesh sequence.
//! - `cargo run --release -p xtask -- ingest-table FOLDER` measures the ingest of the sequences `dancer` and `monastery` in a folder.
//! - `cargo run --release -p xtask -- conformance FOLDER` writes the conformance streams and their hashes, after a change
//!   of the format.

mod conformance;
mod ingest_table;
mod lod_table;
mod paper_table;

use anyhow::{Context, Result, bail};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["paper-table", folder] => paper_table::run(folder, usize::MAX),
        ["paper-table", folder, frames] => {
            paper_table::run(folder, frames.parse().context("FRAMES is a number")?)
        }
        ["lod-table", folder] => lod_table::run(folder, usize::MAX, &paper_table::header()?),
        ["lod-table", folder, frames] => {
            lod_table::run(folder, frames.parse().context("FRAMES is a number")?, &paper_table::header()?)
        }
        ["ingest-table", folder] => ingest_table::run(folder),
        ["conformance", folder] => conformance::run(folder),
        _ => bail!(
            "usage: cargo run --release -p xtask -- paper-table FOLDER [FRAMES] | lod-table FOLDER [FRAMES] | ingest-table FOLDER | conformance FOLDER"
        ),
    }
}
