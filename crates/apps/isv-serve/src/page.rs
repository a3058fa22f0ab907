//! The player's page and everything that it loads, embedded at compile time.

use crate::policy;
use crate::url::query_value;
use axum::extract::{Request, State};
use axum::http::{HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::sync::Arc;

/// Path in `player/` and contents, in order of paths; made by `build.rs`.
static EMBEDDED: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/player_files.rs"));

const INDEX: &str = "index.html";
/// The script of an exported page that names what to open.
const START: &str = "start.js";

/// The files of a page, by path.
#[derive(Clone, Debug)]
pub struct Page {
    files: &'static [(&'static str, &'static [u8])],
    policy: HeaderValue,
}

impl Page {
    /// The player.
    #[must_use]
    pub fn player() -> Self {
        Self::new(EMBEDDED)
    }

    /// Other files, of which `index.html` is the page.
    #[must_use]
    pub fn new(files: &'static [(&'static str, &'static [u8])]) -> Self {
        let index = files.iter().find(|(path, _)| *path == INDEX).map_or(&b""[..], |(_, bytes)| bytes);
        let policy = policy::for_page(&String::from_utf8_lossy(index));
        Self { files, policy: HeaderValue::try_from(policy).expect("a policy is ASCII") }
    }

    /// Path, with slashes, and contents of each file.
    #[must_use]
    pub fn files(&self) -> &'static [(&'static str, &'static [u8])] {
        self.files
    }

    /// Files as they are to be put on a host without this server. The page then opens `streams`, the first
    /// and one to compare it with, unless its address says otherwise. They are paths of URLs relative to the
    /// page.
    #[must_use]
    pub fn export(&self, streams: &[String], options: &PageOptions) -> Vec<(&'static str, Vec<u8>)> {
        let mut files: Vec<_> = self.files.iter().map(|(path, bytes)| (*path, bytes.to_vec())).collect();
        if !streams.is_empty() || *options != PageOptions::default() {
            for (_, bytes) in files.iter_mut().filter(|(path, _)| *path == INDEX) {
                let text = String::from_utf8_lossy(bytes);
                // First of all: whatever reads the address comes after it.
                let tag = format!("<head>\n    <script src=\"{START}\"></script>");
                *bytes = text.replacen("<head>", &tag, 1).into_bytes();
            }
            files.push((START, start_script(streams, options).into_bytes()));
        }
        files
    }

    /// What the page may do, as a `Content-Security-Policy`.
    pub(crate) fn policy(&self) -> HeaderValue {
        self.policy.clone()
    }

    fn find(&self, path: &str) -> Option<(&'static str, &'static [u8])> {
        let path = if path.is_empty() { INDEX } else { path };
        self.files.iter().find(|(known, _)| *known == path).copied()
    }
}

/// What the page's address says beside what it opens.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PageOptions {
    /// The axis that points up: `y`, `z`, `x`, `-y`, `-z` or `-x`. Without it Y is.
    pub up: Option<&'static str>,
    /// Bytes that the player's decoders may take. Without it the player goes by the machine.
    pub max_memory: Option<u64>,
}

impl PageOptions {
    /// Terms of a query.
    fn terms(&self) -> impl Iterator<Item = String> {
        let up = self.up.map(|up| format!("up={up}"));
        let memory = self.max_memory.map(|bytes| format!("max-memory={bytes}"));
        [up, memory].into_iter().flatten()
    }
}

/// The query with which the page opens a stream, and perhaps another to compare it with.
pub(crate) fn query(streams: &[String], options: &PageOptions) -> String {
    let named = streams.iter().zip(["src", "compare"]);
    let named = named.map(|(url, name)| format!("{name}={}", query_value(url)));
    format!("?{}", named.chain(options.terms()).collect::<Vec<_>>().join("&"))
}

/// The query with which the page opens the live stream.
pub(crate) fn live_query(options: &PageOptions) -> String {
    let live = std::iter::once("live=/live".to_owned());
    format!("?{}", live.chain(options.terms()).collect::<Vec<_>>().join("&"))
}

/// A stream that the page offers.
#[derive(Debug, Serialize)]
pub(crate) struct Offered {
    pub(crate) name: String,
    /// The query with which the page opens it.
    pub(crate) href: String,
}

/// Runs before the page's modules, which read the address. Nothing in a query needs an escape in a string. From a disk the address
/// cannot be changed.
fn start_script(streams: &[String], options: &PageOptions) -> String {
    let query = query(streams, options);
    format!(
        r#"// What the page opens, and how, where its address does not say.
if (location.protocol !== "file:") {{
  const usual = "{query}";
  const asked = new URLSearchParams(location.search);
  const missing = new URLSearchParams(usual);
  if (asked.has("src") || asked.has("live")) for (const name of ["src", "compare"]) missing.delete(name);
  for (const name of asked.keys()) missing.delete(name);
  const search = location.search.length > 1 ? `${{location.search}}&${{missing}}` : usual;
  if (String(missing)) history.replaceState(null, "", search + location.hash);
}}
"#
    )
}

/// `GET` and `HEAD` of the page itself: opens what is served, unless the address says what to open.
pub(crate) async fn start(State((page, query)): State<(Arc<Page>, Arc<str>)>, request: Request) -> Response {
    let asked = request.uri().query().unwrap_or_default();
    let opens = |term: &str| ["src=", "live=", "list="].iter().any(|name| term.starts_with(name));
    if asked.split('&').any(opens) {
        return serve(State(page), request).await;
    }
    let join = if asked.is_empty() { "" } else { "&" };
    let headers =
        [(header::LOCATION, format!("{query}{join}{asked}")), (header::CACHE_CONTROL, "no-store".into())];
    (StatusCode::TEMPORARY_REDIRECT, headers).into_response()
}

/// `GET` and `HEAD` of everything else than files and the live socket.
pub(crate) async fn serve(State(page): State<Arc<Page>>, request: Request) -> Response {
    if !matches!(*request.method(), Method::GET | Method::HEAD) {
        return (StatusCode::METHOD_NOT_ALLOWED, [(header::ALLOW, "GET, HEAD")]).into_response();
    }
    let Some((path, bytes)) = page.find(request.uri().path().trim_start_matches('/')) else {
        return (StatusCode::NOT_FOUND, "no such page").into_response();
    };
    let tag = tag_of(bytes);
    let headers = [(header::CACHE_CONTROL, "no-cache"), (header::ETAG, &tag)];
    if request.headers().get(header::IF_NONE_MATCH).is_some_and(|known| known == tag.as_str()) {
        return (StatusCode::NOT_MODIFIED, headers).into_response();
    }
    (headers, [(header::CONTENT_TYPE, content_type(path))], bytes).into_response()
}

fn tag_of(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    let hex = digest[..8].iter().fold(String::new(), |mut hex, byte| {
        write!(hex, "{byte:02x}").expect("memory");
        hex
    });
    format!("\"{hex}\"")
}

fn content_type(path: &str) -> &'static str {
    match path.rsplit_once('.').map_or("", |(_, kind)| kind) {
        "html" => "text/html; charset=utf-8",
        "js" | "mjs" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "json" | "map" => "application/json",
        "wasm" => "application/wasm",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "ico" => "image/x-icon",
        _ => "text/plain; charset=utf-8",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exported_page_opens_its_streams() {
        let page = Page::new(&[("index.html", b"<head><title>isv</title></head>"), ("src/a.js", b"1")]);
        assert_eq!(
            page.export(&[], &PageOptions::default()),
            [("index.html", page.files()[0].1.to_vec()), ("src/a.js", b"1".to_vec())]
        );
        let options = PageOptions { up: Some("-y"), max_memory: Some(7) };
        let files = page.export(&["files/0/a%20b.isv".to_owned(), "files/1/\"c.isv".to_owned()], &options);
        let text = |at: usize| String::from_utf8(files[at].1.clone()).unwrap();
        assert_eq!(text(0), "<head>\n    <script src=\"start.js\"></script><title>isv</title></head>");
        assert_eq!(files[2].0, "start.js");
        let query = "\"?src=files/0/a%2520b.isv&compare=files/1/%22c.isv&up=-y&max-memory=7\"";
        assert!(text(2).contains(query), "{}", text(2));
    }
}
