//! What is asked for reaches the camera's registers and shows in what it sends.

use std::time::Duration;

use evfocus_camera::davis346::{CoarseFine, PixelFilterAxes, TriggerInput};
use evfocus_camera::evk4::RowOrder;
use evfocus_camera::{Driver, davis346, evk4};
use evfocus_core::{Event, Window};
use evfocus_hal::DeviceErrorKind;

use crate::common::Bench;

const ROI: Window = Window { x: 30, y: 20, width: 50, height: 40 };

fn events_of(bench: &Bench, camera: &mut dyn evfocus_hal::Camera) -> Vec<Event> {
    camera.start().unwrap();
    bench.watch(camera, Duration::from_millis(300)).unwrap().0
}

/// The pixel with the most events.
fn busiest(events: &[Event]) -> (u16, u16) {
    let mut counts = std::collections::BTreeMap::<(u16, u16), u32>::new();
    for event in events {
        *counts.entry((event.x, event.y)).or_default() += 1;
    }
    counts.into_iter().max_by_key(|(_, count)| *count).unwrap().0
}

#[test]
fn the_davis346_drops_nothing_by_default() {
    let bench = Bench::new(Driver::Davis346);
    let _camera = bench.open().unwrap();
    // Activity, refractory and skip filter, flattened and suppressed polarities.
    for parameter in [31, 33, 51, 61, 62] {
        assert_eq!(bench.port.register(1, parameter), 0, "parameter {parameter}");
    }
    // A millisecond of 80 MHz that are off by 1.008.
    assert_eq!(bench.port.register(9, 1), 80_640);
    // Bias DiffBn as the maker has it; the window is the whole sensor.
    assert_eq!(bench.port.register(5, 10), 0x427F);
    assert_eq!(
        (41..45).map(|parameter| bench.port.register(1, parameter)).collect::<Vec<_>>(),
        [0, 0, 345, 259]
    );
}

#[test]
fn settings_reach_the_davis346() {
    let bench = Bench::new(Driver::Davis346);
    let settings = davis346::Settings {
        biases: vec![("OnBn".to_owned(), CoarseFine { coarse: 4, fine: 7 })],
        masked_pixels: vec![(3, 200)],
        activity_filter: Some(Duration::from_millis(5)),
        trigger_input: TriggerInput::Falling,
        ..davis346::Settings::default()
    };
    let mut camera = bench.open_davis346(&settings).unwrap();
    camera.start().unwrap();
    let register = |module, parameter| bench.port.register(module, parameter);
    assert_eq!(register(5, 11), 0x407F);
    assert_eq!((register(1, 31), register(1, 32)), (1, 20));
    assert_eq!((register(1, 11), register(1, 12), register(1, 13), register(1, 14)), (200, 3, 260, 346));
    assert_eq!((register(4, 0), register(4, 1), register(4, 2), register(4, 5)), (1, 0, 1, 1260));
    camera.stop().unwrap();
    for (module, parameter) in [(0, 0), (0, 1), (0, 3), (1, 3), (4, 0), (9, 0)] {
        assert_eq!(register(module, parameter), 0, "{module}, {parameter} still runs");
    }
    drop(camera);
    let settings = davis346::Settings { pixel_filter_axes: PixelFilterAxes::Chip, ..settings };
    let _camera = bench.open_davis346(&settings).unwrap();
    assert_eq!((register(1, 11), register(1, 12)), (3, 200));
}

#[test]
fn windows_and_masks_of_the_davis346_are_kept() {
    let bench = Bench::new(Driver::Davis346);
    let roi = davis346::Settings { roi: Some(ROI), ..davis346::Settings::default() };
    let events = events_of(&bench, bench.open_davis346(&roi).unwrap().as_mut());
    assert!(events.len() > 200 && events.iter().all(|event| ROI.place_of(event.x, event.y).is_some()));
    let noisy = busiest(&events);
    let settings = davis346::Settings { masked_pixels: vec![noisy], ..roi };
    let events = events_of(&bench, bench.open_davis346(&settings).unwrap().as_mut());
    assert!(events.len() > 200 && events.iter().all(|event| (event.x, event.y) != noisy));
}

#[test]
fn the_activity_filter_falsifies_the_rate_which_is_why_it_is_off() {
    let bench = Bench::new(Driver::Davis346);
    let all = events_of(&bench, bench.open().unwrap().as_mut()).len();
    let activity_filter = Some(Duration::from_micros(500));
    let settings = davis346::Settings { activity_filter, ..davis346::Settings::default() };
    let filtered = events_of(&bench, bench.open_davis346(&settings).unwrap().as_mut()).len();
    assert!(filtered < all * 9 / 10, "{filtered} of {all}");
}

#[test]
fn the_evk4_drops_nothing_by_default() {
    let bench = Bench::new(Driver::Evk4);
    let _camera = bench.open().unwrap();
    let register = |address| bench.port.register(0, address);
    // Filters bypassed; rate control without dropping by time, columns, rows.
    assert_eq!((register(0xC000), register(0xD000) >> 2 & 1), (0b101, 1));
    assert_eq!((register(0x6050), register(0x6060), register(0x6070)), (0, 0, 0));
    // EVT 3.0; all lines on, none beyond the last row.
    assert_eq!((register(0x7000) >> 1 & 1, register(0x8000) >> 6 & 3), (0, 2));
    assert_eq!(
        (register(0x2000), register(0x209C), register(0x4054), register(0x4058)),
        (0, 0, 0, 0xFFFF_0000)
    );
    // The tables of the rate controller, first and last words.
    assert_eq!((register(0x6400), register(0x67FC)), (0x0001_0000, 0x01FF_01FE));
    assert_eq!((register(0x6800), register(0x6B94), register(0x602C)), (0x0808_0808, 0x0808_0808, 0));
}

#[test]
fn settings_reach_the_evk4() {
    let bench = Bench::new(Driver::Evk4);
    let settings = evk4::Settings {
        biases: vec![("bias_diff_on".to_owned(), 20), ("bias_hpf".to_owned(), 255)],
        masked_pixels: vec![(3, 200)],
        rate_limit: Some(1_000_000),
        anti_flicker_hz: Some((100, 120)),
        trigger_input: true,
        row_order: RowOrder::BottomUp,
        ..evk4::Settings::default()
    };
    let camera = bench.open_evk4(&settings).unwrap();
    let register = |address| bench.port.register(0, address);
    assert_eq!((register(0x1010), register(0x100C)), (0x11A1_007A, 0x11A1_00FF));
    assert_eq!((register(0x9100), register(0x9104)), (1 << 31 | 519 << 16 | 3, 0));
    assert_eq!((register(0x6008), register(0x600C), register(0x6050)), (200, 200, 1));
    // 8.3 and 10 ms in units of 128 us, half of it dark, and 1630 to wait.
    assert_eq!((register(0xC000), register(0xC008), register(0xC0C0) & 0xFFF), (1, 0x8_4E41, 0x65E));
    assert_eq!(register(0x7004) >> 10 & 1, 1);
    // Switched off when it is let go: the output stays disabled.
    drop(camera);
    assert_eq!((register(0x9028), register(0x0004) >> 10 & 1), (2, 0));
}

#[test]
fn windows_masks_and_limits_of_the_evk4_are_kept() {
    let bench = Bench::new(Driver::Evk4);
    let roi = evk4::Settings { roi: Some(ROI), ..evk4::Settings::default() };
    let events = events_of(&bench, bench.open_evk4(&roi).unwrap().as_mut());
    assert!(events.len() > 200 && events.iter().all(|event| ROI.place_of(event.x, event.y).is_some()));
    let noisy = busiest(&events);
    let settings = evk4::Settings { masked_pixels: vec![noisy], ..roi };
    let events = events_of(&bench, bench.open_evk4(&settings).unwrap().as_mut());
    assert!(events.len() > 200 && events.iter().all(|event| (event.x, event.y) != noisy));
    let limit = evk4::Settings { rate_limit: Some(10_000), ..evk4::Settings::default() };
    let events = events_of(&bench, bench.open_evk4(&limit).unwrap().as_mut());
    assert!((200..=3_100).contains(&events.len()), "{} events in 0.3 s", events.len());
}

#[test]
fn what_a_camera_does_not_have_is_refused_before_it_is_touched() {
    let bench = Bench::new(Driver::Davis346);
    let refused = |settings: davis346::Settings, words: &str| {
        let error = bench.open_davis346(&settings).err().unwrap();
        assert_eq!(error.kind, DeviceErrorKind::OutOfRange);
        assert!(error.to_string().contains(words), "{error}");
    };
    let good = davis346::Settings::default();
    let current = CoarseFine { coarse: 9, fine: 0 };
    refused(davis346::Settings { biases: vec![("PrBp".to_owned(), current)], ..good.clone() }, "biases.PrBp");
    refused(davis346::Settings { biases: vec![("Pr".to_owned(), current)], ..good.clone() }, "PrSFBp");
    let wide = Window { x: 300, y: 0, width: 50, height: 10 };
    refused(davis346::Settings { roi: Some(wide), ..good.clone() }, "346x260");
    refused(davis346::Settings { masked_pixels: vec![(0, 0); 9], ..good.clone() }, "can mask 8");
    refused(davis346::Settings { masked_pixels: vec![(346, 0)], ..good.clone() }, "column 346");
    let short = Some(Duration::from_micros(100));
    refused(davis346::Settings { activity_filter: short, ..good.clone() }, "activity_filter: 100");
    refused(davis346::Settings { packet_delay: Duration::from_secs(1), ..good }, "packet_delay: 1s");
    let bench = Bench::new(Driver::Evk4);
    let biases = vec![("bias_fo".to_owned(), -151)];
    let error = bench.open_evk4(&evk4::Settings { biases, ..evk4::Settings::default() }).err().unwrap();
    assert!(error.to_string().contains("from -150 to 200, not -151"), "{error}");
    for band in [(49, 120), (120, 100), (100, 501)] {
        let settings = evk4::Settings { anti_flicker_hz: Some(band), ..evk4::Settings::default() };
        let error = bench.open_evk4(&settings).err().unwrap();
        assert!(error.to_string().contains(&format!("anti_flicker_hz: [{}, {}]", band.0, band.1)), "{error}");
    }
    let settings = evk4::Settings { rate_limit: Some(10), ..evk4::Settings::default() };
    let error = bench.open_evk4(&settings).err().unwrap();
    assert!(error.to_string().contains("rate_limit: 10 events/s"), "{error}");
}
