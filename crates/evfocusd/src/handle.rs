//! What the socket's side of the daemon holds of the control thread: a queue of commands in, the status and the progress
//! out.
//!
//! The control thread owns the lens and the state, so it decides which command is admitted.

use std::sync::Arc;

use evfocus_core::controller::Pause;
pub use evfocus_ipc::client::Reloaded;
use evfocus_ipc::{Calibration, Device, Error, FocusRequest, Mode, Progress, Report, Status};
use tokio::sync::{broadcast, mpsc, oneshot, watch};

use crate::access::Access;
use crate::config::Config;

/// The answer to a command.
pub type Answer<Value> = oneshot::Sender<Result<Value, Error>>;

/// What the control thread is asked to do. It answers at once, but for a calibration; it never waits for a motion or a run
/// to end.
#[derive(Debug)]
pub enum Command {
    /// Start a run, or follow the one under way.
    Focus {
        /// How to focus.
        request: FocusRequest,
        /// The number of the run, new or under way. Numbers grow.
        answer: Answer<u64>,
    },
    /// Stop the run under way, and the lens.
    Abort {
        /// The run that was stopped.
        answer: Answer<Option<u64>>,
    },
    /// Start to move the lens.
    MoveTo {
        /// Where to, in counts; finite.
        position: f64,
        /// Accepted, not arrived.
        answer: Answer<()>,
    },
    /// Measure the lens. Answered when it is done, which takes a while.
    Calibrate {
        /// What was measured.
        answer: Answer<Calibration>,
    },
    /// Change the mode.
    SetMode {
        /// The new mode.
        mode: Mode,
        /// Done.
        answer: Answer<()>,
    },
    /// Pause continuous mode, or go on with it.
    Pause {
        /// Which, and when.
        pause: Pause,
        /// Done.
        answer: Answer<()>,
    },
    /// Change the settings; they hold once no run is under way.
    Configure {
        /// The configuration that they are made of.
        config: Box<Config>,
    },
}

/// What is looked up, or done, away from the task that serves clients. These may take their time: they run on a thread of their own.
pub trait Lookups: Send + Sync + 'static {
    /// The devices in use, attached or configured; what answers on the serial ports `probe` (empty: those on USB) is asked.
    fn devices(&self, probe: Option<&[String]>) -> Result<Vec<Device>, Error>;

    /// The report of run `id`, or of the last one that has one.
    fn report(&self, id: Option<u64>) -> Result<Report, Error>;

    /// Reads the configuration anew and applies what can be changed while running.
    fn reload(&self) -> Result<Reloaded, Error>;
}

/// The daemon as the socket sees it. Clones share the same channels.
#[derive(Clone)]
pub struct Handle {
    /// To the control thread; bounded.
    pub commands: mpsc::Sender<Command>,
    /// The latest status.
    pub status: watch::Receiver<Arc<Status>>,
    /// The progress of all runs; each run ends with a message that has `done` and the report. A follower that falls
    /// behind by the channel's capacity loses the oldest, and is told how many. Weak, so that followers notice when the
    /// control thread has gone and its sender with it.
    pub progress: broadcast::WeakSender<Arc<Progress>>,
    /// Who may move the lens.
    pub access: watch::Receiver<Arc<Access>>,
    /// Devices, reports and the configuration.
    pub lookups: Arc<dyn Lookups>,
}

impl std::fmt::Debug for Handle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Handle").finish_non_exhaustive()
    }
}
