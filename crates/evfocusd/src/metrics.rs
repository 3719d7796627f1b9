//! Figures for Prometheus: what they are, and their text form. [`serve`] has the ways out.

mod serve;
mod text;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use evfocus_core::controller::Snapshot;
use evfocus_ipc::Report;

use crate::vitals::{LATENCIES_US, Vitals};

pub(crate) use serve::{answer, keep_file};
use text::Text;

/// Upper ends of the focus times that are told apart, seconds.
const FOCUS_TIMES_S: [f64; 8] = [0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 60.0];
/// Upper ends of the error bars that are told apart, lens counts.
const ERROR_BARS: [f64; 8] = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 500.0];

/// The figures since the daemon started. Clones share them.
#[derive(Debug, Clone)]
pub(crate) struct Metrics {
    figures: Arc<Mutex<Figures>>,
    vitals: Vitals,
}

#[derive(Debug, Default)]
struct Figures {
    /// By state and reason.
    runs: BTreeMap<(&'static str, String), u64>,
    focus_time_s: Histogram<{ FOCUS_TIMES_S.len() }>,
    error_bar: Histogram<{ ERROR_BARS.len() }>,
    run_events: u64,
    events: u64,
    lost: u64,
    event_rate: f64,
    continuous_runs: u64,
    camera: Health,
    lens: Health,
}

/// A device: whether it is there, and how often it came back.
#[derive(Debug, Default)]
struct Health {
    ready: bool,
    seen: bool,
    reconnects: u64,
}

impl Health {
    fn observe(&mut self, ready: bool) {
        if ready && !self.ready && self.seen {
            self.reconnects += 1;
        }
        self.seen |= ready;
        self.ready = ready;
    }
}

#[derive(Debug)]
struct Histogram<const LIMITS: usize> {
    counts: [u64; LIMITS],
    count: u64,
    sum: f64,
}

impl<const LIMITS: usize> Default for Histogram<LIMITS> {
    fn default() -> Self {
        Self { counts: [0; LIMITS], count: 0, sum: 0.0 }
    }
}

impl<const LIMITS: usize> Histogram<LIMITS> {
    fn add(&mut self, value: f64, limits: &[f64; LIMITS]) {
        if let Some(count) = self.counts.get_mut(limits.partition_point(|&limit| limit < value)) {
            *count += 1;
        }
        self.count += 1;
        self.sum += value;
    }

    fn write(&self, text: &mut Text, title: (&str, &str), limits: &[f64; LIMITS]) {
        text.histogram(title, limits, &self.counts, self.count, self.sum);
    }
}

impl Metrics {
    pub(crate) fn new(vitals: Vitals) -> Self {
        Self { figures: Arc::default(), vitals }
    }

    /// Counters are whole after every statement, so a panic elsewhere does not spoil them.
    fn figures(&self) -> MutexGuard<'_, Figures> {
        self.figures.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes what the control thread published.
    pub(crate) fn observe(&self, snapshot: &Snapshot) {
        let mut figures = self.figures();
        (figures.events, figures.lost) = (snapshot.events, snapshot.lost);
        figures.event_rate = snapshot.event_rate.0;
        figures.continuous_runs = snapshot.continuous_runs;
        figures.camera.observe(snapshot.camera_ready);
        figures.lens.observe(snapshot.lens_ready);
    }

    /// Notes a run that ended.
    pub(crate) fn count(&self, report: &Report) {
        let mut figures = self.figures();
        let result = &report.result;
        let reason = result.reason.clone().unwrap_or_default();
        *figures.runs.entry((result.state.name(), reason)).or_default() += 1;
        figures.focus_time_s.add(report.elapsed_s, &FOCUS_TIMES_S);
        if let Some(error_bar) = result.error_bar {
            figures.error_bar.add(error_bar, &ERROR_BARS);
        }
        figures.run_events += report.events.counted;
    }

    /// All of it in Prometheus's text form.
    pub(crate) fn text(&self) -> String {
        let figures = self.figures();
        let mut text = Text::default();
        text.head("evfocus_build_info", "gauge", "The daemon's version");
        text.sample("evfocus_build_info", &[("version", env!("CARGO_PKG_VERSION"))], 1.0);
        text.head("evfocus_runs_total", "counter", "Focus runs that ended, by state and reason");
        for ((state, reason), count) in &figures.runs {
            text.sample("evfocus_runs_total", &[("state", state), ("reason", reason)], *count as f64);
        }
        figures.focus_time_s.write(
            &mut text,
            ("evfocus_focus_seconds", "Time from trigger to result"),
            &FOCUS_TIMES_S,
        );
        figures.error_bar.write(
            &mut text,
            ("evfocus_error_bar_counts", "Error bars of answers, lens counts"),
            &ERROR_BARS,
        );
        for (name, kind, help, value) in [
            ("evfocus_run_events_total", "counter", "Events counted in sweeps", figures.run_events as f64),
            (
                "evfocus_continuous_runs_total",
                "counter",
                "Focus runs that continuous mode started",
                figures.continuous_runs as f64,
            ),
            ("evfocus_events_total", "counter", "Events read from the camera", figures.events as f64),
            ("evfocus_events_lost_total", "counter", "Events known to be lost", figures.lost as f64),
            ("evfocus_event_rate", "gauge", "Events per second", figures.event_rate),
        ] {
            text.head(name, kind, help);
            text.sample(name, &[], value);
        }
        let devices = [("camera", &figures.camera), ("lens", &figures.lens)];
        text.head("evfocus_device_up", "gauge", "Whether the device answers");
        for (device, health) in devices {
            text.sample("evfocus_device_up", &[("device", device)], f64::from(u8::from(health.ready)));
        }
        text.head("evfocus_device_reconnects_total", "counter", "How often the device came back");
        for (device, health) in devices {
            text.sample("evfocus_device_reconnects_total", &[("device", device)], health.reconnects as f64);
        }
        self.of_the_loop(&mut text);
        text.into_string()
    }

    /// What the control thread counts itself.
    fn of_the_loop(&self, text: &mut Text) {
        let (batches, samples) = self.vitals.most_waiting();
        text.head("evfocus_queue_high_water", "gauge", "The most that ever waited in a queue");
        for (queue, most) in [("batches", batches), ("lens_samples", samples)] {
            text.sample("evfocus_queue_high_water", &[("queue", queue)], most as f64);
        }
        let (counts, sum_us) = self.vitals.latencies();
        let (name, help) = ("evfocus_batch_latency_seconds", "From a batch's arrival to its being counted");
        let limits = LATENCIES_US.map(|us| us as f64 * 1e-6);
        text.histogram((name, help), &limits, &counts, counts.iter().sum(), sum_us as f64 * 1e-6);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_that_comes_back_is_counted_and_one_that_comes_first_is_not() {
        let mut health = Health::default();
        for ready in [false, true, true, false, false, true, false, true] {
            health.observe(ready);
        }
        assert_eq!(health.reconnects, 2);
    }

    #[test]
    fn a_value_at_a_limit_belongs_below_it() {
        let mut histogram = Histogram::<2>::default();
        for value in [1.0, 1.5, 9.0] {
            histogram.add(value, &[1.0, 2.0]);
        }
        assert_eq!((histogram.counts, histogram.count, histogram.sum), ([1, 1], 3, 11.5));
    }
}
