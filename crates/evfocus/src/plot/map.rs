//! The focus map of a recording or a run as an SVG picture: each part of the camera's picture in the colour of its best lens position, so that tilt
//! and depth show at a glance; the fainter, the less sure.

use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::draw::failed;

/// A tile's edge, pixels.
const TILE: i32 = 120;
const CAPTION: i32 = 48;
const MARGIN: i32 = 20;
const TEXT: RGBColor = RGBColor(0x22, 0x22, 0x22);
const EMPTY: RGBColor = RGBColor(0xee, 0xee, 0xee);
/// Lower positions, the middle, higher ones. Told apart by the colour-blind too.
const SCALE: [(f64, f64, f64); 3] = [(33.0, 102.0, 172.0), (247.0, 247.0, 247.0), (178.0, 24.0, 43.0)];
/// Positions have the full colour when they are this many error bars from the middle one, or more: noise does not look like tilt.
const LEAST_SPAN: f64 = 5.0;

/// Where each part of the picture is sharp.
#[derive(Debug, Clone)]
pub(crate) struct FocusMap {
    title: String,
    columns: usize,
    tiles: Vec<Option<Tile>>,
}

#[derive(Debug, Clone, Copy)]
struct Tile {
    position: f64,
    error_bar: f64,
    confidence: f64,
}

impl FocusMap {
    /// A picture of `map` with this title.
    pub(crate) fn new(title: String, map: &evfocus_ipc::FocusMap) -> Self {
        let known = map.position.iter().zip(&map.error_bar).zip(&map.confidence);
        let tile = |((&position, &error_bar), &confidence): ((&Option<f64>, &Option<f64>), &Option<f64>)| {
            Some(Tile { position: position?, error_bar: error_bar?, confidence: confidence? })
        };
        Self { title, columns: map.columns.max(1) as usize, tiles: known.map(tile).collect() }
    }

    /// Writes the map to `path`, replacing the file.
    pub(crate) fn write(&self, path: &Path) -> anyhow::Result<()> {
        let mut svg = String::new();
        self.draw(&mut svg)?;
        Ok(std::fs::write(path, svg)?)
    }

    /// The middle of the scale and how far its ends are from that, counts.
    fn scale(&self) -> (f64, f64) {
        let mut tiles: Vec<Tile> = self.tiles.iter().copied().flatten().collect();
        tiles.sort_by(|a, b| a.position.total_cmp(&b.position));
        let Some(middle) = tiles.get(tiles.len() / 2) else { return (0.0, 1.0) };
        let noise = LEAST_SPAN * middle.error_bar.max(0.1);
        let farthest = tiles.iter().map(|tile| (tile.position - middle.position).abs());
        (middle.position, farthest.fold(noise, f64::max))
    }

    fn draw(&self, svg: &mut String) -> anyhow::Result<()> {
        let (columns, rows) = (self.columns as i32, self.tiles.len().div_ceil(self.columns) as i32);
        let size = ((columns * TILE + 2 * MARGIN) as u32, (rows * TILE + CAPTION + 2 * MARGIN) as u32);
        let area = SVGBackend::with_string(svg, size).into_drawing_area();
        area.fill(&WHITE).map_err(failed)?;
        let text = format!("{}: best lens position by part of the picture, counts", self.title);
        let caption = ("sans-serif", 17, &TEXT).into_text_style(&area);
        area.draw(&Text::new(text, (MARGIN, MARGIN), caption)).map_err(failed)?;
        let (middle, span) = self.scale();
        for (index, tile) in self.tiles.iter().enumerate() {
            let (column, row) = ((index % self.columns) as i32, (index / self.columns) as i32);
            let corner = (MARGIN + column * TILE, MARGIN + CAPTION + row * TILE);
            let fill = tile.map_or(EMPTY.mix(1.0), |tile| {
                let sure = tile.confidence.clamp(0.3, 1.0);
                color((tile.position - middle) / span).mix(sure)
            });
            draw_tile(&area, corner, fill, tile.as_ref())?;
        }
        area.present().map_err(failed)
    }
}

fn draw_tile(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    (left, top): (i32, i32),
    fill: RGBAColor,
    tile: Option<&Tile>,
) -> anyhow::Result<()> {
    let corners = [(left + 1, top + 1), (left + TILE - 1, top + TILE - 1)];
    area.draw(&Rectangle::new(corners, fill.filled())).map_err(failed)?;
    let lines = tile.map_or([(0, 13, String::from("no structure")), (0, 13, String::new())], |tile| {
        [
            (-9, 20, format!("{:.0}", tile.position)),
            (15, 13, format!("± {:.0}, {:.0} %", tile.error_bar, (tile.confidence * 100.0).floor())),
        ]
    });
    for (down, size, text) in lines {
        let style =
            ("sans-serif", size, &TEXT).into_text_style(area).pos(Pos::new(HPos::Center, VPos::Center));
        area.draw(&Text::new(text, (left + TILE / 2, top + TILE / 2 + down), style)).map_err(failed)?;
    }
    Ok(())
}

/// The colour of `place` between -1 and 1.
fn color(place: f64) -> RGBColor {
    let [low, middle, high] = SCALE;
    let (end, share) = if place < 0.0 { (low, -place) } else { (high, place) };
    let share = share.clamp(0.0, 1.0) * 0.8;
    let mix = |from: f64, to: f64| (from + share * (to - from)).round() as u8;
    RGBColor(mix(middle.0, end.0), mix(middle.1, end.1), mix(middle.2, end.2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_is_drawn_whatever_it_says() {
        let map = evfocus_ipc::FocusMap {
            columns: 2,
            rows: 1,
            position: vec![Some(1234.0), None],
            error_bar: vec![Some(6.0), None],
            confidence: vec![Some(0.958), None],
            significance: vec![Some(40.0), None],
        };
        let mut svg = String::new();
        FocusMap::new(String::from("a & b"), &map).draw(&mut svg).unwrap();
        assert!(svg.contains("a &amp; b") && svg.contains("1234") && svg.contains("± 6, 95 %"), "{svg}");
        assert_eq!(svg.matches("no structure").count(), 1);
    }
}
