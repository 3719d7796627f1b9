//! The counts of a summary, on recordings small enough to count by hand.

use evfocus_core::{EventRate, Geometry};
use evfocus_record::Summary;

use crate::common::file;

fn summary(lines: &str) -> Summary {
    let (_folder, path) = file("events.csv", format!("t_us,x,y,p\n{lines}").as_bytes());
    Summary::of_file(&path, None).unwrap()
}

#[test]
fn counts_rates_and_gaps() {
    // Two events in the first 10 ms, none for a while, three in one window, a silence of exactly 100 ms (no gap).
    let found = summary("0,5,1,1\n9999,0,0,0\n200000,0,9,1\n200001,0,0,1\n209998,0,0,1\n309998,0,0,0\n");
    assert_eq!((found.events, found.on, found.off), (6, 4, 2));
    assert_eq!((found.first_t_us, found.last_t_us), (Some(0), Some(309_998)));
    assert_eq!(found.mean_rate, Some(EventRate(6.0 * 1e6 / 309_998.0)));
    assert_eq!(found.peak_rate, Some(EventRate(300.0)));
    assert_eq!((found.gaps, found.longest_silence_us), (1, 190_001));
    assert_eq!((found.sum_x, found.sum_y, found.sum_t_us), (5, 10, 929_996));
    assert_eq!((found.geometry, found.geometry_inferred), (Some(Geometry { width: 6, height: 10 }), true));
}

#[test]
fn a_clock_that_starts_again_does_not_make_a_peak() {
    let found = summary("500000,0,0,1\n500001,0,0,1\n0,0,0,1\n20000,0,0,1\n40000,0,0,1\n60000,0,0,1\n");
    assert_eq!(found.peak_rate, Some(EventRate(200.0)));
    assert_eq!(found.damage.time_reversals, 1);
    assert_eq!(found.mean_rate, None);
}

#[test]
fn one_event_has_no_mean_rate() {
    let found = summary("7,3,4,0\n");
    assert_eq!((found.mean_rate, found.longest_silence_us), (None, 0));
    assert_eq!(found.peak_rate, Some(EventRate(100.0)));
}
