//! Connections whose other side takes nothing are given up.

use std::future::Future;
use std::io::{self, IoSlice};
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep, sleep};

/// A connection that fails with [`io::ErrorKind::TimedOut`] when something has waited to be written for so long that nothing of
/// it was taken. Whoever takes some now and then may be as slow as they like.
#[derive(Debug)]
pub(crate) struct Unstalled<S> {
    stream: S,
    limit: Duration,
    /// Runs out so long after the write that waits began to wait.
    timer: Pin<Box<Sleep>>,
    /// Whether a write waits.
    waits: bool,
    /// Told of the stream before it fails.
    give_up: fn(&S),
}

impl<S> Unstalled<S> {
    pub(crate) fn new(stream: S, limit: Duration, give_up: fn(&S)) -> Self {
        Self { stream, limit, timer: Box::pin(sleep(limit)), waits: false, give_up }
    }

    /// What an attempt to write gives, unless it waits and has waited for too long.
    fn watched(
        &mut self,
        context: &mut Context<'_>,
        written: Poll<io::Result<usize>>,
    ) -> Poll<io::Result<usize>> {
        if written.is_ready() {
            self.waits = false;
            return written;
        }
        if !std::mem::replace(&mut self.waits, true) {
            self.timer.as_mut().reset(Instant::now() + self.limit);
        }
        ready!(self.timer.as_mut().poll(context));
        (self.give_up)(&self.stream);
        Poll::Ready(Err(io::ErrorKind::TimedOut.into()))
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Unstalled<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, buffer)
    }
}

/// Only writes are watched: to flush or to shut down a socket never waits.
impl<S: AsyncWrite + Unpin> AsyncWrite for Unstalled<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.watched(context, written)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write_vectored(context, slices);
        self.watched(context, written)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::{AsyncReadExt, AsyncWriteExt, duplex};

    const LIMIT: Duration = Duration::from_secs(60);

    /// A byte every 50 s is enough; after the last one the write fails, and not before the limit.
    #[tokio::test(start_paused = true)]
    async fn whoever_takes_a_byte_now_and_then_is_waited_for_and_nobody_else() {
        let (mut reader, writer) = duplex(1);
        let mut writer = Unstalled::new(writer, LIMIT, |_| ());
        let begin = Instant::now();
        let write = tokio::spawn(async move { (writer.write_all(&[7; 100]).await, Instant::now()) });
        let pause = Duration::from_secs(50);
        for _ in 0..10 {
            sleep(pause).await;
            reader.read_u8().await.unwrap();
        }
        let (result, end) = write.await.unwrap();
        assert_eq!(result.unwrap_err().kind(), io::ErrorKind::TimedOut);
        let stalled = (end - begin).saturating_sub(10 * pause);
        assert!(stalled >= LIMIT && stalled < LIMIT + Duration::from_secs(1), "{stalled:?}");
    }

    #[tokio::test(start_paused = true)]
    async fn a_connection_on_which_nothing_waits_may_be_still() {
        let (mut reader, writer) = duplex(16);
        let mut writer = Unstalled::new(writer, LIMIT, |_| ());
        for _ in 0..3 {
            writer.write_all(b"abc").await.unwrap();
            let mut bytes = [0; 3];
            reader.read_exact(&mut bytes).await.unwrap();
            sleep(10 * LIMIT).await;
        }
    }
}
