//! The scene at an instant, in true luminances.
//!
//! Unlike the daylight background this picture is measured by others (`evalglare` and the eye), so
//! its luminances are right: the sun's disc whole, a clear sky, surfaces that reflect both once,
//! and PV that scatters by its BSDF. The sun's reflection is integrated over the disc at each place
//! that a pixel looks at, because it may be a millionth of the picture's area and most of its
//! light; pixels that show it, or an edge, are looked at more often. The sky's light is shared out
//! among neighbouring pixels of one surface, as in [`super::super::background`].

use std::f64::consts::FRAC_1_PI;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::sky::ClearSky;
use crate::base::{Frame, Grid, Progress, Purpose, Stream};
use crate::render::paint::palette;
use crate::render::paint::palette::Palette;
use crate::render::paint::sky_directions::directions;
use crate::render::reflect::eye::{EyeMaterial, SunAt, UnderSun};
use crate::render::view::camera::{View, ViewRay};
use crate::render::view::error::Error;
use crate::render::view::hits::{Met, surfaces_along};
use crate::site::Site;

/// Lumens of a watt in Radiance's pictures.
pub const WATT_LM: f64 = 179.0;
/// Weights of red, green and blue in Radiance's brightness.
const BRIGHT: Vec3 = Vec3::new(0.265, 0.670, 0.065);
/// Directions that a surface asks for the sky's light; pixels of a square of [`SQUARE`] pixels share
/// theirs out.
const SKY_RAYS: usize = 16;
const SQUARE: usize = 4;
/// Directions in which PV mirrors the sky, for each place that is looked at.
const MIRROR_RAYS: usize = 6;
/// Places of a pixel that is looked at once, four times, or (sun, PV) sixteen times, a side each.
const FEW: usize = 2;
const MANY: usize = 4;
/// Rays start this far before a surface, m.
const LIFT_M: f64 = 2e-3;

/// The scene at an instant.
#[derive(Debug)]
pub struct Moment<'a> {
    site: &'a Site,
    /// From 0 (January): what crowns let through.
    month: usize,
    sun: SunAt,
    /// Radiance's watts (of 179 lm) in a watt of the sun.
    watts: f64,
    sky: ClearSky,
    materials: Vec<EyeMaterial<'a>>,
    /// Front and back of each PV surface under the sun.
    sunlit: Vec<[UnderSun<'a>; 2]>,
    palette: Palette,
    directions: Vec<DVec3>,
    sun_tint: Vec3,
}

impl<'a> Moment<'a> {
    /// `month` from 0 (January); `lm_per_w`: of the sun's watts; `materials` by PV surface.
    pub fn new(
        site: &'a Site,
        month: usize,
        sun: SunAt,
        lm_per_w: f64,
        materials: Vec<EyeMaterial<'a>>,
    ) -> Self {
        let sunlit = site.pv.iter().zip(&materials).map(|(pv, material)| {
            [pv.normal, -pv.normal].map(|normal| {
                let frame = Frame::around(normal.normalize());
                material.under(&sun, frame.local_from_world(sun.direction))
            })
        });
        Self {
            sunlit: sunlit.collect(),
            sky: ClearSky::new(sun.direction, sun.irradiance_w_m2 * lm_per_w),
            watts: lm_per_w / WATT_LM,
            palette: Palette::of(site),
            sun_tint: tint(palette::SUN),
            site,
            month,
            sun,
            materials,
            directions: directions(SKY_RAYS * SQUARE * SQUARE).collect(),
        }
    }

    /// The picture, radiances in Radiance's watts (179 lm each): red, green and blue whose weighted
    /// sum is true. Surfaces reflect the sun and the sky once, diffusely, with the reflectance of
    /// their material; hues are for the eye alone. PV scatters by its BSDF: the sun's disc whole,
    /// the sky and the scene by some directions.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn paint(&self, view: &View, progress: &dyn Progress) -> Result<Grid<[f32; 3]>, Error> {
        let (columns, rows) = (view.columns(), view.rows());
        progress.begin("luminance picture", 2 * (columns * rows) as u64, "pixels");
        let mut first: Vec<Seen> = vec![Seen::default(); columns * rows];
        first.par_chunks_mut(columns).enumerate().try_for_each(|(row, out)| {
            progress.check()?;
            for (column, seen) in out.iter_mut().enumerate() {
                *seen = self.first(view, column, row);
            }
            progress.advance(columns as u64);
            Ok::<(), Error>(())
        })?;
        let first = Grid::from_vec(columns, rows, first);
        let mut out = vec![[0.0; 3]; columns * rows];
        out.par_chunks_mut(columns).enumerate().try_for_each(|(row, out)| {
            progress.check()?;
            for (column, value) in out.iter_mut().enumerate() {
                *value = self.pixel(view, &first, column, row).to_array();
            }
            progress.advance(columns as u64);
            Ok::<(), Error>(())
        })?;
        progress.finish();
        Ok(Grid::from_vec(columns, rows, out))
    }

    /// What the middle of a pixel shows, and its share of the sky's light.
    fn first(&self, view: &View, column: usize, row: usize) -> Seen {
        let Some(ray) = view.ray(column, row) else { return Seen::default() };
        let (mut leaves, end) = surfaces_along(self.site, &ray, self.month);
        let pv_of = |met: &Met| {
            let face = self.site.triangles[met.triangle as usize].face;
            self.site.faces[face as usize].pv
        };
        let light_passes = leaves.last().is_none_or(|(_, share)| *share > 0.0);
        let is_pv = light_passes && end.as_ref().and_then(pv_of).is_some();
        leaves.truncate(1);
        let Some(met) = leaves.pop().map(|(met, _)| met).or(end) else {
            return Seen { face: NOTHING, ..Seen::default() };
        };
        let face = self.site.triangles[met.triangle as usize].face;
        let share = (row % SQUARE) * SQUARE + column % SQUARE;
        let sky = if is_pv { Vec3::ZERO } else { self.sky_light(&met, share) };
        Seen { face, normal: met.normal, position: met.position.as_vec3(), sky, is_pv }
    }

    /// Irradiance from the sky, by one share of the directions.
    fn sky_light(&self, met: &Met, share: usize) -> Vec3 {
        let frame = Frame::around(met.normal.as_dvec3());
        let from = (met.position + frame.z * LIFT_M).as_vec3();
        let mut sum = Vec3::ZERO;
        for local in self.directions.iter().skip(share).step_by(SQUARE * SQUARE) {
            let towards = frame.world_from_local(*local);
            let passes = self.passes(from, towards);
            sum += self.bounce() * (1.0 - passes);
            if passes > 0.0 {
                sum += self.sky(towards) * passes;
            }
        }
        sum * (std::f32::consts::PI / SKY_RAYS as f32)
    }

    /// Share of the light that comes from far away.
    fn passes(&self, from: Vec3, towards: DVec3) -> f32 {
        self.site.transmittance(from, towards.as_vec3(), f32::INFINITY, self.month)
    }

    /// What a ray shows: of crowns what they keep, and what is seen through them; `None`: nothing
    /// stands in its way.
    fn along(&self, ray: &ViewRay, mut show: impl FnMut(Option<&Met>) -> Vec3) -> Vec3 {
        let (leaves, end) = surfaces_along(self.site, ray, self.month);
        let (mut sum, mut left) = (Vec3::ZERO, 1.0);
        for (met, share) in &leaves {
            sum += show(Some(met)) * (left * (1.0 - share));
            left *= share;
        }
        if left > 0.0 { sum + show(end.as_ref()) * left } else { sum }
    }

    /// Radiance of the sky or of the ground beyond the scene.
    fn sky(&self, towards: DVec3) -> Vec3 {
        let value = self.sky.luminance_cd_m2(towards) / WATT_LM;
        tint(palette::sky(towards.as_vec3())) * value as f32
    }

    /// Radiance of what stands in the way of the sky, on the average: half of the ground's.
    fn bounce(&self) -> Vec3 {
        self.sky(DVec3::NEG_Z) * 0.5
    }

    fn pixel(&self, view: &View, first: &Grid<Seen>, column: usize, row: usize) -> Vec3 {
        let here = &first[(column, row)];
        let Some(ray) = view.ray(column, row) else { return Vec3::ZERO };
        let (wide, high) = (first.columns(), first.rows());
        let next =
            view.ray((column + 1) % wide, row).map_or(0.0, |n| n.direction.distance(ray.direction));
        let near_sun = self.sun.direction.distance(ray.direction)
            < self.sun.radius_rad() + 1.5 * next.min(0.1);
        let neighbours = [(0, 1), (2, 1), (1, 0), (1, 2)];
        let edge = neighbours.iter().any(|(dx, dy)| {
            let (x, y) = (column + dx, row + dy);
            (1..=wide).contains(&x)
                && (1..=high).contains(&y)
                && !first[(x - 1, y - 1)].is_like(here)
        });
        let side = match (here.is_pv || near_sun, edge) {
            (true, _) => MANY,
            (false, true) => FEW,
            _ => 1,
        };
        let mut sum = Vec3::ZERO;
        for i in 0..side * side {
            let at = |i: usize| (i as f64 + 0.5) / side as f64;
            let (x, y) = (column as f64 + at(i % side), row as f64 + at(i / side));
            let number = ((row * wide + column) * MANY * MANY + i) as u64;
            sum += self.through(view, first, (x, y), number);
        }
        sum / (side * side) as f32
    }

    /// What one ray shows.
    fn through(&self, view: &View, first: &Grid<Seen>, (x, y): (f64, f64), number: u64) -> Vec3 {
        let Some(ray) = view.ray_at(x, y) else { return Vec3::ZERO };
        self.along(&ray, |met| {
            let Some(met) = met else { return self.beyond(&ray) };
            let face = self.site.triangles[met.triangle as usize].face;
            if let Some(surface) = self.site.faces[face as usize].pv {
                return self.pv(met, surface, ray.direction, number);
            }
            let sky = self.shared_sky(first, met, face, x as usize, y as usize);
            self.diffuse(met, face, sky)
        })
    }

    /// The sky, and the sun itself.
    fn beyond(&self, ray: &ViewRay) -> Vec3 {
        if ray.limit_m.is_finite() {
            return Vec3::ZERO;
        }
        let mut seen = self.sky(ray.direction);
        if ray.direction.dot(self.sun.direction) > libm::cos(self.sun.radius_rad()) {
            seen += self.sun_watts(self.sun.irradiance_w_m2 / self.sun.solid_angle_sr());
        }
        seen
    }

    fn sun_watts(&self, watts: f64) -> Vec3 {
        self.sun_tint * (watts * self.watts) as f32
    }

    /// A diffuse surface in the sun and under the sky.
    fn diffuse(&self, met: &Met, face: u32, sky: Vec3) -> Vec3 {
        let normal = met.normal.as_dvec3();
        let cos = normal.dot(self.sun.direction);
        let from = (met.position + normal * LIFT_M).as_vec3();
        let mut light = sky;
        if cos > 0.0 {
            let passes = self.passes(from, self.sun.direction);
            light += self.sun_watts(self.sun.irradiance_w_m2 * cos) * passes;
        }
        self.reflectance(face, met.normal) * light * FRAC_1_PI as f32
    }

    /// The hue that people expect, as bright as the material says.
    fn reflectance(&self, face: u32, normal: Vec3) -> Vec3 {
        let hue = self.palette.reflectance(face, normal).unwrap_or(Vec3::splat(0.05));
        let material = self.site.faces[face as usize].material;
        let own = self.site.materials.get(material as usize);
        let own = own.map_or(0.25, |m| Vec3::from_array(m.reflectance).dot(BRIGHT));
        tint(hue) * own
    }

    /// The sky's light around a pixel, from those that show the same plane.
    fn shared_sky(
        &self,
        first: &Grid<Seen>,
        met: &Met,
        face: u32,
        column: usize,
        row: usize,
    ) -> Vec3 {
        let own =
            Seen { face, normal: met.normal, position: met.position.as_vec3(), ..Seen::default() };
        let half = SQUARE / 2;
        let (mut sum, mut count) = (Vec3::ZERO, 0.0_f32);
        for r in row.saturating_sub(half)..(row + half).min(first.rows()) {
            for c in column.saturating_sub(half)..(column + half).min(first.columns()) {
                let there = &first[(c, r)];
                if own.is_like(there) {
                    sum += there.sky;
                    count += 1.0;
                }
            }
        }
        if count > 0.0 {
            return sum / count;
        }
        self.sky_light(met, (row % SQUARE) * SQUARE + column % SQUARE)
    }

    /// PV: the sun's disc by its BSDF, and what it mirrors of sky and scene.
    fn pv(&self, met: &Met, surface: u16, direction: DVec3, number: u64) -> Vec3 {
        let pv = &self.site.pv[usize::from(surface)];
        let front = pv.normal.dot(direction) < 0.0;
        if !front && !pv.two_sided {
            return self.bounce() * 0.2;
        }
        let frame = Frame::around(if front { pv.normal } else { -pv.normal }.normalize());
        let material = &self.materials[usize::from(surface)];
        let from = (met.position + frame.z * LIFT_M).as_vec3();
        let out = frame.local_from_world(-direction);
        let under = &self.sunlit[usize::from(surface)][usize::from(!front)];
        let mut seen = Vec3::ZERO;
        if frame.z.dot(self.sun.direction) > 0.0 {
            let passes = self.passes(from, self.sun.direction);
            if passes > 0.0 {
                seen += self.sun_watts(under.radiance(out)) * passes;
            }
        }
        let bsdf = material.bsdf();
        let bound = bsdf.bound(out);
        let mut random = Stream::new(1, Purpose::Picture, number);
        let mut sum = Vec3::ZERO;
        for _ in 0..MIRROR_RAYS {
            if let Some(found) = bsdf.sample(out, &mut random) {
                let towards = frame.world_from_local(found.direction);
                sum += self.mirrored(from, towards) * found.weight as f32;
            }
        }
        seen + sum * (bound as f32 / MIRROR_RAYS as f32)
    }

    fn mirrored(&self, from: Vec3, towards: DVec3) -> Vec3 {
        let limit_m = f64::INFINITY;
        let ray = ViewRay { origin: from.as_dvec3(), direction: towards, limit_m };
        self.along(&ray, |met| {
            let Some(met) = met else { return self.sky(towards) };
            let face = self.site.triangles[met.triangle as usize].face;
            let sky = (self.sky(DVec3::Z) + self.bounce()) * (0.5 * std::f32::consts::PI);
            self.diffuse(met, face, sky)
        })
    }
}

const NOTHING: u32 = u32::MAX;

/// What a pixel's middle shows.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    face: u32,
    normal: Vec3,
    position: Vec3,
    /// Irradiance from the sky.
    sky: Vec3,
    is_pv: bool,
}

impl Seen {
    fn is_like(&self, other: &Self) -> bool {
        if self.face == NOTHING || other.face == NOTHING {
            return self.face == other.face;
        }
        let way = other.position - self.position;
        self.is_pv == other.is_pv
            && self.normal.dot(other.normal) > 0.97
            && self.normal.dot(way).abs() <= 0.02 + 0.1 * way.length()
    }
}

/// A colour as bright as white.
fn tint(color: Vec3) -> Vec3 {
    color / color.dot(BRIGHT).max(1e-6)
}

/// What a picture's pixels give on a plane across its axis, lx; pixels behind it give nothing.
/// Each pixel covers the solid angle of its four corners.
pub fn illuminance_lx(view: &View, picture: &Grid<[f32; 3]>) -> f64 {
    let mut sum = 0.0;
    for row in 0..picture.rows() {
        for column in 0..picture.columns() {
            let (x, y) = (column as f64, row as f64);
            let corner = |dx: f64, dy: f64| view.ray_at(x + dx, y + dy).map(|r| r.direction);
            let corners = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
            let (Some(middle), [Some(a), Some(b), Some(c), Some(d)]) =
                (view.ray(column, row), corners)
            else {
                continue;
            };
            let solid = 0.5 * (c - a).cross(d - b).length();
            let cos = middle.direction.dot(view.direction()).max(0.0);
            let value = Vec3::from_array(picture[(column, row)]).dot(BRIGHT);
            sum += f64::from(value) * cos * solid;
        }
    }
    sum * WATT_LM
}
