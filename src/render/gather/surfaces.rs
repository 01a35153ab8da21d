//! Where a surface ends: which part of the disc around a pixel can hold photons at all.
//!
//! Around a pixel the photons of one surface are spread over a disc. At a roof's edge or at the
//! foot of a wall part of that disc is air, or ground inside a house, or ground behind a garden
//! wall: no photon that belongs to the pixel can lie there. [`Surfaces`] finds the triangles of a
//! neighbourhood; a [`Mask`] is a raster in the tangent plane that knows which cells are whole
//! pieces of the same surface and hang together without crossing a wall.

use glam::{Vec2, Vec3, vec2};

use super::estimator::Kernel;
use crate::base::{Aabb, Frame};
use crate::render::view::order::code;
use crate::site::Site;

/// Triangles in a leaf of the tree.
const LEAF: usize = 8;
/// Walls are looked for this far above the surface, m: above kerbs that are drawn twice and
/// rounding, below anything that stands there.
const WALL_LEVEL_M: f32 = 0.05;
/// Cosine of the tilt against the surface from which a triangle that rises is a wall (30 degrees):
/// terrain bends less.
const WALL_COS: f32 = 0.866;
/// Seams between triangles are closed by this share of a cell.
const SEAM: f32 = 1e-2;

/// The triangles of a scene, found by place: a binary tree of boxes over their Morton order.
pub struct Surfaces<'a> {
    site: &'a Site,
    order: Vec<u32>,
    /// Node i has the children 2i and 2i + 1; the root is 1.
    boxes: Vec<Aabb>,
    leaves: usize,
}

impl<'a> Surfaces<'a> {
    /// Builds the tree, n log n.
    pub fn of(site: &'a Site) -> Self {
        let bound = |t: u32| Aabb::around(site.triangles[t as usize].corners);
        let mut keyed: Vec<(u64, u32)> = (0..site.triangles.len() as u32)
            .map(|t| (code(&site.bounds, bound(t).center()), t))
            .collect();
        keyed.sort_unstable();
        let order: Vec<u32> = keyed.into_iter().map(|(_, t)| t).collect();
        let leaves = order.len().div_ceil(LEAF).next_power_of_two();
        let mut boxes = vec![Aabb::EMPTY; 2 * leaves];
        for (leaf, triangles) in order.chunks(LEAF).enumerate() {
            boxes[leaves + leaf] =
                triangles.iter().fold(Aabb::EMPTY, |all, &t| all.union(bound(t)));
        }
        for node in (1..leaves).rev() {
            boxes[node] = boxes[2 * node].union(boxes[2 * node + 1]);
        }
        Self { site, order, boxes, leaves }
    }

    /// Calls `each` for the triangles whose leaf touches `region`.
    fn near(&self, region: Aabb, mut each: impl FnMut(u32)) {
        let apart = |b: &Aabb| b.min.cmpgt(region.max).any() || b.max.cmplt(region.min).any();
        let mut stack = vec![1];
        while let Some(node) = stack.pop() {
            if apart(&self.boxes[node]) {
                continue;
            }
            if node < self.leaves {
                stack.extend([2 * node + 1, 2 * node]);
                continue;
            }
            let first = (node - self.leaves) * LEAF;
            for &t in &self.order[first.min(self.order.len())..self.order.len().min(first + LEAF)] {
                if !apart(&Aabb::around(self.site.triangles[t as usize].corners)) {
                    each(t);
                }
            }
        }
    }
}

/// The tangent plane of some pixels.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Plane {
    /// Unit normal.
    pub normal: Vec3,
    /// Distance from the origin along the normal, m.
    pub offset_m: f32,
}

impl Plane {
    /// Height of a place above the plane, m.
    pub fn height_m(&self, place: Vec3) -> f32 {
        self.normal.dot(place) - self.offset_m
    }
}

/// What is a piece of the same surface.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Tolerance {
    /// Cosine of the largest angle between two normals of one surface.
    pub normal_cos: f32,
    /// How far a piece may lie off the tangent plane, m.
    pub plane_m: f32,
}

/// A raster of the tangent plane: which cells are whole pieces of the surface, and which of them
/// hang together.
#[derive(Debug, Default)]
pub(in crate::render) struct Mask {
    u: Vec3,
    v: Vec3,
    /// Where the raster's corner lies, relative to `center`.
    low: Vec2,
    center: Vec3,
    cell_m: f32,
    columns: usize,
    rows: usize,
    /// Corners of cells that lie on the surface.
    corners: Vec<bool>,
    /// 0: no whole piece; else the number of its component.
    label: Vec<u32>,
    /// Cells of the label at work before each cell of a row.
    before: Vec<u32>,
    stack: Vec<u32>,
}

impl Mask {
    /// Draws the surface around `places` as far as `reach_m`. Returns whether it ends anywhere
    /// there; if not, the raster isn't needed.
    pub fn draw(
        &mut self,
        surfaces: &Surfaces<'_>,
        plane: Plane,
        tolerance: Tolerance,
        places: &[Vec3],
        (reach_m, cell_m): (f32, f32),
    ) -> bool {
        let frame = Frame::around(plane.normal.as_dvec3());
        (self.u, self.v) = (frame.x.as_vec3(), frame.y.as_vec3());
        self.center = Aabb::around(places.iter().copied()).center();
        let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        for &p in places {
            let at = self.flat(p);
            (low, high) = (low.min(at), high.max(at));
        }
        let margin = Vec2::splat(reach_m + cell_m);
        (self.low, self.cell_m) = (low - margin, cell_m);
        let size = (high + margin - self.low) / cell_m;
        (self.columns, self.rows) = (size.x.ceil() as usize + 1, size.y.ceil() as usize + 1);
        self.corners.clear();
        self.corners.resize((self.columns + 1) * (self.rows + 1), false);
        self.label.clear();
        self.label.resize(self.columns * self.rows, 0);
        let mut walls = false;
        let reach = Vec3::splat(reach_m + 2.0 * cell_m);
        let around = Aabb::around(places.iter().copied());
        let region = Aabb { min: around.min - reach, max: around.max + reach };
        let site = surfaces.site;
        surfaces.near(region, |t| {
            let triangle = &site.triangles[t as usize];
            let normal = triangle.normal();
            let slant = normal.dot(plane.normal).abs();
            let heights = triangle.corners.map(|c| plane.height_m(c));
            let lowest = heights[0].min(heights[1]).min(heights[2]);
            let highest = heights[0].max(heights[1]).max(heights[2]);
            if slant < WALL_COS && lowest <= WALL_LEVEL_M && highest > WALL_LEVEL_M {
                walls |= self.wall(triangle.corners, heights);
            }
            let receives = site.faces[triangle.face as usize].pv.is_none();
            let within = lowest <= tolerance.plane_m && highest >= -tolerance.plane_m;
            if receives && slant >= tolerance.normal_cos && within {
                self.cover(triangle.corners, heights, tolerance.plane_m);
            }
        });
        if !walls && self.corners.iter().all(|&on| on) {
            return false;
        }
        self.connect();
        true
    }

    fn flat(&self, place: Vec3) -> Vec2 {
        let p = place - self.center;
        vec2(p.dot(self.u), p.dot(self.v))
    }

    /// Place in cells from the raster's corner.
    fn cells(&self, place: Vec3) -> Vec2 {
        (self.flat(place) - self.low) / self.cell_m
    }

    fn cell(&self, place: Vec3) -> Option<usize> {
        let at = self.cells(place);
        // `as` saturates: what lies before the raster is sorted out first.
        let inside = at.x >= 0.0 && at.y >= 0.0;
        let (column, row) = (at.x as usize, at.y as usize);
        (inside && column < self.columns && row < self.rows).then(|| row * self.columns + column)
    }

    /// Marks the corners of cells that lie on a triangle.
    fn cover(&mut self, corners: [Vec3; 3], heights: [f32; 3], most_m: f32) {
        let p = corners.map(|c| self.cells(c));
        let flat = heights.iter().all(|h| h.abs() <= most_m);
        let (e, f) = (p[1] - p[0], p[2] - p[0]);
        let area = e.perp_dot(f);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let low = p[0].y.min(p[1].y).min(p[2].y) - SEAM;
        let high = p[0].y.max(p[1].y).max(p[2].y) + SEAM;
        let first = low.ceil().max(0.0) as usize;
        let last = (high.floor().max(-1.0) + 1.0) as usize;
        for row in first..last.min(self.rows + 1) {
            let y = row as f32;
            let (mut from, mut to) = (f32::INFINITY, f32::NEG_INFINITY);
            for i in 0..3 {
                let (a, b) = (p[i], p[(i + 1) % 3]);
                let (below, above) = if a.y <= b.y { (a, b) } else { (b, a) };
                if y < below.y - SEAM || y > above.y + SEAM {
                    continue;
                }
                let rise = above.y - below.y;
                if rise <= SEAM {
                    (from, to) = (from.min(a.x.min(b.x)), to.max(a.x.max(b.x)));
                    continue;
                }
                let along = ((y - below.y) / rise).clamp(0.0, 1.0);
                let x = below.x + (above.x - below.x) * along;
                (from, to) = (from.min(x), to.max(x));
            }
            let start = (from - SEAM).ceil().max(0.0);
            let end = (to + SEAM).floor().min(self.columns as f32);
            if start > end {
                continue;
            }
            let line = row * (self.columns + 1);
            for column in start as usize..=end as usize {
                let q = vec2(column as f32, y) - p[0];
                let (s, t) = (q.perp_dot(f) / area, e.perp_dot(q) / area);
                let height =
                    heights[0] + s * (heights[1] - heights[0]) + t * (heights[2] - heights[0]);
                if flat || height.abs() <= most_m {
                    self.corners[line + column] = true;
                }
            }
        }
    }

    /// Marks the cells through which a wall goes. Returns whether there are any.
    fn wall(&mut self, corners: [Vec3; 3], heights: [f32; 3]) -> bool {
        let mut ends = [Vec2::ZERO; 2];
        let mut count = 0;
        for i in 0..3 {
            let (h, k) = (heights[i] - WALL_LEVEL_M, heights[(i + 1) % 3] - WALL_LEVEL_M);
            if (h > 0.0) != (k > 0.0) && count < 2 {
                let place = corners[i] + (corners[(i + 1) % 3] - corners[i]) * (h / (h - k));
                ends[count] = self.cells(place);
                count += 1;
            }
        }
        let (from, to) = (ends[0], ends[1]);
        if count < 2 || !from.is_finite() || !to.is_finite() {
            return false;
        }
        // Only what lies in the raster is walked along: Liang and Barsky.
        let way = to - from;
        let (mut enter, mut leave) = (0.0f32, 1.0f32);
        for (start, step, most) in
            [(from.x, way.x, self.columns as f32), (from.y, way.y, self.rows as f32)]
        {
            for (gap, slope) in [(start, -step), (most - start, step)] {
                if slope == 0.0 {
                    if gap < 0.0 {
                        return false;
                    }
                } else if slope < 0.0 {
                    enter = enter.max(gap / slope);
                } else {
                    leave = leave.min(gap / slope);
                }
            }
        }
        if enter > leave {
            return false;
        }
        // Steps of a quarter of a cell: cells that follow each other touch at least at a corner,
        // and components are joined over edges only, so nothing slips through.
        let steps = (way.length() * (leave - enter) * 4.0).ceil().max(1.0);
        let mut any = false;
        for i in 0..=steps as usize {
            let at = from + way * (enter + (leave - enter) * (i as f32 / steps));
            let (column, row) = (at.x.max(0.0) as usize, at.y.max(0.0) as usize);
            if column < self.columns && row < self.rows {
                self.label[row * self.columns + column] = u32::MAX;
                any = true;
            }
        }
        any
    }

    /// Numbers the components of whole cells.
    fn connect(&mut self) {
        let (columns, rows) = (self.columns, self.rows);
        for row in 0..rows {
            for column in 0..columns {
                let c = row * (columns + 1) + column;
                let whole = self.corners[c]
                    && self.corners[c + 1]
                    && self.corners[c + columns + 1]
                    && self.corners[c + columns + 2];
                let label = &mut self.label[row * columns + column];
                // u32::MAX - 1: whole, without a number yet.
                *label = if whole && *label == 0 { u32::MAX - 1 } else { 0 };
            }
        }
        let mut number = 0;
        for start in 0..columns * rows {
            if self.label[start] != u32::MAX - 1 {
                continue;
            }
            number += 1;
            self.label[start] = number;
            self.stack.push(start as u32);
            while let Some(at) = self.stack.pop() {
                let at = at as usize;
                let (row, column) = (at / columns, at % columns);
                let beside = [
                    (column > 0).then(|| at - 1),
                    (column + 1 < columns).then_some(at + 1),
                    (row > 0).then(|| at - columns),
                    (row + 1 < rows).then_some(at + columns),
                ];
                for next in beside.into_iter().flatten() {
                    if self.label[next] == u32::MAX - 1 {
                        self.label[next] = number;
                        self.stack.push(next as u32);
                    }
                }
            }
        }
    }

    /// The component of a pixel: that of its cell or of a cell at most two away; `None` on slivers
    /// that hold no whole cell.
    pub fn component(&self, place: Vec3) -> Option<u32> {
        let at = self.cells(place);
        let (column, row) = (at.x.floor() as i64, at.y.floor() as i64);
        let mut best: Option<(f32, u32)> = None;
        for y in row - 2..=row + 2 {
            for x in column - 2..=column + 2 {
                if x < 0 || y < 0 || x >= self.columns as i64 || y >= self.rows as i64 {
                    continue;
                }
                let label = self.label[y as usize * self.columns + x as usize];
                let away = (vec2(x as f32 + 0.5, y as f32 + 0.5) - at).length_squared();
                if label != 0 && best.is_none_or(|(nearest, _)| away < nearest) {
                    best = Some((away, label));
                }
            }
        }
        best.map(|(_, label)| label)
    }

    /// Whether a place lies in a component.
    pub fn holds(&self, component: u32, place: Vec3) -> bool {
        self.cell(place).is_some_and(|cell| self.label[cell] == component)
    }

    /// Makes [`share`](Self::share) ready for a component.
    pub fn measure(&mut self, component: u32) {
        self.before.clear();
        self.before.reserve((self.columns + 1) * self.rows);
        for row in self.label.chunks_exact(self.columns) {
            let mut sum = 0;
            self.before.push(0);
            for &label in row {
                sum += u32::from(label == component);
                self.before.push(sum);
            }
        }
    }

    /// The share of a disc that belongs to the measured component: cells of it among all cells
    /// whose centres lie in the disc, weighted as the kernel weighs photons.
    pub fn share(&self, place: Vec3, radius_m: f32, kernel: Kernel) -> f64 {
        let at = self.cells(place) - Vec2::splat(0.5);
        let radius = radius_m / self.cell_m;
        let (mut inside, mut all) = (0u32, 0u32);
        let (mut heavy_inside, mut heavy_all) = (0.0f64, 0.0f64);
        let first = (at.y - radius).ceil().max(0.0) as usize;
        let last = ((at.y + radius).floor().max(-1.0) + 1.0) as usize;
        for row in first..last.min(self.rows) {
            let dy = row as f32 - at.y;
            let half = (radius * radius - dy * dy).max(0.0).sqrt();
            let from = (at.x - half).ceil().max(0.0) as usize;
            let to = ((at.x + half).floor().max(-1.0) + 1.0) as usize;
            let to = to.min(self.columns);
            if from >= to {
                continue;
            }
            let line = &self.before[row * (self.columns + 1)..][..=self.columns];
            inside += line[to] - line[from];
            all += (to - from) as u32;
            if kernel == Kernel::Epanechnikov {
                for column in from..to {
                    let dx = column as f32 - at.x;
                    let weight = f64::from(1.0 - (dx * dx + dy * dy) / (radius * radius));
                    heavy_all += weight;
                    heavy_inside += weight * f64::from(line[column + 1] - line[column]);
                }
            }
        }
        if inside == all {
            return 1.0;
        }
        match kernel {
            Kernel::Flat => f64::from(inside) / f64::from(all),
            Kernel::Epanechnikov => heavy_inside / heavy_all.max(1e-9),
        }
    }
}
