//! What was understood, and what looks wrong, in words for a person: `glintmap check` and `new`.

use std::collections::{BTreeMap, HashMap};
use std::fmt;

use glam::{DVec3, Vec3};

use super::{Loaded, North, Site, Source, azimuth_deg, tilt_deg};
use crate::base::{Aabb, Finding, Place, Severity};

/// How far from the PV ground is looked for, m: the paper's path limit.
const REACH_M: f64 = 100.0;

/// Points along one edge of the square in which ground is looked for.
const PROBES: usize = 48;
/// PV surfaces around which it is looked for; the largest ones.
const PROBED_PV: usize = 8;
/// Share of missing ground that is worth a warning.
const MISSING_SHARE: f64 = 0.02;
/// Extents outside look like another unit than metres, m.
const LIKELY_SIZE_M: std::ops::RangeInclusive<f32> = 5.0..=100_000.0;
/// Further from everything else the PV isn't part of the scene, m.
const FAR_M: f32 = 1000.0;

/// PV surfaces that the text lists.
const LISTED_PV: usize = 20;

/// What a scene is.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Summary {
    /// The files, where they are known.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub files: Vec<Source>,
    /// Named things with a face.
    pub objects: usize,
    /// Surfaces.
    pub faces: usize,
    /// Triangles.
    pub triangles: usize,
    /// Coordinate reference system of map coordinates.
    pub crs: Option<String>,
    /// Map coordinates of the local origin, m.
    pub origin_m: DVec3,
    /// Where true north lies in the files' coordinates.
    pub north: North,
    /// Extent, metres from the local origin.
    pub extent_m: Aabb,
    /// Surfaces by what the source says they are, and by material.
    pub kinds: Vec<Kind>,
    /// The PV.
    pub pv: Vec<Pv>,
    /// What looks wrong; what was noticed while reading lies in [`Site::findings`].
    pub doubts: Vec<Finding>,
}

/// Surfaces of one kind and material.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Kind {
    /// `RoofSurface`, `polygon`.
    pub kind: String,
    /// Their material.
    pub material: String,
    /// How many there are.
    pub faces: usize,
    /// Their area, m2.
    pub area_m2: f64,
}

/// A PV surface.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Pv {
    /// Its name.
    pub name: String,
    /// The object that it is part of.
    pub object: String,
    /// Area, m2.
    pub area_m2: f64,
    /// Angle between its normal and the vertical, degrees.
    pub tilt_deg: f64,
    /// Compass direction that it faces, degrees clockwise from north.
    pub azimuth_deg: Option<f64>,
    /// Centre of its area, metres from the local origin.
    pub centre_m: DVec3,
}

/// Sums up a scene.
pub fn summarise(site: &Site) -> Summary {
    let used: std::collections::HashSet<u32> = site.faces.iter().map(|f| f.object).collect();
    Summary {
        files: Vec::new(),
        objects: used.len(),
        faces: site.faces.len(),
        triangles: site.triangles.len(),
        crs: None,
        origin_m: site.origin,
        north: North::default(),
        extent_m: site.bounds,
        kinds: kinds(site),
        pv: (0..site.pv.len()).map(|i| pv(site, i)).collect(),
        doubts: doubts(site, REACH_M),
    }
}

/// Sums up a scene and its files.
pub fn summarise_loaded(loaded: &Loaded) -> Summary {
    let (files, crs) = (loaded.sources.clone(), loaded.crs.clone());
    Summary { files, crs, north: loaded.north.clone(), ..summarise(&loaded.site) }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (min, size, o) = (self.extent_m.min, self.extent_m.size(), self.origin_m);
        writeln!(
            f,
            "{} objects, {} faces, {} triangles",
            self.objects, self.faces, self.triangles
        )?;
        writeln!(
            f,
            "extent {:.1} x {:.1} x {:.1} m, from ({:.1}, {:.1}, {:.1}) local",
            size.x, size.y, size.z, min.x, min.y, min.z
        )?;
        if o == DVec3::ZERO {
            writeln!(f, "local origin = the files' own")?;
        } else {
            write!(f, "local origin = map ({:.3}, {:.3}, {:.3})", o.x, o.y, o.z)?;
            writeln!(f, "{}", self.crs.as_ref().map_or_else(String::new, |c| format!(", {c}")))?;
        }
        writeln!(f, "true north: {}", self.north)?;
        writeln!(f, "\nsurfaces")?;
        for k in &self.kinds {
            writeln!(
                f,
                "  {:<24} {:<20} {:>8} faces {:>12.1} m2",
                k.kind, k.material, k.faces, k.area_m2
            )?;
        }
        writeln!(f, "\nPV ({} surfaces)", self.pv.len())?;
        for p in self.pv.iter().take(LISTED_PV) {
            let azimuth =
                p.azimuth_deg.map_or_else(|| "   level".to_owned(), |a| format!("{a:>8.1}"));
            writeln!(
                f,
                "  {:<24} {:>9.2} m2, tilt {:>5.1}, azimuth {azimuth}, centre ({:.1}, {:.1}, {:.1})",
                p.name, p.area_m2, p.tilt_deg, p.centre_m.x, p.centre_m.y, p.centre_m.z
            )?;
        }
        if self.pv.len() > LISTED_PV {
            writeln!(f, "  … and {} more", self.pv.len() - LISTED_PV)?;
        }
        if !self.doubts.is_empty() {
            writeln!(f)?;
        }
        self.doubts.iter().try_for_each(|doubt| writeln!(f, "{doubt}"))
    }
}

fn kinds(site: &Site) -> Vec<Kind> {
    let mut areas: BTreeMap<(&str, &str), (usize, f64)> = BTreeMap::new();
    let mut last = None;
    for t in &site.triangles {
        let face = &site.faces[t.face as usize];
        let key = (
            site.objects[face.object as usize].kind.as_str(),
            site.materials[face.material as usize].name.as_str(),
        );
        let entry = areas.entry(key).or_default();
        // Triangles of a face lie side by side.
        entry.0 += usize::from(last != Some(t.face));
        entry.1 += f64::from(t.area_m2());
        last = Some(t.face);
    }
    let named = |((kind, material), (faces, area_m2)): ((&str, &str), (usize, f64))| Kind {
        kind: kind.to_owned(),
        material: material.to_owned(),
        faces,
        area_m2,
    };
    areas.into_iter().map(named).collect()
}

fn pv(site: &Site, i: usize) -> Pv {
    let surface = &site.pv[i];
    let object = surface.triangles.first().map(|&t| site.face_of(t).object);
    Pv {
        name: surface.name.clone(),
        object: object.map_or_else(String::new, |o| site.objects[o as usize].id.clone()),
        area_m2: surface.area_m2,
        tilt_deg: tilt_deg(surface.normal),
        azimuth_deg: azimuth_deg(surface.normal),
        centre_m: centre(site, i),
    }
}

/// Centre of a PV surface's area.
fn centre(site: &Site, i: usize) -> DVec3 {
    let mut sum = DVec3::ZERO;
    let mut area_m2 = 0.0;
    for &t in &site.pv[i].triangles {
        let triangle = &site.triangles[t as usize];
        let own = f64::from(triangle.area_m2());
        sum += triangle.corners.iter().map(|c| c.as_dvec3()).sum::<DVec3>() / 3.0 * own;
        area_m2 += own;
    }
    if area_m2 > 0.0 { sum / area_m2 } else { sum }
}

/// What looks wrong with a scene: no ground within reach of the PV, PV far from everything, faces
/// that lie double, a unit that can't be metres.
pub fn doubts(site: &Site, reach_m: f64) -> Vec<Finding> {
    let mut out = Vec::new();
    let mut warn = |item: &str, message: String| {
        let place = Place { item: item.to_owned(), file: "[scene]".into(), ..Place::default() };
        out.push(Finding { severity: Severity::Warning, place, message });
    };
    let size = site.bounds.size().max_element();
    if !LIKELY_SIZE_M.contains(&size) {
        warn("", format!("the scene is {size} m large; is its unit the metre?"));
    }
    if let Some(axis) = likely_up(site) {
        warn(
            "",
            format!(
                "most of its area faces along {axis}, next to nothing up or down: is {axis} the axis that points up? State it (up = \"{axis}\"; --up {axis} of `new`)"
            ),
        );
    }
    let share = missing_ground(site, reach_m);
    if share > MISSING_SHARE {
        warn(
            "",
            format!(
                "{:.0} % of the ground within {reach_m:.0} m of the PV has no surface: light that arrives there is not shown; add terrain, or a ground polygon at its height",
                share * 100.0
            ),
        );
    }
    for i in far_from_everything(site) {
        warn(
            &site.pv[i].name,
            format!(
                "lies more than {FAR_M} m from every other surface: are the files in one coordinate system?"
            ),
        );
    }
    let (double, pv) = coincident(site);
    if double > 0 {
        warn(
            "",
            format!(
                "{double} triangles lie in the same place as another (shared walls, or a model that is in twice)"
            ),
        );
    }
    for i in pv {
        warn(
            &site.pv[i].name,
            "another surface lies in the same place and may cover it".to_owned(),
        );
    }
    out
}

/// Another axis than z that seems to point up: ground, roofs and floors are most of a scene's area.
fn likely_up(site: &Site) -> Option<char> {
    let mut along = [0.0_f64; 3];
    let mut all = 0.0;
    for triangle in &site.triangles {
        let (normal, area_m2) = (triangle.normal().abs(), f64::from(triangle.area_m2()));
        all += area_m2;
        if let Some(axis) = (0..3).find(|&k| normal[k] > 0.9) {
            along[axis] += area_m2;
        }
    }
    let suspects = ['x', 'y'].into_iter().zip(along);
    let upright = along[2] < 0.1 * all;
    suspects.filter(|(_, area_m2)| upright && *area_m2 > 0.6 * all).map(|(axis, _)| axis).next()
}

/// Share of the disc around the PV, seen from above, under which no surface lies. Asked on a grid
/// of points around the largest PV surfaces.
pub fn missing_ground(site: &Site, reach_m: f64) -> f64 {
    let mut largest: Vec<usize> = (0..site.pv.len()).collect();
    largest.sort_by(|&a, &b| site.pv[b].area_m2.total_cmp(&site.pv[a].area_m2).then(a.cmp(&b)));
    let top = site.bounds.max.z + 1.0;
    let depth = site.bounds.size().z + 2.0;
    let (mut asked, mut missing) = (0_u32, 0_u32);
    for &i in largest.iter().take(PROBED_PV) {
        let centre = centre(site, i);
        for k in 0..PROBES * PROBES {
            let at = |n: usize| (2 * n + 1) as f64 / PROBES as f64 - 1.0;
            let (x, y) = (at(k % PROBES), at(k / PROBES));
            if x * x + y * y > 1.0 {
                continue;
            }
            asked += 1;
            let (px, py) = (centre.x + x * reach_m, centre.y + y * reach_m);
            let from = Vec3::new(px as f32, py as f32, top);
            missing += u32::from(!site.bvh.occluded(from, Vec3::NEG_Z, 0.0, depth));
        }
    }
    if asked == 0 { 0.0 } else { f64::from(missing) / f64::from(asked) }
}

/// PV surfaces with nothing else near.
fn far_from_everything(site: &Site) -> Vec<usize> {
    let near = |centre: Vec3| {
        site.triangles
            .iter()
            .filter(|t| site.faces[t.face as usize].pv.is_none())
            .any(|t| t.corners.iter().any(|c| c.distance_squared(centre) < FAR_M * FAR_M))
    };
    let mut out: Vec<usize> = Vec::new();
    for i in 0..site.pv.len() {
        // Each search that fails goes through all triangles: a few are enough for a warning.
        if out.len() == 3 {
            break;
        }
        if !near(centre(site, i).as_vec3()) {
            out.push(i);
        }
    }
    out
}

/// How many triangles have the corners (to a millimetre, in any order) of an earlier one, and which
/// PV surfaces share theirs with another face.
fn coincident(site: &Site) -> (usize, Vec<usize>) {
    let key = |i: usize| {
        let mut corners =
            site.triangles[i].corners.map(|c| (c * 1000.0).round().to_array().map(|v| v as i64));
        corners.sort_unstable();
        corners
    };
    let mut first: HashMap<[[i64; 3]; 3], usize> = HashMap::with_capacity(site.triangles.len());
    let mut count = 0;
    let mut pv = std::collections::BTreeSet::new();
    for i in 0..site.triangles.len() {
        let earlier = *first.entry(key(i)).or_insert(i);
        let (face, other) = (site.triangles[i].face, site.triangles[earlier].face);
        if earlier != i && face != other {
            count += 1;
            let owners = [face, other].map(|f| site.faces[f as usize].pv);
            pv.extend(owners.into_iter().flatten().map(usize::from));
        }
    }
    (count, pv.into_iter().collect())
}
