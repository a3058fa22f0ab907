//! Samples from the tables of a `moov`, where a file is not fragmented.

use crate::boxes::{RawBox, find, parse};
use crate::reader::MOST_SAMPLES;
use crate::{Mp4Error, Sample};
use mp4_atom::{Co64, Ctts, Stco, Stsc, Stss, Stsz, StszSamples, Stts};
use std::iter::repeat_n;

/// Lists the samples that the boxes of a `stbl` describe. `at` is where the `moov` begins in the file.
pub(crate) fn samples(tables: &[RawBox<'_>], at: u64) -> Result<Vec<Sample>, Mp4Error> {
    let table = |kind| find(tables, kind);
    let Some(sizes) = table(b"stsz").map(|found| parse::<Stsz>(found, at)).transpose()? else {
        return Ok(Vec::new());
    };
    let sizes: Box<dyn ExactSizeIterator<Item = u32>> = match &sizes.samples {
        StszSamples::Identical { count, size } => Box::new(repeat_n(*size, limited(*count as usize)?)),
        StszSamples::Different { sizes } => Box::new(sizes.iter().copied()),
    };
    let count = limited(sizes.len())?;
    if count == 0 {
        return Ok(Vec::new());
    }
    let lacks = |what: &str| Mp4Error::malformed(at, format!("a track of {count} samples has no {what}"));
    let durations = parse::<Stts>(table(b"stts").ok_or_else(|| lacks("durations"))?, at)?.entries;
    let mut durations =
        durations.iter().flat_map(|run| repeat_n(run.sample_delta, run.sample_count as usize));
    let offsets = table(b"ctts").map(|found| parse::<Ctts>(found, at)).transpose()?;
    let offsets = offsets.map_or_else(Vec::new, |offsets| offsets.entries);
    let mut offsets = offsets.iter().flat_map(|run| repeat_n(run.sample_offset, run.sample_count as usize));
    let sync = table(b"stss").map(|found| parse::<Stss>(found, at)).transpose()?;
    let mut places = places(tables, at)?;
    let (mut samples, mut time) = (Vec::new(), 0u64);
    for (number, bytes) in (1..).zip(sizes) {
        let duration = durations.next().unwrap_or(0);
        let place = places.next(bytes).ok_or_else(|| lacks("place in the file"))?;
        samples.push(Sample {
            time,
            at: place,
            bytes,
            duration,
            composition_offset: offsets.next().and_then(|offset| i32::try_from(offset).ok()).unwrap_or(0),
            sync: sync.as_ref().is_none_or(|sync| sync.entries.binary_search(&number).is_ok()),
        });
        time = time.saturating_add(duration.into());
    }
    Ok(samples)
}

fn limited(count: usize) -> Result<usize, Mp4Error> {
    let (asked, allowed) = (count as u64, MOST_SAMPLES as u64);
    if asked > allowed {
        Err(Mp4Error::Limit { what: "samples in a track", asked, allowed })
    } else {
        Ok(count)
    }
}

/// Places of samples: chunks, each of some samples one behind the other.
struct Places {
    chunks: Vec<u64>,
    runs: Vec<mp4_atom::StscEntry>,
    /// Number of the chunk, from 0, and samples left in it.
    chunk: usize,
    left: u32,
    run: usize,
    at: u64,
}

fn places(tables: &[RawBox<'_>], at: u64) -> Result<Places, Mp4Error> {
    let chunks = match (find(tables, b"stco"), find(tables, b"co64")) {
        (Some(found), _) => parse::<Stco>(found, at)?.entries.into_iter().map(u64::from).collect(),
        (None, Some(found)) => parse::<Co64>(found, at)?.entries,
        (None, None) => Vec::new(),
    };
    let runs = find(tables, b"stsc").map(|found| parse::<Stsc>(found, at)).transpose()?;
    let runs = runs.map_or_else(Vec::new, |runs| runs.entries);
    if runs.iter().any(|run| run.sample_description_index != 1) {
        return Err(Mp4Error::Unsupported("a track that changes its codec midway cannot be read".to_owned()));
    }
    Ok(Places { chunks, runs, chunk: 0, left: 0, run: 0, at: 0 })
}

impl Places {
    /// The place of the next sample, which has so many bytes.
    fn next(&mut self, bytes: u32) -> Option<u64> {
        while self.left == 0 {
            let number = self.chunk as u64 + 1;
            while self.runs.get(self.run + 1).is_some_and(|next| u64::from(next.first_chunk) <= number) {
                self.run += 1;
            }
            self.at = *self.chunks.get(self.chunk)?;
            self.left = self.runs.get(self.run)?.samples_per_chunk;
            self.chunk += 1;
        }
        self.left -= 1;
        let place = self.at;
        self.at = self.at.saturating_add(bytes.into());
        Some(place)
    }
}
