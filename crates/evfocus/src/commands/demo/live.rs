//! The run as it happens, for the eye.

use evfocus_core::controller::Snapshot;
use evfocus_core::{CurvePoint, HostMicros, LensRange, Phase};
use evfocus_hal::{Clock, SystemClock};

use crate::curve_view::{CurveFrame, CurveView};
use crate::output::Output;
use crate::quantity::rate;

/// Virtual time from one frame to the next.
const FRAME_US: i64 = 50_000;

/// Draws a run in virtual time at the pace of real time, or does nothing.
pub(super) struct LiveDemo {
    screen: Option<Screen>,
    result: std::io::Result<()>,
}

struct Screen {
    view: CurveView,
    clock: SystemClock,
    /// Virtual time of the first look, against which the run is paced.
    begin: Option<HostMicros>,
    next_frame: HostMicros,
    points: Vec<(f64, f64)>,
}

impl LiveDemo {
    pub(super) fn silent() -> Self {
        Self { screen: None, result: Ok(()) }
    }

    pub(super) fn on_terminal(range: LensRange) -> Self {
        let screen = Screen {
            view: CurveView::new(range.min().0, range.max().0),
            clock: SystemClock::new(),
            begin: None,
            next_frame: HostMicros(0),
            points: Vec::new(),
        };
        Self { screen: Some(screen), result: Ok(()) }
    }

    /// Looks at the run; draws if a frame is due.
    pub(super) fn show(&mut self, now: HostMicros, seen: &Snapshot, curve: &[CurvePoint], out: &mut Output) {
        if let Some(screen) = &mut self.screen
            && let Err(error) = screen.show(now, seen, curve, out)
        {
            self.result = Err(error);
            self.screen = None;
        }
    }

    /// What went wrong with the drawing, if anything.
    pub(super) fn finish(self) -> std::io::Result<()> {
        self.result
    }
}

impl Screen {
    fn show(
        &mut self,
        now: HostMicros,
        seen: &Snapshot,
        curve: &[CurvePoint],
        out: &mut Output,
    ) -> std::io::Result<()> {
        if now < self.next_frame && seen.run.is_some() {
            return Ok(());
        }
        self.next_frame = HostMicros(now.0 + FRAME_US);
        let begin = *self.begin.get_or_insert_with(|| {
            // The rig took a while to build; the run begins now.
            self.clock = SystemClock::new();
            now
        });
        self.clock.sleep_until(HostMicros(now.micros_since(begin)));
        self.points.clear();
        self.points.extend(curve.iter().map(|point| (point.position.0, point.rate.0)));
        let title = format!("{:<10} {:>12}", seen.phase.map_or("done", Phase::name), rate(seen.event_rate.0));
        let lens = seen.lens.map(|sample| sample.position.0);
        self.view.draw(CurveFrame { points: &self.points, lens, title: &title }, out)
    }
}
