//! Connections: so many at a time. Each has a time within which it must say what it wants, and one to take
//! what it is sent.

use crate::stall::Unstalled;
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
/// Time for which the other side of a connection may take nothing of what it is sent. Otherwise downloads
/// that nobody reads would hold all places for ever. With a send buffer as large as the server's, Linux tells
/// of room after 130 to 310 kB were read. In this time a modem reads as much.
pub(crate) const STALL: Duration = Duration::from_secs(90);
/// How long to wait where no connection can be accepted, as when the process has too many files open.
const RECOVERY: Duration = Duration::from_millis(200);

/// Serves connections for ever. While there are `most`, others wait to be accepted. One that takes nothing for as long as
/// `stall`, although something waits for it, is closed.
pub(crate) async fn serve(listener: TcpListener, router: Router, most: usize, stall: Duration) {
    let places = Arc::new(Semaphore::new(most.min(Semaphore::MAX_PERMITS)));
    loop {
        let place = Arc::clone(&places).acquire_owned().await.expect("the semaphore is never closed");
        match listener.accept().await {
            Ok((stream, _)) => drop(tokio::spawn(connection(stream, router.clone(), stall, place))),
            Err(_) => sleep(RECOVERY).await,
        }
    }
}

/// Serves a connection. One that becomes a WebSocket gives its place back: it has a viewer's seat instead.
async fn connection(stream: TcpStream, router: Router, stall: Duration, _place: OwnedSemaphorePermit) {
    // A packet must not wait for the next one. Without this it still arrives.
    let _ = stream.set_nodelay(true);
    // Otherwise the system would go on for minutes to offer what it holds. Where it cannot be told so, that costs only memory.
    let stream = Unstalled::new(stream, stall, |stream: &TcpStream| drop(stream.set_zero_linger()));
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(HEADER_TIME).max_buf_size(HEADER_BYTES);
    let served =
        http.serve_connection(TokioIo::new(stream), TowerToHyperService::new(router)).with_upgrades();
    // What went wrong, the other side knows.
    let _ = served.await;
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::routing::get;
    use std::io::ErrorKind;
    use std::net::{Ipv4Addr, SocketAddr};
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio::time::timeout;

    const LARGE: usize = 64 << 20;

    async fn request(address: SocketAddr, path: &str) -> TcpStream {
        let mut socket = TcpStream::connect(address).await.unwrap();
        let text = format!("GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n");
        socket.write_all(text.as_bytes()).await.unwrap();
        socket
    }

    #[tokio::test]
    async fn a_download_that_nobody_reads_gives_its_place_back() {
        let router = Router::new()
            .route("/large", get(|| async { vec![0u8; LARGE] }))
            .route("/small", get(|| async { "here" }));
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.unwrap();
        let address = listener.local_addr().unwrap();
        tokio::spawn(serve(listener, router, 1, Duration::from_millis(300)));
        let mut stalled = request(address, "/large").await;
        let mut answer = String::new();
        let mut other = request(address, "/small").await;
        let read = timeout(Duration::from_secs(60), other.read_to_string(&mut answer)).await;
        read.expect("the place should have come free").unwrap();
        assert!(answer.ends_with("\r\n\r\nhere"), "{answer}");
        // It was broken off, so that the system too gives up what it has.
        let end = timeout(Duration::from_secs(60), stalled.read_to_end(&mut Vec::new())).await;
        assert_eq!(end.expect("it should be closed").unwrap_err().kind(), ErrorKind::ConnectionReset);
    }
}
