//! `isv verify`: is a stream whole and sound?

use crate::backend::BackendArgs;
use crate::failure::{one_line, usage};
use crate::output::{frames_in_words, is_pipe, print, say};
use crate::progress::Progress;
use crate::stream;
use crate::words;
use anyhow::{Result, anyhow, bail};
use isv::raw::decode::Lod;
use isv::raw::take::Input;
use isv::raw::take::stream::{Verified, verify};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Decode whole streams and check them: packet checksums, frame hashes where they have them, index and end
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Streams; - for standard input
    ///
    /// After one that fails, the others are checked too.
    #[arg(value_name = "IN.isv", required = true)]
    inputs: Vec<PathBuf>,
    /// Print JSON: a list with an object for each stream
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    backend: BackendArgs,
}

/// What was found of a stream. The names of the fields are the keys of `isv verify --json`.
#[derive(Debug, Serialize)]
struct Verdict {
    file: String,
    ok: bool,
    /// What is wrong, in a sentence; null if nothing is.
    error: Option<String>,
    /// Frames that are sound, up to the first that is not.
    frames: usize,
    /// Sound frames that state a hash.
    frames_hashed: usize,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    if let [input] = args.inputs.as_slice()
        && !args.json
    {
        let (verified, checked) = check(input, args.backend);
        checked?;
        return print(&sound(input, verified));
    }
    if args.inputs.iter().filter(|input| is_pipe(input)).count() > 1 {
        return Err(usage("-: standard input is one stream: name it once"));
    }
    let mut verdicts = Vec::new();
    for input in &args.inputs {
        let (verified, checked) = check(input, args.backend);
        let error = checked.err().map(|error| one_line(&words::error(&error).0));
        if !args.json {
            match &error {
                None => print(&sound(input, verified))?,
                Some(error) => say(format_args!("isv: {error}")),
            }
        }
        verdicts.push(Verdict {
            file: stream::name(input),
            ok: error.is_none(),
            error,
            frames: verified.frames,
            frames_hashed: verified.hashed,
        });
    }
    if args.json {
        print(&serde_json::to_string_pretty(&verdicts)?)?;
    }
    let failed: Vec<&str> = verdicts.iter().filter(|v| !v.ok).map(|verdict| verdict.file.as_str()).collect();
    match failed.as_slice() {
        [] => Ok(()),
        failed => bail!("{} of {} streams failed: {}", failed.len(), verdicts.len(), failed.join(", ")),
    }
}

/// Checks a stream; an error has advice, and the frames before it that are sound.
fn check(input: &Path, used: BackendArgs) -> (Verified, Result<()>) {
    let settings = match used.decode_settings(None, Lod::Full) {
        Ok(settings) => settings,
        Err(error) => return (Verified::default(), Err(error)),
    };
    let progress = Progress::new(None, "verifying");
    let (verified, checked) = verify(&Input::from_argument(input), &settings, || progress.step());
    let checked = checked.map_err(|error| {
        let error = stream::advise_repair(error.into());
        match verified.frames {
            0 => error,
            1 => {
                anyhow!("{}: the frame before is sound, and --frames 0..1 decodes it", words::error(&error).0)
            }
            frames => anyhow!(
                "{}: the {frames} frames before are sound, and --frames 0..{frames} decodes them",
                words::error(&error).0
            ),
        }
    });
    (verified, checked)
}

/// What is said of a stream without a fault.
fn sound(input: &Path, verified: Verified) -> String {
    let Verified { frames, hashed, .. } = verified;
    format!("{}: {} verified, {hashed} of them by hash", stream::name(input), frames_in_words(frames))
}
