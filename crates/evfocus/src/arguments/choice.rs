//! Values that are one of a few names.

use std::str::FromStr;

use clap::builder::{PossibleValuesParser, TypedValueParser};

/// A parser for one of `values`, each by its `name`; it lists them in help, errors and completions.
pub fn choices<T>(values: &'static [T], name: fn(T) -> &'static str) -> impl TypedValueParser<Value = T>
where
    T: FromStr + Copy + Send + Sync + 'static,
    T::Err: std::error::Error + Send + Sync + 'static,
{
    PossibleValuesParser::new(values.iter().map(|&value| name(value))).try_map(|given| given.parse::<T>())
}
