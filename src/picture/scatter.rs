//! Points over two logarithmic axes, with coloured zones behind them.

use std::path::Path;

use super::canvas::{Canvas, Color, HAIRLINE, INK, Mask, Rect, SOFT_INK, WHITE};
use super::text::{Lettering, Style, Weight};
use super::{Error, png};
use crate::base::Grid;

/// A logarithmic axis.
#[derive(Clone, Debug, PartialEq)]
pub struct LogAxis {
    /// What it measures, with the unit.
    pub label: String,
    /// Lower and upper end, powers of ten.
    pub decades: (i32, i32),
}

/// All that lies above a curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Zone {
    /// Written into it.
    pub label: String,
    /// Its colour.
    pub color: [u8; 3],
    /// Where the label begins, values of both axes.
    pub label_at: (f64, f64),
    /// The curve, from left to right, values of both axes; the whole plot where it is empty.
    pub above: Vec<(f64, f64)>,
}

/// Points of one colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Dots {
    /// What the legend calls them; empty for none.
    pub label: String,
    /// Their colour.
    pub color: [u8; 3],
    /// Diameter, pixels.
    pub size: f64,
    /// Values of both axes.
    pub points: Vec<(f64, f64)>,
}

/// The chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Scatter {
    /// In large letters.
    pub title: String,
    /// Below it.
    pub subtitle: String,
    /// Across.
    pub x: LogAxis,
    /// Upward.
    pub y: LogAxis,
    /// Drawn in order, each over the ones before.
    pub zones: Vec<Zone>,
    /// Drawn in order.
    pub dots: Vec<Dots>,
    /// Words below the chart.
    pub caption: String,
}

const DECADE_X: i64 = 210;
const DECADE_Y: i64 = 74;
const LEFT: i64 = 92;
const RIGHT: i64 = 30;
const TOP: i64 = 104;
const LINE: i64 = 20;

impl Scatter {
    /// Draws the chart.
    pub fn draw(&self) -> Grid<[u8; 3]> {
        let letters = Lettering::new();
        let decades = |a: &LogAxis| i64::from((a.decades.1 - a.decades.0).clamp(1, 12));
        let (width, height) = (decades(&self.x) * DECADE_X, decades(&self.y) * DECADE_Y);
        let plot = Rect { x: LEFT, y: TOP, width, height };
        let caption = letters.wrap(&self.caption, 13.0, Weight::Regular, (plot.width - 10) as f64);
        let named: Vec<&Dots> = self.dots.iter().filter(|d| !d.label.is_empty()).collect();
        let below = 62 + LINE * (named.len() as i64 + caption.len() as i64) + 12;
        let (w, h) = (plot.right() + RIGHT, plot.bottom() + below);
        let mut canvas = Canvas::new(w as usize, h as usize, WHITE);
        let left = LEFT as f64;
        letters.draw(&mut canvas, &self.title, (left, 36.0), &Style::new(22.0, INK).bold());
        letters.draw(&mut canvas, &self.subtitle, (left, 62.0), &Style::new(14.0, SOFT_INK));
        let place = |(x, y): (f64, f64)| {
            let along = |v: f64, a: &LogAxis| libm::log10(v) - f64::from(a.decades.0);
            let right = along(x, &self.x) * DECADE_X as f64;
            let up = along(y, &self.y) * DECADE_Y as f64;
            (plot.x as f64 + right, plot.bottom() as f64 - up)
        };
        for zone in &self.zones {
            zone_into(&mut canvas, zone, plot, &place);
        }
        self.axes(&mut canvas, &letters, plot);
        for zone in &self.zones {
            let style = Style::new(14.0, INK).bold();
            letters.draw(&mut canvas, &zone.label, place(zone.label_at), &style);
        }
        for dots in &self.dots {
            let mut points = Vec::new();
            for &(x, y) in dots.points.iter().filter(|p| p.0 > 0.0 && p.1 > 0.0) {
                let at = place((x, y));
                points.extend([Some(at), Some(at), None]);
            }
            canvas.stamp(&Mask::line(&points, dots.size, plot), dots.color, 0.9);
        }
        let mut y = plot.bottom() + 66;
        for dots in named {
            let dot = (left + 6.0, y as f64 - 4.0);
            let mask = Mask::line(&[Some(dot), Some(dot)], dots.size.max(5.0), canvas.area());
            canvas.stamp(&mask, dots.color, 1.0);
            letters.draw(&mut canvas, &dots.label, (left + 20.0, y as f64), &Style::new(13.0, INK));
            y += LINE;
        }
        for line in &caption {
            letters.draw(&mut canvas, line, (left, y as f64), &Style::new(13.0, SOFT_INK));
            y += LINE;
        }
        canvas.into_pixels()
    }

    fn axes(&self, canvas: &mut Canvas, letters: &Lettering, plot: Rect) {
        let style = Style::new(12.0, SOFT_INK);
        for (i, decade) in (self.x.decades.0..=self.x.decades.1).enumerate() {
            let x = plot.x + i as i64 * DECADE_X;
            canvas.fill(Rect { x, width: 1, ..plot }, WHITE, 0.8);
            let text = power(decade);
            let at = x as f64 - 0.5 * letters.width(&text, 12.0, Weight::Regular);
            letters.draw(canvas, &text, (at, plot.bottom() as f64 + 18.0), &style);
        }
        for (i, decade) in (self.y.decades.0..=self.y.decades.1).enumerate() {
            let y = plot.bottom() - i as i64 * DECADE_Y;
            canvas.fill(Rect { y, height: 1, ..plot }, WHITE, 0.8);
            let text = power(decade);
            let at = plot.x as f64 - 8.0 - letters.width(&text, 12.0, Weight::Regular);
            letters.draw(canvas, &text, (at, y as f64 + 4.0), &style);
        }
        canvas.frame(plot, 1, HAIRLINE);
        let wide = letters.width(&self.x.label, 13.0, Weight::Regular);
        let middle = plot.x as f64 + 0.5 * (plot.width as f64 - wide);
        let style = Style::new(13.0, SOFT_INK);
        letters.draw(canvas, &self.x.label, (middle, plot.bottom() as f64 + 38.0), &style);
        letters.draw(canvas, &self.y.label, (plot.x as f64, plot.y as f64 - 12.0), &style);
    }

    /// Draws the chart into a PNG, with `texts` (provenance) as text chunks.
    ///
    /// # Errors
    /// As [`png::write`].
    pub fn write_png(&self, path: &Path, texts: &[(String, String)]) -> Result<(), Error> {
        png::write(path, &self.draw(), texts)
    }
}

fn power(decade: i32) -> String {
    match decade {
        -3..=4 => super::scale::format_value(libm::pow(10.0, f64::from(decade))),
        _ => format!("1e{decade}"),
    }
}

fn zone_into(
    canvas: &mut Canvas,
    zone: &Zone,
    plot: Rect,
    place: &dyn Fn((f64, f64)) -> (f64, f64),
) {
    let color: Color = zone.color;
    let curve: Vec<(f64, f64)> = zone.above.iter().map(|&p| place(p)).collect();
    if curve.is_empty() {
        canvas.fill(plot, color, 1.0);
        return;
    }
    for x in plot.x..plot.right() {
        let at = x as f64 + 0.5;
        let y = curve.windows(2).find(|w| w[0].0 <= at && at <= w[1].0).map(|w| {
            let part = (at - w[0].0) / (w[1].0 - w[0].0).max(1e-9);
            w[0].1 + (w[1].1 - w[0].1) * part
        });
        let Some(y) = y else { continue };
        let height = (libm::round(y) as i64).clamp(plot.y, plot.bottom()) - plot.y;
        canvas.fill(Rect { x, y: plot.y, width: 1, height }, color, 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zones_lie_above_their_curves_and_dots_where_they_belong() {
        let (low, high) = ([10, 20, 30], [200, 90, 10]);
        let zone = |color, above| Zone { label: String::new(), color, label_at: (1.0, 1.0), above };
        let chart = Scatter {
            title: "t".into(),
            subtitle: String::new(),
            x: LogAxis { label: "x".into(), decades: (-1, 1) },
            y: LogAxis { label: "y".into(), decades: (-2, 2) },
            zones: vec![zone(low, vec![]), zone(high, vec![(0.1, 10.0), (10.0, 0.1)])],
            dots: vec![Dots {
                label: "d".into(),
                color: [0, 0, 255],
                size: 7.0,
                points: vec![(3.0, 0.03), (0.0, 1.0)],
            }],
            caption: "words".into(),
        };
        let picture = chart.draw();
        let at = |x: f64, y: f64| {
            let right = (libm::log10(x) + 1.0) * DECADE_X as f64;
            let down = (2.0 - libm::log10(y)) * DECADE_Y as f64;
            picture[((LEFT as f64 + right) as usize, (TOP as f64 + down) as usize)]
        };
        assert_eq!(at(2.0, 0.3), low);
        assert_eq!(at(2.0, 0.9), high);
        assert_eq!(at(0.2, 3.0), low);
        assert_eq!(at(0.2, 20.0), high);
        assert!(at(3.0, 0.03)[2] > 200);
    }
}
