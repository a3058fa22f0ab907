//! Fuzz targets hold for what campaigns kept, for what once crashed them, and for some changes of it.
//! A fuzzer looks at what an input reaches and finds more (`fuzz/run`). But its programs take a build of their own.

use isv::raw::volume::SplitMix64;
use isv_hostile::{TARGETS, Target};
use isv_testkit::{Need, skip};
use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::time::{SystemTime, UNIX_EPOCH};
use std::{env, fs, thread};

/// One of so many inputs of a target is tried, another one each time, beside the seeds and what once crashed it.
const SHARE: u64 = 16;
/// Changed inputs that are tried for each one, and of a target that has few inputs so many in all.
const CHANGED: usize = 2;
const LEAST: usize = 200;
/// Most memory of all inputs that are read, and of each one that is tried.
const MOST_MEMORY: usize = 512 << 20;
/// Most bytes that are added to an input.
const GROWTH: usize = 256;

/// Inputs by target.
type Inputs = BTreeMap<String, Vec<Vec<u8>>>;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("fuzz")
}

/// The files of a folder that has a folder for each target.
fn read_inputs(folder: &Path, into: &mut Inputs) {
    for target in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let inputs = into.entry(target.file_name().into_string().unwrap()).or_default();
        inputs
            .extend(fs::read_dir(target.path()).unwrap().map(|file| fs::read(file.unwrap().path()).unwrap()));
    }
}

/// Adds some of what campaigns kept; says whether it can be unpacked here.
fn read_corpus(random: &mut SplitMix64, into: &mut Inputs) -> bool {
    let mut unpack = Command::new("xz");
    unpack.arg("-dc").arg(folder().join("corpus.tar.xz")).stdout(Stdio::piped());
    let Ok(mut unpack) = unpack.spawn() else { return false };
    let mut archive = tar::Archive::new(unpack.stdout.take().unwrap());
    for entry in archive.entries().unwrap() {
        let mut entry = entry.unwrap();
        if !entry.header().entry_type().is_file() || !random.next_u64().is_multiple_of(SHARE) {
            continue;
        }
        let path = entry.path().unwrap().into_owned();
        let target = path.components().rev().nth(1).unwrap().as_os_str().to_str().unwrap().to_owned();
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).unwrap();
        into.entry(target).or_default().push(bytes);
    }
    assert!(unpack.wait().unwrap().success());
    true
}

/// Changes bytes at a few places, as libFuzzer does: a bit, a byte, or a digit. Some bytes are left out, put in, or copied from elsewhere.
fn change(random: &mut SplitMix64, bytes: &[u8], most: usize) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..1 + random.next_u64() % 4 {
        let mut below = |end: usize| (random.next_u64() % end.max(1) as u64) as usize;
        let (at, from) = (below(bytes.len()), below(bytes.len()));
        let (count, value) = (1 + below(16), below(256) as u8);
        match (below(7), bytes.get_mut(at)) {
            (0, Some(byte)) => *byte ^= 1 << (value % 8),
            (1, Some(byte)) => *byte = value,
            (2, Some(byte)) => *byte = [0, 1, 0x7f, 0x80, 0xff][usize::from(value) % 5],
            (3, _) => {
                if let Some(digit) = bytes.iter_mut().skip(at).find(|byte| byte.is_ascii_digit()) {
                    *digit = b'0' + value % 10;
                }
            }
            (4, Some(_)) => drop(bytes.drain(at..bytes.len().min(at + count))),
            (5, Some(_)) => {
                let copied = bytes[from..bytes.len().min(from + count)].to_vec();
                bytes.splice(at..at, copied);
            }
            _ => drop(bytes.splice(at..at, std::iter::repeat_n(value, count))),
        }
    }
    bytes.truncate(most);
    bytes
}

/// Tries an input. One that breaks something is kept.
fn try_input(target: &Target, bytes: &[u8]) -> Result<(), String> {
    catch_unwind(AssertUnwindSafe(|| (target.run)(bytes))).map_err(|_| {
        let path = folder().join("artifacts").join(target.name).join(format!("replayed-{}", bytes.len()));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, bytes).unwrap();
        format!("{} breaks on {}", target.name, path.display())
    })
}

/// Tries inputs, each as it is and changed; how many.
fn try_inputs(target: &Target, inputs: &[Vec<u8>], random: &mut SplitMix64) -> Result<usize, String> {
    let changed = CHANGED.max(LEAST / inputs.len().max(1));
    for bytes in inputs {
        try_input(target, bytes)?;
        for _ in 0..changed {
            let seed = random.next_u64() as u32;
            let mut change = |bytes: &[u8], most| change(random, bytes, most);
            try_input(target, &target.mutate(bytes, bytes.len() + GROWTH, seed, &mut change))?;
        }
    }
    Ok(inputs.len() * (1 + changed))
}

#[test]
fn what_was_kept_breaks_no_target_and_nor_do_changes_of_it() {
    let seed = match env::var("ISV_FUZZ_SEED") {
        Ok(seed) => seed.parse().expect("a number"),
        Err(_) => SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64,
    };
    let mut random = SplitMix64::new(seed);
    let mut inputs = Inputs::new();
    if !read_corpus(&mut random, &mut inputs) {
        skip(Need::Xz, "xz, which unpacks what campaigns kept, is missing");
    }
    let streams = inputs.get("stream").cloned().unwrap_or_default();
    for like_stream in ["packet", "syntax"] {
        inputs.entry(like_stream.to_owned()).or_default().extend(streams.iter().cloned());
    }
    let seeds = tempfile::tempdir().unwrap();
    let mut make_seeds = Command::new(env!("CARGO_BIN_EXE_xtask"));
    assert!(make_seeds.arg("fuzz-seeds").arg(seeds.path()).status().unwrap().success());
    for folder in [seeds.path(), &folder().join("regressions")] {
        read_inputs(folder, &mut inputs);
    }
    let waiting = Mutex::new(TARGETS.iter());
    let results = Mutex::new(Vec::new());
    let work = || {
        while let Some(target) = { waiting.lock().unwrap().next() } {
            let inputs = inputs.get(target.name).map(Vec::as_slice).unwrap_or_default();
            let mut random = SplitMix64::new(seed);
            // Of its own: readers keep a folder of files for each thread.
            let result =
                thread::scope(|scope| scope.spawn(|| try_inputs(target, inputs, &mut random)).join());
            results.lock().unwrap().push((target.name, result.unwrap()));
        }
    };
    let processors = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| (0..processors).for_each(|_| drop(scope.spawn(work))));
    let results = results.into_inner().unwrap();
    for (name, result) in &results {
        println!("{name}: {result:?}");
    }
    let broken: Vec<&String> = results.iter().filter_map(|(_, result)| result.as_ref().err()).collect();
    assert!(broken.is_empty(), "{broken:?}; ISV_FUZZ_SEED={seed} does it again");
    assert!(results.iter().all(|(_, result)| *result >= Ok(LEAST)), "{results:?}");
    match most_memory() {
        Some(bytes) => {
            let most = (1 + processors) * MOST_MEMORY;
            assert!(bytes < most, "{bytes} bytes of {most}; ISV_FUZZ_SEED={seed} does it again");
        }
        None => skip(Need::MemoryUse, "this system does not say how much memory a process has taken"),
    }
}

/// The most memory that this process has taken, in bytes, where the system says so.
fn most_memory() -> Option<usize> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix(" kB")?.parse::<usize>().ok()? << 10)
}

#[test]
fn libfuzzer_has_a_program_for_each_target() {
    let manifest = fs::read_to_string(folder().join("Cargo.toml")).unwrap();
    let programs = manifest.split("[[bin]]\nname = \"").skip(1).map(|bin| bin.split('"').next().unwrap());
    let programs: BTreeSet<&str> = programs.collect();
    assert_eq!(programs, TARGETS.iter().map(|target| target.name).collect());
    for program in programs {
        let source = fs::read_to_string(folder().join(format!("fuzz_targets/{program}.rs"))).unwrap();
        assert!(source.ends_with(&format!("\nisv_fuzz::run!(\"{program}\");\n")), "{source}");
    }
}
