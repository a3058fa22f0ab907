//! Connections: so many at a time, each with a time within which it must say what it wants.

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::sleep;

/// How long a request's headers may take to arrive.
const HEADER_TIME: Duration = Duration::from_secs(20);
/// Largest size of a request's headers in bytes.
const HEADER_BYTES: usize = 16 << 10;
/// How long to wait where no connection can be accepted, as when the process has too many files open.
const RECOVERY: Duration = Duration::from_millis(200);

/// Serves connections for ever. While there are `most`, others wait to be accepted.
pub(crate) async fn serve(listener: TcpListener, router: Router, most: usize) {
    let places = Arc::new(Semaphore::new(most.min(Semaphore::MAX_PERMITS)));
    loop {
        let place = Arc::clone(&places).acquire_owned().await.expect("the semaphore is never closed");
        match listener.accept().await {
            Ok((stream, _)) => drop(tokio::spawn(connection(stream, router.clone(), place))),
            Err(_) => sleep(RECOVERY).await,
        }
    }
}

/// Serves a connection. One that becomes a WebSocket gives its place back: it has a viewer's seat instead.
async fn connection(stream: TcpStream, router: Router, _place: OwnedSemaphorePermit) {
    // A packet must not wait for the next one. Without this it still arrives.
    let _ = stream.set_nodelay(true);
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(HEADER_TIME).max_buf_size(HEADER_BYTES);
    let served =
        http.serve_connection(TokioIo::new(stream), TowerToHyperService::new(router)).with_upgrades();
    // What went wrong, the other side knows.
    let _ = served.await;
}
