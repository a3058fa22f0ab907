//! `isv export-player`: the player for any web host.

use crate::interrupt;
use crate::output::{quoted, say};
use crate::serving::{ShowArgs, check_streams};
use anyhow::{Result, bail};
use isv::raw::io::check_folder_name;
use isv_serve::{ExportFolder, Page, StreamFiles};
use std::path::PathBuf;

/// Write the player as static files, for any web host; its page plays what its address names, as in
/// index.html?src=FILE.isv&compare=OTHER.isv
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder to write: new, empty, or that of an earlier export
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Streams to copy into it
    ///
    /// The page opens the first, beside the second if there is one, when its address names none.
    #[arg(value_name = "FILE.isv")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    show: ShowArgs,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    check_folder_name(&args.folder, "the files of a page")?;
    check_streams(&args.files)?;
    interrupt::listen()?;
    let mut folder = ExportFolder::create(&args.folder)?;
    let urls = StreamFiles::new(&args.files)?.urls();
    // Relative to the page, wherever that will be.
    let urls: Vec<_> = urls.iter().map(|url| url.trim_start_matches('/').to_owned()).collect();
    for (path, bytes) in Page::player().export(&urls, &args.show.page_options()) {
        folder.write(path, &bytes)?;
    }
    for (number, file) in args.files.iter().enumerate() {
        folder.copy(file, &format!("files/{number}"))?;
        if interrupt::requested() {
            bail!("interrupted: nothing was exported");
        }
    }
    let files = folder.commit()?;
    say(format_args!(
        "{}: {files} files: put them on a web server, or try them with python3 -m http.server -d {}",
        args.folder.display(),
        quoted(&args.folder)
    ));
    Ok(())
}
