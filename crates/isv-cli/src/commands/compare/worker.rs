//! One codec in a process of its own, and the lines in which it tells its parent how far it is.

use super::Study;
use super::store::Store;
use crate::progress::Progress;
use anyhow::{Context, Result};
use isv_study::{Codec, Record, Subject, Take};
use serde::{Deserialize, Serialize};
use std::io::{BufRead, BufReader, Write, stdout};
use std::process::{Command, Stdio};

/// How often a frame of a point is reported: when it is encoded, and when it is compared.
pub(super) const STEPS_A_FRAME: usize = 2;

/// A line of a worker, as JSON.
#[derive(Debug, Serialize, Deserialize)]
enum Message {
    /// This many steps are done.
    Steps(usize),
    /// A point is measured and kept.
    Done(Box<Record>),
    /// Something was left out; why.
    Note(String),
}

/// What came of a worker.
pub(super) struct Outcome {
    pub(super) records: Vec<Record>,
    pub(super) notes: Vec<String>,
}

/// The worker: measures a codec at all its points, except those that the store has.
pub(super) fn run(study: &Study, codec: Codec, points: usize) -> Result<()> {
    let Study { take, training, settings, store } = study;
    let training: Vec<_> = training.iter().map(|take| take as &dyn Take).collect();
    let subject = match Subject::prepare(codec, take, &training, settings) {
        Ok(Some(subject)) => subject,
        Ok(None) => {
            return say(&Message::Note(format!(
                "{codec}: draco_encoder and draco_decoder are not installed"
            )));
        }
        Err(error) => return say(&Message::Note(format!("{codec}: {error}"))),
    };
    for point in subject.points(points) {
        if let Some(record) = store.find(codec, &point) {
            say(&Message::Steps(STEPS_A_FRAME * record.frames()))?;
            say(&Message::Done(Box::new(record)))?;
            continue;
        }
        // A parent that is gone shows when the point is done.
        let mut step = || drop(say(&Message::Steps(1)));
        match subject.measure(point, &mut step) {
            Ok(measured) => {
                store.keep(codec, &point, measured)?;
                let record = store.find(codec, &point).context("what was just kept is gone")?;
                say(&Message::Done(Box::new(record)))?;
            }
            Err(error) => say(&Message::Note(format!("{codec} at {point}: {error}")))?,
        }
    }
    Ok(())
}

fn say(message: &Message) -> Result<()> {
    let mut out = stdout().lock();
    writeln!(out, "{}", serde_json::to_string(message)?)?;
    Ok(out.flush()?)
}

/// Runs this program again as a worker and listens to it.
pub(super) fn spawn(codec: Codec, store: &Store, progress: &Progress) -> Result<Outcome> {
    let program = std::env::current_exe().context("cannot find this program")?;
    let mut child = Command::new(program)
        .args(std::env::args_os().skip(1))
        .arg(format!("--worker={codec}"))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .with_context(|| format!("{codec}: cannot start a process of its own"))?;
    let mut outcome = Outcome { records: Vec::new(), notes: Vec::new() };
    let lines = BufReader::new(child.stdout.take().expect("the pipe above")).lines();
    for line in lines {
        // Half a line is all that is left of a worker that was killed.
        match serde_json::from_str(&line?) {
            Ok(Message::Steps(steps)) => (0..steps).for_each(|_| progress.step()),
            Ok(Message::Done(record)) => outcome.records.push(*record),
            Ok(Message::Note(note)) => outcome.notes.push(note),
            Err(_) => break,
        }
    }
    let output = child.wait_with_output()?;
    if !output.status.success() {
        let words = String::from_utf8_lossy(&output.stderr);
        let words = words.lines().last().unwrap_or_default().trim_start_matches("isv: ").to_owned();
        let folder = store.folder().display();
        outcome.notes.push(format!(
            "{codec}: ended early ({}) {words}; what it measured is in {folder}",
            output.status
        ));
    }
    Ok(outcome)
}
