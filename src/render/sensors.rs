//! Points with normals instead of pixels: what stands in the files that `rtrace -I` reads, and
//! what they see of the PV.

use glam::{DVec3, Vec3};

use super::seen::SeenPv;
use super::{Error, Hit, HitKind, HitMap};
use crate::base::{Aabb, Gate, limits};
use crate::site::Site;

/// A sensor counts as lying on a surface within this distance, m: terrain and walls of city models
/// are no truer.
pub const ON_SURFACE_M: f64 = 0.05;
/// Cosine of the largest angle between a sensor's normal and that of the surface that it lies on:
/// 25 degrees. Beyond, the photons on the surface say nothing of the sensor's plane.
const SAME_PLANE: f32 = 0.9063;

/// A point that light falls onto, on one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Where, m from the local origin.
    pub position: DVec3,
    /// Unit normal of the side that is asked for.
    pub normal: DVec3,
}

/// What a sensor stands on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Footing {
    /// A surface of the scene: photons land there.
    Surface,
    /// The PV itself: photons don't land on what sends them.
    Pv,
    /// Nothing: photons pass, and are counted where they cross a [`Gate`].
    Air,
}

/// What a point sees of the PV, by the 64 points that are tested on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PvInView {
    /// Distance to the nearest visible one, m.
    pub nearest_m: f64,
    /// Largest angle between two visible ones, degrees.
    pub widest_deg: f64,
    /// Solid angle of the visible share of the PV, sr.
    pub solid_angle_sr: f64,
}

/// The sensors of a set, checked against the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    /// One pixel a sensor, one row.
    pub hits: HitMap,
    /// What each stands on.
    pub footing: Vec<Footing>,
    /// What each sees of the PV; none sees nothing of it.
    pub pv: Vec<Option<PvInView>>,
}

/// Reads sensors as `rtrace -I` takes them: `x y z nx ny nz` on each line, separated by blanks,
/// tabs or commas. Blank lines and what follows a `#` are passed over.
///
/// # Errors
/// [`Error::Sensors`] with all lines (up to 20) that don't fit.
pub fn parse_sensors(text: &str) -> Result<Vec<Sensor>, Error> {
    let mut sensors = Vec::new();
    let mut wrong: Vec<String> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or("").trim();
        if line.is_empty() {
            continue;
        }
        match sensor(line) {
            Ok(sensor) => sensors.push(sensor),
            Err(what) => wrong.push(format!("line {}: {what}", number + 1)),
        }
    }
    if !wrong.is_empty() {
        let more = wrong.len().saturating_sub(limits::MAX_FINDINGS_SHOWN);
        wrong.truncate(limits::MAX_FINDINGS_SHOWN);
        if more > 0 {
            wrong.push(format!("and {more} more"));
        }
        return Err(Error::Sensors { what: wrong.join("\n") });
    }
    if !(1..=limits::MAX_VIEW_EDGE).contains(&sensors.len()) {
        let what = format!(
            "expected 1 to {} sensors, found {}; spread more over several [[view]]s",
            limits::MAX_VIEW_EDGE,
            sensors.len()
        );
        return Err(Error::Sensors { what });
    }
    Ok(sensors)
}

fn sensor(line: &str) -> Result<Sensor, String> {
    let words: Vec<&str> =
        line.split(|c: char| c.is_whitespace() || c == ',').filter(|w| !w.is_empty()).collect();
    if words.len() != 6 {
        return Err(format!("expected 6 numbers (x y z nx ny nz), found {}", words.len()));
    }
    let mut numbers = [0.0; 6];
    for (number, word) in numbers.iter_mut().zip(words) {
        *number = word
            .parse()
            .ok()
            .filter(|v: &f64| v.is_finite() && v.abs() < 1e9)
            .ok_or_else(|| format!("expected a number of metres, found `{word}`"))?;
    }
    let [x, y, z, nx, ny, nz] = numbers;
    let normal = DVec3::new(nx, ny, nz)
        .try_normalize()
        .ok_or("the normal nx ny nz is zero, expected a direction")?;
    Ok(Sensor { position: DVec3::new(x, y, z), normal })
}

/// Looks what each sensor stands on and what it sees of the PV. Sensors that stand on a surface
/// get its place (at most [`ON_SURFACE_M`] away) and plane, turned to the sensor's side, so that
/// the photons there are found. In the hits all others are [`HitKind::Clipped`] (or
/// [`HitKind::Pv`]): no photons are looked for on surfaces there, and `footing` says why.
pub fn place(sensors: &[Sensor], site: &Site, max_path_m: f64, seed: u64) -> Placed {
    let seen = SeenPv::spread(site, seed);
    let mut placed = Placed {
        hits: HitMap { columns: sensors.len(), rows: 1, hits: Vec::with_capacity(sensors.len()) },
        footing: Vec::with_capacity(sensors.len()),
        pv: Vec::with_capacity(sensors.len()),
    };
    for sensor in sensors {
        let (footing, mut hit) = footing(sensor, site);
        let pv = seen.in_view(site, hit.position, hit.normal);
        if footing == Footing::Surface {
            (hit.kind, hit.pv_distance_m) = match &pv {
                None => (HitKind::Hidden, 0.0),
                Some(v) if v.nearest_m > max_path_m => (HitKind::Beyond, v.nearest_m as f32),
                Some(v) => (HitKind::Receiver, v.nearest_m as f32),
            };
        }
        placed.hits.hits.push(hit);
        placed.footing.push(footing);
        placed.pv.push(pv);
    }
    placed
}

fn footing(sensor: &Sensor, site: &Site) -> (Footing, Hit) {
    let normal = sensor.normal.as_vec3();
    let from = (sensor.position + sensor.normal * ON_SURFACE_M).as_vec3();
    let air = Hit { position: sensor.position.as_vec3(), normal, ..Hit::nothing(HitKind::Clipped) };
    let Some(found) = site.bvh.closest(from, -normal, 0.0, 2.0 * ON_SURFACE_M as f32) else {
        return (Footing::Air, air);
    };
    let front = site.triangles[found.triangle as usize].normal();
    let turned = if front.dot(normal) < 0.0 { -front } else { front };
    if turned.dot(normal) < SAME_PLANE {
        return (Footing::Air, air);
    }
    let face = site.triangles[found.triangle as usize].face;
    let source = &site.faces[face as usize];
    let hit = Hit {
        position: from - normal * found.distance_m,
        normal: turned,
        object: source.object,
        face,
        pv_distance_m: 0.0,
        kind: HitKind::Pv,
    };
    (if source.pv.is_some() { Footing::Pv } else { Footing::Surface }, hit)
}

/// Rays that look for surfaces around a gate.
const SPOKES: u32 = 32;
/// A gate isn't made smaller than this for the surfaces around it, m.
const LEAST_GATE_M: f64 = 0.02;

/// The gate of a sensor in free air: a disc of `radius_m`, smaller where it would cut a surface of
/// the scene, behind which it would lie in the dark.
pub fn gate(position: DVec3, normal: DVec3, radius_m: f64, site: &Site) -> Gate {
    let frame = crate::base::Frame::around(normal);
    let nearest = (0..SPOKES).fold(radius_m, |least, i| {
        let turn = std::f64::consts::TAU * f64::from(i) / f64::from(SPOKES);
        let spoke = frame.x * libm::cos(turn) + frame.y * libm::sin(turn);
        let met = site.bvh.closest(position.as_vec3(), spoke.as_vec3(), 0.0, least as f32);
        met.map_or(least, |hit| least.min(f64::from(hit.distance_m)))
    });
    Gate { centre: position, normal, radius_m: nearest.max(LEAST_GATE_M.min(radius_m)) }
}

/// A piece of a surface that a region is sampled by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Where, and the side that may see PV.
    pub sensor: Sensor,
    /// The area it stands for, m2.
    pub area_m2: f64,
}

/// Spreads samples over the faces of some objects: a square lattice of `spacing_m` in the plane of
/// each face. Of the two sides of a face that one is taken that sees PV, the front where neither
/// or both do. A face that no lattice point meets gets one sample in its largest triangle. PV is
/// left out. The samples of a face stand for equal parts of its area.
pub fn sample_objects(site: &Site, objects: &[u32], spacing_m: f64, seed: u64) -> Vec<Sample> {
    let seen = SeenPv::spread(site, seed);
    let wanted: std::collections::BTreeSet<u32> = objects.iter().copied().collect();
    let mut by_face: std::collections::BTreeMap<u32, Vec<u32>> = std::collections::BTreeMap::new();
    for (t, triangle) in site.triangles.iter().enumerate() {
        let face = &site.faces[triangle.face as usize];
        if face.pv.is_none() && wanted.contains(&face.object) {
            by_face.entry(triangle.face).or_default().push(t as u32);
        }
    }
    let mut out = Vec::new();
    for triangles in by_face.values() {
        let mut places: Vec<(DVec3, Vec3)> = Vec::new();
        for &t in triangles {
            lattice(site, t, spacing_m, |place, normal| places.push((place, normal)));
        }
        let area = |t: &u32| f64::from(site.triangles[*t as usize].area_m2());
        let area_m2: f64 = triangles.iter().map(area).sum();
        if area_m2 <= 0.0 {
            continue;
        }
        if places.is_empty() {
            let largest = triangles.iter().max_by(|a, b| area(a).total_cmp(&area(b)));
            places.extend(largest.map(|t| {
                let triangle = &site.triangles[*t as usize];
                let [a, b, c] = triangle.corners.map(Vec3::as_dvec3);
                ((a + b + c) / 3.0, triangle.normal())
            }));
        }
        let share = area_m2 / places.len() as f64;
        out.extend(places.into_iter().map(|(position, front)| {
            let sees = |n: Vec3| seen.nearest_m(site, position.as_vec3(), n).is_some();
            let normal = if !sees(front) && sees(-front) { -front } else { front };
            let sensor = Sensor { position, normal: normal.as_dvec3() };
            Sample { sensor, area_m2: share }
        }));
    }
    out
}

/// Calls `each` with the lattice points inside a triangle and its normal. The lattice depends on
/// the plane alone, and an edge belongs to the triangle above or to the left of it: triangles of a
/// face share neither points nor gaps.
fn lattice(site: &Site, triangle: u32, spacing_m: f64, mut each: impl FnMut(DVec3, Vec3)) {
    let triangle = &site.triangles[triangle as usize];
    let normal = triangle.normal();
    if normal == Vec3::ZERO {
        return;
    }
    let frame = crate::base::Frame::around(normal.as_dvec3());
    let corners = triangle.corners.map(|c| frame.local_from_world(c.as_dvec3()));
    let cell = |v: f64| libm::floor(v / spacing_m);
    let [low, high] = [f64::min, f64::max].map(|pick| {
        corners
            .iter()
            .skip(1)
            .fold([corners[0].x, corners[0].y], |b, c| [pick(b[0], c.x), pick(b[1], c.y)])
    });
    let z = (corners[0].z + corners[1].z + corners[2].z) / 3.0;
    let count = |axis: usize| (cell(high[axis]) - cell(low[axis]) + 1.0).min(65_536.0) as u64;
    for j in 0..count(1) {
        for i in 0..count(0) {
            let x = (cell(low[0]) + i as f64 + 0.5) * spacing_m;
            let y = (cell(low[1]) + j as f64 + 0.5) * spacing_m;
            if inside(&corners, x, y) {
                each(frame.world_from_local(DVec3::new(x, y, z)), normal);
            }
        }
    }
}

/// Whether a point lies in a polygon, by the half-open rule: of two polygons that share an edge
/// exactly one holds a point on it.
fn inside(corners: &[DVec3], x: f64, y: f64) -> bool {
    let mut odd = false;
    for (at, a) in corners.iter().enumerate() {
        let b = &corners[(at + 1) % corners.len()];
        // Both polygons of an edge must compute the same crossing: from its lower end.
        let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
        if (a.y > y) != (b.y > y) && x < a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x) {
            odd = !odd;
        }
    }
    odd
}

/// Spreads samples over a polygon in plan, `height_m` above the ground and facing up; on the
/// ground itself, in its plane, where no height is given. The ground is the lowest surface that
/// faces up (the highest of all where none does): what a plot is under its trees. Where there is
/// none the sample is left out; how many were is returned beside them.
pub fn sample_polygon(
    site: &Site,
    polygon: &[[f64; 2]],
    height_m: Option<f64>,
    spacing_m: f64,
) -> (Vec<Sample>, usize) {
    let corners: Vec<DVec3> = polygon.iter().map(|[x, y]| DVec3::new(*x, *y, 0.0)).collect();
    let bounds = Aabb::around(corners.iter().map(|c| c.as_vec3()));
    let mut out = Vec::new();
    let mut missing = 0;
    if bounds.is_empty() {
        return (out, missing);
    }
    let size = bounds.size().as_dvec3();
    let count = |length: f64| (libm::ceil(length / spacing_m)).clamp(1.0, 65_536.0) as u64;
    let (columns, rows) = (count(size.x), count(size.y));
    let step = |length: f64, n: u64| length / n as f64;
    let (dx, dy) = (step(size.x, columns), step(size.y, rows));
    for j in 0..rows {
        for i in 0..columns {
            let x = f64::from(bounds.min.x) + (i as f64 + 0.5) * dx;
            let y = f64::from(bounds.min.y) + (j as f64 + 0.5) * dy;
            if !inside(&corners, x, y) {
                continue;
            }
            let Some((ground, normal)) = ground(site, x, y) else {
                missing += 1;
                continue;
            };
            let sensor = match height_m {
                Some(h) => Sensor { position: ground + DVec3::Z * h, normal: DVec3::Z },
                None => Sensor { position: ground, normal },
            };
            out.push(Sample { sensor, area_m2: dx * dy });
        }
    }
    (out, missing)
}

/// Surfaces under each other that are looked through for the ground.
const STOREYS: usize = 64;

fn ground(site: &Site, x: f64, y: f64) -> Option<(DVec3, DVec3)> {
    let mut from = site.bounds.max.z + 1.0;
    let (mut top, mut lowest) = (None, None);
    for _ in 0..STOREYS {
        let origin = Vec3::new(x as f32, y as f32, from);
        let Some(found) = site.bvh.closest(origin, Vec3::NEG_Z, 0.0, f32::INFINITY) else { break };
        let front = site.triangles[found.triangle as usize].normal();
        let z = from - found.distance_m;
        let up = if front.z < 0.0 { -front } else { front };
        let place = (DVec3::new(x, y, f64::from(z)), up.as_dvec3());
        if site.face_of(found.triangle).pv.is_none() {
            top = top.or(Some(place));
            if front.z > 0.1 {
                lowest = Some(place);
            }
        }
        from = z - 1e-3 * (1.0 + z.abs() * 1e-2);
    }
    lowest.or(top)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::site::{Face, Material, Object, PvSurface, Triangle};

    #[test]
    fn lines_of_rtrace_are_read_and_mistakes_have_their_number() {
        let text = "# x y z nx ny nz\n\n 1 2 3 0 0 2 # up\n4,5,6\t1,0,0\r\n";
        let found = parse_sensors(text).expect("reads");
        assert_eq!(found.len(), 2);
        assert_eq!(found[0], Sensor { position: DVec3::new(1.0, 2.0, 3.0), normal: DVec3::Z });
        assert_eq!(found[1].normal, DVec3::X);
        let wrong = "1 2 3 0 0 1\n1 2 3\n\n1 2 x 0 0 1\n1 2 3 0 0 0\n1 2 nan 0 0 1\n";
        let message = parse_sensors(wrong).expect_err("mistakes").to_string();
        for word in ["line 2: expected 6", "line 4", "`x`", "line 5", "zero", "line 6"] {
            assert!(message.contains(word), "{word}: {message}");
        }
        assert!(!message.contains("line 1:"), "{message}");
        assert!(parse_sensors("# none\n").is_err());
    }

    /// A floor of 8 x 8 m, a wall on its west side whose front faces west, a roof of PV above the floor
    /// that faces down and is 1 x 1 m.
    fn site() -> Site {
        let quad = |corners: [[f32; 3]; 4], face: u32| {
            let [a, b, c, d] = corners.map(Vec3::from_array);
            [Triangle { corners: [a, b, c], face }, Triangle { corners: [a, c, d], face }]
        };
        let triangles = [
            quad([[0., 0., 0.], [8., 0., 0.], [8., 8., 0.], [0., 8., 0.]], 0),
            quad([[0., 0., 0.], [0., 0., 3.], [0., 8., 3.], [0., 8., 0.]], 1),
            quad([[4., 4., 2.], [4., 5., 2.], [5., 5., 2.], [5., 4., 2.]], 2),
        ]
        .concat();
        let face = |object, pv| Face { object, material: 0, pv };
        let object = |id: &str| Object { id: id.into(), kind: String::new() };
        let pv = PvSurface {
            name: "pv".into(),
            entry: 0,
            triangles: vec![4, 5],
            normal: DVec3::NEG_Z,
            area_m2: 1.0,
            two_sided: false,
        };
        let material = Material { name: "m".into(), reflectance: [0.2; 3], diffuse: true };
        Site::from_parts(
            triangles,
            vec![face(0, None), face(1, None), face(2, Some(0))],
            vec![object("floor"), object("wall"), object("pv")],
            vec![material],
            vec![pv],
            DVec3::ZERO,
            Vec::new(),
        )
    }

    #[test]
    fn sensors_stand_on_surfaces_on_pv_or_in_air() {
        let at = |p: [f64; 3], n: DVec3| Sensor { position: DVec3::from_array(p), normal: n };
        let sensors = [
            at([4.5, 4.5, 0.0], DVec3::Z),
            at([4.5, 4.5, 0.03], DVec3::Z),
            at([4.5, 4.5, -0.03], DVec3::Z),
            at([4.5, 4.5, 0.07], DVec3::Z),
            at([4.5, 4.5, 0.0], DVec3::X),
            at([0.0, 4.0, 1.0], DVec3::X),
            at([0.0, 4.0, 1.0], DVec3::NEG_X),
            at([4.5, 4.5, 2.0], DVec3::NEG_Z),
            at([7.0, 1.0, 0.0], DVec3::Z),
        ];
        let placed = place(&sensors, &site(), 6.0, 1);
        use Footing::{Air, Pv, Surface};
        let expected = [Surface, Surface, Surface, Air, Air, Surface, Surface, Pv, Surface];
        assert_eq!(placed.footing, expected);
        let kinds: Vec<HitKind> = placed.hits.hits.iter().map(|h| h.kind).collect();
        use HitKind::{Clipped, Hidden, Receiver};
        let receivers = [Receiver, Receiver, Receiver, Clipped, Clipped, Receiver, Hidden];
        assert_eq!(kinds[..7], receivers);
        assert_eq!(kinds[7], HitKind::Pv);
        // Where photons land, not where the file says.
        assert_eq!(placed.hits.hits[1].position.z, 0.0);
        let below = placed.pv[0].expect("sees the PV");
        assert!((below.nearest_m - 2.0).abs() < 0.01, "{below:?}");
        // From corner to corner; the 64 points lie a little inside.
        let whole = 2.0 * libm::atan(0.5f64.sqrt() / 2.0).to_degrees();
        assert!(below.widest_deg < whole && below.widest_deg > 0.8 * whole, "{below:?}");
        // Solid angle of a square over its middle: 4 asin(a2 / (a2 + 4 h2)), a = 1, h = 2.
        let exact = 4.0 * libm::asin(1.0 / 17.0);
        assert!((below.solid_angle_sr / exact - 1.0).abs() < 0.02, "{below:?} {exact}");
        assert_eq!(place(&sensors[..1], &site(), 1.0, 1).hits.hits[0].kind, HitKind::Beyond);
    }

    #[test]
    fn samples_stand_for_the_whole_area_and_look_at_the_pv() {
        let site = site();
        for spacing in [0.3, 1.0, 2.7, 50.0] {
            for (object, area) in [(0, 64.0), (1, 24.0)] {
                let samples = sample_objects(&site, &[object], spacing, 1);
                let sum: f64 = samples.iter().map(|s| s.area_m2).sum();
                assert!((sum - area).abs() < 1e-6, "{object} {spacing}: {sum}");
                let whole = (area / (spacing * spacing)) as usize;
                assert!(
                    samples.len().abs_diff(whole) * 4 <= whole.max(4),
                    "{spacing}: {}",
                    samples.len()
                );
            }
            // Where the wall sees the PV's lower side its samples look at it, not to the front.
            for s in sample_objects(&site, &[1], spacing, 1) {
                let east = s.sensor.normal.x > 0.9;
                assert_eq!(east, s.sensor.position.z < 2.0, "{spacing}: {s:?}");
            }
        }
        // The PV has no samples of its own.
        assert!(sample_objects(&site, &[2], 0.1, 1).is_empty());
    }

    #[test]
    fn polygons_lie_on_the_ground_or_above_it() {
        let site = site();
        let triangle = [[1.0, 1.0], [7.0, 1.0], [1.0, 7.0]];
        let (ground, missing) = sample_polygon(&site, &triangle, None, 0.1);
        assert_eq!(missing, 0);
        let sum: f64 = ground.iter().map(|s| s.area_m2).sum();
        assert!((sum - 18.0).abs() < 0.6, "{sum}");
        // Also under the PV.
        assert!(ground.iter().all(|s| s.sensor.position.z.abs() < 1e-5));
        let (above, _) = sample_polygon(&site, &triangle, Some(2.0), 0.5);
        assert!(above.iter().all(|s| (s.sensor.position.z - 2.0).abs() < 1e-5));
        let beyond = [[20.0, 20.0], [21.0, 20.0], [21.0, 21.0]];
        let (none, missing) = sample_polygon(&site, &beyond, None, 0.1);
        assert!(none.is_empty() && missing > 10);
    }

    /// Points on shared edges and corners belong to exactly one of the triangles.
    #[test]
    fn neighbours_share_neither_points_nor_gaps() {
        let p = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        let parts =
            [[p(0.0, 0.0), p(8.0, 0.0), p(8.0, 8.0)], [p(0.0, 0.0), p(8.0, 8.0), p(0.0, 8.0)]];
        for i in 0..16 {
            for j in 0..16 {
                let (x, y) = (f64::from(i) * 0.5, f64::from(j) * 0.5);
                let holders = parts.iter().filter(|t| inside(&t[..], x, y)).count();
                let whole = [p(0.0, 0.0), p(8.0, 0.0), p(8.0, 8.0), p(0.0, 8.0)];
                assert_eq!(holders, usize::from(inside(&whole, x, y)), "{x} {y}");
                assert_eq!(holders, 1, "{x} {y}");
            }
        }
    }
}
