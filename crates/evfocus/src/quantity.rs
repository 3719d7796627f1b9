//! Numbers with units, as people read them.

/// 1,234,567.
pub(crate) fn count(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// An event rate: 12 events/s, 3.4 kev/s, 1.2 Mev/s.
pub(crate) fn rate(per_second: f64) -> String {
    if per_second >= 1e6 {
        format!("{:.2} Mev/s", per_second * 1e-6)
    } else if per_second >= 1e3 {
        format!("{:.1} kev/s", per_second * 1e-3)
    } else {
        format!("{per_second:.0} events/s")
    }
}

/// Camera time in seconds.
pub(crate) fn seconds(micros: f64) -> String {
    format!("{:.3} s", micros * 1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_stand_in_threes() {
        for (number, text) in [(0, "0"), (999, "999"), (1000, "1,000"), (1_234_567, "1,234,567")] {
            assert_eq!(count(number), text);
        }
    }

    #[test]
    fn rates_have_three_digits_or_so() {
        assert_eq!(rate(12.3), "12 events/s");
        assert_eq!(rate(3_400.0), "3.4 kev/s");
        assert_eq!(rate(1_234_567.0), "1.23 Mev/s");
    }
}
