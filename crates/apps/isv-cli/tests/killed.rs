//! An encoder that is killed leaves a file that opens: what was written of it, under the name with `.part`.
#![cfg(unix)]

mod support;

use isv::raw::format::StreamHeader;
use isv_testkit::Random;
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::process::Child;
use std::time::{Duration, Instant};
use support::{ENCODE, Workspace};

const FRAMES: usize = 24;
const SIGKILL: i32 = 9;

/// How long an encoder takes that is left alone.
fn time_to_encode(work: &Workspace) -> Duration {
    let started = Instant::now();
    work.isv(&ENCODE).done();
    started.elapsed()
}

/// An encoder that writes `take.isv`, killed after a while; whether it had not ended before.
fn killed_after(work: &Workspace, time: Duration) -> bool {
    let mut encoder: Child = work.command(&ENCODE).spawn().unwrap();
    std::thread::sleep(time);
    encoder.kill().unwrap();
    let status = encoder.wait().unwrap();
    assert!(status.success() || status.signal() == Some(SIGKILL), "{status}");
    !status.success()
}

/// The whole frames of what is left of a stream, each of which decodes to the hash that it states.
fn sound_frames(work: &Workspace, whole: &[u8]) -> usize {
    let part = work.read("take.isv.part");
    assert!(whole.starts_with(&part), "the same bytes as those of an encoder that is left alone");
    let info = work.isv(&["info", "take.isv.part", "--json"]).json();
    let frames = info["frames"].as_u64().unwrap() as usize;
    assert!(frames <= FRAMES);
    let verify = work.isv(&["verify", "take.isv.part"]);
    match info["complete"].as_bool().unwrap() {
        // Killed between the index and the new name.
        true => drop(verify.done()),
        false if frames == 0 => verify.fails(1, &["take.isv.part: "]),
        false if frames == 1 => verify.fails(1, &["the frame before is sound"]),
        false => verify.fails(1, &[&format!("the {frames} frames before are sound")]),
    }
    if frames > 0 {
        let range = format!("0..{frames}");
        work.isv(&["decode", "take.isv.part", "-o", "decoded", "--frames", &range]).done();
        assert_eq!(work.names("decoded").len(), frames);
        fs::remove_dir_all(work.path("decoded")).unwrap();
    }
    frames
}

#[test]
fn at_fifty_moments() {
    let work = Workspace::with_figure(FRAMES);
    let time = time_to_encode(&work);
    let whole = work.read("take.isv");
    let mut random = Random::new(50);
    let (mut nothing, mut finished, mut found) = (0, 0, Vec::new());
    for _ in 0..50 {
        fs::remove_file(work.path("take.isv")).ok();
        let killed = killed_after(&work, time.mul_f64(0.5 + 0.5 * random.signed()));
        match work.path("take.isv.part").exists() {
            true => {
                assert!(killed && !work.path("take.isv").exists());
                // Else it was killed before the header was whole.
                if work.read("take.isv.part").len() >= StreamHeader::BYTES {
                    found.push(sound_frames(&work, &whole));
                }
                fs::remove_file(work.path("take.isv.part")).unwrap();
            }
            // Under the final name there is a whole stream or none.
            false if work.path("take.isv").exists() => {
                assert!(work.read("take.isv") == whole);
                finished += 1;
            }
            false => nothing += 1,
        }
    }
    println!(
        "{nothing} killed before the file was there, {finished} when it was whole, in between with these frames: {found:?}"
    );
    assert!(found.len() >= 10 && found.iter().any(|frames| *frames >= 2), "{found:?}");
}

/// What a killed encoder left is not overwritten by the next.
#[test]
fn what_is_left_stays() {
    let work = Workspace::with_figure(2);
    work.write("take.isv.part", "left");
    work.isv(&ENCODE).done();
    assert_eq!(work.names(""), ["frames", "take.isv", "take.isv.part"]);
    assert_eq!(work.read("take.isv.part"), b"left");
}
