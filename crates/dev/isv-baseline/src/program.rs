//! Running someone else's program: its time, its memory, and what it had to say if it failed.

use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};
use thiserror::Error;

/// How often a running program is looked at, at first and at most; its time is known this well. Between the two a look
/// comes after a twentieth of the time that it has run. So short programs are seen as well as long ones.
const POLL: [Duration; 2] = [Duration::from_micros(50), Duration::from_micros(500)];

/// A peak of less is that of the child before it became the program.
const LEAST_PEAK: u64 = 1 << 18;

/// Most bytes of a failed program's words that are kept.
const MOST_WORDS: u64 = 2000;

/// What came of running a program.
#[derive(Clone, Debug, PartialEq)]
pub struct ProgramRun<T> {
    /// What it made.
    pub output: T,
    /// Wall time from start to end in milliseconds: all of the program, its reading and writing of files included.
    pub ms: f64,
    /// Most memory that it had at a time, in bytes. It is `None` where the system does not say (only Linux does), and for
    /// programs that end before they are looked at.
    pub peak_memory_bytes: Option<u64>,
}

/// A program that did not do its work.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ProgramError {
    /// It cannot be started or watched.
    #[error("cannot run {}: {source}", program.display())]
    Run {
        /// The program.
        program: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// It ended with an error.
    #[error("{} failed ({status}): {words}", program.display())]
    Failed {
        /// The program.
        program: PathBuf,
        /// How it ended.
        status: ExitStatus,
        /// What it wrote to its outputs, on one line; of more than 2000 bytes the first and the last 1000.
        words: String,
    },
    /// It ended well, but without the file that it was to write, or with one beyond all reason.
    #[error("{} wrote no file of up to {limit} bytes", program.display())]
    Output {
        /// The program.
        program: PathBuf,
        /// Most bytes that are read.
        limit: u64,
    },
    /// It took too long and was ended.
    #[error("{} was ended as it took more than {limit_s} s", program.display())]
    TooLong {
        /// The program.
        program: PathBuf,
        /// The limit in seconds.
        limit_s: f64,
    },
}

/// Path of an executable file of this name in the folders of `PATH`.
pub(crate) fn find_program(name: &str) -> Option<PathBuf> {
    let file = format!("{name}{}", std::env::consts::EXE_SUFFIX);
    std::env::split_paths(&std::env::var_os("PATH")?)
        .map(|folder| folder.join(&file))
        .find(|path| is_executable(path))
}

#[cfg(unix)]
pub(crate) fn is_executable(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    std::fs::metadata(path).is_ok_and(|data| data.is_file() && data.permissions().mode() & 0o111 != 0)
}

#[cfg(not(unix))]
pub(crate) fn is_executable(path: &Path) -> bool {
    path.is_file()
}

/// Runs a program to its end, or ends it at the limit. What it says goes to the file `log`, which is made anew: a file,
/// unlike a pipe, never fills up.
pub(crate) fn run(
    program: &Path,
    arguments: &[&OsStr],
    log: &Path,
    limit: Duration,
) -> Result<ProgramRun<()>, ProgramError> {
    let mut command = Command::new(program);
    command.args(arguments);
    run_command(program, command, log, limit)
}

/// Runs a program as [`run`] does, in a folder: its arguments may name files there. The program's own path is absolute.
pub(crate) fn run_in(
    folder: &Path,
    program: &Path,
    arguments: &[String],
    limit: Duration,
) -> Result<ProgramRun<()>, ProgramError> {
    let mut command = Command::new(program);
    command.args(arguments).current_dir(folder);
    run_command(program, command, &folder.join(LOG), limit)
}

/// What a program says when it is run with some arguments, however it ends.
pub(crate) fn words_of(
    program: &Path,
    arguments: &[String],
    limit: Duration,
) -> Result<String, ProgramError> {
    let failed_to_run = |source| ProgramError::Run { program: program.into(), source };
    let folder = tempfile::tempdir().map_err(failed_to_run)?;
    match run_in(folder.path(), program, arguments, limit) {
        Ok(_) | Err(ProgramError::Failed { .. }) => Ok(read_words(&folder.path().join(LOG))),
        Err(error) => Err(error),
    }
}

/// Name of the file that gets what a program says, in the folder that it runs in.
const LOG: &str = "isv-log";

fn run_command(
    program: &Path,
    mut command: Command,
    log: &Path,
    limit: Duration,
) -> Result<ProgramRun<()>, ProgramError> {
    let failed_to_run = |source| ProgramError::Run { program: program.into(), source };
    let words = File::create(log).map_err(failed_to_run)?;
    let errors = words.try_clone().map_err(failed_to_run)?;
    let start = Instant::now();
    command.stdin(Stdio::null()).stdout(words).stderr(errors);
    let mut running = Running(command.spawn().map_err(failed_to_run)?);
    let mut peak_memory_bytes = None;
    loop {
        if let Some(status) = running.0.try_wait().map_err(failed_to_run)? {
            let ms = start.elapsed().as_secs_f64() * 1e3;
            if !status.success() {
                return Err(ProgramError::Failed { program: program.into(), status, words: read_words(log) });
            }
            let peak_memory_bytes = peak_memory_bytes.filter(|peak| *peak >= LEAST_PEAK);
            return Ok(ProgramRun { output: (), ms, peak_memory_bytes });
        }
        let elapsed = start.elapsed();
        if elapsed > limit {
            return Err(ProgramError::TooLong { program: program.into(), limit_s: limit.as_secs_f64() });
        }
        peak_memory_bytes = peak_memory_bytes.max(peak_memory(running.0.id()));
        std::thread::sleep((elapsed / 20).clamp(POLL[0], POLL[1]));
    }
}

/// Largest file of a program that is read.
const OUTPUT_LIMIT: u64 = 4 << 30;

/// The file that a program was to write is there and of a size that can be read.
pub(crate) fn check_output(program: &Path, output: &Path) -> Result<(), ProgramError> {
    let readable = std::fs::metadata(output).is_ok_and(|data| data.is_file() && data.len() <= OUTPUT_LIMIT);
    let failure = || ProgramError::Output { program: program.into(), limit: OUTPUT_LIMIT };
    readable.then_some(()).ok_or_else(failure)
}

/// A child that does not outlive whoever watches it.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // Both fail if it has ended and been waited for, which is what is wanted.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Largest resident set of a process so far. The figure of `wait4` would be the parent's wherever that is larger. A
/// fork begins with the parent's pages, and its maximum survives the exec.
fn peak_memory(process: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}

/// The beginning of a log, on one line; of a long one its beginning and its end, where programs say why they failed.
fn read_words(log: &Path) -> String {
    let mut bytes = Vec::new();
    if let Ok(mut file) = File::open(log) {
        let length = file.metadata().map_or(0, |data| data.len());
        let _ = (&mut file).take(MOST_WORDS / 2).read_to_end(&mut bytes);
        if length > MOST_WORDS && file.seek(SeekFrom::End(-(MOST_WORDS as i64) / 2)).is_ok() {
            bytes.extend_from_slice(b" ... ");
        }
        let _ = file.take(MOST_WORDS / 2).read_to_end(&mut bytes);
    }
    let words = String::from_utf8_lossy(&bytes).split_whitespace().collect::<Vec<_>>().join(" ");
    if words.is_empty() { "it says nothing".into() } else { words }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn shell(script: &str, limit: Duration) -> Result<ProgramRun<()>, ProgramError> {
        let folder = tempfile::tempdir().unwrap();
        let shell = find_program("sh").expect("a shell");
        run(&shell, &["-c".as_ref(), script.as_ref()], &folder.path().join("log"), limit)
    }

    #[test]
    fn a_failure_is_told_in_the_programs_own_words() {
        let error = shell("echo no such; echo mesh >&2; exit 3", Duration::from_secs(600)).unwrap_err();
        let ProgramError::Failed { status, words, .. } = error else { panic!("{error}") };
        assert_eq!((status.code(), words.as_str()), (Some(3), "no such mesh"));
    }

    #[test]
    fn a_program_that_hangs_is_ended() {
        let error = shell("exec sleep 600", Duration::from_millis(20)).unwrap_err();
        assert!(matches!(error, ProgramError::TooLong { .. }), "{error}");
    }

    #[test]
    fn time_is_that_of_the_program() {
        let run = shell("sleep 0.1", Duration::from_secs(600)).unwrap();
        assert!(run.ms >= 100.0, "{} ms", run.ms);
    }

    #[test]
    fn what_is_not_there_cannot_be_run() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("missing");
        let error = run(&missing, &[], &folder.path().join("log"), Duration::MAX).unwrap_err();
        assert!(error.to_string().contains("missing"), "{error}");
        assert_eq!(find_program("a program of no such name"), None);
    }

    /// A parent of 200 MB and a child of a few: the figure is the child's.
    #[test]
    #[cfg(target_os = "linux")]
    fn memory_is_that_of_the_program() {
        let ours = vec![1u8; 200 << 20];
        let run = shell("sleep 0.1", Duration::from_secs(600)).unwrap();
        assert_eq!(ours.iter().map(|b| usize::from(*b)).sum::<usize>(), ours.len());
        let peak = run.peak_memory_bytes.expect("Linux tells");
        assert!((1 << 16..64 << 20).contains(&peak), "{peak} bytes");
    }
}
