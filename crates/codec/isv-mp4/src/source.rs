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

impl SourceSample {
    /// Decode time at which it ends, in the track's timescale.
    pub(crate) fn end(&self) -> u64 {
        self.time.saturating_add(u64::from(self.duration))
    }
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
    /// # Errors
    /// A file that has no such track.
    pub fn new(file: Mp4File<S>, track: usize) -> Result<Self, Mp4Error> {
        if track >= file.tracks().len() {
            return Err(Mp4Error::NoTrack("this number"));
        }
        Ok(Self { file, track, next: 0 })
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
            let time = sample.time.saturating_sub(description.units_of_ns(self.begin_ns));
            return Ok(Some(SourceSample { time, ..sample }));
        }
        Ok(None)
    }
}

/// Tracks of one description one after the other, each from a time on.
///
/// A part ends where the next one begins: what it has behind is left out, and a sample that reaches over is made shorter.
pub struct Chained {
    parts: Vec<(u64, Box<dyn SampleSource>)>,
    current: usize,
    /// The last sample, until it is known when the next one begins.
    held: Option<SourceSample>,
}

impl Chained {
    /// Plays each part from its time on (ns).
    ///
    /// # Panics
    /// Without any part.
    #[must_use]
    pub fn new(parts: Vec<(u64, Box<dyn SampleSource>)>) -> Self {
        assert!(!parts.is_empty(), "a chain of no parts");
        Self { parts, current: 0, held: None }
    }

    /// The next sample of the part that is played, or of the next one.
    fn next_of_parts(&mut self) -> Result<Option<SourceSample>, Mp4Error> {
        let description = self.description().clone();
        while let Some((begin_ns, part)) = self.parts.get_mut(self.current) {
            let begin = description.units_of_ns(*begin_ns);
            let sample = part
                .next_sample()?
                .map(|sample| SourceSample { time: sample.time.saturating_add(begin), ..sample });
            let end = self
                .parts
                .get(self.current + 1)
                .map_or(u64::MAX, |(next_ns, _)| description.units_of_ns(*next_ns));
            match sample {
                Some(sample) if sample.time < end => return Ok(Some(sample)),
                _ => self.current += 1,
            }
        }
        Ok(None)
    }
}

impl SampleSource for Chained {
    fn description(&self) -> &TrackDescription {
        self.parts[0].1.description()
    }

    fn next_sample(&mut self) -> Result<Option<SourceSample>, Mp4Error> {
        let next = self.next_of_parts()?;
        let Some(mut sample) = std::mem::replace(&mut self.held, next) else {
            // The first one is held, too.
            return if self.held.is_some() { self.next_sample() } else { Ok(None) };
        };
        if let Some(next) = &self.held {
            let room = next.time.saturating_sub(sample.time);
            sample.duration = sample.duration.min(u32::try_from(room).unwrap_or(u32::MAX));
        }
        Ok(Some(sample))
    }
}
