//! When something happens: the days of a year across, the hours of the day upward, and a colour
//! for each of several sources.

use std::path::Path;

use super::canvas::{Canvas, Color, HAIRLINE, INK, Mask, Rect, SOFT_INK, WHITE};
use super::text::{Lettering, Style, Weight};
use super::{Error, png};
use crate::base::Grid;

/// An unbroken span of one column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Column, from 0.
    pub column: u32,
    /// Lower end, in the unit of the upright axis.
    pub from: f64,
    /// Upper end.
    pub to: f64,
}

/// The spans of one source.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// What the legend calls it.
    pub label: String,
    /// Its spans.
    pub spans: Vec<Span>,
}

/// The chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Occurrence {
    /// In large letters.
    pub title: String,
    /// Below it.
    pub subtitle: String,
    /// Number of columns: the days.
    pub columns: u32,
    /// Where a part of the columns begins, and its name: the months.
    pub parts: Vec<(u32, String)>,
    /// Ends of the upright axis: hours.
    pub range: (f64, f64),
    /// What is drawn, in order; colours by position.
    pub series: Vec<Series>,
    /// Thin grey lines, a value for each column: sunrise and sunset.
    pub curves: Vec<Vec<f64>>,
    /// Words below the chart.
    pub caption: String,
}

const COLORS: [Color; 8] = [
    [0x00, 0x72, 0xb2],
    [0xd5, 0x5e, 0x00],
    [0x00, 0x9e, 0x73],
    [0xcc, 0x79, 0xa7],
    [0x56, 0xb4, 0xe9],
    [0xe6, 0x9f, 0x00],
    [0x7a, 0x51, 0x95],
    [0x33, 0x33, 0x33],
];
const COLUMN: i64 = 3;
const UNIT: f64 = 30.0;
const LEFT: i64 = 70;
const RIGHT: i64 = 30;
const TOP: i64 = 86;
const LINE: i64 = 20;

impl Occurrence {
    /// Draws the chart.
    pub fn draw(&self) -> Grid<[u8; 3]> {
        let letters = Lettering::new();
        let columns = i64::from(self.columns.clamp(1, 4000));
        let (low, high) = self.range;
        let tall = ((high - low) * UNIT).clamp(UNIT, 4000.0) as i64;
        let plot = Rect { x: LEFT, y: TOP, width: columns * COLUMN, height: tall };
        let words = (plot.width - 10) as f64;
        let caption = letters.wrap(&self.caption, 13.0, Weight::Regular, words);
        let below = 34 + LINE * (self.series.len() as i64 + caption.len() as i64) + 16;
        let (width, height) = (plot.right() + RIGHT, plot.bottom() + below);
        let mut canvas = Canvas::new(width as usize, height as usize, WHITE);
        let left = f64::from(LEFT as i32);
        letters.draw(&mut canvas, &self.title, (left, 36.0), &Style::new(22.0, INK).bold());
        letters.draw(&mut canvas, &self.subtitle, (left, 62.0), &Style::new(14.0, SOFT_INK));
        let up = |value: f64| plot.bottom() as f64 - (value - low) / (high - low) * tall as f64;
        self.axes(&mut canvas, &letters, plot, &up);
        for (i, series) in self.series.iter().enumerate() {
            for span in series.spans.iter().filter(|s| i64::from(s.column) < columns) {
                let (top, bottom) = (up(span.to.min(high)), up(span.from.max(low)));
                let y = libm::floor(top) as i64;
                let area = Rect {
                    x: plot.x + i64::from(span.column) * COLUMN,
                    y,
                    width: COLUMN,
                    height: (libm::ceil(bottom) as i64 - y).max(1),
                };
                canvas.fill(area.intersection(&plot), color(i), 0.85);
            }
        }
        self.legend(&mut canvas, &letters, plot, &caption);
        canvas.into_pixels()
    }

    fn axes(&self, canvas: &mut Canvas, letters: &Lettering, plot: Rect, up: &dyn Fn(f64) -> f64) {
        let style = Style::new(12.0, SOFT_INK);
        let (low, high) = self.range;
        let mut hour = low.ceil();
        while hour <= high {
            let y = up(hour) as i64;
            canvas.fill(Rect { x: plot.x, y, width: plot.width, height: 1 }, HAIRLINE, 0.35);
            let text = format!("{hour:.0} h");
            let at = plot.x as f64 - 8.0 - letters.width(&text, 12.0, Weight::Regular);
            letters.draw(canvas, &text, (at, y as f64 + 4.0), &style);
            hour += if high - low > 12.0 { 2.0 } else { 1.0 };
        }
        for (column, name) in &self.parts {
            let x = plot.x + i64::from(*column) * COLUMN;
            canvas.fill(Rect { x, y: plot.y, width: 1, height: plot.height }, HAIRLINE, 0.35);
            letters.draw(canvas, name, (x as f64 + 4.0, plot.bottom() as f64 + 17.0), &style);
        }
        for curve in &self.curves {
            let points: Vec<_> = curve
                .iter()
                .enumerate()
                .map(|(i, &value)| {
                    let x = plot.x as f64 + (i as f64 + 0.5) * COLUMN as f64;
                    value.is_finite().then(|| (x, up(value)))
                })
                .collect();
            canvas.stamp(&Mask::line(&points, 1.5, plot), HAIRLINE, 1.0);
        }
        canvas.frame(plot, 1, HAIRLINE);
    }

    fn legend(&self, canvas: &mut Canvas, letters: &Lettering, plot: Rect, caption: &[String]) {
        let mut y = plot.bottom() + 44;
        for (i, series) in self.series.iter().enumerate() {
            canvas.fill(Rect { x: plot.x, y: y - 10, width: 22, height: 11 }, color(i), 0.85);
            let at = (plot.x as f64 + 30.0, y as f64);
            letters.draw(canvas, &series.label, at, &Style::new(13.0, INK));
            y += LINE;
        }
        for line in caption {
            letters.draw(canvas, line, (plot.x as f64, y as f64), &Style::new(13.0, SOFT_INK));
            y += LINE;
        }
    }

    /// Draws the chart into a PNG, with `texts` (provenance) as text chunks.
    ///
    /// # Errors
    /// As [`png::write`].
    pub fn write_png(&self, path: &Path, texts: &[(String, String)]) -> Result<(), Error> {
        png::write(path, &self.draw(), texts)
    }
}

fn color(i: usize) -> Color {
    COLORS[i % COLORS.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_lies_at_its_day_and_hour_in_its_colour() {
        let spans = |column| vec![Span { column, from: 6.0, to: 7.0 }];
        let chart = Occurrence {
            title: "t".into(),
            subtitle: String::new(),
            columns: 365,
            parts: vec![(0, "Jan".into())],
            range: (0.0, 24.0),
            series: vec![
                Series { label: "a".into(), spans: spans(10) },
                Series { label: "b".into(), spans: spans(200) },
            ],
            curves: vec![vec![12.0; 365]],
            caption: "words".into(),
        };
        let picture = chart.draw();
        let at = |day: i64, hour: f64| {
            let y = TOP as f64 + (24.0 - hour) * UNIT;
            picture[((LEFT + day * COLUMN + 1) as usize, y as usize)]
        };
        let expected = |i| crate::picture::canvas::mix(WHITE, color(i), 0.85);
        assert_eq!(at(10, 6.5), expected(0));
        assert_eq!(at(200, 6.5), expected(1));
        assert_eq!(at(11, 6.5), WHITE);
        assert_eq!(at(10, 7.5), WHITE);
        assert_ne!(at(100, 12.0), WHITE, "the curve");
    }
}
