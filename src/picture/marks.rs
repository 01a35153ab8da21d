//! What lies on the picture of a figure: lines, markers, scale bar, north arrow, extremes.
//!
//! Labels must not hide each other nor the marks: each tries eight sides of its place and takes the
//! first that is free, or the least bad one. Rectangles that are taken go through all drawing
//! functions.

use super::Figure;
use super::canvas::{Canvas, HAIRLINE, INK, Mask, Rect, SOFT_INK, WHITE};
use super::layout::Layout;
use super::scale::{format_value, nice_step};
use super::text::{Lettering, Style, Weight};

/// Draws everything that lies on the picture, then its frame and the labels below it.
pub(super) fn draw(canvas: &mut Canvas, figure: &Figure<'_>, layout: &Layout, letters: &Lettering) {
    let mut marks = Marks { canvas, figure, layout, letters, taken: Vec::new() };
    if let Some(words) = &figure.watermark {
        watermark(marks.canvas, words, layout, letters);
    }
    marks.polylines();
    if let Some(size) = figure.metres_per_pixel {
        marks.scale_bar(size);
    }
    if let Some(north) = figure.north_deg {
        marks.north_arrow(north);
    }
    marks.markers();
    let hair = ((layout.em / 14.0).round() as i64).max(1);
    canvas.frame(layout.picture, hair, HAIRLINE);
    axis(canvas, figure, layout, letters);
}

/// What marks are drawn with, and which places they take.
struct Marks<'a> {
    canvas: &'a mut Canvas,
    figure: &'a Figure<'a>,
    layout: &'a Layout,
    letters: &'a Lettering,
    taken: Vec<Rect>,
}

impl Marks<'_> {
    fn polylines(&mut self) {
        let Self { figure, layout, .. } = *self;
        let em = layout.em;
        for line in &figure.polylines {
            let points: Vec<_> = line
                .points
                .iter()
                .map(|&p| (p[0].is_finite() && p[1].is_finite()).then(|| layout.sheet(p)))
                .collect();
            let width = (line.width * em / 8.0).clamp(0.5, 20.0 * em);
            // A thin dark rim keeps light lines visible on a light ground.
            let rim = Mask::line(&points, width + em / 8.0, layout.picture);
            self.canvas.stamp_in(&rim, INK, 0.35, layout.picture);
            let mask = Mask::line(&points, width, layout.picture);
            self.canvas.stamp_in(&mask, line.color, 0.95, layout.picture);
            if line.label.is_empty() {
                continue;
            }
            let style = Style::new(0.85 * em, INK).bold().halo(WHITE);
            if let Some(&at) = points.iter().rev().flatten().next() {
                self.label(&line.label, at, 0.5 * em, style);
            }
        }
    }

    fn markers(&mut self) {
        let Self { figure, layout, .. } = *self;
        let em = layout.em;
        let mut places: Vec<(f64, f64, String)> = figure
            .markers
            .iter()
            .filter(|m| m.at[0].is_finite() && m.at[1].is_finite())
            .map(|m| {
                let (x, y) = layout.sheet(m.at);
                (x, y, m.label.clone())
            })
            .collect();
        if figure.extrema {
            places.extend(extrema(figure, layout));
        }
        let radius = 0.36 * em;
        // All rings first: a label must not hide a later one.
        for (x, y, _) in &places {
            let dot =
                |r: f64| Mask::line(&[Some((*x, *y)), Some((*x, *y))], 2.0 * r, layout.picture);
            self.canvas.stamp_in(&dot(radius + em / 7.0), WHITE, 0.95, layout.picture);
            self.canvas.stamp_in(&dot(radius), INK, 1.0, layout.picture);
            self.canvas.stamp_in(&dot(radius * 0.42), WHITE, 1.0, layout.picture);
            let reach = (radius + em / 7.0) as i64;
            let (x, y) = (*x as i64 - reach, *y as i64 - reach);
            self.taken.push(Rect { x, y, width: 2 * reach, height: 2 * reach });
        }
        for (x, y, words) in &places {
            let style = Style::new(0.9 * em, INK).bold().halo(WHITE);
            self.label(words, (*x, *y), radius + 0.35 * em, style);
        }
    }

    /// Sets a label beside a place: the first of eight sides where it hides nothing.
    fn label(&mut self, words: &str, (x, y): (f64, f64), gap: f64, style: Style) {
        let Self { layout, letters, .. } = *self;
        let words = words.trim();
        if words.is_empty()
            || !layout.picture.holds(&Rect { x: x as i64, y: y as i64, width: 0, height: 0 })
        {
            return;
        }
        let width = letters.width(words, style.size, style.weight);
        let (rise, fall) = (0.78 * style.size, 0.24 * style.size);
        let slant = gap * 0.75;
        let middle = y + (rise - fall) / 2.0;
        let candidates = [
            (x + gap, middle),
            (x - gap - width, middle),
            (x - width / 2.0, y - gap - fall),
            (x - width / 2.0, y + gap + rise),
            (x + slant, y - slant - fall),
            (x + slant, y + slant + rise),
            (x - slant - width, y - slant - fall),
            (x - slant - width, y + slant + rise),
        ];
        let area = |(left, base): (f64, f64)| Rect {
            x: left as i64 - 1,
            y: (base - rise) as i64 - 1,
            width: width as i64 + 3,
            height: (rise + fall) as i64 + 2,
        };
        let fits = |at: &&(f64, f64)| {
            let area = area(**at);
            layout.picture.holds(&area) && !self.taken.iter().any(|t| t.overlaps(&area))
        };
        let inside = |at: &&(f64, f64)| layout.picture.holds(&area(**at));
        let chosen = candidates.iter().find(fits).or_else(|| candidates.iter().find(inside));
        let Some(&at) = chosen else { return };
        self.taken.push(area(at));
        letters.draw(self.canvas, words, at, &style);
    }

    fn scale_bar(&mut self, metres_per_pixel: f64) {
        let Self { layout, letters, .. } = *self;
        let metres_per_dot = metres_per_pixel / layout.factor as f64;
        if !(metres_per_dot.is_finite() && metres_per_dot > 0.0) {
            return;
        }
        let em = layout.em;
        let wanted = metres_per_dot * (layout.picture.width as f64 * 0.27);
        // The largest round length of at most `wanted`: the step that parts it, at most twice.
        let mut metres = nice_step(wanted, 2.0);
        while metres * 2.0 <= wanted * 1.0001 {
            metres *= 2.0;
        }
        let (words, unit) = if metres >= 1000.0 {
            (format_value(metres / 1000.0), "km")
        } else {
            (format_value(metres), "m")
        };
        let words = format!("{words}\u{a0}{unit}");
        let style = Style::new(0.9 * em, INK).bold();
        let length = (metres / metres_per_dot).round() as i64;
        let text = letters.width(&words, style.size, style.weight);
        let pad = 0.55 * em;
        let width = (length as f64).max(text) + 2.0 * pad;
        let height = 2.35 * em;
        let plate = Rect {
            x: layout.picture.x + (0.6 * em) as i64,
            y: layout.picture.bottom() - (0.6 * em + height) as i64,
            width: width as i64,
            height: height as i64,
        };
        if !layout.picture.holds(&plate) {
            return;
        }
        self.canvas.fill(plate, WHITE, 0.82);
        let at = (plate.x as f64 + (plate.width as f64 - text) / 2.0, plate.y as f64 + 1.2 * em);
        letters.draw(self.canvas, &words, at, &style);
        let bar = Rect {
            x: plate.x + (plate.width - length) / 2,
            y: plate.y + (1.55 * em) as i64,
            width: length,
            height: ((0.34 * em).round() as i64).max(3),
        };
        self.canvas.fill(bar, INK, 1.0);
        let hair = ((em / 14.0).round() as i64).max(1);
        // Two parts, the second one hollow: half the length can be read off too.
        let half = Rect { x: bar.x + length / 2, width: length - length / 2, ..bar }.grown(-hair);
        self.canvas.fill(half, WHITE, 1.0);
        self.taken.push(plate);
    }

    fn north_arrow(&mut self, north_deg: f64) {
        let Self { layout, letters, .. } = *self;
        let em = layout.em;
        let radius = 1.75 * em;
        let center = (
            layout.picture.right() as f64 - radius - 0.7 * em,
            layout.picture.y as f64 + radius + 0.7 * em,
        );
        let reach = radius as i64;
        let (x, y) = (center.0 as i64 - reach, center.1 as i64 - reach);
        let area = Rect { x, y, width: 2 * reach, height: 2 * reach };
        if !layout.picture.holds(&area) || !north_deg.is_finite() {
            return;
        }
        let disc = Mask::line(&[Some(center), Some(center)], 2.0 * radius, layout.picture);
        self.canvas.stamp(&disc, WHITE, 0.82);
        let (sin, cos) = libm::sincos(north_deg.to_radians());
        let turned = |x: f64, y: f64| {
            let (x, y) = (x * em, y * em);
            (center.0 + x * cos - y * sin, center.1 + x * sin + y * cos)
        };
        let left = [turned(0.0, -0.45), turned(-0.55, 1.25), turned(0.0, 0.85)];
        let right = [turned(0.0, -0.45), turned(0.55, 1.25), turned(0.0, 0.85)];
        self.canvas.stamp(&Mask::polygon(&left, layout.picture), INK, 1.0);
        self.canvas.stamp(&Mask::polygon(&right, layout.picture), SOFT_INK, 0.75);
        let style = Style::new(0.95 * em, INK).bold();
        let letter = turned(0.0, -1.0);
        let width = letters.width("N", style.size, style.weight);
        letters.draw(
            self.canvas,
            "N",
            (letter.0 - width / 2.0, letter.1 + 0.36 * style.size),
            &style,
        );
        self.taken.push(area);
    }
}

/// The smallest and largest values that are not 0, first places in reading order.
fn extrema(figure: &Figure<'_>, layout: &Layout) -> Vec<(f64, f64, String)> {
    let mut low: Option<(usize, f32)> = None;
    let mut high: Option<(usize, f32)> = None;
    for (at, &value) in figure.data.data().iter().enumerate() {
        if value == 0.0 || !value.is_finite() {
            continue;
        }
        if low.is_none_or(|(_, v)| value < v) {
            low = Some((at, value));
        }
        if high.is_none_or(|(_, v)| value > v) {
            high = Some((at, value));
        }
    }
    let columns = figure.data.columns();
    [("min", low), ("max", high)]
        .into_iter()
        .filter_map(|(name, found)| {
            let (at, value) = found?;
            let digits: f64 = format!("{value:.2e}").parse().ok()?;
            let place = [(at % columns) as f64 + 0.5, (at / columns) as f64 + 0.5];
            let (x, y) = layout.sheet(place);
            Some((x, y, format!("{name} {} {}", format_value(digits), figure.scale.unit)))
        })
        .collect()
}

/// Large hollow letters across the picture: seen at once, but every pixel of data stays readable
/// between their strokes.
fn watermark(canvas: &mut Canvas, words: &str, layout: &Layout, letters: &Lettering) {
    let picture = layout.picture;
    let (width, height) = (picture.width as f64, picture.height as f64);
    let unit = letters.width(words, 100.0, Weight::Bold) / 100.0;
    if unit <= 0.0 {
        return;
    }
    // Along the diagonal, but not steeper than 30 degrees, over two thirds of the picture.
    let slope = libm::atan2(height, width).min(std::f64::consts::FRAC_PI_6);
    let (sin, cos) = libm::sincos(slope);
    let room = (width * 0.66 / cos).min(height * 0.66 / sin.max(0.05));
    let size = (room / (unit + 1.0)).max(6.0);
    let flat = letters.mask(words, (0.0, 0.0), size, Weight::Bold);
    let stroke = (size / 30.0).max(0.7);
    let outer = flat.dilated(stroke);
    let middle = (
        flat.area.x as f64 + flat.area.width as f64 / 2.0,
        flat.area.y as f64 + flat.area.height as f64 / 2.0,
    );
    let center = (picture.x as f64 + width / 2.0, picture.y as f64 + height / 2.0);
    let mut rim = Mask::empty(picture);
    let mut light = Mask::empty(picture);
    for y in picture.y..picture.bottom() {
        for x in picture.x..picture.right() {
            let p = (x as f64 + 0.5 - center.0, y as f64 + 0.5 - center.1);
            // Rising to the right: turned back by the slope.
            let q = (p.0 * cos - p.1 * sin + middle.0, p.0 * sin + p.1 * cos + middle.1);
            let (inside, around) = (sample(&flat, q), sample(&outer, q));
            rim.raise(x, y, (around - inside).max(0.0));
            light.raise(x, y, inside);
        }
    }
    canvas.stamp_in(&rim, INK, 0.34, picture);
    canvas.stamp_in(&light, WHITE, 0.17, picture);
}

fn sample(mask: &Mask, (x, y): (f64, f64)) -> f32 {
    let (x, y) = (x - 0.5, y - 0.5);
    let (i, j) = (libm::floor(x), libm::floor(y));
    let (u, v) = ((x - i) as f32, (y - j) as f32);
    let (i, j) = (i as i64, j as i64);
    let top = mask.at(i, j) * (1.0 - u) + mask.at(i + 1, j) * u;
    let bottom = mask.at(i, j + 1) * (1.0 - u) + mask.at(i + 1, j + 1) * u;
    top * (1.0 - v) + bottom * v
}

fn axis(canvas: &mut Canvas, figure: &Figure<'_>, layout: &Layout, letters: &Lettering) {
    let em = layout.em;
    let mut taken: Vec<(f64, f64)> = Vec::new();
    for major in [true, false] {
        for label in figure.axis.iter().filter(|l| l.major == major && l.column.is_finite()) {
            let (x, _) = layout.sheet([label.column, 0.0]);
            let style = Style::new(0.92 * em, if major { INK } else { SOFT_INK });
            let style = if major { style.bold() } else { style };
            let width = letters.width(&label.label, style.size, style.weight);
            let (left, right) = (x - width / 2.0, x + width / 2.0);
            let bottom = layout.picture.bottom();
            let inside =
                x >= layout.picture.x as f64 - 1.0 && x <= layout.picture.right() as f64 + 1.0;
            let free = taken.iter().all(|t| right + 0.4 * em < t.0 || left - 0.4 * em > t.1);
            if !inside || !free {
                continue;
            }
            let thick = ((em / 11.0).round() as i64).max(1);
            let long = ((if major { 0.45 } else { 0.3 }) * em) as i64;
            let tick = Rect { x: x as i64 - thick / 2, y: bottom, width: thick, height: long };
            canvas.fill(tick, INK, 1.0);
            letters.draw(canvas, &label.label, (left, layout.axis_y), &style);
            taken.push((left, right));
        }
    }
}
