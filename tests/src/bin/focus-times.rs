//! How long a focus run takes at each speed, against EGS's full sweep and return, for each class of lens; virtual time, as Markdown:
//! `cargo run --release -p evfocus-tests --bin focus-times`.
#![expect(clippy::print_stdout, reason = "the table is what this program is for")]

use std::time::Duration;

use anyhow::Result;
use evfocus_core::controller::{Command, FocusRequest, Pace};
use evfocus_core::{Directions, LensPosition, LensSpeed, Method, Outcome};
use evfocusd::{Config, VirtualRig};
use hil_sim::{LensConfig, MotionConfig};

/// A class of lenses: name, seconds for the whole range, acceleration in counts per second squared, backlash in counts, time from
/// the question for the position to its answer in microseconds. All have the paper's range of 3530 counts.
struct Class(&'static str, f64, f64, f64, u64);

const CLASSES: [Class; 5] = [
    Class("the paper's: DC motor and potentiometer, 2 s", 2.0, 20_000.0, 0.0, 1_000),
    Class("motorised varifocal: DC motor, 900 counts/s", 3.92, 22_500.0, 15.0, 1_000),
    Class("stepper focuser, 1000 steps/s, 9600 baud", 3.53, 2_000.0, 50.0, 9_400),
    Class("liquid lens, open loop", 0.5, 2_000_000.0, 0.0, 1_000),
    Class("voice coil", 0.3, 2_000_000.0, 0.0, 1_000),
];

/// Where focus lies, as shares of the range, and the shake of the camera, pixels RMS: the means over all of these are printed.
const FOCUSES: [f64; 3] = [0.25, 0.5, 0.75];
const SHAKES: [f64; 2] = [0.0, 2.0];

/// Means over the runs of a cell.
#[derive(Default)]
struct Cell {
    runs: u32,
    focused: u32,
    seconds: f64,
    error: f64,
}

impl Cell {
    fn text(&self) -> String {
        let (seconds, error) = (self.seconds / f64::from(self.runs), self.error / f64::from(self.focused));
        let failed = self.runs - self.focused;
        let failed = if failed == 0 { String::new() } else { format!(", {failed} of {} failed", self.runs) };
        format!("{seconds:.2} s ({error:.1}{failed})")
    }
}

fn requests() -> [FocusRequest; 4] {
    let egs = FocusRequest {
        method: Some(Method::Egs),
        directions: Some(Directions::Forward),
        pace: Some(Pace::Accurate),
        ..FocusRequest::default()
    };
    let [fast, normal, accurate] =
        Pace::ALL.map(|pace| FocusRequest { pace: Some(pace), ..FocusRequest::default() });
    [egs, fast, normal, accurate]
}

fn cell(class: &Class, request: FocusRequest) -> Result<Cell> {
    let &Class(_, sweep_s, acceleration, backlash, round_trip_us) = class;
    let mut cell = Cell::default();
    for (index, share) in FOCUSES.into_iter().enumerate() {
        for shake in SHAKES {
            let mut config = Config::simulated()?;
            let rig = &mut config.rig;
            let range = rig.lens.range;
            rig.lens = LensConfig {
                max_speed: LensSpeed::new(range.length() / sweep_s)?,
                acceleration,
                backlash,
                round_trip: Duration::from_micros(round_trip_us),
                ..rig.lens
            };
            rig.focus = LensPosition((range.min().0 + share * range.length()).round());
            rig.motion =
                MotionConfig { shake_px_rms: shake, roll_rad_rms: 0.0015 * shake, ..MotionConfig::default() };
            rig.seed = index as u64 + 1;
            // A stepper's play is measured when the rig is set up.
            config.lens_backlash = Some(backlash);
            let mut rig = VirtualRig::new(&config)?;
            if request.pace == Some(Pace::Fast) {
                // A fast run counts on what an earlier one has taught of the pixels' delay.
                let normal = FocusRequest { pace: Some(Pace::Normal), ..FocusRequest::default() };
                rig.focus(normal, |_, _, _| {})?;
                // Every run timed begins where the sweep does.
                rig.command(Command::MoveTo(range.min()))?;
                rig.run_for(Duration::from_secs(8));
            }
            let report = rig.focus(request, |_, _, _| {})?;
            cell.runs += 1;
            cell.seconds += report.elapsed().as_secs_f64();
            if let (Outcome::Focused { position }, Some(&truth)) = (report.outcome, rig.truth().first()) {
                cell.focused += 1;
                cell.error += position.distance(truth);
            }
        }
    }
    Ok(cell)
}

fn main() -> Result<()> {
    println!(
        "Time from trigger to verified focus, and the mean absolute error in counts of 3530; {} runs a cell.\n",
        FOCUSES.len() * SHAKES.len()
    );
    println!("| lens | egs, one full sweep and return | fast | normal | accurate |");
    println!("| --- | ---: | ---: | ---: | ---: |");
    let rows: Vec<Result<String>> = std::thread::scope(|scope| {
        let rows: Vec<_> = CLASSES.iter().map(|class| scope.spawn(|| row(class))).collect();
        rows.into_iter()
            .map(|row| row.join().unwrap_or_else(|_| Err(anyhow::anyhow!("a run panicked"))))
            .collect()
    });
    for row in rows {
        println!("{}", row?);
    }
    Ok(())
}

fn row(class: &Class) -> Result<String> {
    let mut cells = vec![class.0.to_owned()];
    for request in requests() {
        cells.push(cell(class, request)?.text());
    }
    Ok(format!("| {} |", cells.join(" | ")))
}
