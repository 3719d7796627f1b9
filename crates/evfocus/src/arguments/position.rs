//! Numbers of the lens: positions in counts, speeds in counts per second.

use evfocus_core::LensSpeed;

/// Parses a lens position in counts.
pub fn position(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => {
            Err(format!("{text:?} is not a lens position; write a number in counts, such as 1985 or 1985.5"))
        }
    }
}

/// Parses a lens speed in counts per second.
pub fn speed(text: &str) -> Result<LensSpeed, String> {
    let value = text.trim().parse::<f64>().map_err(|_| {
        format!("{text:?} is not a lens speed; write a number in counts per second, such as 1765")
    })?;
    LensSpeed::new(value).map_err(|error| error.to_string())
}
