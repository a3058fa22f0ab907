//! `isv view`: streams in a browser.

use crate::output::{print, say};
use crate::serving::{ShowArgs, check_streams, serve};
use anyhow::Result;
use isv_serve::{Server, Settings, StreamFiles};
use std::future;
use std::net::Ipv4Addr;
use std::path::PathBuf;

/// Watch an .isv file in a browser, or two side by side, until Ctrl-C; prints the address. Only this machine can reach it
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The file, or two to compare
    #[arg(value_name = "FILE.isv", required = true, num_args = 1..=2)]
    files: Vec<PathBuf>,
    /// The port to serve at; 0 is any that is free
    #[arg(long, value_name = "N", default_value = "0")]
    port: u16,
    /// Only print the address
    #[arg(long)]
    no_open: bool,
    #[command(flatten)]
    show: ShowArgs,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    check_streams(&args.files)?;
    let files = StreamFiles::new(&args.files)?;
    let address = (Ipv4Addr::LOCALHOST, args.port).into();
    let page_options = args.show.page_options();
    let settings = Settings { address, files, page_options, compares: true, ..Settings::default() };
    let introduce = |server: &Server| {
        let url = server.comparison_url();
        print(&url)?;
        if !args.no_open
            && let Err(error) = open::that_detached(&url)
        {
            say(format_args!("no browser could be opened: {error}: open the address in one"));
        }
        Ok(())
    };
    serve(settings, introduce, future::pending())
}
