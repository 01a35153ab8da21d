//! Triangulating a square of heights to a stated error, without cracks.
//!
//! The mesh follows a hierarchy of right triangles: each is halved from its right angle to the
//! middle of its longest edge (Evans, Kirkpatrick, Townsend 2001, "Right-Triangulated Irregular
//! Networks", Algorithmica 30). A middle is a corner of the mesh where a triangle that has it is
//! off by more than the bound, measured at every height inside, or where one of its halves needs
//! it: so no crack opens.

/// Largest vertical distance between a grid's height and the triangles that stand for it, m.
pub(in crate::site) const ERROR_M: f32 = 0.1;
/// Cells along the edge of a tile, at most.
pub(super) const MAX_EDGE: usize = 256;

/// A triangle of a tile: its corners' columns and rows.
pub(super) type Corners = [(usize, usize); 3];

/// A square of heights, and how far off the mesh would be without each of them.
pub(super) struct Tile {
    /// Cells along the edge: a power of two.
    pub size: usize,
    /// Heights by row, NaN where there is none.
    pub heights: Vec<f32>,
    error: Vec<f32>,
}

impl Tile {
    /// `shared`: which borders (left, right, top, bottom) other tiles share; those keep all their
    /// points, so that both sides have the same.
    pub fn new(size: usize, heights: Vec<f32>, shared: [bool; 4]) -> Self {
        let error = vec![0.0; heights.len()];
        let mut tile = Self { size, heights, error };
        let n = size;
        for i in 0..=n {
            for (on, at) in shared.iter().zip([(0, i), (n, i), (i, 0), (i, n)]) {
                if *on {
                    let at = tile.at(at);
                    tile.error[at] = f32::INFINITY;
                }
            }
        }
        tile.measure();
        tile
    }

    fn at(&self, (x, y): (usize, usize)) -> usize {
        y * (self.size + 1) + x
    }

    /// Errors of all middles, from the smallest triangles up: the children of triangle `i` are
    /// numbered `2 i` and `2 i + 1` of the next level.
    fn measure(&mut self) {
        let n = self.size;
        let count = 2 * n * n - 2;
        for id in (2..count + 2).rev() {
            let [a, b, c] = triangle(id, n);
            let middle = ((a.0 + b.0) / 2, (a.1 + b.1) / 2);
            let mut error = self.deviation([a, b, c]);
            // Halves of the smallest have no middle of their own.
            if a.0.abs_diff(c.0) + a.1.abs_diff(c.1) > 1 {
                for (p, q) in [(a, c), (b, c)] {
                    let half = ((p.0 + q.0) / 2, (p.1 + q.1) / 2);
                    if (p.0 + q.0) % 2 == 0 && (p.1 + q.1) % 2 == 0 {
                        error = error.max(self.error[self.at(half)]);
                    }
                }
            }
            let middle = self.at(middle);
            self.error[middle] = self.error[middle].max(error);
        }
    }

    /// Largest vertical distance of the heights in a triangle from its plane; infinite where one of
    /// them is missing.
    fn deviation(&self, corners: Corners) -> f32 {
        let z = corners.map(|c| self.heights[self.at(c)]);
        if z.iter().any(|z| z.is_nan()) {
            return f32::INFINITY;
        }
        let mut most = 0.0_f32;
        each_inside(corners, |x, y, [u, v, w]| {
            let height = self.heights[self.at((x, y))];
            let off = (height - (z[0] * u + z[1] * v + z[2] * w)).abs();
            most = if off.is_nan() { f32::INFINITY } else { most.max(off) };
        });
        most
    }

    /// The triangles of the mesh; those without all their heights are left out.
    pub fn triangles(&self, mut each: impl FnMut(Corners)) {
        let n = self.size;
        let mut open = vec![[(n, n), (0, 0), (0, n)], [(0, 0), (n, n), (n, 0)]];
        while let Some([a, b, c]) = open.pop() {
            let middle = ((a.0 + b.0) / 2, (a.1 + b.1) / 2);
            let divisible = a.0.abs_diff(c.0) + a.1.abs_diff(c.1) > 1
                || (a.0.abs_diff(b.0) > 1 || a.1.abs_diff(b.1) > 1);
            if divisible && self.error[self.at(middle)] > ERROR_M {
                open.push([b, c, middle]);
                open.push([c, a, middle]);
            } else if [a, b, c].iter().all(|&p| !self.heights[self.at(p)].is_nan()) {
                each([a, b, c]);
            }
        }
    }
}

/// Corners of a triangle by its number: its binary digits after the first say which half.
fn triangle(id: usize, n: usize) -> Corners {
    let (mut a, mut b, mut c) = match id & 1 {
        1 => ((0, 0), (n, n), (n, 0)),
        _ => ((n, n), (0, 0), (0, n)),
    };
    let mut rest = id >> 1;
    while rest > 1 {
        let middle = ((a.0 + b.0) / 2, (a.1 + b.1) / 2);
        (a, b, c) = if rest & 1 == 1 { (c, a, middle) } else { (b, c, middle) };
        rest >>= 1;
    }
    [a, b, c]
}

/// Calls with each grid point in a triangle or on its border, and its shares of the corners.
pub(super) fn each_inside(corners: Corners, mut each: impl FnMut(usize, usize, [f32; 3])) {
    let [a, b, c] = corners.map(|(x, y)| (x as i64, y as i64));
    let area = (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0);
    if area == 0 {
        return;
    }
    let (x0, x1) = (a.0.min(b.0).min(c.0), a.0.max(b.0).max(c.0));
    let (y0, y1) = (a.1.min(b.1).min(c.1), a.1.max(b.1).max(c.1));
    let inverse = 1.0 / area as f32;
    for y in y0..=y1 {
        for x in x0..=x1 {
            let u = (b.0 - x) * (c.1 - y) - (b.1 - y) * (c.0 - x);
            let v = (c.0 - x) * (a.1 - y) - (c.1 - y) * (a.0 - x);
            let w = area - u - v;
            if u * area >= 0 && v * area >= 0 && w * area >= 0 {
                each(x as usize, y as usize, [u, v, w].map(|s| s as f32 * inverse));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(size: usize, shared: [bool; 4], height: impl Fn(usize, usize) -> f32) -> usize {
        let points = (0..(size + 1) * (size + 1)).map(|i| height(i % (size + 1), i / (size + 1)));
        let tile = Tile::new(size, points.collect(), shared);
        let mut covered = vec![false; tile.heights.len()];
        let (mut area, mut count) = (0, 0);
        tile.triangles(|corners| {
            count += 1;
            assert!(tile.deviation(corners) <= ERROR_M);
            each_inside(corners, |x, y, _| covered[tile.at((x, y))] = true);
            let [a, b, c] = corners.map(|(x, y)| (x as i64, y as i64));
            area += ((b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0)).unsigned_abs();
        });
        if tile.heights.iter().all(|z| z.is_finite()) {
            assert!(covered.iter().all(|&c| c));
            assert_eq!(area, 2 * (size * size) as u64);
        }
        count
    }

    #[test]
    fn the_error_is_bounded_everywhere_and_flat_ground_is_two_triangles() {
        assert_eq!(check(16, [false; 4], |x, y| x as f32 * 2.0 + y as f32), 2);
        let bumpy = |x: usize, y: usize| ((x * 37 + y * 91) % 17) as f32 * 0.05;
        assert!(check(32, [false; 4], bumpy) > 500);
        let hill = |x: usize, y: usize| {
            let (dx, dy) = (x as f32 - 20.0, y as f32 - 11.0);
            8.0 / (1.0 + 0.02 * (dx * dx + dy * dy))
        };
        let count = check(64, [false; 4], hill);
        assert!(count < 2500, "{count} of 8192");
        // A bump that no middle of a larger triangle sees.
        let spike = |x: usize, y: usize| if (x, y) == (5, 3) { 1.0 } else { 0.0 };
        assert!(check(16, [false; 4], spike) > 8);
        assert_eq!(check(1, [false; 4], |x, _| x as f32), 2);
    }

    #[test]
    fn shared_borders_keep_every_point() {
        let n = 16;
        let tile = Tile::new(n, vec![0.0; (n + 1) * (n + 1)], [false, true, false, false]);
        let mut border = std::collections::BTreeSet::new();
        tile.triangles(|c| border.extend(c.iter().filter(|p| p.0 == n).map(|p| p.1)));
        assert_eq!(border.len(), n + 1);
        check(n, [true, true, true, true], |_, _| 0.0);
    }

    #[test]
    fn missing_heights_leave_a_hole() {
        let hole = |x: usize, y: usize| if (3..6).contains(&x) && y > 8 { f32::NAN } else { 1.0 };
        assert!(check(16, [false; 4], hole) > 2);
    }
}
