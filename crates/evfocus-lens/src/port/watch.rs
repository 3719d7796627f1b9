//! Waiting for bytes from a file descriptor, or for a bell.

use std::io;
use std::os::fd::RawFd;
use std::sync::Arc;
use std::task::Wake;
use std::time::Duration;

use evfocus_hal::Bell;
use mio::unix::SourceFd;
use mio::{Events, Interest, Poll, Token};

const BYTES: Token = Token(0);
const BELL: Token = Token(1);

/// Watches a file descriptor that stays open for longer.
pub(super) struct Watch {
    poll: Poll,
    events: Events,
    bell: Bell,
}

/// Who waits in a [`Watch`].
struct Sleeper(mio::Waker);

impl Wake for Sleeper {
    fn wake(self: Arc<Self>) {
        if let Err(error) = self.0.wake() {
            tracing::error!(%error, "an order cannot end the wait for an answer; it comes after it");
        }
    }
}

impl Watch {
    pub(super) fn new(descriptor: RawFd) -> io::Result<Self> {
        let poll = Poll::new()?;
        poll.registry().register(&mut SourceFd(&descriptor), BYTES, Interest::READABLE)?;
        Ok(Self { poll, events: Events::with_capacity(2), bell: Bell::default() })
    }

    /// Ends waits while `bell` rings.
    pub(super) fn listen(&mut self, bell: &Bell) -> io::Result<()> {
        bell.wakes(Arc::new(Sleeper(mio::Waker::new(self.poll.registry(), BELL)?)).into());
        self.bell = bell.clone();
        Ok(())
    }

    /// Waits for at most `limit` until something may have come in that was not there at the last look, or the bell rings; says
    /// whether it is worth another look.
    pub(super) fn wait(&mut self, limit: Duration) -> io::Result<bool> {
        if limit.is_zero() || self.bell.rings() {
            return Ok(false);
        }
        match self.poll.poll(&mut self.events, Some(limit)) {
            Err(error) if error.kind() != io::ErrorKind::Interrupted => Err(error),
            Ok(()) | Err(_) => Ok(true),
        }
    }
}
