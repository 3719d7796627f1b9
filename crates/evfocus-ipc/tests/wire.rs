//! The wire format: frozen examples of every type, held against the types and against the interface description.
//!
//! The examples under `wire/v1/` are what clients of version 1 send and expect. If a test of them fails, do not change the
//! example: change the code, or make a new version. Adding an example for something new is fine.

#![expect(clippy::panic, clippy::unwrap_used, reason = "helpers of the tests")]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use evfocus_ipc::{
    DESCRIPTION, Device, Error, FocusRequest, Progress, ProtocolError, Report, Request, Status,
};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use zlink::idl::{CustomType, Interface, Type};

/// The example `name` as it is written today: everything in it must survive, and fields that are newer than it are added.
fn frozen<T: Serialize + DeserializeOwned>(name: &str) -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/wire/v1").join(name).with_extension("json");
    let example: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let typed: T = serde_json::from_value(example.clone()).unwrap_or_else(|error| panic!("{name}: {error}"));
    let written = serde_json::to_value(typed).unwrap();
    check_survival(&example, &written, name);
    written
}

/// Fails unless `written` holds all of `example`.
fn check_survival(example: &Value, written: &Value, at: &str) {
    match (example, written) {
        (Value::Object(example), Value::Object(written)) => {
            for (name, value) in example {
                let kept = written.get(name).unwrap_or_else(|| panic!("{at}.{name} is gone"));
                check_survival(value, kept, &format!("{at}.{name}"));
            }
        }
        (Value::Array(example), Value::Array(written)) => {
            assert_eq!(example.len(), written.len(), "{at}");
            for (index, (example, written)) in example.iter().zip(written).enumerate() {
                check_survival(example, written, &format!("{at}[{index}]"));
            }
        }
        (example, written) => assert_eq!(example, written, "{at}"),
    }
}

/// The example `name`, which has every field there is.
fn complete<T: Serialize + DeserializeOwned>(name: &str) -> Value {
    let written = frozen::<T>(name);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/wire/v1").join(name).with_extension("json");
    assert_eq!(serde_json::from_slice::<Value>(&fs::read(&path).unwrap()).unwrap(), written, "{name}");
    written
}

fn interface() -> Interface<'static> {
    Interface::try_from(DESCRIPTION).unwrap()
}

/// Fails unless `value` is of type `kind`, with all the fields and no others.
fn check(interface: &Interface<'_>, kind: &Type<'_>, value: &Value, at: &str) {
    let fits = match kind {
        Type::Bool => value.is_boolean(),
        Type::Int => value.is_i64() || value.is_u64(),
        Type::Float => value.is_number(),
        Type::String => value.is_string(),
        Type::Array(inner) => {
            let items = value.as_array().unwrap_or_else(|| panic!("{at}: {value} is no list"));
            for item in items {
                check(interface, inner.inner(), item, at);
            }
            true
        }
        Type::Optional(inner) => {
            if !value.is_null() {
                check(interface, inner.inner(), value, at);
            }
            true
        }
        Type::Custom(name) => {
            let name = name.to_string();
            let custom = interface
                .custom_types()
                .find(|custom| custom.name().to_string() == name)
                .unwrap_or_else(|| panic!("{at}: the description has no type {name}"));
            match custom {
                CustomType::Object(object) => {
                    let fields =
                        object.fields().map(|field| (field.name().to_string(), field.ty())).collect();
                    check_fields(interface, &fields, value, &name);
                    true
                }
                CustomType::Enum(variants) => variants.variants().any(|one| value == one.name().as_str()),
            }
        }
        Type::ForeignObject | Type::Any | Type::Map(_) | Type::Enum(_) | Type::Object(_) => {
            panic!("{at}: a type {kind} was not expected")
        }
    };
    assert!(fits, "{at}: {value} is not of type {kind}");
}

fn check_fields(interface: &Interface<'_>, fields: &BTreeMap<String, &Type<'_>>, value: &Value, at: &str) {
    let object = value.as_object().unwrap_or_else(|| panic!("{at}: {value} is no object"));
    let (mut given, known): (Vec<_>, Vec<_>) = (object.keys().collect(), fields.keys().collect());
    given.sort();
    assert_eq!(given, known, "{at}: fields on the wire, and in the description");
    for (name, kind) in fields {
        check(interface, kind, &object[name], &format!("{at}.{name}"));
    }
}

fn custom(name: &'static str) -> Type<'static> {
    Type::Custom(zlink::names::TypeName::try_from(name).unwrap())
}

#[test]
fn every_type_is_on_the_wire_what_the_description_says() {
    let interface = interface();
    for (kind, example) in [
        ("Status", frozen::<Status>("status-idle")),
        ("Status", frozen::<Status>("status-scanning")),
        ("FocusRequest", frozen::<FocusRequest>("focus-request-default")),
        ("FocusRequest", frozen::<FocusRequest>("focus-request-full")),
        ("FocusRequest", complete::<FocusRequest>("focus-request-windows")),
        ("Status", frozen::<Status>("status-focused")),
        ("Status", frozen::<Status>("status-calibrated")),
        ("Status", complete::<Status>("status-continuous")),
        ("Report", frozen::<Report>("report-windows")),
        ("Report", complete::<Report>("report-calibrated")),
        ("Progress", frozen::<Progress>("progress-point")),
        ("Progress", frozen::<Progress>("progress-done")),
        ("Report", frozen::<Report>("report-focused")),
        ("Report", frozen::<Report>("report-failed")),
        ("Device", frozen::<Device>("device")),
    ] {
        check(&interface, &custom(kind), &example, kind);
    }
}

#[test]
fn every_error_is_on_the_wire_what_the_description_says() {
    let interface = interface();
    let errors = frozen::<Vec<Error>>("errors");
    let mut described: BTreeMap<String, _> =
        interface.errors().map(|error| (format!("org.evfocus.Controller.{}", error.name()), error)).collect();
    for error in errors.as_array().unwrap() {
        let name = error["error"].as_str().unwrap();
        // The same error may have several examples.
        let Some(description) = described.get(name) else { panic!("{name} is not described") };
        let fields = description.fields().map(|field| (field.name().to_string(), field.ty())).collect();
        check_fields(&interface, &fields, &error["parameters"], name);
    }
    described
        .retain(|name, _| !errors.as_array().unwrap().iter().any(|error| error["error"] == name.as_str()));
    assert!(described.is_empty(), "without an example: {:?}", described.keys());
    frozen::<Vec<ProtocolError>>("protocol-errors");
}

#[test]
fn the_methods_are_those_of_the_description() {
    let interface = interface();
    assert_eq!(interface.name().as_str(), evfocus_ipc::INTERFACE);
    let described: Vec<_> = interface.methods().map(|method| method.name().to_string()).collect();
    assert_eq!(described, Request::NAMES);
    let request = FocusRequest::default();
    let focus = interface.methods().find(|method| method.name().as_str() == "Focus").unwrap();
    let arguments: Vec<_> = focus.inputs().map(|input| input.name().to_string()).collect();
    let fields = serde_json::to_value(request).unwrap();
    let mut fields: Vec<_> = fields.as_object().unwrap().keys().cloned().collect();
    let mut sorted = arguments.clone();
    sorted.sort();
    fields.sort();
    assert_eq!(sorted, fields);
}

/// Readers ignore what they do not know, so that a newer daemon can say more.
#[test]
fn fields_of_a_newer_version_are_ignored() {
    let mut status = frozen::<Status>("status-idle");
    status["temperature_c"] = Value::from(21.5);
    serde_json::from_value::<Status>(status).unwrap();
}
