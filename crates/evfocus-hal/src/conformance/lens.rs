//! What every lens must do.

use std::time::Duration;

use evfocus_core::{LensPosition, LensSample, LensSpeed};

use super::{ensure, fails, works};
use crate::{Clock, DeviceErrorKind, Lens};

/// A check: a lens at rest, homed if it must be, and its clock.
type Check = fn(&mut dyn Lens, &dyn Clock) -> Result<(), String>;

/// All checks by name.
pub(super) const CHECKS: &[(&str, Check)] = &[
    ("lens info is sane", info_is_sane),
    ("a target out of range is refused", target_out_of_range_is_refused),
    ("a move arrives in time", move_arrives_in_time),
    ("a move is no faster than asked", move_is_no_faster_than_asked),
    ("a move does not block", move_does_not_block),
    ("samples are in order", samples_are_in_order),
    ("stop stops", stop_stops),
    ("stop at rest is harmless", stop_at_rest_is_harmless),
    ("a new move replaces the old one", new_move_replaces_the_old_one),
];

/// Time between two samples while waiting.
const POLL: Duration = Duration::from_millis(5);

/// What a motion may take beyond distance / speed: acceleration, settling, serial lines.
const GRACE: Duration = Duration::from_secs(1);

/// From stop to standstill.
const BRAKING: Duration = Duration::from_millis(500);

/// Homing at its slowest.
const HOMING: Duration = Duration::from_secs(60);

/// Homes the lens if it needs that, and waits until it is at rest.
pub(super) fn prepare(lens: &mut dyn Lens, clock: &dyn Clock) -> Result<(), String> {
    if lens.info().needs_homing {
        works("home", lens.home())?;
    }
    wait_for_rest(lens, clock, HOMING)
}

/// How far off its target a lens at rest may report itself: 0.5 % of the range.
fn tolerance(lens: &dyn Lens) -> f64 {
    lens.info().range.length() * 0.005
}

/// The position at `share` of the range.
fn place(lens: &dyn Lens, share: f64) -> LensPosition {
    let range = lens.info().range;
    LensPosition(range.min().0 + share * range.length())
}

fn sample(lens: &mut dyn Lens) -> Result<LensSample, String> {
    works("sample", lens.sample())
}

/// Time for `counts` at `speed`.
fn travel_time(counts: f64, speed: LensSpeed) -> Duration {
    Duration::from_secs_f64(counts / speed.counts_per_second())
}

fn wait(clock: &dyn Clock, duration: Duration) {
    clock.sleep_until(clock.now() + duration);
}

fn wait_for_rest(lens: &mut dyn Lens, clock: &dyn Clock, limit: Duration) -> Result<(), String> {
    let end = clock.now() + limit;
    while sample(lens)?.moving {
        ensure(clock.now() < end, || format!("still moving after {limit:?}"))?;
        wait(clock, POLL);
    }
    Ok(())
}

/// Moves to `share` of the range, waits for as long as that may take, and checks the arrival.
fn travel(lens: &mut dyn Lens, clock: &dyn Clock, share: f64, speed: LensSpeed) -> Result<Duration, String> {
    let target = place(lens, share);
    let from = sample(lens)?.position;
    let started = clock.now();
    works("move_to", lens.move_to(target, speed))?;
    wait_for_rest(lens, clock, travel_time(target.distance(from), speed).mul_f64(1.5) + GRACE)?;
    let took = clock.now().since(started);
    arrived(lens, target)?;
    Ok(took)
}

fn arrived(lens: &mut dyn Lens, target: LensPosition) -> Result<(), String> {
    let (position, tolerance) = (sample(lens)?.position, tolerance(lens));
    ensure(position.distance(target) <= tolerance, || {
        format!("sent to {target}, at rest at {position}; {tolerance:.1} off are allowed")
    })
}

/// The lens stays where it is.
fn stays(lens: &mut dyn Lens, clock: &dyn Clock, after: &str) -> Result<(), String> {
    let (before, tolerance) = (sample(lens)?.position, tolerance(lens));
    for _ in 0..20 {
        wait(clock, POLL);
        let sample = sample(lens)?;
        ensure(!sample.moving, || format!("moving after {after}"))?;
        ensure(sample.position.distance(before) <= tolerance, || {
            format!("went from {before} to {} after {after}", sample.position)
        })?;
    }
    Ok(())
}

fn info_is_sane(lens: &mut dyn Lens, _: &dyn Clock) -> Result<(), String> {
    let info = lens.info();
    ensure(!info.model.is_empty(), || "the model has no name".to_owned())?;
    ensure(!info.serial.is_empty(), || "the serial number is empty".to_owned())?;
    let (position, tolerance) = (sample(lens)?.position, tolerance(lens));
    let nearest = info.range.clamp(position);
    ensure(position.distance(nearest) <= tolerance, || format!("at {position}, outside of {}", info.range))
}

fn target_out_of_range_is_refused(lens: &mut dyn Lens, clock: &dyn Clock) -> Result<(), String> {
    let info = lens.info();
    travel(lens, clock, 0.5, info.max_speed)?;
    let beyond = info.range.length() * 0.01;
    for target in [info.range.min().0 - beyond, info.range.max().0 + beyond, f64::NAN, f64::INFINITY] {
        let result = lens.move_to(LensPosition(target), info.max_speed);
        fails(&format!("move_to {target}"), DeviceErrorKind::OutOfRange, result)?;
        stays(lens, clock, &format!("move_to {target} was refused"))?;
    }
    Ok(())
}

fn move_arrives_in_time(lens: &mut dyn Lens, clock: &dyn Clock) -> Result<(), String> {
    let speed = lens.info().max_speed;
    for share in [0.0, 1.0, 0.3, 0.31, 0.31] {
        travel(lens, clock, share, speed)?;
    }
    Ok(())
}

fn move_is_no_faster_than_asked(lens: &mut dyn Lens, clock: &dyn Clock) -> Result<(), String> {
    let fastest = lens.info().max_speed;
    let slow = LensSpeed::new(fastest.counts_per_second() / 2.0).map_err(|error| error.to_string())?;
    travel(lens, clock, 0.2, fastest)?;
    let took = travel(lens, clock, 0.7, slow)?;
    let least = travel_time(lens.info().range.length() * 0.5, slow).mul_f64(0.95);
    ensure(took >= least, || format!("half the range in {took:?}; at the speed asked it takes {least:?}"))
}

fn move_does_not_block(lens: &mut dyn Lens, clock: &dyn Clock) -> Result<(), String> {
    let info = lens.info();
    travel(lens, clock, 0.0, info.max_speed)?;
    let before = clock.now();
    works("move_to", lens.move_to(place(lens, 1.0), info.max_speed))?;
    let took = clock.now().since(before);
    let limit = travel_time(info.range.length(), info.max_speed).mul_f64(0.5);
    ensure(took < limit, || format!("move_to returned after {took:?}: it waited for the motion"))?;
    ensure(sample(lens)?.moving, || "not moving right after the start of a long motion".to_owned())
}

fn samples_are_in_order(lens: &mut dyn Lens, clock: &dyn Clock) -> Result<(), String> {
    let speed = lens.info().max_speed;
    works("move_to", lens.move_to(place(lens, 1.0), speed))?;
    let mut last = clock.now();
    for _ in 0..50 {
        let before = clock.now();
        let LensSample { requested, replied, .. } = sample(lens)?;
        let after = clock.now();
        ensure(requested <= replied, || format!("replied at {replied}, before the request at {requested}"))?;
        ensure(requested >= last, || format!("a request at {requested} after a reply at {last}"))?;
        ensure(requested >= before && replied <= after, || {
            format!("requested {requested}, replied {replied}, but the call took from {before} to {after}")
        })?;
        last = replied;
        wait(clock, POLL);
    }
    Ok(())
}

fn stop_stops(lens: &mut dyn Lens, clock: &dyn Clock) -> Result<(), String> {
    let info = lens.info();
    travel(lens, clock, 0.0, info.max_speed)?;
    let target = place(lens, 1.0);
    works("move_to", lens.move_to(target, info.max_speed))?;
    wait(clock, travel_time(info.range.length(), info.max_speed).mul_f64(0.2));
    works("stop", lens.stop())?;
    wait_for_rest(lens, clock, BRAKING)?;
    stays(lens, clock, "stop")?;
    let position = sample(lens)?.position;
    ensure(position.distance(target) > tolerance(lens), || {
        format!("stopped on the way to {target}, but went there")
    })
}

fn stop_at_rest_is_harmless(lens: &mut dyn Lens, clock: &dyn Clock) -> Result<(), String> {
    let speed = lens.info().max_speed;
    travel(lens, clock, 0.4, speed)?;
    for _ in 0..2 {
        works("stop at rest", lens.stop())?;
        wait_for_rest(lens, clock, BRAKING)?;
        stays(lens, clock, "stop at rest")?;
    }
    travel(lens, clock, 0.6, speed).map(|_| ())
}

fn new_move_replaces_the_old_one(lens: &mut dyn Lens, clock: &dyn Clock) -> Result<(), String> {
    let info = lens.info();
    travel(lens, clock, 0.5, info.max_speed)?;
    works("move_to", lens.move_to(place(lens, 1.0), info.max_speed))?;
    wait(clock, travel_time(info.range.length(), info.max_speed).mul_f64(0.1));
    travel(lens, clock, 0.2, info.max_speed)?;
    stays(lens, clock, "arriving")
}
