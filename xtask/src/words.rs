//! Sentences that break the rules of wording (CONTRIBUTING.md), counted by folder and rule.
//!
//! A table holds the counts, which may not rise: old sentences are mended as they are touched, and no new ones come. Where
//! they have fallen the table is to be written again, so that they stay there.

mod sentences;

use anyhow::{Context, Result, bail, ensure};
use sentences::{Paragraph, is_long, markdown, rust, sentences};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

/// Folders and files with text, from the root of the repository.
const SOURCES: [&str; 17] = [
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CODE_OF_CONDUCT.md",
    "CONTRIBUTING.md",
    "README.md",
    "SECURITY.md",
    "bindings",
    "conformance",
    "crates/apps",
    "crates/codec",
    "crates/dev",
    "crates/geometry",
    "docs",
    "fuzz",
    "integrations",
    "player",
    "xtask",
];
/// Folders of what is built or installed.
const NOT_OURS: [&str; 5] = ["target", "node_modules", "__pycache__", "vendor", "corpus"];
/// Beginnings of doc comments that need a neighbour to make sense.
const BEGINNINGS: [&str; 8] = ["The same", "That", "Those", "Of", "As", "Where", "Its", "Who"];
/// Most characters of a line in a document.
const MOST_CHARACTERS: usize = 120;

/// What a text may break.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Rule {
    /// A doc comment begins with one of [`BEGINNINGS`].
    Beginning,
    /// A sentence has more than 25 words.
    LongSentence,
    /// A line of a document has more than [`MOST_CHARACTERS`]; lines of tables and code may have.
    LongLine,
}

impl Rule {
    const ALL: [Self; 3] = [Self::Beginning, Self::LongSentence, Self::LongLine];

    fn name(self) -> &'static str {
        match self {
            Self::Beginning => "beginning",
            Self::LongSentence => "long sentence",
            Self::LongLine => "long line",
        }
    }
}

/// A place that breaks a rule.
struct Finding {
    source: &'static str,
    rule: Rule,
    /// `file:line: text`.
    words: String,
}

/// Counts by source and rule.
type Counts = BTreeMap<(String, &'static str), usize>;

/// Counts what breaks a rule and holds it against a table, or writes the table.
pub(crate) fn run(table: &Path, update: bool, list: Option<&str>) -> Result<()> {
    ensure!(Path::new("ARCHITECTURE.md").exists(), "run this at the root of the repository");
    let mut found = Vec::new();
    for source in SOURCES {
        for file in texts(Path::new(source))? {
            let text =
                fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))?;
            found.extend(findings(source, &file, &text));
        }
    }
    if let Some(part) = list {
        found.iter().filter(|finding| finding.words.contains(part)).for_each(|finding| {
            println!("{} ({})", finding.words, finding.rule.name());
        });
    }
    let mut counts = Counts::new();
    for (source, rule) in SOURCES.into_iter().flat_map(|source| Rule::ALL.map(|rule| (source, rule))) {
        counts.insert((source.to_owned(), rule.name()), 0);
    }
    for finding in &found {
        *counts.entry((finding.source.to_owned(), finding.rule.name())).or_default() += 1;
    }
    counts.retain(|_, count| *count > 0);
    if update {
        fs::write(table, csv(&counts)).with_context(|| format!("cannot write {}", table.display()))?;
    }
    let before =
        parse(&fs::read_to_string(table).with_context(|| format!("cannot read {}", table.display()))?)?;
    let risen: Vec<String> = counts
        .iter()
        .filter_map(|((source, rule), count)| {
            let allowed = before.get(&(source.clone(), *rule)).copied().unwrap_or(0);
            (*count > allowed).then(|| format!("{source}: {rule}: {count}, at most {allowed} allowed"))
        })
        .collect();
    let has_fallen = before.iter().any(|(place, allowed)| counts.get(place).copied().unwrap_or(0) < *allowed);
    let total = |counts: &Counts| counts.values().sum::<usize>();
    println!("{} places break a rule of wording, {} allowed", total(&counts), total(&before));
    if !risen.is_empty() {
        bail!(
            "{}\n`cargo xtask words --list PART` lists the places whose file or text has PART",
            risen.join("\n")
        );
    }
    ensure!(!has_fallen, "there are fewer places than the table allows: `cargo xtask words --update`");
    Ok(())
}

/// Files of Rust and Markdown at or under a path, in order.
fn texts(path: &Path) -> Result<Vec<PathBuf>> {
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let entries = fs::read_dir(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut paths = entries.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>>>()?;
    paths.sort();
    let mut files = Vec::new();
    for path in paths {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let is_ours = !NOT_OURS.contains(&name) && !name.starts_with('.');
        if path.is_dir() && is_ours && !path.is_symlink() {
            files.extend(texts(&path)?);
        } else if path.is_file() && (name.ends_with(".rs") || name.ends_with(".md")) {
            files.push(path);
        }
    }
    Ok(files)
}

/// What breaks a rule in a file.
fn findings(source: &'static str, file: &Path, text: &str) -> Vec<Finding> {
    let is_document = file.extension().is_some_and(|ending| ending == "md");
    let place = |line: usize, words: &str| format!("{}:{line}: {words}", file.display());
    let mut found = Vec::new();
    let mut find = |rule, line, words: &str| found.push(Finding { source, rule, words: place(line, words) });
    let paragraphs = if is_document { markdown(text) } else { rust(text) };
    for Paragraph { line, text, begins } in &paragraphs {
        if !is_document && *begins && BEGINNINGS.iter().any(|word| begins_with(text, word)) {
            find(Rule::Beginning, *line, text);
        }
        for sentence in sentences(text).filter(|sentence| is_long(sentence)) {
            find(Rule::LongSentence, *line, sentence);
        }
    }
    if is_document {
        let mut in_code = false;
        for (number, line) in text.lines().enumerate() {
            in_code ^= line.trim_start().starts_with("```");
            let is_prose = !in_code && !line.trim_start().starts_with(['|', '!', '<']);
            if is_prose && line.chars().count() > MOST_CHARACTERS {
                find(Rule::LongLine, number + 1, line);
            }
        }
    }
    found
}

/// Whether a text begins with whole words.
fn begins_with(text: &str, words: &str) -> bool {
    text.strip_prefix(words).is_some_and(|rest| !rest.starts_with(char::is_alphanumeric))
}

fn csv(counts: &Counts) -> String {
    let mut table = String::from("folder,rule,places\n");
    for ((source, rule), count) in counts {
        writeln!(table, "{source},{rule},{count}").expect("memory takes it");
    }
    table
}

fn parse(table: &str) -> Result<Counts> {
    let row = |line: &str| {
        let mut fields = line.split(',');
        let (source, rule, count) = (fields.next()?, fields.next()?, fields.next()?);
        let rule = Rule::ALL.into_iter().find(|known| known.name() == rule)?;
        Some(((source.to_owned(), rule.name()), count.parse().ok()?))
    };
    let rows = table.lines().skip(1).filter(|line| !line.is_empty());
    rows.map(|line| row(line).with_context(|| format!("not a row of the table: {line}"))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rules(file: &str, text: &str) -> Vec<Rule> {
        findings("docs", Path::new(file), text).into_iter().map(|finding| finding.rule).collect()
    }

    #[test]
    fn each_rule_is_found() {
        let long = "word ".repeat(26);
        assert_eq!(rules("a.rs", "/// Where it is.\nstruct A;\n"), [Rule::Beginning]);
        assert_eq!(rules("a.rs", "/// Wherever it is.\n/// Where it goes on.\nstruct A;\n"), []);
        assert_eq!(rules("a.rs", &format!("//! {long}end.\n")), [Rule::LongSentence]);
        assert_eq!(rules("a.rs", &format!("// {long}end.\n")), []);
        assert_eq!(rules("a.rs", &format!("#[error(\"{long}end\")]\n")), [Rule::LongSentence]);
        assert_eq!(rules("a.md", &format!("Short.\n\n{long}end.\n")), [Rule::LongSentence, Rule::LongLine]);
        assert_eq!(rules("a.md", &format!("```\n{long}{long}\n```\n| {long}{long} |\n")), []);
    }

    #[test]
    fn a_table_comes_back() {
        let counts =
            Counts::from([(("docs".to_owned(), "long line"), 3), (("xtask".to_owned(), "beginning"), 1)]);
        assert_eq!(parse(&csv(&counts)).unwrap(), counts);
        assert!(parse("folder,rule,places\ndocs,no rule,1\n").is_err());
    }
}
