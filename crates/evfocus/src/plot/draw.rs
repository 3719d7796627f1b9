//! The drawing of a [`FocusPlot`].

use std::ops::Range;

use anyhow::anyhow;
use evfocus_ipc::Direction;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use super::FocusPlot;

const SIZE: (u32, u32) = (960, 600);
const FORWARD: RGBColor = RGBColor(0x1f, 0x5f, 0xbf);
const BACKWARD: RGBColor = RGBColor(0xd9, 0x6a, 0x0b);
const ANSWER: RGBColor = RGBColor(0x22, 0x22, 0x22);
const TRUTH: RGBColor = RGBColor(0x1a, 0x8a, 0x3a);
const GRID: RGBColor = RGBColor(0xe3, 0xe3, 0xe3);
const TEXT: RGBColor = RGBColor(0x33, 0x33, 0x33);
/// Left margin of both panels, so that their axes agree.
const LABELS: u32 = 96;
const MARGIN: u32 = 24;
const ROW_HEIGHT: u32 = 24;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Draws `plot` into `svg`.
pub(super) fn draw(plot: &FocusPlot, svg: &mut String) -> anyhow::Result<()> {
    let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    area.fill(&WHITE).map_err(failed)?;
    let rows = methods(plot);
    let below = if rows.is_empty() { 0 } else { ROW_HEIGHT * rows.len() as u32 + MARGIN };
    let (curves, answers) = area.split_vertically(SIZE.1 - below);
    draw_curves(plot, &curves)?;
    if !rows.is_empty() {
        draw_answers(plot, &rows, &answers)?;
    }
    area.present().map_err(failed)
}

fn draw_curves(plot: &FocusPlot, area: &Area<'_>) -> anyhow::Result<()> {
    let (scale, unit) = rate_unit(plot);
    let highest = plot.sweeps.iter().flat_map(|sweep| &sweep.points).map(|point| point.1).fold(0.0, f64::max);
    let top = if highest > 0.0 { 1.08 * highest / scale } else { 1.0 };
    let mut chart = ChartBuilder::on(area)
        .caption(&plot.title, ("sans-serif", 19, &TEXT))
        .margin_left(MARGIN / 2)
        .margin_right(MARGIN)
        .margin_top(MARGIN / 2)
        .x_label_area_size(46)
        .y_label_area_size(LABELS)
        .build_cartesian_2d(positions(plot), 0.0..top)
        .map_err(failed)?;
    chart
        .configure_mesh()
        .x_desc("lens position (counts)")
        .y_desc(format!("event rate ({unit})"))
        .x_labels(10)
        .y_labels(6)
        .x_label_formatter(&|position| format!("{position:.0}"))
        .y_label_formatter(&|rate| format!("{rate}"))
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(TEXT)
        .label_style(("sans-serif", 13, &TEXT))
        .axis_desc_style(("sans-serif", 14, &TEXT))
        .draw()
        .map_err(failed)?;
    draw_marks(plot, &mut chart, top, true)?;
    for sweep in &plot.sweeps {
        let (color, name) = look(sweep.direction);
        let points = sweep.points.iter().map(|&(position, rate)| (position, rate / scale));
        chart
            .draw_series(LineSeries::new(points, color.stroke_width(2)))
            .map_err(failed)?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.85))
        .border_style(GRID)
        .label_font(("sans-serif", 13, &TEXT))
        .legend_area_size(24)
        .margin(8)
        .draw()
        .map_err(failed)
}

fn draw_answers(plot: &FocusPlot, rows: &[String], area: &Area<'_>) -> anyhow::Result<()> {
    let height = rows.len() as f64;
    let mut chart = ChartBuilder::on(area)
        .margin_left(MARGIN / 2)
        .margin_right(MARGIN)
        .margin_bottom(MARGIN)
        .y_label_area_size(LABELS)
        .build_cartesian_2d(positions(plot), 0.0..height)
        .map_err(failed)?;
    draw_marks(plot, &mut chart, height, false)?;
    let ends = positions(plot);
    for (row, method) in rows.iter().enumerate() {
        let middle = height - row as f64 - 0.5;
        let line = PathElement::new([(ends.start, middle), (ends.end, middle)], GRID);
        chart.draw_series([line]).map_err(failed)?;
        let anchor =
            ("sans-serif", 13, &TEXT).into_text_style(area).pos(plotters::style::text_anchor::Pos::new(
                plotters::style::text_anchor::HPos::Right,
                plotters::style::text_anchor::VPos::Center,
            ));
        let (_, y) = chart.backend_coord(&(ends.start, middle));
        let top = area.get_pixel_range().1.start;
        area.draw(&Text::new(method.clone(), ((MARGIN / 2 + LABELS - 8) as i32, y - top), anchor))
            .map_err(failed)?;
        for said in plot.estimates.iter().filter(|said| said.method == *method) {
            let dot = Circle::new((said.position, middle), 5, look(said.direction).0.filled());
            chart.draw_series([dot]).map_err(failed)?;
        }
    }
    Ok(())
}

/// Vertical lines at the truth and the answer.
fn draw_marks(plot: &FocusPlot, chart: &mut Chart<'_, '_>, top: f64, named: bool) -> anyhow::Result<()> {
    for &truth in &plot.truth {
        let line = DashedLineSeries::new([(truth, 0.0), (truth, top)], 6, 4, TRUTH.stroke_width(2));
        let series = chart.draw_series(line).map_err(failed)?;
        if named {
            series.label(format!("truth {truth:.1}")).legend(|(x, y)| legend_line(x, y, TRUTH));
        }
    }
    if let Some((position, method)) = &plot.answer {
        let line = LineSeries::new([(*position, 0.0), (*position, top)], ANSWER.stroke_width(1));
        let series = chart.draw_series(line).map_err(failed)?;
        if named {
            series.label(format!("{method} {position:.1}")).legend(|(x, y)| legend_line(x, y, ANSWER));
        }
    }
    Ok(())
}

fn legend_line(x: i32, y: i32, color: RGBColor) -> PathElement<(i32, i32)> {
    PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2))
}

/// Methods with an answer, in the order in which they first appear.
fn methods(plot: &FocusPlot) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for said in &plot.estimates {
        if !names.contains(&said.method) {
            names.push(said.method.clone());
        }
    }
    names
}

fn look(direction: Direction) -> (RGBColor, &'static str) {
    match direction {
        Direction::Forward => (FORWARD, "towards higher positions"),
        Direction::Backward => (BACKWARD, "towards lower positions"),
    }
}

/// The positions shown: all that there are, with a little room.
fn positions(plot: &FocusPlot) -> Range<f64> {
    let curves = plot.sweeps.iter().flat_map(|sweep| &sweep.points).map(|point| point.0);
    let marks = plot.estimates.iter().map(|said| said.position).chain(plot.truth.iter().copied());
    let (low, high) = curves
        .chain(marks)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if low < high {
        let room = 0.015 * (high - low);
        low - room..high + room
    } else {
        0.0..1.0
    }
}

fn rate_unit(plot: &FocusPlot) -> (f64, &'static str) {
    let highest = plot.sweeps.iter().flat_map(|sweep| &sweep.points).map(|point| point.1).fold(0.0, f64::max);
    if highest >= 1e6 {
        (1e6, "million events/s")
    } else if highest >= 1e3 {
        (1e3, "thousand events/s")
    } else {
        (1.0, "events/s")
    }
}

/// Plotters' errors borrow what anyhow wants to own.
pub(super) fn failed(error: impl std::fmt::Display) -> anyhow::Error {
    anyhow!("{error}")
}
