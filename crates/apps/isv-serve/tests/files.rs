//! Files and the page over HTTP.

mod support;

use isv_serve::{Page, PageOptions, Server, Settings, StreamFiles};
use std::fs;
use std::io::Write;
use std::net::SocketAddr;
use support::{ask, settings, start};
use tempfile::TempDir;

const TEXT: &[u8] = b"0123456789";

/// A server of ten bytes.
fn ten_bytes() -> (TempDir, SocketAddr) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("take.isv");
    fs::write(&path, TEXT).unwrap();
    fs::write(folder.path().join("secret.isv"), "secret").unwrap();
    let address = start(Settings { files: StreamFiles::new([path]).unwrap(), ..settings() });
    (folder, address)
}

#[tokio::test]
async fn a_file_comes_whole() {
    let (_folder, address) = ten_bytes();
    let answer = ask(address, "GET /files/0/take.isv", &[]).await;
    assert_eq!((answer.status, &answer.body[..]), (200, TEXT));
    for (name, value) in [
        ("content-type", "application/octet-stream"),
        ("content-length", "10"),
        ("accept-ranges", "bytes"),
        ("cache-control", "no-store"),
        ("content-range", ""),
        ("x-content-type-options", "nosniff"),
        ("cross-origin-resource-policy", "same-origin"),
        ("access-control-allow-origin", ""),
    ] {
        assert_eq!(answer.header(name), value, "{name}");
    }
}

#[tokio::test]
async fn parts_of_a_file_are_what_was_asked_for() {
    let (_folder, address) = ten_bytes();
    for (range, status, content_range, body) in [
        ("bytes=0-0", 206, "bytes 0-0/10", "0"),
        ("bytes=2-5", 206, "bytes 2-5/10", "2345"),
        ("bytes=7-", 206, "bytes 7-9/10", "789"),
        ("bytes=7-99", 206, "bytes 7-9/10", "789"),
        ("bytes=-3", 206, "bytes 7-9/10", "789"),
        ("bytes=-99", 206, "bytes 0-9/10", "0123456789"),
        ("bytes=10-", 416, "bytes */10", ""),
        ("bytes=-0", 416, "bytes */10", ""),
        ("bytes=5-2", 200, "", "0123456789"),
        ("bytes=0-1,5-6", 200, "", "0123456789"),
        ("nonsense", 200, "", "0123456789"),
    ] {
        let answer = ask(address, "GET /files/0/take.isv", &[("Range", range)]).await;
        assert_eq!((answer.status, answer.header("content-range")), (status, content_range), "{range}");
        assert_eq!(String::from_utf8(answer.body.clone()).unwrap(), body, "{range}");
        assert_eq!(answer.header("content-length"), body.len().to_string(), "{range}");
        let head = ask(address, "HEAD /files/0/take.isv", &[("Range", range)]).await;
        assert_eq!((head.status, head.header("content-range")), (status, content_range), "{range}");
        assert_eq!(
            (head.header("content-length"), head.body.len()),
            (answer.header("content-length"), 0),
            "{range}"
        );
    }
}

#[tokio::test]
async fn a_part_of_a_file_that_changed_is_the_whole_new_one() {
    let (folder, address) = ten_bytes();
    let ask_part = async |tag: &str| {
        let headers = [("Range", "bytes=2-3"), ("If-Range", tag)];
        ask(address, "GET /files/0/take.isv", &headers).await
    };
    let tag = ask(address, "HEAD /files/0/take.isv", &[]).await.header("etag").to_owned();
    assert!(tag.starts_with('"') && tag.ends_with('"'), "{tag}");
    assert_eq!(ask_part(&tag).await.status, 206);
    assert_eq!(ask_part("\"other\"").await.status, 200);
    assert_eq!(ask_part("Wed, 21 Oct 2015 07:28:00 GMT").await.status, 200);
    fs::write(folder.path().join("take.isv"), "another").unwrap();
    let answer = ask_part(&tag).await;
    assert_eq!((answer.status, &answer.body[..]), (200, &b"another"[..]));
    assert_ne!(answer.header("etag"), tag);
}

#[tokio::test]
async fn a_file_that_grows_is_as_long_as_it_is() {
    let (folder, address) = ten_bytes();
    let path = folder.path().join("take.isv");
    fs::OpenOptions::new().append(true).open(&path).unwrap().write_all(b"ab").unwrap();
    let answer = ask(address, "GET /files/0/take.isv", &[("Range", "bytes=9-")]).await;
    assert_eq!((answer.header("content-range"), &answer.body[..]), ("bytes 9-11/12", &b"9ab"[..]));
    fs::remove_file(path).unwrap();
    assert_eq!(ask(address, "GET /files/0/take.isv", &[]).await.status, 404);
}

#[tokio::test]
async fn only_the_files_given_are_served() {
    let (_folder, address) = ten_bytes();
    for path in [
        "/files/0/secret.isv",
        "/files/1/take.isv",
        "/files/00000000000000000000000000/take.isv",
        "/files/-0/take.isv",
        "/files/0/",
        "/files/0",
        "/files/",
        "/files/0/../0/take.isv",
        "/files/0/../..",
        "/files/0/..",
        "/files/0/%2e%2e",
        "/files/0/%2e%2e/0/take.isv",
        "/files/0/..%2fsecret.isv",
        "/files/0/%2e%2e%2fsecret.isv",
        "/files/0/..%5csecret.isv",
        "/files/0/./take.isv",
        "/files/0//take.isv",
        "/files/0/take.isv/",
        "/files/0/take.isv%00",
        "/files/0/%ff",
        "/files/0/TAKE.isv",
        "/../Cargo.toml",
        "/..%2fCargo.toml",
        "//etc/passwd",
        "/src/../../Cargo.toml",
        "/src/",
        "/src",
        "/live",
    ] {
        let answer = ask(address, &format!("GET {path}"), &[]).await;
        assert!(matches!(answer.status, 400 | 404), "{path}: {}", answer.status);
        assert!(!String::from_utf8_lossy(&answer.body).contains("secret"), "{path}");
        assert_eq!(answer.header("x-content-type-options"), "nosniff", "{path}");
    }
    for method in ["POST", "PUT", "DELETE"] {
        for path in ["/files/0/take.isv", "/", "/src/a.js"] {
            assert_eq!(ask(address, &format!("{method} {path}"), &[]).await.status, 405, "{method} {path}");
        }
    }
}

#[tokio::test]
async fn any_name_can_be_reached_by_its_url() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["a b.isv", "100%.isv", "50%25.isv", "größe?.isv", "a&b=c#d.isv", "\"quoted\".isv"];
    let paths: Vec<_> = names.iter().map(|name| folder.path().join(name)).collect();
    for (path, name) in paths.iter().zip(names) {
        fs::write(path, name).unwrap();
    }
    let files = StreamFiles::new(&paths).unwrap();
    let urls = files.urls();
    assert_eq!(urls[0], "/files/0/a%20b.isv");
    let address = start(Settings { files, ..settings() });
    for (url, name) in urls.iter().zip(names) {
        let answer = ask(address, &format!("GET {url}"), &[]).await;
        assert_eq!(String::from_utf8(answer.body).unwrap(), name, "{url}");
    }
    assert!(StreamFiles::new(["/"]).is_err());
}

#[tokio::test]
async fn links_name_what_is_served() {
    let files = StreamFiles::new(["take.isv", "50%.isv"]).unwrap();
    let server = Server::bind(Settings { files, live: Some(support::hub()), ..settings() }).unwrap();
    let base = format!("http://{}/", server.address());
    assert!(!server.is_open());
    assert_eq!(server.comparison_url(), format!("{base}?src=/files/0/take.isv&compare=/files/1/50%2525.isv"));
    let queries = ["?src=/files/0/take.isv", "?src=/files/1/50%2525.isv", "?live=/live"];
    assert_eq!(server.urls(), queries.map(|query| format!("{base}{query}")));
    let taken = Server::bind(Settings { address: server.address(), ..settings() }).unwrap_err().to_string();
    assert!(
        taken.contains(&server.address().to_string()) && taken.ends_with("another address or port"),
        "{taken}"
    );
}

#[tokio::test]
async fn the_page_is_served_with_its_types_and_its_policy() {
    let (_folder, address) = ten_bytes();
    for (path, kind) in [
        ("/?src=/files/0/take.isv", "text/html; charset=utf-8"),
        ("/index.html", "text/html; charset=utf-8"),
        ("/src/a.js", "text/javascript; charset=utf-8"),
        ("/src/isv.wasm", "application/wasm"),
    ] {
        let answer = ask(address, &format!("GET {path}"), &[]).await;
        assert_eq!((answer.status, answer.header("content-type")), (200, kind), "{path}");
        assert_eq!(answer.header("cache-control"), "no-cache");
        let policy = answer.header("content-security-policy");
        assert!(
            policy.starts_with("default-src 'none'; script-src 'self' 'wasm-unsafe-eval' 'sha256-"),
            "{policy}"
        );
        assert!(policy.contains("media-src blob:"), "sound: {policy}");
        let known = [("If-None-Match", answer.header("etag"))];
        let again = ask(address, &format!("GET {path}"), &known).await;
        assert_eq!((again.status, again.body.len()), (304, 0), "{path}");
        let head = ask(address, &format!("HEAD {path}"), &[]).await;
        assert_eq!((head.status, head.body.len()), (200, 0), "{path}");
        assert_eq!(head.header("content-length"), answer.body.len().to_string(), "{path}");
    }
}

/// What `/` with a query goes on to; empty where it is the page itself.
async fn goes_to(address: SocketAddr, query: &str) -> String {
    let answer = ask(address, &format!("GET /{query}"), &[]).await;
    let to = answer.header("location").to_owned();
    assert_eq!(answer.status, if to.is_empty() { 200 } else { 307 });
    to
}

#[tokio::test]
async fn the_address_alone_opens_what_is_served() {
    let (folder, address) = ten_bytes();
    assert_eq!(goes_to(address, "").await, "?src=/files/0/take.isv");
    assert_eq!(goes_to(address, "?view=normals").await, "?src=/files/0/take.isv&view=normals");
    for named in ["?src=other.isv", "?view=bits&live=/live", "?list=/streams.json"] {
        assert_eq!(goes_to(address, named).await, "", "{named}");
    }
    assert_eq!(goes_to(start(settings()), "").await, "", "with nothing to open the page asks for a file");
    let files = StreamFiles::new(["take.isv", "secret.isv"].map(|name| folder.path().join(name))).unwrap();
    let page_options = PageOptions { up: Some("-y"), max_memory: Some(1 << 30) };
    let two = Settings { files, page_options, live: Some(support::hub()), ..settings() };
    let compared = start(Settings { compares: true, ..two.clone() });
    let expected = "?src=/files/0/take.isv&compare=/files/1/secret.isv&up=-y&max-memory=1073741824";
    assert_eq!(goes_to(compared, "").await, expected);
    let offered = start(two);
    assert_eq!(goes_to(offered, "").await, "?list=/streams.json");
    let list = ask(offered, "GET /streams.json", &[]).await;
    assert_eq!((list.status, list.header("content-type")), (200, "application/json"));
    let list: serde_json::Value = serde_json::from_slice(&list.body).unwrap();
    let end = "&up=-y&max-memory=1073741824";
    let entry = |name: &str, query: &str| serde_json::json!({"name": name, "href": format!("{query}{end}")});
    let names = [
        entry("take.isv", "?src=/files/0/take.isv"),
        entry("secret.isv", "?src=/files/1/secret.isv"),
        entry("Live", "?live=/live"),
    ];
    assert_eq!(list, serde_json::Value::from(names.to_vec()));
}

/// What a module or a page of the player names with a relative path.
fn references(path: &str, text: &str) -> Vec<String> {
    let folder = path.rsplit_once('/').map_or("", |(folder, _)| folder);
    let quoted = text.split(['"', '\'', '`']).skip(1);
    let is_path = |part: &&str| {
        let kinds = [".js", ".css", ".wasm"];
        let is_relative = part.starts_with("./") || part.starts_with("../");
        // In the page any path is one of a file, but for the names that its import map gives to modules.
        let is_named = path.ends_with(".html") && !part.starts_with("three/");
        (is_relative || is_named)
            && kinds.iter().any(|kind| part.ends_with(kind))
            && !part.contains([' ', '\n', '(', '*'])
    };
    let resolve = |part: &str| {
        let mut place: Vec<_> = folder.split('/').filter(|step| !step.is_empty()).collect();
        for step in part.split('/') {
            match step {
                "." => {}
                ".." => drop(place.pop()),
                step => place.push(step),
            }
        }
        place.join("/")
    };
    quoted.filter(is_path).map(resolve).collect()
}

#[test]
fn all_that_the_player_loads_is_embedded_and_nothing_of_its_tests() {
    let files = Page::player().files();
    let has = |path: &str| files.iter().any(|(known, _)| *known == path);
    let mut found = 0;
    for (path, bytes) in files.iter().filter(|(path, _)| path.ends_with(".js") || path.ends_with(".html")) {
        if path.starts_with("vendor/three/three.") {
            continue;
        }
        for reference in references(path, std::str::from_utf8(bytes).unwrap()) {
            found += 1;
            // Addons import three by its name; three's own files import each other.
            assert!(has(&reference), "{path} names {reference}");
        }
    }
    assert!(found > 20, "{found} references");
    for path in
        ["index.html", "style.css", "src/isv.wasm", "vendor/three/three.core.min.js", "vendor/three/LICENSE"]
    {
        assert!(has(path), "{path}");
    }
    for (path, _) in files {
        assert!(
            !path.contains("node_modules") && !path.contains("test") && !path.ends_with(".json"),
            "{path}"
        );
    }
}
