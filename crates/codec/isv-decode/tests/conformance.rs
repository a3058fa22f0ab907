//! The committed streams decode to the committed hashes, or are refused as they have to be, with every instruction set that the
//! machine has. What is said of them after losses is as committed, too. The streams never change: see `conformance/README.md`.

use isv_decode::colour::{ColourDecoder, ColourError, ColourFrame, Sample};
use isv_decode::main::ExactBlocks;
use isv_decode::{DecodeError, Decoder, Limits, volume_hash};
use isv_format::{PacketReader, RefusalClass};
use isv_kernels::simd::{self, Instructions};
use isv_testkit::{Need, skip};
use isv_volume::{SparseVolume, VolumeBuilder};
use std::collections::BTreeMap;
use std::env::consts::ARCH;
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../conformance")
}

/// The streams of a folder, by name.
fn streams(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let files = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path());
    let streams = files.filter(|path| path.extension().is_some_and(|extension| extension == "isv"));
    streams
        .map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), std::fs::read(&path).unwrap()))
        .collect()
}

/// The hashes of a stream's frames, and whether its index was met; or what is refused after them.
fn decode(bytes: &[u8]) -> (Vec<u64>, Result<bool, DecodeError>) {
    let mut hashes = Vec::new();
    let mut decode = || {
        let mut reader = PacketReader::new(bytes)?;
        let mut decoder = Decoder::new(reader.header(), Limits::default());
        while let Some(packet) = reader.next_frame()? {
            hashes.push(volume_hash(decoder.decode_and_verify(&packet)?.volume));
        }
        Ok(reader.complete())
    };
    let end = decode();
    (hashes, end)
}

#[test]
fn streams_decode_to_their_hashes_with_every_instruction_set() {
    let table = std::fs::read_to_string(folder().join("hashes.txt")).unwrap();
    let mut expected: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
    for line in table.lines() {
        let [name, frame, hash] = line.split(' ').collect::<Vec<_>>().try_into().expect("three words");
        let hashes = expected.entry(name).or_default();
        assert_eq!(frame, hashes.len().to_string(), "{line}");
        hashes.push(u64::from_str_radix(hash, 16).unwrap());
    }
    let streams = streams(&folder());
    assert!(expected.keys().all(|name| streams.contains_key(*name)));
    assert!(streams.len() >= 40, "{} streams", streams.len());
    let decoded = || streams.iter().map(|(name, bytes)| (name, decode(bytes))).collect::<Vec<_>>();
    for (instructions, found) in simd::with_each(decoded) {
        for (name, (hashes, end)) in found {
            assert_eq!(end.unwrap(), !name.contains("no_index"), "{name}, {instructions}");
            // Streams without frames have no line.
            assert_eq!(&hashes, expected.get(&name[..]).unwrap_or(&Vec::new()), "{name}, {instructions}");
        }
        println!("{ARCH} with {instructions}: {} streams as committed", streams.len());
    }
    let wanted: &[&str] = match ARCH {
        "x86" | "x86_64" => &["scalar", "sse2", "sse4.2", "avx2", "avx512"],
        "aarch64" => &["scalar", "neon"],
        _ => &["scalar"],
    };
    for name in wanted {
        let set: Instructions = name.parse().unwrap();
        if !Instructions::available().any(|available| available == set) {
            skip(Need::Instructions, format_args!("{name}, which this machine does not have"));
        }
    }
}

#[test]
fn streams_that_must_be_refused_are_and_say_why() {
    let streams = streams(&folder().join("refused"));
    let mut listed = 0;
    for (table, must) in [("refused.txt", true), ("may_refuse.txt", false)] {
        for line in std::fs::read_to_string(folder().join(table)).unwrap().lines() {
            let [name, frames, class] = line.split(' ').collect::<Vec<_>>().try_into().expect("three words");
            let (hashes, end) = decode(&streams[name]);
            match end {
                Err(error) => {
                    assert_eq!(error.class().unwrap().name(), class, "{name}: {error}");
                    assert_eq!(hashes.len().to_string(), frames, "{name}: {error}");
                }
                Ok(_) => assert!(!must, "{name} is accepted"),
            }
            listed += 1;
        }
    }
    assert_eq!(listed, streams.len(), "every stream is listed once");
    assert!(listed >= 60, "{listed} streams");
}

/// A stream's volume hashes and its colour hashes as words, and what is refused after them.
fn decode_with_colour(bytes: &[u8]) -> (Vec<u64>, Vec<String>, Option<DecodeError>) {
    let (mut hashes, mut colours) = (Vec::new(), Vec::new());
    let mut decode = || {
        let mut reader = PacketReader::new(bytes)?;
        let mut decoder = Decoder::new(reader.header(), Limits::default());
        decoder.keep_colour(true);
        while let Some(packet) = reader.next_frame()? {
            hashes.push(volume_hash(decoder.decode_and_verify(&packet)?.volume));
            colours.push(decoder.colour().map_or("-".to_owned(), |frame| format!("{:016x}", frame.hash())));
        }
        Ok(())
    };
    let error = decode().err();
    (hashes, colours, error)
}

#[test]
fn colour_decodes_to_its_hashes_with_every_instruction_set() {
    let table = std::fs::read_to_string(folder().join("colour.txt")).unwrap();
    let mut expected: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for line in table.lines() {
        let [name, _, colour] = line.split(' ').collect::<Vec<_>>().try_into().expect("three words");
        expected.entry(name).or_default().push(colour);
    }
    assert!(expected.len() >= 15, "{} streams", expected.len());
    let streams = streams(&folder());
    let decoded = || {
        expected
            .keys()
            .map(|name| (decode_with_colour(&streams[*name]), decode(&streams[*name]).0))
            .collect::<Vec<_>>()
    };
    for (instructions, found) in simd::with_each(decoded) {
        for ((name, expected), ((hashes, colours, error), alone)) in expected.iter().zip(found) {
            assert!(error.is_none(), "{name}, {instructions}: {error:?}");
            assert_eq!(&colours, expected, "{name}, {instructions}");
            assert_eq!(hashes, alone, "volumes of {name} do not depend on colour, {instructions}");
        }
    }
}

#[test]
fn colour_that_must_be_refused_is_by_those_who_want_it() {
    let streams = streams(&folder().join("colour_refused"));
    let table = std::fs::read_to_string(folder().join("colour_refused.txt")).unwrap();
    assert!(table.lines().count() >= 20);
    assert_eq!(table.lines().count(), streams.len(), "every stream is listed once");
    for line in table.lines() {
        let [name, frames, class] = line.split(' ').collect::<Vec<_>>().try_into().expect("three words");
        let (hashes, _, error) = decode_with_colour(&streams[name]);
        let error = error.unwrap_or_else(|| panic!("{name} is accepted"));
        assert_eq!(
            (error.class().unwrap().name(), hashes.len().to_string()),
            (class, frames.into()),
            "{error}"
        );
        assert!(decode(&streams[name]).1.is_ok(), "{name}: the volumes decode");
    }
}

/// The samples of a colour block.
fn block_samples(frame: &ColourFrame, block: usize) -> &[Sample] {
    let depth = frame.shape.depths()[block];
    &frame.layers[usize::from(depth)][frame.shape.block_samples(block, depth)]
}

#[test]
fn colour_blocks_that_are_said_to_be_exact_are() {
    let (mut exact_blocks, mut wrong_blocks) = (0, 0);
    for (name, bytes) in streams(&folder()).iter().filter(|(name, _)| name.starts_with("colour_")) {
        let mut reader = PacketReader::new(&bytes[..]).unwrap();
        let layers = reader.header().colour_layers.count();
        let mut decoder = Decoder::new(reader.header(), Limits::default());
        decoder.keep_colour(true);
        let mut frames = Vec::new();
        while let Some(packet) = reader.next_frame().unwrap() {
            let volume = decoder.decode(&packet).unwrap().volume.clone();
            let part = packet.colour().unwrap().map(<[u8]>::to_vec);
            frames.push((packet.is_keyframe(), volume, part, decoder.colour().cloned()));
        }
        // Colour alone is lost, whatever the volumes are predicted from.
        for lost in 0..frames.len() {
            let mut colour = ColourDecoder::new(layers);
            for (number, (keyframe, volume, part, whole)) in frames.iter().enumerate() {
                if number == lost {
                    colour.lose();
                    continue;
                }
                if *keyframe {
                    colour.begin_group();
                }
                let decoded = part.as_ref().map(|part| colour.decode(volume, part, 0, true).map(Arc::clone));
                let found = match decoded {
                    Some(Ok(found)) => Some(found),
                    Some(Err(ColourError::NoReference)) | None => colour.carry_over(volume).unwrap().cloned(),
                    Some(Err(error)) => panic!("{name} without {lost}, frame {number}: {error}"),
                };
                let (Some(found), Some(whole)) = (found, whole) else { continue };
                for block in 0..whole.shape.depths().len() {
                    let is_equal = block_samples(&found, block) == block_samples(whole, block);
                    let is_exact = colour.exact().contains(block);
                    assert!(is_equal || !is_exact, "{name} without {lost}, frame {number}, block {block}");
                    exact_blocks += usize::from(is_exact && !colour.is_exact());
                    wrong_blocks += usize::from(!is_equal);
                }
            }
        }
    }
    assert!(exact_blocks > 200 && wrong_blocks > 200, "{exact_blocks} {wrong_blocks}");
}

/// The exact blocks of a volume without their masks, which are exact only if the volume is as a whole.
fn exact_part(volume: &SparseVolume, exact: &ExactBlocks) -> SparseVolume {
    let mut part = VolumeBuilder::new(*volume.grid());
    for block in (0..volume.block_count()).filter(|block| exact.contains(*block)) {
        part.push(volume.coords()[block], volume.block(block).to_vec(), None);
    }
    part.finish()
}

/// Decodes a stream without the frames that are lost. What `loss.txt` has of each frame that is left: its number, the blocks that are
/// not exact, and the hash of those that are. With colour what `colour_loss.txt` has: a word on the colour too.
fn decode_with_losses(bytes: &[u8], lost: &[usize], colour: bool) -> Vec<String> {
    let mut reader = PacketReader::new(bytes).unwrap();
    let mut decoder = Decoder::new(reader.header(), Limits::default());
    decoder.recover(true);
    decoder.keep_colour(colour);
    let mut found = Vec::new();
    for frame in 0.. {
        let Some(packet) = reader.next_frame().unwrap() else { break };
        if lost.contains(&frame) {
            continue;
        }
        let said = decoder.decode_and_verify(&packet).map(|decoded| decoded.inexact_blocks);
        let mut line = match &said {
            Ok(inexact) => {
                let volume = decoder.volume().unwrap();
                let hash = match decoder.exact_blocks() {
                    Some(exact) => volume_hash(&exact_part(volume, exact)),
                    None => volume_hash(volume),
                };
                format!("{frame} {inexact} {hash:016x}")
            }
            Err(error) => {
                assert_eq!(error.class(), Some(RefusalClass::Missing), "{error}");
                format!("{frame} missing -")
            }
        };
        if colour {
            line += &match decoder.colour() {
                _ if said.is_err() => " -".to_owned(),
                _ if !decoder.is_colour_exact() => " inexact".to_owned(),
                Some(frame) => format!(" {:016x}", frame.hash()),
                None => " -".to_owned(),
            };
        }
        found.push(line);
    }
    found
}

#[test]
fn what_is_exact_after_losses_is_as_committed_with_every_instruction_set() {
    assert_losses("loss.txt", 10, false);
}

#[test]
fn colour_that_is_exact_after_losses_is_as_committed() {
    assert_losses("colour_loss.txt", 4, true);
}

/// Decodes what a table has of losses, at least so many of them.
fn assert_losses(table: &str, least: usize, colour: bool) {
    let table = std::fs::read_to_string(folder().join(table)).unwrap();
    let mut expected: BTreeMap<(&str, &str), Vec<&str>> = BTreeMap::new();
    for line in table.lines() {
        let [name, lost, frame] = line.splitn(3, ' ').collect::<Vec<_>>().try_into().expect("five words");
        expected.entry((name, lost)).or_default().push(frame);
    }
    assert!(expected.len() >= least, "{} losses", expected.len());
    let streams = streams(&folder());
    let decoded = || {
        let decode = |(name, lost): &(&str, &str)| {
            let lost: Vec<_> = lost.split(',').map(|frame| frame.parse().unwrap()).collect();
            decode_with_losses(&streams[*name], &lost, colour)
        };
        expected.keys().map(decode).collect::<Vec<_>>()
    };
    for (instructions, found) in simd::with_each(decoded) {
        for (((name, lost), expected), found) in expected.iter().zip(found) {
            assert_eq!(&found, expected, "{name} without {lost}, {instructions}");
        }
    }
}
