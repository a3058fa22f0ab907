//! One codec at one point in a process of its own, and the lines in which it tells its parent how far it is.

use crate::{CapturedTake, Codec, OperatingPoint, Store, StudyError, StudySettings, Subject, Take};
use isv_baseline::Tools;
use serde::{Deserialize, Serialize};
use std::io::{self, BufRead, BufReader, Read, Write, stdout};
use std::process::{Child, Command, Stdio};

/// How often a frame of a point is reported: when it is encoded, and when it is compared.
pub const STEPS_A_FRAME: usize = 2;

/// A line of a worker, as JSON.
#[derive(Debug, Serialize, Deserialize)]
enum Message {
    /// Another frame is encoded, or compared.
    Step,
    /// The point is measured and kept.
    Kept,
    /// It is not; why.
    Failed {
        sentence: String,
        /// Whether the codec's other points need not be tried.
        at_all_points: bool,
    },
}

/// How a worker ended.
#[derive(Clone, Debug)]
pub enum Outcome {
    /// The point is in the store.
    Kept,
    /// It is not; why.
    Failed {
        /// Cause of the failure.
        sentence: String,
        /// Whether the codec's other points need not be tried.
        at_all_points: bool,
    },
}

/// The worker: measures a codec at one of its points, keeps what it finds in the store, and tells its parent on standard output.
///
/// # Errors
/// [`StudyError::File`], if its parent is gone or the store cannot be written.
pub fn run(
    take: &CapturedTake,
    training: &[CapturedTake],
    settings: &StudySettings,
    store: &Store,
    codec: Codec,
    point: OperatingPoint,
    tools: &Tools,
) -> Result<(), StudyError> {
    let training: Vec<_> = training.iter().map(|take| take as &dyn Take).collect();
    let measured = match Subject::prepare(codec, take, &training, settings, tools) {
        Ok(Some(subject)) => subject.measure(point, &mut step),
        Ok(None) => {
            return Ok(say(&Message::Failed { sentence: not_installed(codec), at_all_points: true })?);
        }
        Err(error) => Err(error),
    };
    match measured {
        Ok(measured) => {
            store.keep(codec, &point, measured)?;
            Ok(say(&Message::Kept)?)
        }
        Err(error) => Ok(say(&failure(&error))?),
    }
}

/// Says which programs a codec lacks.
fn not_installed(codec: Codec) -> String {
    match codec.programs() {
        [one] => format!("{one} is not installed; --tool {one}=PATH says where it is"),
        all => format!("{} are not both installed; --tool NAME=PATH says where they are", all.join(" and ")),
    }
}

fn failure(error: &StudyError) -> Message {
    Message::Failed { sentence: error.to_string(), at_all_points: error.is_of_all_points() }
}

/// Says that a frame is done. Nobody needs the rest once the parent is gone.
fn step() {
    if say(&Message::Step).is_err() {
        std::process::exit(1);
    }
}

fn say(message: &Message) -> io::Result<()> {
    let mut out = stdout().lock();
    writeln!(out, "{}", serde_json::to_string(message)?)?;
    out.flush()
}

/// Runs a worker as a process of its own and listens to it. `on_step` is called as often as [`STEPS_A_FRAME`] says.
///
/// # Errors
/// [`StudyError::File`], if it cannot be started.
pub fn spawn(
    mut command: Command,
    codec: Codec,
    point: &OperatingPoint,
    mut on_step: impl FnMut(),
) -> Result<Outcome, StudyError> {
    let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = Worker(child?);
    let lines = BufReader::new(child.0.stdout.take().expect("a pipe")).lines();
    let mut stderr = child.0.stderr.take().expect("a pipe");
    // On a thread: a worker that has much to say on one pipe must not wait for the other.
    let words = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        let _ = stderr.read_to_end(&mut bytes);
        String::from_utf8_lossy(&bytes).into_owned()
    });
    let mut outcome = None;
    for line in lines {
        // Half a line is all that is left of a worker that was killed.
        match serde_json::from_str(&line?) {
            Ok(Message::Step) => on_step(),
            Ok(Message::Kept) => outcome = Some(Outcome::Kept),
            Ok(Message::Failed { sentence, at_all_points }) => {
                outcome = Some(Outcome::Failed {
                    sentence: format!("{codec} at {point}: {sentence}"),
                    at_all_points,
                });
            }
            Err(_) => break,
        }
    }
    let status = child.0.wait()?;
    let words = words.join().unwrap_or_default();
    let words = words.lines().last().unwrap_or_default().trim_start_matches("isv: ");
    Ok(outcome.unwrap_or_else(|| Outcome::Failed {
        sentence: format!(
            "{codec} at {point}: ended early ({status}{}{words}), run again to try again",
            if words.is_empty() { "" } else { ", " }
        ),
        at_all_points: false,
    }))
}

/// A worker that does not outlive its parent's interest.
struct Worker(Child);

impl Drop for Worker {
    fn drop(&mut self) {
        // Both fail if it has ended and been waited for, which is what is wanted.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
