//! Windows of the picture.

use evfocus_ipc::{FocusWindow, WindowUnit};

const EXAMPLES: &str = "write X,Y,WIDTH,HEIGHT in pixels, such as 100,80,60,40, or as parts of the picture, such as 0.4,0.4,0.2,0.2 or 40%,40%,20%,20%";

/// Parses `X,Y,WIDTH,HEIGHT`: whole pixels, or parts of the picture if any of them has a decimal point or a `%`.
pub fn window(text: &str) -> Result<FocusWindow, String> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let [x, y, width, height] = parts.as_slice() else {
        return Err(format!("{text:?} does not have four numbers; {EXAMPLES}"));
    };
    let unit = if text.contains(['.', '%']) { WindowUnit::Fraction } else { WindowUnit::Pixels };
    Ok(FocusWindow {
        x: number(x, unit)?,
        y: number(y, unit)?,
        width: number(width, unit)?,
        height: number(height, unit)?,
        unit: Some(unit),
    })
}

fn number(text: &str, unit: WindowUnit) -> Result<f64, String> {
    let (digits, scale) = text.strip_suffix('%').map_or((text, 1.0), |digits| (digits.trim_end(), 0.01));
    let value = digits.parse::<f64>().map_err(|_| format!("{text:?} is not a number; {EXAMPLES}"))? * scale;
    let limit = if unit == WindowUnit::Pixels { f64::MAX } else { 1.0 };
    if (0.0..=limit).contains(&value) {
        Ok(value)
    } else {
        Err(format!(
            "{text} is not {}; {EXAMPLES}",
            match unit {
                WindowUnit::Pixels => "a number of pixels",
                WindowUnit::Fraction => "a part of the picture, 0 to 1",
            }
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_pixels_or_parts() {
        let fraction = Some(WindowUnit::Fraction);
        let half = FocusWindow { x: 0.5, y: 0.0, width: 0.5, height: 1.0, unit: fraction };
        for text in ["0.5,0,0.5,1", "50%,0%,50%,100%", " 50 %, 0, .5, 1"] {
            assert_eq!(window(text), Ok(half), "{text}");
        }
        let unit = Some(WindowUnit::Pixels);
        let pixels = FocusWindow { x: 100.0, y: 80.0, width: 60.0, height: 1.0, unit };
        assert_eq!(window("100,80,60,1"), Ok(pixels));
    }

    #[test]
    fn what_is_no_window_is_refused_with_examples() {
        for text in
            ["", "1,2,3", "1,2,3,4,5", "1,2,3,x", "-1,2,3,4", "1,2,30%,40%", "0.1,0.1,1.5,0.1", "nan,1,1,1"]
        {
            let error = window(text).unwrap_err();
            assert!(error.contains("100,80,60,40") && error.contains("40%"), "{text}: {error}");
        }
    }
}
