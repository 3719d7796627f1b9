//! Whether the simulated DAVIS346 keeps up with real time on one core: `cargo bench -p hil-sim --bench real_time`. Ends with an error
//! if it does not. The best of several sweeps counts, since noise only ever adds time.
#![expect(clippy::print_stdout, reason = "the figures are what this program is for")]
#![expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]
#![expect(clippy::expect_used, reason = "a benchmark of broken devices means nothing")]

use std::process::ExitCode;
use std::time::{Duration, Instant};

use hil_sim::{CameraModel, Light, MotionConfig, RigConfig};

#[path = "support/rig.rs"]
mod rig;

use rig::{Bench, STRETCH};

/// Simulated seconds a second.
const LEAST_SPEED: f64 = 1.0;
/// A sweep over the whole range, in stretches.
const SWEEP: u32 = 20;
const REPEATS: u32 = 5;

/// Simulated time by the time that it took, for the best of several sweeps.
fn speed(config: &RigConfig) -> f64 {
    let mut bench = Bench::new(config.clone());
    let mut shortest = Duration::MAX;
    for _ in 0..REPEATS {
        let begin = Instant::now();
        for _ in 0..SWEEP {
            bench.sweep();
            bench.advance();
        }
        shortest = shortest.min(begin.elapsed());
    }
    (STRETCH * SWEEP).as_secs_f64() / shortest.as_secs_f64()
}

fn main() -> ExitCode {
    let still = RigConfig::preset(CameraModel::Davis346, Light::Light);
    let shaken = RigConfig { motion: MotionConfig::hand_held(), ..still.clone() };
    let mut kept_up = true;
    for (name, config) in [("static sweep", still), ("shaken sweep", shaken)] {
        let speed = speed(&config);
        kept_up &= speed >= LEAST_SPEED;
        let verdict = if speed >= LEAST_SPEED { "ok" } else { "FAIL" };
        println!(
            "{verdict}: DAVIS346 in light, {name}: {speed:.2} x real time on one core (at least {LEAST_SPEED})"
        );
    }
    if kept_up { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
