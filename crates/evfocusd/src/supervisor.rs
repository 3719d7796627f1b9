//! What the daemon and the service manager have to say to each other: the socket that it keeps for us, that we are ready, what we
//! do, and that the control thread makes progress. All of it is silent where no service manager listens.

use std::io;
use std::os::unix::net::UnixListener;
use std::sync::Arc;
use std::time::Duration;

use evfocus_ipc::Status;
use listenfd::ListenFd;
use sd_notify::NotifyState;
use tokio::sync::watch;
use tokio::time::{MissedTickBehavior, interval};

use crate::vitals::Vitals;

/// How often progress is looked for within the watchdog's time.
const LOOKS: u32 = 4;
/// How often without a watchdog; only the status text depends on it then.
const UNWATCHED: Duration = Duration::from_secs(1);

/// The listening socket that was handed over, in socket activation.
///
/// # Errors
/// What was handed over is no listening Unix socket.
pub(crate) fn inherited_socket() -> io::Result<Option<UnixListener>> {
    ListenFd::from_env().take_unix_listener(0)
}

/// Says that clients are served.
pub(crate) fn ready() {
    tell(&[NotifyState::Ready]);
}

/// Says that the end has begun.
pub(crate) fn stopping() {
    tell(&[NotifyState::Stopping, NotifyState::Status("stopping")]);
}

fn tell(news: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(news) {
        tracing::warn!(%error, "the service manager does not listen");
    }
}

/// Keeps the service manager informed.
#[derive(Debug)]
pub(crate) struct Supervisor {
    pub(crate) status: watch::Receiver<Arc<Status>>,
    pub(crate) vitals: Vitals,
}

impl Supervisor {
    /// Runs until the daemon has no more status. The watchdog is fed only when the control thread has passed through its loop since the last time, so it
    /// bites when that thread hangs, and when this one does.
    pub(crate) async fn run(mut self) {
        let watchdog = sd_notify::watchdog_enabled();
        let mut looks = interval(watchdog.map_or(UNWATCHED, |time| time / LOOKS));
        looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let (mut seen, mut told) = (self.vitals.beats(), String::new());
        while self.status.has_changed().is_ok() {
            looks.tick().await;
            let beats = self.vitals.beats();
            if watchdog.is_some() && beats != seen {
                tell(&[NotifyState::Watchdog]);
            }
            seen = beats;
            let text = words(&self.status.borrow_and_update());
            if text != told {
                tell(&[NotifyState::Status(&text)]);
                told = text;
            }
        }
    }
}

/// The status in a line, without what changes all the time.
fn words(status: &Status) -> String {
    let run = match (status.run_id, &status.last_run) {
        (Some(run), _) => format!("run {run}: {}", status.phase),
        (None, Some(last)) => match (&last.reason, last.position) {
            (Some(reason), _) => format!("{}, run {}: {reason}", status.state, last.id),
            (None, Some(position)) => format!("{}, run {} at {position:.1}", status.state, last.id),
            (None, None) => format!("{}, run {}", status.state, last.id),
        },
        (None, None) => status.state.to_string(),
    };
    match &status.fault {
        Some(fault) => format!("{run}; {fault}"),
        None => run,
    }
}

#[cfg(test)]
mod tests {
    use evfocus_ipc::{LastRun, State};

    use super::*;

    #[test]
    fn the_status_line_names_run_result_and_fault() {
        let mut status = Status::default();
        assert_eq!(words(&status), "idle");
        (status.run_id, status.state) = (Some(7), State::Scanning);
        assert_eq!(words(&status), "run 7: none");
        status.run_id = None;
        status.state = State::Failed;
        status.last_run = Some(LastRun {
            id: 7,
            state: State::Failed,
            position: None,
            reason: Some("flat".to_owned()),
            error_bar: None,
            confidence: None,
            flags: Vec::new(),
        });
        status.fault = Some("the lens does not answer".to_owned());
        assert_eq!(words(&status), "failed, run 7: flat; the lens does not answer");
    }
}
