//! The boxes before the first sample: `ftyp` and `moov`.

use crate::boxes::{put, write_box, write_full_box};
use crate::{TrackDescription, TrackKind};
use mp4_atom::{
    Dinf, Dref, Edts, Elst, ElstEntry, FixedPoint, FourCC, Ftyp, Hdlr, Mdhd, Mvex, Mvhd, Nmhd, Smhd, Stco,
    Stsc, Stsz, Stts, Styp, Tkhd, Trex, Url, Vmhd,
};

/// Units of time a second of the movie, in which only delays are stated.
const MOVIE_TIMESCALE: u32 = 1000;
const BRAND: FourCC = FourCC::new(b"iso6");
const CMAF: FourCC = FourCC::new(b"cmfc");

/// Number of a track, as boxes have it.
pub(crate) fn track_id(track: usize) -> u32 {
    track as u32 + 1
}

/// Writes `ftyp` and a `moov` without samples: those come in fragments.
pub(crate) fn write_init(out: &mut Vec<u8>, tracks: &[TrackDescription]) {
    put(out, &Ftyp { major_brand: BRAND, minor_version: 0, compatible_brands: vec![BRAND, CMAF] });
    write_box(out, b"moov", |out| {
        put(
            out,
            &Mvhd {
                creation_time: 0,
                modification_time: 0,
                timescale: MOVIE_TIMESCALE,
                duration: 0,
                rate: 1.into(),
                volume: 1.into(),
                matrix: mp4_atom::Matrix::default(),
                next_track_id: track_id(tracks.len()),
            },
        );
        for (track, description) in tracks.iter().enumerate() {
            write_track(out, track_id(track), description);
        }
        let trex = (0..tracks.len()).map(|track| Trex {
            track_id: track_id(track),
            default_sample_description_index: 1,
            ..Trex::default()
        });
        put(out, &Mvex { mehd: None, trex: trex.collect() });
    });
}

/// Writes the box that begins a segment.
pub(crate) fn write_segment_type(out: &mut Vec<u8>) {
    put(out, &Styp { major_brand: BRAND, minor_version: 0, compatible_brands: vec![BRAND, CMAF] });
}

fn write_track(out: &mut Vec<u8>, id: u32, track: &TrackDescription) {
    write_box(out, b"trak", |out| {
        let [width, height] = track.size.map(|size| FixedPoint::new((size >> 16) as u16, size as u16));
        put(
            out,
            &Tkhd {
                creation_time: 0,
                modification_time: 0,
                track_id: id,
                duration: 0,
                layer: 0,
                alternate_group: 0,
                enabled: true,
                in_movie: true,
                size_is_aspect_ratio: false,
                volume: u8::from(track.kind == TrackKind::Sound).into(),
                matrix: mp4_atom::Matrix::default(),
                width,
                height,
            },
        );
        if let Some(edits) = edits(track) {
            put(out, &Edts { elst: Some(edits) });
        }
        write_box(out, b"mdia", |out| {
            put(
                out,
                &Mdhd {
                    creation_time: 0,
                    modification_time: 0,
                    timescale: track.timescale,
                    duration: 0,
                    language: track.language.clone(),
                },
            );
            let (handler, name) = handler(track.kind);
            put(out, &Hdlr { handler: handler.into(), name: name.to_owned() });
            write_box(out, b"minf", |out| {
                match track.kind {
                    TrackKind::Geometry => write_full_box(out, b"vvhd", |_| {}),
                    TrackKind::Sound => put(out, &Smhd::default()),
                    TrackKind::Picture => put(out, &Vmhd::default()),
                    TrackKind::Other => put(out, &Nmhd::default()),
                }
                put(out, &Dinf { dref: Dref { entries: vec![Url::default().into()] } });
                write_box(out, b"stbl", |out| {
                    write_full_box(out, b"stsd", |out| {
                        out.extend(1u32.to_be_bytes());
                        out.extend(&track.sample_entry);
                    });
                    put(out, &Stts::default());
                    put(out, &Stsc::default());
                    put(out, &Stsz::default());
                    put(out, &Stco::default());
                });
            });
        });
    });
}

/// The edit list of a track, if its time line is not the movie's.
fn edits(track: &TrackDescription) -> Option<Elst> {
    let media_rate = 1.into();
    let wait = (track.edit.delay_ms > 0).then(|| ElstEntry {
        segment_duration: track.edit.delay_ms.into(),
        media_time: None,
        media_rate,
    });
    // A duration of 0 means all there is, as fragments do not say beforehand.
    let play =
        ElstEntry { segment_duration: 0, media_time: Some(track.edit.media_time), media_rate: 1.into() };
    (track.edit != crate::Edit::default()).then(|| Elst { entries: wait.into_iter().chain([play]).collect() })
}

/// Type and name of the handler of a kind of track.
fn handler(kind: TrackKind) -> (&'static [u8; 4], &'static str) {
    match kind {
        TrackKind::Geometry => (b"volv", "geometry"),
        TrackKind::Sound => (b"soun", "sound"),
        TrackKind::Picture => (b"vide", "picture"),
        TrackKind::Other => (b"meta", "data"),
    }
}
