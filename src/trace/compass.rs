/// Directions of the compass that are told apart.
pub(super) const BINS: usize = 512;

/// A number that grows with the azimuth, from 0 (x axis) over 1 (y axis) to 4, without
/// trigonometry.
#[inline]
pub(super) fn compass(x: f64, y: f64) -> f64 {
    let turn = if x.abs() + y.abs() > 0.0 { y / (x.abs() + y.abs()) } else { 0.0 };
    if x < 0.0 {
        2.0 - turn
    } else if turn < 0.0 {
        4.0 + turn
    } else {
        turn
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_compass_grows_all_the_way_round() {
        let mut last = -1.0;
        for i in 0..3600 {
            let angle = (f64::from(i) * 0.1).to_radians();
            let now = compass(libm::cos(angle), libm::sin(angle));
            assert!(now > last && (0.0..4.0).contains(&now), "at {}: {now}", f64::from(i) * 0.1);
            last = now;
        }
        for (x, y, at) in [(1.0, 0.0, 0.0), (0.0, 2.0, 1.0), (-1.0, 0.0, 2.0), (0.0, -1.0, 3.0)] {
            assert_eq!(compass(x, y), at);
        }
    }
}
