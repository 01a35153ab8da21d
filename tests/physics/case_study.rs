//! The geometry of the built-in case study, as it lies in fixtures/: independent of materials and
//! noise, and of the generator (tools checks that it makes these bytes).

use std::path::PathBuf;

use glam::DVec3;
use glintmap::sky::{
    self, DayRange, HourRange, Place, SunModel, TimeSpec, altitude_azimuth_deg, sun_direction,
    timeline,
};

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("fixtures/projects/case-study")
}

struct Polygon {
    modifier: String,
    points: Vec<DVec3>,
}

/// The polygons of a file that has plastic and polygons only, and its plastics' reflectances.
fn read(name: &str) -> (Vec<Polygon>, Vec<String>) {
    let text = std::fs::read_to_string(folder().join(name)).unwrap();
    let bare = text.lines().filter(|line| !line.starts_with('#'));
    let mut words = bare.flat_map(str::split_whitespace);
    let mut polygons = Vec::new();
    let mut plastics = Vec::new();
    while let Some(modifier) = words.next() {
        let kind = words.next().unwrap();
        let _name = words.next().unwrap();
        assert_eq!((words.next(), words.next()), (Some("0"), Some("0")));
        let count: usize = words.next().unwrap().parse().unwrap();
        let reals: Vec<&str> = words.by_ref().take(count).collect();
        match kind {
            "plastic" => plastics.push(reals.join(" ")),
            "polygon" => {
                let n: Vec<f64> = reals.iter().map(|r| r.parse().unwrap()).collect();
                let points = n.chunks(3).map(|c| DVec3::new(c[0], c[1], c[2])).collect();
                polygons.push(Polygon { modifier: modifier.to_owned(), points });
            }
            other => panic!("{name}: {other}"),
        }
    }
    (polygons, plastics)
}

fn normal_and_area_m2(polygon: &Polygon) -> (DVec3, f64) {
    let [a, b, c, d] = polygon.points[..] else { panic!("a section has four corners") };
    let twice = (c - a).cross(d - b);
    (twice.normalize(), twice.length() / 2.0)
}

fn project() -> toml::Table {
    std::fs::read_to_string(folder().join("project.toml")).unwrap().parse().unwrap()
}

fn place(project: &toml::Table) -> Place {
    let number = |key: &str| project["site"][key].as_float().unwrap();
    Place {
        latitude_deg: number("latitude"),
        longitude_deg: number("longitude"),
        meridian_deg: number("meridian"),
        elevation_m: number("elevation_m"),
    }
}

#[test]
fn sections_face_west_at_27_percent_and_south_at_35() {
    let (sections, plastics) = read("pv.rad");
    assert!(plastics.is_empty(), "the project gives the sections their materials");
    let expected = [
        ("pv_west_lower", DVec3::new(-0.27, 0.0, 1.0)),
        ("pv_west_upper", DVec3::new(-0.27, 0.0, 1.0)),
        ("pv_south", DVec3::new(0.0, -0.35, 1.0)),
    ];
    assert_eq!(sections.len(), expected.len());
    for (section, (modifier, normal)) in sections.iter().zip(expected) {
        let (found, area_m2) = normal_and_area_m2(section);
        assert_eq!(section.modifier, modifier);
        assert!((found - normal.normalize()).length() < 1e-6, "{modifier}: {found}");
        assert!((area_m2 - 120.0).abs() < 2.0, "{modifier}: {area_m2} m2");
    }
}

/// The table of the issue: 21 June, standard time. Azimuths are given in whole degrees.
#[test]
fn mirrored_suns_of_21_june_go_where_the_table_says() {
    let place = place(&project());
    let day = sky::parse_day("06-21", 2018).unwrap();
    assert_eq!(day, 171);
    let (sections, _) = read("pv.rad");
    for (hour, azimuth, elevation, modifier) in [
        (7.0, 260.0, -7.5, "pv_west_lower"),
        (7.5, 265.0, -2.8, "pv_west_lower"),
        (8.0, 269.0, 2.1, "pv_west_upper"),
        (8.5, 274.0, 7.3, "pv_west_upper"),
        (6.0, 246.0, -3.0, "pv_south"),
        (18.5, 113.0, 2.9, "pv_south"),
        (19.0, 114.0, -3.9, "pv_south"),
    ] {
        let section = sections.iter().find(|s| s.modifier == modifier).unwrap();
        let (normal, _) = normal_and_area_m2(section);
        let sun = sun_direction(&place, SunModel::Gensky2018, 2018, day, hour);
        assert!(sun.z > 0.0 && sun.dot(normal) > 0.0, "{hour} h: the sun shines on {modifier}");
        let mirrored = 2.0 * sun.dot(normal) * normal - sun;
        let (found_elevation, found_azimuth) = altitude_azimuth_deg(mirrored);
        let off = (found_azimuth - azimuth, found_elevation - elevation);
        assert!(
            off.0.abs() < 0.6 && off.1.abs() < 0.1,
            "{modifier} {hour} h: {found_azimuth:.2}, {found_elevation:.2}"
        );
    }
}

#[test]
fn nothing_goes_west_in_december_mornings() {
    let place = place(&project());
    let (sections, _) = read("pv.rad");
    let day = sky::parse_day("12-21", 2018).unwrap();
    for section in &sections {
        let (normal, _) = normal_and_area_m2(section);
        for quarter in 0..48 {
            let hour = f64::from(quarter) * 0.25;
            let sun = sun_direction(&place, SunModel::Gensky2018, 2018, day, hour);
            if sun.z <= 0.0 || sun.dot(normal) <= 0.0 {
                continue;
            }
            let mirrored = 2.0 * sun.dot(normal) * normal - sun;
            let (elevation, azimuth) = altitude_azimuth_deg(mirrored);
            // Above 16 degrees a beam passes over everything within 100 m.
            let west = (225.0..315.0).contains(&azimuth) && elevation < 16.0;
            assert!(!west, "{} {hour} h: {azimuth:.1}, {elevation:.1}", section.modifier);
        }
    }
}

#[test]
fn the_scene_is_5_000_to_20_000_polygons_of_25_percent() {
    let files = project()["scene"]["files"].as_array().unwrap().clone();
    let mut polygons = 0;
    let mut reach = [0.0_f64; 2];
    for file in &files {
        let (found, plastics) = read(file.as_str().unwrap());
        polygons += found.len();
        assert!(plastics.iter().all(|p| p == ".25 .25 .25 0 0"), "{file}: {plastics:?}");
        for p in found.iter().flat_map(|polygon| &polygon.points) {
            reach = [reach[0].max(p.x.abs()), reach[1].max(p.y.abs())];
        }
    }
    assert!((5_000..=20_000).contains(&polygons), "{polygons} polygons");
    // 200 x 200 m, and the ends of streets.
    assert!(reach.iter().all(|r| (100.0..104.0).contains(r)), "{reach:?}");
}

#[test]
fn the_project_asks_for_table_3() {
    let project = project();
    let time = &project["time"];
    let whole =
        |range: &str, key: &str| u32::try_from(time[range][key].as_integer().unwrap()).unwrap();
    let real = |range: &str, key: &str| time[range][key].as_float().unwrap();
    let sun: SunModel = time["sun"].as_str().unwrap().parse().unwrap();
    let spec = TimeSpec {
        year: i32::try_from(time["year"].as_integer().unwrap()).unwrap(),
        days: DayRange {
            from: whole("days", "from"),
            to: whole("days", "to"),
            step: whole("days", "step"),
        },
        hours: HourRange {
            from: real("hours", "from"),
            to: real("hours", "to"),
            step: real("hours", "step"),
        },
        finer: Vec::new(),
        sun,
        irradiance: sun.default_irradiance(),
        half_year: time["half_year"].as_bool().unwrap(),
    };
    let found = timeline(&place(&project), &spec).unwrap();
    assert_eq!(found.steps.len(), 1280);
    assert!(found.steps.iter().all(|step| step.weight_h == 3.5));
    let materials: Vec<&str> = project["material"]
        .as_array()
        .unwrap()
        .iter()
        .map(|m| m["name"].as_str().unwrap())
        .collect();
    assert_eq!(materials, ["standard", "satinated", "tile", "smooth"]);
    assert_eq!(project["reference"]["material"].as_str(), Some("tile"));
}
