//! `isv verify`: is a stream whole and sound?

use crate::backend::BackendArgs;
use crate::failure::{one_line, usage};
use crate::output::{frames_in_words, is_pipe, print, say};
use crate::progress::Progress;
use crate::stream;
use crate::words;
use anyhow::{Context, Result, anyhow, bail};
use isv::raw::decode::Lod;
use isv::raw::format::{IndexEntry, StreamIndex};
use isv::raw::take::{DeviceError, Event, StreamFault};
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

/// Frames that passed.
#[derive(Clone, Copy, Debug, Default)]
struct Verified {
    frames: usize,
    /// Those that stated a hash.
    hashed: usize,
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
        return verify_in_words(input, args.backend);
    }
    if args.inputs.iter().filter(|input| is_pipe(input)).count() > 1 {
        return Err(usage("-: standard input is one stream: name it once"));
    }
    let mut verdicts = Vec::new();
    for input in &args.inputs {
        let mut verified = Verified::default();
        let checked = verify(input, args.backend, &mut verified).map_err(stream::advise_repair);
        let checked = checked.map_err(|error| with_sound(error, verified));
        let error = checked.err().map(|error| one_line(&words::error(&error).0));
        if !args.json {
            match &error {
                None => print(&sound(input, verified))?,
                Some(error) => say(format_args!("isv: {error}")),
            }
        }
        let Verified { frames, hashed: frames_hashed } = verified;
        verdicts.push(Verdict {
            file: stream::name(input),
            ok: error.is_none(),
            error,
            frames,
            frames_hashed,
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

fn verify_in_words(input: &Path, backend: BackendArgs) -> Result<()> {
    let mut verified = Verified::default();
    let checked = verify(input, backend, &mut verified).map_err(stream::advise_repair);
    checked.map_err(|error| with_sound(error, verified))?;
    print(&sound(input, verified))
}

/// An error with the frames before it that are sound.
fn with_sound(error: anyhow::Error, verified: Verified) -> anyhow::Error {
    match verified.frames {
        0 => error,
        1 => anyhow!("{}: the frame before is sound, and --frames 0..1 decodes it", words::error(&error).0),
        frames => anyhow!(
            "{}: the {frames} frames before are sound, and --frames 0..{frames} decodes them",
            words::error(&error).0
        ),
    }
}

/// What is said of a stream without a fault.
fn sound(input: &Path, Verified { frames, hashed }: Verified) -> String {
    format!("{}: {} verified, {hashed} of them by hash", stream::name(input), frames_in_words(frames))
}

fn verify(input: &Path, used: BackendArgs, verified: &mut Verified) -> Result<()> {
    let name = stream::name(input);
    let (mut packets, header) = stream::open(input)?;
    let settings = used.decode_settings(None, Lod::Full)?;
    let (limits, observer) = (settings.memory.decoder_limits(), &*settings.observer);
    let decoder = settings.device.decoder(&header, limits, Lod::Full, observer);
    let mut decoder = decoder.map_err(|fault| fault.in_stream(&name))?;
    let (progress, mut found) = (Progress::new(None, "verifying"), StreamIndex::default());
    while let Some(packet) =
        packets.next_frame().map_err(|error| StreamFault::from(error).in_stream(&name))?
    {
        let decoded = decoder.decode_and_verify(&packet);
        let decoded = decoded.map_err(|error| StreamFault::from(error).in_stream(&name))?;
        if let Some(why) = decoder.take_notice() {
            observer.event(&Event::FellBack(DeviceError::new(why)));
        }
        found.frames.push(IndexEntry { at: packet.at, keyframe: packet.is_keyframe() });
        verified.frames += 1;
        verified.hashed += usize::from(decoded.stated_hash.is_some());
        progress.step();
    }
    match packets.index() {
        None => bail!("{name}: ends without an index, so frames may be missing"),
        Some(index) if *index != found => {
            bail!("{name}: its index does not say where its frames are: isv repair makes one that does")
        }
        Some(_) => {}
    }
    if packets.has_more().with_context(|| name.clone())? {
        bail!("{name}: bytes follow the end of the stream, from byte {} on", packets.at());
    }
    Ok(())
}
