//! `cargo instructions`: the table of how many instructions each kernel takes, unlike times the same on any machine. A program of its
//! own, as an optimised build of the codec alone takes a quarter of that of everything.

mod callgrind;
mod kernels;
mod table;

use anyhow::Result;
use clap::Parser;
use isv_kernels::simd;
use std::path::PathBuf;

/// Count the instructions of the kernels and fail where there are more than in the table.
#[derive(Parser)]
struct Args {
    /// The table
    #[arg(long, default_value = "docs/results/instructions.md")]
    table: PathBuf,
    /// Write the counts into the table
    #[arg(long)]
    update: bool,
    /// Be what is counted
    #[arg(long = callgrind::COUNTED_FLAG, hide = true)]
    counted: bool,
}

fn main() -> Result<()> {
    simd::choose_by_environment()?;
    let args = Args::parse();
    if args.counted { callgrind::run_kernels() } else { table::run(&args.table, args.update) }
}
