//! `isv serve`: files and live streams for browsers elsewhere.

use crate::count;
use crate::output::{is_pipe, print, say};
use crate::serving::{ShowArgs, check_streams, serve};
use crate::stream;
use anyhow::Result;
use isv_serve::{Hub, HubLimits, LiveLimits, Origin, Server, Settings, Source, StreamFiles};
use std::future;
use std::io::stdin;
use std::net::SocketAddr;
use std::num::NonZero;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// How long viewers may take, after a live stream has ended for good, to receive the rest of it.
const GRACE: Duration = Duration::from_secs(5);

/// Serve .isv files, a live stream or both to browsers until Ctrl-C; prints the addresses. Only this machine can reach them
/// unless --bind says otherwise
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The files
    #[arg(value_name = "FILE.isv", required_unless_present = "live")]
    files: Vec<PathBuf>,
    /// Send packets to viewers as they come
    ///
    /// The source is - for standard input, a FIFO, a file that is being written, or the newest such file of a folder. For
    /// example, isv encode -o - > FILE.isv writes such a file. When the source ends and begins anew, so do the viewers. Standard
    /// input ends once: viewers are told, and the command ends too, unless it serves files.
    #[arg(long, value_name = "SOURCE")]
    live: Option<PathBuf>,
    /// Address to listen at; 0.0.0.0 is all networks, port 0 any that is free
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:8047")]
    bind: SocketAddr,
    /// Let pages of another site watch and read, such as https://show.example
    ///
    /// May be given several times.
    #[arg(long, value_name = "ORIGIN")]
    allow_origin: Vec<Origin>,
    /// Most viewers of the live stream at a time [default: 100]
    #[arg(long, value_name = "N", requires = "live", value_parser = count::parse::<NonZero<usize>>)]
    viewers: Option<NonZero<usize>>,
    #[command(flatten)]
    show: ShowArgs,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    check_streams(&args.files)?;
    let source = args.source()?;
    let hub = source.is_some().then(|| Arc::new(Hub::new(HubLimits::default())));
    let settings = Settings {
        address: args.bind,
        files: StreamFiles::new(&args.files)?,
        page_options: args.show.page_options(),
        live: hub.clone(),
        live_limits: args.live_limits(),
        allowed_origins: args.allow_origin.clone(),
        ..Settings::default()
    };
    // Files are there for as long as the user wants.
    let ends = hub.clone().filter(|_| args.files.is_empty());
    let mut feed = None;
    let begin = |server: &Server| {
        introduce(server)?;
        feed = source.zip(hub).map(|(source, hub)| source.feed(hub, |notice| say(notice)));
        Ok(())
    };
    serve(settings, begin, async {
        match ends {
            Some(hub) => hub.finished(GRACE).await,
            None => future::pending().await,
        }
    })
}

impl Args {
    fn source(&self) -> Result<Option<Source>> {
        Ok(match self.live.as_deref() {
            Some(path) if is_pipe(path) => Some(Source::pipe(stream::name(path), stdin())),
            Some(path) => Some(Source::open(path)?),
            None => None,
        })
    }

    fn live_limits(&self) -> LiveLimits {
        let usual = LiveLimits::default();
        LiveLimits { viewers: self.viewers.map_or(usual.viewers, NonZero::get), ..usual }
    }
}

/// Says what is served, and to whom.
fn introduce(server: &Server) -> Result<()> {
    for url in server.urls() {
        print(&url)?;
    }
    if server.is_open() {
        say(format_args!("anybody who reaches {} can watch", server.address()));
    }
    Ok(())
}
