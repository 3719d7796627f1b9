//! Messages on the stream: each ends with a NUL byte. Reading is bounded in memory, and in time where that is asked for.

use std::io;
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt};
use tokio::time::{Instant, timeout_at};

/// Grown buffers shrink to this once they are empty, so that one long message does not stay in memory.
const KEPT_BYTES: usize = 16 * 1024;

/// Why no message came.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FrameError {
    /// The peer sent this many bytes and the message has still not ended.
    #[error("a message is longer than {limit} bytes")]
    TooLong {
        /// The longest message taken, in bytes.
        limit: usize,
    },
    /// The stream ended in the middle of a message.
    #[error("the stream ended in the middle of a message")]
    Truncated,
    /// A message was begun and not ended in time.
    #[error("a message was begun and not ended within {0:?}")]
    TooSlow(Duration),
    /// The stream failed.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// Cuts a stream into messages.
#[derive(Debug)]
pub(crate) struct FrameReader<Stream> {
    stream: Stream,
    limit: usize,
    patience: Option<Duration>,
    buffer: Vec<u8>,
    /// Where the message that is handed out next begins.
    start: usize,
    /// There is no NUL byte between `start` and here.
    scanned: usize,
}

impl<Stream: AsyncRead + Unpin> FrameReader<Stream> {
    /// A reader of messages of at most `limit` bytes, each of which must end within `patience` of its first byte.
    pub(crate) fn new(stream: Stream, limit: usize, patience: Option<Duration>) -> Self {
        Self { stream, limit, patience, buffer: Vec::new(), start: 0, scanned: 0 }
    }

    /// The next message without its NUL byte, or nothing at the end of the stream.
    pub(crate) async fn next(&mut self) -> Result<Option<&[u8]>, FrameError> {
        let mut deadline = self.deadline();
        loop {
            if let Some(offset) = self.buffer[self.scanned..].iter().position(|&byte| byte == 0) {
                let (start, end) = (self.start, self.scanned + offset);
                self.start = end + 1;
                self.scanned = end + 1;
                return Ok(Some(&self.buffer[start..end]));
            }
            self.scanned = self.buffer.len();
            self.discard_consumed();
            if self.buffer.len() >= self.limit {
                return Err(FrameError::TooLong { limit: self.limit });
            }
            if self.read_some(deadline).await? == 0 {
                return if self.buffer.is_empty() { Ok(None) } else { Err(FrameError::Truncated) };
            }
            deadline = deadline.or_else(|| self.deadline());
        }
    }

    /// When a message that has been begun must have ended.
    fn deadline(&self) -> Option<Instant> {
        let begun = self.buffer.len() > self.start;
        self.patience.filter(|_| begun).and_then(|patience| Instant::now().checked_add(patience))
    }

    async fn read_some(&mut self, deadline: Option<Instant>) -> Result<usize, FrameError> {
        // The buffer doubles as a message goes on, and never grows beyond the limit.
        let room = self.buffer.len().clamp(1024, 64 * 1024).min(self.limit - self.buffer.len());
        self.buffer.reserve(room);
        let mut stream = (&mut self.stream).take(room as u64);
        let read = stream.read_buf(&mut self.buffer);
        match deadline {
            None => Ok(read.await?),
            Some(deadline) => match timeout_at(deadline, read).await {
                Ok(read) => Ok(read?),
                Err(_) => Err(FrameError::TooSlow(self.patience.unwrap_or_default())),
            },
        }
    }

    fn discard_consumed(&mut self) {
        if self.start > 0 {
            self.buffer.drain(..self.start);
            self.scanned -= self.start;
            self.start = 0;
            if self.buffer.is_empty() {
                self.buffer.shrink_to(KEPT_BYTES);
            }
        }
    }
}

/// `message` as JSON with its NUL byte.
pub(crate) fn encode<Message: serde::Serialize>(message: &Message) -> Result<Vec<u8>, serde_json::Error> {
    let mut bytes = serde_json::to_vec(message)?;
    bytes.push(0);
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn messages_are_cut_at_nul_bytes_wherever_the_reads_end() {
        let stream = tokio_test_stream(&[b"on", b"e\0two\0thr", b"ee\0"]);
        let mut reader = FrameReader::new(stream, 64, None);
        for expected in ["one", "two", "three"] {
            assert_eq!(reader.next().await.unwrap(), Some(expected.as_bytes()));
        }
        assert_eq!(reader.next().await.unwrap(), None);
    }

    #[tokio::test]
    async fn a_message_that_never_ends_is_cut_off_at_the_limit() {
        let mut reader = FrameReader::new(tokio::io::repeat(b'x'), 1000, None);
        assert!(matches!(reader.next().await, Err(FrameError::TooLong { limit: 1000 })));
        assert!(reader.buffer.capacity() <= 2048, "{}", reader.buffer.capacity());
    }

    #[tokio::test]
    async fn an_end_in_mid_message_is_an_error() {
        let mut reader = FrameReader::new(&b"half"[..], 64, None);
        assert!(matches!(reader.next().await, Err(FrameError::Truncated)));
    }

    #[tokio::test(start_paused = true)]
    async fn patience_starts_with_the_first_byte() {
        let (mut peer, stream) = tokio::io::duplex(64);
        let mut reader = FrameReader::new(stream, 64, Some(Duration::from_secs(10)));
        let silent = tokio::time::timeout(Duration::from_secs(1000), reader.next()).await;
        assert!(silent.is_err(), "an idle connection is fine");
        tokio::io::AsyncWriteExt::write_all(&mut peer, b"half").await.unwrap();
        let began = Instant::now();
        assert!(matches!(reader.next().await, Err(FrameError::TooSlow(_))));
        assert_eq!(began.elapsed().as_secs(), 10);
    }

    /// A stream whose reads return these pieces.
    fn tokio_test_stream(pieces: &[&'static [u8]]) -> impl AsyncRead + Unpin {
        let mut joined: Box<dyn AsyncRead + Unpin> = Box::new(tokio::io::empty());
        for piece in pieces {
            joined = Box::new(joined.chain(*piece));
        }
        joined
    }
}
