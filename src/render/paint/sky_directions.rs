use std::f64::consts::PI;

use glam::DVec3;

/// Directions over the hemisphere about z, cosine weighted: a spiral of equal areas on the disc,
/// lifted.
pub(super) fn directions(count: usize) -> impl Iterator<Item = DVec3> {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    (0..count).map(move |i| {
        let r2 = (i as f64 + 0.5) / count as f64;
        let (r, angle) = (r2.sqrt(), golden * i as f64);
        DVec3::new(r * libm::cos(angle), r * libm::sin(angle), (1.0 - r2).sqrt())
    })
}
