//! Arguments for sound and picture beside a stream.

use anyhow::{Context, Result};
use isv::raw::mp4::{Mp4Error, SampleSource, SoundOptions, SourceSample, TrackDescription, Trimmed};
use isv::raw::take::BitRate;
use isv::raw::take::stream::{Tracks, picture, sound};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// Sound and picture beside a stream in an MP4 file.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Sound and picture")]
pub(crate) struct TrackArgs {
    /// Sound: an MP4, MP3, Ogg (Opus), FLAC or WAV file; may be given again
    ///
    /// Coded sound is copied as it is. WAV is coded with Opus.
    #[arg(long, value_name = "FILE")]
    audio: Vec<PathBuf>,
    /// Rate at which WAV sound is coded with Opus, such as 96k
    #[arg(long, value_name = "RATE", default_value = "128k", requires = "audio")]
    audio_bitrate: BitRate,
    /// Keep WAV sound as it is, without loss; few browsers play it
    #[arg(long, requires = "audio", conflicts_with = "audio_bitrate")]
    pcm: bool,
    /// Picture: an MP4 file whose video is copied as it is
    #[arg(long, value_name = "FILE.mp4")]
    video: Option<PathBuf>,
}

impl TrackArgs {
    /// The files that are read.
    pub(crate) fn files(&self) -> impl Iterator<Item = &Path> {
        self.audio.iter().chain(&self.video).map(PathBuf::as_path)
    }

    /// Whether any track is asked for.
    pub(crate) fn is_empty(&self) -> bool {
        self.files().next().is_none()
    }

    /// Opens the tracks, sound first. `part`: the time (ns) of them that is wanted.
    pub(crate) fn open(&self, part: Option<Range<u64>>) -> Result<Tracks> {
        let mut options = SoundOptions::default();
        let bits = self.audio_bitrate.bits_per_second().min(f64::from(u32::MAX)) as u32;
        options.opus_bits_per_second = (!self.pcm).then_some(bits);
        let named = |path: &Path| path.display().to_string();
        let mut tracks = Tracks::new();
        for path in &self.audio {
            tracks.push(sound(path, options).with_context(|| named(path))?);
        }
        if let Some(path) = &self.video {
            tracks.push(picture(path).with_context(|| named(path))?);
        }
        Ok(match part {
            Some(Range { start, end }) => {
                tracks.into_iter().map(|track| Box::new(Trimmed::new(track, start, end)) as _).collect()
            }
            None => tracks,
        })
    }
}

/// A track that begins with the first frame of a stream, which is known by the time that it is read.
pub(crate) struct FromFirstFrame {
    /// Not trimmed before the first sample is asked for.
    track: Option<Box<dyn SampleSource>>,
    description: TrackDescription,
    /// Time (ns) of that frame in the track.
    begin: Arc<OnceLock<u64>>,
    begun: bool,
}

impl FromFirstFrame {
    pub(crate) fn new(track: Box<dyn SampleSource>, begin: &Arc<OnceLock<u64>>) -> Self {
        let description = track.description().clone();
        Self { track: Some(track), description, begin: Arc::clone(begin), begun: false }
    }
}

impl SampleSource for FromFirstFrame {
    fn description(&self) -> &TrackDescription {
        &self.description
    }

    fn next_sample(&mut self) -> Result<Option<SourceSample>, Mp4Error> {
        let begin_ns = self.begin.get().copied().unwrap_or(0);
        if !std::mem::replace(&mut self.begun, true) && begin_ns > 0 {
            let whole = self.track.take();
            self.track = whole.map(|track| Box::new(Trimmed::new(track, begin_ns, u64::MAX)) as _);
        }
        self.track.as_mut().map_or(Ok(None), |track| track.next_sample())
    }
}
