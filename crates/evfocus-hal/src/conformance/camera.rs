//! What every camera must do.

use std::time::Duration;

use evfocus_core::{CameraMicros, Event, EventBatch, HostMicros, LARGEST_ADDRESS, Polarity};

use super::{ensure, fails, works};
use crate::{Camera, Clock, DeviceErrorKind};

/// A check: a camera, not started, and its clock.
type Check = fn(&mut dyn Camera, &dyn Clock) -> Result<(), String>;

/// All checks by name.
pub(super) const CHECKS: &[(&str, Check)] = &[
    ("camera info is sane", info_is_sane),
    ("read before start is refused", read_before_start_is_refused),
    ("start and stop are idempotent", start_and_stop_are_idempotent),
    ("read clears the batch", read_clears_the_batch),
    ("read returns in time", read_returns_in_time),
    ("event times never decrease", event_times_never_decrease),
    ("events lie on the sensor", events_lie_on_the_sensor),
    ("the batch never grows", the_batch_never_grows),
    ("arrivals are in order", arrivals_are_in_order),
    ("reached is true", reached_is_true),
];

/// How long a check watches the stream.
const WATCH: Duration = Duration::from_millis(300);

/// Timeout of a read while watching.
const TIMEOUT: Duration = Duration::from_millis(20);

/// What a read may take beyond its timeout: a busy machine, a transfer under way.
const GRACE: Duration = Duration::from_millis(250);

/// Reads for a while with batches of `capacity` and shows each to `look`, with the time before the read.
fn watch(
    camera: &mut dyn Camera,
    clock: &dyn Clock,
    capacity: usize,
    mut look: impl FnMut(&EventBatch, HostMicros) -> Result<(), String>,
) -> Result<(), String> {
    works("start", camera.start())?;
    let mut batch = EventBatch::with_capacity(capacity);
    let mut seen = 0;
    let end = clock.now() + WATCH;
    while clock.now() < end {
        let before = clock.now();
        works("read", camera.read(&mut batch, TIMEOUT))?;
        seen += batch.events.len();
        look(&batch, before)?;
    }
    ensure(seen > 0, || format!("no event in {WATCH:?}: this check needs a scene that makes some"))
}

fn info_is_sane(camera: &mut dyn Camera, _: &dyn Clock) -> Result<(), String> {
    let info = camera.info();
    ensure(!info.model.is_empty(), || "the model has no name".to_owned())?;
    ensure(!info.serial.is_empty(), || "the serial number is empty".to_owned())?;
    ensure(info.geometry.pixels() > 0, || format!("the sensor has no pixels: {:?}", info.geometry))?;
    ensure(info.rate_ceiling != Some(0), || "a rate ceiling of zero; unknown is None".to_owned())?;
    works("start", camera.start())?;
    ensure(camera.info() == info, || format!("info changed with start: {info:?}, then {:?}", camera.info()))
}

fn read_before_start_is_refused(camera: &mut dyn Camera, _: &dyn Clock) -> Result<(), String> {
    let mut batch = EventBatch::with_capacity(64);
    fails("read before start", DeviceErrorKind::NotStarted, camera.read(&mut batch, Duration::ZERO))
}

fn start_and_stop_are_idempotent(camera: &mut dyn Camera, _: &dyn Clock) -> Result<(), String> {
    let mut batch = EventBatch::with_capacity(4096);
    works("stop before start", camera.stop())?;
    for round in ["first", "second"] {
        works(&format!("{round} start"), camera.start())?;
        works(&format!("start after the {round} start"), camera.start())?;
        works(&format!("read after the {round} start"), camera.read(&mut batch, TIMEOUT))?;
        works(&format!("{round} stop"), camera.stop())?;
        works(&format!("stop after the {round} stop"), camera.stop())?;
        fails("read after stop", DeviceErrorKind::NotStarted, camera.read(&mut batch, Duration::ZERO))?;
    }
    Ok(())
}

fn read_clears_the_batch(camera: &mut dyn Camera, _: &dyn Clock) -> Result<(), String> {
    // No sensor has such a pixel.
    let stale =
        Event { t: CameraMicros(i64::MIN), x: LARGEST_ADDRESS, y: LARGEST_ADDRESS, polarity: Polarity::Off };
    let mut batch = EventBatch::with_capacity(4096);
    works("start", camera.start())?;
    for _ in 0..3 {
        batch.events.clear();
        ensure(batch.events.push(stale).is_ok(), || "a batch refuses the first event".to_owned())?;
        batch.lost = u64::MAX;
        batch.reached = Some(CameraMicros(i64::MIN));
        works("read", camera.read(&mut batch, TIMEOUT))?;
        ensure(batch.events.iter().all(|event| event != stale), || {
            "an event from before the read is still there".to_owned()
        })?;
        ensure(batch.lost != u64::MAX, || "lost still has its value from before the read".to_owned())?;
        ensure(batch.reached != Some(CameraMicros(i64::MIN)), || {
            "reached is from before the read".to_owned()
        })?;
    }
    Ok(())
}

fn read_returns_in_time(camera: &mut dyn Camera, clock: &dyn Clock) -> Result<(), String> {
    let mut batch = EventBatch::with_capacity(4096);
    works("start", camera.start())?;
    for timeout in [Duration::ZERO, Duration::from_millis(5), Duration::from_millis(50)] {
        let before = clock.now();
        works("read", camera.read(&mut batch, timeout))?;
        let took = clock.now().since(before);
        ensure(took <= timeout + GRACE, || format!("read took {took:?} with a timeout of {timeout:?}"))?;
        ensure(!batch.events.is_empty() || took >= timeout, || {
            format!("an empty batch after {took:?}, before the timeout of {timeout:?}")
        })?;
    }
    Ok(())
}

fn event_times_never_decrease(camera: &mut dyn Camera, clock: &dyn Clock) -> Result<(), String> {
    let mut last = CameraMicros(i64::MIN);
    // Small batches cut the stream in many places.
    watch(camera, clock, 256, |batch, _| {
        for event in batch.events.iter() {
            ensure(event.t >= last, || format!("an event at {} after one at {last}", event.t))?;
            last = event.t;
        }
        Ok(())
    })
}

fn events_lie_on_the_sensor(camera: &mut dyn Camera, clock: &dyn Clock) -> Result<(), String> {
    let geometry = camera.info().geometry;
    watch(camera, clock, 1 << 16, |batch, _| {
        let outside = batch.events.iter().find(|event| !geometry.contains(event.x, event.y));
        outside.map_or(Ok(()), |event| Err(format!("{event:?} on a sensor of {geometry:?}")))
    })
}

fn the_batch_never_grows(camera: &mut dyn Camera, clock: &dyn Clock) -> Result<(), String> {
    let capacity = EventBatch::with_capacity(16).events.capacity();
    watch(camera, clock, 16, |batch, _| {
        let now = batch.events.capacity();
        ensure(now == capacity, || format!("the batch's capacity was {capacity} and is {now}"))
    })
}

fn arrivals_are_in_order(camera: &mut dyn Camera, clock: &dyn Clock) -> Result<(), String> {
    let started = clock.now();
    let mut last = started;
    watch(camera, clock, 4096, |batch, _| {
        let (arrival, now) = (batch.arrival, clock.now());
        ensure(arrival >= last, || {
            format!("arrival {arrival} after {last}; the stream started at {started}")
        })?;
        ensure(arrival <= now, || format!("arrival {arrival} lies in the future; it is {now}"))?;
        last = arrival;
        Ok(())
    })
}

fn reached_is_true(camera: &mut dyn Camera, clock: &dyn Clock) -> Result<(), String> {
    let mut complete = CameraMicros(i64::MIN);
    watch(camera, clock, 512, |batch, _| {
        if let Some(first) = batch.events.first() {
            ensure(first.t >= complete, || {
                format!("an event at {} after all up to {complete} were there", first.t)
            })?;
        }
        let Some(reached) = batch.reached else { return Ok(()) };
        ensure(reached >= complete, || format!("reached went back from {complete} to {reached}"))?;
        complete = reached;
        let last = batch.events.last().map_or(reached, |event| event.t);
        ensure(reached >= last, || format!("reached {reached} with an event at {last} in the batch"))
    })
}
