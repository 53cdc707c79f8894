//! The stream of a connection, which ends when a client takes nothing of what is written to it.

use std::{
    future::Future,
    io::{self, IoSlice},
    pin::Pin,
    task::{Context, Poll, ready},
    time::Duration,
};

use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    net::TcpStream,
    time::{Sleep, sleep},
};
use tokio_util::sync::{CancellationToken, WaitForCancellationFutureOwned};

use super::Admitted;

/// A TCP stream with its place among the connections. It fails when nothing that is written was taken for a while, and when all
/// connections are cancelled; a WebSocket that takes it over keeps both.
pub(super) struct Stream {
    tcp: TcpStream,
    write_timeout: Duration,
    /// Runs while something is to be written and nothing is taken.
    stalled: Option<Pin<Box<Sleep>>>,
    broken: Pin<Box<WaitForCancellationFutureOwned>>,
    /// Runs while the rest of a request is taken that was refused.
    draining: Option<Pin<Box<Sleep>>>,
    place: Admitted,
}

/// How long the rest of a refused request is read, so that its sender comes to read the answer: if the connection were closed with
/// something unread, the answer would be lost.
const DRAINED_WITHIN: Duration = Duration::from_secs(2);
/// The bytes of it that are read at a time.
const DRAINED_BYTES: usize = 16 << 10;

impl Stream {
    pub(super) fn new(tcp: TcpStream, write_timeout: Duration, broken: CancellationToken, place: Admitted) -> Self {
        Self { tcp, write_timeout, stalled: None, broken: Box::pin(broken.cancelled_owned()), draining: None, place }
    }

    fn check_broken(&mut self, cx: &mut Context<'_>) -> io::Result<()> {
        match self.broken.as_mut().poll(cx) {
            Poll::Ready(()) => Err(io::ErrorKind::ConnectionAborted.into()),
            Poll::Pending => Ok(()),
        }
    }

    /// Handles a write and its time limit.
    fn written<T>(
        &mut self,
        cx: &mut Context<'_>,
        write: impl FnOnce(Pin<&mut TcpStream>, &mut Context<'_>) -> Poll<io::Result<T>>,
    ) -> Poll<io::Result<T>> {
        self.check_broken(cx)?;
        let written = write(Pin::new(&mut self.tcp), cx);
        if written.is_ready() {
            self.stalled = None;
            return written;
        }
        let (stalled, write_timeout) = (&mut self.stalled, self.write_timeout);
        ready!(stalled.get_or_insert_with(|| Box::pin(sleep(write_timeout))).as_mut().poll(cx));
        Poll::Ready(Err(io::ErrorKind::TimedOut.into()))
    }
}

impl AsyncRead for Stream {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buffer: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        self.check_broken(cx)?;
        let before = buffer.filled().len();
        ready!(Pin::new(&mut self.tcp).poll_read(cx, buffer))?;
        if buffer.filled().len() > before {
            self.place.connection.heard();
        }
        Poll::Ready(Ok(()))
    }
}

impl AsyncWrite for Stream {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        self.written(cx, |tcp, cx| tcp.poll_write(cx, bytes))
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        slices: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        self.written(cx, |tcp, cx| tcp.poll_write_vectored(cx, slices))
    }

    fn is_write_vectored(&self) -> bool {
        self.tcp.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.tcp).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        ready!(Pin::new(&mut self.tcp).poll_shutdown(cx))?;
        if !self.place.connection.has_unread() {
            return Poll::Ready(Ok(()));
        }
        let until = self.draining.get_or_insert_with(|| Box::pin(sleep(DRAINED_WITHIN)));
        if until.as_mut().poll(cx).is_ready() || self.check_broken(cx).is_err() {
            return Poll::Ready(Ok(()));
        }
        let mut rest = [0; DRAINED_BYTES];
        loop {
            let mut buffer = ReadBuf::new(&mut rest);
            match ready!(Pin::new(&mut self.tcp).poll_read(cx, &mut buffer)) {
                Ok(()) if !buffer.filled().is_empty() => {}
                // It has come to its end, or broke off.
                _ => return Poll::Ready(Ok(())),
            }
        }
    }
}
