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
        assert_eq!(square_from_disk([1.0, 0.0]), [1.0, 0.5]);
        assert_eq!(square_from_disk([0.0, 0.0]), [0.5, 0.5]);
    }
}
