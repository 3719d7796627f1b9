//! Lists of events give back what was put into them, and the store what there was room for.

use evfocus_core::{CameraMicros, DoesNotFit, Event, EventList, EventStore, LARGEST_ADDRESS, Polarity};
use proptest::prelude::*;

const DAYS_US: i64 = 1 << 40;

fn event(t: i64, x: u16, y: u16) -> Event {
    Event { t: CameraMicros(t), x, y, polarity: Polarity::On }
}

/// Events within 12.7 days of the first, wherever that is in time.
fn events() -> impl Strategy<Value = Vec<Event>> {
    let origins = prop_oneof![Just(0), Just(1_763_800_000_000_000_i64), Just(i64::MIN), Just(i64::MAX)];
    let event = (-DAYS_US..DAYS_US, 0..=LARGEST_ADDRESS, 0..=LARGEST_ADDRESS, any::<bool>());
    (origins, prop::collection::vec(event, 1..50)).prop_map(|(origin, events)| {
        let times = events.iter().map(|&(since, ..)| origin.saturating_add(since));
        let times: Vec<i64> = core::iter::once(origin).chain(times.skip(1)).collect();
        let made = times.into_iter().zip(events);
        made.map(|(t, (_, x, y, on))| Event { t: CameraMicros(t), x, y, polarity: Polarity::from_on(on) })
            .collect()
    })
}

proptest! {
    /// Events that fit come back as they were, in their order.
    #[test]
    fn packing_loses_nothing(events in events(), count in 0..60_usize) {
        let mut list = EventList::of(events.iter().copied()).unwrap();
        prop_assert_eq!(&list, &events);
        prop_assert_eq!(list.first(), events.first().copied());
        prop_assert_eq!(list.last(), events.last().copied());
        let (front, back) = events.split_at(count.min(events.len()));
        prop_assert!(list.drain_front(count).eq(front.iter().copied()));
        prop_assert_eq!(&list, &back);
    }

    /// `first_at_or_after` finds what looking at one event after the other finds, in the whole store and in parts of it.
    #[test]
    fn first_at_or_after_is_the_first(
        mut times in prop::collection::vec(0..5_000_i64, 0..100),
        asked in -10..5_010_i64,
        (from, to) in (0..110_usize, 0..110_usize),
    ) {
        times.sort_unstable();
        let list = EventList::of(times.iter().map(|&t| event(t, 1, 2))).unwrap();
        let first = times.iter().position(|&t| t >= asked).unwrap_or(times.len());
        prop_assert_eq!(list.as_slice().first_at_or_after(CameraMicros(asked)), first);
        let mut store = EventStore::with_capacity(100);
        store.append(list.as_slice());
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
fn what_does_not_fit_a_list_is_refused() {
    let mut list = EventList::default();
    for (x, y) in [(LARGEST_ADDRESS + 1, 0), (0, LARGEST_ADDRESS + 1), (u16::MAX, u16::MAX)] {
        assert_eq!(list.push(event(7, x, y)), Err(DoesNotFit::Address { x, y }));
    }
    assert_eq!(list.push(event(100, 1, 2)), Ok(()));
    for time_us in [100 + DAYS_US, 99 - DAYS_US, i64::MIN, i64::MAX] {
        assert_eq!(list.push(event(time_us, 1, 2)), Err(DoesNotFit::Time { time_us, origin_us: 100 }));
    }
    let kept = [event(100, 1, 2), event(99 + DAYS_US, 1, 2), event(100 - DAYS_US, 1, 2)];
    assert_eq!(list.append(kept.into_iter().skip(1).chain([event(i64::MAX, 1, 2)])), 1);
    assert_eq!(list, kept);
    list.clear();
    assert_eq!(list.push(event(i64::MAX, 1, 2)), Ok(()), "an empty list begins anew");
}

#[test]
fn what_a_store_has_no_room_for_is_counted() {
    let times = |store: &EventStore| store.iter().map(|event| event.t.0).collect::<Vec<_>>();
    let list = EventList::of([100, 101, 102].map(|t| event(t, 3, 4))).unwrap();
    let mut store = EventStore::with_capacity(5);
    store.append(list.as_slice());
    assert_eq!((store.len(), store.not_kept(), store.is_complete()), (3, 0, true));
    store.append(list.as_slice());
    assert_eq!((store.len(), store.not_kept(), store.is_complete()), (5, 1, false));
    assert_eq!(times(&store), [100, 101, 102, 100, 101]);
    assert_eq!(store.get(5), None);
    store.start();
    assert!(store.is_empty() && store.is_complete());
    store.append(EventList::of([event(i64::MIN, 3, 4)]).unwrap().as_slice());
    store.append(list.as_slice());
    assert_eq!((times(&store), store.not_kept()), (vec![i64::MIN], 3), "too far from the first");
}
