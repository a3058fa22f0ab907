//! The decoder as WebAssembly: `player/src/isv.wasm`, which is committed so that a checkout can be viewed with a Rust compiler alone.
//!
//! Compilers differ in their bytes, so a check compares what the modules do: `player/test/conformance.test.js`.

mod toolchain;

use anyhow::{Context, Result, bail, ensure};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use toolchain::Toolchain;

const COMMITTED: &str = "player/src/isv.wasm";
const TEST: &str = "player/test/conformance.test.js";
/// The variable by which [`TEST`] is given a module to compare.
const FRESH: &str = "ISV_WASM_FRESH";

/// Builds the module, and writes it or, for a check, compares it with the one that is there.
pub(crate) fn run(check: bool, from_source: bool) -> Result<()> {
    ensure!(Path::new(TEST).exists(), "run this at the root of the repository");
    let toolchain = if from_source { Toolchain::from_source() } else { Toolchain::find() };
    let fresh = build(&toolchain?)?;
    if check {
        return test(&fresh);
    }
    let bytes = std::fs::read(&fresh)?;
    std::fs::write(COMMITTED, &bytes).with_context(|| format!("cannot write {COMMITTED}"))?;
    println!("{COMMITTED}: {} bytes", bytes.len());
    for (program, level) in [("gzip", "-9"), ("brotli", "-9")] {
        if let Some(bytes) = compressed_bytes(program, level, &fresh)? {
            println!("{program} {level}: {bytes} bytes");
        }
    }
    Ok(())
}

/// Builds the module. Where it is.
fn build(toolchain: &Toolchain) -> Result<PathBuf> {
    let output = toolchain
        .cargo_build()?
        .args(["--locked", "--package", "isv-wasm", "--profile", "player"])
        .arg("--message-format=json-render-diagnostics")
        .stderr(Stdio::inherit())
        .output()
        .context("cannot run cargo")?;
    ensure!(output.status.success(), "isv-wasm was not built: {}", output.status);
    let messages = String::from_utf8(output.stdout)?;
    let files = messages.lines().map(serde_json::from_str::<serde_json::Value>).filter_map(Result::ok);
    let mut files = files.filter_map(|message| Some(PathBuf::from(message["filenames"][0].as_str()?)));
    files
        .find(|file| file.extension().is_some_and(|ending| ending == "wasm"))
        .context("cargo names no module")
}

/// Runs the conformance test on the committed module and on a fresh one.
fn test(fresh: &Path) -> Result<()> {
    let status = Command::new("node").args(["--test", TEST]).env(FRESH, fresh).status();
    let status = status.context("cannot run node, which the check needs")?;
    if !status.success() {
        bail!("{COMMITTED} was not built from this source: run `cargo xtask player` and commit it");
    }
    Ok(())
}

/// How large a file is once a program compressed it; `None` if there is no such program.
fn compressed_bytes(program: &str, level: &str, file: &Path) -> Result<Option<usize>> {
    match Command::new(program).args([level, "--stdout"]).arg(file).output() {
        Ok(output) if output.status.success() => Ok(Some(output.stdout.len())),
        Ok(output) => bail!("{program}: {}", output.status),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error).with_context(|| format!("cannot run {program}")),
    }
}
