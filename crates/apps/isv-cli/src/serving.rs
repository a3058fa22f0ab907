//! What `isv view` and `isv serve` share: a server that runs until Ctrl-C.

use crate::cli_enums::UpName;
use crate::failure::usage;
use crate::interrupt;
use crate::output::is_pipe;
use crate::{memory, stream};
use anyhow::{Context, Result};
use isv::raw::take::{MemorySize, Up};
use isv_serve::{PageOptions, Server, Settings};
use std::fs;
use std::path::PathBuf;
use std::time::Duration;
use tokio::runtime;
use tokio::time::sleep;

/// How often it is looked whether the user wants to stop.
const PATIENCE: Duration = Duration::from_millis(50);

/// How the page shows streams.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct ShowArgs {
    /// The axis that points up in the player [default: y]
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    up: Option<UpName>,
}

impl ShowArgs {
    /// What the page is told; the memory is that of `--max-memory`.
    pub(crate) fn page_options(self) -> PageOptions {
        PageOptions {
            up: self.up.map(|up| Up::from(up).name()),
            max_memory: memory::chosen().map(MemorySize::bytes),
        }
    }
}

/// Refuses what is no stream, before anybody tries to watch it.
pub(crate) fn check_streams(paths: &[PathBuf]) -> Result<()> {
    for path in paths {
        if is_pipe(path) || fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
            let name = path.display();
            return Err(usage(format!(
                "{name}: files are wanted here: isv serve --live {name} takes a stream from a pipe"
            )));
        }
        stream::check(path)?;
    }
    Ok(())
}

/// Listens, does what there is to do once that is possible, and serves until the user wants to stop or `done` is.
pub(crate) fn serve(
    settings: Settings,
    ready: impl FnOnce(&Server) -> Result<()>,
    done: impl Future<Output = ()>,
) -> Result<()> {
    interrupt::listen()?;
    let runtime =
        runtime::Builder::new_multi_thread().enable_all().build().context("cannot start a server")?;
    let served = runtime.block_on(async {
        let server = Server::bind(settings)?;
        ready(&server)?;
        tokio::select! {
            () = server.run() => {}
            () = interrupted() => {}
            () = done => {}
        }
        Ok(())
    });
    // Nobody waits for downloads in progress.
    runtime.shutdown_background();
    served
}

async fn interrupted() {
    while !interrupt::requested() {
        sleep(PATIENCE).await;
    }
}
