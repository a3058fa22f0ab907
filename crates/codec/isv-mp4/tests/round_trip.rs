//! Streams go into MP4 files and come out again, byte for byte, with sound beside them.

mod support;

use isv_format::PacketReader;
use isv_mp4::{Chained, GeometryPipe, GeometryStream, Mp4File, SampleSource, TrackKind, Trimmed};
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::num::NonZero;
use support::{Clicks, conformance, in_mp4, read_all};

#[test]
fn every_stream_comes_out_as_it_went_in() {
    let mut streams = 0;
    for (name, stream) in conformance() {
        // What a reader refuses, and what ends early, is no stream to be kept whole.
        let mut reader = PacketReader::new(&stream[..]).unwrap();
        let mut packets = 0;
        while let Ok(Some(_)) = reader.next_frame() {
            packets += 1;
        }
        if !reader.complete() || reader.has_more().unwrap() {
            continue;
        }
        let (file, left_out) = in_mp4(&stream, Vec::new()).unwrap_or_else(|error| panic!("{name}: {error}"));
        let mut back =
            GeometryStream::open(Cursor::new(&file)).unwrap_or_else(|error| panic!("{name}: {error}"));
        let bytes = read_all(&mut back);
        assert_eq!(back.length(), bytes.len() as u64, "{name}");
        assert!(read_all(&mut GeometryPipe::new(&file[..])) == bytes, "{name} through a pipe");
        if left_out == 0 {
            assert!(bytes == stream, "{name}");
        } else {
            // Without the packets that readers skip, the frames are the same.
            let mut reader = PacketReader::new(&bytes[..]).unwrap();
            let mut kept = 0;
            while reader.next_frame().unwrap().is_some() {
                kept += 1;
            }
            assert!(kept == packets && reader.complete(), "{name}");
        }
        streams += 1;
    }
    assert!(streams > 70, "{streams} streams");
}

#[test]
fn a_reader_may_seek_as_in_a_file() {
    let stream = support::stream(40, 10);
    let (file, _) = in_mp4(&stream, vec![Box::new(Clicks::new(3.0))]).unwrap();
    let mut back = GeometryStream::open(Cursor::new(&file)).unwrap();
    for at in (0..stream.len()).step_by(37) {
        assert_eq!(back.seek(SeekFrom::Start(at as u64)).unwrap(), at as u64);
        let mut piece = [0; 61];
        let length = 61.min(stream.len() - at);
        back.read_exact(&mut piece[..length]).unwrap();
        assert_eq!(piece[..length], stream[at..at + length], "byte {at}");
    }
    assert_eq!(back.seek(SeekFrom::End(-1)).unwrap(), stream.len() as u64 - 1);
    assert_eq!(back.seek(SeekFrom::Start(1 << 40)).unwrap(), 1 << 40);
    assert_eq!(back.read(&mut [0; 8]).unwrap(), 0, "behind the end is nothing");
    assert!(back.seek(SeekFrom::Current(i64::MIN)).is_err());
}

#[test]
fn sound_stands_before_the_geometry_that_is_seen_with_it() {
    let stream = support::stream(90, 30);
    let (file, _) = in_mp4(&stream, vec![Box::new(Clicks::new(3.0))]).unwrap();
    let file = Mp4File::open(Cursor::new(&file)).unwrap();
    assert!(file.is_whole());
    let [geometry, sound] = file.tracks() else { panic!("{} tracks", file.tracks().len()) };
    assert_eq!(
        (geometry.description.codec(), sound.description.codec()),
        ("isv1".to_owned(), "test".to_owned())
    );
    assert_eq!((geometry.samples.len(), sound.samples.len()), (90, 150));
    assert!((geometry.end_s() - 3.0).abs() < 1e-3 && (sound.end_s() - 3.0).abs() < 1e-3);
    let keyframes: Vec<_> = (0..90).filter(|frame| geometry.samples[*frame].sync).collect();
    assert_eq!(keyframes, [0, 30, 60]);
    for seconds in 0..3 {
        let (frame, click) = (geometry.samples[seconds * 30], sound.samples[seconds * 50]);
        assert!(click.at < frame.at, "second {seconds}");
        assert_eq!(frame.time, seconds as u64 * u64::from(geometry.description.timescale));
    }
}

#[test]
fn times_that_do_not_ascend_become_those_of_the_frame_rate() {
    let stream = support::stream_with_times([0, 0, 0, 500_000_000, 400_000_000].into_iter(), 2);
    let (file, _) = in_mp4(&stream, Vec::new()).unwrap();
    let file = Mp4File::open(Cursor::new(&file)).unwrap();
    let track = &file.tracks()[0];
    let ms: Vec<_> =
        track.samples.iter().map(|s| s.time * 1000 / u64::from(track.description.timescale)).collect();
    assert_eq!(ms, [0, 33, 66, 500, 533]);
    // A clock's time is that of the stream, and the movie begins with its first frame.
    let year = 1_700_000_000_000_000_000;
    let stream = support::stream_with_times([year, year + 100_000_000].into_iter(), 2);
    let (file, _) = in_mp4(&stream, Vec::new()).unwrap();
    assert!(read_all(&mut GeometryStream::open(Cursor::new(&file)).unwrap()) == stream);
    let file = Mp4File::open(Cursor::new(&file)).unwrap();
    assert!((file.tracks()[0].end_s() - (0.1 + 1.0 / 30.0)).abs() < 1e-3);
}

#[test]
fn a_file_that_ends_early_has_the_frames_that_are_whole() {
    let stream = support::stream(12, 4);
    let (file, _) = in_mp4(&stream, vec![Box::new(Clicks::new(0.4))]).unwrap();
    let whole = Mp4File::open(Cursor::new(&file)).unwrap();
    let samples = whole.tracks()[0].samples.clone();
    for length in 0..file.len() {
        let cut = &file[..length];
        let Ok(mut back) = GeometryStream::open(Cursor::new(cut)) else {
            assert!(length < samples[0].at as usize, "{length} bytes");
            continue;
        };
        let bytes = read_all(&mut back);
        let mut reader = PacketReader::new(&bytes[..]).unwrap();
        let mut frames = 0;
        while reader.next_frame().unwrap().is_some() {
            frames += 1;
        }
        let expected = samples.iter().filter(|s| s.at + u64::from(s.bytes) <= length as u64).count();
        assert_eq!(frames, expected, "{length} bytes");
        assert!(reader.complete() == back.file().is_whole(), "{length} bytes");
        // A pipe gives the frame that is cut off, too, as a file that is cut off does.
        let piped = read_all(&mut GeometryPipe::new(cut));
        assert!(
            piped.starts_with(&bytes[..bytes.len().min(piped.len())]) && piped.len() >= bytes.len(),
            "{length}"
        );
    }
}

#[test]
fn no_flipped_byte_brings_a_reader_down() {
    let stream = support::stream(6, 3);
    let (file, _) = in_mp4(&stream, vec![Box::new(Clicks::new(0.2))]).unwrap();
    let lists = file.windows(4).position(|name| name == b"mfra").unwrap() + 4;
    for at in 0..file.len() {
        for flip in [0x01, 0x80, 0xff] {
            let mut damaged = file.clone();
            damaged[at] ^= flip;
            // The lists at the end say where samples are, and nobody needs them to read the file from its begin.
            if at >= lists {
                assert!(GeometryStream::open(Cursor::new(&damaged)).is_ok(), "byte {at}");
            }
            let mut piped = Vec::new();
            let _ = std::io::copy(&mut GeometryPipe::new(&damaged[..]).take(1 << 20), &mut piped);
            assert!(piped.len() <= 2 * file.len(), "byte {at}");
            if let Ok(mut back) = GeometryStream::open(Cursor::new(&damaged)) {
                assert!(read_all(&mut back).len() <= 2 * file.len(), "byte {at}");
            }
        }
    }
}

#[test]
fn what_is_no_mp4_is_named() {
    let error = |bytes: &[u8]| GeometryStream::open(Cursor::new(bytes.to_vec())).err().unwrap().to_string();
    assert!(error(b"").contains("not an MP4 file"));
    assert!(error(b"\x89ISV\r\n\x1a\n and so on").contains("not an MP4 file"));
    assert!(error(b"\0\0\0\x0cftypiso6").contains("no moov"));
    let sound = isv_mp4::write_tracks(Vec::new(), vec![Box::new(Clicks::new(1.0))]).unwrap();
    assert!(error(&sound).contains("no track of geometry"));
}

#[test]
fn a_part_of_sound_keeps_step() {
    let times = |source: &mut dyn SampleSource| {
        let mut found = Vec::new();
        while let Some(sample) = source.next_sample().unwrap() {
            found.push((sample.time, sample.duration, sample.data[0]));
        }
        found
    };
    // Clicks are 20 ms long: from 0.25 s on, the first whole one begins at 0.26 s.
    let mut part = Trimmed::new(Box::new(Clicks::new(1.0)), 250_000_000, 330_000_000);
    assert_eq!(times(&mut part), [(10, 20, 13), (30, 20, 14), (50, 20, 15), (70, 20, 16)]);
    let parts: Vec<(u64, Box<dyn SampleSource>)> =
        vec![(0, Box::new(Clicks::new(1.0))), (50_000_000, Box::new(Clicks::new(0.06)))];
    // The third click of the first part reaches into the second part, and what comes behind it is left out.
    assert_eq!(
        times(&mut Chained::new(parts)),
        [(0, 20, 0), (20, 20, 1), (40, 10, 2), (50, 20, 0), (70, 20, 1), (90, 20, 2)]
    );
}

#[test]
fn tracks_of_a_file_can_be_taken_out() {
    let stream = support::stream(30, 10);
    let (file, _) = in_mp4(&stream, vec![Box::new(Clicks::new(1.0))]).unwrap();
    let read = Mp4File::open(Cursor::new(file)).unwrap();
    let track = read.track_of(TrackKind::Sound).unwrap();
    assert!(read.track_of(TrackKind::Picture).is_err());
    let alone =
        isv_mp4::write_tracks(Vec::new(), vec![Box::new(isv_mp4::TrackSource::new(read, track).unwrap())])
            .unwrap();
    let alone = Mp4File::open(Cursor::new(alone)).unwrap();
    assert_eq!((alone.tracks().len(), alone.tracks()[0].samples.len()), (1, 50));
}

#[test]
fn segments_hold_the_file() {
    let stream = support::stream(90, 30);
    let (file, _) = in_mp4(&stream, Vec::new()).unwrap();
    let open = || Mp4File::open(Cursor::new(&file)).unwrap();
    let longer = isv_mp4::Segments::new(open(), NonZero::new(60)).unwrap();
    assert_eq!(longer.list().iter().map(|segment| segment.samples).collect::<Vec<_>>(), [60, 30]);
    let shorter = isv_mp4::Segments::new(open(), NonZero::new(45)).unwrap();
    assert_eq!(shorter.list().iter().map(|segment| segment.samples).collect::<Vec<_>>(), [30; 3]);
    assert!(isv_mp4::Segments::new(open(), NonZero::new(20)).is_err(), "no keyframe is there");
    let mut segments = isv_mp4::Segments::new(open(), None).unwrap();
    let list = segments.list();
    assert_eq!(list.iter().map(|segment| segment.samples).collect::<Vec<_>>(), [30; 3]);
    assert!(list.iter().all(|segment| (segment.duration_s - 1.0).abs() < 1e-6));
    let mut joined = segments.init();
    for segment in 0..list.len() {
        joined.extend(segments.read(segment).unwrap());
    }
    let mut back = GeometryStream::open(Cursor::new(joined)).unwrap();
    assert!(read_all(&mut back) == stream);
}
