//! A focus curve in a terminal, redrawn in place while the lens sweeps.
//!
//! Not its job: deciding whether there is a terminal; callers ask `Output::is_terminal`.

use std::io::Write;

use crate::output::Output;
use crate::quantity::rate;

const ROWS: usize = 10;
const NARROWEST: usize = 30;
const WIDEST: usize = 100;
/// Columns left of the curve: the longest rate, such as `123 events/s`, a space and the axis.
const GUTTER: usize = LABEL + 2;
const LABEL: usize = 12;
const BLOCKS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// What is drawn at one moment. Positions in lens counts, rates in events per second.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CurveFrame<'a> {
    /// Points as they came.
    pub(crate) points: &'a [(f64, f64)],
    /// Where the lens is.
    pub(crate) lens: Option<f64>,
    /// A line above the curve.
    pub(crate) title: &'a str,
}

/// Draws frames over each other.
#[derive(Debug)]
pub(crate) struct CurveView {
    low: f64,
    high: f64,
    columns: usize,
    lines_drawn: usize,
}

impl CurveView {
    /// A view of the positions from `low` to `high`, as wide as the terminal allows.
    pub(crate) fn new(low: f64, high: f64) -> Self {
        let width = terminal_size::terminal_size().map_or(80, |(width, _)| usize::from(width.0));
        Self::with_columns(low, high, width.saturating_sub(GUTTER + 2))
    }

    fn with_columns(low: f64, high: f64, columns: usize) -> Self {
        Self { low, high, columns: columns.clamp(NARROWEST, WIDEST), lines_drawn: 0 }
    }

    /// Draws `frame` in place of the one before.
    pub(crate) fn draw(&mut self, frame: CurveFrame<'_>, out: &mut Output) -> std::io::Result<()> {
        let lines = self.lines(frame);
        // One write for the whole frame, so that the terminal never shows half of it.
        let mut text = Vec::new();
        if self.lines_drawn > 0 {
            write!(text, "\x1b[{}A", self.lines_drawn)?;
        }
        for line in &lines {
            // Clears what the frame before left to the right.
            write!(text, "\r{line}\x1b[K\r\n")?;
        }
        self.lines_drawn = lines.len();
        out.write_all(&text)?;
        out.flush()
    }

    fn lines(&self, frame: CurveFrame<'_>) -> Vec<String> {
        let columns = self.column_rates(frame.points);
        let highest = columns.iter().flatten().copied().fold(0.0, f64::max);
        let mut lines = vec![frame.title.to_owned()];
        for row in (0..ROWS).rev() {
            let label = if row + 1 == ROWS && highest > 0.0 { rate(highest) } else { String::new() };
            let bars: String = columns.iter().map(|&rate| block(rate, highest, row)).collect();
            lines.push(format!("{label:>LABEL$} ┤{bars}").trim_end().to_owned());
        }
        lines.push(format!("{:>LABEL$} └{}", "", "─".repeat(self.columns)));
        lines.push(self.foot(frame.lens));
        lines
    }

    /// The mean rate of the points in each column.
    fn column_rates(&self, points: &[(f64, f64)]) -> Vec<Option<f64>> {
        let mut sums = vec![(0.0, 0_u32); self.columns];
        for &(position, rate) in points {
            if let Some((sum, number)) = self.column(position).and_then(|column| sums.get_mut(column)) {
                *sum += rate;
                *number += 1;
            }
        }
        let mut rates: Vec<Option<f64>> =
            sums.into_iter().map(|(sum, number)| (number > 0).then(|| sum / f64::from(number))).collect();
        fill_gaps(&mut rates);
        rates
    }

    fn column(&self, position: f64) -> Option<usize> {
        let share = (position - self.low) / (self.high - self.low);
        (-0.001..=1.001)
            .contains(&share)
            .then(|| ((share.clamp(0.0, 1.0) * self.columns as f64) as usize).min(self.columns - 1))
    }

    /// The ends of the range, and a mark where the lens is.
    fn foot(&self, lens: Option<f64>) -> String {
        let (low, high) = (format!("{:.0}", self.low), format!("{:.0} counts", self.high));
        let gap = self.columns.saturating_sub(low.len() + high.len());
        let mut foot: Vec<char> = format!("{low}{}{high}", " ".repeat(gap)).chars().collect();
        if let Some(place) = lens.and_then(|position| self.column(position)).and_then(|at| foot.get_mut(at)) {
            *place = '▲';
        }
        format!("{}{}", " ".repeat(GUTTER), foot.into_iter().collect::<String>())
    }
}

/// Where the lens goes faster than points come, a column between two others takes the rate of the one before.
fn fill_gaps(rates: &mut [Option<f64>]) {
    let Some(end) = rates.iter().rposition(Option::is_some) else { return };
    let mut before = None;
    for rate in rates.iter_mut().take(end) {
        before = rate.or(before);
        *rate = before;
    }
}

/// What row `row` (0 is the lowest) shows of a bar of height `rate`.
fn block(rate: Option<f64>, highest: f64, row: usize) -> char {
    let Some(rate) = rate.filter(|_| highest > 0.0) else { return ' ' };
    let eighths = (rate / highest * (8 * ROWS) as f64).round() as usize;
    // A column that has been swept shows at least a line, so that darkness is told from what is yet to come.
    let eighths = eighths.max(1).saturating_sub(8 * row).min(8);
    BLOCKS.get(eighths).copied().unwrap_or(' ')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_highest_column_reaches_the_top_and_the_unswept_are_empty() {
        let view = CurveView::with_columns(0.0, 100.0, 50);
        let points: Vec<(f64, f64)> = (0..50).map(|p| (f64::from(p), f64::from(p))).collect();
        let lines = view.lines(CurveFrame { points: &points, lens: Some(50.0), title: "t" });
        assert_eq!(lines.len(), ROWS + 3);
        assert!(lines[1].contains("48 events/s") && lines[1].ends_with('█'), "{}", lines[1]);
        assert!(lines[ROWS].chars().count() < GUTTER + 27, "{}", lines[ROWS]);
        assert!(lines[ROWS + 2].contains('▲') && lines[ROWS + 2].ends_with("100 counts"));
    }

    #[test]
    fn all_rows_begin_at_the_axis_however_long_the_rate_is() {
        let view = CurveView::with_columns(0.0, 100.0, 50);
        for highest in [3.0, 48.0, 999.4, 999.9, 960_300.0, 999_960.0, 3.2e6, 123.4e6] {
            let lines = view.lines(CurveFrame { points: &[(50.0, highest)], lens: None, title: "t" });
            for line in &lines[1..=ROWS + 1] {
                let axis = line.chars().position(|letter| "┤└".contains(letter));
                assert_eq!(axis, Some(GUTTER - 1), "{line}");
            }
        }
    }

    #[test]
    fn positions_outside_and_silence_draw_nothing_strange() {
        let view = CurveView::with_columns(0.0, 100.0, 50);
        for points in [vec![], vec![(500.0, 3.0)], vec![(50.0, 0.0)], vec![(50.0, f64::NAN)]] {
            let lines = view.lines(CurveFrame { points: &points, lens: Some(-9.0), title: "" });
            assert!(!lines.concat().contains(['█', '▲']), "{points:?}");
        }
    }
}
