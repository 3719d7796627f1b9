//! The exit statuses, the same for every command.

use std::fmt;
use std::process::ExitCode;

/// How a command ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Focused, or done.
    Done,
    /// Something went wrong; standard error says what.
    Error,
    /// The command line makes no sense.
    Usage,
    /// All went well, but the run ended without focus.
    NoFocus,
}

impl Exit {
    /// The status for a run that is or is not in focus.
    pub fn of_run(focused: bool) -> Self {
        if focused { Self::Done } else { Self::NoFocus }
    }

    /// The status for `error`.
    pub fn of_error(error: &anyhow::Error) -> Self {
        if error.is::<UsageError>() { Self::Usage } else { Self::Error }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        match exit {
            Exit::Done => Self::SUCCESS,
            Exit::Error => Self::from(1),
            Exit::Usage => Self::from(2),
            Exit::NoFocus => Self::from(3),
        }
    }
}

/// Arguments that are well-formed one by one and make no sense together, or on this rig: status 2 like those that clap
/// refuses.
#[derive(Debug)]
pub struct UsageError(pub String);

impl fmt::Display for UsageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for UsageError {}
