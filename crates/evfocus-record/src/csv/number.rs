//! Fields of a line as numbers.

/// Digits after the point that a microsecond has.
const MICRO_DIGITS: usize = 6;

/// Whether the field is a number with a point or an exponent, as times in seconds are written.
pub(super) fn is_fractional(field: &str) -> bool {
    field.contains(['.', 'e', 'E']) && field.parse::<f64>().is_ok_and(f64::is_finite)
}

/// Seconds as microseconds, rounded to the nearest. Decimal notation is exact at any size, which a float is not: Unix times
/// have sixteen digits.
pub(super) fn seconds(field: &str) -> Option<i64> {
    if !field.contains(['e', 'E'])
        && let Some(micros) = decimal_seconds(field)
    {
        return Some(micros);
    }
    let micros = (field.parse::<f64>().ok()? * 1e6).round();
    (micros.abs() < i64::MAX as f64).then_some(micros as i64)
}

fn decimal_seconds(field: &str) -> Option<i64> {
    let (negative, digits) = match field.strip_prefix('-') {
        Some(digits) => (true, digits),
        None => (false, field.strip_prefix('+').unwrap_or(field)),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let all_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if digits.len() < 2 && whole.is_empty() || !all_digits(whole) || !all_digits(fraction) {
        return None;
    }
    let whole: i64 = if whole.is_empty() { 0 } else { whole.parse().ok()? };
    let mut padded = fraction.bytes().chain(std::iter::repeat(b'0'));
    let micros = padded.by_ref().take(MICRO_DIGITS).fold(0, |sum, digit| sum * 10 + i64::from(digit - b'0'));
    let round_up = i64::from(padded.next().is_some_and(|digit| digit >= b'5'));
    let magnitude = whole.checked_mul(1_000_000)?.checked_add(micros + round_up)?;
    Some(if negative { -magnitude } else { magnitude })
}

/// 1 or 0, 1 or -1, true or false, on or off; a sign of "+" is allowed.
pub(super) fn polarity(field: &str) -> Option<bool> {
    match field {
        "1" | "+1" => Some(true),
        "0" | "-1" => Some(false),
        _ if field.eq_ignore_ascii_case("true") || field.eq_ignore_ascii_case("on") => Some(true),
        _ if field.eq_ignore_ascii_case("false") || field.eq_ignore_ascii_case("off") => Some(false),
        _ => None,
    }
}
