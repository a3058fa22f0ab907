//! Development commands: `cargo xtask COMMAND`.

mod colour_ablation;
mod colour_sheets;
mod colour_table;
mod conformance;
mod fuzz_seeds;
mod ingest_table;
mod lod_table;
mod loss;
mod main_table;
mod paper_results;
mod paper_table;
mod player;
mod regression;
mod sheet_pictures;
mod takes;
mod words;

use anyhow::Result;
use clap::Parser;
use isv::raw::kernels::simd;
use std::path::PathBuf;

/// Measured tables, conformance streams and fuzz seeds of isv.
#[derive(Parser)]
enum Command {
    /// Measure the paper's profile on a mesh sequence, every byte counted: the table that the README quotes
    PaperTable { folder: String, frames: Option<usize> },
    /// Measure profile main on a mesh sequence under settings such as step=2.2,trials=1
    MainTable {
        folder: String,
        #[arg(long, default_value = "1000000")]
        frames: usize,
        /// Edge of a voxel in millimetres
        #[arg(long, default_value = "5")]
        voxel: f64,
        /// Play the frames to and fro until there are so many
        #[arg(long, value_name = "FRAMES")]
        to_and_fro: Option<usize>,
        settings: Vec<String>,
    },
    /// Measure decoding at reduced resolution on a mesh sequence
    LodTable { folder: String, frames: Option<usize> },
    /// Measure the ingest of sequences in a folder: the whole band with the paper's sign, and surfaces, sheets among them
    IngestTable {
        folder: String,
        /// Sequences to measure; without any, all
        sequences: Vec<String>,
    },
    /// Measure rate and error of the colour of textured sequences in a folder
    ColourTable {
        folder: String,
        /// Sequences to measure
        #[arg(required = true)]
        sequences: Vec<String>,
    },
    /// Measure what each part of colour coding is worth, on textured sequences in a folder
    ColourAblation {
        folder: String,
        /// Sequences to measure
        #[arg(required = true)]
        sequences: Vec<String>,
    },
    /// Draw a textured take beside its streams at about 0.3, 0.6 and 1.2 Mbps, and print their rates and errors
    ColourSheets {
        folder: PathBuf,
        /// Take to draw
        sequence: String,
        /// Folder of the picture and the streams
        #[arg(long, default_value = "target/colour-sheets")]
        output: PathBuf,
        /// Turn of the camera about the up axis: 0 looks from +z
        #[arg(long, default_value = "0", allow_negative_numbers = true)]
        yaw: f64,
    },
    /// Make the paper's figures and table again on our clips: docs/results
    PaperResults {
        /// Folder of the captures
        #[arg(default_value = "../shared/data", env = "ISV_DATA")]
        data: PathBuf,
        /// Folder for the results
        #[arg(long, default_value = "docs/results")]
        docs: PathBuf,
        /// Folder for the studies of clips, which are large; they go on where they stopped
        #[arg(long, default_value = "target/results")]
        work: PathBuf,
        /// Only this part
        #[arg(long)]
        part: Option<paper_results::Part>,
    },
    /// Measure what is shown of streams that lose packets: docs/results/loss.md
    Loss {
        /// Folder of the captures
        #[arg(default_value = "../shared/data", env = "ISV_DATA")]
        data: PathBuf,
        /// Folder for the results
        #[arg(long, default_value = "docs/results")]
        docs: PathBuf,
    },
    /// Measure the regression table anew and fail where it became worse
    Regression {
        /// Folder of the captures; the clips that are not in it keep their rows
        #[arg(default_value = "../shared/data", env = "ISV_DATA")]
        data: PathBuf,
        /// The table
        #[arg(long, default_value = "regression/results.csv")]
        table: PathBuf,
        /// Write the figures into the table
        #[arg(long)]
        update: bool,
    },
    /// Draw open surfaces before and after coding: docs/images/sheets.png
    SheetPictures {
        /// Folder of the picture
        #[arg(default_value = "docs/images")]
        images: PathBuf,
    },
    /// Write the conformance streams that a folder does not have yet, and add them to its tables
    Conformance {
        folder: String,
        /// Write the streams with colour alone, in seconds
        #[arg(long)]
        colour: bool,
    },
    /// Write what `fuzz/run` starts from
    FuzzSeeds { folder: String },
    /// Build the decoder as WebAssembly into player/src/isv.wasm
    Player {
        /// Write nothing; fail where the file does not do what a fresh one does
        #[arg(long)]
        check: bool,
        /// Build with Debian's packages, standard library and all, even where rustup has it for WebAssembly
        #[arg(long)]
        from_source: bool,
    },
    /// Count the places that break the rules of wording, and fail where there are more than before
    Words {
        /// The table
        #[arg(long, default_value = "regression/words.csv")]
        table: PathBuf,
        /// Write the counts into the table
        #[arg(long)]
        update: bool,
        /// Print the places whose file or text has this in it
        #[arg(long, value_name = "PART")]
        list: Option<String>,
    },
}

fn main() -> Result<()> {
    simd::choose_by_environment()?;
    match Command::parse() {
        Command::PaperTable { folder, frames } => paper_table::run(&folder, frames.unwrap_or(usize::MAX)),
        Command::MainTable { folder, frames, voxel, to_and_fro, settings } => {
            main_table::run(&folder, frames, voxel, to_and_fro, &settings)
        }
        Command::LodTable { folder, frames } => {
            lod_table::run(&folder, frames.unwrap_or(usize::MAX), &paper_table::header()?)
        }
        Command::ColourTable { folder, sequences } => colour_table::run(&folder, &sequences),
        Command::ColourAblation { folder, sequences } => colour_ablation::run(&folder, &sequences),
        Command::ColourSheets { folder, sequence, output, yaw } => {
            colour_sheets::run(&folder, &sequence, &output, yaw)
        }
        Command::IngestTable { folder, sequences } => ingest_table::run(&folder, &sequences),
        Command::Loss { data, docs } => loss::run(&data, &docs),
        Command::PaperResults { data, docs, work, part } => paper_results::run(&data, &docs, &work, part),
        Command::Regression { data, table, update } => regression::run(&data, &table, update),
        Command::SheetPictures { images } => sheet_pictures::run(&images),
        Command::Conformance { folder, colour } => conformance::run(&folder, colour),
        Command::FuzzSeeds { folder } => fuzz_seeds::run(&folder),
        Command::Player { check, from_source } => player::run(check, from_source),
        Command::Words { table, update, list } => words::run(&table, update, list.as_deref()),
    }
}
