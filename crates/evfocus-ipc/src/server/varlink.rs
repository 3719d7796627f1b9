//! The interface `org.varlink.service`: who serves, which interfaces, and their descriptions.

use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::{DESCRIPTION, ProtocolError};

/// The interface's name.
pub(super) const INTERFACE: &str = "org.varlink.service";

/// The interface's description, the same for every service (from the Varlink documentation).
const OWN_DESCRIPTION: &str = include_str!("org.varlink.service.varlink");

/// Who is serving.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Info {
    /// Who makes the product.
    pub vendor: String,
    /// The product.
    pub product: String,
    /// Its version.
    pub version: String,
    /// Where to read about it.
    pub url: String,
}

/// Answers the method `method`, whose full name is `full_name`.
pub(super) fn call(
    full_name: &str,
    method: &str,
    parameters: &Map<String, Value>,
    info: &Info,
) -> Result<Value, ProtocolError> {
    match method {
        "GetInfo" => Ok(json!({
            "vendor": info.vendor,
            "product": info.product,
            "version": info.version,
            "url": info.url,
            "interfaces": [INTERFACE, crate::INTERFACE],
        })),
        "GetInterfaceDescription" => match parameters.get("interface").and_then(Value::as_str) {
            Some(INTERFACE) => Ok(json!({ "description": OWN_DESCRIPTION })),
            Some(crate::INTERFACE) => Ok(json!({ "description": DESCRIPTION })),
            Some(other) => Err(ProtocolError::InterfaceNotFound { interface: other.to_owned() }),
            None => Err(ProtocolError::InvalidParameter { parameter: "interface".to_owned() }),
        },
        _ => Err(ProtocolError::MethodNotFound { method: full_name.to_owned() }),
    }
}
