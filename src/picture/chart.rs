//! A chart of coloured cells over two axes with words: what happens when. Like figures, it knows
//! colours and texts, not what they mean.

use std::path::Path;

use super::canvas::{Canvas, HAIRLINE, INK, Mask, Rect, SOFT_INK, WHITE};
use super::figure::Polyline;
use super::text::{Lettering, SetLine, Style, Weight};
use super::{Error, png};
use crate::base::Grid;

/// Letter size (em), pixels.
const EM: f64 = 17.0;
/// Size of the plot, pixels.
const PLOT: [i64; 2] = [1120, 430];
/// From one line of a paragraph to the next, ems.
const LEADING: f64 = 1.4;
/// Space around everything, pixels.
const MARGIN: f64 = 28.0;

/// Cells over two axes.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// In large letters.
    pub title: String,
    /// In the second line.
    pub subtitle: String,
    /// From left to right.
    pub x: Axis,
    /// From below to above.
    pub y: Axis,
    /// Colour where no cell lies.
    pub ground: [u8; 3],
    /// Rectangles in the axes' coordinates, later ones over earlier ones.
    pub cells: Vec<Cell>,
    /// Lines in the axes' coordinates; their labels aren't drawn.
    pub lines: Vec<Polyline>,
    /// What the colours mean.
    pub key: Vec<Swatch>,
    /// Notes below, a paragraph each.
    pub caption: Vec<String>,
    /// Words that lie across the plot.
    pub watermark: Option<String>,
}

/// An axis of a chart.
#[derive(Clone, Debug, Default)]
pub struct Axis {
    /// What it shows, with its unit; may be empty.
    pub label: String,
    /// Its lower end.
    pub from: f64,
    /// Its upper end.
    pub to: f64,
    /// Where lines cross the plot.
    pub lines: Vec<f64>,
    /// Words beside the axis, centred at a place.
    pub words: Vec<(f64, String)>,
}

/// A coloured rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Left and right end.
    pub x: [f64; 2],
    /// Lower and upper end.
    pub y: [f64; 2],
    /// Its colour.
    pub color: [u8; 3],
}

/// A colour with its meaning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Swatch {
    /// The colour.
    pub color: [u8; 3],
    /// The words.
    pub label: String,
}

/// Colours of sources that stay apart for the colour-blind (Okabe and Ito 2008), the darker ones
/// first.
pub const SURFACES: [[u8; 3]; 7] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [230, 159, 0],
    [86, 180, 233],
    [240, 228, 66],
];
const MONTHS: [&str; 12] =
    ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"];

impl Axis {
    /// The days of a year from 0, its months named.
    pub fn days_of_year(leap: bool) -> Self {
        let lengths = [31, 28 + i32::from(leap), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
        let mut axis = Self::default();
        for (name, length) in MONTHS.into_iter().zip(lengths) {
            let (start, length) = (axis.to, f64::from(length));
            axis.lines.push(start);
            axis.words.push((start + length / 2.0, name.to_owned()));
            axis.to = start + length;
        }
        axis
    }

    /// Hours of the day, every second one marked; `from` and `to` are even.
    pub fn clock(from: f64, to: f64, label: String) -> Self {
        let marks = || (0..14).map(|i| f64::from(i) * 2.0).filter(|h| (from..=to).contains(h));
        Self {
            label,
            from,
            to,
            lines: marks().collect(),
            words: marks().map(|h| (h, format!("{:02}:00", h as u32 % 24))).collect(),
        }
    }

    /// Position of a value between 0 and 1.
    fn position(&self, value: f64) -> f64 {
        let span = self.to - self.from;
        if span > 0.0 { (value - self.from) / span } else { 0.0 }
    }
}

impl Chart {
    /// Draws the chart.
    pub fn draw(&self) -> Grid<[u8; 3]> {
        let letters = Lettering::new();
        let words = |text: &str| letters.width(text, 0.9 * EM, Weight::Regular);
        let beside = self.y.words.iter().map(|(_, w)| words(w)).fold(0.0, f64::max);
        let left = (MARGIN + beside + 0.9 * EM).round();
        let width = left + PLOT[0] as f64 + MARGIN;
        let mut lines: Vec<SetLine> = Vec::new();
        let set = |lines: &mut Vec<SetLine>, text: &str, style, at, width| {
            letters.set(lines, text, style, at, (width, LEADING))
        };
        let mut y = MARGIN;
        for (text, style) in [
            (&self.title, Style::new(1.4 * EM, INK).bold()),
            (&self.subtitle, Style::new(EM, SOFT_INK)),
        ] {
            y = set(&mut lines, text, style, (MARGIN, y), width - 2.0 * MARGIN);
        }
        y += 0.5 * EM;
        if !self.y.label.is_empty() {
            let style = Style::new(0.82 * EM, SOFT_INK);
            y = set(&mut lines, &self.y.label, style, (MARGIN, y), width);
            y += 0.6 * EM;
        }
        let plot = Rect { x: left as i64, y: y.round() as i64, width: PLOT[0], height: PLOT[1] };
        y = plot.bottom() as f64;
        for (at, text) in &self.x.words {
            let middle = plot.x as f64 + self.x.position(*at) * plot.width as f64;
            let at = (middle - words(text) / 2.0, y + 1.25 * EM);
            lines.push(SetLine { text: text.clone(), at, style: Style::new(0.9 * EM, INK) });
        }
        for (at, text) in &self.y.words {
            let middle = plot.bottom() as f64 - self.y.position(*at) * plot.height as f64;
            let at = (left - 0.6 * EM - words(text), middle + 0.32 * EM);
            lines.push(SetLine { text: text.clone(), at, style: Style::new(0.9 * EM, INK) });
        }
        y += 1.9 * EM;
        if !self.x.label.is_empty() {
            let style = Style::new(0.82 * EM, SOFT_INK);
            y = set(&mut lines, &self.x.label, style, (left, y), PLOT[0] as f64);
        }
        let mut swatches = Vec::new();
        let mut x = left;
        let row = 1.55 * EM;
        for swatch in &self.key {
            let long = 1.9 * EM + words(&swatch.label);
            if x > left && x + long > width - MARGIN {
                (x, y) = (left, y + row);
            }
            let side = (0.95 * EM) as i64;
            let area =
                Rect { x: x as i64, y: (y + 0.45 * EM) as i64, width: side + 4, height: side };
            swatches.push((area, swatch.color));
            let at = (x + 1.5 * EM, y + 1.25 * EM);
            lines.push(SetLine {
                text: swatch.label.clone(),
                at,
                style: Style::new(0.9 * EM, INK),
            });
            x += long + 1.3 * EM;
        }
        y += if self.key.is_empty() { 0.0 } else { row + 0.4 * EM };
        for text in self.caption.iter().filter(|c| !c.is_empty()) {
            let style = Style::new(0.82 * EM, SOFT_INK);
            y = set(&mut lines, text, style, (MARGIN, y), width - 2.0 * MARGIN);
        }
        let mut canvas = Canvas::new(width as usize, (y + MARGIN).ceil() as usize, WHITE);
        self.plot(&mut canvas, plot, &letters);
        for (area, color) in swatches {
            canvas.fill(area, color, 1.0);
            canvas.frame(area, 1, HAIRLINE);
        }
        letters.draw_all(&mut canvas, &lines);
        canvas.into_pixels()
    }

    fn plot(&self, canvas: &mut Canvas, plot: Rect, letters: &Lettering) {
        canvas.fill(plot, self.ground, 1.0);
        let column = |v: f64| plot.x as f64 + self.x.position(v) * plot.width as f64;
        let row = |v: f64| plot.bottom() as f64 - self.y.position(v) * plot.height as f64;
        for cell in &self.cells {
            let (left, right) = (column(cell.x[0]).round(), column(cell.x[1]).round());
            let (top, bottom) = (row(cell.y[1]).round(), row(cell.y[0]).round());
            if ![left, right, top, bottom].iter().all(|v| v.abs() < 1e7) {
                continue;
            }
            // What is shorter than a pixel is still there.
            let area = Rect {
                x: left as i64,
                y: top as i64,
                width: (right - left).max(1.0) as i64,
                height: (bottom - top).max(1.0) as i64,
            };
            canvas.fill(area.intersection(&plot), cell.color, 1.0);
        }
        for at in &self.x.lines {
            let line = Rect { x: column(*at) as i64, y: plot.y, width: 1, height: plot.height };
            canvas.fill(line.intersection(&plot), HAIRLINE, 0.45);
        }
        for at in &self.y.lines {
            let line = Rect { x: plot.x, y: row(*at) as i64, width: plot.width, height: 1 };
            canvas.fill(line.intersection(&plot), HAIRLINE, 0.45);
        }
        for line in &self.lines {
            let points: Vec<Option<(f64, f64)>> = line
                .points
                .iter()
                .map(|[x, y]| (x.is_finite() && y.is_finite()).then(|| (column(*x), row(*y))))
                .collect();
            let mask = Mask::line(&points, 1.6 * line.width, plot);
            canvas.stamp_in(&mask, line.color, 1.0, plot);
        }
        if let Some(words) = &self.watermark {
            let size = 2.6 * EM;
            let wide = letters.width(words, size, Weight::Bold);
            let at = (
                plot.x as f64 + (plot.width as f64 - wide) / 2.0,
                plot.y as f64 + plot.height as f64 * 0.97,
            );
            let mask = letters.mask(words, at, size, Weight::Bold);
            canvas.stamp_in(&mask, SOFT_INK, 0.22, plot);
        }
        canvas.frame(plot, 1, SOFT_INK);
    }

    /// Draws the chart into a PNG, with `texts` (provenance) as text chunks.
    ///
    /// # Errors
    /// As [`png::write`].
    pub fn write_png(&self, path: &Path, texts: &[(String, String)]) -> Result<(), Error> {
        png::write(path, &self.draw(), texts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> Chart {
        Chart {
            x: Axis { from: 0.0, to: 10.0, ..Axis::default() },
            y: Axis { from: 0.0, to: 10.0, ..Axis::default() },
            ground: [200, 210, 220],
            ..Chart::default()
        }
    }

    #[test]
    fn cells_lie_where_the_axes_say() {
        let red = [250, 10, 20];
        let empty = chart().draw();
        let cells = vec![Cell { x: [5.0, 6.0], y: [0.0, 1.0], color: red }];
        let drawn = Chart { cells, ..chart() }.draw();
        assert_eq!((empty.columns(), empty.rows()), (drawn.columns(), drawn.rows()));
        let places: Vec<(usize, usize)> = (0..drawn.rows())
            .flat_map(|row| (0..drawn.columns()).map(move |column| (column, row)))
            .filter(|at| drawn[*at] == red)
            .collect();
        assert_eq!(places.len() as i64, PLOT[0] / 10 * PLOT[1] / 10);
        // In the lower half of the plot, in its right half.
        let ground: Vec<usize> =
            (0..empty.rows()).filter(|row| empty.row(*row).contains(&[200, 210, 220])).collect();
        let low = places.iter().map(|(_, row)| *row).max();
        assert_eq!(low, ground.last().copied());
    }

    #[test]
    fn what_lies_outside_or_is_no_number_draws_nothing() {
        let odd = [f64::NAN, f64::INFINITY, -1e30];
        let cells =
            odd.iter().map(|v| Cell { x: [*v, 5.0], y: [20.0, 30.0], color: [1, 2, 3] }).collect();
        assert_eq!(Chart { cells, ..chart() }.draw(), chart().draw());
    }
}
