use std::ops::Range;

use glam::{DMat2, DVec2, DVec3};

use super::tile::{Corners, MAX_EDGE, Tile, each_inside};
use crate::base::limits;

/// A rectangle of map coordinates, m: smallest and largest.
pub(in crate::site) type Region = [DVec2; 2];

/// How a raster lies on the map: the height of column c and row r stands at
/// `origin + axes * (c, r)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::site) struct Layout {
    pub origin: DVec2,
    pub axes: DMat2,
    pub columns: usize,
    pub rows: usize,
}

impl Layout {
    /// The columns and rows that a region needs, with one more on each side.
    pub fn window(&self, region: Option<Region>) -> Result<[Range<usize>; 2], String> {
        let determinant = self.axes.determinant();
        if !determinant.is_normal() || !self.origin.is_finite() {
            return Err("its cells have no size".to_owned());
        }
        let mut window = [0..self.columns, 0..self.rows];
        if let Some([min, max]) = region {
            let back = self.axes.inverse();
            let corners = [min, max, DVec2::new(min.x, max.y), DVec2::new(max.x, min.y)];
            let corners = corners.map(|c| back * (c - self.origin));
            let low = corners.iter().copied().fold(DVec2::INFINITY, DVec2::min);
            let high = corners.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
            for (k, range) in window.iter_mut().enumerate() {
                // Casts saturate.
                let from = (low[k].floor() - 1.0).max(0.0) as usize;
                let to = (high[k].ceil() + 2.0).max(0.0) as usize;
                *range = from.min(range.end)..to.min(range.end);
            }
        }
        let cells = window[0].len() as u64 * window[1].len() as u64;
        if cells > limits::MAX_GRID_CELLS as u64 {
            return Err(format!(
                "{cells} heights lie around the scene; {} at most: use a coarser grid",
                limits::MAX_GRID_CELLS
            ));
        }
        Ok(window)
    }

    /// The part of it in a window.
    pub fn part(&self, window: &[Range<usize>; 2]) -> Self {
        let first = DVec2::new(window[0].start as f64, window[1].start as f64);
        Self {
            origin: self.origin + self.axes * first,
            axes: self.axes,
            columns: window[0].len(),
            rows: window[1].len(),
        }
    }
}

/// Heights of a terrain.
#[derive(Debug)]
pub(in crate::site) struct Grid {
    pub layout: Layout,
    /// By row; NaN where there is none.
    pub heights: Vec<f32>,
    /// Of the whole file, before it was cut to the region.
    pub whole: [usize; 2],
    pub crs: Option<String>,
}

/// Cuts a grid into triangles that face up, three points each. A height without neighbours becomes
/// a level square of its cell's size.
pub(in crate::site) fn triangles(grid: &Grid) -> Vec<DVec3> {
    let Layout { origin, axes, columns, rows } = grid.layout;
    let mut out = Vec::new();
    if columns == 0 || rows == 0 {
        return out;
    }
    let mut emit = |corners: [(DVec2, f32); 3]| {
        let [a, b, c] = corners.map(|(at, height)| (origin + axes * at).extend(f64::from(height)));
        let up = (b - a).truncate().perp_dot((c - a).truncate()) > 0.0;
        out.extend(if up { [a, b, c] } else { [a, c, b] });
    };
    let height = |x: usize, y: usize| {
        if x < columns && y < rows { grid.heights[y * columns + x] } else { f32::NAN }
    };
    let longest = columns.max(rows).saturating_sub(1).max(1);
    let size = longest.next_power_of_two().min(MAX_EDGE);
    let mut covered = vec![false; columns * rows];
    for y0 in (0..rows.saturating_sub(1).max(1)).step_by(size) {
        for x0 in (0..columns.saturating_sub(1).max(1)).step_by(size) {
            let points = (0..(size + 1) * (size + 1))
                .map(|i| height(x0 + i % (size + 1), y0 + i / (size + 1)))
                .collect();
            let shared = [x0 > 0, x0 + size + 1 < columns, y0 > 0, y0 + size + 1 < rows];
            let tile = Tile::new(size, points, shared);
            tile.triangles(|corners: Corners| {
                each_inside(corners, |x, y, _| covered[(y0 + y) * columns + x0 + x] = true);
                emit(corners.map(|(x, y)| {
                    let at = DVec2::new((x0 + x) as f64, (y0 + y) as f64);
                    (at, height(x0 + x, y0 + y))
                }));
            });
        }
    }
    for (i, _) in covered.iter().enumerate().filter(|(_, c)| !**c) {
        let (x, y) = (i % columns, i / columns);
        let z = height(x, y);
        if z.is_finite() {
            let at = |dx: f64, dy: f64| (DVec2::new(x as f64 + dx, y as f64 + dy), z);
            let [a, b, c, d] = [at(-0.5, -0.5), at(0.5, -0.5), at(0.5, 0.5), at(-0.5, 0.5)];
            emit([a, b, c]);
            emit([a, c, d]);
        }
    }
    out
}
