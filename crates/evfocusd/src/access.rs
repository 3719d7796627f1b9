//! Who may move the lens.
//!
//! Who may connect, and so read, is decided by the socket's file: owner and group. Who may control is decided here, by what the
//! kernel says of the peer.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use evfocus_ipc::Error;
use evfocus_ipc::server::Peer;
use nix::unistd::{Group, User, geteuid};

use crate::config::AccessSection;

/// The users and groups that may control.
#[derive(Debug)]
pub struct Access {
    /// Nothing: everybody who can connect.
    allowed: Option<Allowed>,
    /// Users whose refusal has been logged: one line each, so that nobody can fill the log.
    logged: Mutex<BTreeSet<u32>>,
}

#[derive(Debug)]
struct Allowed {
    users: BTreeSet<u32>,
    groups: BTreeSet<u32>,
}

/// A user or group of the configuration that the system does not know.
#[derive(Debug, thiserror::Error)]
#[error("access.{key} names {name:?}: {cause}; create it, or name another one, or give its number")]
pub struct UnknownName {
    key: &'static str,
    name: String,
    cause: String,
}

impl Access {
    /// Everybody who can connect.
    pub fn of_everybody() -> Self {
        Self { allowed: None, logged: Mutex::default() }
    }

    /// Those whom `section` names. The members of a group are those of this moment.
    ///
    /// # Errors
    /// [`UnknownName`].
    pub fn of(section: &AccessSection) -> Result<Self, UnknownName> {
        if section.users.is_none() && section.groups.is_none() {
            return Ok(Self::of_everybody());
        }
        let mut allowed = Allowed { users: BTreeSet::from([0, geteuid().as_raw()]), groups: BTreeSet::new() };
        for name in section.users.iter().flatten() {
            allowed.users.insert(user(name)?);
        }
        for name in section.groups.iter().flatten() {
            let (group, members) = group(name)?;
            allowed.groups.insert(group);
            allowed.users.extend(members);
        }
        Ok(Self { allowed: Some(allowed), logged: Mutex::default() })
    }

    /// Whether `peer` may do `what`.
    ///
    /// # Errors
    /// [`Error::NotPermitted`], which is logged at a user's first try.
    pub fn check(&self, peer: Peer, what: &str) -> Result<(), Error> {
        let Some(allowed) = &self.allowed else { return Ok(()) };
        if allowed.users.contains(&peer.uid) || allowed.groups.contains(&peer.gid) {
            return Ok(());
        }
        let is_news = self.logged.lock().unwrap_or_else(PoisonError::into_inner).insert(peer.uid);
        if is_news {
            tracing::warn!(uid = peer.uid, gid = peer.gid, pid = peer.pid, method = what, "not permitted");
        }
        Err(Error::NotPermitted {
            what: format!("{what} by user {}", peer.uid),
            remedy: "the configuration's [access] names who may; ask who keeps it, then `evfocus reload`"
                .to_owned(),
        })
    }
}

/// The number of the user called `name`.
fn user(name: &str) -> Result<u32, UnknownName> {
    if let Ok(number) = name.parse() {
        return Ok(number);
    }
    let unknown = |cause: String| UnknownName { key: "users", name: name.to_owned(), cause };
    let found = User::from_name(name).map_err(|error| unknown(error.to_string()))?;
    found.map(|user| user.uid.as_raw()).ok_or_else(|| unknown("there is no such user".to_owned()))
}

/// The number of the group called `name`, and the users that are its members beside their own group.
fn group(name: &str) -> Result<(u32, Vec<u32>), UnknownName> {
    let unknown = |cause: String| UnknownName { key: "groups", name: name.to_owned(), cause };
    let found = match name.parse::<u32>() {
        // A number needs no name: its group may be unknown here.
        Ok(number) => match Group::from_gid(number.into()) {
            Ok(Some(group)) => Some(group),
            Ok(None) | Err(_) => return Ok((number, Vec::new())),
        },
        Err(_) => Group::from_name(name).map_err(|error| unknown(error.to_string()))?,
    };
    let group = found.ok_or_else(|| unknown("there is no such group".to_owned()))?;
    // A member whom the system does not know cannot connect either.
    let members = group.mem.iter().filter_map(|member| User::from_name(member).ok().flatten());
    Ok((group.gid.as_raw(), members.map(|user| user.uid.as_raw()).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn peer(uid: u32, gid: u32) -> Peer {
        Peer { uid, gid, pid: Some(1) }
    }

    fn access(users: &[&str], groups: &[&str]) -> Access {
        let names = |names: &[&str]| Some(names.iter().map(|name| (*name).to_owned()).collect());
        Access::of(&AccessSection { users: names(users), groups: names(groups) }).unwrap()
    }

    #[test]
    fn without_names_everybody_who_can_connect_may() {
        Access::of(&AccessSection::default()).unwrap().check(peer(4321, 4321), "Focus").unwrap();
    }

    #[test]
    fn those_named_may_and_root_and_nobody_else() {
        let access = access(&["4000"], &["5000"]);
        for allowed in [peer(0, 9), peer(4000, 9), peer(9, 5000), peer(geteuid().as_raw(), 9)] {
            access.check(allowed, "Focus").unwrap();
        }
        for stranger in [peer(4001, 4000), peer(5000, 5001)] {
            let refused = access.check(stranger, "MoveTo").unwrap_err();
            assert!(
                matches!(&refused, Error::NotPermitted { what, .. } if what.contains("MoveTo")),
                "{refused}"
            );
        }
    }

    #[test]
    fn a_users_refusals_take_one_line_of_the_log() {
        let access = access(&["4000"], &[]);
        let log = tempfile::NamedTempFile::new().unwrap();
        let writer = Mutex::new(log.reopen().unwrap());
        let subscriber = tracing_subscriber::fmt().with_writer(writer).finish();
        tracing::subscriber::with_default(subscriber, || {
            for stranger in [4001, 4001, 4002, 4001, 4002] {
                access.check(peer(stranger, 1), "Focus").unwrap_err();
            }
        });
        let log = std::fs::read_to_string(log.path()).unwrap();
        assert_eq!(log.lines().count(), 2, "{log}");
    }

    #[test]
    fn an_empty_list_shuts_everybody_out_but_root() {
        access(&[], &[]).check(peer(4321, 4321), "Focus").unwrap_err();
    }

    #[test]
    fn a_name_that_is_not_there_is_named() {
        let section = AccessSection { users: None, groups: Some(vec!["no-such-group-here".to_owned()]) };
        let error = Access::of(&section).unwrap_err().to_string();
        assert!(error.contains("access.groups") && error.contains("no-such-group-here"), "{error}");
    }
}
