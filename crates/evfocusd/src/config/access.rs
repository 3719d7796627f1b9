//! `[access]`: who may move the lens.

use serde::Deserialize;

/// `[access]`. Names or numbers of those who may focus, move and configure, beside root and the daemon's own user. Absent:
/// everybody who can connect.
#[derive(Debug, Clone, PartialEq, Eq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AccessSection {
    /// Users.
    pub users: Option<Vec<String>>,
    /// Groups.
    pub groups: Option<Vec<String>>,
}
