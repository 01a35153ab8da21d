//! Which faces are PV: the conditions of a `[[pv]]` entry, and what to say where nothing fits.
//!
//! An entry that selects nothing is the commonest mistake of a first project. So the answer to it
//! names what is there instead: near names, the areas behind each, or the tilts and azimuths of the
//! faces that fulfil all but the orientation.

use std::collections::BTreeMap;
use std::fmt::Write;

use glam::DVec3;

use super::clip::Region;
use super::draft::{Draft, Shape, Surface};
use super::placement::Placement;
use super::{Coordinates, Error, PvSpec, PvSurface, Select};
use crate::base::limits;

/// A normal's vertical component below which a front looks down.
const DOWN: f64 = -1e-3;
/// A normal's horizontal component below which it has no compass direction.
const LEVEL: f64 = 1e-6;
/// How many names an error lists.
const LISTED: usize = 12;

/// Angle between a unit normal and the vertical, degrees: 0 faces up, 90 is a wall.
pub fn tilt_deg(normal: DVec3) -> f64 {
    // atan2 is exact near 0, acos isn't.
    libm::atan2(libm::hypot(normal.x, normal.y), normal.z).to_degrees()
}

/// Compass direction that a normal faces, degrees clockwise from north (+y) in 0..360; `None` where
/// it is vertical.
pub fn azimuth_deg(normal: DVec3) -> Option<f64> {
    (libm::hypot(normal.x, normal.y) > LEVEL)
        .then(|| libm::atan2(normal.x, normal.y).to_degrees().rem_euclid(360.0))
}

/// A surface that was kept, in local coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    /// Index into the draft's surfaces.
    pub surface: u32,
    /// Unit normal; of no meaning where curved.
    pub normal: DVec3,
    pub area_m2: f64,
    /// Its triangles.
    pub first_triangle: u32,
    pub triangles: u32,
    /// The entry within whose polygon it lies; faces are cut at polygons.
    pub part: Option<usize>,
}

/// The polygon of an entry.
pub(super) struct Cut<'a> {
    /// Index of the entry.
    pub entry: usize,
    pub matcher: Matcher<'a>,
    pub region: Region,
}

/// The polygons of entries that have one.
pub(super) fn cuts<'a>(
    draft: &'a Draft,
    entries: &'a [PvSpec],
    placement: &Placement,
) -> Result<Vec<Cut<'a>>, Error> {
    let mut out = Vec::new();
    for (number, entry) in entries.iter().enumerate() {
        let Some(polygon) = &entry.select.polygon else { continue };
        let points = polygon.len();
        let wrong = || Error::Polygon { entry: entry.name.clone(), points };
        let region = (points <= limits::MAX_POLYGON_VERTICES)
            .then(|| placement.region(polygon, entry.select.coordinates))
            .flatten()
            .ok_or_else(wrong)?;
        out.push(Cut { entry: number, matcher: Matcher::new(draft, &entry.select), region });
    }
    Ok(out)
}

/// The PV surfaces that the entries select, in the order of entries and faces; sets `pv` on none of
/// the faces, the caller does. Candidates are in the order of faces.
pub(super) fn select(
    draft: &Draft,
    candidates: &[Candidate],
    entries: &[PvSpec],
) -> Result<Vec<(usize, PvSurface)>, Error> {
    let mut owner: BTreeMap<usize, usize> = BTreeMap::new();
    let mut out = Vec::new();
    for (e, entry) in entries.iter().enumerate() {
        check(entry)?;
        let matcher = Matcher::new(draft, &entry.select);
        let takes = |c: &Candidate| match entry.select.polygon {
            Some(_) => c.part == Some(e),
            None => matcher.takes(c.surface, c.normal),
        };
        let chosen: Vec<usize> = (0..candidates.len()).filter(|&i| takes(&candidates[i])).collect();
        if chosen.is_empty() {
            return Err(Error::NothingSelected {
                entry: entry.name.clone(),
                select: spelt(&entry.select),
                found: alternatives(&matcher, candidates),
            });
        }
        if out.len() + chosen.len() > limits::MAX_PV_SURFACES {
            let found = out.len() + chosen.len();
            return Err(Error::TooManyPv { found, limit: limits::MAX_PV_SURFACES });
        }
        faces_up(draft, candidates, entry, &chosen)?;
        for (n, &i) in chosen.iter().enumerate() {
            if let Some(&first) = owner.get(&i) {
                return Err(Error::SelectedTwice {
                    what: describe(draft, &candidates[i]),
                    first: entries[first].name.clone(),
                    second: entry.name.clone(),
                });
            }
            owner.insert(i, e);
            let c = &candidates[i];
            let name = match chosen.len() {
                1 => entry.name.clone(),
                _ => format!("{}/{}", entry.name, n + 1),
            };
            out.push((
                i,
                PvSurface {
                    name,
                    entry: e,
                    triangles: (c.first_triangle..c.first_triangle + c.triangles).collect(),
                    normal: c.normal,
                    area_m2: c.area_m2,
                    two_sided: entry.two_sided,
                },
            ));
        }
    }
    Ok(out)
}

fn check(entry: &PvSpec) -> Result<(), Error> {
    let s = &entry.select;
    if s.is_empty() {
        return Err(Error::SelectEmpty { entry: entry.name.clone() });
    }
    let tilts = [("min_tilt_deg", s.min_tilt_deg), ("max_tilt_deg", s.max_tilt_deg)];
    for (key, value) in tilts {
        if let Some(v) = value.filter(|v| !(0.0..=180.0).contains(v)) {
            let expected = "degrees from 0 (facing up) to 180";
            return Err(Error::Value { key, found: v.to_string(), expected });
        }
    }
    match s.azimuth_deg {
        Some(range) if range.iter().any(|a| !(-360.0..=360.0).contains(a)) => Err(Error::Value {
            key: "azimuth_deg",
            found: format!("{range:?}"),
            expected: "two compass directions, degrees clockwise from north",
        }),
        _ => Ok(()),
    }
}

/// Refuses curved faces and fronts that look down.
fn faces_up(
    draft: &Draft,
    candidates: &[Candidate],
    entry: &PvSpec,
    chosen: &[usize],
) -> Result<(), Error> {
    let mut down = Vec::new();
    for &i in chosen {
        let c = &candidates[i];
        if matches!(draft.surfaces[c.surface as usize].shape, Shape::Curved(_)) {
            let what = describe(draft, c);
            return Err(Error::PvCurved { entry: entry.name.clone(), what });
        }
        if c.normal.z < DOWN && !entry.two_sided {
            down.push(format!("{} (tilt {:.1} degrees)", describe(draft, c), tilt_deg(c.normal)));
        }
    }
    if down.is_empty() {
        return Ok(());
    }
    Err(Error::PvFacesDown {
        entry: entry.name.clone(),
        count: down.len(),
        examples: some(&down, 5),
    })
}

fn describe(draft: &Draft, c: &Candidate) -> String {
    let surface = &draft.surfaces[c.surface as usize];
    let object = &draft.objects[surface.object as usize];
    let line = if surface.line > 0 { format!(", line {}", surface.line) } else { String::new() };
    format!("{} `{}`{line}, {:.2} m2", object.kind, object.id, c.area_m2)
}

pub(super) struct Matcher<'a> {
    draft: &'a Draft,
    select: &'a Select,
    /// The object and its parts.
    ids: Option<std::collections::HashSet<&'a str>>,
}

impl<'a> Matcher<'a> {
    fn new(draft: &'a Draft, select: &'a Select) -> Self {
        let ids = select.object.as_deref().map(|id| draft.with_parts(id).into_iter().collect());
        Self { draft, select, ids }
    }

    /// Whether it takes a surface with this normal, wherever it lies.
    pub fn takes(&self, surface: u32, normal: DVec3) -> bool {
        self.named(surface) && self.oriented(normal)
    }

    /// The conditions on names.
    fn named(&self, surface: u32) -> bool {
        let surface = &self.draft.surfaces[surface as usize];
        let object = &self.draft.objects[surface.object as usize];
        let is = |wanted: &Option<String>, name: Option<&str>| {
            wanted.as_deref().is_none_or(|w| name == Some(w))
        };
        is(&self.select.modifier, modifier(self.draft, surface))
            && is(&self.select.material, Some(material(self.draft, surface)))
            && is(&self.select.surface, Some(&object.kind))
            && self.ids.as_ref().is_none_or(|ids| ids.contains(object.id.as_str()))
    }

    /// The conditions on the normal.
    fn oriented(&self, normal: DVec3) -> bool {
        let s = self.select;
        if s.min_tilt_deg.is_none() && s.max_tilt_deg.is_none() && s.azimuth_deg.is_none() {
            return true;
        }
        let tilt = tilt_deg(normal);
        s.min_tilt_deg.is_none_or(|least| tilt >= least)
            && s.max_tilt_deg.is_none_or(|most| tilt <= most)
            && s.azimuth_deg
                .is_none_or(|range| azimuth_deg(normal).is_some_and(|a| within(a, range)))
    }
}

/// Whether a direction lies on the way clockwise from the first to the second.
fn within(azimuth_deg: f64, [from, to]: [f64; 2]) -> bool {
    if to - from >= 360.0 {
        return true;
    }
    (azimuth_deg - from).rem_euclid(360.0) <= (to - from).rem_euclid(360.0)
}

fn modifier<'a>(draft: &'a Draft, surface: &Surface) -> Option<&'a str> {
    surface.modifier.map(|m| draft.modifiers[m as usize].as_str())
}

fn material<'a>(draft: &'a Draft, surface: &Surface) -> &'a str {
    &draft.materials[surface.material as usize].name
}

/// Says what there is instead: about the first condition that nothing fulfils alone, else about
/// their combination.
fn alternatives(matcher: &Matcher<'_>, candidates: &[Candidate]) -> String {
    let Matcher { draft, select, .. } = *matcher;
    let surface = |c: &Candidate| &draft.surfaces[c.surface as usize];
    let object = |c: &Candidate| &draft.objects[surface(c).object as usize];
    if let Some(name) = &select.modifier {
        let names = tally(candidates, |c| modifier(draft, surface(c)));
        if !names.contains_key(name.as_str()) {
            return listed("modifiers", name, &names);
        }
    }
    if let Some(name) = &select.material {
        let names = tally(candidates, |c| Some(material(draft, surface(c))));
        if !names.contains_key(name.as_str()) {
            return listed("materials", name, &names);
        }
    }
    if let Some(id) = &select.object {
        let names = tally(candidates, |c| Some(object(c).id.as_str()));
        if !names.keys().any(|k| matcher.ids.as_ref().is_some_and(|ids| ids.contains(k))) {
            return no_object(draft, id, &names);
        }
    }
    if let Some(kind) = &select.surface {
        let names = tally(candidates, |c| Some(object(c).kind.as_str()));
        if !names.contains_key(kind.as_str()) {
            return listed("surface types", kind, &names);
        }
    }
    combination(matcher, candidates)
}

fn combination(matcher: &Matcher<'_>, candidates: &[Candidate]) -> String {
    let named: Vec<&Candidate> = candidates.iter().filter(|c| matcher.named(c.surface)).collect();
    if named.is_empty() {
        return "each name is there, but no face has all of them: leave one out".to_owned();
    }
    if let Some(polygon) = &matcher.select.polygon
        && named.iter().any(|c| matcher.oriented(c.normal))
    {
        return beside(polygon, matcher.select.coordinates);
    }
    let mut faces: Vec<String> = Vec::new();
    let mut sorted = named.clone();
    sorted.sort_by(|a, b| b.area_m2.total_cmp(&a.area_m2));
    for c in sorted.iter().take(LISTED) {
        let azimuth =
            azimuth_deg(c.normal).map_or_else(|| "none".to_owned(), |a| format!("{a:.0}"));
        faces.push(format!(
            "tilt {:.0} azimuth {azimuth} ({:.1} m2)",
            tilt_deg(c.normal),
            c.area_m2
        ));
    }
    format!(
        "{} faces have the names, but not the tilt or azimuth; theirs are, largest first: {}",
        named.len(),
        with_rest(&faces, named.len())
    )
}

/// What to say where all conditions but the polygon are fulfilled.
fn beside(polygon: &[[f64; 2]], coordinates: Coordinates) -> String {
    let range = |k: usize| {
        let values = || polygon.iter().map(|p| p[k]);
        let (low, high) =
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        format!("{low} to {high}")
    };
    let hint = match coordinates {
        Coordinates::Local => {
            "it counts from the local origin; add coordinates = \"map\" where it holds map coordinates"
        }
        Coordinates::Map => "compare it with the extent that `glintmap check` prints",
    };
    format!(
        "faces have the names and directions, but none lies in the polygon (x {}, y {}): {hint}",
        range(0),
        range(1)
    )
}

/// Number of faces and area of each name.
fn tally<'a>(
    candidates: &[Candidate],
    name: impl Fn(&Candidate) -> Option<&'a str>,
) -> BTreeMap<&'a str, (usize, f64)> {
    let mut out: BTreeMap<&str, (usize, f64)> = BTreeMap::new();
    for c in candidates {
        if let Some(name) = name(c) {
            let entry = out.entry(name).or_default();
            entry.0 += 1;
            entry.1 += c.area_m2;
        }
    }
    out
}

fn listed(what: &str, wanted: &str, names: &BTreeMap<&str, (usize, f64)>) -> String {
    if names.is_empty() {
        return format!("the scene has no {what} at all (they come from Radiance files)");
    }
    let mut rows: Vec<_> = names.iter().collect();
    rows.sort_by(|a, b| b.1.1.total_cmp(&a.1.1).then(a.0.cmp(b.0)));
    let shown: Vec<String> = rows
        .iter()
        .take(LISTED)
        .map(|(name, (faces, area))| format!("{name} ({faces} faces, {area:.1} m2)"))
        .collect();
    format!(
        "{}the {what} are: {}",
        meant(wanted, names.keys().copied()),
        with_rest(&shown, rows.len())
    )
}

fn no_object(draft: &Draft, id: &str, names: &BTreeMap<&str, (usize, f64)>) -> String {
    if draft.objects.iter().any(|o| o.id == id) || draft.children.contains_key(id) {
        return format!("object `{id}` is there, but has no usable face");
    }
    let first: Vec<String> = names.keys().take(5).map(|k| (*k).to_owned()).collect();
    format!(
        "{}there are {} objects with faces: {}",
        meant(id, names.keys().copied()),
        names.len(),
        with_rest(&first, names.len())
    )
}

/// `did you mean …?`, where a name is near enough.
fn meant<'a>(wanted: &str, names: impl Iterator<Item = &'a str>) -> String {
    let mut near: Vec<(f64, &str)> = names
        .map(|n| (strsim::jaro_winkler(&n.to_lowercase(), &wanted.to_lowercase()), n))
        .filter(|(score, _)| *score > 0.85)
        .collect();
    near.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(b.1)));
    match near.first() {
        Some((_, name)) => format!("did you mean `{name}`? "),
        None => String::new(),
    }
}

fn some(items: &[String], most: usize) -> String {
    with_rest(&items[..items.len().min(most)], items.len())
}

fn with_rest(shown: &[String], count: usize) -> String {
    let mut out = shown.join(", ");
    if count > shown.len() {
        let _ = write!(out, " and {} more", count - shown.len());
    }
    out
}

fn spelt(select: &Select) -> String {
    let texts = [
        ("modifier", &select.modifier),
        ("material", &select.material),
        ("object", &select.object),
        ("surface", &select.surface),
    ];
    let mut out: Vec<String> = texts
        .iter()
        .filter_map(|(key, value)| value.as_ref().map(|v| format!("{key} = \"{v}\"")))
        .collect();
    let tilts = [("min_tilt_deg", select.min_tilt_deg), ("max_tilt_deg", select.max_tilt_deg)];
    out.extend(tilts.iter().filter_map(|(key, v)| v.map(|v| format!("{key} = {v}"))));
    out.extend(select.azimuth_deg.map(|[a, b]| format!("azimuth_deg = [{a}, {b}]")));
    out.extend(select.polygon.as_ref().map(|p| format!("polygon = {} points", p.len())));
    format!("{{ {} }}", out.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tilt_and_azimuth_are_compass_terms() {
        assert_eq!(tilt_deg(DVec3::Z), 0.0);
        assert_eq!(tilt_deg(DVec3::X), 90.0);
        assert_eq!(tilt_deg(DVec3::NEG_Z), 180.0);
        assert_eq!(azimuth_deg(DVec3::Z), None);
        for (normal, azimuth) in
            [(DVec3::Y, 0.0), (DVec3::X, 90.0), (DVec3::NEG_Y, 180.0), (DVec3::NEG_X, 270.0)]
        {
            assert!((azimuth_deg(normal).unwrap() - azimuth).abs() < 1e-12);
        }
        // The paper's slope of 27 %.
        let slope = DVec3::new(-0.27, 0.0, 1.0).normalize();
        assert!((tilt_deg(slope) - libm::atan(0.27).to_degrees()).abs() < 1e-12);
    }

    #[test]
    fn azimuth_ranges_may_cross_north() {
        assert!(within(350.0, [315.0, 45.0]) && within(10.0, [315.0, 45.0]));
        assert!(!within(180.0, [315.0, 45.0]) && within(10.0, [-45.0, 45.0]));
        assert!(within(180.0, [0.0, 360.0]) && within(0.0, [0.0, 360.0]));
        assert!(within(90.0, [90.0, 90.0]) && !within(91.0, [90.0, 90.0]));
    }
}
