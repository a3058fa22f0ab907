//! `isv verify`: is a stream whole and sound?

use crate::backend::{self, BackendArgs};
use crate::output::{frames_in_words, print};
use crate::progress::Progress;
use crate::stream;
use anyhow::{Context, Result, anyhow, bail};
use isv::decode::Lod;
use isv::format::{IndexEntry, StreamIndex};
use std::path::PathBuf;

/// Decode a whole stream and check it: packet checksums, frame hashes where it has them, that its index is right, and that its end is there and nothing behind it
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The stream; - for standard input
    #[arg(value_name = "IN.isv")]
    input: PathBuf,
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

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let mut verified = Verified::default();
    let checked = verify(args, &mut verified).map_err(stream::advise_repair);
    checked.map_err(|error| match verified.frames {
        0 => error,
        1 => anyhow!("{error:#}: the frame before is sound, and --frames 0..1 decodes it"),
        frames => {
            anyhow!("{error:#}: the {frames} frames before are sound, and --frames 0..{frames} decodes them")
        }
    })?;
    let Verified { frames, hashed } = verified;
    let (name, frames) = (stream::name(&args.input), frames_in_words(frames));
    print(&format!("{name}: {frames} verified, {hashed} of them by hash"))
}

fn verify(args: &Args, verified: &mut Verified) -> Result<()> {
    let name = stream::name(&args.input);
    let (mut packets, header) = stream::open(&args.input)?;
    let decoder = args.backend.decoder(&header, Lod::Full);
    let mut decoder = decoder.with_context(|| name.clone())?;
    let (progress, mut found) = (Progress::new(None, "verifying"), StreamIndex::default());
    while let Some(packet) = packets.next_frame().with_context(|| name.clone())? {
        let decoded = decoder.decode_and_verify(&packet).map_err(|error| stream::fault(&name, 0, error))?;
        if let Some(why) = decoder.take_notice() {
            backend::notify(&why);
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
