//! Scattered measurements as a function of both directions.

use glam::DVec3;

use super::disk::square_from_disk;
use super::gonio::Goniophotometer;

/// Points that decide about a direction.
const NEAREST: usize = 8;
/// Points closer than this share of the square's edge are taken together: some 0.2 degrees.
const THINNED: usize = 512;
/// Fraction of an incidence's largest value that stands for darkness, as logarithms need one.
const DARK: f64 = 1e-6;

/// The points of one incidence, turned so that the light comes from negative x.
struct Sheet {
    theta_deg: f64,
    from: DVec3,
    /// Buckets along the square's edge.
    edge: usize,
    /// Where each bucket's points begin.
    first: Vec<u32>,
    /// Direction and logarithm of the value.
    points: Vec<(DVec3, f64)>,
    /// Typical distance between points, a chord.
    spacing: f64,
}

/// Goniophotometer data as a function: in outgoing directions Shepard's interpolation of the
/// logarithm over the 8 nearest points (Franke and Nielson 1980); between incident angles along
/// constant half vectors, so that the lobe moves instead of fading from one place to another.
/// Beyond the measured angles the last ones count.
pub struct Interpolation {
    isotropic: bool,
    sheets: Vec<Sheet>,
    /// Incident azimuth of each sheet, degrees.
    phis: Vec<f64>,
}

/// How far the measurement reaches.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Reach {
    /// Smallest and largest incidence.
    pub incidence_deg: (f64, f64),
    /// Share of light from all directions that comes in beyond the largest.
    pub beyond: f64,
    /// For each incidence (degrees): share of the reflected light that leaves where no point is
    /// nearby.
    pub unseen: Vec<(f64, f64)>,
}

fn turned(v: DVec3, cos: f64, sin: f64) -> DVec3 {
    DVec3::new(v.x * cos - v.y * sin, v.x * sin + v.y * cos, v.z)
}

impl Sheet {
    fn new(theta_deg: f64, points: Vec<(DVec3, f32)>) -> Self {
        let theta = theta_deg.to_radians();
        let from = DVec3::new(-libm::sin(theta), 0.0, libm::cos(theta));
        let most = points.iter().fold(0.0_f64, |m, p| m.max(f64::from(p.1)));
        let dark = (most * DARK).max(1e-12);
        // Points in one small cell become their mean.
        let mut keyed: Vec<(usize, DVec3, f64)> = points
            .into_iter()
            .map(|(v, f)| {
                let [x, y] = square_from_disk([v.x, v.y]);
                let place = |x: f64| ((x * THINNED as f64) as usize).min(THINNED - 1);
                (place(x) * THINNED + place(y), v, f64::from(f))
            })
            .collect();
        keyed.sort_by_key(|k| k.0);
        let thin: Vec<(DVec3, f64)> = keyed
            .chunk_by(|a, b| a.0 == b.0)
            .map(|same| {
                let count = same.len() as f64;
                let sum = same.iter().fold(DVec3::ZERO, |s, p| s + p.1);
                let mean = same.iter().map(|p| p.2).sum::<f64>() / count;
                (sum.try_normalize().unwrap_or(DVec3::Z), libm::log(mean.max(dark)))
            })
            .collect();
        let edge = ((thin.len() / 2) as f64).sqrt().clamp(1.0, 256.0) as usize;
        let bucket = |v: DVec3| {
            let [x, y] = square_from_disk([v.x, v.y]);
            let place = |x: f64| ((x * edge as f64) as usize).min(edge - 1);
            place(x) * edge + place(y)
        };
        let mut points = thin;
        points.sort_by_key(|p| bucket(p.0));
        let mut first = vec![0_u32; edge * edge + 1];
        for p in &points {
            first[bucket(p.0) + 1] += 1;
        }
        for i in 0..edge * edge {
            first[i + 1] += first[i];
        }
        let spacing = (std::f64::consts::TAU / points.len() as f64).sqrt();
        Self { theta_deg, from, edge, first, points, spacing }
    }

    /// Logarithm of the value, and the distance (chord) to the nearest point.
    fn at(&self, to: DVec3) -> (f64, f64) {
        let edge = self.edge as i64;
        let [x, y] = square_from_disk([to.x, to.y]);
        let place = |x: f64| ((x * edge as f64) as i64).min(edge - 1);
        let (cx, cy) = (place(x), place(y));
        let mut near = [(f64::INFINITY, 0.0); NEAREST];
        let mut count = 0;
        let mut look = |bx: i64, by: i64, count: &mut usize| {
            if !(0..edge).contains(&bx) || !(0..edge).contains(&by) {
                return;
            }
            let bucket = (bx * edge + by) as usize;
            for &(v, f) in
                &self.points[self.first[bucket] as usize..self.first[bucket + 1] as usize]
            {
                *count += 1;
                let d = v.distance_squared(to);
                if d < near[NEAREST - 1].0 {
                    let at = near.partition_point(|n| n.0 <= d);
                    near[at..].rotate_right(1);
                    near[at] = (d, f);
                }
            }
        };
        let mut after = 0;
        for ring in 0..=edge {
            if ring == 0 {
                look(cx, cy, &mut count);
            } else {
                for i in -ring..=ring {
                    look(cx + i, cy - ring, &mut count);
                    look(cx + i, cy + ring, &mut count);
                }
                for i in 1 - ring..ring {
                    look(cx - ring, cy + i, &mut count);
                    look(cx + ring, cy + i, &mut count);
                }
            }
            // One ring more, as the nearest may lie across a border.
            after += usize::from(count >= NEAREST);
            if after == 2 {
                break;
            }
        }
        let found = &near[..near.iter().take_while(|n| n.0.is_finite()).count()];
        let Some(&(closest, value)) = found.first() else { return (f64::NEG_INFINITY, 2.0) };
        if closest < 1e-16 {
            return (value, 0.0);
        }
        let radius = 1.05 * found[found.len() - 1].0.sqrt();
        let (mut sum, mut weights) = (0.0, 0.0);
        for &(d, f) in found {
            let d = d.sqrt();
            let w = ((radius - d) / (radius * d)).powi(2);
            sum += w * f;
            weights += w;
        }
        (if weights > 0.0 { sum / weights } else { value }, closest.sqrt())
    }

    /// The value where the half vector is `half`, or at `to` where that lies below.
    fn along(&self, half: DVec3, to: DVec3) -> f64 {
        let out = half * (2.0 * self.from.dot(half)) - self.from;
        self.at(if out.z > 0.02 { out } else { to }).0
    }
}

impl Interpolation {
    /// The points joined to a function.
    pub fn of(data: &Goniophotometer) -> Self {
        let isotropic = data.is_isotropic();
        let mut phis = Vec::new();
        let sheets = data
            .incidents
            .iter()
            .map(|i| {
                // The light comes from azimuth 180.
                let angle = (180.0 - i.phi_deg).to_radians();
                let (cos, sin) = (libm::cos(angle), libm::sin(angle));
                let mut points: Vec<_> =
                    i.points.iter().map(|&(v, f)| (turned(v, cos, sin), f)).collect();
                if isotropic {
                    // The two sides of the plane of incidence are alike.
                    let count = points.len();
                    for n in 0..count {
                        let (v, f) = points[n];
                        if v.y.abs() > 1e-6 {
                            points.push((DVec3::new(v.x, -v.y, v.z), f));
                        }
                    }
                }
                phis.push(i.phi_deg);
                Sheet::new(i.theta_deg, points)
            })
            .collect();
        Self { isotropic, sheets, phis }
    }

    /// 1/sr; light comes from `from`. Both point away from the surface.
    pub fn value(&self, from: DVec3, to: DVec3) -> f64 {
        let sin = (from.x * from.x + from.y * from.y).sqrt();
        let theta_deg = libm::atan2(sin, from.z).to_degrees();
        // Turned so that the light comes from negative x.
        let (cos, turn) = if sin > 1e-9 { (-from.x / sin, from.y / sin) } else { (1.0, 0.0) };
        let (from, to) = (turned(from, cos, turn), turned(to, cos, turn));
        let half = (from + to).try_normalize().unwrap_or(DVec3::Z);
        if self.isotropic {
            let sheets: Vec<&Sheet> = self.sheets.iter().collect();
            return between(&sheets, theta_deg, half, to);
        }
        // The two measured azimuths on either side; light from the normal has none.
        let phi_deg = libm::atan2(-turn, -cos).to_degrees().rem_euclid(360.0);
        let mut azimuths: Vec<f64> = Vec::new();
        for (sheet, &phi) in self.sheets.iter().zip(&self.phis) {
            if sheet.theta_deg > 0.01 && !azimuths.contains(&phi) {
                azimuths.push(phi);
            }
        }
        let ahead = |phi: f64| (phi - phi_deg).rem_euclid(360.0);
        let next = azimuths.iter().copied().min_by(|a, b| ahead(*a).total_cmp(&ahead(*b)));
        let last = azimuths.iter().copied().max_by(|a, b| ahead(*a).total_cmp(&ahead(*b)));
        let (Some(next), Some(last)) = (next, last) else { return 0.0 };
        let at = |phi: f64| {
            let sheets: Vec<&Sheet> = self
                .sheets
                .iter()
                .zip(&self.phis)
                .filter(|(s, p)| **p == phi || s.theta_deg <= 0.01)
                .map(|(s, _)| s)
                .collect();
            between(&sheets, theta_deg, half, to)
        };
        let (up, down) = (ahead(next), (phi_deg - last).rem_euclid(360.0));
        if up + down < 1e-9 {
            return at(next);
        }
        (at(next) * down + at(last) * up) / (up + down)
    }

    /// What was measured, and what wasn't.
    pub fn reach(&self) -> Reach {
        let angles = || self.sheets.iter().map(|s| s.theta_deg);
        let (low, high) = (angles().fold(90.0, f64::min), angles().fold(0.0, f64::max));
        let cos = libm::cos(high.to_radians());
        let unseen = self.sheets.iter().map(|s| (s.theta_deg, s.unseen())).collect();
        Reach { incidence_deg: (low, high), beyond: cos * cos, unseen }
    }
}

impl Sheet {
    fn unseen(&self) -> f64 {
        const EDGE: u32 = 64;
        let (mut all, mut far) = (0.0, 0.0);
        let limit = (2.0 * self.spacing).max(0.05);
        for i in 0..EDGE * EDGE {
            let (u, v) = (
                (f64::from(i / EDGE) + 0.5) / f64::from(EDGE),
                (f64::from(i % EDGE) + 0.5) / f64::from(EDGE),
            );
            let (value, distance) = self.at(super::on_hemisphere(u, v));
            let value = libm::exp(value);
            all += value;
            far += if distance > limit { value } else { 0.0 };
        }
        if all > 0.0 { far / all } else { 0.0 }
    }
}

/// Between the sheets on either side of a polar angle; they are sorted by it.
fn between(sheets: &[&Sheet], theta_deg: f64, half: DVec3, to: DVec3) -> f64 {
    let after = sheets.partition_point(|s| s.theta_deg <= theta_deg);
    let one = |sheet: &Sheet| libm::exp(sheet.along(half, to));
    match (after.checked_sub(1).and_then(|i| sheets.get(i)), sheets.get(after)) {
        (Some(low), Some(high)) => {
            let part = (theta_deg - low.theta_deg) / (high.theta_deg - low.theta_deg);
            libm::exp(low.along(half, to) * (1.0 - part) + high.along(half, to) * part)
        }
        (Some(only), None) | (None, Some(only)) => one(only),
        (None, None) => 0.0,
    }
}
