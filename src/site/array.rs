//! Rows of modules on a roof or a field where no panel is modelled.
//!
//! A planner has an outline, a tilt and a pitch long before anyone draws modules. Seen from above a
//! row is a strip; cutting the outline's triangles at the strip's two edges and raising what is
//! left gives the row, however the outline looks.

use glam::{DVec2, DVec3};

use super::clip::{fan, half};
use super::draft::{Draft, Surface};
use super::placement::Placement;
use super::source::Source;
use super::spec::ARRAY_KIND;
use super::{Error, Object, PvArray};
use crate::base::limits;

/// Steepest row, degrees: above it a row covers next to nothing of the ground.
const STEEPEST_DEG: f64 = 85.0;

/// Adds the rows of an array to the draft, which is in local coordinates by now.
pub(super) fn add(
    (name, array): &(String, PvArray),
    placement: &Placement,
    (source, material): (u32, u32),
    draft: &mut Draft,
) -> Result<Source, Error> {
    let rows = rows(name, array, placement)?;
    let object = draft.objects.len() as u32;
    draft.objects.push(Object { id: name.clone(), kind: ARRAY_KIND.to_owned() });
    let full = |_| Error::TooManyTriangles { limit: limits::MAX_TRIANGLES };
    for row in &rows {
        let shape = draft.add_flat(row.as_flattened().iter().copied()).map_err(full)?;
        let surface = Surface { shape, object, material, modifier: None, source, line: 0 };
        draft.add_surface(surface).map_err(full)?;
    }
    Ok(Source { objects: 1, ..Source::named(&format!("[[pv]] {name}"), "PV array") })
}

/// The rows' triangles, the southernmost (that which faces the azimuth) first.
///
/// Seen from above a row is a strip as deep as a module's length times the cosine of the tilt, cut
/// at the polygon; the next one begins `row_pitch_m` behind. A row that doesn't find its whole
/// depth is left out.
fn rows(name: &str, array: &PvArray, placement: &Placement) -> Result<Vec<Vec<[DVec3; 3]>>, Error> {
    let wrong = |key, found: String, expected| Error::Array {
        entry: name.to_owned(),
        key,
        found,
        expected,
    };
    let number = |key, value: f64, range: std::ops::RangeInclusive<f64>, expected| {
        if range.contains(&value) { Ok(()) } else { Err(wrong(key, value.to_string(), expected)) }
    };
    number("tilt_deg", array.tilt_deg, 0.0..=STEEPEST_DEG, "degrees from 0 (level) to 85")?;
    number("azimuth_deg", array.azimuth_deg, -360.0..=360.0, "degrees clockwise from north")?;
    number("height_m", array.height_m, -1e5..=1e5, "the height of the rows' lower edge, m")?;
    number("module_m", array.module_m, 1e-3..=1e4, "a module's length along the slope, m")?;
    let (sin, cos) = libm::sincos(array.tilt_deg.to_radians());
    let depth_m = array.module_m * cos;
    if !(depth_m..=1e6).contains(&array.row_pitch_m) {
        let found = array.row_pitch_m.to_string();
        return Err(wrong(
            "row_pitch_m",
            found,
            "at least the depth of a row: module_m * cos(tilt_deg)",
        ));
    }
    let count = array.polygon.len();
    let region = Some(placement.region(&array.polygon, array.coordinates))
        .filter(|_| count <= limits::MAX_POLYGON_VERTICES)
        .flatten();
    let expected = "at least three points [x, y] around an area, in metres";
    let region = region.ok_or_else(|| wrong("polygon", format!("{count} points"), expected))?;
    // Up the slope, away from where the rows face; and along them.
    let (east, north) = libm::sincos(array.azimuth_deg.to_radians());
    let back = -DVec2::new(east, north);
    let uphill = |p: DVec2| p.dot(back);
    let points = || region.triangles().iter().flatten().map(|&p| uphill(p));
    let (first, last) =
        (points().fold(f64::INFINITY, f64::min), points().fold(f64::NEG_INFINITY, f64::max));
    let most = (last - first - depth_m) / array.row_pitch_m;
    if most >= limits::MAX_PV_SURFACES as f64 {
        let expected = "a pitch that makes fewer than 65,535 rows";
        return Err(wrong("row_pitch_m", array.row_pitch_m.to_string(), expected));
    }
    let foot_m = placement.local_height(array.height_m, array.coordinates);
    let mut out = Vec::new();
    for row in 0.. {
        let low = first + f64::from(row) * array.row_pitch_m;
        if low + depth_m > last + 1e-6 {
            break;
        }
        let mut triangles = Vec::new();
        for part in region.triangles() {
            let part = part.map(|p| p.extend(0.0));
            let beyond = half(&part, |p| uphill(p.truncate()) - low);
            let strip = half(&beyond, |p| low + depth_m - uphill(p.truncate()));
            let raised: Vec<DVec3> = strip
                .iter()
                .map(|p| p.truncate().extend(foot_m + (uphill(p.truncate()) - low) * (sin / cos)))
                .collect();
            fan(&raised, &mut triangles);
        }
        if !triangles.is_empty() {
            out.push(triangles);
        }
    }
    if out.is_empty() {
        let found = format!("{:.2} m from front to back", last - first);
        return Err(wrong("polygon", found, "room for one row: module_m * cos(tilt_deg)"));
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::site::Coordinates;

    fn array() -> PvArray {
        PvArray {
            polygon: vec![[0., 0.], [20., 0.], [20., 10.], [10., 10.], [10., 5.], [0., 5.]],
            coordinates: Coordinates::Local,
            tilt_deg: 30.0,
            azimuth_deg: 180.0,
            height_m: 4.0,
            row_pitch_m: 2.0,
            module_m: 1.0,
        }
    }

    fn area(triangles: &[[DVec3; 3]]) -> DVec3 {
        triangles.iter().map(|[a, b, c]| (b - a).cross(c - a) * 0.5).sum()
    }

    #[test]
    fn rows_fill_the_polygon() {
        let rows = rows("a", &array(), &Placement::default()).unwrap();
        // At y 0, 2, 4 over the whole width (the third to 4.87), then at 6 and 8 on the right half.
        let areas: Vec<f64> = rows.iter().map(|r| area(r).length()).collect();
        assert_eq!(areas.len(), 5);
        for (found, wanted) in areas.iter().zip([20.0, 20.0, 20.0, 10.0, 10.0]) {
            assert!((found - wanted).abs() < 1e-9, "{areas:?}");
        }
        for (k, row) in rows.iter().enumerate() {
            let normal = area(row).normalize();
            assert!((normal - DVec3::new(0.0, -0.5, 0.75f64.sqrt())).length() < 1e-9, "{normal}");
            for p in row.iter().flatten() {
                let up = (p.y - 2.0 * k as f64) * (1.0 / 3f64.sqrt());
                assert!((p.z - 4.0 - up).abs() < 1e-9 && p.z < 4.5 + 1e-9);
            }
        }
    }

    #[test]
    fn what_makes_no_array_is_named() {
        let ask = |change: fn(&mut PvArray)| {
            let mut array = array();
            change(&mut array);
            rows("east", &array, &Placement::default()).unwrap_err().to_string()
        };
        for (message, key) in [
            (ask(|a| a.tilt_deg = 90.0), "tilt_deg = 90"),
            (ask(|a| a.row_pitch_m = 0.5), "row_pitch_m = 0.5"),
            (ask(|a| a.row_pitch_m = f64::NAN), "row_pitch_m = NaN"),
            (ask(|a| (a.row_pitch_m, a.module_m) = (1e-4, 1e-4)), "module_m = 0.0001"),
            (ask(|a| a.polygon.truncate(2)), "polygon = 2 points"),
            (ask(|a| a.polygon[0] = [f64::NAN, 0.0]), "polygon = 6 points"),
            (ask(|a| (a.module_m, a.row_pitch_m) = (30.0, 40.0)), "10.00 m from front to back"),
        ] {
            assert!(message.contains(key) && message.contains("[[pv]] east"), "{message}");
        }
    }
}
