//! The daylight background behind the maps: where is what, for a planner's eye.
//!
//! It answers no physical question, so it may be cheap: some suns that stand for the year, a simple
//! sky, the materials' colours, one reflection. Two passes: the first gathers the sky's light with
//! few rays a pixel, of which neighbouring pixels of one surface share theirs out in the second
//! ("interleaved sampling", Keller and Heidrich 2001); edges get more rays.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::palette::{self, Palette};
use super::sky_directions::directions;
use crate::base::{Frame, Grid, Progress, Timeline};
use crate::render::view::camera::{Projection, View, ViewRay};
use crate::render::view::error::Error;
use crate::render::view::hits::first_surface;
use crate::render::view::hits::{Hit, HitKind, HitMap};
use crate::render::view::pv_visibility::LIFT_M;
use crate::site::Site;

/// Sky directions of one pixel, and pixels of a square whose edge is [`SQUARE`] that share them
/// out: together they cover the sky with `SKY_RAYS * SQUARE^2` directions.
const SKY_RAYS: usize = 16;
const SQUARE: usize = 4;
/// Light of all suns on an open horizontal plane: bright, without burning white walls out.
const SUN_PART: f32 = 1.15;
/// Weight of the sky's light beside it.
const SKY_PART: f32 = 0.46;
/// Where rays go through a pixel on an edge: a rotated grid, so that upright and level edges gain
/// as much as slanted ones.
const EDGE_RAYS: [(f64, f64); 4] = [(0.375, 0.125), (0.875, 0.375), (0.625, 0.875), (0.125, 0.625)];

/// Suns that stand for a year's: the timesteps are cut, in chronological order, into `count` parts
/// of equal energy, and the middle one of each is taken with its part's energy.
pub fn representative_suns(timeline: &Timeline, count: usize) -> Vec<(DVec3, f64)> {
    let energy = |i: usize| {
        let step = &timeline.steps[i];
        step.irradiance_w_m2 * step.weight_h
    };
    let total: f64 = (0..timeline.steps.len()).map(energy).sum();
    let mut out = Vec::new();
    let mut sum = 0.0;
    for (i, step) in timeline.steps.iter().enumerate() {
        sum += energy(i);
        while out.len() < count
            && total > 0.0
            && sum >= total * (out.len() as f64 + 0.5) / count as f64
        {
            out.push((step.sun, total / count as f64));
        }
    }
    out
}

/// The scene by daylight, for orientation: the light of some suns with their shadows (directions
/// to the sun with relative weights), the light of a simple sky, the materials' colours, PV in
/// dark blue. Linear light; 1 is display white.
///
/// # Errors
/// [`Error::Interrupted`]; [`Error::Settings`] where `hits` are not those of `view`.
pub fn background(
    view: &View,
    hits: &HitMap,
    site: &Site,
    suns: &[(DVec3, f64)],
    progress: &dyn Progress,
) -> Result<Grid<[f32; 3]>, Error> {
    let (columns, rows) = (view.columns(), view.rows());
    if (hits.columns, hits.rows) != (columns, rows) {
        let what = format!(
            "the hits are {} x {} pixels, the view {columns} x {rows}",
            hits.columns, hits.rows
        );
        return Err(Error::Settings { what });
    }
    let painter = Painter {
        view,
        hits,
        site,
        suns: Suns::new(suns),
        palette: Palette::of(site),
        sky: directions(SKY_RAYS * SQUARE * SQUARE).map(|d| d.as_vec3()).collect(),
    };
    progress.begin("background", 2 * (columns * rows) as u64, "pixels");
    let each_row = |out: &mut [Vec3], row: usize, one: &(dyn Fn(usize, usize) -> Vec3 + Sync)| {
        progress.check()?;
        for (column, value) in out.iter_mut().enumerate() {
            *value = one(column, row);
        }
        progress.advance(columns as u64);
        Ok::<(), Error>(())
    };
    let mut raw = vec![Vec3::ZERO; columns * rows];
    raw.par_chunks_mut(columns)
        .enumerate()
        .try_for_each(|(row, out)| each_row(out, row, &|c, r| painter.sky_light(c, r)))?;
    let raw = Grid::from_vec(columns, rows, raw);
    let mut picture = vec![Vec3::ZERO; columns * rows];
    picture
        .par_chunks_mut(columns)
        .enumerate()
        .try_for_each(|(row, out)| each_row(out, row, &|c, r| painter.pixel(&raw, c, r)))?;
    progress.finish();
    Ok(Grid::from_vec(columns, rows, picture.into_iter().map(|v| v.to_array()).collect()))
}

struct Suns {
    /// Direction and irradiance across it; together they give an open horizontal plane 1.
    suns: Vec<(Vec3, f32)>,
}

impl Suns {
    fn new(suns: &[(DVec3, f64)]) -> Self {
        let up: Vec<(DVec3, f64)> = suns
            .iter()
            .filter(|(d, w)| d.z > 0.0 && d.is_finite() && w.is_finite() && *w > 0.0)
            .map(|&(d, w)| (d.normalize(), w))
            .collect();
        let weight: f64 = up.iter().map(|(_, w)| w).sum();
        let level: f64 = up.iter().map(|(d, w)| d.z * w).sum();
        // Where all suns are low, walls would be blinding.
        let scale = 1.0 / level.max(0.35 * weight);
        Self { suns: up.into_iter().map(|(d, w)| (d.as_vec3(), (w * scale) as f32)).collect() }
    }
}

struct Painter<'a> {
    view: &'a View,
    hits: &'a HitMap,
    site: &'a Site,
    suns: Suns,
    palette: Palette,
    sky: Vec<Vec3>,
}

/// A point of a surface that is to be painted.
struct SurfacePoint {
    position: Vec3,
    normal: Vec3,
    face: u32,
    /// From the eye to the place, m.
    distance_m: f32,
    toward: Vec3,
}

impl Painter<'_> {
    /// Light of the sky at a pixel, from its share of the directions; zero where nothing is hit.
    fn sky_light(&self, column: usize, row: usize) -> Vec3 {
        let hit = self.hits.at(column, row);
        if hit.face == u32::MAX {
            return Vec3::ZERO;
        }
        let share = (row % SQUARE) * SQUARE + column % SQUARE;
        self.sky_at(hit.position, hit.normal, share)
    }

    fn sky_at(&self, position: Vec3, normal: Vec3, share: usize) -> Vec3 {
        let frame = Frame::around(normal.as_dvec3());
        let (x, y) = (frame.x.as_vec3(), frame.y.as_vec3());
        let from = position + normal * LIFT_M;
        let mut sum = Vec3::ZERO;
        for local in self.sky.iter().skip(share).step_by(SQUARE * SQUARE) {
            let direction = x * local.x + y * local.y + normal * local.z;
            sum += if direction.z < 0.0
                || self.site.bvh.occluded(from, direction, 0.0, f32::INFINITY)
            {
                palette::BOUNCE
            } else {
                palette::sky(direction) * SKY_PART
            };
        }
        sum / SKY_RAYS as f32
    }

    /// The sky's light at a pixel after its square shared its directions: the mean over the
    /// pixels around that lie on the same plane.
    fn shared_sky(&self, raw: &Grid<Vec3>, column: usize, row: usize) -> Vec3 {
        let here = self.hits.at(column, row);
        let (mut sum, mut count) = (Vec3::ZERO, 0.0f32);
        for r in row.saturating_sub(SQUARE / 2)..(row + SQUARE / 2).min(raw.rows()) {
            for c in column.saturating_sub(SQUARE / 2)..(column + SQUARE / 2).min(raw.columns()) {
                if same_plane(here, self.hits.at(c, r)) {
                    sum += raw[(c, r)];
                    count += 1.0;
                }
            }
        }
        sum / count.max(1.0)
    }

    fn pixel(&self, raw: &Grid<Vec3>, column: usize, row: usize) -> Vec3 {
        if self.on_edge(column, row) {
            let mut sum = Vec3::ZERO;
            for (dx, dy) in EDGE_RAYS {
                sum += self.through(raw, column as f64 + dx, row as f64 + dy);
            }
            return sum / EDGE_RAYS.len() as f32;
        }
        let Some(ray) = self.view.ray(column, row) else { return palette::PAPER };
        let hit = self.hits.at(column, row);
        match hit.kind {
            HitKind::Clipped => palette::PAPER,
            HitKind::Sky => self.nothing(&ray),
            _ => {
                let point = SurfacePoint {
                    position: hit.position,
                    normal: hit.normal,
                    face: hit.face,
                    distance_m: (hit.position.as_dvec3() - ray.origin).length() as f32,
                    toward: ray.direction.as_vec3(),
                };
                self.shade(&point, self.shared_sky(raw, column, row))
            }
        }
    }

    /// What one ray through the picture shows.
    fn through(&self, raw: &Grid<Vec3>, x: f64, y: f64) -> Vec3 {
        let Some(ray) = self.view.ray_at(x, y) else { return palette::PAPER };
        let Some(met) = first_surface(self.site, &ray) else {
            return if ray.limit_m.is_finite() { palette::PAPER } else { self.nothing(&ray) };
        };
        let point = SurfacePoint {
            position: met.position.as_vec3(),
            normal: met.normal,
            face: self.site.triangles[met.triangle as usize].face,
            distance_m: (met.position - ray.origin).length() as f32,
            toward: ray.direction.as_vec3(),
        };
        // The sky's light changes slowly: take it from a pixel nearby on the same plane.
        let like = Hit {
            position: point.position,
            normal: point.normal,
            face: point.face,
            ..Hit::nothing(HitKind::Hidden)
        };
        let (column, row) = (x as usize, y as usize);
        for r in row.saturating_sub(1)..=(row + 1).min(raw.rows() - 1) {
            for c in column.saturating_sub(1)..=(column + 1).min(raw.columns() - 1) {
                if same_plane(&like, self.hits.at(c, r)) {
                    return self.shade(&point, self.shared_sky(raw, c, r));
                }
            }
        }
        let share = (row % SQUARE) * SQUARE + column % SQUARE;
        let sky = self.sky_at(point.position, point.normal, share);
        self.shade(&point, sky)
    }

    fn shade(&self, point: &SurfacePoint, sky: Vec3) -> Vec3 {
        let from = point.position + point.normal * LIFT_M;
        let mut sun = 0.0;
        for &(direction, irradiance) in &self.suns.suns {
            let cos = point.normal.dot(direction);
            if cos > 0.0 && !self.site.bvh.occluded(from, direction, 0.0, f32::INFINITY) {
                sun += cos * irradiance;
            }
        }
        let light = palette::SUN * (SUN_PART * sun) + sky;
        let seen = match self.palette.reflectance(point.face, point.normal) {
            Some(reflectance) => reflectance * light,
            None => self.glass(point, light),
        };
        if self.view.projection() == Projection::Parallel {
            return seen;
        }
        // A little haze tells near from far.
        let haze = 1.0 - libm::expf(-point.distance_m / 3000.0);
        seen.lerp(palette::sky(Vec3::X), haze)
    }

    /// PV: dark blue under glass that mirrors the sky, more so at grazing angles (Schlick 1994).
    fn glass(&self, point: &SurfacePoint, light: Vec3) -> Vec3 {
        let cos = (-point.toward.dot(point.normal)).clamp(0.0, 1.0);
        let gap = 1.0 - cos;
        let mirrored = 0.04 + 0.96 * gap * gap * gap * gap * gap;
        let mirror = point.toward + point.normal * (2.0 * cos);
        palette::PV * light + palette::sky(mirror) * mirrored.min(0.6)
    }

    fn nothing(&self, ray: &ViewRay) -> Vec3 {
        match self.view.projection() {
            Projection::Parallel => palette::PAPER,
            _ => palette::sky(ray.direction.as_vec3()),
        }
    }

    /// Whether the pixel's neighbours show another surface, or none.
    fn on_edge(&self, column: usize, row: usize) -> bool {
        let here = self.hits.at(column, row);
        let differs = |c: usize, r: usize| {
            let there = self.hits.at(c, r);
            if here.face == u32::MAX || there.face == u32::MAX {
                return here.kind != there.kind;
            }
            here.face != there.face || !same_plane(here, there)
        };
        (column > 0 && differs(column - 1, row))
            || (column + 1 < self.hits.columns && differs(column + 1, row))
            || (row > 0 && differs(column, row - 1))
            || (row + 1 < self.hits.rows && differs(column, row + 1))
    }
}

/// Whether two hits lie on one (slightly bent) surface.
fn same_plane(a: &Hit, b: &Hit) -> bool {
    if a.face == u32::MAX || b.face == u32::MAX || a.normal.dot(b.normal) < 0.97 {
        return false;
    }
    let way = b.position - a.position;
    a.normal.dot(way).abs() <= 0.02 + 0.2 * way.length()
}
