//! Segments of a file of one track, for a network: each fragment a file, with the boxes before them in another.

use crate::init::{write_init, write_segment_type};
use crate::reader::FragmentPlace;
use crate::{Mp4Error, Mp4File};
use std::io::{Read, Seek, SeekFrom};

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
    /// Finds the segments.
    ///
    /// # Errors
    /// A file of several tracks, and one that is not fragmented or not whole.
    pub fn new(file: Mp4File<S>) -> Result<Self, Mp4Error> {
        let places = file.fragments().to_vec();
        let listed: usize = places.iter().map(|place| place.samples.len()).sum();
        match file.tracks() {
            [track] if file.is_whole() && listed == track.samples.len() => Ok(Self { file, places }),
            _ => Err(Mp4Error::Unsupported(
                "segments are made of a whole, fragmented file of one track".to_owned(),
            )),
        }
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
    /// Those of the source.
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
