//! Focus curves as an SVG picture: event rate against lens position above, below what every method answered.
//!
//! Not its job: choosing what is shown; callers add sweeps, answers and the truth.

mod draw;
mod map;

use std::path::Path;

use evfocus_core::{LegReport, LensPosition, Method};
use evfocus_ipc::{Direction, Report};

pub(crate) use map::FocusMap;

/// A picture to be drawn.
#[derive(Debug, Clone)]
pub(crate) struct FocusPlot {
    title: String,
    sweeps: Vec<PlottedSweep>,
    estimates: Vec<PlottedEstimate>,
    answer: Option<(f64, String)>,
    truth: Vec<f64>,
}

/// A focus curve.
#[derive(Debug, Clone)]
struct PlottedSweep {
    direction: Direction,
    /// Lens counts, events per second.
    points: Vec<(f64, f64)>,
}

/// What one method said of one sweep.
#[derive(Debug, Clone)]
struct PlottedEstimate {
    method: String,
    direction: Direction,
    position: f64,
}

impl FocusPlot {
    /// An empty picture.
    pub(crate) fn new(title: String) -> Self {
        Self { title, sweeps: Vec::new(), estimates: Vec::new(), answer: None, truth: Vec::new() }
    }

    /// Adds a sweep with what every method said of it.
    pub(crate) fn add_sweep(&mut self, report: &LegReport) {
        let direction = if report.to >= report.from { Direction::Forward } else { Direction::Backward };
        let points = report.curve.points().iter().map(|point| (point.position.0, point.rate.0)).collect();
        self.sweeps.push(PlottedSweep { direction, points });
        for method in Method::ALL {
            if let Some(Ok(said)) = report.estimate(method) {
                self.estimates.push(PlottedEstimate {
                    method: method.name().to_owned(),
                    direction,
                    position: said.position.0,
                });
            }
        }
    }

    /// Adds what the daemon's report of a run holds.
    pub(crate) fn add_report(&mut self, report: &Report) {
        for sweep in &report.sweeps {
            let (direction, curve) = (sweep.direction, &sweep.curve);
            let points = curve.position.iter().copied().zip(curve.rate.iter().copied()).collect();
            self.sweeps.push(PlottedSweep { direction, points });
            for said in &sweep.estimators {
                if let Some(position) = said.position {
                    self.estimates.push(PlottedEstimate { method: said.method.clone(), direction, position });
                }
            }
        }
        if let Some(position) = report.result.position {
            self.answer = Some((position, report.result.method.clone().unwrap_or_default()));
        }
    }

    /// Marks the answer.
    pub(crate) fn set_answer(&mut self, position: LensPosition, method: Method) {
        self.answer = Some((position.0, method.name().to_owned()));
    }

    /// Marks where the scene is sharp in truth.
    pub(crate) fn set_truth(&mut self, truth: &[LensPosition]) {
        self.truth = truth.iter().map(|position| position.0).collect();
    }

    /// Writes the picture to `path`, replacing the file.
    pub(crate) fn write(&self, path: &Path) -> anyhow::Result<()> {
        let mut svg = String::new();
        draw::draw(self, &mut svg)?;
        Ok(std::fs::write(path, svg)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_without_curves_is_drawn_all_the_same() {
        let mut svg = String::new();
        draw::draw(&FocusPlot::new(String::from("nothing & <nothing>")), &mut svg).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("nothing &amp; &lt;nothing&gt;"));
    }
}
