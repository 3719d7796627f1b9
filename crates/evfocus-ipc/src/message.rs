//! The envelopes of Varlink: a call, a reply, an error.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::{Error, ProtocolError};

/// A call as it is on the wire.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Call {
    /// The full name of the method.
    pub(crate) method: String,
    /// Its arguments.
    #[serde(default)]
    pub(crate) parameters: Option<Map<String, Value>>,
    /// The caller takes many replies.
    #[serde(default, skip_serializing_if = "is_false")]
    pub(crate) more: bool,
    /// The caller takes no reply.
    #[serde(default, skip_serializing_if = "is_false")]
    pub(crate) oneway: bool,
    /// The caller wants to speak another protocol from here on; we know none.
    #[serde(default, skip_serializing_if = "is_false")]
    pub(crate) upgrade: bool,
}

/// A reply as we send it.
#[derive(Debug, Serialize)]
pub(crate) struct Outgoing<'a, Parameters: Serialize> {
    /// The results.
    pub(crate) parameters: &'a Parameters,
    /// More replies follow.
    #[serde(skip_serializing_if = "is_false")]
    pub(crate) continues: bool,
}

/// A reply or an error as we receive it.
#[derive(Debug, Deserialize)]
pub(crate) struct Incoming {
    /// The name of the error, if it is one.
    pub(crate) error: Option<String>,
    /// The results, or the error's.
    #[serde(default)]
    parameters: Value,
    /// More replies follow.
    #[serde(default)]
    pub(crate) continues: bool,
}

/// An error reply, sorted.
#[derive(Debug)]
pub(crate) enum Refusal {
    /// One of the interface's own.
    Ours(Error),
    /// One of Varlink's own.
    Protocol(ProtocolError),
    /// One that this version does not know.
    Unknown(String),
}

impl Incoming {
    /// The results as `Parameters`.
    pub(crate) fn results<Parameters: DeserializeOwned>(self) -> Result<Parameters, serde_json::Error> {
        // A method without results may leave `parameters` out.
        let parameters = if self.parameters.is_null() { Value::Object(Map::new()) } else { self.parameters };
        serde_json::from_value(parameters)
    }

    /// The error called `name`, with its parameters.
    pub(crate) fn refusal(self, name: &str) -> Refusal {
        // An error without parameters may leave them out.
        let parameters = if self.parameters.is_null() { Value::Object(Map::new()) } else { self.parameters };
        let whole = serde_json::json!({ "error": name, "parameters": parameters });
        if let Ok(error) = Error::deserialize(&whole) {
            Refusal::Ours(error)
        } else if let Ok(error) = ProtocolError::deserialize(&whole) {
            Refusal::Protocol(error)
        } else {
            Refusal::Unknown(whole.to_string())
        }
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it with a reference")]
fn is_false(flag: &bool) -> bool {
    !*flag
}
