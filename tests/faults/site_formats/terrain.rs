//! Terrain.

use super::*;

#[test]
fn a_hill_in_map_coordinates_keeps_its_heights() {
    let files = Files::new();
    let (ox, oy) = (2_600_000.25, 1_200_000.75);
    let hill = |x: f64, y: f64| {
        let (dx, dy) = (x - ox - 400.0, y - oy - 260.0);
        500.0 + 40.0 * libm::exp(-(dx * dx + dy * dy) / 20_000.0) + 0.01 * dx
    };
    let text = asc(401, 263, [ox, oy], 2.0, hill);
    let loaded = load(&files.spec("hill.asc", &text), &[]).unwrap();
    let site = &loaded.site;
    assert!(site.triangles.len() < 30_000, "{} of 209,600 triangles", site.triangles.len());
    for t in &site.triangles {
        assert!(t.normal().z > 0.0);
    }
    let mut random = Stream::new(3, Purpose::Survey, 0);
    for _ in 0..2000 {
        let (x, y) = (ox + 2.0 + random.uniform() * 796.0, oy + 2.0 + random.uniform() * 520.0);
        let local = DVec3::new(x, y, 0.0) - site.origin;
        let z = f64::from(ground(site, local.x as f32, local.y as f32).expect("no gap"))
            + site.origin.z;
        // The bound, the curvature between heights and rounding.
        assert!((z - hill(x, y)).abs() < 0.1 + 0.02 + 0.005, "at {x}, {y}: {z}");
    }
}

#[test]
fn terrain_is_cut_to_the_surroundings_of_the_model() {
    let files = Files::new();
    let text = asc(1001, 1001, [100_000.0, 400_000.0], 5.0, |x, _| (x - 100_000.0) * 0.1);
    let terrain = files.write("ground.asc", text);
    let house = files.write("house.obj", OBJ.replace("v ", "v 10300").replace("mtllib", "#"));
    let moved: String = fs::read_to_string(&house).unwrap();
    let moved = moved
        .lines()
        .map(|line| match line.strip_prefix("v 10300") {
            Some(rest) => {
                let n: Vec<f64> = rest.split(' ').map(|w| w.parse().unwrap()).collect();
                format!("v {} {} {}\n", n[0] + 103_000.0, n[1] + 402_000.0, n[2] + 300.0)
            }
            None => format!("{line}\n"),
        })
        .collect::<String>();
    fs::write(&house, moved).unwrap();
    let mut spec = SceneSpec::of([terrain, house]);
    spec.files.iter_mut().for_each(stated);
    let loaded = load(&spec, &pv(object("roof"))).unwrap();
    let size = loaded.site.bounds.size();
    assert!(size.x < 640.0 && size.x > 600.0 && size.y < 640.0, "{size}");
    assert!(loaded.site.triangles.len() < 2000, "of {} cells", 126 * 126);
    let centre = DVec3::new(103_100.0, 402_100.0, 0.0) - loaded.site.origin;
    let z = ground(&loaded.site, centre.x as f32, centre.y as f32).unwrap();
    assert!((f64::from(z) + loaded.site.origin.z - 310.0).abs() < 0.01);
    // Elsewhere there is nothing to cut out.
    spec.files[0].path = files.write("far.asc", asc(3, 3, [0.0, 0.0], 1.0, |_, _| 0.0));
    says(&load(&spec, &[]).unwrap_err().to_string(), &["no height lies around the other files"]);
}

#[test]
fn the_gully_as_it_was_measured() {
    let Some(path) = support::data("terrain/west_bijou_gully.asc") else { return };
    let loaded = load(&SceneSpec::of([&path]), &[]).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(6)
        .map(|l| l.split_whitespace().map(|w| w.parse().unwrap()).collect())
        .collect();
    let (mut asked, mut there) = (0, 0);
    for (r, row) in rows.iter().enumerate() {
        for (c, &z) in row.iter().enumerate() {
            let at =
                DVec3::new(559_706.5 + 3.0 * c as f64, 4_380_221.5 + 3.0 * (88 - r) as f64, 0.0);
            let local = at - loaded.site.origin;
            // A ray down the very rim may miss.
            let found = ground(&loaded.site, local.x as f32, local.y as f32);
            there += usize::from(z != 0.0);
            if let (Some(found), true) = (found, z != 0.0) {
                asked += 1;
                let off = f64::from(found) + loaded.site.origin.z - z;
                assert!(off.abs() < 0.101, "row {r}, column {c}: {off}");
            }
        }
    }
    assert!(there > 1000 && asked > there * 9 / 10, "{asked} of {there}");
}

#[test]
fn the_same_place_from_three_ways_to_say_it() {
    let mut centres = Vec::new();
    for (kind, way) in [
        ("tie_point_and_pixel_scale", "area"),
        ("tie_point_and_pixel_scale", "point"),
        ("transformation", "area"),
    ] {
        let name = format!("terrain/geotags/austrian_capitals_model_{kind}_pixel_is_{way}.tif");
        let Some(path) = support::data(&name) else { return };
        let loaded = load(&SceneSpec::of([path]), &[]).unwrap();
        assert_eq!(loaded.crs.as_deref(), Some("EPSG:3035"));
        let t = &loaded.site.triangles[0];
        let middle: DVec3 = t.corners.iter().map(|c| c.as_dvec3()).sum::<DVec3>() / 3.0;
        centres.push((middle + loaded.site.origin, loaded.site.triangles.len()));
    }
    assert_eq!(centres[0], centres[2]);
    // Where pixels are points the same tie point names a middle, not a corner: half a cell of 1 km.
    let off = centres[0].0 - centres[1].0;
    assert!((off - DVec3::new(500.0, -500.0, 0.0)).length() < 0.1, "{off}");
}

/// What a scene with local and map coordinates is asked for.
#[test]
fn terrain_beside_local_files_needs_an_origin() {
    let files = Files::new();
    let ground = files.write("ground.asc", asc(9, 9, [50_000.0, 60_000.0], 10.0, |_, _| 7.0));
    let local = files.write("yard.rad", "a polygon p 0 0 9 0 0 8 1 0 8 0 1 8\n");
    let mut spec = SceneSpec::of([local, ground]);
    assert!(matches!(load(&spec, &[]), Err(Error::MixedCoordinates { .. } | Error::Faults { .. })));
    spec.origin = Origin::At(DVec3::new(50_045.0, 60_045.0, 0.0));
    let site = load(&spec, &[]).unwrap().site;
    assert_eq!(ground_at(&site), Some(7.0));
}

fn ground_at(site: &Site) -> Option<f32> {
    ground(site, -5.0, 3.0)
}
