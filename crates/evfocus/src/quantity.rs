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

/// An event rate, by the unit that leaves at most three digits before the point: 12 events/s, 3.4 kev/s, 1.2 Mev/s.
pub(crate) fn rate(per_second: f64) -> String {
    if per_second >= 999_950.0 {
        format!("{:.2} Mev/s", per_second * 1e-6)
    } else if per_second >= 999.5 {
        format!("{:.1} kev/s", per_second * 1e-3)
    } else {
        format!("{per_second:.0} events/s")
    }
}

/// Camera time in seconds.
pub(crate) fn seconds(micros: f64) -> String {
    format!("{:.3} s", micros * 1e-6)
}

/// Half the difference of the two directions' answers, from the time that `delay_us` says and the speed in counts per
/// second if it is known. Only for methods without a bias of their own is it a delay, so it is not called one.
pub(crate) fn half_difference(delay_us: f64, speed: Option<f64>) -> String {
    let time = format!("{:.2} ms", delay_us * 1e-3);
    match speed {
        Some(speed) => {
            format!("half the difference of the directions  {:.1} counts ({time})", delay_us * 1e-6 * speed)
        }
        None => format!("half the difference of the directions  {time}"),
    }
}

/// A position in counts with its standard deviation, and how probable it is to be right, as far as they are known.
pub(crate) fn answer(position: f64, error_bar: Option<f64>, confidence: Option<f64>) -> String {
    let error_bar = error_bar.map(|error_bar| format!(" ± {error_bar:.1}")).unwrap_or_default();
    // Rounded down: nothing is quite sure.
    let confidence = confidence.map(|share| format!(", {:.0} % sure", (share * 100.0).floor()));
    format!("{position:.1}{error_bar} counts{}", confidence.unwrap_or_default())
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
    fn an_answer_says_how_sure_it_is() {
        assert_eq!(answer(1892.52, Some(4.26), Some(0.9996)), "1892.5 ± 4.3 counts, 99 % sure");
        assert_eq!(answer(1892.52, None, None), "1892.5 counts");
    }

    #[test]
    fn a_difference_is_told_in_counts_first() {
        let text = half_difference(-72_940.0, Some(1765.0));
        assert_eq!(text, "half the difference of the directions  -128.7 counts (-72.94 ms)");
        assert!(half_difference(5e3, None).ends_with("  5.00 ms"));
    }

    #[test]
    fn rates_have_three_digits_or_so() {
        assert_eq!(rate(12.3), "12 events/s");
        assert_eq!(rate(999.4), "999 events/s");
        assert_eq!(rate(999.6), "1.0 kev/s");
        assert_eq!(rate(999_960.0), "1.00 Mev/s");
        assert_eq!(rate(3_400.0), "3.4 kev/s");
        assert_eq!(rate(1_234_567.0), "1.23 Mev/s");
    }
}
