//! Fragments: `moof` and `mdat` of some samples of one track.

use crate::SourceSample;
use crate::boxes::put;
use mp4_atom::{FourCC, Header, Mfhd, Moof, Tfdt, Tfhd, Traf, Trun, TrunEntry};

/// Flags of a sample that needs no other, and of one that does (14496-12, 8.8.3.1).
const SYNC: u32 = 0x0200_0000;
const NO_SYNC: u32 = 0x0101_0000;
/// The bit of a sample's flags that says that decoding cannot begin there.
const NO_SYNC_BIT: u32 = 0x0001_0000;

/// Whether decoding can begin at a sample with these flags.
pub(crate) fn is_sync(flags: u32) -> bool {
    flags & NO_SYNC_BIT == 0
}

/// Bytes of a fragment, and where its first sample is in them.
pub(crate) struct Fragment {
    pub bytes: Vec<u8>,
    pub data_at: usize,
}

/// Writes samples that follow each other as a fragment. There is at least one.
pub(crate) fn write_fragment(sequence: u32, track_id: u32, samples: &[SourceSample]) -> Fragment {
    let has_offsets = samples.iter().any(|sample| sample.composition_offset != 0);
    let entries: Vec<_> = samples
        .iter()
        .map(|sample| TrunEntry {
            duration: Some(sample.duration),
            size: Some(sample.data.len() as u32),
            flags: Some(if sample.sync { SYNC } else { NO_SYNC }),
            cts: has_offsets.then_some(sample.composition_offset.into()),
        })
        .collect();
    let mut moof = Moof {
        mfhd: Mfhd { sequence_number: sequence },
        traf: vec![Traf {
            tfhd: Tfhd { track_id, default_base_is_moof: true, ..Tfhd::default() },
            tfdt: Some(Tfdt { base_media_decode_time: samples[0].time }),
            trun: vec![Trun { data_offset: Some(0), samples: entries.into() }],
            ..Traf::default()
        }],
    };
    let data: usize = samples.iter().map(|sample| sample.data.len()).sum();
    let mut bytes = Vec::new();
    put(&mut bytes, &moof);
    let mut header = Vec::new();
    put(&mut header, &Header { kind: FourCC::new(b"mdat"), size: Some(data) });
    let data_at = bytes.len() + header.len();
    // Its own length does not depend on the offset.
    moof.traf[0].trun[0].data_offset =
        Some(i32::try_from(data_at).expect("a moof is a table of one fragment"));
    bytes.clear();
    put(&mut bytes, &moof);
    bytes.extend(header);
    samples.iter().for_each(|sample| bytes.extend(&sample.data));
    Fragment { bytes, data_at }
}
