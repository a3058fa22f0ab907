//! MP4 files: streams go in and out byte for byte, sound and picture stay in step, and every command reads and writes them.

mod support;

use isv::raw::mp4::{Mp4File, TrackKind};
use isv_testkit::{Need, skip};
use serde_json::Value;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::process::Command;
use support::{ENCODE, Workspace, waveform};

const FRAMES: usize = 9;
const NOT_OVERWRITTEN: &str = "so it is not overwritten";

/// A workspace with `take.isv`, `clicks.wav` and `take.mp4` of both.
fn workspace() -> (Workspace, Vec<u8>) {
    let (work, stream) = Workspace::with_stream(FRAMES);
    work.write("clicks.wav", waveform(0.3));
    work.isv(&["mux", "take.isv", "--audio", "clicks.wav", "-o", "take.mp4"]).done();
    (work, stream)
}

fn info(work: &Workspace, file: &str) -> Value {
    work.isv(&["info", file, "--json"]).json()
}

fn open(work: &Workspace, file: &str) -> Mp4File<BufReader<File>> {
    Mp4File::open(BufReader::new(File::open(work.path(file)).unwrap())).unwrap()
}

#[test]
fn a_stream_comes_out_as_it_went_in() {
    let (work, stream) = workspace();
    work.isv(&["demux", "take.mp4", "-o", "back.isv"]).done();
    assert!(work.read("back.isv") == stream);
    let described = info(&work, "take.mp4");
    let tracks = described["tracks"].as_array().unwrap();
    assert_eq!(tracks.len(), 2);
    assert_eq!((&tracks[0]["codec"], &tracks[0]["samples"]), (&"isv1".into(), &FRAMES.into()));
    assert_eq!((&tracks[1]["kind"], &tracks[1]["codec"]), (&"sound".into(), &"Opus".into()));
    // 0.3 s, a packet of 20 ms more at most, and what warms the decoder up.
    let end_s = tracks[1]["end_s"].as_f64().unwrap();
    assert!((0.3..0.33).contains(&end_s), "{end_s}");
    assert_eq!(described["frames"], info(&work, "take.isv")["frames"]);
    assert_eq!(described["bitrate_mbps"], info(&work, "take.isv")["bitrate_mbps"]);
}

#[test]
fn every_command_reads_it() {
    let (work, stream) = workspace();
    let decode =
        |input: &str, output: &str| work.isv(&["decode", input, "-o", output, "--frames", "4..6"]).done();
    decode("take.isv", "a");
    decode("take.mp4", "b");
    for frame in ["frame_0004.ply", "frame_0005.ply"] {
        assert!(work.read(&format!("a/{frame}")) == work.read(&format!("b/{frame}")), "{frame}");
    }
    work.isv(&["verify", "take.mp4"]).done();
    let piped = work.isv_with_input(&["demux", "take.mp4", "-o", "-"], b"").done();
    assert!(piped.stdout() == stream);
    let piped = work.isv_with_input(&["repair", "-", "-o", "-"], &work.read("take.mp4")).done();
    assert!(piped.stdout() == stream, "through a pipe");
    work.isv(&["encode", "take.mp4", "-o", "again.mp4", "--quality", "20"]).done();
    let tracks = info(&work, "again.mp4")["tracks"].as_array().unwrap().len();
    assert_eq!(tracks, 2, "sound stays when geometry is coded anew");
}

#[test]
fn encoding_into_it_is_encoding_and_putting_into_it() {
    let (work, _) = workspace();
    let mut encode: Vec<&str> = ENCODE.to_vec();
    let output = encode.iter().position(|word| *word == "take.isv").unwrap();
    encode[output] = "direct.mp4";
    encode.extend(["--audio", "clicks.wav"]);
    let said = work.isv(&encode).done().stderr();
    assert!(work.read("direct.mp4") == work.read("take.mp4"));
    // The rate is that of the packets, which are the stream but for its header and its end.
    let rate =
        said.split(" Mbps without sound and picture").next().and_then(|said| said.split(' ').next_back());
    let bytes = rate.unwrap().parse::<f64>().unwrap() * 1e6 / 8.0 * 0.3;
    let stream = work.read("take.isv").len() as f64;
    assert!((0.7 * stream..stream).contains(&bytes), "{bytes} of {stream}: {said}");
}

#[test]
fn sound_is_cut_and_joined_with_the_frames() {
    let (work, _) = workspace();
    work.isv(&["cut", "take.mp4", "3..6", "-o", "b.mp4"]).done();
    work.isv(&["cut", "take.mp4", "0..3", "-o", "a.mp4"]).done();
    work.isv(&["join", "a.mp4", "b.mp4", "-o", "ab.mp4"]).done();
    let whole = open(&work, "take.mp4");
    let sound = whole.track_of(TrackKind::Sound).unwrap();
    for (file, begin_ms, frames) in [("a.mp4", 0, 3), ("b.mp4", 100, 3), ("ab.mp4", 0, 6)] {
        let mut part = open(&work, file);
        let description = &whole.tracks()[sound].description;
        assert_eq!(part.tracks()[1].description, *description, "{file}");
        assert_eq!(part.tracks()[0].samples.len(), frames);
        let samples = part.tracks()[1].samples.clone();
        assert!(!samples.is_empty());
        // Each packet is the packet of the whole at the same time.
        for sample in samples.iter().take(4) {
            let begin = begin_ms * u64::from(description.timescale) / 1000;
            let of_whole =
                whole.tracks()[sound].samples.iter().find(|other| other.time == sample.time + begin);
            let of_whole = of_whole.unwrap_or_else(|| panic!("{file}: {sample:?}"));
            let data = open(&work, "take.mp4").read(of_whole).unwrap();
            assert!(part.read(sample).unwrap() == data, "{file}");
        }
    }
    let cut = work.isv(&["cut", "take.mp4", "3..6", "-o", "b.isv"]).done();
    assert!(cut.stderr().contains("sound and picture are not kept"), "{}", cut.stderr());
}

#[test]
fn what_cannot_be_is_said_in_a_sentence() {
    let (work, _) = workspace();
    let refused = |args: &[&str], words: &str| {
        // An output that is refused before any work is a wrong command line.
        let status = if words == NOT_OVERWRITTEN { 2 } else { 1 };
        work.isv(args).fails(status, &[words]);
    };
    refused(&["mux", "take.isv", "--audio", "take.isv", "-o", "x.mp4"], "take.isv: this is no MP4, MP3, Ogg");
    refused(&["mux", "take.isv", "--audio", "missing.wav", "-o", "x.mp4"], "missing.wav");
    refused(&["mux", "take.isv", "--video", "clicks.wav", "-o", "x.mp4"], "clicks.wav: not an MP4 file");
    refused(&["mux", "take.isv", "--video", "take.mp4", "-o", "x.mp4"], "no track of picture is in it");
    refused(&["demux", "take.isv", "-o", "x.isv"], "not an MP4 file");
    refused(&["mux", "take.isv", "-o", "clicks.wav"], NOT_OVERWRITTEN);
    refused(&["cut", "take.mp4", "0..3", "-o", "clicks.wav"], NOT_OVERWRITTEN);
    work.write("sound.mp4", [0u8; 64]);
    refused(&["mux", "take.isv", "-o", "sound.mp4"], NOT_OVERWRITTEN);
    work.isv(&["demux", "take.mp4", "--tracks", "s.mp4"]).done();
    refused(&["info", "s.mp4"], "no track of geometry");
    assert!(!work.path("x.mp4").exists(), "nothing is left of what failed");
    work.isv(&["encode", "frames", "-o", "x.isv", "--audio", "clicks.wav"])
        .fails(2, &["name the output x.mp4"]);
}

#[test]
fn files_are_named_after_what_is_in_them() {
    let (work, _) = workspace();
    work.isv(&["mux", "take.isv", "-o", "x.isv"]).fails(2, &["x.isv: this makes an MP4 file"]);
    work.isv(&["demux", "take.mp4", "-o", "x.mp4"])
        .fails(2, &["x.mp4: a stream has a name such as take.isv"]);
    work.write("text.isv", "no stream, but text that is longer than the header of one is");
    work.isv(&["mux", "text.isv", "-o", "x.mp4"]).fails(1, &["text.isv: not an .isv stream"]);
    assert!(!work.path("x.isv").exists() && !work.path("x.mp4").exists());
}

#[test]
fn a_fragment_whose_name_is_damaged_is_missed() {
    let (work, bytes) = workspace();
    // Of sound nobody knows how many packets there were.
    work.isv(&["mux", "take.isv", "-o", "silent.mp4"]).done();
    let file = work.read("silent.mp4");
    let places =
        (0..file.len() - 4).filter(|at| [b"moof", b"trun"].iter().any(|name| file[*at..].starts_with(*name)));
    let places: Vec<_> = places.collect();
    assert!(places.len() > 3);
    for at in places {
        let mut damaged = file.clone();
        damaged[at + 3] ^= 1;
        work.write("damaged.mp4", &damaged);
        work.isv(&["verify", "damaged.mp4"]).fails(1, &["damaged.mp4: "]);
    }
    // What follows a stream is not in its copies, and that is said.
    work.write("twice.isv", [&bytes[..], &bytes[..]].concat());
    for args in [
        &["mux", "twice.isv", "-o", "copy.mp4"][..],
        &["join", "twice.isv", "take.isv", "-o", "copy.isv"],
        &["cut", "twice.isv", "0..9", "-o", "copy.isv"],
    ] {
        let said = work.isv(args).done().stderr();
        assert!(said.contains("twice.isv: ") && said.contains("bytes"), "{args:?}: {said}");
    }
}

#[test]
fn a_rate_that_no_sound_has_is_refused() {
    let (work, _) = workspace();
    let mut sound = waveform(0.1);
    for (rate, words) in [
        (0u32, "sound.wav: "),
        (3_999, "sound.wav: waveforms of 4000 to 384000 Hz are coded, not of 3999 Hz"),
        (384_001, "not of 384001 Hz"),
        (u32::MAX, "sound.wav: "),
    ] {
        sound[24..28].copy_from_slice(&rate.to_le_bytes());
        work.write("sound.wav", &sound);
        work.isv(&["mux", "take.isv", "--audio", "sound.wav", "-o", "x.mp4"]).fails(1, &[words]);
    }
    work.isv(&["mux", "take.isv", "--audio", "sound.wav", "--pcm", "-o", "x.mp4"])
        .fails(1, &["waveforms of 4000 to 384000 Hz are taken, not of 4294967295 Hz"]);
    sound[24..28].copy_from_slice(&384_000u32.to_le_bytes());
    work.write("sound.wav", &sound);
    work.isv(&["mux", "take.isv", "--audio", "sound.wav", "-o", "x.mp4"]).done();
}

#[test]
fn sound_that_is_longer_or_shorter_than_the_geometry_is_told_of() {
    let (work, _) = workspace();
    // Frames take 0.3 s; packets of sound may end a little later.
    for (sound_s, words) in [
        (0.3, None),
        (0.36, None),
        (0.24, None),
        (1.0, Some("longer than the geometry")),
        (0.1, Some("shorter than the geometry")),
    ] {
        work.write("sound.wav", waveform(sound_s));
        let said = |stderr: &str| match words {
            None => assert!(!stderr.contains("than the geometry"), "{sound_s} s: {stderr}"),
            Some(words) => {
                let by_s = (sound_s - 0.3f64).abs();
                assert!(
                    stderr.contains(words) && stderr.contains("sound of track 2"),
                    "{sound_s} s: {stderr}"
                );
                let told = stderr.split(" is ").nth(1).and_then(|rest| rest.split(' ').next());
                let told: f64 = told.unwrap().parse().unwrap();
                assert!((told - by_s).abs() < 0.03, "{sound_s} s: {stderr}");
            }
        };
        said(&work.isv(&["mux", "take.isv", "--audio", "sound.wav", "-o", "other.mp4"]).done().stderr());
        let track = &info(&work, "other.mp4")["tracks"][1];
        let longer_s = track["longer_s"].as_f64().unwrap();
        assert!((longer_s - (sound_s - 0.3)).abs() < 0.03, "{track}");
        assert_eq!(info(&work, "other.mp4")["tracks"][0]["longer_s"], 0.0);
        let table = String::from_utf8(work.isv(&["info", "other.mp4"]).done().stdout().to_vec()).unwrap();
        assert_eq!(table.contains("than the geometry"), words.is_some(), "{table}");
    }
    // What is encoded and muxed at once is told of in the same words.
    work.write("sound.wav", waveform(1.0));
    let run = ["encode", "take.isv", "-o", "again.mp4", "--audio", "sound.wav", "--quality", "20"];
    let said = work.isv(&run).done().stderr();
    assert!(said.contains("again.mp4: the sound of track 2 is 0.7") && said.contains("longer"), "{said}");
    // So are tracks that an MP4 file has already, each by its number.
    work.isv(&["mux", "other.mp4", "--audio", "sound.wav", "-o", "two.mp4"]).done();
    let said = work.isv(&["mux", "two.mp4", "-o", "kept.mp4"]).done().stderr();
    assert!(
        said.contains("track 2 is 0.1") && said.contains("track 3 is 0.7"),
        "kept tracks are told of: {said}"
    );
}

/// What another program prints of a file.
fn printed(program: &str, args: &[&str], file: &Path) -> Option<String> {
    let output = Command::new(program).args(args).arg(file).output().ok()?;
    Some(String::from_utf8(output.stdout).unwrap())
}

#[test]
fn other_parsers_list_the_same_tracks_and_times() {
    let (work, _) = workspace();
    work.isv(&["mux", "take.isv", "--audio", "clicks.wav", "--pcm", "-o", "pcm.mp4"]).done();
    let file = work.path("take.mp4");
    let probe = ["-v", "error", "-of", "json", "-show_streams", "-show_packets"];
    let (Some(probed), Some(described)) =
        (printed("ffprobe", &probe, &file), printed("mediainfo", &["--Output=JSON"], &file))
    else {
        return skip(Need::Media, "ffprobe and mediainfo are not installed");
    };
    let probed: Value = serde_json::from_str(&probed).unwrap();
    let streams = probed["streams"].as_array().unwrap();
    let tags: Vec<_> = streams.iter().map(|stream| stream["codec_tag_string"].as_str().unwrap()).collect();
    assert_eq!(tags, ["isv1", "Opus"]);
    assert_eq!((&streams[1]["codec_name"], &streams[1]["sample_rate"]), (&"opus".into(), &"48000".into()));
    let seconds = |value: &Value| value.as_str().unwrap().parse::<f64>().unwrap();
    let packets = probed["packets"].as_array().unwrap();
    let times = |stream: usize| {
        let of_stream = packets.iter().filter(move |packet| packet["stream_index"] == stream);
        of_stream.map(|packet| seconds(&packet["pts_time"])).collect::<Vec<_>>()
    };
    let mut own = open(&work, "take.mp4");
    assert_eq!(times(0).len(), FRAMES);
    for (frame, time) in times(0).into_iter().enumerate() {
        assert!((time - frame as f64 / 30.0).abs() < 1e-4, "frame {frame} at {time}");
        let sample = own.tracks()[0].samples[frame];
        let packet = packets.iter().filter(|packet| packet["stream_index"] == 0).nth(frame).unwrap();
        assert_eq!(packet["pos"].as_str().unwrap(), sample.at.to_string());
        assert_eq!(packet["size"].as_str().unwrap(), own.read(&sample).unwrap().len().to_string());
        assert_eq!(sample.sync, frame % 3 == 0);
    }
    // What warms the decoder up lies before the begin.
    assert!((times(1)[0] + 312.0 / 48_000.0).abs() < 1e-3, "{}", times(1)[0]);
    let described: Value = serde_json::from_str(&described).unwrap();
    let tracks = described["media"]["track"].as_array().unwrap();
    let kinds: Vec<_> = tracks.iter().map(|track| track["@type"].as_str().unwrap()).collect();
    assert!(kinds.contains(&"Audio") && kinds.contains(&"Other"), "{kinds:?}");
    let audio = tracks.iter().find(|track| track["@type"] == "Audio").unwrap();
    assert_eq!(audio["Format"], "Opus");
    assert!((seconds(&audio["Duration"]) - 0.3).abs() < 0.04, "{}", audio["Duration"]);
    let pcm = printed("mediainfo", &["--Output=JSON"], &work.path("pcm.mp4")).unwrap();
    assert!(pcm.contains("ipcm"), "{pcm}");
}

#[test]
fn coded_sound_is_copied_as_it_is() {
    let (work, _) = workspace();
    for (file, coder, codec) in [
        ("sound.ogg", "libopus", "Opus"),
        ("sound.flac", "flac", "fLaC"),
        ("sound.mp3", "libmp3lame", "mp4a"),
        ("sound.m4a", "aac", "mp4a"),
    ] {
        let coded = Command::new("ffmpeg")
            .args(["-v", "error", "-i"])
            .arg(work.path("clicks.wav"))
            .args(["-c:a", coder])
            .arg(work.path(file))
            .status();
        if !coded.is_ok_and(|status| status.success()) {
            return skip(Need::Media, "ffmpeg is not installed, or lacks a coder");
        }
        work.isv(&["mux", "take.isv", "--audio", file, "-o", "coded.mp4"]).done();
        let mut muxed = open(&work, "coded.mp4");
        let track = muxed.track_of(TrackKind::Sound).unwrap();
        let (description, samples) =
            (muxed.tracks()[track].description.clone(), muxed.tracks()[track].samples.clone());
        assert_eq!(description.codec(), codec, "{file}");
        let end_s = muxed.tracks()[track].end_s();
        assert!((0.29..0.4).contains(&end_s), "{file}: {end_s}");
        // The bytes of each packet stand in the file one after the other, or with pages of Ogg between some.
        let original = work.read(file);
        for sample in samples.iter().take(3) {
            let packet = muxed.read(sample).unwrap();
            let piece = &packet[..packet.len().min(200)];
            assert!(
                original.windows(piece.len()).any(|window| window == piece),
                "{file}: a packet is another"
            );
        }
    }
}

#[test]
fn a_file_that_is_cut_off_has_its_first_frames() {
    let (work, _) = workspace();
    let bytes = work.read("take.mp4");
    let second = open(&work, "take.mp4").tracks()[0].samples[4];
    work.write("cut.mp4", &bytes[..second.at as usize + 10]);
    work.isv(&["verify", "cut.mp4"]).fails(1, &["ends without an index"]);
    work.isv(&["repair", "cut.mp4", "-o", "whole.mp4"]).done();
    work.isv(&["verify", "whole.mp4"]).done();
    assert_eq!(info(&work, "whole.mp4")["frames"], 4);
    let said = work.isv(&["demux", "cut.mp4", "-o", "cut.isv"]).done().stderr();
    assert!(said.contains("cut.mp4: ends without an index"), "{said}");
    let first = open(&work, "take.mp4").tracks()[0].samples[0];
    work.write("none.mp4", &bytes[..first.at as usize + 10]);
    work.isv(&["demux", "none.mp4", "-o", "none.isv"]).fails(1, &["none.mp4: ends before frame 0"]);
}

/// The first packet of sound of a file at a time or after it.
fn sound_from(work: &Workspace, file: &str, from_ms: u64) -> Vec<u8> {
    let mut file = open(work, file);
    let sound = file.track_of(TrackKind::Sound).unwrap();
    let track = &file.tracks()[sound];
    let found = track.samples.iter().find(|sample| track.shown_ns(sample) >= from_ms * 1_000_000);
    let found = *found.unwrap();
    file.read(&found).unwrap()
}

#[test]
fn sound_begins_with_the_first_frame_that_is_coded() {
    let work = Workspace::with_figure(8);
    work.write("sound.wav", waveform(1.0));
    let encode = |output: &str, more: &[&str]| {
        let run = ["encode", "frames", "-o", output, "--voxel", "30mm", "--audio", "sound.wav"];
        work.isv(&[&run[..], more].concat()).done();
    };
    // Numbers tell when frames are shown: the fifth, ten frames after the first.
    for frame in 4..8 {
        let bytes = work.read(&format!("frames/frame_{frame}.ply"));
        std::fs::remove_file(work.path(&format!("frames/frame_{frame}.ply"))).unwrap();
        work.write(&format!("frames/frame_{}.ply", frame + 6), bytes);
    }
    encode("whole.mp4", &[]);
    encode("part.mp4", &["--frames", "4..8"]);
    assert!(sound_from(&work, "part.mp4", 0) == sound_from(&work, "whole.mp4", 333));
    for frame in 0..3 {
        work.write(&format!("frames/frame_{frame}.ply"), "no mesh");
    }
    encode("left.mp4", &["--skip-bad-frames"]);
    assert!(sound_from(&work, "left.mp4", 0) == sound_from(&work, "whole.mp4", 100));
}

#[test]
fn joined_sound_is_where_its_frames_are() {
    let work = Workspace::with_figure(9);
    work.write("sound.wav", waveform(1.0));
    for (range, output) in [("0..3", "a.mp4"), ("6..9", "b.mp4")] {
        let run = ["encode", "frames", "-o", output, "--voxel", "30mm", "--time-origin", "0"];
        work.isv(&[&run[..], &["--frames", range, "--audio", "sound.wav"]].concat()).done();
    }
    work.isv(&["join", "a.mp4", "b.mp4", "-o", "kept.mp4", "--keep-times"]).done();
    assert!(sound_from(&work, "kept.mp4", 199) == sound_from(&work, "b.mp4", 0));
    work.isv(&["join", "a.mp4", "b.mp4", "-o", "followed.mp4"]).done();
    assert!(sound_from(&work, "followed.mp4", 99) == sound_from(&work, "b.mp4", 0));
}
