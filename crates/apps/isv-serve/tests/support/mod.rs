//! A server to ask, and streams to serve.
#![allow(dead_code, reason = "each test program uses a part")]

use futures_util::{SinkExt, StreamExt};
use isv_format::{PacketHeader, PacketKind, PacketReader, StreamHeader};
use isv_serve::{Hub, HubLimits, Page, Server, Settings, message};
use std::collections::HashMap;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::{self, Message};
use tokio_tungstenite::{WebSocketStream, client_async};

/// A small page.
pub(crate) fn page() -> Page {
    Page::new(&[
        ("index.html", b"<head></head><script type=\"importmap\">{}</script>"),
        ("src/a.js", b"export {};"),
        ("src/isv.wasm", b"\0asm"),
    ])
}

/// Settings with that page and nothing else.
pub(crate) fn settings() -> Settings {
    Settings { page: page(), ..Settings::default() }
}

/// Settings with a live stream.
pub(crate) fn live(hub: &Arc<Hub>) -> Settings {
    Settings { live: Some(Arc::clone(hub)), ..settings() }
}

/// Serves until the test's runtime ends.
pub(crate) fn start(settings: Settings) -> SocketAddr {
    let server = Server::bind(settings).unwrap();
    let address = server.address();
    tokio::spawn(server.run());
    address
}

/// An answer to a request.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) status: u16,
    /// By names in lower case.
    headers: HashMap<String, String>,
    pub(crate) body: Vec<u8>,
}

impl Answer {
    pub(crate) fn header(&self, name: &str) -> &str {
        self.headers.get(name).map_or("", String::as_str)
    }
}

/// Sends a request as it is written, with these headers and the server's own name as host.
pub(crate) async fn ask(address: SocketAddr, request: &str, headers: &[(&str, &str)]) -> Answer {
    let host = address.to_string();
    ask_as(address, request, &[&[("Host", host.as_str())], headers].concat()).await
}

/// Sends a request with these headers and no others.
pub(crate) async fn ask_as(address: SocketAddr, request: &str, headers: &[(&str, &str)]) -> Answer {
    let headers: String = headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    let text = format!("{request} HTTP/1.1\r\n{headers}Connection: close\r\n\r\n");
    let mut socket = TcpStream::connect(address).await.unwrap();
    socket.write_all(text.as_bytes()).await.unwrap();
    let mut answer = Vec::new();
    socket.read_to_end(&mut answer).await.unwrap();
    let end = answer.windows(4).position(|bytes| bytes == b"\r\n\r\n").expect("headers");
    let head = String::from_utf8(answer[..end].to_vec()).unwrap();
    let mut lines = head.split("\r\n");
    let status = lines.next().unwrap().split(' ').nth(1).unwrap().parse().unwrap();
    let headers = lines.filter_map(|line| line.split_once(": "));
    let headers = headers.map(|(name, value)| (name.to_lowercase(), value.to_owned())).collect();
    Answer { status, headers, body: answer[end + 4..].to_vec() }
}

/// A viewer on the other side of a socket.
pub(crate) struct Watcher {
    pub(crate) socket: WebSocketStream<TcpStream>,
}

impl Watcher {
    pub(crate) async fn join(address: SocketAddr) -> Self {
        Self::try_join(address, None).await.unwrap()
    }

    /// Joins with an origin; the error is the status of the refusal.
    pub(crate) async fn try_join(address: SocketAddr, origin: Option<&str>) -> Result<Self, u16> {
        Self::over(TcpStream::connect(address).await.unwrap(), address, origin).await
    }

    /// Joins with a receive buffer of the least size.
    pub(crate) async fn join_narrow(address: SocketAddr) -> Self {
        let socket = TcpSocket::new_v4().unwrap();
        socket.set_recv_buffer_size(1 << 12).unwrap();
        Self::over(socket.connect(address).await.unwrap(), address, None).await.unwrap()
    }

    async fn over(stream: TcpStream, address: SocketAddr, origin: Option<&str>) -> Result<Self, u16> {
        let mut request = format!("ws://{address}/live").into_client_request().unwrap();
        if let Some(origin) = origin {
            request.headers_mut().insert("Origin", origin.parse().unwrap());
        }
        match client_async(request, stream).await {
            Ok((socket, _)) => Ok(Self { socket }),
            Err(tungstenite::Error::Http(response)) => Err(response.status().as_u16()),
            Err(error) => panic!("{error}"),
        }
    }

    pub(crate) async fn send(&mut self, message: Message) {
        self.socket.send(message).await.unwrap();
    }

    /// The next message that is not the protocol's own; `None` when the connection is over.
    pub(crate) async fn next(&mut self) -> Option<Message> {
        loop {
            match self.socket.next().await {
                Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
                Some(Ok(message)) => return Some(message),
                Some(Err(_)) | None => return None,
            }
        }
    }

    /// The next message, which must be binary.
    pub(crate) async fn next_bytes(&mut self) -> Vec<u8> {
        match self.next().await {
            Some(Message::Binary(bytes)) => bytes.to_vec(),
            other => panic!("{other:?}"),
        }
    }

    /// The next message, which must be a packet: its number, see [`packet`].
    pub(crate) async fn next_packet(&mut self) -> u64 {
        let bytes = self.next_bytes().await;
        assert!(message::is_packet(&bytes), "{bytes:?}");
        number_of(&bytes[9..])
    }

    pub(crate) async fn expect(&mut self, kind: u8) -> Vec<u8> {
        let bytes = self.next_bytes().await;
        assert_eq!(bytes[0], kind, "{bytes:?}");
        bytes
    }
}

/// A hub with a stream that has begun.
pub(crate) fn hub() -> Arc<Hub> {
    let hub = Arc::new(Hub::new(HubLimits::default()));
    hub.start(&stream_header());
    hub
}

pub(crate) fn conformance(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../conformance").join(name)
}

pub(crate) fn stream_header() -> [u8; StreamHeader::BYTES] {
    std::fs::read(conformance("main_inter.isv")).unwrap()[..StreamHeader::BYTES].try_into().unwrap()
}

/// A packet with its number as timestamp and so many bytes of payload; every tenth is a keyframe.
pub(crate) fn packet(number: u64, payload_bytes: usize) -> Vec<u8> {
    let payload: Vec<u8> = (0..payload_bytes as u64).map(|at| (number * 31 + at) as u8).collect();
    let kind = PacketKind::Frame { keyframe: number.is_multiple_of(10), hashed: false, colour: false };
    [&PacketHeader::seal(kind, (number % 10) as u16, number, &payload)[..], &payload].concat()
}

pub(crate) fn publish(hub: &Hub, numbers: std::ops::Range<u64>, payload_bytes: usize) {
    for number in numbers {
        hub.publish(&packet(number, payload_bytes), number.is_multiple_of(10));
    }
}

/// The number of a packet, all of which must be sound.
pub(crate) fn number_of(bytes: &[u8]) -> u64 {
    let header = StreamHeader::parse(&stream_header()).unwrap();
    let packet = PacketReader::at_packet(bytes, 0, &header).next_packet().unwrap().unwrap();
    assert_eq!(packet.total_bytes(), bytes.len());
    packet.header.timestamp_ns
}

/// A stream of such packets, without an end.
pub(crate) fn stream(numbers: std::ops::Range<u64>) -> Vec<u8> {
    let packets: Vec<u8> = numbers.flat_map(|number| packet(number, 50)).collect();
    [&stream_header()[..], &packets].concat()
}
