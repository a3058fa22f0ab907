//! Paths and versions of the programs of other codecs.

use crate::ToolError;
use crate::program::{find_program, is_executable, words_of};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;
use thiserror::Error;

/// A program that does not say its version by then hangs.
const VERSION_LIMIT: Duration = Duration::from_secs(20);

/// The programs of other codecs: on the `PATH`, or where a user says that they are.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tools {
    named: BTreeMap<String, PathBuf>,
    time_limit: Option<Duration>,
}

/// A program that a user named and that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum UnusableTool {
    /// No codec has a program of this name.
    #[error("no codec has a program {name:?}; there are {names}", names = Tools::NAMES.join(", "))]
    Unknown {
        /// The name.
        name: String,
    },
    /// The path is not that of an executable file.
    #[error("{}: not an executable file", path.display())]
    NotExecutable {
        /// The path.
        path: PathBuf,
    },
}

impl Tools {
    /// Names of all programs.
    pub const NAMES: [&str; 9] = [
        "draco_encoder",
        "draco_decoder",
        "ffmpeg",
        "gltfpack",
        "tmc3",
        "PccAppEncoder",
        "PccAppDecoder",
        "encode",
        "decode",
    ];

    /// Says where a program is.
    ///
    /// # Errors
    /// See [`UnusableTool`].
    pub fn set(&mut self, name: &str, path: &Path) -> Result<(), UnusableTool> {
        if !Self::NAMES.contains(&name) {
            return Err(UnusableTool::Unknown { name: name.to_owned() });
        }
        let not_executable = || UnusableTool::NotExecutable { path: path.to_owned() };
        let absolute = std::path::absolute(path).map_err(|_| not_executable())?;
        if !is_executable(&absolute) {
            return Err(not_executable());
        }
        self.named.insert(name.to_owned(), absolute);
        Ok(())
    }

    /// Ends each program after this time instead of the limit that suits its codec.
    pub fn set_time_limit(&mut self, limit: Duration) {
        self.time_limit = Some(limit);
    }

    /// The limit of a program's time.
    pub(crate) fn limit(&self, of_codec: Duration) -> Duration {
        self.time_limit.unwrap_or(of_codec)
    }

    /// A program, if it is there, with the version that it says; `limit` is that of its codec.
    pub(crate) fn identify(&self, identity: &Identity, limit: Duration) -> Result<Option<Tool>, ToolError> {
        let Some(path) = self.find(identity.name) else { return Ok(None) };
        let version = ToolVersion::ask(&path, identity)?;
        Ok(Some(Tool { path, version, limit: self.limit(limit) }))
    }

    /// Path of a program, if it is there.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<PathBuf> {
        match self.named.get(name) {
            Some(path) => Some(path.clone()),
            None => std::path::absolute(find_program(name)?).ok(),
        }
    }
}

/// How a program is told from others of the same name.
pub(crate) struct Identity {
    /// Name of its file.
    pub(crate) name: &'static str,
    /// Arguments with which it says its version.
    pub(crate) arguments: &'static [&'static str],
    /// Words before the version.
    pub(crate) mark: &'static str,
    /// The version that the adapter was tested with.
    pub(crate) tested: &'static str,
}

/// A program that was found and has said its version.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Tool {
    pub(crate) path: PathBuf,
    pub(crate) version: ToolVersion,
    /// Time after which it is ended.
    pub(crate) limit: Duration,
}

/// Version of a program of another codec.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ToolVersion {
    /// What the program says.
    pub version: String,
    /// The version that the adapter was tested with.
    pub tested: &'static str,
}

impl ToolVersion {
    /// What a reader must know if it is not the tested version.
    #[must_use]
    pub fn note(&self, program: &str) -> Option<String> {
        let Self { version, tested } = self;
        (!version.contains(tested))
            .then(|| format!("{program} is version {version}; isv's settings are tested with {tested}"))
    }

    /// Asks a program for its version. A program that does not say the mark is another one of the same name.
    pub(crate) fn ask(program: &Path, identity: &Identity) -> Result<Self, ToolError> {
        let Identity { arguments, mark, tested, .. } = *identity;
        let arguments: Vec<_> = arguments.iter().map(|argument| (*argument).to_owned()).collect();
        let words = words_of(program, &arguments, VERSION_LIMIT)?;
        let version = words.split_once(mark).and_then(|(_, rest)| rest.split_whitespace().next());
        let unknown = || ToolError::Version {
            program: program.to_owned(),
            mark: mark.trim().to_owned(),
            says: words.chars().take(80).collect(),
        };
        version.map(|version| Self { version: version.to_owned(), tested }).ok_or_else(unknown)
    }
}

/// Folders above a program, its own included, in which its configurations are looked for.
const FOLDERS_ABOVE: usize = 4;

/// The folder `cfg` beside a program, or up to 3 folders above, that has a file. The program's path may be a link.
pub(crate) fn folder_above(program: &Path, file: &'static str) -> Result<PathBuf, ToolError> {
    let real = program.canonicalize().unwrap_or_else(|_| program.to_owned());
    let folders = [program, &real].into_iter().flat_map(|path| path.ancestors().skip(1).take(FOLDERS_ABOVE));
    let found = folders.map(|folder| folder.join("cfg")).find(|folder| folder.join(file).is_file());
    found.ok_or_else(|| ToolError::Configuration { program: program.to_owned(), file })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_named_program_comes_before_that_of_the_path() {
        let shell = find_program("sh").expect("a shell");
        let mut tools = Tools::default();
        assert_eq!(tools.find("tmc3"), find_program("tmc3"));
        tools.set("tmc3", &shell).unwrap();
        assert_eq!(tools.find("tmc3"), Some(shell.clone()));
        let unknown = tools.set("tmc4", &shell).unwrap_err().to_string();
        assert!(unknown.contains("\"tmc4\"") && unknown.contains("ffmpeg, gltfpack, tmc3"), "{unknown}");
        let missing = tools.set("gltfpack", Path::new("no/such/file")).unwrap_err();
        assert_eq!(missing.to_string(), "no/such/file: not an executable file");
    }
}
