//! The legend of a figure: the colour bar, its ticks and the notes below it.
//!
//! Its size has to be known before the sheet can be laid out, and its place only afterwards: so
//! [`Block::of`] measures, the layout places, and [`draw`] draws.

use super::Figure;
use super::canvas::{Canvas, HAIRLINE, INK, Rect, SOFT_INK, mix};
use super::compose::{BARE, Contours, colored};
use super::scale::{Below, Scale, Tick, format_value};
use super::text::{Lettering, Style, Weight};
use crate::base::Grid;

/// Pictures wider than this times their height get the legend below.
const WIDE: f64 = 1.7;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Right,
    Below,
}

/// The legend's block: its size is known before its place.
pub(super) struct Block {
    pub side: Side,
    pub width: f64,
    pub height: f64,
    at: (f64, f64),
    heading: Vec<String>,
    bar_length: f64,
    bar_breadth: f64,
    ticks: Vec<Tick>,
    notes: Vec<(Note, Vec<String>)>,
}

/// A swatch below the bar with words.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Note {
    Above,
    Bare,
    Below,
}

impl Block {
    pub(super) fn of(
        figure: &Figure<'_>,
        letters: &Lettering,
        em: f64,
        width: f64,
        height: f64,
    ) -> Option<Self> {
        if figure.legend_size.is_some_and(|[length, breadth]| length == 0 || breadth == 0) {
            return None;
        }
        let side = if width > WIDE * height { Side::Below } else { Side::Right };
        let given =
            figure.legend_size.map(|[l, b]| [f64::from(l.min(8192)), f64::from(b.min(1024))]);
        let bar_breadth = given.map_or((1.35 * em).round(), |g| g[1]);
        let ticks = thinned(&figure.scale);
        let label = |t: &Tick| letters.width(&t.label, 0.9 * em, Weight::Regular);
        let labels = ticks.iter().map(label).fold(0.0, f64::max);
        let unit = if figure.scale.unit.is_empty() {
            String::new()
        } else {
            format!(" ({})", figure.scale.unit.replace(' ', "\u{a0}"))
        };
        let words = format!("{}{unit}", figure.legend);
        let column = match side {
            Side::Right => (bar_breadth + 0.9 * em + labels).max(9.0 * em),
            Side::Below => width.max(26.0 * em),
        };
        let heading = match words.trim() {
            "" => Vec::new(),
            words => letters.wrap(words, em, Weight::Bold, column),
        };
        let mut notes = Vec::new();
        let mut note = |kind, words: &str| {
            notes.push((
                kind,
                letters.wrap(
                    words,
                    0.82 * em,
                    Weight::Regular,
                    (if side == Side::Right { column } else { 15.0 * em }) - 2.0 * em,
                ),
            ));
        };
        let highest =
            figure.data.data().iter().copied().filter(|v| v.is_finite()).fold(0.0, f32::max);
        let (end, peak) = (figure.scale.max, three_digits(highest));
        if peak > end {
            note(
                Note::Above,
                &format!("above {}: up to {}", format_value(end), format_value(peak)),
            );
        }
        if figure.scale.below == Below::Faint && figure.scale.min > 0.0 {
            note(Note::Below, &format!("below {}", format_value(figure.scale.min)));
        }
        if !figure.bare.is_empty() {
            note(Note::Bare, &figure.bare);
        }
        let heading_height = heading.len() as f64 * 1.3 * em;
        let heights = notes.iter().map(|(_, lines)| note_height(lines, em));
        // Below a wide picture the notes stand in a row.
        let notes_height: f64 = match side {
            Side::Right => heights.sum(),
            Side::Below => heights.fold(0.0, f64::max),
        };
        let (bar_length, height) = match side {
            Side::Right => {
                let rest = heading_height + 0.7 * em + 0.9 * em + notes_height;
                let length = given.map_or((height - rest).clamp(12.0 * em, 34.0 * em), |g| g[0]);
                (length, length + rest)
            }
            Side::Below => {
                let length = given.map_or(column, |g| g[0]);
                (length, heading_height + 0.4 * em + bar_breadth + 2.2 * em + notes_height)
            }
        };
        let width = match side {
            Side::Right => column,
            Side::Below => bar_length,
        };
        let bar_length = bar_length.round();
        Some(Self {
            side,
            width,
            height,
            at: (0.0, 0.0),
            heading,
            bar_length,
            bar_breadth,
            ticks,
            notes,
        })
    }

    pub(super) fn moved(self, at: (f64, f64)) -> Self {
        Self { at, ..self }
    }
}

fn note_height(lines: &[String], em: f64) -> f64 {
    lines.len() as f64 * 1.15 * em + 0.35 * em
}

fn three_digits(value: f32) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(f64::from(value))
}

/// The legend's marks, but none closer to its neighbour than letters allow.
fn thinned(scale: &Scale) -> Vec<Tick> {
    let mut out: Vec<Tick> = Vec::new();
    for tick in scale.ticks() {
        if scale.divisions.is_some()
            || out.last().is_none_or(|l| tick.position - l.position > 0.035)
        {
            out.push(tick);
        }
    }
    out
}

pub(super) fn draw(
    canvas: &mut Canvas,
    figure: &Figure<'_>,
    block: &Block,
    em: f64,
    letters: &Lettering,
) {
    let (x, mut y) = block.at;
    for line in &block.heading {
        letters.draw(canvas, line, (x, y + em), &Style::new(em, INK).bold());
        y += 1.3 * em;
    }
    y += match block.side {
        Side::Right => 0.7 * em,
        Side::Below => 0.4 * em,
    };
    let (length, breadth) = (block.bar_length as i64, block.bar_breadth as i64);
    let bar = match block.side {
        Side::Right => Rect { x: x as i64, y: y as i64, width: breadth, height: length },
        Side::Below => Rect { x: x as i64, y: y as i64, width: length, height: breadth },
    };
    draw_bar(canvas, figure, bar, block.side);
    let hair = ((em / 14.0).round() as i64).max(1);
    canvas.frame(bar, hair, HAIRLINE);
    draw_ticks(canvas, block, bar, em, letters);
    y = bar.bottom() as f64
        + match block.side {
            Side::Right => 0.9 * em,
            Side::Below => 2.2 * em,
        };
    let mut x = x;
    for (note, lines) in &block.notes {
        let swatch =
            Rect { x: x as i64, y: y as i64, width: breadth.min(em as i64 * 2), height: em as i64 };
        let color = match note {
            Note::Above => bar_color(figure, figure.scale.max),
            Note::Bare => BARE,
            // As over a background of middle grey.
            Note::Below => mix([150; 3], figure.scale.palette.color(0.0), 0.35 * figure.opacity),
        };
        canvas.fill(swatch, color, 1.0);
        if *note == Note::Bare && figure.background.is_some() {
            // The background in small: two shades of grey.
            let half = Rect { width: swatch.width / 2, ..swatch };
            canvas.fill(half, [120; 3], 1.0);
            canvas.fill(
                Rect { x: half.right(), width: swatch.width - half.width, ..swatch },
                [190; 3],
                1.0,
            );
        }
        canvas.frame(swatch, hair, HAIRLINE);
        let words = (x + swatch.width as f64 + 0.6 * em).round();
        let mut base = y + 0.83 * em;
        for line in lines {
            letters.draw(canvas, line, (words, base), &Style::new(0.82 * em, SOFT_INK));
            base += 1.15 * em;
        }
        match block.side {
            Side::Right => y += note_height(lines, em),
            Side::Below => x += 17.0 * em,
        }
    }
}

/// The colour that a value has in the bar: bands where the picture has contour lines, because
/// lines are read by their colour.
fn bar_color(figure: &Figure<'_>, value: f64) -> [u8; 3] {
    let contours = match figure.contours {
        Contours::Lines => Contours::Bands,
        other => other,
    };
    let grid = Grid::filled(1, 1, value as f32);
    colored(&grid, &figure.scale, contours).map_or(BARE, |colors| colors[(0, 0)].0)
}

fn draw_bar(canvas: &mut Canvas, figure: &Figure<'_>, bar: Rect, side: Side) {
    let length = if side == Side::Right { bar.height } else { bar.width };
    let place = |at: i64| (at as f64 + 0.5) / length as f64;
    for at in 0..length {
        let color = bar_color(figure, figure.scale.value(place(at)));
        let strip = match side {
            Side::Right => Rect { y: bar.bottom() - 1 - at, height: 1, ..bar },
            Side::Below => Rect { x: bar.x + at, width: 1, ..bar },
        };
        canvas.fill(strip, color, 1.0);
    }
}

fn draw_ticks(canvas: &mut Canvas, block: &Block, bar: Rect, em: f64, letters: &Lettering) {
    let size = 0.9 * em;
    let thick = ((em / 12.0).round() as i64).max(1);
    let long = (0.4 * em).round() as i64;
    let style = Style::new(size, INK);
    let mut free_from = f64::MIN;
    for tick in &block.ticks {
        match block.side {
            Side::Right => {
                let y = bar.bottom() as f64 - tick.position * bar.height as f64;
                let mark =
                    Rect { x: bar.right(), y: y as i64 - thick / 2, width: long, height: thick };
                canvas.fill(mark, INK, 1.0);
                let at = (bar.right() as f64 + 0.7 * em, y + 0.36 * size);
                letters.draw(canvas, &tick.label, at, &style);
            }
            Side::Below => {
                let x = bar.x as f64 + tick.position * bar.width as f64;
                let mark =
                    Rect { x: x as i64 - thick / 2, y: bar.bottom(), width: thick, height: long };
                canvas.fill(mark, INK, 1.0);
                let width = letters.width(&tick.label, size, Weight::Regular);
                let left = x - width / 2.0;
                if left > free_from {
                    let base = bar.bottom() as f64 + 0.45 * em + size;
                    letters.draw(canvas, &tick.label, (left, base), &style);
                    free_from = x + width / 2.0 + 0.35 * em;
                }
            }
        }
    }
}
