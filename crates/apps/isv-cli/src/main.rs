//! The `isv` command line: files in and out, progress, tables and messages around the codec of the `isv` crate.
//!
//! One module a command in `commands`; what they share is beside this file. Exit status: 0 done, 1 the job failed, 2
//! the command line was wrong; each failure is one sentence on stderr.

// `output::say` and `output::print` do it where nobody may hear it.
#![warn(clippy::print_stderr, clippy::print_stdout)]

mod backend;
mod capture;
mod cli_enums;
mod commands;
mod count;
mod drivers;
mod failure;
mod interrupt;
mod memory;
mod origin;
mod output;
mod progress;
mod serving;
mod stats;
mod stream;
mod table;
mod threads;
mod tracks;
mod words;

use anyhow::Result;
use clap::{Parser, Subcommand};
use commands::{
    backends, compare, cut, decode, demo, demux, encode, eval, export_player, info, join, mux, package,
    render, repair, serve, verify, view,
};
use failure::usage;
use isv::raw::kernels::simd::{self, Instructions};
use isv::raw::take::MemorySize;
use std::process::ExitCode;

/// Compress moving 3-D geometry: mesh sequences become sparse distance fields, coded like video.
#[derive(Debug, Parser)]
#[command(name = "isv", version, max_term_width = 110)]
struct Cli {
    /// Vector instructions to use, for finding faults; results are the same
    ///
    /// One of auto, scalar, sse2, sse4.2, avx2, avx512, neon and simd128, if the machine has it.
    #[arg(help_heading = "Global options", long, value_name = "SET", global = true, env = simd::VARIABLE, hide_env_values = true, default_value_t)]
    simd: Instructions,
    /// Most memory for the frames of a stream, such as 500MB or 2GiB
    ///
    /// A frame that needs more is refused before it takes any. Without it, a frame has 3 billion voxels at most,
    /// and no more than what the stream's bytes make likely. `view`, `serve` and `export-player` hand it to the
    /// player, which otherwise takes half of the machine's memory.
    #[arg(help_heading = "Global options", long, value_name = "SIZE", global = true)]
    max_memory: Option<MemorySize>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Args),
    Encode(encode::Args),
    Decode(decode::Args),
    Info(info::Args),
    Verify(verify::Args),
    Cut(cut::Args),
    Join(join::Args),
    Repair(repair::Args),
    Mux(mux::Args),
    Demux(demux::Args),
    Eval(eval::Args),
    Compare(compare::Args),
    Render(render::Args),
    View(view::Args),
    Serve(serve::Args),
    ExportPlayer(export_player::Args),
    Package(package::Args),
    Backends(backends::Args),
}

fn main() -> ExitCode {
    isv::raw::io::hush_foreign_panics();
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return failure::report_command_line(&error),
    };
    if let Some(size) = cli.max_memory {
        memory::choose(size);
    }
    match simd::choose(cli.simd)
        .map_err(|error| usage(format!("--simd: {error}")))
        .and_then(|()| run(&cli.command))
    {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => failure::report(&error),
    }
}

fn run(command: &Command) -> Result<()> {
    match command {
        Command::Demo(args) => demo::run(args),
        Command::Encode(args) => encode::run(args),
        Command::Decode(args) => decode::run(args),
        Command::Info(args) => info::run(args),
        Command::Verify(args) => verify::run(args),
        Command::Cut(args) => cut::run(args),
        Command::Join(args) => join::run(args),
        Command::Repair(args) => repair::run(args),
        Command::Mux(args) => mux::run(args),
        Command::Demux(args) => demux::run(args),
        Command::Eval(args) => eval::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Render(args) => render::run(args),
        Command::View(args) => view::run(args),
        Command::Serve(args) => serve::run(args),
        Command::ExportPlayer(args) => export_player::run(args),
        Command::Package(args) => package::run(args),
        Command::Backends(args) => backends::run(args),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{CommandFactory, builder::StyledStr};

    /// Options that a command may have before they are put into groups.
    const UNGROUPED: usize = 10;

    #[test]
    fn help_is_one_line_an_option_and_in_groups() {
        let mut long = Vec::new();
        for command in Cli::command().get_subcommands() {
            let name = command.get_name();
            let options = || command.get_opts().filter(|option| !option.is_hide_set());
            for option in command.get_arguments().filter(|option| !option.is_hide_set()) {
                let help = option.get_help().map(StyledStr::to_string).unwrap_or_default();
                if !(1..=80).contains(&help.chars().count()) {
                    long.push(format!("{name}: {}: {help}", option.get_id()));
                }
            }
            if options().count() > UNGROUPED {
                let without = options().filter(|option| option.get_help_heading().is_none());
                let names: Vec<_> = without.map(|option| option.get_id().to_string()).collect();
                assert!(names.len() <= UNGROUPED, "{name}: without a group: {names:?}");
            }
        }
        assert!(long.is_empty(), "{long:#?}");
    }
}
