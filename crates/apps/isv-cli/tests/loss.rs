//! Streams that lost something: `isv repair`, `isv decode --after-loss hold`, and `isv cut` and `isv join` of whole ones.

mod support;

use isv::raw::format::{
    FrameRate, PacketHeader, PacketKind, PacketReader, PacketWriter, StreamHeader, StreamIndex,
};
use support::{ENCODE, Workspace};

const FRAMES: usize = 9;

/// Beginning and length of each packet of a stream.
fn packets(work: &Workspace, stream: &str) -> Vec<(usize, usize)> {
    let info = work.isv(&["info", stream, "--json"]).json();
    let sizes = info["packets"].as_array().unwrap().iter().map(|p| p["bytes"].as_u64().unwrap() as usize);
    let mut at = 48;
    sizes
        .map(|size| {
            at += size;
            (at - size, size)
        })
        .collect()
}

fn info(work: &Workspace, stream: &str) -> serde_json::Value {
    work.isv(&["info", stream, "--json"]).json()
}

fn hashes(work: &Workspace, stream: &str) -> String {
    String::from_utf8(work.isv(&["verify", stream]).done().stdout().to_vec()).unwrap()
}

/// A keyframe every three frames: a damaged packet costs what needs it, up to the next.
#[test]
fn a_damaged_packet_costs_what_needs_it() {
    let (work, mut bytes) = Workspace::with_stream(FRAMES);
    let whole = packets(&work, "take.isv");
    bytes[whole[4].0 + 30] ^= 1;
    work.write("damaged.isv", &bytes);
    work.isv(&["verify", "damaged.isv"]).fails(1, &["damaged.isv", "isv repair"]);
    let run = work.isv(&["repair", "damaged.isv", "-o", "mended.isv"]).done();
    let said = String::from_utf8(run.stdout().to_vec()).unwrap();
    let (at, size) = whole[4];
    assert_eq!(
        said.trim(),
        format!(
            "damaged.isv: 7 frames kept, {size} bytes are damaged from byte {at} on, 1 frame left out that needs a lost one"
        )
    );
    assert!(hashes(&work, "mended.isv").contains("7 frames verified, 7 of them by hash"));
    // Their times are those that they had.
    let (old, new) = (info(&work, "take.isv"), info(&work, "mended.isv"));
    let times: Vec<_> =
        new["packets"].as_array().unwrap().iter().map(|p| p["timestamp_ns"].clone()).collect();
    let kept = [0, 1, 2, 3, 6, 7, 8];
    assert_eq!(times, kept.map(|frame| old["packets"][frame]["timestamp_ns"].clone()));
}

/// What the header said is in no packet, but another stream of the take says it.
#[test]
fn a_damaged_header_is_taken_from_another_stream() {
    let (work, bytes) = Workspace::with_stream(3);
    work.isv(&["cut", "take.isv", "0..1", "-o", "other.isv"]).done();
    let repair = |damaged: &str, other: &str| {
        work.isv(&["repair", damaged, "-o", "mended.isv", "--header-from", other])
    };
    // In the magic, the version and the voxel size.
    for at in [3, 8, 18] {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1;
        work.write("damaged.isv", &damaged);
        work.isv(&["repair", "damaged.isv", "-o", "mended.isv"])
            .fails(1, &["damaged.isv: ", "--header-from takes that of another stream"]);
        let run = repair("damaged.isv", "other.isv").done();
        let said = "damaged.isv: 3 frames kept, 48 bytes are damaged from byte 0 on\n";
        assert_eq!(String::from_utf8_lossy(run.stdout()), said);
        assert_eq!(work.read("mended.isv"), bytes);
        std::fs::remove_file(work.path("mended.isv")).unwrap();
    }
    work.isv(&["encode", "frames", "-o", "coarse.isv", "--voxel", "30mm"]).done();
    repair("take.isv", "coarse.isv").fails(1, &["take.isv: its own header is sound"]);
    repair("damaged.isv", "damaged.isv").fails(1, &["damaged.isv: "]);
    repair("damaged.isv", "mended.isv").fails(1, &["mended.isv: "]);
    work.isv(&["repair", "damaged.isv", "-o", "other.isv", "--header-from", "other.isv"])
        .fails(2, &["other.isv: is what is read"]);
    assert!(!work.path("mended.isv").exists());
}

/// Two files that were joined byte for byte: the second has a header of its own, and is no part of the first.
#[test]
fn another_stream_behind_the_first_is_left_out() {
    let (work, first) = Workspace::with_stream(3);
    work.isv(&["encode", "frames", "-o", "other.isv", "--voxel", "30mm"]).done();
    let cut = packets(&work, "take.isv")[1].0 + 5;
    for (joined, kept) in [(&first[..], 3), (&first[..cut], 1)] {
        let at = joined.len();
        work.write("joined.isv", [joined, &work.read("other.isv")].concat());
        let run = work.isv(&["repair", "joined.isv", "-o", "mended.isv"]).done();
        let said = String::from_utf8(run.stdout().to_vec()).unwrap();
        assert!(said.contains(&format!("another stream begins at byte {at} and is left out")), "{said}");
        assert_eq!(info(&work, "mended.isv")["frames"], kept, "{said}");
        work.isv(&["verify", "mended.isv"]).done();
        let run = work.isv(&["decode", "joined.isv", "-o", "held", "--after-loss", "hold"]).done();
        assert!(run.stderr().contains(&format!("another stream begins at byte {at}")), "{}", run.stderr());
        assert_eq!(work.names("held").len(), kept);
        std::fs::remove_dir_all(work.path("held")).unwrap();
    }
    // The same header again goes on.
    work.write("joined.isv", [&first[..], &first].concat());
    work.isv(&["repair", "joined.isv", "-o", "mended.isv"]).done();
    assert_eq!(info(&work, "mended.isv")["frames"], 6);
}

/// A cut in the trailer is a cut: nobody can tell whether all was written.
#[test]
fn an_index_without_its_trailer_is_no_end() {
    let (work, bytes) = Workspace::with_stream(3);
    work.write("cut.isv", &bytes[..bytes.len() - 3]);
    assert_eq!(info(&work, "cut.isv")["complete"], false);
    let run = work.isv(&["repair", "cut.isv", "-o", "mended.isv"]).done();
    let said = String::from_utf8(run.stdout().to_vec()).unwrap();
    assert!(said.contains("3 frames kept") && said.contains("the end was missing and is new"), "{said}");
    assert_eq!(work.read("mended.isv"), bytes);
}

/// A frame every twenty seconds, as of a building site: one that is lost is held as anywhere.
#[test]
fn frames_of_slow_captures_are_held_too() {
    let work = Workspace::with_figure(4);
    work.isv(&["encode", "frames", "-o", "take.isv", "--voxel=20mm", "--gop=1", "--fps=0.05"]).done();
    let (bytes, (at, size)) = (work.read("take.isv"), packets(&work, "take.isv")[1]);
    work.write("lossy.isv", [&bytes[..at], &bytes[at + size..]].concat());
    work.isv(&["decode", "take.isv", "-o", "whole"]).done();
    work.isv(&["decode", "lossy.isv", "-o", "held", "--after-loss", "hold"]).done();
    for (frame, shown) in [0, 0, 2, 3].into_iter().enumerate() {
        let (held, whole) = (format!("held/frame_{frame:04}.ply"), format!("whole/frame_{shown:04}.ply"));
        assert!(work.read(&held) == work.read(&whole), "frame {frame}");
    }
}

/// Timestamps almost a second apart are no reason for thousands of millions of frames.
#[test]
fn frames_that_no_camera_makes_are_not_held() {
    let work = Workspace::with_figure(3);
    work.isv(&["encode", "frames", "-o", "take.isv", "--voxel=20mm", "--gop=1"]).done();
    let bytes = work.read("take.isv");
    let mut packets = PacketReader::new(&bytes[..]).unwrap();
    let frame_rate = FrameRate { numerator: u32::MAX, denominator: 1 };
    let header = StreamHeader { frame_rate, ..*packets.header() };
    let mut writer = PacketWriter::new(Vec::new(), &header).unwrap();
    for timestamp_ns in [0, 900_000_000, 900_000_001] {
        writer.copy_frame(&packets.next_frame().unwrap().unwrap(), timestamp_ns).unwrap();
    }
    work.write("fast.isv", writer.finish().unwrap());
    work.isv(&["decode", "fast.isv", "-o", "meshes", "--after-loss", "hold"]).done();
    // A nanosecond is four frames at that rate.
    assert_eq!(work.names("meshes").len(), 6);
}

#[test]
fn a_cut_file_is_repaired_to_its_last_whole_frame() {
    let (work, bytes) = Workspace::with_stream(FRAMES);
    let whole = packets(&work, "take.isv");
    let (last, _) = whole[8];
    for (length, frames) in [(last + 10, 8), (last, 8), (whole[1].0 + 1, 1)] {
        work.write("cut.isv", &bytes[..length]);
        let run = work.isv(&["repair", "cut.isv", "-o", "mended.isv"]).done();
        let said = String::from_utf8(run.stdout().to_vec()).unwrap();
        assert!(said.contains("the end was missing and is new"), "{said}");
        assert_eq!(info(&work, "mended.isv")["frames"], frames, "{length} bytes");
        assert_eq!(info(&work, "mended.isv")["complete"], true);
        work.isv(&["verify", "mended.isv"]).done();
    }
    work.write("cut.isv", &bytes[..whole[0].0 + 50]);
    work.isv(&["repair", "cut.isv", "-o", "nothing.isv"]).fails(1, &["no frame in it can be decoded"]);
    assert!(!work.path("nothing.isv").exists());
    work.write("cut.isv", &bytes[..40]);
    work.isv(&["repair", "cut.isv", "-o", "nothing.isv"]).fails(1, &["cut off at byte 40"]);
}

#[test]
fn a_whole_stream_stays_byte_for_byte_and_pipes_work() {
    let (work, bytes) = Workspace::with_stream(FRAMES);
    work.isv(&["repair", "take.isv", "-o", "same.isv"]).done();
    assert_eq!(work.read("same.isv"), bytes);
    let run = work.isv_with_input(&["repair", "-", "-o", "-"], &[&bytes[..], b"and more"].concat()).done();
    assert_eq!(run.stdout(), bytes);
    assert!(run.stderr().contains("8 bytes are damaged"), "{}", run.stderr());
}

/// Every frame of time has a file: where one is lost, the last one's.
#[test]
fn lost_frames_are_held() {
    let (work, bytes) = Workspace::with_stream(FRAMES);
    work.isv(&["decode", "take.isv", "-o", "whole"]).done();
    let whole = packets(&work, "take.isv");
    // Frame 4 is gone as if it had never been sent, so frame 5 cannot be decoded.
    let (at, size) = whole[4];
    work.write("lossy.isv", [&bytes[..at], &bytes[at + size..]].concat());
    work.isv(&["decode", "lossy.isv", "-o", "stopped"])
        .fails(1, &["a packet is missing", "--after-loss hold"]);
    work.isv(&["verify", "lossy.isv"]).fails(1, &["a packet is missing", "--after-loss hold"]);
    let run = work.isv(&["decode", "lossy.isv", "-o", "held", "--after-loss", "hold"]).done();
    let said = run.stderr();
    assert!(said.contains("frame 4 is lost") && said.contains("exact again from frame 6 on"), "{said}");
    assert_eq!(work.names("held"), work.names("whole"));
    let shown = [0, 1, 2, 3, 3, 3, 6, 7, 8];
    for (frame, shown) in shown.into_iter().enumerate() {
        let (held, whole) = (format!("held/frame_{frame:04}.ply"), format!("whole/frame_{shown:04}.ply"));
        assert_eq!(work.read(&held), work.read(&whole), "frame {frame}");
    }
    // Without its first packet too a frame has its number.
    let (first, of_first) = whole[0];
    work.write("headless.isv", [&bytes[..first], &bytes[first + of_first..]].concat());
    work.isv(&["decode", "headless.isv", "-o", "late", "--after-loss", "hold"]).done();
    assert_eq!(work.names("late"), work.names("whole")[3..]);
    assert!(work.read("late/frame_0003.ply") == work.read("whole/frame_0003.ply"));
    // The same where a packet is there, but damaged.
    let mut damaged = bytes;
    damaged[at + 30] ^= 1;
    work.write("damaged.isv", damaged);
    let held = ["decode", "damaged.isv", "-o", "part", "--after-loss", "hold", "--frames", "3..6"];
    assert!(work.isv(&held).done().stderr().contains("bytes are damaged from byte"));
    assert_eq!(work.names("part").len(), 3);
    assert!(work.read("part/frame_0005.ply") == work.read("whole/frame_0003.ply"));
}

#[test]
fn a_stream_with_gradual_refresh_is_whole_again_without_a_keyframe() {
    let work = Workspace::with_figure(FRAMES);
    let encode =
        ["encode", "frames", "-o", "take.isv", "--voxel=20mm", "--gop=2", "--checksums", "--refresh=gradual"];
    work.isv(&encode).done();
    assert_eq!(info(&work, "take.isv")["keyframes"], serde_json::json!([0]));
    assert!(hashes(&work, "take.isv").contains("9 frames verified, 9 of them by hash"));
    work.isv(&["decode", "take.isv", "-o", "whole"]).done();
    let (bytes, (at, size)) = (work.read("take.isv"), packets(&work, "take.isv")[2]);
    work.write("lossy.isv", [&bytes[..at], &bytes[at + size..]].concat());
    let run = work.isv(&["decode", "lossy.isv", "-o", "held", "--after-loss", "hold"]).done();
    assert!(run.stderr().contains("near what was encoded from frame 3 on"), "{}", run.stderr());
    assert!(run.stderr().contains("exact again from frame 4 on"), "{}", run.stderr());
    for frame in [0, 1, 4, 5, 6, 7, 8] {
        let name = format!("frame_{frame:04}.ply");
        assert!(work.read(&format!("held/{name}")) == work.read(&format!("whole/{name}")), "frame {frame}");
    }
    let said = work.isv(&["repair", "lossy.isv", "-o", "mended.isv"]).done();
    let said = String::from_utf8(said.stdout().to_vec()).unwrap();
    assert!(said.contains("8 frames kept") && said.contains("--after-loss hold"), "{said}");
    // Without its keyframe it begins at a resilient frame, and what is refreshed is the same.
    let first = packets(&work, "take.isv")[0];
    work.write("headless.isv", [&bytes[..first.0], &bytes[first.0 + first.1..]].concat());
    let said = work.isv(&["repair", "headless.isv", "-o", "mended.isv"]).done();
    let said = String::from_utf8(said.stdout().to_vec()).unwrap();
    assert!(said.contains("8 frames kept") && said.contains("8 frames of them behind a loss"), "{said}");
    let run = work.isv(&["decode", "mended.isv", "-o", "entered", "--after-loss", "hold"]).done();
    assert!(run.stderr().contains("exact again from frame"), "{}", run.stderr());
    assert!(work.read("entered/frame_0008.ply") == work.read("whole/frame_0008.ply"));
    let paper = ["encode", "frames", "-o", "p.isv", "--voxel=20mm", "--profile=paper", "--refresh=gradual"];
    work.isv(&paper).fails(2, &["--refresh", "profile main"]);
}

/// A whole GOP is damaged, so that the counts of packets fit each other: what follows needs another frame than the one before.
#[test]
fn a_damaged_gop_is_noticed_though_the_counts_fit() {
    let (work, mut bytes) = Workspace::with_stream(FRAMES);
    work.isv(&["decode", "take.isv", "-o", "whole"]).done();
    // Keyframes are frames 0, 3 and 6: frame 1 and then frame 5 have the counts 1 and 2.
    for (at, _) in &packets(&work, "take.isv")[2..5] {
        bytes[at + 30] ^= 1;
    }
    work.write("damaged.isv", bytes);
    let said = work.isv(&["repair", "damaged.isv", "-o", "mended.isv"]).done();
    let said = String::from_utf8(said.stdout().to_vec()).unwrap();
    assert!(
        said.contains("5 frames kept") && said.contains("1 frame left out that needs a lost one"),
        "{said}"
    );
    work.isv(&["verify", "mended.isv"]).done();
    let run = work.isv(&["decode", "damaged.isv", "-o", "held", "--after-loss", "hold"]).done();
    assert!(run.stderr().contains("exact again from frame 6 on"), "{}", run.stderr());
    for (frame, shown) in [0, 1, 1, 1, 1, 1, 6, 7, 8].into_iter().enumerate() {
        let (held, whole) = (format!("held/frame_{frame:04}.ply"), format!("whole/frame_{shown:04}.ply"));
        assert!(work.read(&held) == work.read(&whole), "frame {frame}");
    }
}

#[test]
fn streams_are_cut_at_keyframes_and_joined() {
    let (work, bytes) = Workspace::with_stream(FRAMES);
    work.isv(&["cut", "take.isv", "0..3", "-o", "a.isv"]).done();
    work.isv(&["cut", "take.isv", "3..9", "-o", "b.isv"]).done();
    for (part, frames) in [("a.isv", 3), ("b.isv", 6)] {
        assert!(hashes(&work, part).contains(&format!("{frames} frames verified, {frames} of them by hash")));
        assert_eq!(info(&work, part)["packets"][0]["timestamp_ns"], 0);
    }
    // The same by open ranges.
    work.isv(&["cut", "take.isv", "..3", "-o", "a_open.isv"]).done();
    work.isv(&["cut", "take.isv", "3..", "-o", "b_open.isv"]).done();
    assert!(work.read("a.isv") == work.read("a_open.isv") && work.read("b.isv") == work.read("b_open.isv"));
    work.isv(&["cut", "take.isv", "9..", "-o", "c.isv"]).fails(1, &["frames 9.. asked for", "there are 9"]);
    work.isv(&["join", "a.isv", "b.isv", "-o", "joined.isv"]).done();
    assert_eq!(info(&work, "joined.isv")["frames"], 9);
    // Times are those of one take, to the nanosecond, however many pieces it is joined of.
    let times = |stream: &str| -> Vec<u64> {
        let info = info(&work, stream);
        info["packets"].as_array().unwrap().iter().map(|p| p["timestamp_ns"].as_u64().unwrap()).collect()
    };
    assert_eq!(times("joined.isv"), times("take.isv"));
    work.isv(&["join", "b.isv", "a.isv", "joined.isv", "-o", "longer.isv"]).done();
    let expected = (0..18).map(|frame| frame * 1_000_000_000 / 30);
    assert!(times("longer.isv").into_iter().eq(expected), "{:?}", times("longer.isv"));
    assert_eq!(work.read("joined.isv").len(), bytes.len());
    work.isv(&["verify", "joined.isv"]).done();
    work.isv(&["decode", "take.isv", "-o", "whole"]).done();
    work.isv(&["decode", "joined.isv", "-o", "again"]).done();
    for name in work.names("whole") {
        assert!(work.read(&format!("whole/{name}")) == work.read(&format!("again/{name}")), "{name}");
    }
    // Into the same folder once more: of what is left from before is told, where a part was decoded.
    let run = work.isv(&["decode", "a.isv", "-o", "again"]).done();
    assert!(run.stderr().contains("again: 6 frames from before are left in it, from frame_0003.ply on"));
    assert!(!work.isv(&["decode", "take.isv", "-o", "again"]).done().stderr().contains("before"));
    work.isv(&["cut", "take.isv", "4..9", "-o", "c.isv"]).fails(1, &["frame 4 is no keyframe", "3 or 6"]);
    work.isv(&["cut", "take.isv", "3..10", "-o", "c.isv"]).fails(1, &["there are 9"]);
    work.isv(&["encode", "frames", "-o", "other.isv", "--voxel=25mm"]).done();
    work.isv(&["join", "a.isv", "other.isv", "-o", "c.isv"]).fails(1, &["other.isv", "voxel size"]);
    work.isv(&["join", "-", "-o", "c.isv"]).fails(2, &["needs a file"]);
    #[cfg(unix)]
    work.isv(&["join", "a.isv", "/dev/null", "-o", "c.isv"]).fails(2, &["/dev/null: ", "needs a file"]);
    assert!(!work.path("c.isv").exists());
}

/// A stream of some of the packets of another, in any order, with its index and trailer as they were.
fn rearranged(work: &Workspace, bytes: &[u8], order: &[usize]) -> Vec<u8> {
    let packets = packets(work, "take.isv");
    let (last, size) = packets[packets.len() - 1];
    let taken = order.iter().flat_map(|frame| &bytes[packets[*frame].0..][..packets[*frame].1]);
    bytes[..48].iter().chain(taken).chain(&bytes[last + size..]).copied().collect()
}

/// Decodes a stream behind losses and compares every frame with one of `whole/`.
fn check_held(work: &Workspace, stream: &str, shown: &[usize]) {
    let run = work.isv(&["decode", stream, "-o", "held", "--after-loss", "hold"]).done();
    assert_eq!(work.names("held").len(), shown.len(), "{}", run.stderr());
    for (frame, shown) in shown.iter().enumerate() {
        let (held, whole) = (format!("held/frame_{frame:04}.ply"), format!("whole/frame_{shown:04}.ply"));
        assert!(work.read(&held) == work.read(&whole), "frame {frame}: {}", run.stderr());
    }
    std::fs::remove_dir_all(work.path("held")).unwrap();
}

/// Keyframes are frames 0, 3 and 6.
#[test]
fn frames_keep_their_numbers_whatever_packets_come_twice_too_late_or_not_at_all() {
    let (work, bytes) = Workspace::with_stream(FRAMES);
    work.isv(&["decode", "take.isv", "-o", "whole"]).done();
    for (order, shown) in [
        // Twice.
        (&[0, 1, 1, 2, 3, 3, 4, 5, 6, 7, 8][..], [0, 1, 2, 3, 4, 5, 6, 7, 8]),
        // Frame 2 before frame 1, and frame 4 before its keyframe.
        (&[0, 2, 1, 3, 4, 5, 6, 7, 8], [0, 0, 0, 3, 4, 5, 6, 7, 8]),
        (&[0, 1, 2, 4, 3, 5, 6, 7, 8], [0, 1, 2, 2, 2, 2, 6, 7, 8]),
        // A keyframe with the frame before, and the last two.
        (&[0, 1, 4, 5, 6], [0, 1, 1, 1, 1, 1, 6, 6, 6]),
    ] {
        work.write("rearranged.isv", rearranged(&work, &bytes, order));
        check_held(&work, "rearranged.isv", &shown);
    }
    // Each take of two begins at time 0.
    let twice = [&bytes[..], &bytes].concat();
    work.write("twice.isv", twice);
    check_held(&work, "twice.isv", &[0, 1, 2, 3, 4, 5, 6, 7, 8, 0, 1, 2, 3, 4, 5, 6, 7, 8]);
}

#[test]
fn frames_that_are_not_there_cannot_be_asked_for_behind_a_loss_either() {
    let (work, _) = Workspace::with_stream(3);
    let run = work.isv(&["decode", "take.isv", "-o", "x.ply", "--after-loss=hold", "--frames=5..6"]);
    run.fails(1, &["frames 5..6 asked for, but there are 3"]);
    work.isv(&["decode", "take.isv", "-o", "x.ply", "--after-loss=hold", "--frames=2..3"]).done();
}

/// Frames of a clock come when they come. Where one was skipped, the one before it is shown for longer.
#[test]
fn frames_are_shown_when_they_are_to_be() {
    let work = Workspace::with_figure(8);
    let clock = [&ENCODE[..], &["--timestamps=clock", "--fps=1000"]].concat();
    work.isv(&clock).done();
    work.write("frames/frame_4.ply", "ply\n");
    let skipped = [&["encode", "frames", "-o", "skipped.isv"], &ENCODE[4..], &["--skip-bad-frames"]].concat();
    work.isv(&skipped).done();
    for (stream, held) in [("take.isv", 0), ("skipped.isv", 1)] {
        let run = work.isv(&["decode", stream, "-o", "held", "--after-loss=hold"]).done();
        assert_eq!(run.stderr().matches("is held").count(), held, "{stream}: {}", run.stderr());
        assert_eq!(work.names("held").len(), 8);
        std::fs::remove_dir_all(work.path("held")).unwrap();
    }
    // Coded again, frames are shown when they were.
    work.isv(&["encode", "skipped.isv", "-o", "again.isv"]).done();
    let times = |stream: &str| -> Vec<u64> {
        let packets = info(&work, stream)["packets"].clone();
        packets.as_array().unwrap().iter().map(|packet| packet["timestamp_ns"].as_u64().unwrap()).collect()
    };
    assert_eq!(times("skipped.isv")[4], 166_666_666);
    assert_eq!(times("again.isv"), times("skipped.isv"));
}

/// A stream is whole if its frames, its index and its end agree.
#[test]
fn what_does_not_fit_together_is_not_verified() {
    let (work, bytes) = Workspace::with_stream(FRAMES);
    work.write("twice.isv", [&bytes[..], &bytes].concat());
    let at = format!("bytes follow the end of the stream, from byte {} on", bytes.len());
    work.isv(&["verify", "twice.isv"]).fails(1, &[&at]);
    let run = work.isv(&["decode", "twice.isv", "-o", "meshes"]).done();
    assert!(run.stderr().contains("follow the end of the stream and are left out"), "{}", run.stderr());
    let behind = info(&work, "twice.isv")["bytes_behind"].as_u64().unwrap();
    assert_eq!(behind as usize, bytes.len());
    // An index without frame 4, and one that calls frame 1 a keyframe.
    let index_at = u64::from_le_bytes(*bytes[..bytes.len() - 8].last_chunk().unwrap()) as usize;
    let frames = StreamIndex::load(&mut std::io::Cursor::new(&bytes)).unwrap().frames;
    for change in [0, 1] {
        let mut index = StreamIndex { frames: frames.clone() };
        match change {
            0 => drop(index.frames.remove(4)),
            _ => index.frames[1].keyframe = true,
        }
        let payload = index.to_payload();
        let header = PacketHeader::seal(PacketKind::Index, 0, 0, &payload);
        let end = StreamIndex::trailer(index_at as u64);
        work.write("false.isv", [&bytes[..index_at], &header, &payload, &end].concat());
        work.isv(&["verify", "false.isv"]).fails(1, &["its index does not say where its frames are"]);
    }
    work.isv(&["cut", "false.isv", "1..3", "-o", "cut.isv"])
        .fails(1, &["its index calls frame 1 a keyframe"]);
    work.isv(&["repair", "false.isv", "-o", "mended.isv"]).done();
    assert_eq!(work.read("mended.isv"), bytes);
}

/// Nothing is lost in silence: what is copied of a cut or lossy stream looks whole afterwards.
#[test]
fn copies_of_what_is_not_whole_say_so() {
    let (work, bytes) = Workspace::with_stream(FRAMES);
    work.write("cut.isv", &bytes[..packets(&work, "take.isv")[8].0 + 7]);
    let mut lossy = rearranged(&work, &bytes, &[0, 1, 2, 3, 5, 6, 7, 8]);
    // Its index was that of the whole one.
    let end = packets(&work, "take.isv")[8];
    lossy.truncate(lossy.len() - (bytes.len() - end.0 - end.1));
    work.write("lossy.isv", lossy);
    let says = |args: &[&str], part: &str| {
        let run = work.isv(args).done();
        assert_eq!(run.stderr().contains(part), !part.is_empty(), "{args:?}: {}", run.stderr());
    };
    says(&["cut", "cut.isv", "3..", "-o", "a.isv"], "what is before that was copied");
    says(
        &["join", "take.isv", "lossy.isv", "-o", "b.isv"],
        "lossy.isv: packets are missing or out of order at byte",
    );
    work.isv(&["join", "cut.isv", "take.isv", "-o", "c.isv"]).fails(1, &["cut.isv", "cut off"]);
    let run = work.isv(&["cut", "take.isv", "3..", "-o", "d.isv"]).done();
    assert_eq!(run.stderr(), "");
    // A packet that is there twice costs nothing.
    work.write("doubled.isv", rearranged(&work, &bytes, &[0, 1, 1, 2, 3, 4, 5, 6, 7, 8]));
    let run = work.isv(&["repair", "doubled.isv", "-o", "mended.isv"]).done();
    let said = String::from_utf8(run.stdout().to_vec()).unwrap();
    assert!(said.contains("9 frames kept, 1 frame left out that is there twice"), "{said}");
    assert_eq!(work.read("mended.isv"), bytes);
}

/// Damage behind the frames that are asked for is not in their way.
#[test]
fn frames_before_damage_can_be_asked_for_without_an_index() {
    let (work, mut bytes) = Workspace::with_stream(FRAMES);
    bytes.truncate(packets(&work, "take.isv")[8].0);
    bytes[packets(&work, "take.isv")[5].0 + 30] ^= 1;
    work.write("damaged.isv", &bytes);
    work.isv(&["verify", "damaged.isv"]).fails(1, &["--frames 0..5 decodes them"]);
    work.isv(&["decode", "damaged.isv", "-o", "meshes", "--frames", "0..5"]).done();
    assert_eq!(work.names("meshes").len(), 5);
    work.isv(&["decode", "damaged.isv", "-o", "meshes", "--frames", "0..6"])
        .fails(1, &["frames 0..6 asked for, but there are 5"]);
}

#[test]
fn a_part_of_a_take_has_lost_nothing_before_its_first_frame() {
    let work = Workspace::with_figure(9);
    let encode = ["encode", "frames", "-o", "part.isv", "--voxel", "30mm"];
    work.isv(&[&encode[..], &["--frames", "6..9", "--time-origin", "0"]].concat()).done();
    let held = work.isv(&["decode", "part.isv", "-o", "held", "--after-loss", "hold"]).done();
    assert!(!held.stderr().contains("lost"), "{}", held.stderr());
    work.isv(&["decode", "part.isv", "-o", "plain"]).done();
    for frame in 0..3 {
        let name = format!("frame_{frame:04}.ply");
        assert!(work.read(&format!("held/{name}")) == work.read(&format!("plain/{name}")));
    }
}
