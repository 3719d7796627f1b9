//! What would catch a wrong `structure`, on sweeps of the simulated rig: a reversed sweep, motors that do not run evenly.
//! The rest of it is in `sweeps.rs`, on recorded sweeps.

use std::time::Duration;

use anyhow::{Context, Result};
use evfocus_core::{
    EventList, Events, HostMicros, LensSpeed, Method, Searcher, SweepCapacity, SweepRecorder,
};
use evfocus_eval::simulated_sweep::{SweepObserver, SweepPlan, Ways};
use hil_sim::{LensConfig, LensKind, Rig, RigConfig, Scene};

struct Collected(EventList);

impl SweepObserver for Collected {
    fn events(&mut self, events: Events<'_>) -> Result<()> {
        Ok(events.iter().try_for_each(|event| self.0.push(event))?)
    }

    fn passed(&mut self, _: HostMicros, _: &Rig) -> Result<()> {
        Ok(())
    }
}

/// The error of `structure` on one sweep with `lens`, the delay of the pixels still in it; lens counts.
fn raw_error(lens: LensConfig, ways: Ways) -> Result<f64> {
    let rig = RigConfig { scene: Scene::DeadLeaves, lens, seed: 5, ..RigConfig::default() };
    let geometry = rig.sensor.geometry;
    let speed = LensSpeed::new(rig.lens.range.length() / 1.5)?;
    let plan = SweepPlan { rig, speed, ways, rest: Duration::ZERO };
    let mut collected = Collected(EventList::default());
    let made = plan.simulate(&mut collected)?;
    let capacity = SweepCapacity { events: collected.0.len(), ..SweepCapacity::default() };
    let mut recorder = SweepRecorder::new(geometry, capacity);
    recorder.start(collected.0.first().context("no events")?.t);
    recorder.feed(collected.0.as_slice());
    let sweep = recorder.sweep(&made.trace).context("no sweep")?;
    let said = Searcher::new(geometry).search(Method::Structure, &sweep, Duration::ZERO)?;
    let truth = made.rig.truth();
    Ok(said.position.counts_from(*truth.first().context("no truth")?))
}

#[test]
fn the_way_back_has_the_opposite_error() -> Result<()> {
    let (up, down) =
        (raw_error(LensConfig::default(), Ways::Up)?, raw_error(LensConfig::default(), Ways::Down)?);
    println!("up {up:+.1}, down {down:+.1}");
    assert!(up > 3.0 && down < -3.0 && (up + down).abs() < 5.0, "{up:+.1} {down:+.1}");
    Ok(())
}

#[test]
fn motors_that_do_not_run_evenly_change_nothing() -> Result<()> {
    let even = raw_error(LensConfig::default(), Ways::Up)?;
    for kind in [LensKind::Rippling, LensKind::Sticking, LensKind::Accelerating] {
        let error = raw_error(kind.into(), Ways::Up)?;
        println!("{kind:?}: {error:+.1}, evenly {even:+.1}");
        assert!((error - even).abs() < 8.0, "{kind:?}: {error:+.1}, evenly {even:+.1}");
    }
    Ok(())
}
