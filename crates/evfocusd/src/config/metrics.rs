//! `[metrics]`: where the figures for Prometheus go.

use std::path::PathBuf;

use serde::Deserialize;

use super::BadValue;

/// `[metrics]`. Absent: nowhere.
#[derive(Debug, Clone, PartialEq, Eq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MetricsSection {
    /// A Unix socket on which they can be asked for over HTTP.
    pub socket: Option<PathBuf>,
    /// A file, whose name ends in `.prom`, for node_exporter's textfile collector.
    pub file: Option<PathBuf>,
}

impl MetricsSection {
    pub(super) fn check(self) -> Result<Self, BadValue> {
        let wrong = |path: &PathBuf| path.extension().is_none_or(|extension| extension != "prom");
        match &self.file {
            Some(path) if wrong(path) => Err(BadValue::new(
                "metrics.file",
                path.display(),
                "its name must end in .prom, or the collector does not read it",
            )),
            _ => Ok(self),
        }
    }
}
