//! Windows of a request, in whatever unit, as rectangles of pixels.

use evfocus_core::search::MOST_WINDOWS;
use evfocus_core::{Geometry, Window, Windows};
use evfocus_ipc::{Error, FocusWindow, WindowUnit};

use crate::wire::invalid;

/// Fractions that add up to no more than this are meant to add up to one.
const WHOLE: f64 = 1.0 + 1e-9;

/// `given` on a sensor of `geometry`.
pub fn in_pixels(given: &[FocusWindow], geometry: Geometry) -> Result<Windows, Error> {
    if given.len() > MOST_WINDOWS {
        let remedy = format!("at most {MOST_WINDOWS} windows are looked at");
        return Err(invalid("windows", &format!("{} windows", given.len()), &remedy));
    }
    let mut windows = Windows::default();
    for (index, (place, window)) in windows.iter_mut().zip(given).enumerate() {
        *place = Some(one(index, window, geometry)?);
    }
    Ok(windows)
}

fn one(index: usize, given: &FocusWindow, geometry: Geometry) -> Result<Window, Error> {
    let FocusWindow { x, y, width, height, unit } = *given;
    let (columns, rows) = (f64::from(geometry.width), f64::from(geometry.height));
    let refuse = |remedy: String| {
        Err(invalid("windows", &format!("{x}, {y}, {width}, {height}"), &format!("window {index}: {remedy}")))
    };
    let is_within = |start: f64, size: f64, limit: f64| start >= 0.0 && size > 0.0 && start + size <= limit;
    match unit.unwrap_or(WindowUnit::Pixels) {
        WindowUnit::Pixels => {
            if [x, y, width, height].iter().any(|number| number.fract() != 0.0) {
                return refuse(
                    "pixels are whole numbers; for parts of the picture the unit is fraction".to_owned(),
                );
            }
            if !(is_within(x, width, columns) && is_within(y, height, rows)) {
                return refuse(format!(
                    "{width} x {height} pixels at {x}, {y} do not lie on the sensor of {columns} x {rows} pixels"
                ));
            }
            Ok(Window { x: x as u16, y: y as u16, width: width as u16, height: height as u16 })
        }
        WindowUnit::Fraction => {
            if !(is_within(x, width, WHOLE) && is_within(y, height, WHOLE)) {
                return refuse(format!(
                    "{width} x {height} of the picture at {x}, {y} do not lie within it; it goes from 0 to 1"
                ));
            }
            let (x, width) = span(x, width, columns);
            let (y, height) = span(y, height, rows);
            Ok(Window { x, y, width, height })
        }
    }
}

/// First pixel and number of pixels of what begins at `start` and is `size` long, as parts of `pixels`: at least one pixel, and none
/// beyond the end.
fn span(start: f64, size: f64, pixels: f64) -> (u16, u16) {
    let first = (start * pixels).round().min(pixels - 1.0);
    let end = ((start + size) * pixels).round().clamp(first + 1.0, pixels);
    (first as u16, (end - first) as u16)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DAVIS346: Geometry = Geometry { width: 346, height: 260 };

    fn window(x: f64, y: f64, width: f64, height: f64, unit: Option<WindowUnit>) -> FocusWindow {
        FocusWindow { x, y, width, height, unit }
    }

    #[test]
    fn fractions_become_pixels() {
        let fraction = Some(WindowUnit::Fraction);
        for (given, expected) in [
            (window(0.0, 0.0, 1.0, 1.0, fraction), Window::whole(DAVIS346)),
            (window(0.25, 0.5, 0.5, 0.25, fraction), Window { x: 87, y: 130, width: 173, height: 65 }),
            (window(0.9, 0.7, 0.1, 0.3, fraction), Window { x: 311, y: 182, width: 35, height: 78 }),
            (
                window(0.9999, 0.9999, 0.0001, 0.0001, fraction),
                Window { x: 345, y: 259, width: 1, height: 1 },
            ),
            (window(10.0, 20.0, 30.0, 40.0, None), Window { x: 10, y: 20, width: 30, height: 40 }),
        ] {
            let windows = in_pixels(&[given], DAVIS346).unwrap();
            assert_eq!(windows[0], Some(expected), "{given:?}");
            assert!(expected.fits(DAVIS346), "{expected:?}");
        }
    }

    #[test]
    fn a_window_off_the_sensor_is_named() {
        let good = window(0.0, 0.0, 10.0, 10.0, None);
        let (pixels, fraction) = (Some(WindowUnit::Pixels), Some(WindowUnit::Fraction));
        for (bad, words) in [
            (window(340.0, 0.0, 10.0, 10.0, pixels), "346 x 260"),
            (window(-1.0, 0.0, 10.0, 10.0, pixels), "sensor"),
            (window(0.0, 0.0, 0.0, 10.0, pixels), "sensor"),
            (window(0.0, 1e9, 5.0, 10.0, pixels), "sensor"),
            (window(0.5, 0.0, 10.0, 10.0, pixels), "whole numbers"),
            (window(f64::NAN, 0.0, 10.0, 10.0, pixels), "whole numbers"),
            (window(0.5, 0.5, 0.6, 0.5, fraction), "from 0 to 1"),
            (window(0.5, 0.5, f64::NAN, 0.5, fraction), "from 0 to 1"),
        ] {
            let error = in_pixels(&[good, bad], DAVIS346).unwrap_err().to_string();
            assert!(error.contains("window 1") && error.contains(words), "{error}");
        }
        let error = in_pixels(&[good; 9], DAVIS346).unwrap_err().to_string();
        assert!(error.contains("at most 8"), "{error}");
    }
}
