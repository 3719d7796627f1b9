//! Single values of the configuration: checking one, and saying what is wrong with it.

use std::time::Duration;

/// A value that makes no sense, before it is known which file it came from.
#[derive(Debug)]
pub(crate) struct BadValue {
    pub(super) key: String,
    pub(super) value: String,
    pub(super) remedy: String,
}

impl std::fmt::Display for BadValue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} is {}: {}", self.key, self.value, self.remedy)
    }
}

impl BadValue {
    pub(crate) fn new(
        key: impl Into<String>,
        value: impl std::fmt::Display,
        remedy: impl Into<String>,
    ) -> Self {
        Self { key: key.into(), value: format!("{value}"), remedy: remedy.into() }
    }

    /// `value`, if it lies within `min` and `max`.
    pub(crate) fn check(key: &str, value: f64, min: f64, max: f64) -> Result<f64, Self> {
        if value >= min && value <= max {
            Ok(value)
        } else {
            Err(Self::new(key, value, format!("it must be from {min} to {max}")))
        }
    }

    /// A duration from a number of `unit_s` seconds each.
    pub(crate) fn duration(key: &str, value: f64, unit_s: f64, min: f64, max: f64) -> Result<Duration, Self> {
        Ok(Duration::from_secs_f64(Self::check(key, value, min, max)? * unit_s))
    }
}

/// Sets `place` to what the name `given` stands for; `names` are those there are.
pub(super) fn set_choice<T: Copy>(
    place: &mut T,
    key: &str,
    given: Option<&String>,
    names: &[(&str, T)],
) -> Result<(), BadValue> {
    if let Some(given) = given {
        let (_, value) = names.iter().find(|(name, _)| name == given).ok_or_else(|| {
            let known: Vec<String> = names.iter().map(|(name, _)| format!("\"{name}\"")).collect();
            BadValue::new(key, given, format!("it must be {}", known.join(" or ")))
        })?;
        *place = *value;
    }
    Ok(())
}

/// Sets `place` to a number from `min` to `max`.
pub(super) fn set(
    place: &mut f64,
    key: &str,
    value: Option<f64>,
    min: f64,
    max: f64,
) -> Result<(), BadValue> {
    if let Some(value) = value {
        *place = BadValue::check(key, value, min, max)?;
    }
    Ok(())
}

/// Sets `place` to a number of `unit_s` seconds each.
pub(super) fn set_duration(
    place: &mut Duration,
    key: &str,
    value: Option<f64>,
    unit_s: f64,
    (min, max): (f64, f64),
) -> Result<(), BadValue> {
    if let Some(value) = value {
        *place = BadValue::duration(key, value, unit_s, min, max)?;
    }
    Ok(())
}
