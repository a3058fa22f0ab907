//! Development commands: `cargo run --release -p xtask -- COMMAND`.

mod conformance;
mod fuzz_seeds;
mod ingest_table;
mod lod_table;
mod paper_table;

use anyhow::Result;
use clap::Parser;

/// Measured tables, conformance streams and fuzz seeds of isv.
#[derive(Parser)]
enum Command {
    /// Measure the paper's profile on a mesh sequence, every byte counted: the table that the README quotes
    PaperTable { folder: String, frames: Option<usize> },
    /// Measure decoding at reduced resolution on a mesh sequence
    LodTable { folder: String, frames: Option<usize> },
    /// Measure the ingest of the sequences `dancer` and `monastery` in a folder
    IngestTable { folder: String },
    /// Write the conformance streams and their hashes, after a change of the format
    Conformance { folder: String },
    /// Write what `fuzz/run` starts from
    FuzzSeeds { folder: String },
}

fn main() -> Result<()> {
    match Command::parse() {
        Command::PaperTable { folder, frames } => paper_table::run(&folder, frames.unwrap_or(usize::MAX)),
        Command::LodTable { folder, frames } => {
            lod_table::run(&folder, frames.unwrap_or(usize::MAX), &paper_table::header()?)
        }
        Command::IngestTable { folder } => ingest_table::run(&folder),
        Command::Conformance { folder } => conformance::run(&folder),
        Command::FuzzSeeds { folder } => fuzz_seeds::run(&folder),
    }
}
