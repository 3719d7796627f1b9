//! The event store gives back what was put into it.

use evfocus_core::{CameraMicros, Event, EventStore, Polarity};
use proptest::prelude::*;

fn events() -> impl Strategy<Value = (i64, Event)> {
    let origins = prop_oneof![Just(0), Just(1_763_800_000_000_000_i64), -1_000_000_i64..1_000_000];
    (origins, 0..(1_i64 << 35), 0..(1_u16 << 14), 0..(1_u16 << 14), any::<bool>()).prop_map(
        |(origin, since, x, y, on)| {
            (origin, Event { t: CameraMicros(origin + since), x, y, polarity: Polarity::from_on(on) })
        },
    )
}

proptest! {
    /// An event that fits the format comes back as it was.
    #[test]
    fn packing_loses_nothing((origin, event) in events()) {
        let mut store = EventStore::with_capacity(1);
        store.start(CameraMicros(origin));
        store.push(&event);
        prop_assert_eq!(store.get(0), Some(event));
        prop_assert!(store.is_complete());
    }

    /// `first_at_or_after` finds what looking at one event after the other finds, in the whole store and in parts of it.
    #[test]
    fn first_at_or_after_is_the_first(
        mut times in prop::collection::vec(0..5_000_i64, 0..100),
        asked in -10..5_010_i64,
        (from, to) in (0..110_usize, 0..110_usize),
    ) {
        times.sort_unstable();
        let mut store = EventStore::with_capacity(100);
        store.start(CameraMicros(0));
        for &t in &times {
            store.push(&Event { t: CameraMicros(t), x: 1, y: 2, polarity: Polarity::Off });
        }
        let (asked_us, len) = (asked as f64 - 0.25, times.len());
        let expected = times.iter().position(|&t| t as f64 >= asked_us).unwrap_or(len);
        prop_assert_eq!(store.first_at_or_after(asked_us), expected);
        let (from, to) = (from.min(to).min(len), from.max(to).min(len));
        let within = store.first_at_or_after_within(from as u64..to as u64, asked_us);
        prop_assert_eq!(within, expected.clamp(from, to));
        prop_assert!(store.iter_from(to).eq(store.iter().skip(to)) && store.iter_from(len + 1).next().is_none());
    }
}

#[test]
fn what_does_not_fit_is_counted() {
    let event = |t, x, y| Event { t: CameraMicros(t), x, y, polarity: Polarity::On };
    let mut store = EventStore::with_capacity(2);
    store.start(CameraMicros(100));
    for unfit in
        [event(99, 0, 0), event(100, 1 << 14, 0), event(100, 0, 1 << 14), event(100 + (1 << 35), 0, 0)]
    {
        store.push(&unfit);
    }
    assert_eq!((store.len(), store.not_kept()), (0, 4));
    for t in [100, 101, 102] {
        store.push(&event(t, 3, 4));
    }
    assert_eq!((store.len(), store.not_kept(), store.is_complete()), (2, 5, false));
    assert_eq!(store.iter().map(|event| event.t.0).collect::<Vec<_>>(), [100, 101]);
    assert_eq!(store.get(2), None);
    store.start(CameraMicros(0));
    assert!(store.is_empty() && store.is_complete());
}
