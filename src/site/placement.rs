use glam::{DMat3, DVec3};

use super::draft::{Draft, Shape};
use super::load::Source;
use super::log::Log;
use super::{Error, Origin, SceneSpec};
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

/// Moves and turns the draft's points; returns the map coordinates of the local origin.
pub(super) fn place(
    scene: &SceneSpec,
    sources: &[Source],
    draft: &mut Draft,
) -> Result<DVec3, Error> {
    let origin = match scene.origin {
        Origin::At(origin) => origin,
        Origin::Auto => auto_origin(sources)?,
    };
    let turn = turn(scene.north_deg);
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
    Ok(origin)
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
