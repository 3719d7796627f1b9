//! Where the log goes: to journald when systemd started the daemon, else to the terminal.

use std::io::IsTerminal;

use tracing_subscriber::EnvFilter;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

/// What is logged unless asked otherwise. nusb calls errors what is none here, such as a camera in use being in use; those that
/// are come back from its calls.
const DEFAULT: &str = "info,nusb=off";

/// Starts to log. `EVFOCUS_LOG` sets levels (`debug`, `evfocusd=trace`); default `info`.
pub fn start() {
    let wanted = std::env::var("EVFOCUS_LOG").unwrap_or_else(|_| DEFAULT.to_owned());
    let parsed = EnvFilter::try_new(&wanted);
    let mistake = parsed.as_ref().err().map(ToString::to_string);
    let filter = parsed.unwrap_or_else(|_| EnvFilter::new(DEFAULT));
    let registry = tracing_subscriber::registry().with(filter);
    // systemd sets JOURNAL_STREAM where standard error is the journal: then fields go there as fields.
    let journal = std::env::var_os("JOURNAL_STREAM").and_then(|_| tracing_journald::layer().ok());
    if let Some(journal) = journal {
        registry.with(journal).init();
    } else {
        let terminal = std::io::stderr().is_terminal();
        registry
            .with(tracing_subscriber::fmt::layer().with_writer(std::io::stderr).with_ansi(terminal))
            .init();
    }
    if let Some(error) = mistake {
        tracing::warn!(EVFOCUS_LOG = %wanted, %error, "not a log filter, so info is used; try debug or evfocusd=trace");
    }
}
