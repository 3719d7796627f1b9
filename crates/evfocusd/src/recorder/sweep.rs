//! The lens's way through its range while a recording is made: to the lower end, up, and down again, with rests between.

use std::collections::VecDeque;
use std::time::Duration;

use evfocus_core::controller::Action;
use evfocus_core::{HostMicros, LensPosition, LensSample};
use evfocus_hal::LensInfo;

use crate::threads::orders::OrderSender;

/// The lens rests for this long before and after each motion.
const REST: Duration = Duration::from_millis(200);
/// What a motion may take beyond twice its distance by speed, homing among them.
const SLACK: Duration = Duration::from_secs(30);
/// How near to its target the lens must stop, as a share of its range.
const TOLERANCE: f64 = 0.01;

#[derive(Debug)]
pub(super) struct Sweeper {
    lens: LensInfo,
    steps: VecDeque<Step>,
    state: State,
    newest: Option<LensSample>,
}

#[derive(Debug, Clone, Copy)]
enum Step {
    Home,
    Go(LensPosition),
}

#[derive(Debug, Clone, Copy)]
enum State {
    Resting { until: Option<HostMicros> },
    Moving { step: Step, since: HostMicros },
}

impl Sweeper {
    pub(super) fn new(lens: &LensInfo) -> Self {
        let (low, high) = (lens.range.min(), lens.range.max());
        let home = lens.needs_homing.then_some(Step::Home);
        let ways = [Step::Go(low), Step::Go(high), Step::Go(low)];
        Self {
            lens: lens.clone(),
            steps: home.into_iter().chain(ways).collect(),
            state: State::Resting { until: None },
            newest: None,
        }
    }

    /// Takes note of where the lens is.
    pub(super) fn see(&mut self, sample: &LensSample) {
        self.newest = Some(*sample);
    }

    /// Orders what is due; `true` once all is done. A motion that does not end is an error.
    pub(super) fn step(&mut self, now: HostMicros, orders: &OrderSender) -> Result<bool, String> {
        match self.state {
            State::Resting { until: None } => self.state = State::Resting { until: Some(now + REST) },
            State::Resting { until: Some(until) } if now < until => {}
            State::Resting { until: Some(_) } => {
                let Some(step) = self.steps.pop_front() else { return Ok(true) };
                orders.send(match step {
                    Step::Home => Action::Home,
                    Step::Go(target) => Action::MoveLens { target, speed: self.lens.max_speed },
                });
                self.state = State::Moving { step, since: now };
            }
            State::Moving { step, since } => {
                if self.has_ended(step, since) {
                    self.state = State::Resting { until: Some(now + REST) };
                } else if now.since(since) > self.longest() {
                    return Err(self.explain(step));
                }
            }
        }
        Ok(false)
    }

    fn has_ended(&self, step: Step, since: HostMicros) -> bool {
        // An answer to a question from before the order says nothing of it.
        let Some(sample) = self.newest.filter(|sample| sample.requested > since && !sample.moving) else {
            return false;
        };
        match step {
            // A lens that has not begun to home yet does not move either: its rest afterwards has to do.
            Step::Home => sample.requested.since(since) >= REST,
            Step::Go(target) => {
                let tolerance = TOLERANCE * self.lens.range.length();
                (sample.position.0 - target.0).abs() <= tolerance
            }
        }
    }

    fn longest(&self) -> Duration {
        let direct_s = self.lens.range.length() / self.lens.max_speed.counts_per_second();
        Duration::from_secs_f64(2.0 * direct_s) + SLACK
    }

    fn explain(&self, step: Step) -> String {
        let at = self.newest.map_or("it has not said where it is".to_owned(), |sample| {
            format!("it is at {:.1} counts", sample.position.0)
        });
        match step {
            Step::Home => format!("homing did not end within {:?}; {at}", self.longest()),
            Step::Go(target) => {
                format!("it did not come to {:.1} counts within {:?}; {at}", target.0, self.longest())
            }
        }
    }
}
