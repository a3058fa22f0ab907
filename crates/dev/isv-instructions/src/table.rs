//! The table, and what has changed since it was written.

use crate::callgrind::{self, Count};
use anyhow::{Context, Result, bail};
use isv_kernels::simd::Instructions;
use isv_testkit::{Need, skip};
use std::path::Path;
use std::process::Command;

/// Largest growth that is let pass, as a share, and under another compiler than the table's.
const TOLERANCE: f64 = 0.03;
const TOLERANCE_OF_OTHER_COMPILERS: f64 = 0.3;
/// What is counted, in the order of the columns.
const COLUMNS: [Instructions; 2] = [Instructions::Scalar, Instructions::Avx2];
/// What renews the table.
const UPDATE: &str = "cargo instructions --update";
const COMPILER: &str = "Compiler: ";

/// One line of the table.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    kernel: String,
    unit: String,
    /// Instructions a unit, by [`COLUMNS`].
    counts: [f64; 2],
}

impl Row {
    fn new(scalar: &Count, avx2: &Count) -> Self {
        let counts = [scalar.instructions, avx2.instructions];
        Self { kernel: scalar.kernel.clone(), unit: scalar.unit.clone(), counts }
    }

    fn to_markdown(&self) -> String {
        let Self { kernel, unit, counts: [scalar, avx2] } = self;
        format!("| {kernel} | {unit} | {scalar:.1} | {avx2:.1} | {:.2} |", scalar / avx2)
    }

    /// A line of the table; nothing for other lines.
    fn parse(line: &str) -> Option<Self> {
        let mut cells = line.strip_prefix("| ")?.split('|').map(str::trim);
        let (kernel, unit) = (cells.next()?.to_owned(), cells.next()?.to_owned());
        let counts = [cells.next()?.parse().ok()?, cells.next()?.parse().ok()?];
        Some(Self { kernel, unit, counts })
    }

    /// What became of `before`: sentences on counts that grew, and on those that fell, by more than a share.
    fn changes(&self, before: &Self, tolerance: f64) -> (Vec<String>, Vec<String>) {
        let (mut worse, mut better) = (Vec::new(), Vec::new());
        for (column, (now, before)) in COLUMNS.iter().zip(self.counts.into_iter().zip(before.counts)) {
            let growth = now / before - 1.0;
            let sentence = format!(
                "{}, {column}: {before:.1} -> {now:.1} instructions a {} ({:+.1} %)",
                self.kernel,
                self.unit,
                100.0 * growth
            );
            // What is no number is worse than any.
            if growth.is_nan() || growth > tolerance {
                worse.push(sentence);
            } else if growth < -tolerance {
                better.push(sentence);
            }
        }
        (worse, better)
    }
}

/// The table: what it was made with, and its rows.
#[derive(Debug, PartialEq)]
struct Table {
    compiler: String,
    rows: Vec<Row>,
}

impl Table {
    fn measure() -> Result<Self> {
        let [scalar, avx2] = COLUMNS.map(callgrind::count);
        let rows = scalar?.iter().zip(&avx2?).map(|(scalar, avx2)| Row::new(scalar, avx2)).collect();
        Ok(Self { compiler: compiler()?, rows })
    }

    /// The lesser counts of two tables of the same kernels.
    fn least(mut self, other: &Self) -> Self {
        for (row, other) in self.rows.iter_mut().zip(&other.rows) {
            for (count, other) in row.counts.iter_mut().zip(other.counts) {
                *count = count.min(other);
            }
        }
        self
    }

    fn to_markdown(&self) -> String {
        let rows: Vec<_> = self.rows.iter().map(Row::to_markdown).collect();
        format!(
            "# Instructions of the kernels\n\n\
             How many instructions each kernel takes on input made in code, one thread, counted by valgrind, which knows no AVX-512:\n\
             the same on any machine. `scalar` is the plain code for any x86-64, in which the compiler may use SSE2. Instructions are\n\
             not time, but what grows here was made slower or does more. CI compares: {:.0} % more fail, {:.0} % under another compiler.\n\n\
             ```sh\n{UPDATE}    # without --update, compares\n```\n\n\
             {COMPILER}{}\n\n\
             | kernel | unit | scalar | avx2 | ratio |\n|---|---|---|---|---|\n{}\n",
            100.0 * TOLERANCE,
            100.0 * TOLERANCE_OF_OTHER_COMPILERS,
            self.compiler,
            rows.join("\n"),
        )
    }

    fn parse(text: &str) -> Option<Self> {
        let compiler = text.lines().find_map(|line| line.strip_prefix(COMPILER))?.to_owned();
        Some(Self { compiler, rows: text.lines().filter_map(Row::parse).collect() })
    }
}

/// The compiler, as `rustc --version` has it: that of the working folder, which made this program.
fn compiler() -> Result<String> {
    let output = Command::new("rustc").arg("--version").output().context("cannot run rustc")?;
    Ok(String::from_utf8(output.stdout)?.trim().to_owned())
}

/// Counts all kernels and compares them with the table, or writes them into it.
pub(super) fn run(path: &Path, update: bool) -> Result<()> {
    let missing = if !callgrind::is_installed() {
        Some((Need::Valgrind, "valgrind is not installed".to_owned()))
    } else {
        let lacks = |set: &Instructions| !Instructions::available().any(|there| there == *set);
        COLUMNS
            .iter()
            .find(|set| lacks(set))
            .map(|set| (Need::Instructions, format!("this machine has no {set}")))
    };
    if let Some((need, missing)) = missing {
        if update {
            bail!("instructions cannot be counted: {missing}");
        }
        skip(need, format_args!("instructions are not counted, as {missing}"));
        return Ok(());
    }
    let table = Table::measure()?;
    if update {
        return std::fs::write(path, table.to_markdown())
            .with_context(|| format!("{}: cannot write", path.display()));
    }
    let committed = std::fs::read_to_string(path).ok().and_then(|text| Table::parse(&text));
    let committed = committed.with_context(|| format!("{}: no table; --update makes one", path.display()))?;
    // Now and then a count is some percent too high, where memory lies otherwise: what has grown is counted once more.
    compare(&table, &committed, path).or_else(|_| compare(&table.least(&Table::measure()?), &committed, path))
}

fn compare(table: &Table, committed: &Table, path: &Path) -> Result<()> {
    let tolerance = if table.compiler == committed.compiler {
        TOLERANCE
    } else {
        println!("the table was made with {}, this is {}", committed.compiler, table.compiler);
        TOLERANCE_OF_OTHER_COMPILERS
    };
    let (mut worse, mut better) = (Vec::new(), Vec::new());
    for row in &table.rows {
        println!("{}", row.to_markdown());
        let same = |old: &&Row| (&old.kernel, &old.unit) == (&row.kernel, &row.unit);
        let Some(old) = committed.rows.iter().find(same) else {
            bail!("{} is not in {}; {UPDATE} adds it", row.kernel, path.display());
        };
        let changes = row.changes(old, tolerance);
        worse.extend(changes.0);
        better.extend(changes.1);
    }
    if !better.is_empty() {
        println!("fewer than in {}; {UPDATE} takes that down:\n{}", path.display(), better.join("\n"));
    }
    if !worse.is_empty() {
        bail!("more than in {}:\n{}\nif this is meant, {UPDATE}", path.display(), worse.join("\n"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(counts: [f64; 2]) -> Row {
        Row { kernel: "forward DCT".to_owned(), unit: "block".to_owned(), counts }
    }

    #[test]
    fn of_two_counts_the_lesser_counts() {
        let table = |rows: Vec<Row>| Table { compiler: String::new(), rows };
        let least = table(vec![row([3.0, 2.0]), row([1.0, 5.0])])
            .least(&table(vec![row([4.0, 1.0]), row([0.5, 6.0])]));
        assert_eq!(least, table(vec![row([3.0, 1.0]), row([0.5, 5.0])]));
    }

    #[test]
    fn the_table_is_read_as_it_is_written() {
        let table =
            Table { compiler: "rustc 1.95.0".to_owned(), rows: vec![row([5000.0, 1234.5]), row([2.0, 1.5])] };
        assert_eq!(Table::parse(&table.to_markdown()), Some(table));
        assert_eq!(Table::parse("# Something else"), None);
    }

    #[test]
    fn growth_beyond_the_tolerance_is_named() {
        let before = row([5000.0, 1000.0]);
        assert_eq!(row([5100.0, 980.0]).changes(&before, 0.03), (vec![], vec![]));
        let (worse, better) = row([4000.0, 1040.0]).changes(&before, 0.03);
        assert_eq!(worse, ["forward DCT, avx2: 1000.0 -> 1040.0 instructions a block (+4.0 %)"]);
        assert_eq!(better, ["forward DCT, scalar: 5000.0 -> 4000.0 instructions a block (-20.0 %)"]);
    }

    #[test]
    fn only_what_grew_fails() {
        let table = |counts, compiler: &str| Table { compiler: compiler.to_owned(), rows: vec![row(counts)] };
        let committed = table([5000.0, 1000.0], "a");
        let path = Path::new("table.md");
        assert!(compare(&table([4000.0, 900.0], "a"), &committed, path).is_ok());
        assert!(compare(&table([5000.0, 1100.0], "b"), &committed, path).is_ok());
        let error = compare(&table([5000.0, 1100.0], "a"), &committed, path).unwrap_err().to_string();
        assert!(error.contains("forward DCT, avx2") && error.contains("--update"), "{error}");
    }
}
