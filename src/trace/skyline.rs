use glam::DVec3;

use super::clip::Polygon;
use crate::site::Triangle;

/// Columns that a triangle may be cut into before the columns are made larger.
const MOST_CUTS: f64 = 3e7;

/// How high the scene is, column by column: the highest point of anything above a plane, over a
/// square map, and the same over ever larger squares (a pyramid of maxima).
///
/// What is seen from below the top of a column is hidden or not by that column's highest point
/// alone: for a given horizontal distance the elevation grows with the height. So this is all that
/// a horizon needs.
#[derive(Debug)]
pub(super) struct Skyline {
    /// Lower left corner of the map, m.
    corner: [f64; 2],
    /// Edge of the smallest column, m.
    edge_m: f64,
    /// Tops by level, row-major; level 0 has the smallest columns, the last a single one. Minus
    /// infinity where nothing is.
    levels: Vec<Vec<f32>>,
}

/// A square of the map.
#[derive(Clone, Copy, Debug)]
pub(super) struct Column {
    pub level: usize,
    pub x: usize,
    pub y: usize,
}

impl Skyline {
    /// Rasterises what lies above the plane `normal . p = floor_m` in the map from `low` to
    /// `high`. `depth`: the map is `2^depth` columns wide. Everything is taken `margin_m` larger
    /// than it is.
    pub(super) fn build(
        triangles: &[Triangle],
        (normal, floor_m): (DVec3, f64),
        (low, high): ([f64; 2], [f64; 2]),
        depth: u32,
        margin_m: f64,
    ) -> Self {
        let extent = (high[0] - low[0]).max(high[1] - low[1]).max(1e-3);
        let mut shapes = Vec::new();
        let mut square_m2 = 0.0;
        for triangle in triangles {
            let corners = triangle.corners.map(|c| c.as_dvec3());
            let outside = |axis: usize| {
                corners.iter().all(|c| c[axis] < low[axis] - margin_m)
                    || corners.iter().all(|c| c[axis] > high[axis] + margin_m)
            };
            if outside(0) || outside(1) || corners.iter().all(|c| normal.dot(*c) <= floor_m) {
                continue;
            }
            let shape = Polygon::triangle(corners).above(normal, floor_m);
            if !shape.is_empty() {
                let (a, b) = shape.bounds();
                let wide = b.x.min(high[0]) - a.x.max(low[0]);
                let deep = b.y.min(high[1]) - a.y.max(low[1]);
                square_m2 += wide.max(0.0) * deep.max(0.0);
                shapes.push(shape);
            }
        }
        let mut depth = depth;
        let edge = |depth: u32| extent / f64::from(1_u32 << depth);
        while depth > 4 && square_m2 / (edge(depth) * edge(depth)) > MOST_CUTS {
            depth -= 1;
        }
        let mut out = Self { corner: low, edge_m: edge(depth), levels: Vec::new() };
        let wide = 1_usize << depth;
        let mut tops = vec![f32::NEG_INFINITY; wide * wide];
        for shape in &shapes {
            out.rasterise(shape, &mut tops, wide, margin_m);
        }
        out.levels.push(tops);
        let mut wide = wide;
        while wide > 1 {
            let below = &out.levels[out.levels.len() - 1];
            wide /= 2;
            let level = (0..wide * wide)
                .map(|i| {
                    let at = (i / wide) * 4 * wide + (i % wide) * 2;
                    below[at]
                        .max(below[at + 1])
                        .max(below[at + 2 * wide])
                        .max(below[at + 2 * wide + 1])
                })
                .collect();
            out.levels.push(level);
        }
        out
    }

    fn rasterise(&self, shape: &Polygon, tops: &mut [f32], wide: usize, margin_m: f64) {
        let last = wide as f64 - 1.0;
        let index = |at: f64, axis: usize| {
            ((at - self.corner[axis]) / self.edge_m).floor().clamp(0.0, last) as usize
        };
        let line = |i: usize, axis: usize| self.corner[axis] + i as f64 * self.edge_m;
        let (low, high) = shape.bounds();
        for x in index(low.x - margin_m, 0)..=index(high.x + margin_m, 0) {
            let slab = shape.between(DVec3::X, line(x, 0) - margin_m, line(x + 1, 0) + margin_m);
            if slab.is_empty() {
                continue;
            }
            let (low, high) = slab.bounds();
            for y in index(low.y - margin_m, 1)..=index(high.y + margin_m, 1) {
                let part = slab.between(DVec3::Y, line(y, 1) - margin_m, line(y + 1, 1) + margin_m);
                if part.is_empty() {
                    continue;
                }
                let top = ((part.bounds().1.z + margin_m) as f32).next_up();
                let slot = &mut tops[y * wide + x];
                *slot = slot.max(top);
            }
        }
    }

    /// The column that is the whole map.
    pub(super) fn whole(&self) -> Column {
        Column { level: self.levels.len() - 1, x: 0, y: 0 }
    }

    /// The four columns of the next finer level, if there is one.
    pub(super) fn parts(&self, column: Column) -> Option<[Column; 4]> {
        let level = column.level.checked_sub(1)?;
        let part = |x, y| Column { level, x: column.x * 2 + x, y: column.y * 2 + y };
        Some([part(0, 0), part(1, 0), part(0, 1), part(1, 1)])
    }

    /// The highest point in a column, m; minus infinity if nothing is there.
    pub(super) fn top_m(&self, column: Column) -> f64 {
        let wide = 1 << (self.levels.len() - 1 - column.level);
        f64::from(self.levels[column.level][column.y * wide + column.x])
    }

    /// A column's square on the map: smallest and largest corner, m.
    pub(super) fn square_m(&self, column: Column) -> ([f64; 2], [f64; 2]) {
        let edge = self.edge_m * (1_u32 << column.level) as f64;
        let at = |axis: usize, i: usize| self.corner[axis] + i as f64 * edge;
        ([at(0, column.x), at(1, column.y)], [at(0, column.x + 1), at(1, column.y + 1)])
    }
}
