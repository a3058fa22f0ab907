//! The files given by name, each under `/files/N/NAME`.
//!
//! No path is made from what a browser sends: N counts the files, and NAME must be that file's own name.

use crate::ServeError;
use crate::range::{Selected, select};
use crate::url::segment;
use axum::body::Body;
use axum::extract::{Path as UrlPath, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::fs::Metadata;
use std::io::SeekFrom;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::UNIX_EPOCH;
use tokio::fs::File;
use tokio::io::{AsyncReadExt, AsyncSeekExt};
use tokio_util::io::ReaderStream;

/// Bytes that are read from a file at a time.
const CHUNK_BYTES: usize = 1 << 16;

/// Files to be served.
#[derive(Clone, Debug, Default)]
pub struct StreamFiles {
    files: Arc<[StreamFile]>,
}

#[derive(Debug)]
struct StreamFile {
    /// Absolute.
    path: PathBuf,
    /// Last part of the path, as text.
    name: String,
}

impl StreamFiles {
    /// These files, in this order. A file is opened anew for each request, so one that grows or is replaced is served as it is
    /// then.
    ///
    /// # Errors
    /// [`ServeError::NoName`] for a path that ends in none.
    pub fn new<P: AsRef<Path>>(paths: impl IntoIterator<Item = P>) -> Result<Self, ServeError> {
        let files = paths.into_iter().map(|path| StreamFile::new(path.as_ref())).collect::<Result<_, _>>()?;
        Ok(Self { files })
    }

    /// The path of each file's URL.
    #[must_use]
    pub fn urls(&self) -> Vec<String> {
        let url = |(number, file): (usize, &StreamFile)| format!("/files/{number}/{}", segment(&file.name));
        self.files.iter().enumerate().map(url).collect()
    }

    /// The name of each file.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.files.iter().map(|file| file.name.as_str())
    }

    fn find(&self, number: &str, name: &str) -> Option<&StreamFile> {
        let at: usize = number.parse().ok()?;
        self.files.get(at).filter(|file| file.name == name && at.to_string() == number)
    }
}

impl StreamFile {
    fn new(path: &Path) -> Result<Self, ServeError> {
        let name = path.file_name().ok_or_else(|| ServeError::NoName { path: path.to_owned() })?;
        let name = name.to_string_lossy().into_owned();
        let path =
            std::path::absolute(path).map_err(|cause| ServeError::File { path: path.to_owned(), cause })?;
        Ok(Self { path, name })
    }
}

/// `GET` and `HEAD` of `/files/N/NAME`.
pub(crate) async fn serve(
    State(files): State<StreamFiles>,
    UrlPath((number, name)): UrlPath<(String, String)>,
    headers: HeaderMap,
) -> Response {
    let Some(file) = files.find(&number, &name) else {
        return (StatusCode::NOT_FOUND, "no such file is served").into_response();
    };
    match respond(&file.path, &headers).await {
        Ok(response) => response,
        Err(_) => (StatusCode::NOT_FOUND, "this file cannot be read now").into_response(),
    }
}

/// The file as long as it is now, or the part of it that is asked for.
async fn respond(path: &Path, asked: &HeaderMap) -> std::io::Result<Response> {
    let mut file = File::open(path).await?;
    let metadata = file.metadata().await?;
    let (length, tag) = (metadata.len(), tag_of(&metadata));
    let text = |name| asked.get(name).and_then(|value| value.to_str().ok());
    // A date would be another validator; a request that has one is answered as if the file had changed.
    let is_current = text(header::IF_RANGE).is_none_or(|known| known == tag);
    let (status, part) = match select(text(header::RANGE).filter(|_| is_current), length) {
        Selected::Whole => (StatusCode::OK, 0..length),
        Selected::Part(part) => (StatusCode::PARTIAL_CONTENT, part),
        Selected::Unsatisfiable => (StatusCode::RANGE_NOT_SATISFIABLE, 0..0),
    };
    file.seek(SeekFrom::Start(part.start)).await?;
    let part_bytes = part.end - part.start;
    let body = Body::from_stream(ReaderStream::with_capacity(file.take(part_bytes), CHUNK_BYTES));
    let mut response = (status, body).into_response();
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/octet-stream"));
    headers.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
    // A browser's cache of parts of a file that may grow only gets in the way.
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.insert(header::CONTENT_LENGTH, part_bytes.into());
    headers.insert(header::ETAG, HeaderValue::try_from(tag).expect("hexadecimal digits"));
    let content_range = match status {
        StatusCode::PARTIAL_CONTENT => format!("bytes {}-{}/{length}", part.start, part.end - 1),
        StatusCode::RANGE_NOT_SATISFIABLE => format!("bytes */{length}"),
        _ => return Ok(response),
    };
    headers.insert(header::CONTENT_RANGE, HeaderValue::try_from(content_range).expect("digits"));
    Ok(response)
}

/// An `ETag` that changes when the file does: its length and when it was last written.
fn tag_of(metadata: &Metadata) -> String {
    let written = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
    format!("\"{:x}-{:x}\"", metadata.len(), written.unwrap_or_default().as_nanos())
}
