//! Where a scene lies: reference system, local origin, true north.
//!
//! Local models and map coordinates come together in one scene. Those of a map are moved by the
//! origin and everything is turned so that +y is true north, because the sun's directions count
//! from there and a map's grid may be off by degrees (the grid's convergence). Local coordinates
//! stay small, so that f32 is exact to millimetres.

use std::fmt;

use glam::{DMat3, DVec2, DVec3};

use super::clip::Region;
use super::convergence::true_north_deg;
use super::draft::{Draft, Shape, in_reach};
use super::log::Log;
use super::source::Source;
use super::{Coordinates, Error, Origin, SceneSpec};
use crate::base::Place;

/// Coordinates up to here are taken as local where nothing else is said, m.
pub(super) const LOCAL_REACH_M: f64 = 10_000.0;
/// Largest coordinate: f32 steps are 8 mm there, m.
const MAX_REACH_M: f64 = 100_000.0;

/// Local coordinates of a point in map coordinates: less the origin, then turned about it so that
/// +y is true north.
pub fn local_from_map(point: DVec3, origin: DVec3, north_deg: f64) -> DVec3 {
    turn(north_deg) * (point - origin)
}

/// Map coordinates of a local point; the inverse of [`local_from_map`].
pub fn map_from_local(point: DVec3, origin: DVec3, north_deg: f64) -> DVec3 {
    turn(north_deg).transpose() * point + origin
}

/// The rotation that takes the direction `north_deg` clockwise from +y to +y; exactly nothing at 0.
fn turn(north_deg: f64) -> DMat3 {
    if north_deg == 0.0 {
        return DMat3::IDENTITY;
    }
    let (sin, cos) = libm::sincos(north_deg.to_radians());
    DMat3::from_cols(DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0), DVec3::Z)
}

/// Where true north lies in the files' coordinates, and who says so.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct North {
    /// Clockwise from the files' y axis, degrees; the scene was turned by as much.
    pub deg: f64,
    /// Who says so.
    pub source: NorthSource,
    /// The reference system, where it matters.
    pub crs: String,
}

/// Who says where true north lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NorthSource {
    /// The project: `north_deg`.
    #[default]
    Stated,
    /// The reference system of the map and the site's latitude and longitude.
    GridConvergence,
    /// Nobody: local coordinates, whose y axis is taken as north.
    Assumed,
    /// Nobody: a map whose projection isn't known here; its y axis is taken as north.
    Unknown,
}

impl fmt::Display for North {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { deg, crs, .. } = self;
        match self.source {
            NorthSource::Stated => {
                write!(f, "{deg:.3} degrees clockwise from the files' y axis (north_deg)")
            }
            NorthSource::GridConvergence => write!(
                f,
                "{deg:.3} degrees clockwise from the map's y axis (grid convergence of {crs} at the site)"
            ),
            NorthSource::Assumed => write!(f, "the files' y axis (north_deg isn't stated)"),
            NorthSource::Unknown => write!(
                f,
                "taken as the map's y axis: the grid convergence of {crs} isn't known here; state north_deg"
            ),
        }
    }
}

/// Where true north lies: as the project says; else by the map's projection, where the files have
/// map coordinates and the site's place is known.
pub(super) fn north(scene: &SceneSpec, crs: Option<&str>, sources: &[Source]) -> North {
    let of = |deg, source| North { deg, source, crs: crs.unwrap_or_default().to_owned() };
    let Some([latitude, longitude]) = scene.convergence_at else {
        return of(scene.north_deg, NorthSource::Stated);
    };
    if crs.is_none() || !sources.iter().any(|s| s.is_city) {
        return of(0.0, NorthSource::Assumed);
    }
    match crs.and_then(epsg).and_then(|code| true_north_deg(code, latitude, longitude)) {
        Some(deg) => of(deg, NorthSource::GridConvergence),
        None => of(0.0, NorthSource::Unknown),
    }
}

/// How coordinates of the project become those of the scene.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Placement {
    /// Map coordinates of the local origin, m.
    pub origin: DVec3,
    pub north_deg: f64,
}

impl Placement {
    /// A polygon of the project in local coordinates; `None` where it has no area.
    pub fn region(&self, polygon: &[[f64; 2]], coordinates: Coordinates) -> Option<Region> {
        let local = |&p: &[f64; 2]| {
            let p = DVec2::from(p).extend(0.0);
            let known = in_reach(p).then_some(p)?;
            Some(match coordinates {
                Coordinates::Local => known.truncate(),
                Coordinates::Map => local_from_map(known, self.origin, self.north_deg).truncate(),
            })
        };
        Region::new(&polygon.iter().map(local).collect::<Option<Vec<_>>>()?)
    }

    /// A height of the project in local coordinates.
    pub fn local_height(&self, height_m: f64, coordinates: Coordinates) -> f64 {
        match coordinates {
            Coordinates::Local => height_m,
            Coordinates::Map => height_m - self.origin.z,
        }
    }
}

/// Smallest and largest coordinates of each file.
pub(super) fn extents(draft: &Draft, files: usize) -> Vec<Option<[DVec3; 2]>> {
    let mut out = vec![None; files];
    for surface in &draft.surfaces {
        let mut grow = |points: &[DVec3]| {
            for &p in points {
                let [min, max] = out[surface.source as usize].get_or_insert([p, p]);
                *min = min.min(p);
                *max = max.max(p);
            }
        };
        match &surface.shape {
            Shape::Planar(rings) => rings.clone().for_each(|r| grow(draft.ring(r))),
            Shape::Curved(points) | Shape::Flat(points) => {
                grow(&draft.points[points.start as usize..points.end as usize]);
            }
        }
    }
    out
}

/// The coordinate reference system of the scene; warns where files disagree.
pub(super) fn reference_system(
    scene: &SceneSpec,
    sources: &[Source],
    log: &mut Log,
) -> Result<Option<String>, Error> {
    let mut crs = scene.crs.clone();
    for source in sources {
        let Some(found) = &source.crs else { continue };
        if is_geographic(found) {
            return Err(Error::Geographic { path: source.file.clone(), crs: found.clone() });
        }
        if epsg(found) == Some(3857) {
            let message = format!(
                "its coordinate reference system is {found} (Web Mercator), whose units aren't metres: lengths are half as much again too large in central Europe; reproject it"
            );
            let place = Place { file: source.file.clone(), ..Place::default() };
            log.warn("files whose units aren't metres", place, message);
        }
        match &crs {
            None => crs = Some(found.clone()),
            Some(first) if !same_plane(first, found) => {
                let message = format!(
                    "its coordinate reference system is {found}, the scene's is {first}: check that they lie to each other as they should"
                );
                let place = Place { file: source.file.clone(), ..Place::default() };
                log.warn("files in another reference system", place, message);
            }
            Some(_) => {}
        }
    }
    Ok(crs)
}

/// The last number in a name such as `EPSG:28992` or `https://…/EPSG/0/7415`.
fn epsg(crs: &str) -> Option<u32> {
    crs.rsplit(|c: char| !c.is_ascii_digit()).find(|part| !part.is_empty())?.parse().ok()
}

fn is_geographic(crs: &str) -> bool {
    let known = [4326, 4979, 4258, 4937, 4269, 6318];
    crs.to_ascii_uppercase().contains("EPSG") && epsg(crs).is_some_and(|code| known.contains(&code))
        || crs.to_ascii_uppercase().contains("CRS84")
}

/// Whether two names mean the same plane coordinates; compound systems count as their plane part.
fn same_plane(a: &str, b: &str) -> bool {
    let plane = |crs| match epsg(crs) {
        Some(7415) => Some(28992),
        Some(5554) => Some(25831),
        Some(5555) => Some(25832),
        Some(5556) => Some(25833),
        other => other,
    };
    a == b || (plane(a).is_some() && plane(a) == plane(b))
}

/// Moves and turns the draft's points.
pub(super) fn place(
    scene: &SceneSpec,
    sources: &[Source],
    north_deg: f64,
    draft: &mut Draft,
) -> Result<Placement, Error> {
    let origin = match scene.origin {
        Origin::At(origin) => origin,
        Origin::Auto => auto_origin(sources)?,
    };
    let turn = turn(north_deg);
    let shift: Vec<DVec3> =
        sources.iter().map(|s| if s.is_city { origin } else { DVec3::ZERO }).collect();
    for (source, shift) in sources.iter().zip(&shift) {
        let Some([min, max]) = source.extent_m else { continue };
        let reach_m = (min - shift).abs().max((max - shift).abs()).max_element();
        if reach_m > MAX_REACH_M {
            return Err(Error::FarFromOrigin {
                path: source.file.clone(),
                reach_m,
                limit_m: MAX_REACH_M,
                hint: if source.is_city {
                    "check [scene] origin, and that all files lie in one place"
                } else {
                    "Radiance files are local; move the scene near the origin (xform -t)"
                },
            });
        }
    }
    // Points lie in the order of the files, but rings of dropped surfaces lie among them: every
    // surface moves its own.
    let Draft { points, rings, surfaces, .. } = draft;
    for surface in surfaces.iter() {
        let shift = shift[surface.source as usize];
        let mut local = |range: &std::ops::Range<u32>| {
            for p in &mut points[range.start as usize..range.end as usize] {
                *p = turn * (*p - shift);
            }
        };
        match &surface.shape {
            Shape::Planar(range) => {
                rings[range.start as usize..range.end as usize].iter().for_each(&mut local);
            }
            Shape::Curved(range) | Shape::Flat(range) => local(range),
        }
    }
    Ok(Placement { origin, north_deg })
}

fn auto_origin(sources: &[Source]) -> Result<DVec3, Error> {
    let cities = || sources.iter().filter(|s| s.is_city && s.extent_m.is_some());
    let extent = cities()
        .filter_map(|s| s.extent_m)
        .reduce(|[min, max], [low, high]| [min.min(low), max.max(high)]);
    let Some([min, max]) = extent else { return Ok(DVec3::ZERO) };
    let plane = |p: DVec3| p.x.abs().max(p.y.abs());
    if plane(min).max(plane(max)) <= LOCAL_REACH_M {
        return Ok(DVec3::ZERO);
    }
    let middle = (min + max) * 0.5;
    let locals = || sources.iter().find(|s| !s.is_city && s.extent_m.is_some());
    if let (Some(city), Some(local)) = (cities().next(), locals()) {
        return Err(Error::MixedCoordinates {
            city: city.file.clone(),
            local: local.file.clone(),
            x: middle.x,
            y: middle.y,
        });
    }
    Ok(DVec3::new(middle.x.round(), middle.y.round(), min.z.floor()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn true_north_becomes_the_y_axis() {
        let origin = DVec3::new(100.0, 200.0, 5.0);
        // North 90 degrees clockwise of y is the map's +x.
        let north = local_from_map(origin + DVec3::X, origin, 90.0);
        assert!((north - DVec3::Y).length() < 1e-12, "{north}");
        let p = DVec3::new(3.0, -4.0, 7.0);
        let back = map_from_local(local_from_map(p, origin, 33.0), origin, 33.0);
        assert!((back - p).length() < 1e-12);
    }

    /// Against PROJ 9 (`pyproj`, `Proj(crs).get_factors(longitude,
    /// latitude).meridian_convergence`).
    #[test]
    fn grid_convergence_is_that_of_proj() {
        for (crs, latitude, longitude, convergence) in PROJ {
            let north = true_north_deg(crs, latitude, longitude).unwrap();
            assert!((north + convergence).abs() < 3e-4, "{crs} at {latitude} {longitude}: {north}");
        }
        assert_eq!(true_north_deg(28992, 52.156_160_555_555_55, 5.387_638_888_888_889), Some(-0.0));
        assert_eq!(true_north_deg(3035, 47.0, 8.0), None);
    }

    const PROJ: [(u32, f64, f64, f64); 26] = [
        (2056, 47.4, 8.55, 0.81148),
        (2056, 46.2, 6.1, -0.97899),
        (21781, 46.8, 10.3, 2.08995),
        (28992, 51.9062, 4.4593, -0.73186),
        (28992, 53.2, 6.6, 0.96417),
        (28992, 50.85, 5.7, 0.24448),
        (32632, 47.4, 8.55, -0.33125),
        (32633, 48.2, 16.4, 1.04376),
        (25832, 52.5, 6.6, -1.90446),
        (32733, -33.9, 18.4, -1.89789),
        (31467, 48.8, 9.2, 0.15048),
        (31256, 48.2, 16.37, 0.02733),
        (27700, 51.5, -0.1, 1.48717),
        (27700, 57.0, -6.0, -3.35631),
        (2154, 45.8, 4.8, 1.30609),
        (2157, 53.3, -6.3, 1.36316),
        (3006, 59.3, 18.0, 2.58017),
        (3067, 60.2, 25.0, -1.73571),
        (2180, 52.2, 21.0, 1.58055),
        (3794, 46.05, 14.5, -0.35998),
        (3765, 45.8, 16.0, -0.35846),
        (4647, 53.5, 10.0, 0.80389),
        (5555, 50.0, 8.0, -0.76608),
        (26918, 40.7, -74.0, 0.65214),
        (3045, 48.2, 16.4, 1.04376),
        (31258, 47.0, 15.4, 1.51177),
    ];

    #[test]
    fn names_of_reference_systems() {
        assert_eq!(epsg("EPSG:28992"), Some(28992));
        assert_eq!(epsg("https://www.opengis.net/def/crs/EPSG/0/7415"), Some(7415));
        assert_eq!(epsg("urn:ogc:def:crs:EPSG::2056"), Some(2056));
        assert_eq!(epsg("local"), None);
        assert!(same_plane("EPSG:28992", "urn:ogc:def:crs:EPSG::7415"));
        assert!(!same_plane("EPSG:28992", "EPSG:2056") && !same_plane("here", "there"));
        assert!(is_geographic("urn:ogc:def:crs:OGC:1.3:CRS84") && is_geographic("EPSG:4326"));
        assert!(!is_geographic("EPSG:28992"));
    }
}
