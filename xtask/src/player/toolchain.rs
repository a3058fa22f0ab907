//! Toolchain that can compile for WebAssembly here.

use anyhow::{Context, Result, bail, ensure};
use std::path::{Path, PathBuf};
use std::process::Command;

const TARGET: &str = "wasm32-unknown-unknown";
/// What the player may ask of a browser: every one has had these vectors since 2023.
const FEATURES: &str = "-C target-feature=+simd128";
/// What Debian's packages install: the compiler, the source of its standard library, and the linker.
const DEBIAN_RUSTC: &str = "/usr/bin/rustc";
const DEBIAN_CARGO: &str = "/usr/bin/cargo";
const DEBIAN_LIBRARY: &str = "/usr/lib/rustlib/src/rust/library";
const DEBIAN_LINKER: &str = "/usr/bin/wasm-ld-22";

/// A compiler, and where the standard library for [`TARGET`] comes from.
pub(super) enum Toolchain {
    /// It has that library, as rustup installs it.
    WithLibrary,
    /// Debian's, which builds it from source: a compiler of stable Rust has to be told that it may.
    FromSource,
}

impl Toolchain {
    /// The one that this machine has.
    ///
    /// # Errors
    /// What to install, if it has none.
    pub(super) fn find() -> Result<Self> {
        let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
        let output = Command::new(rustc).args(["--print", "target-libdir", "--target", TARGET]).output();
        let libraries = String::from_utf8(output.context("cannot run rustc")?.stdout)?;
        let has_library = Path::new(libraries.trim()).is_dir();
        if has_library { Ok(Self::WithLibrary) } else { Self::from_source() }
    }

    /// Debian's.
    ///
    /// # Errors
    /// What to install, if it is not there.
    pub(super) fn from_source() -> Result<Self> {
        let parts = [DEBIAN_RUSTC, DEBIAN_CARGO, DEBIAN_LIBRARY, DEBIAN_LINKER];
        if let Some(missing) = parts.into_iter().find(|part| !Path::new(part).exists()) {
            bail!(
                "nothing here compiles for WebAssembly ({missing} is missing): install it with `rustup target add {TARGET}` \
                 or, on Debian, `apt-get install rustc-web cargo-web rust-web-src lld-22`"
            );
        }
        Ok(Self::FromSource)
    }

    /// `cargo build` for [`TARGET`].
    pub(super) fn cargo_build(&self) -> Result<Command> {
        let program = match self {
            Self::WithLibrary => std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()),
            Self::FromSource => DEBIAN_CARGO.into(),
        };
        let mut cargo = Command::new(program);
        cargo.args(["build", "--target", TARGET]);
        if matches!(self, Self::FromSource) {
            cargo.env("RUSTC", DEBIAN_RUSTC).env("RUSTC_BOOTSTRAP", "1").arg("-Zbuild-std=std,panic_abort");
            cargo.env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER", DEBIAN_LINKER);
        }
        // Words of panics name source files: where they lie on this machine is nobody's business.
        let registry = cargo_home()?.join("registry/src");
        let remap = format!("--remap-path-prefix={}=registry", registry.display());
        cargo.env("CARGO_ENCODED_RUSTFLAGS", [FEATURES.replace(' ', "\x1f"), remap].join("\x1f"));
        Ok(cargo)
    }
}

/// Folder in which cargo keeps the sources of dependencies.
fn cargo_home() -> Result<PathBuf> {
    let home = match std::env::var_os("CARGO_HOME") {
        Some(home) => PathBuf::from(home),
        None => std::env::home_dir().context("there is no home directory")?.join(".cargo"),
    };
    ensure!(home.is_absolute(), "CARGO_HOME is not absolute");
    Ok(home)
}
