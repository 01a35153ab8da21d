use std::fmt::Write as _;

/// A curve of a polar plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// What the legend calls it.
    pub label: String,
    /// Dashes of SVG (`"6 3"`), or empty for a line.
    pub dashes: String,
    /// Which colour of eight.
    pub colour: usize,
    /// Angle from the vertical (positive to the right), degrees, and value.
    pub points: Vec<(f64, f64)>,
}

const COLOURS: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#7a5195", "#333333"];
const RADIUS: f64 = 300.0;
const DECADES: f64 = 5.0;

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Curves over the half circle of outgoing directions as SVG, with a logarithmic radius that spans
/// five decades below the largest value.
pub fn svg(title: &str, unit: &str, curves: &[Curve]) -> String {
    let most = curves.iter().flat_map(|c| &c.points).fold(0.0_f64, |m, p| m.max(p.1));
    let top = if most > 0.0 { libm::log10(most).ceil() } else { 0.0 };
    let bottom = top - DECADES;
    let height = 420.0 + 18.0 * curves.len() as f64;
    let (cx, cy) = (380.0, 370.0);
    let at = |angle_deg: f64, value: f64| {
        let level = if value > 0.0 { (libm::log10(value) - bottom) / DECADES } else { 0.0 };
        let r = RADIUS * level.clamp(0.0, 1.0);
        let a = angle_deg.to_radians();
        (cx + r * libm::sin(a), cy - r * libm::cos(a))
    };
    let mut s = String::new();
    // Writing into a String can't fail.
    let _ = writeln!(
        s,
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 760 {height}" font-family="sans-serif" font-size="12"><rect width="760" height="{height}" fill="#fff"/><text x="380" y="24" text-anchor="middle" font-size="16">{}</text><text x="380" y="42" text-anchor="middle" fill="#555">{}, radius logarithmic</text>"##,
        escaped(title),
        escaped(unit)
    );
    for decade in 1..=DECADES as i32 {
        let r = RADIUS * f64::from(decade) / DECADES;
        let _ = writeln!(
            s,
            r##"<path d="M {} {cy} A {r} {r} 0 0 1 {} {cy}" fill="none" stroke="#ddd"/><text x="{}" y="{}" text-anchor="middle" fill="#777">1e{}</text>"##,
            cx - r,
            cx + r,
            cx + r,
            cy + 15.0,
            bottom as i32 + decade
        );
    }
    for angle in [-90_i32, -75, -60, -45, -30, -15, 0, 15, 30, 45, 60, 75, 90] {
        let a = f64::from(angle).to_radians();
        let (x, y) = (libm::sin(a), -libm::cos(a));
        let _ = writeln!(
            s,
            r##"<line x1="{cx}" y1="{cy}" x2="{:.2}" y2="{:.2}" stroke="#eee"/><text x="{:.2}" y="{:.2}" text-anchor="middle" fill="#777">{angle}°</text>"##,
            cx + RADIUS * x,
            cy + RADIUS * y,
            cx + (RADIUS + 18.0) * x,
            cy + (RADIUS + 14.0) * y + if angle.abs() == 90 { -4.0 } else { 4.0 }
        );
    }
    for (i, curve) in curves.iter().enumerate() {
        let colour = COLOURS[curve.colour % COLOURS.len()];
        let points: Vec<String> = curve
            .points
            .iter()
            .map(|&(angle, value)| {
                let (x, y) = at(angle, value);
                format!("{x:.2},{y:.2}")
            })
            .collect();
        let y = 412.0 + 18.0 * i as f64;
        let dashes = escaped(&curve.dashes);
        let _ = writeln!(
            s,
            r##"<polyline fill="none" stroke="{colour}" stroke-width="1.5" stroke-dasharray="{dashes}" points="{}"/><line x1="40" y1="{}" x2="76" y2="{}" stroke="{colour}" stroke-width="2" stroke-dasharray="{dashes}"/><text x="84" y="{y}">{}</text>"##,
            points.join(" "),
            y - 4.0,
            y - 4.0,
            escaped(&curve.label)
        );
    }
    s.push_str("</svg>\n");
    s
}
