//! The decoder under test of `conformance/run`: decodes one stream and prints a line a frame, `FRAME HASH`, the hash being that of
//! the volume as decoded. With `--colour` the colour hash follows. What it refuses ends the output with `refused CLASS`; see
//! `conformance/README.md`.

use isv_decode::{DecodeError, Decoder, Limits, volume_hash};
use isv_format::{FormatError, PacketReader};
use std::error::Error;
use std::fs::File;
use std::io::{BufReader, Read, Write, stdout};

fn main() -> Result<(), Box<dyn Error>> {
    let (options, paths): (Vec<_>, Vec<_>) = std::env::args_os().skip(1).partition(|word| word == "--colour");
    let [path] = &paths[..] else { return Err("usage: conformance [--colour] FILE".into()) };
    let mut out = stdout().lock();
    if let Err(error) = decode(BufReader::new(File::open(path)?), !options.is_empty(), &mut out) {
        let Some(class) = error.class() else { return Err(error.into()) };
        writeln!(out, "refused {class}")?;
    }
    Ok(())
}

/// Decodes a stream to its end, or to what is refused, and prints each frame.
fn decode(source: impl Read, colour: bool, out: &mut impl Write) -> Result<(), DecodeError> {
    let mut reader = PacketReader::new(source)?;
    let mut decoder = Decoder::new(reader.header(), Limits::default());
    decoder.keep_colour(colour);
    let mut frame = 0;
    while let Some(packet) = reader.next_frame()? {
        let hash = volume_hash(decoder.decode_and_verify(&packet)?.volume);
        let mut line = format!("{frame} {hash:016x}");
        if colour {
            line += &decoder.colour().map_or(" -".to_owned(), |frame| format!(" {:016x}", frame.hash()));
        }
        writeln!(out, "{line}").and_then(|()| out.flush()).map_err(FormatError::from)?;
        frame += 1;
    }
    Ok(())
}
