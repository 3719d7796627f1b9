//! The configuration, read anew while the daemon runs.

use std::sync::{Arc, Mutex, PoisonError};

use evfocus_hal::LensInfo;
use evfocus_ipc::Error;
use tokio::signal::unix::Signal;
use tokio::sync::{mpsc, watch};

use crate::access::Access;
use crate::config::{Config, ConfigError};
use crate::handle::{Command, Lookups, Reloaded};
use crate::reports::Reports;

/// Reads the configuration again.
pub type Reread = Box<dyn Fn() -> Result<Config, ConfigError> + Send + Sync>;

/// Applies what can be changed while running: `[continuous]`, `[focus]`, `[access]`, the play of the lens, and how many reports are kept.
pub(crate) struct Reloader {
    reread: Reread,
    /// What holds now.
    current: Mutex<Config>,
    lens: LensInfo,
    commands: mpsc::Sender<Command>,
    access: watch::Sender<Arc<Access>>,
    reports: Reports,
}

impl std::fmt::Debug for Reloader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Reloader").field("lens", &self.lens).finish_non_exhaustive()
    }
}

impl Reloader {
    /// `config` holds now; `reread` has what is to hold.
    pub(crate) fn new(
        reread: Reread,
        config: &Config,
        lens: &LensInfo,
        commands: mpsc::Sender<Command>,
        access: watch::Sender<Arc<Access>>,
        reports: Reports,
    ) -> Self {
        let current = Mutex::new(config.clone());
        Self { reread, current, lens: lens.clone(), commands, access, reports }
    }

    /// Reads and applies all of it or nothing.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] with what is wrong with the file.
    pub(crate) fn reload(&self) -> Result<Reloaded, Error> {
        let refused = |error: &dyn std::fmt::Display| {
            tracing::warn!(%error, "the configuration is not good, so nothing has changed");
            crate::wire::invalid("configuration", &"the file", error)
        };
        let new = (self.reread)().map_err(|error| refused(&error))?;
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        let reloaded = Reloaded { applied: applicable(&current, &new), needs_restart: fixed(&current, &new) };
        let next = Config {
            continuous: new.continuous,
            focus: new.focus,
            access: new.access,
            lens_backlash: new.lens_backlash,
            reports_kept: new.reports_kept,
            report_days: new.report_days,
            ..current.clone()
        };
        next.controller(&self.lens, None).map_err(|error| refused(&error))?;
        let access = Access::of(&next.access).map_err(|error| refused(&error))?;
        let configure = Command::Configure { config: Box::new(next.clone()) };
        self.commands.try_send(configure).map_err(|_| Error::NotResponding { waited_s: 0.0 })?;
        self.access.send_replace(Arc::new(access));
        self.reports.keep(next.kept());
        *current = next;
        let (applied, needs_restart) = (reloaded.applied.join(" "), reloaded.needs_restart.join(" "));
        tracing::info!(applied, needs_restart, "the configuration has been read anew");
        Ok(reloaded)
    }
}

/// What has changed and holds at once.
fn applicable(old: &Config, new: &Config) -> Vec<String> {
    names(&[
        ("continuous", old.continuous != new.continuous),
        ("focus", old.focus != new.focus),
        ("access", old.access != new.access),
        ("lens.backlash_counts", old.lens_backlash != new.lens_backlash),
        ("daemon.reports_kept", old.reports_kept != new.reports_kept),
        ("daemon.report_days", old.report_days != new.report_days),
    ])
}

/// What has changed and holds after a restart only.
fn fixed(old: &Config, new: &Config) -> Vec<String> {
    names(&[
        ("daemon.socket", old.socket != new.socket),
        ("daemon.state_dir", old.state_dir != new.state_dir),
        ("daemon.mode", old.mode != new.mode),
        ("real_time", old.real_time != new.real_time),
        ("metrics", old.metrics != new.metrics),
        ("camera", old.camera != new.camera),
        ("lens", old.lens != new.lens || old.lens_poll != new.lens_poll),
        ("lens limits", old.lens_min != new.lens_min || old.lens_max != new.lens_max),
        ("simulation", old.rig != new.rig),
    ])
}

fn names(changes: &[(&str, bool)]) -> Vec<String> {
    changes.iter().filter(|(_, changed)| *changed).map(|(name, _)| (*name).to_owned()).collect()
}

/// Reloads at each SIGHUP, for ever.
pub(crate) async fn on_hangup(mut hangups: Signal, lookups: Arc<dyn Lookups>) -> std::io::Result<()> {
    while hangups.recv().await.is_some() {
        let lookups = Arc::clone(&lookups);
        // What is wrong has been logged.
        tokio::task::spawn_blocking(move || lookups.reload().map(drop).unwrap_or_default()).await?;
    }
    Ok(())
}
