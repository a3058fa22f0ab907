//! Kinds of picture files.

use crate::failure::usage;
use crate::output::is_pipe;
use anyhow::Result;
use clap::ValueEnum;
use std::fmt;
use std::path::Path;

/// `--format`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum PictureFormat {
    /// A still: one picture, or a contact sheet of several
    Png,
    /// An animation, 256 colours a picture
    Gif,
    /// An animation in all colours
    Apng,
}

impl PictureFormat {
    /// The format asked for, or that of the output's name. A .png file may also be an animated PNG, if asked for.
    pub(super) fn settle(asked: Option<Self>, output: &Path) -> Result<Self> {
        let named = of_name(output);
        let name = output.display();
        match (asked, named) {
            (Some(Self::Apng), Some(Self::Png)) => Ok(Self::Apng),
            (Some(asked), Some(named)) if asked != named => {
                Err(usage(format!("--format {asked} does not fit the output's name, {name}")))
            }
            (Some(format), _) | (None, Some(format)) => Ok(format),
            (None, None) if is_pipe(output) => Ok(Self::Png),
            (None, None) => Err(usage(format!(
                "{name}: pictures are .png, .gif or .apng files: use such a name, or --format"
            ))),
        }
    }

    /// Whether its pictures follow each other in time.
    pub(super) fn is_moving(self) -> bool {
        self != Self::Png
    }
}

/// The kind of picture that a file of this name is.
pub(super) fn of_name(output: &Path) -> Option<PictureFormat> {
    PictureFormat::from_str(output.extension()?.to_str()?, true).ok()
}

/// As on the command line.
impl fmt::Display for PictureFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Png => "png",
            Self::Gif => "gif",
            Self::Apng => "apng",
        })
    }
}
