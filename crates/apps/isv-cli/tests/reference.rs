//! The reference of the command line, `docs/guide/src/options.md`, is what the commands print for `--help`.

mod support;

use std::fmt::Write;
use std::path::Path;
use support::Workspace;

/// The variable that has the page written anew.
const WRITE: &str = "ISV_WRITE_REFERENCE";
const BEGIN: &str = "# All options

Each command's `--help`. This page is generated: `ISV_WRITE_REFERENCE=1 cargo test -p isv-cli --test reference`.
";

/// What a command prints for `--help`.
fn help(work: &Workspace, command: &[&str]) -> String {
    let run = work.isv(&[command, &["--help"]].concat()).done();
    let text = String::from_utf8(run.stdout().to_vec()).unwrap();
    // The name is that of the file.
    let text = text.replace("isv.exe", "isv");
    text.lines().map(str::trim_end).collect::<Vec<_>>().join("\n").trim_end().to_owned()
}

#[test]
fn the_page_is_what_the_commands_print() {
    let work = Workspace::new();
    let all = help(&work, &[]);
    let listed = all.split("Commands:\n").nth(1).unwrap().lines().take_while(|line| !line.is_empty());
    let names: Vec<&str> = listed
        .filter_map(|line| line.strip_prefix("  ").filter(|line| !line.starts_with(' ')))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    assert!(names.len() > 15 && names.contains(&"encode"), "{names:?}");
    let mut page = BEGIN.to_owned();
    for name in names {
        write!(page, "\n## isv {name}\n\n```text\n{}\n```\n", help(&work, &[name])).unwrap();
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../docs/guide/src/options.md");
    if std::env::var_os(WRITE).is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(written == page, "options.md is not what the commands print: run this test with {WRITE}=1");
}
