//! The WebSocket of a live stream.

use crate::hub::{Hub, Viewer};
use crate::message::{self, CLOCK_QUESTION_BYTES};
use crate::token_bucket::TokenBucket;
use axum::body::Bytes;
use axum::extract::State;
use axum::extract::ws::{CloseFrame, Message, WebSocket, WebSocketUpgrade, close_code};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{MissedTickBehavior, interval, timeout};

/// Largest message taken from a viewer in bytes: the time takes 8, and a ping or its answer may have 125.
const LARGEST_QUESTION: usize = 125;
/// Read buffer of a connection in bytes. Questions are short, and there are many connections.
const READ_BUFFER_BYTES: usize = 512;
/// Messages a viewer may send at once, and how long it takes until it may send another.
const QUESTIONS: (u32, Duration) = (20, Duration::from_millis(250));

/// What viewers may ask of the server.
#[derive(Clone, Copy, Debug)]
pub struct LiveLimits {
    /// Viewers at a time; further ones are refused with status 503.
    pub viewers: usize,
    /// How long a message may wait for a viewer that does not read, before it is cut off.
    pub patience: Duration,
    /// A viewer from which nothing was heard for twice this time, although it was asked, is gone.
    pub ping: Duration,
}

impl Default for LiveLimits {
    fn default() -> Self {
        Self { viewers: 100, patience: Duration::from_secs(10), ping: Duration::from_secs(15) }
    }
}

/// A live stream and who may watch it.
#[derive(Clone, Debug)]
pub(crate) struct Live {
    hub: Arc<Hub>,
    limits: LiveLimits,
    seats: Arc<Semaphore>,
}

impl Live {
    pub(crate) fn new(hub: Arc<Hub>, limits: LiveLimits) -> Self {
        let seats = Arc::new(Semaphore::new(limits.viewers.min(Semaphore::MAX_PERMITS)));
        Self { hub, limits, seats }
    }
}

/// `GET /live`, after its origin was checked.
pub(crate) async fn watch(State(live): State<Live>, upgrade: WebSocketUpgrade) -> Response {
    let Ok(seat) = Arc::clone(&live.seats).try_acquire_owned() else {
        let headers = [(header::RETRY_AFTER, "10")];
        return (StatusCode::SERVICE_UNAVAILABLE, headers, "all seats are taken").into_response();
    };
    upgrade
        .max_message_size(LARGEST_QUESTION)
        .max_frame_size(LARGEST_QUESTION)
        .read_buffer_size(READ_BUFFER_BYTES)
        // A message is written at once. The library copies it, and keeps the room of the largest for each viewer.
        .write_buffer_size(0)
        .on_upgrade(move |socket| Connection::new(socket, &live, seat).run())
}

/// A viewer's connection.
struct Connection {
    socket: WebSocket,
    viewer: Viewer,
    limits: LiveLimits,
    bucket: TokenBucket,
    heard: Instant,
    _seat: OwnedSemaphorePermit,
}

/// Why a connection is over.
enum Over {
    /// The viewer left, cannot be reached, or does not read.
    Gone,
    /// The viewer sent what it should not.
    Refused(&'static str),
    /// The viewer has all of a stream that has ended for good.
    Finished,
}

impl Connection {
    fn new(socket: WebSocket, live: &Live, seat: OwnedSemaphorePermit) -> Self {
        let now = Instant::now();
        let bucket = TokenBucket::new(QUESTIONS.0, QUESTIONS.1, now);
        Self { socket, viewer: live.hub.join(), limits: live.limits, bucket, heard: now, _seat: seat }
    }

    async fn run(mut self) {
        let Err(over) = self.serve().await else { return };
        let (code, reason) = match over {
            Over::Gone => return,
            Over::Refused(reason) => (close_code::POLICY, reason),
            Over::Finished => (close_code::NORMAL, "the stream has ended"),
        };
        let frame = CloseFrame { code, reason: reason.into() };
        // The connection is dropped after this, whether the words arrive or not.
        let _ = self.send(Message::Close(Some(frame))).await;
    }

    async fn serve(&mut self) -> Result<(), Over> {
        let mut ping = interval(self.limits.ping);
        ping.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                message = self.viewer.next() => {
                    self.send(Message::Binary(message)).await?;
                    if self.viewer.is_over() {
                        return Err(Over::Finished);
                    }
                }
                question = self.socket.recv() => match question {
                    Some(Ok(question)) => self.answer(question).await?,
                    Some(Err(_)) | None => return Err(Over::Gone),
                },
                _ = ping.tick() => {
                    if self.heard.elapsed() > 2 * self.limits.ping {
                        return Err(Over::Gone);
                    }
                    self.send(Message::Ping(Bytes::new())).await?;
                }
            }
        }
    }

    async fn answer(&mut self, question: Message) -> Result<(), Over> {
        self.heard = Instant::now();
        if !self.bucket.take(self.heard) {
            return Err(Over::Refused("too many messages"));
        }
        match question {
            Message::Binary(bytes) => match <&[u8; CLOCK_QUESTION_BYTES]>::try_from(&bytes[..]) {
                Ok(question) => {
                    self.send(Message::Binary(message::clock(message::unix_ms(), question))).await
                }
                Err(_) => Err(Over::Refused("a viewer sends nothing but 8 bytes")),
            },
            Message::Text(_) => Err(Over::Refused("a viewer sends nothing but 8 bytes")),
            // Answered by the protocol itself.
            Message::Ping(_) | Message::Pong(_) => Ok(()),
            Message::Close(_) => Err(Over::Gone),
        }
    }

    async fn send(&mut self, message: Message) -> Result<(), Over> {
        match timeout(self.limits.patience, self.socket.send(message)).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(_)) | Err(_) => Err(Over::Gone),
        }
    }
}
