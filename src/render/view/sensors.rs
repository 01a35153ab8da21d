//! Points with normals instead of pixels: what stands in the files that `rtrace -I` reads, and
//! what they see of the PV.

use glam::DVec3;

use super::error::Error;
use super::hits::{Hit, HitKind, HitMap};
use super::pv_visibility::{PvInView, PvVisibility};
use crate::base::{VirtualSensor, limits};
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
    /// Nothing: photons pass, and are counted where they cross a [`VirtualSensor`].
    Air,
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
    let seen = PvVisibility::spread(site, seed);
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

/// Rays that look for surfaces around a virtual sensor.
const SPOKES: u32 = 32;
/// A virtual sensor isn't made smaller than this for the surfaces around it, m.
const LEAST_SENSOR_M: f64 = 0.02;

/// The virtual sensor of a point in free air: a disc of `radius_m`, smaller where it would cut a
/// surface of the scene, behind which it would lie in the dark.
pub fn virtual_sensor(position: DVec3, normal: DVec3, radius_m: f64, site: &Site) -> VirtualSensor {
    let frame = crate::base::Frame::around(normal);
    let nearest = (0..SPOKES).fold(radius_m, |least, i| {
        let turn = std::f64::consts::TAU * f64::from(i) / f64::from(SPOKES);
        let spoke = frame.x * libm::cos(turn) + frame.y * libm::sin(turn);
        let met = site.bvh.closest(position.as_vec3(), spoke.as_vec3(), 0.0, least as f32);
        met.map_or(least, |hit| least.min(f64::from(hit.distance_m)))
    });
    VirtualSensor { centre: position, normal, radius_m: nearest.max(LEAST_SENSOR_M.min(radius_m)) }
}

#[cfg(test)]
pub(in crate::render) mod tests {
    use glam::Vec3;

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

    /// A floor of 8 x 8 m, a wall on its west side whose front faces west, a roof of PV above the
    /// floor that faces down and is 1 x 1 m.
    pub(in crate::render) fn site() -> Site {
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
}
