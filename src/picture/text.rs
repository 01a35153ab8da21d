//! Lettering: the embedded typeface, measured, wrapped and drawn.
//!
//! The typeface is part of the program, so that a figure looks the same on every machine.

use ab_glyph::{Font as _, FontRef, GlyphId, PxScale, ScaleFont as _, point};

use super::canvas::{Canvas, Color, Mask, Rect};

/// The two weights in which figures are lettered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Weight {
    Regular,
    Bold,
}

/// The embedded typeface: Inter, see font/README.md.
pub(super) struct Lettering {
    regular: FontRef<'static>,
    bold: FontRef<'static>,
}

impl Lettering {
    pub(super) fn new() -> Self {
        let regular = FontRef::try_from_slice(include_bytes!("font/Inter-Regular.otf"));
        let bold = FontRef::try_from_slice(include_bytes!("font/Inter-SemiBold.otf"));
        Self {
            regular: regular.expect("the embedded font is sound"),
            bold: bold.expect("the embedded font is sound"),
        }
    }

    fn font(&self, weight: Weight) -> &FontRef<'static> {
        match weight {
            Weight::Regular => &self.regular,
            Weight::Bold => &self.bold,
        }
    }

    fn scale(&self, size: f64, weight: Weight) -> PxScale {
        let font = self.font(weight);
        let units = font.units_per_em().unwrap_or(1000.0);
        PxScale::from(size as f32 * font.height_unscaled() / units)
    }

    fn glyphs(&self, text: &str, size: f64, weight: Weight) -> (Vec<(GlyphId, f32)>, f32) {
        let font = self.font(weight).as_scaled(self.scale(size, weight));
        let mut at = 0.0;
        let mut out = Vec::new();
        for c in text.chars().filter(|c| !c.is_control()) {
            let id = font.glyph_id(c);
            out.push((id, at));
            at += font.h_advance(id);
        }
        (out, at)
    }

    /// Whether the font has a sign.
    #[cfg(test)]
    fn has(&self, c: char) -> bool {
        self.regular.glyph_id(c).0 != 0 && self.bold.glyph_id(c).0 != 0
    }

    /// Width of a line in pixels at a letter size (em) in pixels.
    pub(super) fn width(&self, text: &str, size: f64, weight: Weight) -> f64 {
        f64::from(self.glyphs(text, size, weight).1)
    }

    /// What a line covers when it begins at `x` on the base line `y`.
    pub(super) fn mask(&self, text: &str, (x, y): (f64, f64), size: f64, weight: Weight) -> Mask {
        let font = self.font(weight);
        let scale = self.scale(size, weight);
        let outlines: Vec<_> = self
            .glyphs(text, size, weight)
            .0
            .into_iter()
            .filter_map(|(id, at)| {
                let place = point(x as f32 + at, y as f32);
                font.outline_glyph(id.with_scale_and_position(scale, place))
            })
            .collect();
        let whole = |v: f32| v as i64;
        let mut area: Option<Rect> = None;
        for outline in &outlines {
            let b = outline.px_bounds();
            let (left, top) = (whole(b.min.x.floor()), whole(b.min.y.floor()));
            let (right, bottom) = (whole(b.max.x.ceil()) + 1, whole(b.max.y.ceil()) + 1);
            let (x, y) = area.map_or((left, top), |a| (a.x.min(left), a.y.min(top)));
            let right = area.map_or(right, |a| a.right().max(right));
            let bottom = area.map_or(bottom, |a| a.bottom().max(bottom));
            area = Some(Rect { x, y, width: right - x, height: bottom - y });
        }
        let mut mask = Mask::empty(area.unwrap_or_default());
        for outline in &outlines {
            let corner = outline.px_bounds().min;
            let (left, top) = (whole(corner.x.floor()), whole(corner.y.floor()));
            outline.draw(|i, j, cover| mask.raise(left + i64::from(i), top + i64::from(j), cover));
        }
        mask
    }

    /// Draws a line of text.
    pub(super) fn draw(&self, canvas: &mut Canvas, text: &str, at: (f64, f64), style: &Style) {
        let mask = self.mask(text, at, style.size, style.weight);
        if let Some((color, radius)) = style.halo {
            canvas.stamp(&mask.dilated(radius), color, 0.85);
        }
        canvas.stamp(&mask, style.color, 1.0);
    }

    /// Sets a paragraph below `y`, its lines `leading` ems apart, and returns where it ends.
    pub(super) fn set(
        &self,
        lines: &mut Vec<SetLine>,
        text: &str,
        style: Style,
        (x, mut y): (f64, f64),
        (width, leading): (f64, f64),
    ) -> f64 {
        if text.is_empty() {
            return y;
        }
        for text in self.wrap(text, style.size, style.weight, width) {
            lines.push(SetLine { text, at: (x, (y + style.size).round()), style });
            y += leading * style.size;
        }
        y
    }

    /// Draws lines that were set.
    pub(super) fn draw_all(&self, canvas: &mut Canvas, lines: &[SetLine]) {
        for line in lines {
            self.draw(canvas, &line.text, line.at, &line.style);
        }
    }

    /// Breaks text into lines of at most `width` pixels; words that are longer are cut.
    pub(super) fn wrap(&self, text: &str, size: f64, weight: Weight, width: f64) -> Vec<String> {
        let fits = |line: &str| self.width(line, size, weight) <= width;
        let mut lines = Vec::new();
        for paragraph in text.split('\n') {
            let mut line = String::new();
            for word in paragraph.split(' ').filter(|w| !w.is_empty()) {
                let longer =
                    if line.is_empty() { word.to_owned() } else { format!("{line} {word}") };
                if fits(&longer) {
                    line = longer;
                    continue;
                }
                if !line.is_empty() {
                    lines.push(std::mem::take(&mut line));
                }
                for c in word.chars() {
                    line.push(c);
                    if !fits(&line) && line.chars().nth(1).is_some() {
                        line.pop();
                        lines.push(std::mem::replace(&mut line, c.to_string()));
                    }
                }
            }
            lines.push(line);
        }
        lines
    }
}

/// A line of text, where it begins on its base line, and how it looks.
pub(super) struct SetLine {
    pub text: String,
    pub at: (f64, f64),
    pub style: Style,
}

/// How a line of text looks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Style {
    pub size: f64,
    pub weight: Weight,
    pub color: Color,
    /// Colour and width of a rim that keeps text legible on a picture.
    pub halo: Option<(Color, f64)>,
}

impl Style {
    pub(super) fn new(size: f64, color: Color) -> Self {
        Self { size, weight: Weight::Regular, color, halo: None }
    }

    pub(super) fn bold(self) -> Self {
        Self { weight: Weight::Bold, ..self }
    }

    pub(super) fn halo(self, color: Color) -> Self {
        Self { halo: Some((color, self.size * 0.14)), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_every_sign_that_figures_use() {
        let letters = Lettering::new();
        let signs = "ABCXYZabcxyz0123456789 .,:;!?()[]{}<>=+-*/%&@#'\"_|\\~^$\
            äöüÄÖÜßéèêàçñøåæœšžČčłŁőűěřů°²³¹±×÷·µμ€§¶©«»\
            –—‘’“”„…•−≤≥≈≠∞→←↑↓⁰⁴⁵⁶⁷⁸⁹⁻₀₁₂₃₄τΦπσωΔαβθ\u{202f}\u{a0}\u{2009}";
        let missing: String = signs.chars().filter(|&c| !letters.has(c)).collect();
        assert!(missing.is_empty(), "the font lacks {missing:?}");
    }

    #[test]
    fn wrapped_lines_fit_and_lose_no_letter() {
        let letters = Lettering::new();
        let text = "Annual irradiation reflected by the photovoltaic roof, \
                    Donaudampfschifffahrtsgesellschaftskapitänsmütze included\nsecond paragraph";
        for width in [1.0, 40.0, 90.0, 333.0, 5000.0] {
            let lines = letters.wrap(text, 14.0, Weight::Regular, width);
            for line in &lines {
                let fits = letters.width(line, 14.0, Weight::Regular) <= width;
                assert!(fits || line.chars().count() == 1, "{line:?} at {width}");
            }
            let strip = |s: &str| s.replace([' ', '\n'], "");
            assert_eq!(strip(&lines.concat()), strip(text));
        }
    }

    #[test]
    fn letters_cover_what_they_should() {
        let letters = Lettering::new();
        let mask = letters.mask("lI|", (10.3, 40.0), 32.0, Weight::Bold);
        assert!(mask.area.x >= 10 && mask.area.bottom() <= 52 && mask.area.y < 20);
        let full = mask.cover.iter().filter(|c| **c > 0.99).count();
        assert!(full > 100, "{full} full pixels");
        assert!(letters.mask(" ", (0.0, 0.0), 32.0, Weight::Bold).cover.is_empty());
    }
}
