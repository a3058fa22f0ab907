//! Fragments of sound and picture, cut so that they keep step with those of geometry.

use crate::{Mp4Error, Mp4Writer, SampleSource, SourceSample};
use std::io::Write;

/// Least duration of a fragment (ns), unless the track ends.
const SHORTEST_NS: u64 = 1_000_000_000;
/// Most bytes of samples in a fragment, where decoding can go on at the next sample.
const MOST_BYTES: usize = 1 << 24;

/// A track of which one fragment is held.
pub(crate) struct FragmentSource {
    samples: Box<dyn SampleSource>,
    peeked: Option<SourceSample>,
    ended: bool,
}

impl FragmentSource {
    pub(crate) fn new(samples: Box<dyn SampleSource>) -> Self {
        Self { samples, peeked: None, ended: false }
    }

    /// Time (ns) on the movie's time line at which the next fragment begins; `None` at the end of the track.
    fn begin_ns(&mut self) -> Result<Option<u64>, Mp4Error> {
        self.peek()?;
        Ok(self.peeked.as_ref().map(|first| self.samples.description().shown_ns(first.time)))
    }

    /// The samples of the next fragment; none at the end of the track.
    fn next_fragment(&mut self) -> Result<Vec<SourceSample>, Mp4Error> {
        let mut samples: Vec<SourceSample> = Vec::new();
        let mut bytes = 0;
        loop {
            self.peek()?;
            let track = self.samples.description();
            let ends = |next: &SourceSample| {
                let begin = samples.first().map_or(next.time, |first| first.time);
                let is_long = track.to_ns(next.time.saturating_sub(begin)) >= SHORTEST_NS;
                // Within a fragment samples follow each other: only its begin is a time.
                let is_behind_gap = samples.last().is_some_and(|last| next.time > last.end() + 1);
                is_behind_gap || next.sync && (is_long || bytes > MOST_BYTES)
            };
            let Some(next) = self.peeked.take_if(|next| !ends(next)) else { return Ok(samples) };
            bytes += next.data.len();
            samples.push(next);
        }
    }

    /// Reads the next sample, if none is held.
    fn peek(&mut self) -> Result<(), Mp4Error> {
        if self.peeked.is_none() && !self.ended {
            self.peeked = self.samples.next_sample()?;
            self.ended = self.peeked.is_none();
        }
        Ok(())
    }
}

/// Writes the fragments of tracks that begin before a time (ns), the earliest first. The first of them is track number `first`.
pub(crate) fn write_before<W: Write>(
    writer: &mut Mp4Writer<W>,
    tracks: &mut [FragmentSource],
    first: usize,
    end_ns: u64,
) -> Result<(), Mp4Error> {
    loop {
        let mut earliest = None;
        for (track, source) in tracks.iter_mut().enumerate() {
            let begin_ns = source.begin_ns()?;
            if begin_ns.is_some_and(|begin| begin < end_ns && earliest.is_none_or(|(other, _)| begin < other))
            {
                earliest = begin_ns.map(|begin| (begin, track));
            }
        }
        let Some((_, track)) = earliest else { return Ok(()) };
        let samples = tracks[track].next_fragment()?;
        writer.write_fragment(first + track, &samples)?;
    }
}
