//! A file read: its tracks, and where their samples are, fragmented or not.

use crate::boxes::{RawBox, boxes, find, parse};
use crate::fragment::is_sync;
use crate::geometry::SAMPLE_ENTRY;
use crate::sample_table::samples;
use crate::{Edit, Mp4Error, Sample, Track, TrackDescription, TrackKind};
use mp4_atom::{Elst, Hdlr, Header, Mdhd, Mvhd, ReadFrom, Tfdt, Tfhd, Tkhd, Trex, Trun};
use std::ffi::OsStr;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

/// Most samples of a track: three days at 60 a second.
pub(crate) const MOST_SAMPLES: usize = 1 << 24;
/// Most bytes of a box of tables.
const MOST_TABLE_BYTES: u64 = 1 << 28;
/// Most tracks of a file that are looked at.
const MOST_TRACKS: usize = 256;

/// Whether a file begins like an MP4 file. 8 bytes tell.
#[must_use]
pub fn is_mp4(first_bytes: &[u8]) -> bool {
    first_bytes.get(4..8) == Some(b"ftyp")
}

/// Whether a path is named like the file of a stream: `.isv` or `.mp4`, in any case.
#[must_use]
pub fn is_stream_name(path: &Path) -> bool {
    let is_ours = |end: &OsStr| ["isv", "mp4"].iter().any(|ending| end.eq_ignore_ascii_case(ending));
    path.extension().is_some_and(is_ours)
}

/// An MP4 file and its tracks. Nothing but tables is held.
pub struct Mp4File<S> {
    source: S,
    tracks: Vec<Track>,
    fragments: Vec<FragmentPlace>,
    is_whole: bool,
}

/// Place of a fragment, and what it holds.
#[derive(Clone, Debug)]
pub(crate) struct FragmentPlace {
    /// Bytes of the file from the begin of its `moof` to the end of the `mdat` behind it.
    pub bytes: Range<u64>,
    /// Numbers of its samples; none if it holds samples of several tracks.
    pub samples: Range<usize>,
}

/// A track while a file is read.
pub(crate) struct OpenTrack {
    id: u32,
    pub track: Track,
    defaults: Trex,
    /// Decode time at which the last fragment ended.
    end: u64,
}

impl<S: Read + Seek> Mp4File<S> {
    /// Reads the tables of a file.
    ///
    /// A file that ends early has the samples that are whole. No more memory is taken than the file has bytes of tables.
    ///
    /// # Errors
    /// [`Mp4Error`]: no MP4 file, or a damaged one, and those of the source.
    pub fn open(mut source: S) -> Result<Self, Mp4Error> {
        let length = source.seek(SeekFrom::End(0))?;
        let (mut at, mut is_whole) = (0, true);
        let mut tracks: Option<Vec<OpenTrack>> = None;
        let mut fragments: Vec<FragmentPlace> = Vec::new();
        let mut listed: Vec<(u32, u32)> = Vec::new();
        source.seek(SeekFrom::Start(0))?;
        while at < length {
            let Some((kind, header_bytes, size)) = read_header(&mut source, at, length)? else {
                is_whole = false;
                break;
            };
            if at == 0 && kind != *b"ftyp" {
                return Err(Mp4Error::NotMp4);
            }
            let end = at.saturating_add(size);
            is_whole &= end <= length;
            let body_bytes = size - header_bytes;
            match &kind {
                b"moov" if tracks.is_none() => {
                    let Some(body) = read_table(&mut source, body_bytes, end <= length)? else { break };
                    tracks = Some(read_movie(&body, at)?);
                }
                b"moof" => {
                    let Some(body) = read_table(&mut source, body_bytes, end <= length)? else { break };
                    let tracks = tracks.as_mut().ok_or(Mp4Error::NoMovie)?;
                    let before: Vec<_> = tracks.iter().map(|open| open.track.samples.len()).collect();
                    read_fragment(tracks, &body, at, end)?;
                    fragments.push(FragmentPlace::new(at..end, &before, tracks));
                }
                b"mfra" if body_bytes <= MOST_TABLE_BYTES => {
                    let Some(body) = read_table(&mut source, body_bytes, end <= length)? else { break };
                    // No sample is found by these lists: where they are damaged, all samples may be there.
                    match listed_samples(&body, at) {
                        Ok(lists) if lists.len() <= MOST_TRACKS => listed = lists,
                        _ => is_whole = false,
                    }
                }
                b"mdat" => {
                    if let Some(fragment) = fragments.last_mut().filter(|fragment| fragment.bytes.end == at) {
                        fragment.bytes.end = end;
                    }
                }
                _ => {}
            }
            at = end;
            source.seek(SeekFrom::Start(at.min(length)))?;
        }
        if length == 0 {
            return Err(Mp4Error::NotMp4);
        }
        let tracks = tracks.ok_or(Mp4Error::NoMovie)?;
        // A fragment that was damaged may look like a box of an unknown type.
        is_whole &= tracks.iter().all(|open| {
            let of_track = listed.iter().filter(|(track, _)| *track == open.id);
            of_track.map(|(_, count)| *count as usize).all(|count| count == open.track.samples.len())
        });
        let mut tracks: Vec<_> = tracks.into_iter().map(|open| open.track).collect();
        for track in &mut tracks {
            let whole = |sample: &Sample| sample.at.saturating_add(sample.bytes.into()) <= length;
            let count = track.samples.iter().position(|sample| !whole(sample)).unwrap_or(track.samples.len());
            is_whole &= count == track.samples.len();
            track.samples.truncate(count);
        }
        Ok(Self { source, tracks, fragments, is_whole })
    }

    /// The tracks.
    #[must_use]
    pub fn tracks(&self) -> &[Track] {
        &self.tracks
    }

    /// Whether all boxes and all samples are there to their ends.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.is_whole
    }

    /// Number of the one track of a kind.
    ///
    /// # Errors
    /// None or several tracks of geometry; no track of another kind. Of several others it is the first.
    pub fn track_of(&self, kind: TrackKind) -> Result<usize, Mp4Error> {
        let mut found = self.tracks.iter().enumerate().filter(|(_, track)| track.description.kind == kind);
        match (found.next(), found.count(), kind) {
            (Some((track, _)), 0, _) => Ok(track),
            (Some(_), more, TrackKind::Geometry) => Err(Mp4Error::SeveralGeometries(more + 1)),
            (Some((track, _)), ..) => Ok(track),
            (None, _, TrackKind::Geometry) => Err(Mp4Error::NoGeometry),
            (None, ..) => Err(Mp4Error::NoTrack(kind.name())),
        }
    }

    /// The bytes of a sample.
    ///
    /// # Errors
    /// Errors of the source, and a source that has become shorter.
    pub fn read(&mut self, sample: &Sample) -> Result<Vec<u8>, Mp4Error> {
        self.source.seek(SeekFrom::Start(sample.at))?;
        let mut data = Vec::new();
        self.source.by_ref().take(sample.bytes.into()).read_to_end(&mut data)?;
        if data.len() < sample.bytes as usize {
            return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
        }
        Ok(data)
    }

    /// Places for a viewer that begins with the last sync sample. They are the end of the boxes before the fragments, and the
    /// begin of the sample's fragment. `None` if there is no such sample.
    #[must_use]
    pub fn last_entry(&self) -> Option<(u64, u64)> {
        let geometry = &self.tracks[self.track_of(TrackKind::Geometry).ok()?];
        let last = geometry.samples.iter().rfind(|sample| sample.sync)?;
        let fragment = self.fragments.iter().rfind(|fragment| fragment.bytes.contains(&last.at))?;
        Some((self.fragments.first()?.bytes.start, fragment.bytes.start))
    }

    /// The fragments, in the order of the file.
    pub(crate) fn fragments(&self) -> &[FragmentPlace] {
        &self.fragments
    }

    /// The source.
    pub(crate) fn source_mut(&mut self) -> &mut S {
        &mut self.source
    }
}

impl FragmentPlace {
    /// The fragment that gave tracks more samples than they had before.
    fn new(bytes: Range<u64>, before: &[usize], tracks: &[OpenTrack]) -> Self {
        let counts = tracks.iter().map(|open| open.track.samples.len());
        let mut grown = before.iter().zip(counts).filter(|(before, now)| *before < now);
        match (grown.next(), grown.next()) {
            (Some((before, now)), None) => Self { bytes, samples: *before..now },
            _ => Self { bytes, samples: 0..0 },
        }
    }
}

/// Type, bytes of the header and bytes of a box that begins at byte `at`; `None` if the header is cut off.
pub(crate) fn read_header(
    source: &mut impl Read,
    at: u64,
    length: u64,
) -> Result<Option<([u8; 4], u64, u64)>, Mp4Error> {
    let mut counted = Counted { source, bytes: 0 };
    let header = match Header::read_from(&mut counted) {
        Ok(header) => header,
        Err(mp4_atom::Error::Io(error)) if error.kind() != io::ErrorKind::UnexpectedEof => {
            return Err(error.into());
        }
        Err(mp4_atom::Error::Io(_) | mp4_atom::Error::UnexpectedEof) => return Ok(None),
        Err(error) => return Err(Mp4Error::malformed(at, error.to_string())),
    };
    let size = header.size.map_or(length - at, |body| (body as u64).saturating_add(counted.bytes));
    Ok(Some((header.kind.into(), counted.bytes, size)))
}

/// Counts what is read.
struct Counted<'a, R> {
    source: &'a mut R,
    bytes: u64,
}

impl<R: Read> Read for Counted<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.source.read(buffer)?;
        self.bytes += read as u64;
        Ok(read)
    }
}

/// How many samples the lists at the end of a file (`isvi`) name, by track. `body`: of `mfra`, which begins at byte `at`.
fn listed_samples(body: &[u8], at: u64) -> Result<Vec<(u32, u32)>, Mp4Error> {
    let lists = boxes(body, at)?.into_iter().filter(|one| one.kind == *b"isvi");
    // Version and flags, the track, where its first sample begins, how many there are.
    let of_list = |body: &[u8]| {
        let number = |from: usize| Some(u32::from_be_bytes(*body.get(from..)?.first_chunk()?));
        Some((number(4)?, number(16)?))
    };
    Ok(lists.filter_map(|one| of_list(one.body)).collect())
}

/// The body of a box of tables; `None` if it is cut off.
pub(crate) fn read_table(
    source: &mut impl Read,
    bytes: u64,
    is_whole: bool,
) -> Result<Option<Vec<u8>>, Mp4Error> {
    if bytes > MOST_TABLE_BYTES {
        return Err(Mp4Error::Limit {
            what: "bytes of tables in a box",
            asked: bytes,
            allowed: MOST_TABLE_BYTES,
        });
    }
    if !is_whole {
        return Ok(None);
    }
    let mut body = Vec::new();
    source.take(bytes).read_to_end(&mut body)?;
    Ok((body.len() as u64 == bytes).then_some(body))
}

/// The tracks of a `moov`, with the samples that it lists itself.
pub(crate) fn read_movie(body: &[u8], at: u64) -> Result<Vec<OpenTrack>, Mp4Error> {
    let inside = boxes(body, at)?;
    let movie: Mvhd = parse(find(&inside, b"mvhd").ok_or_else(|| lacks(at, "mvhd"))?, at)?;
    let extends = find(&inside, b"mvex").map(|mvex| boxes(mvex.body, at)).transpose()?.unwrap_or_default();
    let defaults = extends.iter().filter(|one| one.kind == *b"trex").map(|trex| parse::<Trex>(*trex, at));
    let defaults = defaults.collect::<Result<Vec<_>, _>>()?;
    let found: Vec<_> = inside.iter().filter(|one| one.kind == *b"trak").collect();
    if found.len() > MOST_TRACKS {
        let (asked, allowed) = (found.len() as u64, MOST_TRACKS as u64);
        return Err(Mp4Error::Limit { what: "tracks", asked, allowed });
    }
    let mut tracks: Vec<OpenTrack> = Vec::new();
    for trak in found {
        let mut track = read_track(*trak, at, movie.timescale)?;
        if tracks.iter().any(|other| other.id == track.id) {
            return Err(Mp4Error::malformed(at, format!("two tracks have the number {}", track.id)));
        }
        track.defaults = defaults.iter().find(|trex| trex.track_id == track.id).cloned().unwrap_or_default();
        tracks.push(track);
    }
    Ok(tracks)
}

fn read_track(trak: RawBox<'_>, at: u64, movie_timescale: u32) -> Result<OpenTrack, Mp4Error> {
    let trak = boxes(trak.body, at)?;
    let header: Tkhd = parse(need(&trak, b"tkhd", at)?, at)?;
    let media = boxes(need(&trak, b"mdia", at)?.body, at)?;
    let media_header: Mdhd = parse(need(&media, b"mdhd", at)?, at)?;
    let handler: Hdlr = parse(need(&media, b"hdlr", at)?, at)?;
    let information = boxes(need(&media, b"minf", at)?.body, at)?;
    let tables = boxes(need(&information, b"stbl", at)?.body, at)?;
    if media_header.timescale == 0 {
        return Err(Mp4Error::malformed(at, "a track counts 0 units of time a second"));
    }
    // Version and flags, then the number of entries.
    let entries = need(&tables, b"stsd", at)?.body.get(8..).unwrap_or_default();
    let entries = boxes(entries, at)?;
    let kind = match <[u8; 4]>::from(handler.handler) {
        _ if entries.first().is_some_and(|entry| entry.kind == SAMPLE_ENTRY) => TrackKind::Geometry,
        kind if kind == *b"soun" => TrackKind::Sound,
        kind if kind == *b"vide" => TrackKind::Picture,
        _ => TrackKind::Other,
    };
    let entry = match entries[..] {
        [entry] => entry.whole.to_vec(),
        // Nothing is read of a track that is not used.
        [] if kind == TrackKind::Other => Vec::new(),
        _ => {
            let what =
                format!("a track of {} with {} sample entries cannot be read", kind.name(), entries.len());
            return Err(Mp4Error::Unsupported(what));
        }
    };
    let mut description = TrackDescription::new(kind, media_header.timescale, entry);
    if media_header.language.len() == 3
        && media_header.language.bytes().all(|letter| letter.is_ascii_lowercase())
    {
        description.language = media_header.language;
    }
    description.size =
        [header.width, header.height].map(|size| u32::from(size.integer()) << 16 | u32::from(size.decimal()));
    if let Some(edts) = find(&trak, b"edts")
        && let Some(elst) = find(&boxes(edts.body, at)?, b"elst")
    {
        description.edit = read_edit(&parse(elst, at)?, movie_timescale);
    }
    let samples = samples(&tables, at)?;
    let end = samples.last().map_or(0, |last| last.time.saturating_add(last.duration.into()));
    Ok(OpenTrack {
        id: header.track_id,
        track: Track { description, samples },
        defaults: Trex::default(),
        end,
    })
}

/// A box that has to be there.
fn need<'a>(inside: &[RawBox<'a>], kind: &[u8; 4], at: u64) -> Result<RawBox<'a>, Mp4Error> {
    find(inside, kind).ok_or_else(|| lacks(at, &String::from_utf8_lossy(kind)))
}

fn lacks(at: u64, kind: &str) -> Mp4Error {
    Mp4Error::malformed(at, format!("box {kind} is missing"))
}

/// The begin of a track: a pause, then what is heard or seen first. What a list says beyond that is not followed.
fn read_edit(list: &Elst, movie_timescale: u32) -> Edit {
    let pauses = list.entries.iter().take_while(|entry| entry.media_time.is_none());
    let delay: u64 = pauses.fold(0, |sum, entry| sum.saturating_add(entry.segment_duration));
    let delay_ms = u128::from(delay) * 1000 / u128::from(movie_timescale.max(1));
    let media_time = list.entries.iter().find_map(|entry| entry.media_time).unwrap_or(0);
    Edit { delay_ms: u32::try_from(delay_ms).unwrap_or(u32::MAX), media_time }
}

/// Adds the samples of a `moof` that is at `at..end` of the file.
pub(crate) fn read_fragment(
    tracks: &mut [OpenTrack],
    body: &[u8],
    at: u64,
    end: u64,
) -> Result<(), Mp4Error> {
    // Where the data of the run before ends, which runs without an offset follow.
    let mut data_end = None;
    for traf in boxes(body, at)?.iter().filter(|one| one.kind == *b"traf") {
        let inside = boxes(traf.body, at)?;
        let header: Tfhd = parse(need(&inside, b"tfhd", at)?, at)?;
        let Some(open) = tracks.iter_mut().find(|open| open.id == header.track_id) else { continue };
        if header.sample_description_index.is_some_and(|index| index != 1) {
            return Err(Mp4Error::Unsupported(
                "a track that changes its codec midway cannot be read".to_owned(),
            ));
        }
        let base = match header.base_data_offset {
            Some(base) => base,
            None if header.default_base_is_moof => at,
            None => data_end.unwrap_or(at),
        };
        let time = find(&inside, b"tfdt").map(|found| parse::<Tfdt>(found, at)).transpose()?;
        let mut time = time.map_or(open.end, |time| time.base_media_decode_time);
        let mut place = data_end.unwrap_or(end + 8);
        for found in inside.iter().filter(|one| one.kind == *b"trun") {
            let run: Trun = parse(*found, at)?;
            if let Some(offset) = run.data_offset {
                place = base
                    .checked_add_signed(offset.into())
                    .ok_or_else(|| Mp4Error::malformed(at, "samples before the begin of the file"))?;
            }
            for entry in &run.samples {
                let samples = &mut open.track.samples;
                if samples.len() >= MOST_SAMPLES {
                    let allowed = MOST_SAMPLES as u64;
                    return Err(Mp4Error::Limit { what: "samples in a track", asked: allowed + 1, allowed });
                }
                let duration = entry.duration.or(header.default_sample_duration);
                let bytes = entry.size.or(header.default_sample_size);
                let flags = entry.flags.or(header.default_sample_flags);
                let sample = Sample {
                    time,
                    at: place,
                    bytes: bytes.unwrap_or(open.defaults.default_sample_size),
                    duration: duration.unwrap_or(open.defaults.default_sample_duration),
                    composition_offset: entry.cts.and_then(|offset| i32::try_from(offset).ok()).unwrap_or(0),
                    sync: is_sync(flags.unwrap_or(open.defaults.default_sample_flags)),
                };
                samples.push(sample);
                time = time.saturating_add(sample.duration.into());
                place = place.saturating_add(sample.bytes.into());
            }
            data_end = Some(place);
        }
        open.end = time;
    }
    Ok(())
}
