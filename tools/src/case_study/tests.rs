use std::collections::HashMap;
use std::path::PathBuf;

use glam::DVec3;

use super::shape::{Face, Model};
use super::*;

fn committed(project: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../fixtures/projects").join(project)
}

#[test]
fn the_committed_projects_are_what_the_generator_makes() {
    for (project, files) in [("case-study", files()), ("tiny", tiny_files())] {
        for file in files {
            let found = std::fs::read_to_string(committed(project).join(file.name)).unwrap();
            assert!(
                found == file.text,
                "{project}/{} differs; run `cargo run -p glintmap-tools -- {project} fixtures/projects/{project}`",
                file.name
            );
        }
    }
}

#[test]
fn the_scene_has_5_000_to_20_000_polygons() {
    let count: usize = models().iter().map(|(_, _, model)| model.polygons()).sum();
    assert!((5_000..=20_000).contains(&count), "{count} polygons");
}

type Edge = ([i64; 3], [i64; 3]);

/// Edges that are not used once in each direction.
fn open_edges<'a>(faces: impl Iterator<Item = &'a Face>) -> usize {
    let mut uses: HashMap<Edge, i32> = HashMap::new();
    for face in faces {
        for (i, &p) in face.points.iter().enumerate() {
            let q = face.points[(i + 1) % face.points.len()];
            let (p, q) = (export::on_grid(p), export::on_grid(q));
            assert_ne!(p, q, "an edge without length");
            *uses.entry(if p < q { (p, q) } else { (q, p) }).or_default() +=
                if p < q { 1 } else { -1 };
        }
    }
    uses.values().filter(|&&balance| balance != 0).count()
}

#[test]
fn every_solid_is_closed_so_that_no_light_gets_behind_a_wall() {
    let pv = church::pv();
    let check = |model: &Model| {
        for solid in &model.solids {
            // A roof is closed by its section.
            let section = pv.solids.iter().find(|s| s.name == solid.name);
            let faces = solid.faces.iter().chain(section.iter().flat_map(|s| &s.faces));
            assert_eq!(open_edges(faces), 0, "{}", solid.name);
        }
    };
    check(&church::building());
    check(&house::model());
    check(&tree::model());
    let mut streets = terrain::model();
    streets.solids.retain(|solid| solid.name != "meadow");
    assert!(streets.solids.len() > 40, "streets and hedges");
    check(&streets);
    let without: Vec<Face> = church::building().solids[0].faces[1..].to_vec();
    assert_eq!(open_edges(without.iter()), 4, "the check sees a missing face");
}

#[test]
fn faces_are_planar_and_look_outwards() {
    for (file, _, model) in models() {
        for solid in &model.solids {
            let mut volume = 0.0;
            for face in &solid.faces {
                let p = &face.points;
                let normal: DVec3 =
                    (0..p.len()).map(|i| (p[i] - p[0]).cross(p[(i + 1) % p.len()] - p[0])).sum();
                assert!(normal.length() > 1e-4, "{file} {}: a face without area", solid.name);
                let unit = normal.normalize();
                for &q in p {
                    assert!((q - p[0]).dot(unit).abs() < 1e-6, "{file} {}: not planar", solid.name);
                }
                for i in 1..p.len() - 1 {
                    volume += p[0].dot(p[i].cross(p[i + 1])) / 6.0;
                }
                if solid.name == "meadow" || file == "pv.rad" {
                    assert!(unit.z > 0.5, "{file}: looks down");
                }
            }
            if solid.name != "meadow" && file != "pv.rad" && !solid.name.starts_with("roof_") {
                assert!(volume > 0.0, "{file} {}: inside out", solid.name);
            }
        }
    }
}

#[test]
fn nothing_floats() {
    for model in [church::building(), house::model(), tree::model()] {
        let mut lowest: HashMap<String, (f64, DVec3)> = HashMap::new();
        for solid in &model.solids {
            for &p in solid.faces.iter().flat_map(|f| &f.points) {
                let at = lowest.entry(solid.name.clone()).or_insert((p.z, p));
                if p.z < at.0 {
                    *at = (p.z, p);
                }
            }
        }
        for (name, (z, p)) in lowest {
            // Roofs and the courtyard stand on the halls and on the podium.
            if name.starts_with("roof_") || name == "cloister" || name == "tree_courtyard" {
                continue;
            }
            let ground = terrain::height_m(p.truncate());
            assert!(z < ground - 0.3, "{name}: foot {z} m, ground {ground} m");
        }
    }
}

#[test]
fn the_podium_covers_the_ground_and_streets_stay_clear() {
    for i in 0..=40 {
        for j in 0..=40 {
            let p = glam::DVec2::new(
                -16.5 + 36.5 * f64::from(i) / 40.0,
                -20.6 + 50.6 * f64::from(j) / 40.0,
            );
            let ground = terrain::height_m(p);
            assert!((-2.0..-0.2).contains(&ground), "{p}: {ground} m");
        }
    }
    // The ground rises to the west.
    let west = terrain::height_m(glam::DVec2::new(-99.0, 0.0));
    let east = terrain::height_m(glam::DVec2::new(99.0, 0.0));
    assert!(west > 14.0 && east < -3.0, "west {west} m, east {east} m");
}

#[test]
fn roofs_have_the_papers_slopes_and_areas() {
    let expected = [
        ("roof_west_lower", [-0.27, 0.0]),
        ("roof_west_upper", [-0.27, 0.0]),
        ("roof_south", [0.0, -0.35]),
    ];
    let pv = church::pv();
    assert_eq!(pv.solids.len(), 3);
    for (solid, (name, slope)) in pv.solids.iter().zip(expected) {
        assert_eq!((solid.name.as_str(), solid.faces.len()), (name, 1));
        let [a, b, c, d] = solid.faces[0].points[..] else { panic!("{name} has four corners") };
        assert!(((b - a) - (c - d)).length() < 1e-9 && (b - a).dot(d - a).abs() < 1e-9, "{name}");
        let normal = (b - a).cross(d - a);
        assert!((normal.x / normal.z - slope[0]).abs() < 1e-9, "{name}");
        assert!((normal.y / normal.z - slope[1]).abs() < 1e-9, "{name}");
        let sides = [(b - a).length(), (d - a).length()];
        assert!((sides[0].min(sides[1]) - 10.0).abs() < 0.1, "{name}: {sides:?}");
        assert!((sides[0].max(sides[1]) - 12.0).abs() < 0.1, "{name}: {sides:?}");
    }
}

/// All triangles of the scene with the name of what they belong to, and a ray by trying each.
struct Rays {
    triangles: Vec<(String, [DVec3; 3])>,
}

impl Rays {
    fn new() -> Self {
        let mut triangles = Vec::new();
        for (_, _, model) in models() {
            for solid in model.solids {
                for face in solid.faces {
                    for i in 1..face.points.len() - 1 {
                        let corners = [face.points[0], face.points[i], face.points[i + 1]];
                        triangles.push((solid.name.clone(), corners));
                    }
                }
            }
        }
        Self { triangles }
    }

    /// The nearest thing and its distance; Moeller and Trumbore 1997.
    fn hit(&self, from: DVec3, direction: DVec3) -> Option<(&str, f64)> {
        let mut best: Option<(&str, f64)> = None;
        for (name, [a, b, c]) in &self.triangles {
            let (ab, ac) = (*b - *a, *c - *a);
            let across = direction.cross(ac);
            let det = ab.dot(across);
            if det.abs() < 1e-12 {
                continue;
            }
            let to = from - *a;
            let u = to.dot(across) / det;
            let up = to.cross(ab);
            let v = direction.dot(up) / det;
            let t = ac.dot(up) / det;
            let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 1e-6;
            if inside && best.is_none_or(|(_, nearest)| t < nearest) {
                best = Some((name, t));
            }
        }
        best
    }
}

fn compass(azimuth_deg: f64, elevation_deg: f64) -> DVec3 {
    let (a, e) = (f64::to_radians(azimuth_deg), f64::to_radians(elevation_deg));
    DVec3::new(a.sin() * e.cos(), a.cos() * e.cos(), e.sin())
}

/// Points on a section, a little above it, and its normal.
fn section(name: &str) -> (Vec<DVec3>, DVec3) {
    let pv = church::pv();
    let solid = pv.solids.iter().find(|s| s.name == name).unwrap();
    let [a, b, _, d] = solid.faces[0].points[..] else { panic!("four corners") };
    let normal = (b - a).cross(d - a).normalize();
    let at = |i: u32| (f64::from(i) + 0.5) / 6.0;
    let points =
        (0..36).map(|k| a + (b - a) * at(k % 6) + (d - a) * at(k / 6) + normal * 1e-4).collect();
    (points, normal)
}

/// The mirrored sun of 21 June as the issue lists it (tests/physics/case_study.rs derives it from
/// the sun): it must reach the sections, and land within the paper's 100 m on the neighbourhood.
#[test]
fn mirrored_suns_of_june_land_on_the_neighbourhood() {
    let rays = Rays::new();
    let west = [(260.0, -7.5), (265.0, -2.8), (269.0, 2.1), (274.0, 7.3)];
    let south = [(246.0, -3.0), (113.0, 2.9), (114.0, -3.9)];
    let mut chalet_or_its_trees = 0;
    let mut open_house = 0;
    for (roof, beams) in
        [("roof_west_lower", &west[..]), ("roof_west_upper", &west[..]), ("roof_south", &south[..])]
    {
        let (points, normal) = section(roof);
        for &(azimuth, elevation) in beams {
            let beam = compass(azimuth, elevation);
            let sun = 2.0 * beam.dot(normal) * normal - beam;
            assert!(sun.z > 0.0, "{roof} {azimuth}: the sun is up");
            let lit = points.iter().filter(|&&p| rays.hit(p, sun).is_none()).count();
            let mut landed: Vec<String> = Vec::new();
            for &p in &points {
                if let Some((name, distance)) = rays.hit(p, beam) {
                    assert!(
                        !["choir", "parish", "tower", "church_hall", "podium"].contains(&name),
                        "{roof} {azimuth}: onto the church's own {name}"
                    );
                    if distance < 100.0 {
                        landed.push(name.to_owned());
                        open_house += usize::from(name == "open_house");
                        chalet_or_its_trees +=
                            usize::from(name == "chalet" || ("tree_01".."tree_08").contains(&name));
                    }
                }
            }
            let count = landed.len();
            landed.sort_unstable();
            landed.dedup();
            eprintln!("{roof} {azimuth} {elevation}: {lit} lit, {count} landed on {landed:?}");
            assert!(lit >= 33, "{roof} {azimuth}: {lit} of 36 points see the sun");
            assert!(count >= 24, "{roof} {azimuth}: {count} of 36 beams land within 100 m");
        }
    }
    assert!(open_house >= 10, "{open_house} beams onto the open house");
    assert!(chalet_or_its_trees >= 20, "{chalet_or_its_trees} beams onto the chalet's side");
}

/// What the project file says about its observers.
#[test]
fn observers_stand_where_their_names_say() {
    let rays = Rays::new();
    let project = project::project();
    let points: Vec<DVec3> = project
        .lines()
        .filter_map(|line| line.strip_prefix("point = [")?.strip_suffix(']'))
        .map(|line| line.split(", ").map(|n| n.parse().unwrap()).collect::<Vec<f64>>())
        .map(|n| DVec3::new(n[0], n[1], n[2]))
        .collect();
    let [chalet, open_house, street] = points[..] else { panic!("three observers") };
    for (name, at) in [("chalet", chalet), ("open_house", open_house)] {
        let (found, distance) = rays.hit(at, DVec3::NEG_X).unwrap();
        assert!(
            found == name && (0.05..1.0).contains(&distance),
            "{name}: {distance} m to {found}"
        );
        let ground = terrain::height_m(at.truncate());
        assert!((3.0..7.0).contains(&(at.z - ground)), "{name}: {} m above ground", at.z - ground);
    }
    let (found, distance) = rays.hit(street, DVec3::NEG_Z).unwrap();
    assert!(found == "street" && (1.3..1.9).contains(&distance), "{distance} m above {found}");
    // How much of the western sections they see.
    let seen = |from: DVec3| {
        let all: Vec<DVec3> =
            ["roof_west_lower", "roof_west_upper"].iter().flat_map(|r| section(r).0).collect();
        let free = all.iter().filter(|&&p| {
            let way = p - from;
            rays.hit(from, way.normalize()).is_none_or(|(_, t)| t > way.length() - 0.01)
        });
        free.count() as f64 / all.len() as f64
    };
    let shares = [seen(chalet), seen(open_house), seen(street)];
    // The chalet looks into its trees; nothing stands before the open house.
    assert!(shares[0] < 0.1 && shares[1] > 0.9 && shares[2] > 0.3, "{shares:?}");
    let near = |p: DVec3| (p.truncate() - glam::DVec2::new(-13.4, 7.0)).length();
    assert!(near(chalet) < 70.0 && near(open_house) < 70.0);
}
