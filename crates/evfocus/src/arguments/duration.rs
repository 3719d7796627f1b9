//! Durations with a unit, such as `55ms`.

use std::time::Duration;

/// The units, the longest names first so that `ms` is not taken for `s`.
const UNITS: [(&str, f64); 3] = [("us", 1e-6), ("ms", 1e-3), ("s", 1.0)];

/// Parses `55ms`, `0.055s` or `800us`: above zero, at most a day. A number alone is refused, since a wrong guess of the
/// unit is off by a thousand.
pub fn duration(text: &str) -> Result<Duration, String> {
    let trimmed = text.trim();
    let Some((number, scale)) =
        UNITS.iter().find_map(|&(unit, scale)| Some((trimmed.strip_suffix(unit)?.trim_end(), scale)))
    else {
        return Err(match trimmed.parse::<f64>() {
            Ok(number) => format!("{number} has no unit; write {number}ms for milliseconds (or us, s)"),
            Err(_) => format!("{trimmed:?} is not a duration; write for example 55ms (units: us, ms, s)"),
        });
    };
    let value: f64 = number
        .parse()
        .map_err(|_| format!("{number:?} is not a number; write for example 55ms (units: us, ms, s)"))?;
    let seconds = value * scale;
    if !(1e-6..=86_400.0).contains(&seconds) {
        return Err(format!("{trimmed} must be from 1us to 86400s"));
    }
    Ok(Duration::from_secs_f64(seconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_carry_their_unit() {
        for (text, micros) in
            [("55ms", 55_000), ("0.055s", 55_000), ("800us", 800), (" 2 s ", 2_000_000), ("1e1ms", 10_000)]
        {
            assert_eq!(duration(text), Ok(Duration::from_micros(micros)), "{text}");
        }
    }

    #[test]
    fn what_is_no_duration_is_refused_with_an_example() {
        assert!(duration("55").unwrap_err().contains("55ms"));
        for text in ["", "ms", "fifty", "5 min", "-5ms", "0s", "NaNs", "infs", "1e9s"] {
            assert!(duration(text).is_err(), "{text}");
        }
    }
}
