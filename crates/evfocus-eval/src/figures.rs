//! Figures like the paper's, as SVG: errors of every method, focus curves, the golden search's error after each step.

use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::Context;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use crate::Candidate;
use crate::dataset::Condition;
use crate::result::{Curve, Score, SequenceResult};

const SIZE: (u32, u32) = (960, 560);
const TEXT: RGBColor = RGBColor(0x33, 0x33, 0x33);
const GRID: RGBColor = RGBColor(0xe3, 0xe3, 0xe3);
const TRUTH: RGBColor = RGBColor(0x1a, 0x8a, 0x3a);
/// A colour for each condition, in the order of [`Condition::ALL`]; they differ in lightness too.
const CONDITIONS: [RGBColor; 4] = [
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x56, 0xb4, 0xe9),
    RGBColor(0x00, 0x4d, 0x80),
];
/// Curves drawn of a sequence: what the paper shows, and ours.
const CURVES: [(&str, RGBColor); 4] = [
    (crate::result::EVENT_RATE, RGBColor(0x1f, 0x5f, 0xbf)),
    (crate::result::STRUCTURE, RGBColor(0xd9, 0x6a, 0x0b)),
    ("GRAD (events)", RGBColor(0x7a, 0x3e, 0x9d)),
    ("GRAD (frames)", RGBColor(0x88, 0x88, 0x88)),
];
/// Errors are drawn on a logarithmic scale from 1, less being nobody's business, over so many decades.
const DECADES: f64 = 3.7;
/// Room for the names of methods, pixels.
const NAMES: u32 = 120;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Draws all figures of `results`, those of the data set `name`, into `folder`; returns the files written.
///
/// # Errors
/// A file that cannot be written.
pub fn draw(name: &str, results: &[SequenceResult], folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut written = Vec::new();
    let mut keep = |figure: String, text: String| -> anyhow::Result<()> {
        let path = folder.join(format!("{name}-{figure}.svg"));
        std::fs::write(&path, text)
            .with_context(|| format!("{}: cannot write the figure", path.display()))?;
        written.push(path);
        Ok(())
    };
    keep(String::from("errors"), svg(|area| errors(results, area))?)?;
    for condition in Condition::ALL {
        let of_condition = |result: &&SequenceResult| result.label.condition == Some(condition);
        if let Some(result) = results.iter().find(of_condition) {
            let figure = format!("curves-{}", condition.title().replace(' ', "-"));
            keep(figure, svg(|area| curves(result, area))?)?;
        }
    }
    keep(String::from("steps"), svg(|area| steps(results, area))?)?;
    Ok(written)
}

fn svg(draw: impl FnOnce(&Area<'_>) -> anyhow::Result<()>) -> anyhow::Result<String> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        draw(&area)?;
        area.present()?;
    }
    Ok(text)
}

/// Abscissa and ordinate.
type Points = Vec<(f64, f64)>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// A chart with its axes drawn. Without a title of the x axis there is room for names below it.
fn chart<'a, 'b>(
    area: &'a Area<'b>,
    title: &str,
    (x, x_title): (Range<f64>, &str),
    (y, y_title): (Range<f64>, &str),
    y_label: &dyn Fn(&f64) -> String,
) -> anyhow::Result<Chart<'a, 'b>> {
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 18, &TEXT))
        .margin(14)
        .x_label_area_size(if x_title.is_empty() { NAMES } else { 46 })
        .y_label_area_size(70)
        .build_cartesian_2d(x, y)?;
    let mut mesh = chart.configure_mesh();
    mesh.y_desc(y_title)
        .y_label_formatter(&y_label)
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(TEXT)
        .label_style(("sans-serif", 13, &TEXT))
        .axis_desc_style(("sans-serif", 14, &TEXT));
    if x_title.is_empty() {
        mesh.disable_x_mesh().x_labels(0).draw()?;
    } else {
        mesh.x_desc(x_title).draw()?;
    }
    Ok(chart)
}

/// Mean absolute errors: a group of bars for each method, a bar for each condition.
fn errors(results: &[SequenceResult], area: &Area<'_>) -> anyhow::Result<()> {
    let candidates: Vec<Candidate> = Candidate::all()
        .into_iter()
        .filter(|&candidate| Score::in_condition(results, candidate, None).answers > 0)
        .collect();
    let unit = results.first().map_or("lens counts", |result| result.label.unit.title());
    let places = candidates.len().max(1) as f64;
    let power = |exponent: &f64| format!("{:.0}", 10_f64.powf(*exponent));
    let title = format!("mean absolute error ({unit})");
    let mut chart = chart(
        area,
        "Mean absolute error of every method",
        (0.0..places, ""),
        (0.0..DECADES, &title),
        &power,
    )?;
    for (column, (condition, color)) in Condition::ALL.into_iter().zip(CONDITIONS).enumerate() {
        let bars = candidates.iter().enumerate().filter_map(|(index, &candidate)| {
            let height = Score::in_condition(results, candidate, Some(condition)).mae?.log10().max(0.0);
            let left = index as f64 + 0.1 + 0.2 * column as f64;
            Some(Rectangle::new([(left, 0.0), (left + 0.18, height)], color.filled()))
        });
        chart
            .draw_series(bars)?
            .label(condition.title())
            .legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 14, y + 5)], color.filled()));
    }
    let upright = ("sans-serif", 12, &TEXT).into_text_style(area).transform(FontTransform::Rotate90);
    for (index, candidate) in candidates.iter().enumerate() {
        let (x, y) = chart.backend_coord(&(index as f64 + 0.65, 0.0));
        area.draw(&Text::new(candidate.to_string(), (x, y + 6), upright.clone()))?;
    }
    legend(&mut chart)
}

/// The focus curves of a sequence, each from its lowest to its highest.
fn curves(result: &SequenceResult, area: &Area<'_>) -> anyhow::Result<()> {
    let drawn: Vec<(&Curve, RGBColor)> = CURVES
        .iter()
        .filter_map(|(method, color)| {
            let curve = result.curves.iter().find(|curve| curve.method == *method)?;
            Some((curve, *color))
        })
        .collect();
    let positions = extent(drawn.iter().flat_map(|(curve, _)| &curve.points).map(|point| point.0));
    let unit = result.label.unit.title();
    let mut chart = chart(
        area,
        &format!("Focus curves of {}, each from its lowest to its highest", result.label.name),
        (positions, &format!("lens position ({unit})")),
        (0.0..1.05, "focus measure"),
        &|share| format!("{share:.1}"),
    )?;
    for &truth in &result.truths {
        chart
            .draw_series([PathElement::new([(truth, 0.0), (truth, 1.05)], TRUTH.stroke_width(2))])?
            .label("truth")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 16, y)], TRUTH.stroke_width(2)));
    }
    for (curve, color) in drawn {
        let Range { start: low, end: high } = extent(curve.points.iter().map(|point| point.1));
        let points = curve.points.iter().map(|&(position, value)| (position, (value - low) / (high - low)));
        chart
            .draw_series(LineSeries::new(points, color.stroke_width(2)))?
            .label(curve.method.clone())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], color.stroke_width(2)));
    }
    legend(&mut chart)
}

/// The golden search's mean error after each step.
fn steps(results: &[SequenceResult], area: &Area<'_>) -> anyhow::Result<()> {
    let lines: Vec<(Condition, Points, RGBColor)> = Condition::ALL
        .into_iter()
        .zip(CONDITIONS)
        .map(|(condition, color)| {
            let of_condition = |result: &&SequenceResult| result.label.condition == Some(condition);
            let errors: Vec<&[f64]> =
                results.iter().filter(of_condition).map(|result| result.search_errors.as_slice()).collect();
            (condition, mean_by_step(&errors), color)
        })
        .collect();
    let last = lines.iter().flat_map(|(_, points, _)| points).map(|point| point.0).fold(1.0, f64::max);
    let highest = lines.iter().flat_map(|(_, points, _)| points).map(|point| point.1).fold(1.0, f64::max);
    let unit = results.first().map_or("lens counts", |result| result.label.unit.title());
    let mut chart = chart(
        area,
        "Event-based golden search: mean distance of its range's middle from focus",
        (0.0..last, "steps made"),
        (0.0..1.05 * highest, &format!("distance ({unit})")),
        &|distance| format!("{distance:.0}"),
    )?;
    for (condition, points, color) in lines {
        chart
            .draw_series(LineSeries::new(points, color.stroke_width(2)))?
            .label(condition.title())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], color.stroke_width(2)));
    }
    legend(&mut chart)
}

/// The mean over sequences after each step; one whose search is over keeps its last error.
fn mean_by_step(errors: &[&[f64]]) -> Points {
    let longest = errors.iter().map(|errors| errors.len()).max().unwrap_or(0);
    (0..longest)
        .filter_map(|step| {
            let at: Vec<f64> =
                errors.iter().filter_map(|errors| errors.get(step).or(errors.last()).copied()).collect();
            (!at.is_empty()).then(|| (step as f64, at.iter().sum::<f64>() / at.len() as f64))
        })
        .collect()
}

/// From the least to the greatest; never empty.
fn extent(values: impl Iterator<Item = f64> + Clone) -> Range<f64> {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.fold(f64::NEG_INFINITY, f64::max);
    if high > low { low..high } else { 0.0..1.0 }
}

fn legend<'a, 'b: 'a>(chart: &mut Chart<'a, 'b>) -> anyhow::Result<()> {
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.85))
        .border_style(GRID)
        .label_font(("sans-serif", 13, &TEXT))
        .draw()
        .map_err(|error| anyhow::anyhow!("{error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_that_is_over_keeps_its_error() {
        let mean = mean_by_step(&[&[100.0, 40.0], &[200.0, 60.0, 20.0]]);
        assert_eq!(mean, [(0.0, 150.0), (1.0, 50.0), (2.0, 30.0)]);
        assert!(mean_by_step(&[]).is_empty());
    }

    #[test]
    fn what_has_one_value_has_an_extent() {
        assert_eq!(extent([3.0, 3.0].into_iter()), 0.0..1.0);
        assert_eq!(extent([3.0, -1.0].into_iter()), -1.0..3.0);
    }
}
