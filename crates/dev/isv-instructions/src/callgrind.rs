//! Counting by running this very program under valgrind, which emulates processors up to AVX2.
//!
//! Counting is on inside [`counted_work`] only, and what it counted is written out whenever that returns: one file a kernel.

use crate::kernels::{Inputs, KERNELS};
use anyhow::{Context, Result, bail};
use isv_kernels::simd::{self, Instructions};
use std::hint::black_box;
use std::path::Path;
use std::process::Command;

/// The flag that the program is called with to be counted.
pub(super) const COUNTED_FLAG: &str = "counted";
/// The function that is counted, whatever the compiler makes of its name. Of two options with one pattern valgrind 3.19 follows
/// only the first, so there are two.
const COUNTED_FUNCTION: [&str; 2] = ["*counted_work*", "*::counted_work*"];

/// Instructions a unit of one kernel.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Count {
    pub(super) kernel: String,
    pub(super) unit: String,
    pub(super) instructions: f64,
}

/// Whether valgrind is there.
pub(super) fn is_installed() -> bool {
    Command::new("valgrind").arg("--version").output().is_ok_and(|output| output.status.success())
}

/// Counts all kernels with a set of vector instructions.
pub(super) fn count(instructions: Instructions) -> Result<Vec<Count>> {
    let folder = tempfile::tempdir()?;
    let program = std::env::current_exe().context("this program has no path")?;
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--collect-atstart=no"])
        .arg(format!("--toggle-collect={}", COUNTED_FUNCTION[0]))
        .arg(format!("--dump-after={}", COUNTED_FUNCTION[1]))
        .arg(format!("--callgrind-out-file={}", folder.path().join("counts").display()))
        .arg(program)
        .arg(format!("--{COUNTED_FLAG}"))
        .env(simd::VARIABLE, instructions.to_string())
        .output()
        .context("cannot run valgrind")?;
    if !output.status.success() {
        bail!("valgrind with {instructions}: {}", String::from_utf8_lossy(&output.stderr));
    }
    let units = String::from_utf8(output.stdout)?;
    let kernels = KERNELS.iter().zip(units.lines()).enumerate();
    let counts = kernels.map(|(n, (kernel, units))| {
        let counted = read_total(&folder.path().join(format!("counts.{}", n + 1)))?;
        let instructions = counted / units.parse::<f64>()?;
        Ok(Count { kernel: kernel.name.to_owned(), unit: kernel.unit.to_owned(), instructions })
    });
    let counts = counts.collect::<Result<Vec<_>>>()?;
    if counts.len() != KERNELS.len() {
        bail!("valgrind with {instructions}: {} kernels of {} were counted", counts.len(), KERNELS.len());
    }
    Ok(counts)
}

/// The instructions that a file of callgrind's has in all.
fn read_total(path: &Path) -> Result<f64> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("{}: nothing counted", path.display()))?;
    let total = text.lines().find_map(|line| line.strip_prefix("totals: ")?.trim().parse().ok());
    total.filter(|total| *total > 0.0).with_context(|| format!("{}: no total", path.display()))
}

/// Runs all kernels, in the order of the table, and prints how many units each did: what is counted.
pub(super) fn run_kernels() -> Result<()> {
    // Other threads are not counted.
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global()?;
    let inputs = Inputs::new()?;
    for kernel in &KERNELS {
        let mut counter = |work: &mut dyn FnMut()| {
            work();
            counted_work(work);
        };
        println!("{}", (kernel.work)(&inputs, &mut counter));
    }
    Ok(())
}

/// Does the work, and something after it, so that it is not jumped to.
#[inline(never)]
fn counted_work(work: &mut dyn FnMut()) {
    work();
    black_box(());
}
