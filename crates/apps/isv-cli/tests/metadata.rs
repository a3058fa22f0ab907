//! What a stream says of itself: written by encode, shown by info, kept by copies, followed by decode.

mod support;

use serde_json::{Value, json};
use support::{ENCODE, Workspace};

fn info(work: &Workspace, file: &str) -> Value {
    work.isv(&["info", file, "--json"]).json()
}

fn encode(work: &Workspace, output: &str, more: &[&str]) {
    let mut words: Vec<&str> = ENCODE.to_vec();
    let place = words.iter().position(|word| *word == "take.isv").unwrap();
    words[place] = output;
    words.extend(more);
    work.isv(&words).done();
}

#[test]
fn a_stream_says_what_it_is() {
    let work = Workspace::with_figure(6);
    encode(&work, "plain.isv", &[]);
    encode(&work, "take.isv", &["--title", "A walk", "--capture-device", "12 cameras", "--up", "y"]);
    let (plain, take) = (info(&work, "plain.isv"), info(&work, "take.isv"));
    assert_eq!((&plain["format_version"], &plain["metadata"]), (&json!(2), &Value::Null));
    assert_eq!(take["format_version"], 2);
    let said = &take["metadata"];
    assert_eq!((&said["title"], &said["device"]), (&json!("A walk"), &json!("12 cameras")));
    assert_eq!(
        (&said["unit"], &said["up"], &said["source"]["unit"]),
        (&json!("m"), &json!("y"), &json!("m"))
    );
    assert_eq!(said["surface"]["sign"], "closed");
    assert!(said["encoder"].as_str().unwrap().starts_with("isv "));
    assert_eq!((&said["settings"]["profile"], &said["settings"]["gop"]), (&json!("main"), &json!(3)));
    let shown = work.isv(&["info", "take.isv"]).done();
    let shown = str::from_utf8(shown.stdout()).unwrap();
    for words in ["A walk", "12 cameras", "m, y up", "closed", "preset"] {
        assert!(shown.contains(words), "{words}: {shown}");
    }
}

#[test]
fn frames_are_the_same_with_and_without() {
    let work = Workspace::with_figure(6);
    encode(&work, "plain.isv", &[]);
    encode(&work, "take.isv", &["--metadata", "always"]);
    for file in ["plain", "take"] {
        work.isv(&["decode", &format!("{file}.isv"), "-o", file, "--frames", "4..5"]).done();
    }
    assert!(work.read("plain/frame_0004.ply") == work.read("take/frame_0004.ply"));
    let packets = |file: &str| info(&work, file)["packets"].clone();
    assert_eq!(packets("plain.isv"), packets("take.isv"));
}

#[test]
fn a_stream_with_colour_says_so_unless_it_must_not() {
    let work = Workspace::with_painted_balls(2);
    let voxel = ["--voxel", "20mm"];
    work.isv(&[&["encode", "balls", "-o", "a.isv"], &voxel[..]].concat()).done();
    work.isv(&[&["encode", "balls", "-o", "b.isv", "--metadata", "never"], &voxel[..]].concat()).done();
    assert_eq!(info(&work, "a.isv")["metadata"]["colour_space"], "sRGB");
    assert_eq!(info(&work, "b.isv")["metadata"], Value::Null);
}

#[test]
fn copies_keep_it() {
    let work = Workspace::with_figure(6);
    encode(&work, "take.isv", &["--title", "A walk"]);
    work.isv(&["cut", "take.isv", "3..6", "-o", "b.isv"]).done();
    work.isv(&["cut", "take.isv", "0..3", "-o", "a.isv"]).done();
    work.isv(&["join", "a.isv", "b.isv", "-o", "ab.isv"]).done();
    work.isv(&["mux", "take.isv", "-o", "take.mp4"]).done();
    work.isv(&["demux", "take.mp4", "-o", "back.isv"]).done();
    assert!(work.read("back.isv") == work.read("take.isv"));
    assert!(work.read("ab.isv") == work.read("take.isv"), "the parts joined are the whole");
    let mut damaged = work.read("take.isv");
    let last = damaged.len() - 200;
    damaged[last] ^= 1;
    work.write("damaged.isv", damaged);
    work.isv(&["repair", "damaged.isv", "-o", "repaired.isv"]).done();
    work.isv(&["encode", "take.isv", "-o", "again.isv", "--quality", "30"]).done();
    for file in ["a.isv", "b.isv", "take.mp4", "repaired.isv", "again.isv"] {
        assert_eq!(info(&work, file)["metadata"]["title"], "A walk", "{file}");
    }
    encode(&work, "other.isv", &["--title", "A run"]);
    work.isv(&["join", "take.isv", "other.isv", "-o", "both.isv"]).done();
    assert_eq!(info(&work, "both.isv")["metadata"], Value::Null, "two takes have no title");
}

#[test]
fn volumes_keep_their_axes_and_decoding_turns_them() {
    let work = Workspace::with_figure(3);
    encode(&work, "y.isv", &[]);
    work.isv(&["decode", "y.isv", "-o", "fields", "--as", "volume", "--frames", "0..1"]).done();
    work.isv(&["encode", "fields", "-o", "z.isv", "--up", "z", "--metadata", "always"]).done();
    assert_eq!(info(&work, "z.isv")["metadata"]["up"], "z");
    let extent = |up: &str| {
        let obj = format!("{}.obj", up.trim_start_matches('-'));
        work.isv(&["decode", "z.isv", "-o", &obj, &format!("--up={up}")]).done();
        let text = String::from_utf8(work.read(&obj)).unwrap();
        let mut extent = [(f64::MAX, f64::MIN); 3];
        for line in text.lines().filter_map(|line| line.strip_prefix("v ")) {
            for ((low, high), number) in extent.iter_mut().zip(line.split(' ')) {
                let value: f64 = number.parse().unwrap();
                (*low, *high) = (low.min(value), high.max(value));
            }
        }
        extent.map(|(low, high)| high - low)
    };
    // The stream's Z is the output's Y, unless the output is Z up, too.
    let (y_up, z_up) = (extent("y"), extent("z"));
    assert!((y_up[1] - z_up[2]).abs() < 1e-4 && (y_up[2] - z_up[1]).abs() < 1e-4, "{y_up:?} {z_up:?}");
    assert!((z_up[1] - z_up[2]).abs() > 0.1, "the axes differ in what they hold: {z_up:?}");
}
