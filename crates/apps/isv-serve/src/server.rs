//! The server: what it listens at, and what is where.

use crate::ServeError;
use crate::accept;
use crate::files::{self, StreamFiles};
use crate::guard::{Guard, Origin};
use crate::hub::Hub;
use crate::live::{self, Live, LiveLimits};
use crate::page::{self, Offered, Page, PageOptions};
use axum::Router;
use axum::body::Bytes;
use axum::extract::{Request, State};
use axum::http::{HeaderValue, Method, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::Arc;
use tokio::net::{TcpListener, TcpSocket};
use tower_http::cors::CorsLayer;

/// Bytes that the system may hold for a viewer that does not read: about a second of a stream. What is beyond that is late
/// anyway, and is dropped at a keyframe.
const SEND_BUFFER_BYTES: u32 = 256 << 10;
/// Connections beside those of live viewers; a browser opens up to six. Further ones wait. Each may have a file open beside its
/// socket, and a process may often have 1024 of both.
const CONNECTIONS: usize = 400;
/// Connections that may wait to be accepted.
const BACKLOG: u32 = 256;
/// Path of the list of streams.
const STREAMS: &str = "/streams.json";

/// What is served, to whom.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Address to listen at; port 0 is any that is free.
    pub address: SocketAddr,
    /// The page at `/`.
    pub page: Page,
    /// How the page shows what it opens.
    pub page_options: PageOptions,
    /// What is under `/files`.
    pub files: StreamFiles,
    /// Whether `/` opens the first two files side by side; otherwise it opens what is served, or offers it if that is several.
    pub compares: bool,
    /// The stream at `/live`.
    pub live: Option<Arc<Hub>>,
    /// Limits of `/live`.
    pub live_limits: LiveLimits,
    /// Other sites whose pages may watch and read.
    pub allowed_origins: Vec<Origin>,
}

impl Default for Settings {
    /// The player with nothing to play, on this machine only.
    fn default() -> Self {
        Self {
            address: (Ipv4Addr::LOCALHOST, 0).into(),
            page: Page::player(),
            page_options: PageOptions::default(),
            files: StreamFiles::default(),
            compares: false,
            live: None,
            live_limits: LiveLimits::default(),
            allowed_origins: Vec::new(),
        }
    }
}

impl Settings {
    /// The query of the page with the first file, and the second to compare it with.
    fn comparison(&self) -> String {
        page::query(&self.files.urls(), &self.page_options)
    }

    /// All that is served, each on a page of its own.
    fn offered(&self) -> Vec<Offered> {
        let files = self.files.names().zip(self.files.urls());
        let files = files.map(|(name, url)| (name.to_owned(), page::query(&[url], &self.page_options)));
        let live = self.live.iter().map(|_| ("Live".to_owned(), page::live_query(&self.page_options)));
        files.chain(live).map(|(name, href)| Offered { name, href }).collect()
    }

    /// The query that `/` goes on to; nothing where nothing is served.
    fn start(&self) -> Option<String> {
        let mut offered = self.offered();
        match offered.len() {
            0 => None,
            1 => offered.pop().map(|Offered { href, .. }| href),
            _ if self.compares => Some(self.comparison()),
            _ => Some(format!("?list={STREAMS}")),
        }
    }
}

/// A server that listens.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    settings: Settings,
}

impl Server {
    /// Begins to listen; connections wait until [`Self::run`].
    ///
    /// # Errors
    /// [`ServeError::Bind`], as when the port is taken.
    ///
    /// # Panics
    /// Outside a tokio runtime.
    pub fn bind(settings: Settings) -> Result<Self, ServeError> {
        let fail = |cause| ServeError::Bind { address: settings.address, cause };
        let listener = listen(settings.address).map_err(fail)?;
        let address = listener.local_addr().map_err(fail)?;
        Ok(Self { listener, address, settings })
    }

    /// Address at which the server listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Whether other machines can reach it.
    #[must_use]
    pub fn is_open(&self) -> bool {
        !self.address.ip().is_loopback()
    }

    /// The address of the page with the first file, and the second to compare it with.
    #[must_use]
    pub fn comparison_url(&self) -> String {
        format!("{}/{}", self.base_url(), self.settings.comparison())
    }

    /// The address of the page with each file, and with the live stream.
    #[must_use]
    pub fn urls(&self) -> Vec<String> {
        let offered = self.settings.offered().into_iter();
        offered.map(|Offered { href, .. }| format!("{}/{href}", self.base_url())).collect()
    }

    /// The server as this machine reaches it.
    fn base_url(&self) -> String {
        let ip = match self.address.ip() {
            IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
            IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
            ip => ip,
        };
        format!("http://{}", SocketAddr::new(ip, self.address.port()))
    }

    /// Serves until it is dropped.
    pub async fn run(self) {
        let on_loopback = !self.is_open();
        accept::serve(self.listener, router(self.settings, on_loopback), CONNECTIONS, accept::STALL).await;
    }
}

fn listen(address: SocketAddr) -> std::io::Result<TcpListener> {
    let socket = if address.is_ipv4() { TcpSocket::new_v4() } else { TcpSocket::new_v6() }?;
    // A server that was just ended still has the port for a while. Elsewhere than on Unix this would share a port in use.
    #[cfg(unix)]
    socket.set_reuseaddr(true)?;
    // Accepted connections have the listener's.
    socket.set_send_buffer_size(SEND_BUFFER_BYTES)?;
    socket.bind(address)?;
    socket.listen(BACKLOG)
}

fn router(settings: Settings, on_loopback: bool) -> Router {
    let start = settings.start();
    let offered: Bytes = serde_json::to_vec(&settings.offered()).expect("a list of texts").into();
    let json = [(header::CONTENT_TYPE, "application/json"), (header::CACHE_CONTROL, "no-store")];
    let guard = Arc::new(Guard { on_loopback, allowed: settings.allowed_origins });
    let page = Arc::new(settings.page);
    let mut router = Router::new()
        .route(STREAMS, get(async move || (json, offered)))
        .route("/files/{number}/{name}", get(files::serve))
        .with_state(settings.files)
        .fallback(page::serve)
        .with_state(Arc::clone(&page));
    if let Some(query) = start {
        router = router.route("/", get(page::start).with_state((Arc::clone(&page), query.into())));
    }
    if let Some(hub) = settings.live {
        let socket = get(live::watch)
            .with_state(Live::new(hub, settings.live_limits))
            .route_layer(from_fn_with_state(Arc::clone(&guard), own_pages_only));
        router = router.route("/live", socket);
    }
    if !guard.allowed.is_empty() {
        router = router.layer(readable_by(&guard.allowed));
    }
    router
        .layer(from_fn_with_state(guard, known_hosts_only))
        .layer(from_fn_with_state(page, with_security_headers))
}

/// What browsers need to be told so that pages of other sites may read.
fn readable_by(origins: &[Origin]) -> CorsLayer {
    let values = origins.iter().filter_map(|origin| HeaderValue::try_from(origin.to_string()).ok());
    CorsLayer::new()
        .allow_origin(values.collect::<Vec<_>>())
        .allow_methods([Method::GET, Method::HEAD])
        .allow_headers([header::RANGE, header::IF_RANGE, header::IF_NONE_MATCH])
        .expose_headers([header::CONTENT_RANGE, header::ACCEPT_RANGES, header::CONTENT_LENGTH, header::ETAG])
}

async fn own_pages_only(State(guard): State<Arc<Guard>>, request: Request, next: Next) -> Response {
    if guard.allows_origin(request.headers()) {
        return next.run(request).await;
    }
    (StatusCode::FORBIDDEN, "pages of this site may not watch: --allow-origin lets them").into_response()
}

async fn known_hosts_only(State(guard): State<Arc<Guard>>, request: Request, next: Next) -> Response {
    if guard.knows_host(request.headers()) {
        return next.run(request).await;
    }
    (StatusCode::FORBIDDEN, "this server is for this machine only: reach it as localhost").into_response()
}

async fn with_security_headers(State(page): State<Arc<Page>>, request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_SECURITY_POLICY, page.policy());
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    headers.insert("cross-origin-resource-policy", HeaderValue::from_static("same-origin"));
    response
}
