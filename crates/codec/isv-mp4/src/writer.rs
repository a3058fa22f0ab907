//! A fragmented file, written from begin to end.

use crate::boxes::{put, write_box, write_full_box};
use crate::fragment::write_fragment;
use crate::init::{track_id, write_init};
use crate::interleave::{FragmentSource, write_before};
use crate::{Mp4Error, SampleSource, SourceSample, TrackDescription, TrackKind};
use mp4_atom::{FragmentInfo, Mfro, Tfra};
use std::io::Write;

/// Bytes of the box `mfro`, the last one.
const MFRO_BYTES: usize = 16;

/// Writes fragments of tracks to anything that takes bytes. Never seeks, patches nothing.
pub struct Mp4Writer<W> {
    sink: W,
    at: u64,
    fragments: u32,
    tracks: Vec<WrittenTrack>,
}

/// What the end of the file tells of a track.
struct WrittenTrack {
    is_geometry: bool,
    fragments: Vec<FragmentInfo>,
    /// Each sample of geometry, as `isvi` lists it.
    samples: Vec<u8>,
    count: u32,
    /// Decode time of the first sample.
    begin: u64,
    /// Decode time at which the last sample ends.
    end: u64,
}

impl<W: Write> Mp4Writer<W> {
    /// Writes the boxes before the first fragment.
    ///
    /// # Errors
    /// Errors of the sink.
    pub fn new(mut sink: W, tracks: &[TrackDescription]) -> Result<Self, Mp4Error> {
        let mut init = Vec::new();
        write_init(&mut init, tracks);
        sink.write_all(&init)?;
        sink.flush()?;
        let written = |track: &TrackDescription| WrittenTrack {
            is_geometry: track.kind == TrackKind::Geometry,
            fragments: Vec::new(),
            samples: Vec::new(),
            count: 0,
            begin: 0,
            end: 0,
        };
        Ok(Self { sink, at: init.len() as u64, fragments: 0, tracks: tracks.iter().map(written).collect() })
    }

    /// Writes samples of a track that follow each other as a fragment.
    ///
    /// # Errors
    /// Errors of the sink.
    ///
    /// # Panics
    /// Without samples, or if there is no such track.
    pub fn write_fragment(&mut self, track: usize, samples: &[SourceSample]) -> Result<(), Mp4Error> {
        self.fragments = self.fragments.wrapping_add(1);
        let fragment = write_fragment(self.fragments, track_id(track), samples);
        self.sink.write_all(&fragment.bytes)?;
        self.sink.flush()?;
        let mut at = self.at + fragment.data_at as u64;
        let written = &mut self.tracks[track];
        if written.fragments.is_empty() {
            written.begin = samples[0].time;
        }
        let ends = samples.iter().map(|sample| sample.time.saturating_add(sample.duration.into()));
        written.end = ends.fold(written.end, u64::max);
        written.fragments.push(FragmentInfo {
            time: samples[0].time,
            moof_offset: self.at,
            traf_number: 1,
            trun_number: 1,
            sample_delta: 1,
        });
        for sample in samples.iter().filter(|_| written.is_geometry) {
            written.samples.extend((at << 1 | u64::from(sample.sync)).to_be_bytes());
            written.samples.extend((sample.data.len() as u32).to_be_bytes());
            written.samples.extend(sample.duration.to_be_bytes());
            written.count += 1;
            at += sample.data.len() as u64;
        }
        self.at += fragment.bytes.len() as u64;
        Ok(())
    }

    /// Writes where the fragments are, and gives the sink back.
    ///
    /// # Errors
    /// Errors of the sink.
    pub fn finish(mut self) -> Result<W, Mp4Error> {
        let mut end = Vec::new();
        write_box(&mut end, b"mfra", |out| {
            for (track, written) in self.tracks.iter().enumerate() {
                put(out, &Tfra { track_id: track_id(track), entries: written.fragments.clone() });
            }
            for (track, written) in self.tracks.iter().enumerate().filter(|(_, track)| track.is_geometry) {
                write_full_box(out, b"isvi", |out| {
                    out.extend(track_id(track).to_be_bytes());
                    out.extend(written.begin.to_be_bytes());
                    out.extend(written.count.to_be_bytes());
                    out.extend(&written.samples);
                });
            }
            // Of the box around it, which ends with it.
            put(out, &Mfro { parent_size: (out.len() + MFRO_BYTES) as u32 });
        });
        self.sink.write_all(&end)?;
        self.sink.flush()?;
        Ok(self.sink)
    }

    /// Decode time, in the track's timescale, at which what was written of a track ends.
    pub(crate) fn end(&self, track: usize) -> u64 {
        self.tracks[track].end
    }

    /// The sink. What is written to it behind the writer's back breaks the file.
    pub fn sink_mut(&mut self) -> &mut W {
        &mut self.sink
    }
}

/// Writes a file of tracks without geometry, and gives the sink back.
///
/// # Errors
/// Errors of the tracks and of the sink.
pub fn write_tracks<W: Write>(sink: W, tracks: Vec<Box<dyn SampleSource>>) -> Result<W, Mp4Error> {
    let descriptions: Vec<_> = tracks.iter().map(|track| track.description().clone()).collect();
    let mut writer = Mp4Writer::new(sink, &descriptions)?;
    let mut tracks: Vec<_> = tracks.into_iter().map(FragmentSource::new).collect();
    write_before(&mut writer, &mut tracks, 0, u64::MAX)?;
    writer.finish()
}
