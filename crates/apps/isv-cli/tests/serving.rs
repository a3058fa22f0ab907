//! Streams in a browser: files and live ones over HTTP, the player as files.

mod support;

use futures_util::StreamExt;
use isv::raw::format::{PacketReader, StreamHeader};
use isv_serve::{Page, message};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{SystemTime, UNIX_EPOCH};
use support::{ENCODE, Workspace};

/// A server that ends with its test.
struct Serving {
    child: Child,
    stdout: BufReader<std::process::ChildStdout>,
}

impl Serving {
    fn start(mut command: Command) -> Self {
        let mut child = command.spawn().unwrap();
        let stdout = BufReader::new(child.stdout.take().unwrap());
        Self { child, stdout }
    }

    /// The next line of output: an address and what follows it.
    fn url(&mut self) -> (SocketAddr, String) {
        let mut line = String::new();
        self.stdout.read_line(&mut line).unwrap();
        let (address, path) = line.trim_end().strip_prefix("http://").expect(&line).split_once('/').unwrap();
        (address.parse().unwrap(), format!("/{path}"))
    }

    /// Ends it as Ctrl-C does; it must end well and have said no more. Returns what it said on stderr.
    #[cfg(unix)]
    fn interrupt(mut self) -> String {
        let kill = Command::new("kill").args(["-INT", &self.child.id().to_string()]).status().unwrap();
        assert!(kill.success());
        let (mut rest, mut stderr) = (String::new(), String::new());
        self.stdout.read_to_string(&mut rest).unwrap();
        self.child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
        assert!(self.child.wait().unwrap().success(), "{stderr}");
        assert_eq!(rest, "");
        stderr
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The answer to a request, with its headers.
fn get(address: SocketAddr, path: &str, headers: &str) -> (String, Vec<u8>) {
    let mut socket = TcpStream::connect(address).unwrap();
    write!(socket, "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n{headers}\r\n").unwrap();
    let mut answer = Vec::new();
    socket.read_to_end(&mut answer).unwrap();
    let end = answer.windows(4).position(|bytes| bytes == b"\r\n\r\n").unwrap();
    (String::from_utf8(answer[..end].to_vec()).unwrap(), answer[end + 4..].to_vec())
}

#[cfg(unix)]
#[test]
fn view_serves_two_files_and_their_page_until_it_is_interrupted() {
    let (work, bytes) = Workspace::with_stream(3);
    std::fs::copy(work.path("take.isv"), work.path("other take.isv")).unwrap();
    let mut view = Serving::start(work.command(&["view", "take.isv", "other take.isv", "--no-open"]));
    let (address, path) = view.url();
    assert!(address.ip().is_loopback());
    assert_eq!(path, "/?src=/files/0/take.isv&compare=/files/1/other%2520take.isv");
    let (_, page) = get(address, &path, "");
    let index = Page::player().files().iter().find(|(path, _)| *path == "index.html").unwrap().1;
    assert_eq!(page, index);
    let (head, part) = get(address, "/files/1/other%20take.isv", "Range: bytes=100-199\r\n");
    assert!(head.starts_with("HTTP/1.1 206 "), "{head}");
    assert_eq!(part, bytes[100..200]);
    assert_eq!(view.interrupt(), "");
}

#[cfg(unix)]
#[test]
fn the_axis_and_the_memory_are_handed_to_the_page() {
    let (work, _) = Workspace::with_stream(1);
    let shown = ["--up", "-y", "--max-memory", "6GiB"];
    let query = "?src=/files/0/take.isv&up=-y&max-memory=6442450944";
    for begin in [&["view", "take.isv", "--no-open"][..], &["serve", "take.isv", "--bind", "127.0.0.1:0"]] {
        let mut server = Serving::start(work.command(&[begin, &shown].concat()));
        let (address, path) = server.url();
        assert_eq!(path, format!("/{query}"));
        let (head, _) = get(address, "/", "");
        assert!(head.starts_with("HTTP/1.1 307 ") && head.contains(&format!("location: {query}")), "{head}");
        server.interrupt();
    }
    work.isv(&[&["export-player", "site"][..], &shown].concat()).done();
    let start = String::from_utf8(work.read("site/start.js")).unwrap();
    assert!(start.contains("\"?up=-y&max-memory=6442450944\""), "{start}");
    work.isv(&["view", "take.isv", "--no-open", "--up", "w"]).fails(2, &["--up"]);
}

#[test]
fn standard_input_ends_a_live_stream_for_good() {
    let (work, bytes) = Workspace::with_stream(2);
    let serve = |more: &[&str]| {
        let args = [&["serve", "--live", "-", "--bind", "127.0.0.1:0"], more].concat();
        let mut command = work.command(&args);
        command.stdin(Stdio::piped());
        let mut serving = Serving::start(command);
        serving.url();
        serving.child.stdin.take().unwrap().write_all(&bytes).unwrap();
        serving
    };
    assert!(serve(&[]).child.wait().unwrap().success());
    // Files are there for as long as the user wants.
    let mut with_file = serve(&["take.isv"]);
    std::thread::sleep(std::time::Duration::from_millis(500));
    assert!(with_file.child.try_wait().unwrap().is_none());
}

#[test]
fn what_cannot_be_served_is_refused() {
    let (work, _) = Workspace::with_stream(1);
    work.write("text.isv", "a text");
    work.isv(&["view", "text.isv", "--no-open"]).fails(1, &["text.isv: ", "magic"]);
    work.isv(&["view", "take.isv", "missing.isv", "--no-open"]).fails(1, &["missing.isv: "]);
    work.isv(&["view", "-", "--no-open"]).fails(2, &["isv serve --live -"]);
    #[cfg(unix)]
    work.isv(&["serve", "/dev/null"]).fails(2, &["isv serve --live /dev/null"]);
    work.isv(&["view"]).fails(2, &["FILE.isv"]);
    work.isv(&["view", "take.isv", "take.isv", "take.isv"]).fails(2, &[]);
    work.isv(&["serve"]).fails(2, &[]);
    work.isv(&["serve", "take.isv", "--viewers", "3"]).fails(2, &["--live"]);
    work.isv(&["serve", "take.isv", "--allow-origin", "show.example"]).fails(2, &["https://show.example"]);
    work.isv(&["serve", "--live", "no/such/take.isv"]).fails(1, &["no/such/take.isv: "]);
    let holder = TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = holder.local_addr().unwrap();
    work.isv(&["serve", "take.isv", "--bind", &taken.to_string()]).fails(1, &[&taken.to_string(), "another"]);
}

#[cfg(unix)]
#[test]
fn serve_says_what_it_serves_and_who_can_watch() {
    let (work, bytes) = Workspace::with_stream(1);
    let args = ["serve", "take.isv", "take.isv", "--live", "growing.isv", "--bind", "0.0.0.0:0"];
    let mut serve = Serving::start(work.command(&args));
    let (address, first) = serve.url();
    assert!(address.ip().is_loopback(), "an address that a browser understands");
    assert_eq!(first, "/?src=/files/0/take.isv");
    assert_eq!(serve.url().1, "/?src=/files/1/take.isv");
    assert_eq!(serve.url().1, "/?live=/live");
    assert_eq!(get(address, "/files/1/take.isv", "").1, bytes);
    let stderr = serve.interrupt();
    let open = format!("anybody who reaches 0.0.0.0:{} can watch\n", address.port());
    assert_eq!(stderr, open + "growing.isv: not there yet: waiting for it\n");
}

/// It may become one: whoever writes the file may begin anew.
#[test]
fn a_live_file_that_is_no_stream_is_told_of() {
    let work = Workspace::new();
    work.write("text.isv", "a text");
    let args = ["serve", "--live", "text.isv", "--bind", "127.0.0.1:0"];
    let mut serve = Serving::start(work.command(&args));
    let mut said = String::new();
    BufReader::new(serve.child.stderr.as_mut().unwrap()).read_line(&mut said).unwrap();
    assert!(said.starts_with("text.isv: ") && said.contains("not an .isv stream"), "{said}");
}

#[test]
fn an_encoder_on_a_pipe_is_watched_as_it_runs() {
    let work = Workspace::with_figure(4);
    let encode = ["encode", "-", "-o", "-", "--voxel", "20mm", "--gop=3", "--timestamps", "clock"];
    let mut encoder = work.command(&encode).spawn().unwrap();
    let mut command = work.command(&["serve", "--live", "-", "--bind", "127.0.0.1:0"]);
    command.stdin(Stdio::from(encoder.stdout.take().unwrap()));
    let mut serve = Serving::start(command);
    let (address, path) = serve.url();
    assert_eq!(path, "/?live=/live");

    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let socket = tokio::net::TcpStream::connect(address).await.unwrap();
        let (mut socket, _) =
            tokio_tungstenite::client_async(format!("ws://{address}/live"), socket).await.unwrap();
        let mut next = async || loop {
            let received = socket.next().await.unwrap().unwrap();
            if received.is_binary() {
                return received.into_data();
            }
        };
        let (start, mut header) = (unix_ns(), None);
        let mut before = start;
        let mut stdin = encoder.stdin.take().unwrap();
        for frame in 0..4 {
            // Each of these would wait for ever if anything on the way waited for the frame after.
            stdin.write_all(&work.read(&format!("frames/frame_{frame}.ply"))).unwrap();
            if frame == 0 {
                let received = next().await;
                assert_eq!((received[0], received.len()), (message::HEADER, 49));
                header = Some(StreamHeader::parse(received[1..].try_into().unwrap()).unwrap());
            }
            let received = next().await;
            assert!(message::is_packet(&received));
            let packet =
                PacketReader::at_packet(&received[9..], 0, &header.unwrap()).next_packet().unwrap().unwrap();
            assert_eq!(packet.is_keyframe(), frame % 3 == 0);
            let stamp = packet.header.timestamp_ns;
            assert!(before < stamp && stamp <= unix_ns(), "{before} < {stamp}");
            before = stamp;
        }
        drop(stdin);
        assert_eq!(next().await[..], [message::END]);
        assert_eq!(next().await[..], [message::END, message::FOR_GOOD]);
    });
    assert!(encoder.wait().unwrap().success());
    assert!(serve.child.wait().unwrap().success(), "it ends with its input");
}

fn unix_ns() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64
}

#[test]
fn timestamps_by_the_clock_change_nothing_else() {
    let (work, _) = Workspace::with_stream(4);
    let mut by_clock = [&ENCODE[..], &["--timestamps", "clock"]].concat();
    by_clock[3] = "clock.isv";
    let before = unix_ns();
    work.isv(&by_clock).done();
    let info = |name| work.isv(&["info", name, "--json"]).json();
    let (mut rate, mut clock) = (info("take.isv"), info("clock.isv"));
    let stamps = |info: &mut Value| -> Vec<u64> {
        let packets = info["packets"].as_array_mut().unwrap().iter_mut();
        packets.map(|packet| packet["timestamp_ns"].take().as_u64().unwrap()).collect()
    };
    assert_eq!(stamps(&mut rate), [0, 33_333_333, 66_666_666, 100_000_000]);
    let stamps = stamps(&mut clock);
    assert!(stamps[0] >= before && stamps[3] <= unix_ns(), "{before}: {stamps:?}");
    assert!(stamps.is_sorted_by(|a, b| a < b), "{stamps:?}");
    for by_time in ["duration_s", "bitrate_mbps"] {
        assert!(rate[by_time].take() != clock[by_time].take());
    }
    assert_eq!(rate, clock, "frame rate, sizes and all");
    work.isv(&["verify", "clock.isv"]).done();
    for name in ["take", "clock"] {
        work.isv(&["decode", &format!("{name}.isv"), "-o", name]).done();
    }
    assert_eq!(work.read("take/frame_0003.ply"), work.read("clock/frame_0003.ply"));
    let eval = |name| work.isv(&["eval", "frames", name, "--json"]).json()["chamfer_mm"].clone();
    assert_eq!(eval("take.isv"), eval("clock.isv"));
}

#[test]
fn the_player_is_exported_with_streams_to_open() {
    let (work, bytes) = Workspace::with_stream(1);
    std::fs::copy(work.path("take.isv"), work.path("b c.isv")).unwrap();
    work.isv(&["export-player", "site"]).done();
    assert!(!work.path("site/start.js").exists());
    for (path, expected) in Page::player().files() {
        assert_eq!(work.read(&format!("site/{path}")), *expected, "{path}");
    }
    let done = work.isv(&["export-player", "site", "take.isv", "b c.isv"]).done();
    assert!(done.stderr().starts_with("site: "), "{}", done.stderr());
    assert_eq!(work.read("site/files/0/take.isv"), bytes);
    assert_eq!(work.read("site/files/1/b c.isv"), bytes);
    let start = String::from_utf8(work.read("site/start.js")).unwrap();
    assert!(start.contains("\"?src=files/0/take.isv&compare=files/1/b%2520c.isv\""), "{start}");
    let index = String::from_utf8(work.read("site/index.html")).unwrap();
    assert_eq!(index.matches("<script src=\"start.js\"></script>").count(), 1);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("site", work.path("link")).unwrap();
        work.isv(&["export-player", "link"]).done();
        assert!(work.path("link").is_symlink() && !work.path("site/start.js").exists());
    }
    work.isv(&["export-player", "frames"]).fails(1, &["frames: not empty, and no earlier export"]);
    work.isv(&["export-player", "other", "frames/frame_0.ply"]).fails(1, &["frame_0.ply: "]);
    assert!(!work.path("other").exists());
}
