//! MP4 files: tables as a file and as a pipe have them, and sound of any kind.

use isv::raw::io::hush_foreign_panics;
use isv::raw::mp4::{
    GeometryPipe, GeometryStream, Mp4File, SampleSource, SoundOptions, TrackSource, open_sound,
};
use std::io::{Cursor, Read};

/// Most samples that are read of a track: a small file may claim millions.
const MOST_SAMPLES: usize = 4096;

/// Reads the bytes as an MP4 file.
pub(crate) fn read(bytes: &[u8]) {
    let mut piped = Vec::new();
    let whole_pipe = GeometryPipe::new(bytes).read_to_end(&mut piped).is_ok();
    assert!(piped.len() <= 2 * bytes.len(), "a stream is no larger than the file it is in, and its index");
    if let Ok(mut stream) = GeometryStream::open(Cursor::new(bytes)) {
        let mut streamed = Vec::new();
        stream.read_to_end(&mut streamed).expect("memory can be read");
        assert!(streamed.len() <= 2 * bytes.len());
        assert_eq!(stream.length(), streamed.len() as u64);
        let is_whole = stream.file().is_whole();
        // A pipe needs the fragments in order. Where it comes to the end, it has found the same.
        if whole_pipe && is_whole && piped.len() == streamed.len() {
            assert_eq!(piped, streamed);
        }
    }
    let Ok(file) = Mp4File::open(Cursor::new(bytes)) else { return };
    for track in 0..file.tracks().len() {
        let again = Mp4File::open(Cursor::new(bytes)).expect("it was read");
        drain(&mut TrackSource::new(again, track).expect("there is such a track"));
        let _ = file.tracks()[track].description.codec_string();
    }
}

/// Reads the bytes as sound, coded where it is a waveform.
pub(crate) fn hear(bytes: &[u8]) {
    hush_foreign_panics();
    if let Ok(mut sound) = open_sound(Cursor::new(bytes.to_vec()), SoundOptions::default()) {
        drain(&mut *sound);
    }
}

fn drain(source: &mut dyn SampleSource) {
    for _ in 0..MOST_SAMPLES {
        match source.next_sample() {
            Ok(Some(_)) => {}
            Ok(None) | Err(_) => return,
        }
    }
}
