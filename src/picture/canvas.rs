//! A canvas of pixels and the masks that are stamped onto it: all that figures are drawn with.
//!
//! Lines and letters become a [`Mask`] of coverage first, and a mask is blended in one go, so that
//! a line that crosses itself isn't darker there. Everything is clipped; a place outside is no
//! error.

use crate::base::Grid;

/// A display colour.
pub(super) type Color = [u8; 3];

pub(super) const WHITE: Color = [255; 3];
pub(super) const INK: Color = [0x1d, 0x1f, 0x24];
pub(super) const SOFT_INK: Color = [0x55, 0x5a, 0x63];
pub(super) const HAIRLINE: Color = [0x9a, 0x9e, 0xa6];

/// A rectangle in whole pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Rect {
    pub x: i64,
    pub y: i64,
    pub width: i64,
    pub height: i64,
}

impl Rect {
    pub(super) fn right(&self) -> i64 {
        self.x + self.width
    }

    pub(super) fn bottom(&self) -> i64 {
        self.y + self.height
    }

    pub(super) fn overlaps(&self, other: &Self) -> bool {
        self.x < other.right()
            && other.x < self.right()
            && self.y < other.bottom()
            && other.y < self.bottom()
    }

    pub(super) fn holds(&self, other: &Self) -> bool {
        other.x >= self.x
            && other.y >= self.y
            && other.right() <= self.right()
            && other.bottom() <= self.bottom()
    }

    pub(super) fn intersection(&self, other: &Self) -> Self {
        let (x, y) = (self.x.max(other.x), self.y.max(other.y));
        let width = self.right().min(other.right()) - x;
        let height = self.bottom().min(other.bottom()) - y;
        Self { x, y, width: width.max(0), height: height.max(0) }
    }

    pub(super) fn grown(&self, by: i64) -> Self {
        let (width, height) = (self.width + 2 * by, self.height + 2 * by);
        Self { x: self.x - by, y: self.y - by, width, height }
    }
}

/// How much of each pixel of a rectangle is covered, 0 to 1.
#[derive(Clone, Debug, Default)]
pub(super) struct Mask {
    pub area: Rect,
    pub cover: Vec<f32>,
}

impl Mask {
    pub(super) fn empty(area: Rect) -> Self {
        let pixels = (area.width.max(0) * area.height.max(0)) as usize;
        Self { area, cover: vec![0.0; pixels] }
    }

    pub(super) fn at(&self, x: i64, y: i64) -> f32 {
        let (i, j) = (x - self.area.x, y - self.area.y);
        if i < 0 || j < 0 || i >= self.area.width || j >= self.area.height {
            return 0.0;
        }
        self.cover[(j * self.area.width + i) as usize]
    }

    /// Raises the cover of a pixel; outside the area nothing happens.
    pub(super) fn raise(&mut self, x: i64, y: i64, cover: f32) {
        let (i, j) = (x - self.area.x, y - self.area.y);
        if i < 0 || j < 0 || i >= self.area.width || j >= self.area.height {
            return;
        }
        let old = &mut self.cover[(j * self.area.width + i) as usize];
        *old = old.max(cover.min(1.0));
    }

    /// The mask grown by `radius` pixels in every direction, with a soft edge.
    pub(super) fn dilated(&self, radius: f64) -> Self {
        let reach = libm::ceil(radius + 0.5) as i64;
        let mut out = Self::empty(self.area.grown(reach));
        let mut disc = Vec::new();
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let distance = ((dx * dx + dy * dy) as f64).sqrt();
                let cover = (radius + 0.5 - distance).clamp(0.0, 1.0) as f32;
                if cover > 0.0 {
                    disc.push((dx, dy, cover));
                }
            }
        }
        for j in 0..self.area.height {
            for i in 0..self.area.width {
                let cover = self.cover[(j * self.area.width + i) as usize];
                if cover > 0.0 {
                    for &(dx, dy, part) in &disc {
                        out.raise(self.area.x + i + dx, self.area.y + j + dy, cover * part);
                    }
                }
            }
        }
        out
    }

    /// A line with round ends through points; `None` breaks it. Only what lies in `clip` is kept.
    pub(super) fn line(points: &[Option<(f64, f64)>], width: f64, clip: Rect) -> Self {
        let radius = width / 2.0;
        let mut bounds = [f64::MAX, f64::MAX, f64::MIN, f64::MIN];
        for (x, y) in points.iter().flatten().filter(|p| p.0.abs() < 1e7 && p.1.abs() < 1e7) {
            bounds = [bounds[0].min(*x), bounds[1].min(*y), bounds[2].max(*x), bounds[3].max(*y)];
        }
        if bounds[0] > bounds[2] {
            return Self::default();
        }
        let low = [0, 1].map(|at| libm::floor(bounds[at] - radius - 1.0) as i64);
        let high = [2, 3].map(|at| libm::ceil(bounds[at] + radius + 1.0) as i64);
        let (width, height) = (high[0] - low[0], high[1] - low[1]);
        let area = Rect { x: low[0], y: low[1], width, height };
        let mut mask = Self::empty(area.intersection(&clip));
        let mut previous = None;
        for &point in points {
            let point = point.filter(|p| p.0.abs() < 1e7 && p.1.abs() < 1e7);
            if let (Some(a), Some(b)) = (previous, point) {
                mask.capsule(a, b, radius);
            }
            previous = point;
        }
        mask
    }

    fn capsule(&mut self, a: (f64, f64), b: (f64, f64), radius: f64) {
        let reach = radius + 1.0;
        let whole = |v: f64| libm::floor(v) as i64;
        let low = (whole(a.0.min(b.0) - reach), whole(a.1.min(b.1) - reach));
        let high = (whole(a.0.max(b.0) + reach) + 1, whole(a.1.max(b.1) + reach) + 1);
        let (width, height) = (high.0 - low.0, high.1 - low.1);
        let area = Rect { x: low.0, y: low.1, width, height }.intersection(&self.area);
        let along = (b.0 - a.0, b.1 - a.1);
        let length2 = along.0 * along.0 + along.1 * along.1;
        for y in area.y..area.bottom() {
            for x in area.x..area.right() {
                let p = (x as f64 + 0.5 - a.0, y as f64 + 0.5 - a.1);
                let t = if length2 > 0.0 {
                    ((p.0 * along.0 + p.1 * along.1) / length2).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let d = (p.0 - t * along.0, p.1 - t * along.1);
                let distance = (d.0 * d.0 + d.1 * d.1).sqrt();
                // A line thinner than a pixel covers no pixel wholly.
                let cover = (radius + 0.5 - distance).clamp(0.0, 1.0) * (2.0 * radius).min(1.0);
                self.raise(x, y, cover as f32);
            }
        }
    }

    /// A filled polygon (even-odd), sampled 4 x 4 a pixel.
    pub(super) fn polygon(corners: &[(f64, f64)], clip: Rect) -> Self {
        let bounds = |pick: fn(&(f64, f64)) -> f64| {
            let low = corners.iter().map(pick).fold(f64::MAX, f64::min);
            let high = corners.iter().map(pick).fold(f64::MIN, f64::max);
            (libm::floor(low.max(-1e7)) as i64, libm::ceil(high.min(1e7)) as i64)
        };
        let ((left, right), (top, bottom)) = (bounds(|p| p.0), bounds(|p| p.1));
        let area = Rect { x: left, y: top, width: right - left, height: bottom - top };
        let mut mask = Self::empty(area.intersection(&clip));
        let area = mask.area;
        for y in area.y..area.bottom() {
            for x in area.x..area.right() {
                let mut inside = 0u8;
                for sample in 0..16 {
                    let px = x as f64 + (f64::from(sample % 4) + 0.5) / 4.0;
                    let py = y as f64 + (f64::from(sample / 4) + 0.5) / 4.0;
                    inside += u8::from(crosses_odd(corners, px, py));
                }
                mask.raise(x, y, f32::from(inside) / 16.0);
            }
        }
        mask
    }
}

fn crosses_odd(corners: &[(f64, f64)], x: f64, y: f64) -> bool {
    let mut odd = false;
    for (at, a) in corners.iter().enumerate() {
        let b = corners[(at + 1) % corners.len()];
        if (a.1 > y) != (b.1 > y) && x < a.0 + (y - a.1) / (b.1 - a.1) * (b.0 - a.0) {
            odd = !odd;
        }
    }
    odd
}

/// A sheet of display colours to draw on.
pub(super) struct Canvas {
    pixels: Grid<Color>,
}

impl Canvas {
    pub(super) fn new(width: usize, height: usize, color: Color) -> Self {
        Self { pixels: Grid::filled(width, height, color) }
    }

    pub(super) fn into_pixels(self) -> Grid<Color> {
        self.pixels
    }

    pub(super) fn area(&self) -> Rect {
        let (width, height) = (self.pixels.columns() as i64, self.pixels.rows() as i64);
        Rect { x: 0, y: 0, width, height }
    }

    pub(super) fn fill(&mut self, area: Rect, color: Color, alpha: f64) {
        let area = area.intersection(&self.area());
        for y in area.y..area.bottom() {
            for x in area.x..area.right() {
                self.blend(x, y, color, alpha);
            }
        }
    }

    /// A frame of `width` pixels just outside `area`.
    pub(super) fn frame(&mut self, area: Rect, width: i64, color: Color) {
        let outer = area.grown(width);
        let horizontal = Rect { height: width, ..outer };
        self.fill(horizontal, color, 1.0);
        self.fill(Rect { y: area.bottom(), ..horizontal }, color, 1.0);
        let vertical = Rect { y: area.y, height: area.height, width, ..outer };
        self.fill(vertical, color, 1.0);
        self.fill(Rect { x: area.right(), ..vertical }, color, 1.0);
    }

    pub(super) fn stamp(&mut self, mask: &Mask, color: Color, alpha: f64) {
        self.stamp_in(mask, color, alpha, self.area());
    }

    /// Draws a mask in a colour, only inside `clip`.
    pub(super) fn stamp_in(&mut self, mask: &Mask, color: Color, alpha: f64, clip: Rect) {
        let area = mask.area.intersection(&self.area()).intersection(&clip);
        for y in area.y..area.bottom() {
            for x in area.x..area.right() {
                let cover = f64::from(mask.at(x, y));
                if cover > 0.0 {
                    self.blend(x, y, color, cover * alpha);
                }
            }
        }
    }

    /// Sets one pixel inside the sheet.
    pub(super) fn set(&mut self, x: i64, y: i64, color: Color) {
        if let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y))
            && x < self.pixels.columns()
            && y < self.pixels.rows()
        {
            self.pixels[(x, y)] = color;
        }
    }

    fn blend(&mut self, x: i64, y: i64, color: Color, alpha: f64) {
        let old = &mut self.pixels[(x as usize, y as usize)];
        *old = mix(*old, color, alpha);
    }
}

/// `over` laid on `under` with an opacity.
pub(super) fn mix(under: Color, over: Color, alpha: f64) -> Color {
    [0, 1, 2].map(|c| {
        let (u, o) = (f64::from(under[c]), f64::from(over[c]));
        (u + (o - u) * alpha + 0.5) as u8
    })
}
