//! Segments of a file of one track, for a network: some fragments a file, with the boxes before them in another.

use crate::init::{write_init, write_segment_type};
use crate::reader::FragmentPlace;
use crate::{Mp4Error, Mp4File};
use std::io::{Read, Seek, SeekFrom};
use std::num::NonZero;

/// A segment, as a playlist lists it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Number of samples.
    pub samples: usize,
    /// Time (s) that it lasts.
    pub duration_s: f64,
}

/// The segments of a fragmented file that holds one track.
pub struct Segments<S> {
    file: Mp4File<S>,
    places: Vec<FragmentPlace>,
}

impl<S: Read + Seek> Segments<S> {
    /// Finds the segments. With `length`, each begins with a keyframe, and has as many whole groups of pictures as so many samples hold.
    /// Without, a segment is a fragment.
    ///
    /// # Errors
    /// A file of several tracks, one that is not fragmented or not whole, and one whose keyframes are farther apart than `length`.
    pub fn new(file: Mp4File<S>, length: Option<NonZero<usize>>) -> Result<Self, Mp4Error> {
        let refused = |what: &str| Mp4Error::Unsupported(what.to_owned());
        let fragments = file.fragments();
        let listed: usize = fragments.iter().map(|place| place.samples.len()).sum();
        let samples = match file.tracks() {
            [track] if file.is_whole() && listed == track.samples.len() => &track.samples,
            _ => return Err(refused("segments are made of a whole, fragmented file of one track")),
        };
        let is_keyframe =
            |fragment: &FragmentPlace| samples.get(fragment.samples.start).is_some_and(|s| s.sync);
        let places = match length.map(NonZero::get) {
            None => fragments.to_vec(),
            Some(most) => {
                let groups = merged(fragments, |_, fragment| !is_keyframe(fragment));
                if groups.iter().any(|group| group.samples.len() > most) {
                    return Err(refused("a keyframe is missing where a segment should begin"));
                }
                merged(&groups, |segment, group| segment.samples.len() + group.samples.len() <= most)
            }
        };
        Ok(Self { file, places })
    }

    /// The file.
    #[must_use]
    pub fn file(&self) -> &Mp4File<S> {
        &self.file
    }

    /// The file that comes before all segments.
    #[must_use]
    pub fn init(&self) -> Vec<u8> {
        let mut init = Vec::new();
        write_init(&mut init, &[self.file.tracks()[0].description.clone()]);
        init
    }

    /// The segments.
    #[must_use]
    pub fn list(&self) -> Vec<Segment> {
        let track = &self.file.tracks()[0];
        let duration = |place: &FragmentPlace| {
            track.samples[place.samples.clone()].iter().map(|sample| u64::from(sample.duration)).sum::<u64>()
        };
        let timescale = f64::from(track.description.timescale);
        let segment = |place: &FragmentPlace| Segment {
            samples: place.samples.len(),
            duration_s: duration(place) as f64 / timescale,
        };
        self.places.iter().map(segment).collect()
    }

    /// A segment, a whole file.
    ///
    /// # Errors
    /// Errors of the source.
    ///
    /// # Panics
    /// If there is no such segment.
    pub fn read(&mut self, segment: usize) -> Result<Vec<u8>, Mp4Error> {
        let place = self.places[segment].bytes.clone();
        let mut bytes = Vec::new();
        write_segment_type(&mut bytes);
        let before = bytes.len() as u64;
        let source = self.file.source_mut();
        source.seek(SeekFrom::Start(place.start))?;
        source.take(place.end - place.start).read_to_end(&mut bytes)?;
        if bytes.len() as u64 - before < place.end - place.start {
            return Err(std::io::Error::from(std::io::ErrorKind::UnexpectedEof).into());
        }
        Ok(bytes)
    }
}

/// Places of which each takes those behind it that go with it.
fn merged(
    places: &[FragmentPlace],
    goes_with: impl Fn(&FragmentPlace, &FragmentPlace) -> bool,
) -> Vec<FragmentPlace> {
    let mut merged: Vec<FragmentPlace> = Vec::new();
    for place in places {
        match merged.last_mut().filter(|last| goes_with(last, place)) {
            Some(last) => (last.bytes.end, last.samples.end) = (place.bytes.end, place.samples.end),
            None => merged.push(place.clone()),
        }
    }
    merged
}
