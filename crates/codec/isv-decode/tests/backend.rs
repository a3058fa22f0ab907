//! A decoder with a backend other than the CPU alone: one that keeps volumes of its own, and fails when it is told to.

use isv_decode::backend::{Backend, Cpu, MainFrame};
use isv_decode::main::MainBlocks;
use isv_decode::main::activity::Activity;
use isv_decode::paper::{CodingParameters, FrameSymbols};
use isv_decode::{BackendError, DecodeError, Decoder, Limits, ReferenceBlocks};
use isv_format::{FramePayload, Packet, PacketReader, StreamHeader};
use isv_volume::{BlockSet, SparseVolume, VoxelMask};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::Path;

/// Does on the CPU what it is asked to, but for one call.
#[derive(Debug, Default)]
struct Failing {
    cpu: Cpu,
    calls: usize,
    fails_at: Option<usize>,
}

impl Failing {
    /// Counts a call.
    fn call(&mut self) -> Result<&mut Cpu, BackendError> {
        self.calls += 1;
        match self.fails_at {
            Some(call) if call == self.calls => Err(BackendError::DeviceFailed("unplugged".into())),
            _ => Ok(&mut self.cpu),
        }
    }
}

/// A volume that threads do not share.
#[derive(Debug)]
struct Volume {
    volume: SparseVolume,
    hashed: Cell<u32>,
}

impl Volume {
    fn new(volume: &SparseVolume) -> Self {
        Self { volume: volume.clone(), hashed: Cell::new(0) }
    }
}

/// A frame of the CPU, and its volume once it is complete.
#[derive(Debug)]
struct Kept<F> {
    frame: F,
    volume: Option<Volume>,
}

impl Backend for Failing {
    type Volume = Volume;
    type Paper = Kept<<Cpu as Backend>::Paper>;
    type Main = Kept<<Cpu as Backend>::Main>;

    fn reconstruct_paper(
        &mut self,
        parameters: &CodingParameters,
        symbols: FrameSymbols,
        before: Option<&Self::Paper>,
    ) -> Result<Self::Paper, BackendError> {
        let frame =
            self.call()?.reconstruct_paper(parameters, symbols, before.map(|before| &before.frame))?;
        let volume = Some(Volume::new(Cpu::paper_volume(&frame)));
        Ok(Kept { frame, volume })
    }

    fn paper_blocks(frame: &Self::Paper) -> ReferenceBlocks<'_> {
        Cpu::paper_blocks(&frame.frame)
    }

    fn paper_volume(frame: &Self::Paper) -> &Volume {
        frame.volume.as_ref().expect("a frame of profile paper is complete")
    }

    fn reconstruct_main(
        &mut self,
        frame: MainFrame<'_>,
        before: Option<&Self::Main>,
    ) -> Result<Self::Main, BackendError> {
        let frame = self.call()?.reconstruct_main(frame, before.map(|before| &before.frame))?;
        Ok(Kept { frame, volume: None })
    }

    fn main_blocks(frame: &Self::Main) -> MainBlocks<'_> {
        Cpu::main_blocks(&frame.frame)
    }

    fn main_volume(frame: &Self::Main) -> &Volume {
        frame.volume.as_ref().expect("the masks were added")
    }

    fn main_field(&mut self, frame: &Self::Main) -> Result<SparseVolume, BackendError> {
        self.call()?.main_field(&frame.frame)
    }

    fn crossed_corners(&mut self, frame: &Self::Main) -> Result<Vec<(u32, VoxelMask)>, BackendError> {
        self.call()?.crossed_corners(&frame.frame)
    }

    fn crossed_cells(&mut self, frame: &Self::Main) -> Result<Vec<(u32, VoxelMask)>, BackendError> {
        self.call()?.crossed_cells(&frame.frame)
    }

    fn add_masks(
        &mut self,
        frame: &mut Self::Main,
        masks: BTreeMap<u32, VoxelMask>,
    ) -> Result<(), BackendError> {
        assert!(frame.volume.is_none(), "masks are added once");
        self.call()?.add_masks(&mut frame.frame, masks)?;
        frame.volume = Some(Volume::new(Cpu::main_volume(&frame.frame)));
        Ok(())
    }

    fn expected_activity(
        &mut self,
        frame: &Self::Main,
        skipped: &BlockSet,
    ) -> Result<Vec<Activity>, BackendError> {
        self.call()?.expected_activity(&frame.frame, skipped)
    }

    fn hash(&mut self, volume: &Volume) -> Result<u64, BackendError> {
        volume.hashed.set(volume.hashed.get() + 1);
        self.cpu.hash(&volume.volume)
    }
}

/// A committed stream, and the hashes of its frames.
fn stream(name: &str) -> (StreamHeader, Vec<Packet>, Vec<u64>) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../conformance");
    let bytes = std::fs::read(folder.join(name)).unwrap();
    let mut reader = PacketReader::new(&bytes[..]).unwrap();
    let header = *reader.header();
    let packets = std::iter::from_fn(|| reader.next_frame().unwrap()).collect();
    let table = std::fs::read_to_string(folder.join("hashes.txt")).unwrap();
    let hashes = table.lines().filter_map(|line| line.strip_prefix(name)?.rsplit(' ').next());
    (header, packets, hashes.map(|hash| u64::from_str_radix(hash, 16).unwrap()).collect())
}

/// Whichever call fails: that frame's error says so, and the ones after it have no reference. From the next keyframe on all is as
/// it was.
#[test]
fn a_decoder_outlives_the_failures_of_its_backend() {
    // Calls: one a frame; three a frame and one between frames; the same of four frames without masks, so without corners.
    for (name, calls) in [("6dof.isv", 4), ("main_still_cells.isv", 19), ("main_noise_still_cells.isv", 11)] {
        let (header, packets, hashes) = stream(name);
        let mut decoder = Decoder::with_backend(&header, Limits::default(), Failing::default());
        for (packet, hash) in packets.iter().zip(&hashes) {
            let volume = decoder.decode_and_verify(packet).unwrap().volume;
            assert!(volume.hashed.get() > 0, "{name}: the streams state hashes");
            assert_eq!(isv_decode::volume_hash(&volume.volume), *hash, "{name}");
        }
        let mut fails_at = 0;
        loop {
            fails_at += 1;
            let backend = Failing { fails_at: Some(fails_at), ..Failing::default() };
            let mut decoder = Decoder::with_backend(&header, Limits::default(), backend);
            let failed = packets.iter().position(|packet| match decoder.decode(packet) {
                Ok(_) => false,
                Err(DecodeError::Backend(BackendError::DeviceFailed(_))) => true,
                Err(other) => panic!("{name}, call {fails_at}: {other}"),
            });
            let Some(failed) = failed else { break };
            for packet in &packets[failed + 1..] {
                assert!(matches!(decoder.decode(packet), Err(DecodeError::NoReference { .. })), "{name}");
            }
            for (packet, hash) in packets.iter().zip(&hashes) {
                let volume = decoder.decode(packet).unwrap().volume;
                assert_eq!(isv_decode::volume_hash(&volume.volume), *hash, "{name}, call {fails_at}");
            }
        }
        assert_eq!(fails_at - 1, calls, "{name}");
    }
}

/// A frame whose hash is not what it states is refused as one that is damaged: nothing follows it.
#[test]
fn a_wrong_volume_leaves_no_reference() {
    for name in ["3dof.isv", "main_inter.isv"] {
        let (header, packets, hashes) = stream(name);
        let mut wrong = packets[1].clone();
        let mut payload = FramePayload::parse(&packets[1].payload, 0, true, &header.profile).unwrap();
        payload.header.volume_hash = Some(hashes[1] ^ 1);
        wrong.payload = payload.to_bytes();
        for recovers in [false, true] {
            let mut decoder = Decoder::new(&header, Limits::default());
            decoder.recover(recovers);
            decoder.decode_and_verify(&packets[0]).unwrap();
            let refusal = decoder.decode_and_verify(&wrong).map(drop);
            assert!(
                matches!(refusal, Err(DecodeError::HashMismatch { frame: 1, .. })),
                "{name}: {refusal:?}"
            );
            assert!(recovers || decoder.volume().is_none(), "{name}");
            for packet in &packets[2..] {
                let refusal = decoder.decode(packet).map(drop);
                assert!(matches!(refusal, Err(DecodeError::NoReference { .. })), "{name}: {refusal:?}");
            }
            // Whoever reads packets may know of a loss that their counts do not show.
            decoder.decode(&packets[0]).unwrap();
            decoder.lose_packet();
            assert!(matches!(decoder.decode(&packets[1]), Err(DecodeError::NoReference { .. })), "{name}");
        }
    }
}
