//! Polar plots of scattering over the half circle of outgoing directions, as SVG or PNG.

use std::fmt::Write as _;
use std::path::Path;

use super::Error;
use super::canvas::{Canvas, Color, HAIRLINE, INK, Mask, SOFT_INK, WHITE};
use super::png;
use super::text::{Lettering, Style, Weight};

/// A curve of a polar plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// What the legend calls it.
    pub label: String,
    /// Which of four patterns of dashes; 0 is a line.
    pub dashes: usize,
    /// Which colour of eight.
    pub colour: usize,
    /// Angle from the vertical (positive to the right), degrees, and value.
    pub points: Vec<(f64, f64)>,
}

/// What the radius means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Radius {
    /// Five decades down from the largest value.
    #[default]
    Logarithmic,
    /// From zero.
    Linear,
}

/// A polar plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Polar {
    /// Above it.
    pub title: String,
    /// What the radius shows, with its unit.
    pub quantity: String,
    /// What the radius means.
    pub radius: Radius,
    /// Angles from which the light comes, degrees, and their pattern of dashes: an arrow each, from
    /// the left.
    pub arrows: Vec<(f64, usize)>,
    /// In the order of the legend.
    pub curves: Vec<Curve>,
}

/// Okabe and Ito's colours, which stay apart in every common colour blindness.
const COLOURS: [Color; 8] = [
    [0x00, 0x72, 0xb2],
    [0xd5, 0x5e, 0x00],
    [0x00, 0x9e, 0x73],
    [0xcc, 0x79, 0xa7],
    [0x33, 0x33, 0x33],
    [0xe6, 0x9f, 0x00],
    [0x56, 0xb4, 0xe9],
    [0x7a, 0x51, 0x95],
];
/// Lengths of dashes and gaps.
const DASHES: [&[f64]; 4] = [&[], &[9.0, 5.0], &[2.0, 4.5], &[11.0, 4.5, 2.0, 4.5]];
const GRID: Color = [0xdf, 0xe2, 0xe7];
const WIDTH: f64 = 900.0;
const OUTER: f64 = 310.0;
const CENTRE: (f64, f64) = (450.0, 448.0);
const DECADES: i32 = 5;
/// Pixels of a PNG for each unit of the drawing.
const FINE: f64 = 2.0;
const LINE_OF_LEGEND: f64 = 22.0;

#[derive(Clone, Copy)]
enum Anchor {
    Start,
    Middle,
    End,
}

/// What a plot is drawn from.
enum Stroke {
    Line { points: Vec<(f64, f64)>, colour: Color, width: f64, dashes: usize },
    Text { at: (f64, f64), text: String, size: f64, colour: Color, anchor: Anchor, bold: bool },
}

fn line(points: Vec<(f64, f64)>, colour: Color, width: f64) -> Stroke {
    Stroke::Line { points, colour, width, dashes: 0 }
}

fn label(at: (f64, f64), text: impl Into<String>, anchor: Anchor) -> Stroke {
    Stroke::Text { at, text: text.into(), size: 12.5, colour: SOFT_INK, anchor, bold: false }
}

fn place(angle_deg: f64, radius: f64) -> (f64, f64) {
    let angle = angle_deg.to_radians();
    (CENTRE.0 + radius * libm::sin(angle), CENTRE.1 - radius * libm::cos(angle))
}

fn arc(radius: f64) -> Vec<(f64, f64)> {
    (-60..=60).map(|i| place(1.5 * f64::from(i), radius)).collect()
}

/// The step of a linear scale: 1, 2 or 5 times a power of ten, four to nine of them.
fn step(most: f64) -> f64 {
    let power = libm::pow(10.0, libm::floor(libm::log10(most / 4.0)));
    [1.0, 2.0, 5.0].map(|m| m * power).into_iter().rfind(|s| most / s >= 4.0).unwrap_or(power)
}

/// What the radius of a plot spans.
enum Span {
    Log { top: i32 },
    Linear { top: f64, step: f64 },
}

impl Span {
    fn of(plot: &Polar) -> Self {
        let most = plot.curves.iter().flat_map(|c| &c.points).fold(0.0_f64, |m, p| m.max(p.1));
        let most = if most > 0.0 && most.is_finite() { most } else { 1.0 };
        match plot.radius {
            Radius::Logarithmic => Self::Log { top: libm::ceil(libm::log10(most) - 1e-9) as i32 },
            Radius::Linear => {
                let step = step(most);
                Self::Linear { top: libm::ceil(most / step - 1e-9) * step, step }
            }
        }
    }

    fn radius(&self, value: f64) -> f64 {
        let share = match self {
            Self::Log { top } if value > 0.0 => {
                (libm::log10(value) - f64::from(top - DECADES)) / f64::from(DECADES)
            }
            Self::Log { .. } => 0.0,
            Self::Linear { top, .. } => value / top,
        };
        OUTER * share.clamp(0.0, 1.0)
    }

    /// Values of the rings and how they are written.
    fn rings(&self) -> Vec<(f64, String)> {
        match *self {
            Self::Log { top } => (top - DECADES + 1..=top)
                .map(|decade| {
                    let value = libm::pow(10.0, f64::from(decade));
                    let text = match decade {
                        -3..=0 => format!("{value:.*}", usize::try_from(-decade).unwrap_or(0)),
                        1..=5 => format!("{value:.0}"),
                        _ => format!("1e{decade}"),
                    };
                    (value, text)
                })
                .collect(),
            Self::Linear { top, step } => {
                let digits = libm::ceil(-libm::log10(step) - 1e-9).clamp(0.0, 9.0) as usize;
                let count = libm::round(top / step) as u32;
                (1..=count)
                    .map(|i| (step * f64::from(i), format!("{:.digits$}", step * f64::from(i))))
                    .collect()
            }
        }
    }
}

impl Polar {
    fn height(&self) -> f64 {
        CENTRE.1 + 62.0 + LINE_OF_LEGEND * self.curves.len() as f64 + 12.0
    }

    fn strokes(&self) -> Vec<Stroke> {
        let span = Span::of(self);
        let note = match self.radius {
            Radius::Logarithmic => "radius logarithmic; arrows: where the light comes from",
            Radius::Linear => "radius linear; arrows: where the light comes from",
        };
        let mut out = vec![
            Stroke::Text {
                at: (CENTRE.0, 32.0),
                text: self.title.clone(),
                size: 19.0,
                colour: INK,
                anchor: Anchor::Middle,
                bold: true,
            },
            label((CENTRE.0, 54.0), format!("{}; {note}", self.quantity), Anchor::Middle),
        ];
        for angle in (-90..=90).step_by(15) {
            let angle = f64::from(angle);
            out.push(line(vec![place(angle, 0.0), place(angle, OUTER)], GRID, 1.0));
            let at = place(angle, OUTER + 20.0);
            let down = if angle.abs() == 90.0 { -6.0 } else { 4.5 };
            out.push(label((at.0, at.1 + down), format!("{:.0}°", angle.abs()), Anchor::Middle));
        }
        for (value, text) in span.rings() {
            let radius = span.radius(value);
            out.push(line(arc(radius), GRID, 1.0));
            for side in [-1.0, 1.0] {
                let at = (CENTRE.0 + side * radius, CENTRE.1 + 17.0);
                out.push(label(at, text.clone(), Anchor::Middle));
            }
        }
        out.push(line(vec![place(-90.0, OUTER), place(90.0, OUTER)], HAIRLINE, 1.5));
        for &(angle, dashes) in &self.arrows {
            out.extend(arrow(angle, dashes));
        }
        for (i, curve) in self.curves.iter().enumerate() {
            let colour = COLOURS[curve.colour % COLOURS.len()];
            let points =
                curve.points.iter().map(|&(angle, value)| place(angle, span.radius(value)));
            let (dashes, width) = (curve.dashes, 2.0);
            out.push(Stroke::Line { points: points.collect(), colour, width, dashes });
            let y = CENTRE.1 + 62.0 + LINE_OF_LEGEND * i as f64;
            let sample = vec![(140.0, y - 4.5), (190.0, y - 4.5)];
            out.push(Stroke::Line { points: sample, colour, width: 2.5, dashes });
            out.push(Stroke::Text {
                at: (202.0, y),
                text: curve.label.clone(),
                size: 13.5,
                colour: INK,
                anchor: Anchor::Start,
                bold: false,
            });
        }
        out
    }

    /// The plot as SVG.
    pub fn svg(&self) -> String {
        let height = self.height();
        let mut s = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" height=\"{height}\" font-family=\"Inter, Helvetica, Arial, sans-serif\">\n<rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#fff\"/>\n"
        );
        let hex = |c: Color| format!("#{:02x}{:02x}{:02x}", c[0], c[1], c[2]);
        for stroke in self.strokes() {
            // Writing into a String can't fail.
            let _ = match stroke {
                Stroke::Line { points, colour, width, dashes } => {
                    let points: Vec<String> =
                        points.iter().map(|(x, y)| format!("{x:.2},{y:.2}")).collect();
                    let dashes: Vec<String> =
                        DASHES[dashes % DASHES.len()].iter().map(f64::to_string).collect();
                    let dashes = if dashes.is_empty() {
                        String::new()
                    } else {
                        format!(" stroke-dasharray=\"{}\"", dashes.join(" "))
                    };
                    writeln!(
                        s,
                        "<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"{dashes} points=\"{}\"/>",
                        hex(colour),
                        points.join(" ")
                    )
                }
                Stroke::Text { at, text, size, colour, anchor, bold } => {
                    let anchor = match anchor {
                        Anchor::Start => "start",
                        Anchor::Middle => "middle",
                        Anchor::End => "end",
                    };
                    let weight = if bold { " font-weight=\"600\"" } else { "" };
                    writeln!(
                        s,
                        "<text x=\"{:.2}\" y=\"{:.2}\" font-size=\"{size}\" text-anchor=\"{anchor}\" fill=\"{}\"{weight}>{}</text>",
                        at.0,
                        at.1,
                        hex(colour),
                        escaped(&text)
                    )
                }
            };
        }
        s.push_str("</svg>\n");
        s
    }

    /// Writes the plot as PNG, two pixels for each unit of the SVG.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write_png(&self, path: &Path) -> Result<(), Error> {
        let size = [WIDTH, self.height()].map(|v| (FINE * v) as usize);
        let mut canvas = Canvas::new(size[0], size[1], WHITE);
        let letters = Lettering::new();
        for stroke in self.strokes() {
            match stroke {
                Stroke::Line { points, colour, width, dashes } => {
                    let fine: Vec<_> = points.iter().map(|p| (FINE * p.0, FINE * p.1)).collect();
                    let points = dashed(&fine, DASHES[dashes % DASHES.len()]);
                    let mask = Mask::line(&points, FINE * width, canvas.area());
                    canvas.stamp(&mask, colour, 1.0);
                }
                Stroke::Text { at, text, size, colour, anchor, bold } => {
                    let style = Style::new(FINE * size, colour);
                    let (style, weight) =
                        if bold { (style.bold(), Weight::Bold) } else { (style, Weight::Regular) };
                    let wide = letters.width(&text, FINE * size, weight);
                    let left = match anchor {
                        Anchor::Start => 0.0,
                        Anchor::Middle => 0.5 * wide,
                        Anchor::End => wide,
                    };
                    letters.draw(&mut canvas, &text, (FINE * at.0 - left, FINE * at.1), &style);
                }
            }
        }
        png::write(path, &canvas.into_pixels(), &[("Title".into(), self.title.clone())])
    }
}

/// Where light comes from: an arrow outside the half circle, pointing at its middle.
fn arrow(angle_deg: f64, dashes: usize) -> Vec<Stroke> {
    let (tail, tip) = (place(-angle_deg, OUTER + 70.0), place(-angle_deg, OUTER + 34.0));
    let wing = |by: f64| place(-angle_deg + by, OUTER + 44.0);
    let text_at = place(-angle_deg, OUTER + 76.0);
    let anchor = if angle_deg < 5.0 { Anchor::Middle } else { Anchor::End };
    let colour = INK;
    vec![
        Stroke::Line { points: vec![tail, tip], colour, width: 1.6, dashes },
        line(vec![wing(-0.9), tip, wing(0.9)], colour, 1.6),
        Stroke::Text {
            at: (text_at.0, text_at.1 + 4.0),
            text: format!("{angle_deg}°"),
            size: 12.5,
            colour,
            anchor,
            bold: false,
        },
    ]
}

/// Cuts a line into dashes; gaps are `None`.
fn dashed(points: &[(f64, f64)], pattern: &[f64]) -> Vec<Option<(f64, f64)>> {
    if pattern.is_empty() {
        return points.iter().copied().map(Some).collect();
    }
    let (mut nth, mut left) = (0, FINE * pattern[0]);
    let mut out = vec![points.first().copied()];
    for pair in points.windows(2) {
        let (mut from, to) = (pair[0], pair[1]);
        loop {
            let (dx, dy) = (to.0 - from.0, to.1 - from.1);
            let length = (dx * dx + dy * dy).sqrt();
            let drawn = nth % 2 == 0;
            if length <= left {
                left -= length;
                out.push(drawn.then_some(to));
                break;
            }
            from = (from.0 + dx * left / length, from.1 + dy * left / length);
            if drawn {
                out.extend([Some(from), None]);
            } else {
                out.extend([None, Some(from)]);
            }
            nth = (nth + 1) % pattern.len();
            left = FINE * pattern[nth];
        }
    }
    out
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(radius: Radius, most: f64) -> Polar {
        let points = vec![(-30.0, 0.0), (0.0, 0.5 * most), (30.0, most), (60.0, 1e-9)];
        let curve = Curve { label: "a < b & c".into(), dashes: 3, colour: 9, points };
        Polar {
            title: "T".into(),
            quantity: "BRDF, 1/sr".into(),
            radius,
            arrows: vec![(30.0, 0)],
            curves: vec![curve],
        }
    }

    #[test]
    fn the_radius_is_what_the_rings_say() {
        let log = Span::of(&plot(Radius::Logarithmic, 30.0));
        assert_eq!(
            log.rings().iter().map(|r| r.1.as_str()).collect::<Vec<_>>(),
            ["0.01", "0.1", "1", "10", "100"]
        );
        assert!((log.radius(100.0) - OUTER).abs() < 1e-9);
        assert!((log.radius(1.0) - 0.6 * OUTER).abs() < 1e-9);
        assert_eq!(log.radius(0.0), 0.0);
        let linear = Span::of(&plot(Radius::Linear, 0.13));
        assert_eq!(linear.rings()[0].1, "0.02");
        assert!((linear.radius(0.07) - 0.5 * OUTER).abs() < 1e-9);
        for most in [1e-7, 0.3, 1.0, 4.0, 99.0, 3e8] {
            let rings = Span::of(&plot(Radius::Linear, most)).rings();
            assert!((4..=10).contains(&rings.len()), "{most}: {rings:?}");
        }
    }

    #[test]
    fn svg_and_png_are_whole() {
        for radius in [Radius::Logarithmic, Radius::Linear] {
            let plot = plot(radius, 3.0);
            let svg = plot.svg();
            assert!(roxmltree::Document::parse(&svg).is_ok());
            assert!(svg.contains("a &lt; b &amp; c") && svg.contains("1/sr"));
            let keep = tempfile::tempdir().unwrap();
            let path = keep.path().join("p.png");
            plot.write_png(&path).unwrap();
            assert_eq!(png::read(&path).unwrap().0.columns(), (FINE * WIDTH) as usize);
        }
    }

    #[test]
    fn dashes_keep_their_length() {
        let pieces = dashed(&[(0.0, 0.0), (100.0, 0.0)], &[10.0, 5.0]);
        let drawn: f64 = pieces.windows(2).filter_map(|p| Some((p[1]?.0 - p[0]?.0).abs())).sum();
        // 20 of 30, to the last.
        assert!((drawn - 70.0).abs() < 1e-9, "{drawn} {pieces:?}");
    }
}
