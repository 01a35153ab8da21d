//! The unit disc as a square, areas kept: Shirley and Chiu 1997, "A low distortion map between
//! disk and square", Journal of Graphics Tools 2(3). The disc is the hemisphere seen along its
//! normal, so that equal areas of the square are equal projected solid angles: `pi` in all.

use std::f64::consts::{FRAC_PI_4, PI};

use super::on_circle;

/// Point of the unit disc at a point of the square `[0, 1]^2`.
#[inline]
pub(super) fn disk_from_square(square: [f64; 2]) -> [f64; 2] {
    let (a, b) = (2.0 * square[0] - 1.0, 2.0 * square[1] - 1.0);
    // Radius, and the angle in eighths of a turn.
    let (radius, eighths) = if a > -b {
        if a > b { (a, b / a) } else { (b, 2.0 - a / b) }
    } else if a < b {
        (-a, 4.0 + b / a)
    } else if b == 0.0 {
        return [0.0, 0.0];
    } else {
        (-b, 6.0 - a / b)
    };
    let turns = eighths / 8.0;
    let (cos, sin) = on_circle(if turns < 0.0 { turns + 1.0 } else { turns });
    [radius * cos, radius * sin]
}

/// Radii and azimuths (turns) that a part of the square from `low` to `high` spans. The part is
/// the whole or lies in one quadrant, as halving gives them.
///
/// In a quadrant the radius is the larger of the distances from the middle along both axes, and
/// the azimuth grows with one of the coordinates and shrinks with the other, so that its ends lie
/// at corners.
pub(super) fn polar_range(low: [f64; 2], high: [f64; 2]) -> ([f64; 2], [f64; 2]) {
    let along = |i: usize| {
        let (a, b) = (2.0 * low[i] - 1.0, 2.0 * high[i] - 1.0);
        let near = if a < 0.0 && b > 0.0 { 0.0 } else { a.abs().min(b.abs()) };
        (near, a.abs().max(b.abs()))
    };
    let (x, y) = (along(0), along(1));
    let radii = [x.0.max(y.0), x.1.max(y.1)];
    let quadrant = match (low[0] >= 0.5, low[1] >= 0.5) {
        _ if high[0] - low[0] > 0.5 => return (radii, [0.0, 1.0]),
        (true, true) => 0.0,
        (false, true) => 0.25,
        (false, false) => 0.5,
        (true, false) => 0.75,
    };
    let mut turns = [quadrant + 0.25, quadrant];
    for corner in [low, [low[0], high[1]], [high[0], low[1]], high] {
        let [px, py] = disk_from_square(corner);
        if px == 0.0 && py == 0.0 {
            return (radii, [quadrant, quadrant + 0.25]);
        }
        let at = libm::atan2(py, px) / (2.0 * PI);
        // The azimuth nearest to the quadrant's middle: -0 and 1 are the same.
        let at = at + libm::round(quadrant + 0.125 - at);
        turns = [turns[0].min(at), turns[1].max(at)];
    }
    (radii, [turns[0] - 1e-12, turns[1] + 1e-12])
}

/// A box of the square that holds all points with these radii and azimuths (turns).
///
/// Within a quarter turn around an axis one coordinate is the radius and the other the radius times
/// the angle: both are largest and smallest at corners.
pub(super) fn square_span(radii: [f64; 2], turns: [f64; 2]) -> ([f64; 2], [f64; 2]) {
    let far = 0.5 * radii[1];
    if turns[1] - turns[0] >= 1.0 {
        return ([0.5 - far; 2], [0.5 + far; 2]);
    }
    let (mut low, mut high) = ([1.0_f64; 2], [0.0_f64; 2]);
    let mut hold = |turns: f64| {
        // Towards the ends of a radius: the middle's azimuth is any.
        let eighths = 8.0 * (turns - libm::floor(turns));
        for radius in radii {
            let [a, b] = match eighths {
                e if e < 1.0 => [radius, e * radius],
                e if e < 3.0 => [(2.0 - e) * radius, radius],
                e if e < 5.0 => [-radius, (4.0 - e) * radius],
                e if e < 7.0 => [(e - 6.0) * radius, -radius],
                e => [radius, (e - 8.0) * radius],
            };
            for (i, x) in [a, b].into_iter().enumerate() {
                low[i] = low[i].min(0.5 * (x + 1.0));
                high[i] = high[i].max(0.5 * (x + 1.0));
            }
        }
    };
    hold(turns[0]);
    hold(turns[1]);
    // The diagonals, where the coordinates change their parts.
    let mut diagonal = libm::ceil(4.0 * turns[0] - 0.5) + 0.5;
    while diagonal < 4.0 * turns[1] {
        hold(0.25 * diagonal);
        diagonal += 1.0;
    }
    (low, high)
}

/// Point of the square at a point of the unit disc.
#[inline]
pub(super) fn square_from_disk(disk: [f64; 2]) -> [f64; 2] {
    let [x, y] = disk;
    let radius = (x * x + y * y).sqrt();
    let mut angle = libm::atan2(y, x);
    if angle < -FRAC_PI_4 {
        angle += 2.0 * PI;
    }
    let (a, b) = if angle < FRAC_PI_4 {
        (radius, angle * radius / FRAC_PI_4)
    } else if angle < 3.0 * FRAC_PI_4 {
        (-(angle - PI / 2.0) * radius / FRAC_PI_4, radius)
    } else if angle < 5.0 * FRAC_PI_4 {
        (-radius, -(angle - PI) * radius / FRAC_PI_4)
    } else {
        ((angle - 1.5 * PI) * radius / FRAC_PI_4, -radius)
    };
    [((a + 1.0) * 0.5).clamp(0.0, 1.0), ((b + 1.0) * 0.5).clamp(0.0, 1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_and_back_is_the_same_point() {
        for i in 0..=64 {
            for j in 0..=64 {
                let square = [f64::from(i) / 64.0, f64::from(j) / 64.0];
                let disk = disk_from_square(square);
                assert!(disk[0].hypot(disk[1]) <= 1.0 + 1e-12);
                let back = square_from_disk(disk);
                for k in 0..2 {
                    assert!((back[k] - square[k]).abs() < 1e-12, "{square:?} {back:?}");
                }
            }
        }
        for i in 0..85 {
            // The squares of the first levels.
            let level = [0, 1, 5, 21].iter().rposition(|&first| i >= first).unwrap_or(0);
            let (wide, n) = (1 << level, i - [0, 1, 5, 21][level]);
            let edge = 1.0 / f64::from(wide);
            let low = [f64::from(n % wide) * edge, f64::from(n / wide) * edge];
            let (radii, turns) = polar_range(low, low.map(|c| c + edge));
            for j in 0..400 {
                let at = [f64::from(j % 20) / 19.0, f64::from(j / 20) / 19.0];
                let p = disk_from_square([low[0] + at[0] * edge, low[1] + at[1] * edge]);
                let radius = p[0].hypot(p[1]);
                assert!(radius >= radii[0] - 1e-9 && radius <= radii[1] + 1e-9);
                let turn = libm::atan2(p[1], p[0]) / (2.0 * PI);
                let off = turn - turns[0] - libm::floor(turn - turns[0] + 1e-9);
                let wide = turns[1] - turns[0];
                assert!(radius < 1e-9 || off <= wide + 1e-9, "{low:?} level {level}: {p:?}");
            }
        }
        assert_eq!(square_from_disk([1.0, 0.0]), [1.0, 0.5]);
        assert_eq!(square_from_disk([0.0, 0.0]), [0.5, 0.5]);
    }
}
