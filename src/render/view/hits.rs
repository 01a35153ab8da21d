//! What every pixel of a view sees first; written once, read by every estimator.
//!
//! Shooting the rays once has two reasons: photons, direct integration and pictures then mean the
//! same places, and a view can be resumed without the scene. A hit's place is computed anew in f64
//! from the triangle's plane, as a ray from far away would otherwise miss its surface by
//! millimetres.

use std::path::Path;

use glam::{DVec3, Vec3};
use glintmap_formats::hits::{Facts, KINDS, Record};
use rayon::prelude::*;

use super::camera::{View, ViewRay};
use super::error::Error;
use super::pv_visibility::PvVisibility;
use crate::base::{Progress, Provenance};
use crate::site::{RayHit, Site};

/// What a pixel shows, as far as light from the PV is concerned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum HitKind {
    /// A surface that sees PV within the path limit.
    Receiver = 0,
    /// Nothing.
    Sky = 1,
    /// The PV itself, either side.
    Pv = 2,
    /// Outside the projection, or cut off by the aft clipping plane.
    Clipped = 3,
    /// A surface whose nearest visible PV point lies beyond the path limit.
    Beyond = 4,
    /// A surface that sees none of the points tested on the PV.
    Hidden = 5,
}

impl HitKind {
    const ALL: [Self; 6] =
        [Self::Receiver, Self::Sky, Self::Pv, Self::Clipped, Self::Beyond, Self::Hidden];

    /// The kind with a number of the file format.
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }

    /// Its name in the file format.
    pub fn name(self) -> &'static str {
        KINDS[self as usize]
    }

    /// Whether photons may lie there: a surface that isn't PV. Beyond and hidden ones count, too:
    /// what the test points of the PV don't see may still see another part of it.
    pub fn receives(self) -> bool {
        matches!(self, Self::Receiver | Self::Beyond | Self::Hidden)
    }
}

/// What a pixel sees first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Where, m from the local origin; zero where nothing is hit.
    pub position: Vec3,
    /// Unit normal of the surface, turned to the viewer; zero where nothing is hit.
    pub normal: Vec3,
    /// Index of the object; `u32::MAX` where nothing is hit.
    pub object: u32,
    /// Index of the face; `u32::MAX` where nothing is hit.
    pub face: u32,
    /// Distance to the nearest visible of the points tested on the PV, m; 0 where there is none
    /// (see `kind`).
    pub pv_distance_m: f32,
    /// What it is.
    pub kind: HitKind,
}

impl Hit {
    /// A pixel that hits nothing.
    pub fn nothing(kind: HitKind) -> Self {
        Self {
            position: Vec3::ZERO,
            normal: Vec3::ZERO,
            object: u32::MAX,
            face: u32::MAX,
            pv_distance_m: 0.0,
            kind,
        }
    }
}

/// The hits of a whole view, row-major, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct HitMap {
    /// Width, pixels.
    pub columns: usize,
    /// Height, pixels.
    pub rows: usize,
    /// `columns * rows` hits.
    pub hits: Vec<Hit>,
}

impl HitMap {
    /// The hit of a pixel.
    pub fn at(&self, column: usize, row: usize) -> &Hit {
        assert!(column < self.columns, "column {column} of {}", self.columns);
        &self.hits[row * self.columns + column]
    }

    /// Writes and seals `hits.gmh`.
    ///
    /// # Errors
    /// [`Error::Hits`] with what the file system says.
    pub fn write(
        &self,
        path: &Path,
        view: &View,
        max_path_m: f64,
        provenance: &Provenance,
    ) -> Result<(), Error> {
        self.write_as(path, view.to_options(), max_path_m, provenance)
    }

    /// [`Self::write`] for sensors, which no view sees.
    ///
    /// # Errors
    /// [`Error::Hits`] with what the file system says.
    pub fn write_sensors(
        &self,
        path: &Path,
        max_path_m: f64,
        provenance: &Provenance,
    ) -> Result<(), Error> {
        self.write_as(path, "sensors".to_owned(), max_path_m, provenance)
    }

    fn write_as(
        &self,
        path: &Path,
        view: String,
        max_path_m: f64,
        provenance: &Provenance,
    ) -> Result<(), Error> {
        let json = serde_json::to_value(provenance)
            .map_err(|e| glintmap_formats::hits::Error::Io(std::io::Error::other(e)))?;
        let facts = Facts::new(self.columns, self.rows, max_path_m, view, json);
        glintmap_formats::hits::write(path, &facts, |i| {
            let h = &self.hits[i];
            Record {
                position_m: h.position.to_array(),
                normal: h.normal.to_array(),
                object: h.object,
                face: h.face,
                pv_distance_m: h.pv_distance_m,
                kind: h.kind as u8,
            }
        })?;
        Ok(())
    }

    /// Reads `hits.gmh` and what its header says.
    ///
    /// # Errors
    /// [`Error::Hits`] where it can't be read or is damaged.
    pub fn read(path: &Path) -> Result<(Self, Facts), Error> {
        let mut hits = Vec::new();
        let facts = glintmap_formats::hits::read(
            path,
            |_| {},
            |r| {
                hits.push(Hit {
                    position: Vec3::from_array(r.position_m),
                    normal: Vec3::from_array(r.normal),
                    object: r.object,
                    face: r.face,
                    pv_distance_m: r.pv_distance_m,
                    // The reader refuses kinds that it doesn't know.
                    kind: HitKind::from_number(r.kind).unwrap_or(HitKind::Clipped),
                });
            },
        )?;
        Ok((Self { columns: facts.columns, rows: facts.rows, hits }, facts))
    }
}

/// A surface that a ray meets: place, normal to the viewer, triangle.
pub(in crate::render) struct Met {
    pub position: DVec3,
    pub normal: Vec3,
    pub triangle: u32,
}

/// The first surface along a ray. The place is computed anew in f64: far view points would
/// otherwise cost millimetres.
pub(in crate::render) fn first_surface(site: &Site, ray: &ViewRay) -> Option<Met> {
    let (origin, direction) = (ray.origin.as_vec3(), ray.direction.as_vec3());
    site.bvh.closest(origin, direction, 0.0, reach_m(ray)).map(|found| met(site, ray, &found))
}

/// The crowns along a ray in a month, each with the share of the light that it lets through, and
/// what is opaque behind them.
pub(in crate::render) fn surfaces_along(
    site: &Site,
    ray: &ViewRay,
    month: usize,
) -> (Vec<(Met, f32)>, Option<Met>) {
    let Some(crowns) = &site.crowns else { return (Vec::new(), first_surface(site, ray)) };
    let (origin, direction) = (ray.origin.as_vec3(), ray.direction.as_vec3());
    let (leaves, end) = crowns.along(origin, direction, reach_m(ray), month);
    let leaves = leaves.iter().map(|(hit, share)| (met(site, ray, hit), *share)).collect();
    (leaves, end.map(|found| met(site, ray, &found)))
}

fn reach_m(ray: &ViewRay) -> f32 {
    if ray.limit_m.is_finite() { ray.limit_m as f32 } else { f32::INFINITY }
}

fn met(site: &Site, ray: &ViewRay, found: &RayHit) -> Met {
    let triangle = &site.triangles[found.triangle as usize];
    let front = triangle.normal();
    let n = front.as_dvec3();
    let slope = n.dot(ray.direction);
    let mut along = f64::from(found.distance_m);
    if slope.abs() > 1e-3 {
        let plane = n.dot(triangle.corners[0].as_dvec3() - ray.origin) / slope;
        // Both must mean the same place; a sliver's normal may be poor.
        if (plane - along).abs() <= 1e-3 * (1.0 + along) {
            along = plane;
        }
    }
    let normal = if slope > 0.0 { -front } else { front };
    Met { position: ray.origin + ray.direction * along, normal, triangle: found.triangle }
}

/// What every pixel of a view sees. `max_path_m` decides between [`HitKind::Receiver`] and
/// [`HitKind::Beyond`]; `seed` shifts the 64 points that are tested on the PV.
///
/// # Errors
/// [`Error::Interrupted`].
pub fn hits(
    view: &View,
    site: &Site,
    max_path_m: f64,
    seed: u64,
    progress: &dyn Progress,
) -> Result<HitMap, Error> {
    let (columns, rows) = (view.columns(), view.rows());
    let seen = PvVisibility::spread(site, seed);
    let mut all = vec![Hit::nothing(HitKind::Sky); columns * rows];
    progress.begin("hits", (columns * rows) as u64, "pixels");
    all.par_chunks_mut(columns).enumerate().try_for_each(|(row, line)| {
        progress.check()?;
        for (column, hit) in line.iter_mut().enumerate() {
            *hit = one(view, site, &seen, max_path_m, column, row);
        }
        progress.advance(columns as u64);
        Ok::<(), Error>(())
    })?;
    progress.finish();
    Ok(HitMap { columns, rows, hits: all })
}

fn one(
    view: &View,
    site: &Site,
    seen: &PvVisibility,
    max_path_m: f64,
    column: usize,
    row: usize,
) -> Hit {
    let Some(ray) = view.ray(column, row) else {
        return Hit::nothing(HitKind::Clipped);
    };
    let Some(met) = first_surface(site, &ray) else {
        let kind = if ray.limit_m.is_finite()
            && first_surface(site, &ViewRay { limit_m: f64::INFINITY, ..ray }).is_some()
        {
            HitKind::Clipped
        } else {
            HitKind::Sky
        };
        return Hit::nothing(kind);
    };
    let face = site.triangles[met.triangle as usize].face;
    let source = &site.faces[face as usize];
    let position = met.position.as_vec3();
    let (kind, pv_distance_m) = if source.pv.is_some() {
        (HitKind::Pv, 0.0)
    } else {
        match seen.nearest_m(site, position, met.normal) {
            None => (HitKind::Hidden, 0.0),
            Some(d) if f64::from(d) > max_path_m => (HitKind::Beyond, d),
            Some(d) => (HitKind::Receiver, d),
        }
    };
    Hit { position, normal: met.normal, object: source.object, face, pv_distance_m, kind }
}
