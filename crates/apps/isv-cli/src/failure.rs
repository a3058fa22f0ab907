//! How failures leave the program: one sentence on stderr and an exit status.

use crate::output::say;
use crate::words;
use isv::raw::format::FormatError;
use isv::raw::io::WriteError;
use isv::raw::take::decode::DecodeTakeError;
use isv::raw::take::encode::EncodeError;
use std::fmt;
use std::io;
use std::path::Path;
use std::process::ExitCode;

const JOB_FAILED: u8 = 1;
const COMMAND_LINE_WRONG: u8 = 2;

/// A command line that parses, but asks for what cannot be: exit status 2.
#[derive(Debug)]
struct UsageError(String);

impl fmt::Display for UsageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for UsageError {}

/// An error that blames the command line.
pub(crate) fn usage(sentence: impl Into<String>) -> anyhow::Error {
    UsageError(sentence.into()).into()
}

/// Says what went wrong; the reader of a pipe going away needs no words.
pub(crate) fn report(error: &anyhow::Error) -> ExitCode {
    if error.chain().any(is_broken_pipe) {
        return ExitCode::from(JOB_FAILED);
    }
    let (sentence, is_usage) = words::error(error);
    say(format_args!("isv: {}", one_line(&sentence)));
    ExitCode::from(if is_usage || error.is::<UsageError>() { COMMAND_LINE_WRONG } else { JOB_FAILED })
}

/// Prints help or the version where they were asked for, otherwise the first paragraph of what clap has to say.
pub(crate) fn report_command_line(error: &clap::Error) -> ExitCode {
    use clap::error::{ContextKind, ContextValue, ErrorKind};
    match error.kind() {
        ErrorKind::DisplayHelp
        | ErrorKind::DisplayVersion
        | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            // Nothing is left to be said if the terminal is gone.
            let _ = error.print();
        }
        ErrorKind::UnknownArgument
            if let Some(ContextValue::String(found)) = error.get(ContextKind::InvalidArg)
                && Path::new(found).exists() =>
        {
            say(format_args!(
                "isv: {found}: one input too many: name the folder of the frames, or put a pattern in quotes so that the shell leaves it alone"
            ));
        }
        _ => {
            let text = error.render().to_string();
            let paragraph = text.split("\n\n").next().unwrap_or_default();
            let sentence = paragraph.strip_prefix("error: ").unwrap_or(paragraph);
            say(format_args!("isv: {}; --help lists what is understood", one_line(sentence)));
        }
    }
    u8::try_from(error.exit_code()).map_or(ExitCode::FAILURE, ExitCode::from)
}

/// File names may hold line breaks, and clap's messages do.
pub(crate) fn one_line(text: &str) -> String {
    text.lines().map(str::trim).collect::<Vec<_>>().join(" ")
}

fn is_broken_pipe(cause: &(dyn std::error::Error + 'static)) -> bool {
    let io_error = if let Some(FormatError::Io(error)) = cause.downcast_ref() {
        Some(error)
    } else if let Some(EncodeError::Write(FormatError::Io(error))) = cause.downcast_ref() {
        Some(error)
    } else if let Some(WriteError { cause, .. }) = cause.downcast_ref() {
        Some(cause)
    } else if let Some(DecodeTakeError::Io(error) | DecodeTakeError::Write(WriteError { cause: error, .. })) =
        cause.downcast_ref()
    {
        Some(error)
    } else {
        cause.downcast_ref::<io::Error>()
    };
    io_error.is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context;

    #[test]
    fn broken_pipes_are_found_wherever_they_hide() {
        let broken = || io::Error::from(io::ErrorKind::BrokenPipe);
        let in_format = anyhow::Error::from(FormatError::Io(broken()));
        let in_write = anyhow::Error::from(WriteError { path: "out".into(), cause: broken() });
        let in_context = Err::<(), _>(broken()).context("stdout").unwrap_err();
        for error in [in_format, in_write, in_context] {
            assert!(error.chain().any(is_broken_pipe), "{error:#}");
        }
        assert!(!anyhow::anyhow!("other").chain().any(is_broken_pipe));
    }

    #[test]
    fn sentences_are_one_line() {
        assert_eq!(one_line("a value is missing:\n  <INPUT>"), "a value is missing: <INPUT>");
    }
}
