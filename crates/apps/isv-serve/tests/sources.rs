//! Sources that end, start anew, are cut and damaged.

mod support;

use isv_mp4::{GeometrySink, Mp4File};
use isv_serve::{Feed, Hub, HubLimits, Source, Viewer, message};
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, SystemTime};
use support::{conformance, number_of, packet, stream, stream_header};

/// A source that feeds a hub, with a viewer who was there before it.
struct Fed {
    viewer: Viewer,
    notices: Receiver<String>,
    _feed: Feed,
}

impl Fed {
    fn new(source: Source) -> Self {
        let hub = Arc::new(Hub::new(HubLimits { lag: Duration::MAX, ..HubLimits::default() }));
        let viewer = hub.join();
        let (tell, notices) = channel();
        // The receiver goes with the test.
        let feed = source.feed(hub, move |notice| drop(tell.send(notice.to_owned())));
        Self { viewer, notices, _feed: feed }
    }

    async fn header(&mut self) {
        assert_eq!(self.viewer.next().await[..], [&[message::HEADER][..], &stream_header()].concat());
    }

    async fn end(&mut self) {
        assert_eq!(self.viewer.next().await[..], [message::END]);
    }

    /// The source has ended for good.
    async fn is_over(&mut self) {
        assert_eq!(self.viewer.next().await[..], [message::END, message::FOR_GOOD]);
        assert!(self.viewer.is_over());
    }

    async fn packets(&mut self, numbers: impl IntoIterator<Item = u64>) {
        for number in numbers {
            let found = self.viewer.next().await;
            let kind = if number.is_multiple_of(10) { message::ENTRY } else { message::PACKET };
            assert_eq!(found[0], kind, "packet {number} should have come");
            assert_eq!(number_of(&found[9..]), number);
        }
    }

    fn notice(&self, parts: &[&str]) {
        let notice = self.notices.try_recv().unwrap();
        for part in parts {
            assert!(notice.contains(part), "{part:?} is not in {notice:?}");
        }
        assert_eq!(notice.lines().count(), 1);
    }
}

/// A pipe within the process: what is sent is read in the same pieces.
struct Pieces {
    pieces: Receiver<Vec<u8>>,
    rest: Vec<u8>,
}

fn pipe() -> (Sender<Vec<u8>>, Source) {
    let (sender, pieces) = channel();
    (sender, Source::pipe("a pipe", Pieces { pieces, rest: Vec::new() }))
}

impl Read for Pieces {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.rest.is_empty() {
            let Ok(piece) = self.pieces.recv() else { return Ok(0) };
            self.rest = piece;
        }
        let count = buffer.len().min(self.rest.len());
        buffer[..count].copy_from_slice(&self.rest[..count]);
        self.rest.drain(..count);
        Ok(count)
    }
}

fn append(path: &Path, bytes: &[u8]) {
    OpenOptions::new().create(true).append(true).open(path).unwrap().write_all(bytes).unwrap();
}

/// The packets of a whole stream as its reader has them.
fn whole_stream() -> Vec<u8> {
    fs::read(conformance("main_inter.isv")).unwrap()
}

#[tokio::test]
async fn packets_leave_before_the_next_ones_come() {
    let (sender, source) = pipe();
    let mut fed = Fed::new(source);
    for byte in stream(0..1) {
        sender.send(vec![byte]).unwrap();
    }
    fed.header().await;
    fed.packets([0]).await;
    sender.send(packet(1, 50)).unwrap();
    fed.packets([1]).await;
    drop(sender);
    fed.end().await;
    fed.is_over().await;
    assert!(fed.notices.recv().is_err(), "nothing went wrong");
}

#[tokio::test]
async fn a_whole_stream_and_another_behind_it_on_one_pipe() {
    let (sender, source) = pipe();
    let mut fed = Fed::new(source);
    sender.send(whole_stream()).unwrap();
    fed.header().await;
    let mut frames = 0;
    while message::is_packet(&fed.viewer.next().await) {
        frames += 1;
    }
    assert!(frames > 2);
    sender.send(stream(0..3)).unwrap();
    fed.header().await;
    fed.packets(0..3).await;
}

#[tokio::test]
async fn a_damaged_packet_is_told_and_viewers_go_on_at_a_keyframe() {
    let (sender, source) = pipe();
    let mut fed = Fed::new(source);
    let mut bytes = stream(0..25);
    let place = 48 + 5 * (24 + 50) + 30;
    bytes[place] ^= 1;
    sender.send(bytes).unwrap();
    fed.header().await;
    fed.packets((0..5).chain(10..25)).await;
    fed.notice(&["a pipe: damaged", &format!("at byte {}", 48 + 5 * 74), "next keyframe"]);
    assert!(fed.notices.try_recv().is_err(), "one line for one packet");
}

#[tokio::test]
async fn a_writer_killed_inside_a_packet_and_started_again_on_one_pipe() {
    let (sender, source) = pipe();
    let mut fed = Fed::new(source);
    let bytes = stream(0..4);
    sender.send(bytes[..bytes.len() - 20].to_vec()).unwrap();
    fed.header().await;
    fed.packets(0..3).await;
    sender.send(stream(20..23)).unwrap();
    fed.header().await;
    fed.packets(20..23).await;
    fed.notice(&["damaged"]);
}

#[tokio::test]
async fn a_pipe_cut_inside_a_packet() {
    let (sender, source) = pipe();
    let mut fed = Fed::new(source);
    sender.send(stream(0..2)).unwrap();
    sender.send(packet(2, 50)[..40].to_vec()).unwrap();
    drop(sender);
    fed.header().await;
    fed.packets(0..2).await;
    fed.end().await;
    fed.notice(&["cut off at byte 236, inside a packet"]);
}

#[tokio::test]
async fn what_is_no_stream_is_told_once() {
    let (sender, source) = pipe();
    let mut fed = Fed::new(source);
    sender.send(vec![7; 1 << 20]).unwrap();
    sender.send(stream(0..2)).unwrap();
    fed.header().await;
    fed.packets(0..2).await;
    fed.notice(&["not an .isv stream"]);
    assert!(fed.notices.try_recv().is_err());
}

#[cfg(unix)]
#[tokio::test]
async fn a_fifo_is_opened_again_for_the_next_writer() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("live");
    assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
    let mut fed = Fed::new(Source::open(&path).unwrap());
    for first in [0, 10, 20] {
        let mut writer = OpenOptions::new().write(true).open(&path).unwrap();
        writer.write_all(&stream(first..first + 3)).unwrap();
        fed.header().await;
        fed.packets(first..first + 3).await;
        drop(writer);
        fed.end().await;
    }
}

#[tokio::test]
async fn a_file_grows_in_pieces_smaller_than_a_header() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("take.isv");
    let mut fed = Fed::new(Source::open(&path).unwrap());
    fed.notice(&["take.isv: not there yet"]);
    for piece in stream(0..2).chunks(13) {
        append(&path, piece);
    }
    fed.header().await;
    fed.packets(0..2).await;
    for piece in packet(2, 50).chunks(5) {
        append(&path, piece);
    }
    fed.packets([2]).await;
    assert!(fed.notices.try_recv().is_err());
}

#[tokio::test]
async fn a_file_begun_before_is_joined_at_its_last_keyframe() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("take.isv");
    let bytes = stream(0..38);
    fs::write(&path, &bytes[..bytes.len() - 10]).unwrap();
    let mut fed = Fed::new(Source::open(&path).unwrap());
    fed.header().await;
    fed.packets(30..37).await;
    append(&path, &bytes[bytes.len() - 10..]);
    fed.packets([37]).await;
    let mut damaged = packet(38, 50);
    damaged[30] ^= 1;
    append(&path, &damaged);
    append(&path, &packet(39, 50));
    append(&path, &packet(40, 50));
    fed.packets([40]).await;
    fed.notice(&["take.isv: damaged", &format!("at byte {}", 48 + 38 * 74)]);
}

#[tokio::test]
async fn an_mp4_file_that_grows_is_joined_at_its_last_keyframe() {
    let mut sink = GeometrySink::new(Vec::new(), Vec::new()).unwrap();
    sink.write_all(&stream(0..38)).unwrap();
    let file = sink.finish().unwrap();
    let read = Mp4File::open(io::Cursor::new(&file)).unwrap();
    let last = read.tracks()[0].samples[29];
    let begun = last.at as usize + last.bytes as usize + 20;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("take.mp4");
    fs::write(&path, &file[..begun]).unwrap();
    let mut fed = Fed::new(Source::open(&path).unwrap());
    fed.header().await;
    fed.packets(20..30).await;
    for piece in file[begun..].chunks(77) {
        append(&path, piece);
    }
    fed.packets(30..38).await;
    fed.end().await;
}

#[tokio::test]
async fn a_file_begun_anew_starts_anew() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("take.isv");
    fs::write(&path, stream(0..5)).unwrap();
    let mut fed = Fed::new(Source::open(&path).unwrap());
    fed.header().await;
    fed.packets(0..5).await;
    // As a shell does: the same file, emptied.
    File::create(&path).unwrap();
    fed.end().await;
    append(&path, &stream(10..12));
    fed.header().await;
    fed.packets(10..12).await;
    // As an editor does: another file of that name.
    let other = folder.path().join("other");
    fs::write(&other, stream(20..30)).unwrap();
    fs::rename(other, &path).unwrap();
    fed.end().await;
    fed.header().await;
    fed.packets(20..30).await;
}

#[tokio::test]
async fn a_file_that_is_over_is_not_read_twice() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("take.isv");
    fs::write(&path, whole_stream()).unwrap();
    let mut fed = Fed::new(Source::open(&path).unwrap());
    fed.header().await;
    while message::is_packet(&fed.viewer.next().await) {}
    fs::write(&path, stream(0..2)).unwrap();
    fed.header().await;
    fed.packets(0..2).await;
}

#[tokio::test]
async fn the_newest_file_of_a_folder_is_live() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8], seconds_ago: u64| {
        let path = folder.path().join(name);
        append(&path, bytes);
        let time = SystemTime::now() - Duration::from_secs(seconds_ago);
        File::options().append(true).open(path).unwrap().set_modified(time).unwrap();
    };
    let mut fed = Fed::new(Source::open(folder.path()).unwrap());
    fed.notice(&["no .isv file is in it yet"]);
    write("b.isv", &stream(0..5), 100);
    fed.header().await;
    fed.packets(0..5).await;
    write("c.txt", b"no stream", 0);
    write(".d.isv", b"not yet", 0);
    write("a.isv", &stream(10..12), 50);
    fed.end().await;
    fed.header().await;
    fed.packets(10..12).await;
    write("a.isv", &packet(12, 50), 50);
    fed.packets([12]).await;
    assert!(fed.notices.try_recv().is_err());
}

#[tokio::test]
async fn a_folder_that_is_gone_for_a_while_is_read_again() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("takes");
    std::fs::create_dir(&folder).unwrap();
    let mut fed = Fed::new(Source::open(&folder).unwrap());
    fed.notice(&["no .isv file is in it yet"]);
    std::fs::remove_dir(&folder).unwrap();
    let notice = fed.notices.recv_timeout(Duration::from_secs(60)).unwrap();
    assert!(notice.contains("takes: ") && notice.ends_with("tried again until it can be read"), "{notice}");
    std::fs::create_dir(&folder).unwrap();
    append(&folder.join("a.isv"), &stream(0..3));
    fed.header().await;
    fed.packets(0..3).await;
    assert!(fed.notices.try_recv().is_err());
}

#[test]
fn what_cannot_come_is_refused() {
    assert!(Source::open(Path::new("no/such/folder/take.isv")).is_err());
    assert!(Source::open(Path::new("not-there-yet.isv")).is_ok());
}

/// Opens a pipe by a path that nobody else can open, as `<(command)` of a shell and `/dev/stdin` are.
#[cfg(target_os = "linux")]
#[tokio::test]
async fn a_pipe_without_a_name_ends_for_good() {
    use std::os::fd::AsRawFd;
    let (reader, mut writer) = std::io::pipe().unwrap();
    let path = format!("/proc/self/fd/{}", reader.as_raw_fd());
    let mut fed = Fed::new(Source::open(Path::new(&path)).unwrap());
    writer.write_all(&stream(0..2)).unwrap();
    fed.header().await;
    fed.packets(0..2).await;
    drop(writer);
    fed.end().await;
    fed.is_over().await;
}
