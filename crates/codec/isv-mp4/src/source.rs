//! Samples of sound and picture from where they are: files, parts of tracks, tracks one after the other.

use crate::{Mp4Error, Mp4File, TrackDescription};
use std::io::{Read, Seek};

/// A sample with its bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceSample {
    /// Decode time in the track's timescale.
    pub time: u64,
    /// Duration in the track's timescale.
    pub duration: u32,
    /// How much later than decoded it is shown, in the track's timescale.
    pub composition_offset: i32,
    /// Whether decoding can begin here.
    pub sync: bool,
    /// What the codec wrote.
    pub data: Vec<u8>,
}

/// A track whose samples come one after the other.
pub trait SampleSource: Send {
    /// What the track states once.
    fn description(&self) -> &TrackDescription;

    /// The next sample in the order of decoding; `None` at the end.
    ///
    /// # Errors
    /// [`Mp4Error`] of what is read.
    fn next_sample(&mut self) -> Result<Option<SourceSample>, Mp4Error>;
}

/// A track of an MP4 file.
pub struct TrackSource<S> {
    file: Mp4File<S>,
    track: usize,
    next: usize,
}

impl<S: Read + Seek + Send> TrackSource<S> {
    /// Reads track number `track` of a file.
    ///
    /// # Panics
    /// If the file has no such track.
    #[must_use]
    pub fn new(file: Mp4File<S>, track: usize) -> Self {
        assert!(track < file.tracks().len(), "track {track} of {}", file.tracks().len());
        Self { file, track, next: 0 }
    }
}

impl<S: Read + Seek + Send> SampleSource for TrackSource<S> {
    fn description(&self) -> &TrackDescription {
        &self.file.tracks()[self.track].description
    }

    fn next_sample(&mut self) -> Result<Option<SourceSample>, Mp4Error> {
        let Some(sample) = self.file.tracks()[self.track].samples.get(self.next).copied() else {
            return Ok(None);
        };
        self.next += 1;
        let data = self.file.read(&sample)?;
        let (time, duration, composition_offset) = (sample.time, sample.duration, sample.composition_offset);
        Ok(Some(SourceSample { time, duration, composition_offset, sync: sample.sync, data }))
    }
}

/// Part of a track, which begins at time 0.
///
/// The first sample is the first that is shown whole at or after the begin and from which decoding can begin. So sound stays in step
/// with geometry, and what lacks at the begin is shorter than a sample, or than a GOP of pictures.
pub struct Trimmed {
    source: Box<dyn SampleSource>,
    begin_ns: u64,
    end_ns: u64,
    begun: bool,
}

impl Trimmed {
    /// Takes what is shown from `begin_ns` to before `end_ns`, in nanoseconds on the movie's time line.
    #[must_use]
    pub fn new(source: Box<dyn SampleSource>, begin_ns: u64, end_ns: u64) -> Self {
        Self { source, begin_ns, end_ns, begun: false }
    }
}

impl SampleSource for Trimmed {
    fn description(&self) -> &TrackDescription {
        self.source.description()
    }

    fn next_sample(&mut self) -> Result<Option<SourceSample>, Mp4Error> {
        while let Some(sample) = self.source.next_sample()? {
            let description = self.source.description();
            let shown_ns = description.shown_ns(sample.time);
            if shown_ns >= self.end_ns {
                return Ok(None);
            }
            // At the very begin, what warms a decoder up is wanted, too.
            if self.begin_ns > 0 && !self.begun && (shown_ns < self.begin_ns || !sample.sync) {
                continue;
            }
            self.begun = true;
            let time = sample.time.saturating_sub(description.from_ns(self.begin_ns));
            return Ok(Some(SourceSample { time, ..sample }));
        }
        Ok(None)
    }
}

/// Tracks of one description one after the other, each from a time on.
pub struct Chained {
    parts: Vec<(u64, Box<dyn SampleSource>)>,
    current: usize,
    /// Time (in the track's timescale) at which the last sample ended.
    end: u64,
}

impl Chained {
    /// Plays each part from its time on (ns). Samples that would begin before the part before has ended are left out.
    ///
    /// # Panics
    /// Without any part.
    #[must_use]
    pub fn new(parts: Vec<(u64, Box<dyn SampleSource>)>) -> Self {
        assert!(!parts.is_empty(), "a chain of no parts");
        Self { parts, current: 0, end: 0 }
    }
}

impl SampleSource for Chained {
    fn description(&self) -> &TrackDescription {
        self.parts[0].1.description()
    }

    fn next_sample(&mut self) -> Result<Option<SourceSample>, Mp4Error> {
        while let Some((begin_ns, part)) = self.parts.get_mut(self.current) {
            while let Some(sample) = part.next_sample()? {
                let time = sample.time + part.description().from_ns(*begin_ns);
                // What the part before holds beyond its geometry goes first: sound must not be heard twice.
                if time < self.end {
                    continue;
                }
                self.end = time + u64::from(sample.duration);
                return Ok(Some(SourceSample { time, ..sample }));
            }
            self.current += 1;
        }
        Ok(None)
    }
}
