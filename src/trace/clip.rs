use glam::DVec3;

/// A convex polygon on the stack: a triangle cut by up to five planes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Polygon {
    points: [DVec3; Polygon::MOST],
    count: usize,
}

impl Polygon {
    /// A triangle gains at most one corner with each cut.
    const MOST: usize = 9;

    pub(super) fn triangle(corners: [DVec3; 3]) -> Self {
        let mut points = [DVec3::ZERO; Self::MOST];
        points[..3].copy_from_slice(&corners);
        Self { points, count: 3 }
    }

    pub(super) fn points(&self) -> &[DVec3] {
        &self.points[..self.count]
    }

    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The part where `axis . p >= offset` (Sutherland and Hodgman 1974).
    pub(super) fn above(&self, axis: DVec3, offset: f64) -> Self {
        let mut out = Self { points: [DVec3::ZERO; Self::MOST], count: 0 };
        let mut push = |p: DVec3| {
            if out.count < Self::MOST {
                out.points[out.count] = p;
                out.count += 1;
            }
        };
        for (i, &p) in self.points().iter().enumerate() {
            let q = self.points[(i + 1) % self.count];
            let (at_p, at_q) = (axis.dot(p) - offset, axis.dot(q) - offset);
            if at_p >= 0.0 {
                push(p);
            }
            if (at_p >= 0.0) != (at_q >= 0.0) {
                push(p.lerp(q, at_p / (at_p - at_q)));
            }
        }
        out
    }

    /// The part between two planes across one axis.
    pub(super) fn between(&self, axis: DVec3, low: f64, high: f64) -> Self {
        self.above(axis, low).above(-axis, -high)
    }

    /// Smallest and largest corner of the box around it.
    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        self.points()
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), &p| (a.min(p), b.max(p)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(p: &Polygon) -> f64 {
        let points = p.points();
        (1..points.len().saturating_sub(1))
            .map(|i| (points[i] - points[0]).cross(points[i + 1] - points[0]).length() * 0.5)
            .sum()
    }

    #[test]
    fn columns_of_a_triangle_sum_to_its_area() {
        let whole = Polygon::triangle([
            DVec3::new(0.1, 0.2, 3.0),
            DVec3::new(9.3, 1.7, -2.0),
            DVec3::new(4.0, 7.9, 5.0),
        ]);
        let mut sum = 0.0;
        for i in 0..10 {
            let slab = whole.between(DVec3::X, f64::from(i), f64::from(i + 1));
            for j in 0..10 {
                sum += area(&slab.between(DVec3::Y, f64::from(j), f64::from(j + 1)));
            }
        }
        assert!((sum - area(&whole)).abs() < 1e-9);
        assert!(whole.above(DVec3::Z, 5.1).is_empty());
    }
}
