//! The loop against a motor of a few lines: inertia, dead band, coarse readings.

use std::time::Duration;

use super::*;

const STEP: Duration = Duration::from_millis(2);

fn config() -> DriveConfig {
    DriveConfig {
        range: LensRange::new(LensPosition(220.0), LensPosition(3750.0)).unwrap(),
        max_speed: LensSpeed::new(900.0).unwrap(),
        acceleration: 4000.0,
        dead_band: 0.12,
        tolerance: 2.0,
        at_zero: 0.0,
        at_full: 4095.0,
        reversed: false,
    }
}

/// A motor with a time constant of 40 ms.
struct Motor {
    position: f64,
    velocity: f64,
    fastest: f64,
    /// Counts of one step of the readings.
    grain: f64,
    /// -1: wired the wrong way round; 0: no power.
    wiring: f64,
}

impl Motor {
    fn new() -> Self {
        Self { position: 1000.0, velocity: 0.0, fastest: 900.0, grain: 4.0, wiring: 1.0 }
    }

    fn run(&mut self, drive: f64) -> LensPosition {
        let share = ((drive.abs() - 0.12) / 0.88).max(0.0) * drive.signum() * self.wiring;
        for _ in 0..20 {
            self.velocity += (share * self.fastest - self.velocity) * 1e-4 / 0.04;
            self.position = (self.position + self.velocity * 1e-4).clamp(200.0, 3800.0);
        }
        LensPosition((self.position / self.grain).round() * self.grain)
    }
}

/// Runs until rest, and gives the positions, one each 2 ms.
fn run(drive: &mut Drive, motor: &mut Motor, now: &mut HostMicros) -> Result<Vec<f64>, DriveFault> {
    let (mut output, mut way) = (0.0, Vec::new());
    for _ in 0..20_000 {
        *now += STEP;
        output = drive.follow(*now, motor.run(output))?;
        way.push(motor.position);
        if !drive.is_moving() {
            return Ok(way);
        }
    }
    panic!("still moving at {}", motor.position);
}

fn send(motor: &mut Motor, target: f64, speed: f64) -> Result<Vec<f64>, DriveFault> {
    let (mut drive, mut now) = (Drive::new(config()), HostMicros(0));
    drive.follow(now, motor.run(0.0))?;
    drive.aim(LensPosition(target), LensSpeed::new(speed).unwrap());
    run(&mut drive, motor, &mut now)
}

#[test]
fn it_arrives_within_two_counts_at_the_speed_asked() {
    for fastest in [700.0, 900.0, 1100.0] {
        for target in [3700.0, 230.0, 1010.0] {
            let mut motor = Motor { grain: 1.0, fastest, ..Motor::new() };
            let way = send(&mut motor, target, 600.0).unwrap();
            assert!((motor.position - target).abs() <= 2.5, "{} of {target}", motor.position);
            let (from, to) = (1000.0 + 0.1 * (target - 1000.0), 1000.0 + 0.9 * (target - 1000.0));
            let inside = |at: &&f64| (**at > from.min(to)) && (**at < from.max(to));
            let seconds = way.iter().filter(inside).count() as f64 * 0.002;
            let speed = (to - from).abs() / seconds;
            if (target - 1000.0).abs() > 1000.0 {
                assert!((speed / 600.0 - 1.0).abs() < 0.05, "{speed} with a motor of {fastest}");
            }
        }
    }
}

#[test]
fn coarse_readings_leave_half_a_step() {
    let mut motor = Motor::new();
    send(&mut motor, 2001.0, 900.0).unwrap();
    assert!((motor.position - 2001.0).abs() <= 4.0, "{}", motor.position);
}

#[test]
fn a_motor_without_power_and_an_end_of_the_way_are_stalls() {
    let mut dead = Motor { wiring: 0.0, ..Motor::new() };
    assert_eq!(send(&mut dead, 3000.0, 900.0), Err(DriveFault::Stalled));
    let mut at_its_end = Motor { position: 3800.0, ..Motor::new() };
    assert_eq!(send(&mut at_its_end, 3900.0, 900.0), Err(DriveFault::Stalled));
}

#[test]
fn a_motor_that_goes_the_other_way_is_cut_early() {
    let mut motor = Motor { wiring: -1.0, position: 2000.0, ..Motor::new() };
    assert_eq!(send(&mut motor, 3000.0, 900.0), Err(DriveFault::WrongWay));
    assert!(motor.position > 1700.0, "{}", motor.position);
}

#[test]
fn a_new_target_on_the_way_is_no_fault() {
    let (mut drive, mut motor, mut now) = (Drive::new(config()), Motor::new(), HostMicros(0));
    let mut output = drive.follow(now, motor.run(0.0)).unwrap();
    drive.aim(LensPosition(3000.0), LensSpeed::new(900.0).unwrap());
    for _ in 0..400 {
        now += STEP;
        output = drive.follow(now, motor.run(output)).unwrap();
    }
    drive.aim(LensPosition(500.0), LensSpeed::new(900.0).unwrap());
    run(&mut drive, &mut motor, &mut now).unwrap();
    assert!((motor.position - 500.0).abs() <= 4.0, "{}", motor.position);
}

#[test]
fn a_cut_motor_coasts_to_rest_undriven() {
    let (mut drive, mut motor, mut now) = (Drive::new(config()), Motor::new(), HostMicros(0));
    let mut output = drive.follow(now, motor.run(0.0)).unwrap();
    drive.aim(LensPosition(3000.0), LensSpeed::new(900.0).unwrap());
    for _ in 0..200 {
        now += STEP;
        output = drive.follow(now, motor.run(output)).unwrap();
    }
    assert!(output > 0.5);
    drive.cut(now);
    let before = motor.position;
    run(&mut drive, &mut motor, &mut now).unwrap();
    assert!(motor.position - before < 60.0);
}
