//! `include/isv.h` is what cbindgen makes of the source. `ISV_WRITE_HEADER=1` writes it anew.
//! No call of it lets a panic out.

use std::path::Path;

#[test]
fn the_committed_header_is_that_of_the_source() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).unwrap();
    let bindings = cbindgen::generate_with_config(folder, config).unwrap();
    let mut header = Vec::new();
    bindings.write(&mut header);
    let header = String::from_utf8(header).unwrap();
    assert!(
        header.contains(
            "isv_status isv_writer_push_mesh(struct isv_writer *writer, const struct isv_mesh *mesh);"
        ),
        "{header}"
    );
    let path = folder.join("include/isv.h");
    if std::env::var_os("ISV_WRITE_HEADER").is_some() {
        std::fs::write(&path, &header).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == header,
        "include/isv.h is not that of src: run ISV_WRITE_HEADER=1 cargo test -p isv-capi --test header"
    );
}

/// Calls that only return a number or a text, and run nothing that can panic.
const PLAIN: [&str; 5] =
    ["isv_error_message", "isv_status_name", "isv_version", "isv_version_text", "isv_live_handles"];

#[test]
fn every_call_catches_panics() {
    let mut calls = Vec::new();
    for entry in Path::new(env!("CARGO_MANIFEST_DIR")).join("src").read_dir().unwrap() {
        let source = std::fs::read_to_string(entry.unwrap().path()).unwrap();
        for exported in source.split("#[unsafe(no_mangle)]").skip(1) {
            let name = exported.split("fn ").nth(1).unwrap().split('(').next().unwrap().to_owned();
            let body = exported.split("{\n").nth(1).unwrap().trim_start();
            let is_caught = body.starts_with("call(|| ") || body.starts_with("call_ok(|| ");
            assert!(is_caught || PLAIN.contains(&&*name), "{name}: {body}");
            calls.push(name);
        }
    }
    let header = include_str!("../include/isv.h");
    assert!(calls.len() > 60, "{}", calls.len());
    for name in calls {
        assert!(header.contains(&format!("{name}(")), "isv.h lacks {name}");
    }
}
