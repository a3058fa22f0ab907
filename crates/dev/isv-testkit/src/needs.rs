//! Things outside the repository that some tests need, and what happens where they are missing.

use std::fmt::Display;
use std::fs::OpenOptions;
use std::io::Write;

/// The environment variable that lists needs by name, separated by commas. A test that would be skipped for one of them fails.
pub(crate) const REQUIRE_VARIABLE: &str = "ISV_REQUIRE";
/// The environment variable with the file to which each skip adds a line: the need and the test.
pub(crate) const SKIPS_VARIABLE: &str = "ISV_SKIPS";

/// A thing outside the repository that a test may need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// A GPU or a software driver for one.
    Gpu,
    /// Real captures.
    Captures,
    /// The programs of Draco.
    Draco,
    /// The programs of other codecs: gltfpack and MPEG's test models.
    OtherCodecs,
    /// Python with NumPy.
    Python,
    /// Python with OpenVDB.
    OpenVdb,
    /// Python with USD.
    Usd,
    /// A browser and the player's packages; for tests of the player alone.
    Browser,
    /// FFmpeg's `ffprobe`, and MediaInfo.
    Media,
    /// Valgrind.
    Valgrind,
    /// A set of vector instructions.
    Instructions,
    /// A system that tells how much memory a process takes.
    MemoryUse,
    /// The program `xz`.
    Xz,
}

impl Need {
    /// All needs.
    pub const ALL: [Self; 13] = [
        Self::Gpu,
        Self::Captures,
        Self::Draco,
        Self::OtherCodecs,
        Self::Python,
        Self::OpenVdb,
        Self::Usd,
        Self::Browser,
        Self::Media,
        Self::Valgrind,
        Self::Instructions,
        Self::MemoryUse,
        Self::Xz,
    ];

    /// Name in `ISV_REQUIRE`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Gpu => "gpu",
            Self::Captures => "captures",
            Self::Draco => "draco",
            Self::OtherCodecs => "other-codecs",
            Self::Python => "python",
            Self::OpenVdb => "openvdb",
            Self::Usd => "usd",
            Self::Browser => "browser",
            Self::Media => "media",
            Self::Valgrind => "valgrind",
            Self::Instructions => "instructions",
            Self::MemoryUse => "memory-use",
            Self::Xz => "xz",
        }
    }

    /// Whether `ISV_REQUIRE` lists this need.
    ///
    /// # Panics
    /// If the variable lists a name that is none: a test that it was to require would be skipped in silence.
    #[must_use]
    pub fn is_required(self) -> bool {
        let list = std::env::var(REQUIRE_VARIABLE).unwrap_or_default();
        let names = || list.split(',').map(str::trim).filter(|name| !name.is_empty());
        if let Some(name) = names().find(|name| Self::ALL.iter().all(|need| need.name() != *name)) {
            let known = Self::ALL.map(Self::name).join(", ");
            panic!("{REQUIRE_VARIABLE}: {name} is no need; these are: {known}");
        }
        names().any(|name| name == self.name())
    }
}

/// Skips the test that calls it: says why, and adds a line to the file of `ISV_SKIPS`.
///
/// # Panics
/// If `ISV_REQUIRE` lists the need.
pub fn skip(need: Need, why: impl Display) {
    assert!(!need.is_required(), "{REQUIRE_VARIABLE} lists {}: {why}", need.name());
    println!("skipped: {why}");
    let Some(path) = std::env::var_os(SKIPS_VARIABLE) else { return };
    let test = std::thread::current().name().unwrap_or("unnamed").to_owned();
    let line = format!("{}\t{test}\n", need.name());
    let file = OpenOptions::new().create(true).append(true).open(&path);
    file.and_then(|mut file| file.write_all(line.as_bytes()))
        .unwrap_or_else(|error| panic!("{SKIPS_VARIABLE}: {}: {error}", path.display()));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs a test of this file by itself, with variables of its own.
    fn run_alone(test: &str, require: &str, skips: &std::path::Path) -> bool {
        std::process::Command::new(std::env::current_exe().unwrap())
            .args(["--exact", &format!("needs::tests::{test}"), "--nocapture"])
            .env(REQUIRE_VARIABLE, require)
            .env(SKIPS_VARIABLE, skips)
            .output()
            .unwrap()
            .status
            .success()
    }

    #[test]
    fn a_test_without_draco() {
        // Run by the test below; by itself it is one more that is skipped, of which nobody needs to know.
        if std::env::var_os(SKIPS_VARIABLE).is_some_and(|path| path.to_string_lossy().ends_with("needs-test"))
        {
            skip(Need::Draco, "this test has no Draco");
        }
    }

    #[test]
    fn a_skip_is_counted_and_one_of_what_is_required_fails() {
        let path = std::env::temp_dir().join(format!("isv-{}-needs-test", std::process::id()));
        for (require, passes) in
            [("", true), ("gpu", true), ("draco", false), ("gpu, draco", false), ("drako", false)]
        {
            let _ = std::fs::remove_file(&path);
            assert_eq!(run_alone("a_test_without_draco", require, &path), passes, "{require}");
            let counted = std::fs::read_to_string(&path).unwrap_or_default();
            let expected = if passes { "draco\tneeds::tests::a_test_without_draco\n" } else { "" };
            assert_eq!(counted, expected, "{require}");
        }
        let _ = std::fs::remove_file(&path);
    }
}
