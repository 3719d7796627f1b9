//! The paper's Algorithm 2 as printed, side by side with the corrected one.

use evfocus_core::search::{Comparison, GOLDEN_RATIO, STOP_INTERVAL_US, golden_search};

/// T in the paper: the length of the sweep, microseconds.
const LENGTH_US: f64 = 4e6;
/// An answer this near to the peak has found it.
const NEAR_US: f64 = 50_000.0;
/// The print has no bound; whoever has not ended by then never will, since the range repeats.
const CAP: u32 = 200;

/// Events of a window that a bell-shaped rate around `peak` makes.
fn events(peak: f64, (from, to): (f64, f64)) -> f64 {
    let width = 0.075 * LENGTH_US;
    libm::erf((to - peak) / width) - libm::erf((from - peak) / width)
}

/// Line by line what the paper prints. `None` if it does not end.
fn printed(peak: f64) -> Option<f64> {
    let (mut from, mut to) = (0.0, LENGTH_US);
    let mut length = to - from;
    for _ in 0..CAP {
        let centre_1 = from + GOLDEN_RATIO * length / 2.0;
        let centre_2 = to - GOLDEN_RATIO * length / 2.0;
        let half = GOLDEN_RATIO * length / 2.0;
        if events(peak, (centre_1 - half, centre_1 + half))
            >= events(peak, (centre_2 - half, centre_2 + half))
        {
            to = GOLDEN_RATIO * length;
        } else {
            from = (1.0 - GOLDEN_RATIO) * length;
        }
        length = to - from;
        if length <= STOP_INTERVAL_US {
            return Some(f64::midpoint(from, to));
        }
    }
    None
}

fn corrected(peak: f64) -> f64 {
    let compare = |first, second| {
        Ok::<_, core::convert::Infallible>(if events(peak, first) >= events(peak, second) {
            Comparison::First
        } else {
            Comparison::Second
        })
    };
    let Ok(((from, to), _)) = golden_search((0.0, LENGTH_US), compare);
    f64::midpoint(from, to)
}

#[test]
fn the_corrected_search_finds_every_peak_and_the_printed_one_hardly_any() {
    // From 1 % to 92.5 % of the sweep.
    let peaks: Vec<f64> = (0..73).map(|index| 40_000.0 + f64::from(index) / 72.0 * 3_660_000.0).collect();
    let mut errors: Vec<f64> = peaks.iter().map(|&peak| (corrected(peak) - peak).abs()).collect();
    errors.sort_by(f64::total_cmp);
    let found = errors.iter().filter(|&&error| error < NEAR_US).count();
    let answers: Vec<Option<f64>> = peaks.iter().map(|&peak| printed(peak)).collect();
    let endless = answers.iter().filter(|answer| answer.is_none()).count();
    let near = |(&peak, answer): (&f64, &Option<f64>)| answer.is_some_and(|t| (t - peak).abs() < NEAR_US);
    let found_by_print = peaks.iter().zip(&answers).filter(|&pair| near(pair)).count();
    println!("corrected: {found} of 73, median error {:.3} ms", errors[36] / 1e3);
    println!("printed: {found_by_print} of 73, {endless} endless");
    assert_eq!(found, 73);
    assert!(errors[36] < 150.0);
    assert_eq!((found_by_print, endless), (1, 33));
}
