//! The clock map against clocks whose relation is known.

use core::time::Duration;

use evfocus_core::{CameraMicros, ClockEvent, ClockMap, HostMicros, NoClockYet};
use proptest::prelude::*;

#[path = "support/random.rs"]
mod random;

use random::Xorshift;

/// Two clocks and a link between them.
#[derive(Debug, Clone, Copy)]
struct Link {
    /// Host time at camera time 0, microseconds.
    offset: i64,
    drift_ppm: f64,
    shortest_delay_us: f64,
    mean_delay_us: f64,
    /// Every third of a second the link hangs for this long.
    burst_us: i64,
}

impl Link {
    fn host(&self, camera: i64) -> f64 {
        self.offset as f64 + camera as f64 * (1.0 + self.drift_ppm * 1e-6)
    }

    /// Transfers of a millisecond of camera time each, from `begin` until `end`: complete up to, and when they arrive.
    fn transfers(self, mut random: Xorshift, begin: i64, end: i64) -> impl Iterator<Item = (i64, i64)> {
        let mut newest = i64::MIN;
        (begin..end).step_by(1_000).map(move |camera| {
            let delay = self.shortest_delay_us + random.exponential(self.mean_delay_us);
            let hang = if camera % 333_000 < self.burst_us { self.burst_us - camera % 333_000 } else { 0 };
            newest = newest.max((self.host(camera) + delay).ceil() as i64 + hang);
            (camera, newest)
        })
    }
}

fn links() -> impl Strategy<Value = Link> {
    let offsets =
        prop_oneof![Just(0), -1_000_000_000_000..1_000_000_000_000_i64, Just(1_763_800_000_000_000)];
    (offsets, -200.0..200.0_f64, 10.0..500.0_f64, 10.0..1_000.0_f64, prop_oneof![Just(0), Just(30_000_i64)])
        .prop_map(|(offset, drift_ppm, shortest_delay_us, mean_delay_us, burst_us)| Link {
            offset,
            drift_ppm,
            shortest_delay_us,
            mean_delay_us,
            burst_us,
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// After fifteen seconds the map tells offset plus shortest delay to 100 us and the drift to 10 ppm, delays and bursts whatever.
    #[test]
    fn offset_and_drift_are_found(link in links(), seed in any::<u64>()) {
        let mut map = ClockMap::new(None);
        for (camera, arrival) in link.transfers(Xorshift::new(seed), 0, 15_000_000) {
            prop_assert_eq!(map.observe(CameraMicros(camera), HostMicros(arrival)), ClockEvent::Steady);
        }
        let quality = map.quality();
        prop_assert!((quality.drift_ppm - link.drift_ppm).abs() < 10.0, "{:?}", quality);
        for camera in [5_000_000, 10_000_000, 15_000_000] {
            let expected = link.host(camera) + link.shortest_delay_us;
            let error = map.to_host(CameraMicros(camera))?.0 as f64 - expected;
            prop_assert!(error.abs() < 100.0, "{} us at {}", error, camera);
        }
    }

    /// The line lies above no observation of its window by more than drift within a bucket that was not known then can explain.
    #[test]
    fn the_line_is_an_envelope(link in links(), seed in any::<u64>(), end_ms in 10..12_000_i64) {
        let mut map = ClockMap::new(None);
        let transfers: Vec<_> = link.transfers(Xorshift::new(seed), 0, end_ms * 1_000).collect();
        for &(camera, arrival) in &transfers {
            map.observe(CameraMicros(camera), HostMicros(arrival));
        }
        for (camera, arrival) in transfers {
            let above = map.to_host(CameraMicros(camera))?.micros_since(HostMicros(arrival));
            prop_assert!(above <= 51, "{} us above the observation at {}", above, camera);
        }
    }

    /// Camera to host and back is the identity to a microsecond.
    #[test]
    fn there_and_back_is_the_identity(link in links(), seed in any::<u64>(), asked in -20_000_000..40_000_000_i64) {
        let mut map = ClockMap::new(None);
        for (camera, arrival) in link.transfers(Xorshift::new(seed), 0, 3_000_000) {
            map.observe(CameraMicros(camera), HostMicros(arrival));
        }
        let back = map.to_camera(map.to_host(CameraMicros(asked))?)?;
        prop_assert!(back.micros_since(CameraMicros(asked)).abs() <= 1);
    }

    /// A counter that wraps tells the same as one that does not, and each wrap is reported once.
    #[test]
    fn wraps_make_no_difference(
        link in links(),
        seed in any::<u64>(),
        period in prop_oneof![Just(1_i64 << 31), Just(1 << 24), Just(1 << 22)],
        to_wrap in 0..3_000_000_i64,
        disorder in 0..5_i64,
    ) {
        let begin = period - to_wrap - 1;
        let (mut wrapping, mut plain) = (ClockMap::new(Some(Duration::from_micros(period as u64))), ClockMap::new(None));
        let mut wraps = 0;
        for (camera, arrival) in link.transfers(Xorshift::new(seed), begin, begin + 12_000_000) {
            // Now and then a transfer that is a little older than the one before.
            for camera in [camera, camera - disorder] {
                let raw = CameraMicros(camera.rem_euclid(period));
                wraps += i64::from(wrapping.observe(raw, HostMicros(arrival)) == ClockEvent::Wrapped);
                plain.observe(CameraMicros(camera), HostMicros(arrival));
            }
            prop_assert_eq!(wrapping.newest(), plain.newest());
        }
        prop_assert_eq!(wrapping.quality(), plain.quality());
        let last = begin + 12_000_000 - 1_000;
        prop_assert_eq!(wraps, last / period - begin / period);
    }

    /// Whatever camera and host say, the map does not panic and answers.
    #[test]
    fn garbage_does_no_harm(
        observations in prop::collection::vec((any::<i64>(), any::<i64>()), 1..300),
        small in prop::collection::vec((0..5_000_000_i64, 0..5_000_000_i64), 0..300),
        period in prop::option::of(0..100_000_000_u64),
        asked in any::<i64>(),
    ) {
        let mut map = ClockMap::new(period.map(Duration::from_micros));
        for (camera, arrival) in observations.into_iter().chain(small) {
            map.observe(CameraMicros(camera), HostMicros(arrival));
            map.to_host(CameraMicros(asked))?;
            map.to_camera(HostMicros(asked))?;
            map.unwrap_time(CameraMicros(asked));
            map.quality();
        }
    }
}

const LINK: Link = Link {
    offset: 7_000_000,
    drift_ppm: 40.0,
    shortest_delay_us: 100.0,
    mean_delay_us: 300.0,
    burst_us: 30_000,
};

/// A map that has seen `seconds` of [`LINK`].
fn after(seconds: i64, period: Option<Duration>) -> ClockMap {
    let mut map = ClockMap::new(period);
    for (camera, arrival) in LINK.transfers(Xorshift::new(1), 0, seconds * 1_000_000) {
        map.observe(CameraMicros(camera), HostMicros(arrival));
    }
    map
}

#[test]
fn before_the_first_observation_there_is_no_answer() {
    let map = ClockMap::new(None);
    assert_eq!(map.to_host(CameraMicros(0)), Err(NoClockYet));
    assert_eq!(map.to_camera(HostMicros(0)), Err(NoClockYet));
    assert_eq!((map.newest(), map.quality().observations), (None, 0));
    assert_eq!(map.unwrap_time(CameraMicros(3)), CameraMicros(3));
}

#[test]
fn a_camera_that_starts_anew_is_noticed_and_learnt_again() {
    // From zero, and with a leap ahead.
    for base in [0, 60_000_000] {
        let mut map = after(5, None);
        let restart = HostMicros(LINK.host(5_000_000) as i64 + 1_000);
        assert_eq!(map.observe(CameraMicros(base), restart), ClockEvent::Reset);
        for step in 1..20_000_i64 {
            let event = map.observe(CameraMicros(base + step * 1_000), HostMicros(restart.0 + step * 1_000));
            assert_eq!(event, ClockEvent::Steady);
        }
        assert_eq!(map.quality().resets, 1);
        assert_eq!(map.quality().observations, 20_000);
        assert_eq!(map.to_host(CameraMicros(base + 3_000_000)), Ok(HostMicros(restart.0 + 3_000_000)));
    }
}

#[test]
fn disorder_within_ten_milliseconds_is_no_restart() {
    let mut map = after(2, None);
    let now = HostMicros(LINK.host(2_000_000) as i64 + 5_000);
    assert_eq!(map.observe(CameraMicros(1_992_000), now), ClockEvent::Steady);
    assert_eq!(map.observe(CameraMicros(1_981_000), now), ClockEvent::Reset);
}

#[test]
fn a_camera_that_says_nothing_for_a_while_goes_on() {
    // Longer than half a wrap period, and longer than several.
    for (silence, period) in [(4, None), (9, Some(1 << 24)), (40, Some(1 << 23))] {
        let mut map = after(5, period.map(Duration::from_micros));
        let resumed = 5_000_000 + silence * 1_000_000;
        let arrival = HostMicros(LINK.host(resumed) as i64 + 200);
        let raw = period.map_or(resumed, |period| resumed.rem_euclid(period as i64));
        assert_ne!(map.observe(CameraMicros(raw), arrival), ClockEvent::Reset);
        assert_eq!(map.newest(), Some(CameraMicros(resumed)));
        assert!(map.to_host(CameraMicros(resumed)).unwrap().micros_since(arrival).abs() < 500);
    }
}

#[test]
fn transfers_that_a_busy_host_takes_late_are_no_restart() {
    let mut map = after(5, None);
    let before = map.to_host(CameraMicros(8_000_000)).unwrap();
    // Three seconds of transfers, all at once.
    let arrival = HostMicros(LINK.host(8_000_000) as i64);
    for camera in (5_000_000..8_000_000).step_by(1_000) {
        assert_eq!(map.observe(CameraMicros(camera), arrival), ClockEvent::Steady);
    }
    assert!(map.to_host(CameraMicros(8_000_000)).unwrap().micros_since(before).abs() < 200);
}

#[test]
fn a_camera_clock_that_stood_still_shows_in_the_residual_until_it_is_forgotten() {
    let mut map = after(5, None);
    let stop = LINK.host(5_000_000) as i64 + 2_000_000;
    let mut camera = 5_000_000;
    for (seconds, is_known) in [(5, false), (15, true)] {
        for _ in 0..seconds * 1_000 {
            camera += 1_000;
            map.observe(CameraMicros(camera), HostMicros(stop + camera - 5_000_000));
        }
        assert_eq!(map.quality().residual_us < 100.0, is_known, "{:?}", map.quality());
    }
    assert_eq!(map.to_host(CameraMicros(camera)), Ok(HostMicros(stop + camera - 5_000_000)));
}
