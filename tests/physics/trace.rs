//! Photons: closed forms, geometry, and a tally that closes.

mod scene;
mod speed;

pub use scene::{Scene, bsdf, horizontal, settings, sun, timeline, trace, wall};
pub use speed::{processor_s, village};

use crate::support::photons::{plan, run};
use glam::{DVec3, Vec3};
use glintmap::base::{Silent, Timeline};
use glintmap::bsdf::{Bsdf, Model};
use glintmap::site::Site;
use glintmap::trace::{Emission, Error, Plan, Receivers, Settings};
use scene::Kept;

/// Configuration factor from a point to a parallel rectangle with a corner above it, `a` and `b`
/// its edges over the distance (Howell's catalogue, B-3).
fn corner_factor(a: f64, b: f64) -> f64 {
    let (p, q) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
    (a / p * libm::atan(b / p) + b / q * libm::atan(a / q)) / std::f64::consts::TAU
}

/// From a point at (x, y) to a rectangle from -half to half at a distance.
pub fn square_factor(x: f64, y: f64, half: f64, distance: f64) -> f64 {
    let part = |x: f64, y: f64| {
        x.signum() * y.signum() * corner_factor(x.abs() / distance, y.abs() / distance)
    };
    part(half - x, half - y)
        + part(half + x, half - y)
        + part(half - x, half + y)
        + part(half + x, half + y)
}

#[test]
fn a_lambertian_square_lights_a_parallel_one_by_the_closed_form() {
    let (half, distance, edge) = (1.0, 2.0, 3.0);
    let site = Scene::new()
        .pv(horizontal([-1.0, 1.0], [-1.0, 1.0], 0.0), false)
        .quad(horizontal([-3.0, 3.0], [-3.0, 3.0], 2.0))
        .site();
    let timeline = timeline(&[(sun(200.0, 40.0), 900.0), (sun(250.0, 10.0), 300.0)]);
    let tile = bsdf(Model::Lambertian { reflectance: 0.7 });
    let settings = Settings { sun_visibility: false, ..settings(200_000) };
    let emission = Emission { site: &site, timeline: &timeline, bsdfs: vec![&tile], settings };
    let (_, photons, tally) = trace(&emission);
    assert!((tally.stored.photons as f64 / 200_000.0 - 1.0).abs() < 0.02, "{:?}", tally.stored);

    let radiosity: f64 = timeline.steps.iter().map(|s| 0.7 * s.irradiance_w_m2 * s.sun.z).sum();
    const CELLS: usize = 12;
    let mut found = [[0.0_f64; CELLS]; CELLS];
    let cell_m = 2.0 * edge / CELLS as f64;
    for p in &photons {
        assert!((p.position.z - 2.0).abs() < 1e-5);
        assert_eq!(p.normal, Vec3::NEG_Z);
        assert!(p.direction.z < 0.0);
        let at = |v: f32| (((f64::from(v) + edge) / cell_m) as usize).min(CELLS - 1);
        found[at(p.position.y)][at(p.position.x)] += f64::from(p.flux_w);
    }
    let photon_w = f64::from(photons[0].flux_w);
    let (mut chi2, mut whole) = (0.0, 0.0);
    for (row, cells) in found.iter().enumerate() {
        for (column, &flux_w) in cells.iter().enumerate() {
            let mut expected = 0.0;
            for i in 0..64 {
                let at = |cell: usize, part: usize| {
                    -edge + cell_m * (cell as f64 + (part as f64 + 0.5) / 8.0)
                };
                expected += square_factor(at(column, i % 8), at(row, i / 8), half, distance) / 64.0;
            }
            expected *= radiosity * cell_m * cell_m;
            whole += expected;
            chi2 += (flux_w - expected).powi(2) / (expected * photon_w);
        }
    }
    // Chi-square with 144 degrees of freedom: 0.1 % lie above 201 (the sum isn't fitted).
    assert!(chi2 < 201.0, "chi2 {chi2} over {} cells", CELLS * CELLS);
    assert!((tally.stored.flux_w / whole - 1.0).abs() < 0.01);
}

/// The mirror of the tests below: 4 x 4 m, flat; the sun in the west at 30 degrees; a wall in the
/// east at x = 20.
pub fn mirror_scene() -> Scene {
    Scene::new().pv(horizontal([-2.0, 2.0], [-2.0, 2.0], 0.0), false).quad(wall(
        20.0,
        [-15.0, 15.0],
        [-5.0, 25.0],
    ))
}

#[test]
fn a_mirror_throws_its_footprint_onto_a_wall() {
    let site = mirror_scene().site();
    let timeline = timeline(&[(sun(270.0, 30.0), 1000.0)]);
    let mirror = bsdf(Model::Mirror { reflectance: 0.9 });
    let emission = Emission {
        site: &site,
        timeline: &timeline,
        bsdfs: vec![&mirror],
        settings: settings(100_000),
    };
    let (_, photons, tally) = trace(&emission);
    // 1000 W/m2 on 16 m2 at 30 degrees elevation.
    assert!((tally.stored.flux_w / (0.9 * 1000.0 * 16.0 * 0.5) - 1.0).abs() < 1e-3);
    let cos = libm::cos(30_f64.to_radians());
    let tan = libm::tan(30_f64.to_radians());
    let centre = timeline.steps[0].sun;
    let (mut core_w, mut core_m2) = (0.0, 0.0);
    let core = ([-1.8, 1.8], [18.0 * tan + 0.25, 22.0 * tan - 0.25]);
    for p in &photons {
        let (at, back) = (p.position.as_dvec3(), p.direction.as_dvec3());
        assert!((at.x - 20.0).abs() < 1e-5 && p.normal == Vec3::NEG_X);
        // Back to the mirror, and from there to the sun's disc.
        let start = at + back * (at.z / -back.z);
        assert!(start.x.abs() < 2.0 + 0.01 && start.y.abs() < 2.0 + 0.01, "{start}");
        let to_sun = DVec3::new(back.x, back.y, -back.z);
        let off = libm::asin(to_sun.cross(centre).length()).to_degrees();
        assert!(off < 0.2665 + 1e-4, "{off} degrees off the sun's centre");
        if (core.0[0]..core.0[1]).contains(&at.y) && (core.1[0]..core.1[1]).contains(&at.z) {
            core_w += f64::from(p.flux_w);
        }
    }
    core_m2 += (core.0[1] - core.0[0]) * (core.1[1] - core.1[0]);
    // Where the whole disc is mirrored the wall gets the beam: E rho cos.
    let irradiance = core_w / core_m2;
    // About 75,000 photons in the core: 0.37 % is one sigma.
    assert!((irradiance / (900.0 * cos) - 1.0).abs() < 0.012, "{irradiance} W/m2");
}

#[test]
fn a_shadow_takes_its_share_unless_visibility_is_off() {
    // A blocker whose shadow ends in the mirror's middle.
    let height = 2.5 * libm::tan(30_f64.to_radians()) as f32;
    let site = mirror_scene().quad(wall(-2.5, [-9.0, 9.0], [-1.0, height])).site();
    let timeline = timeline(&[(sun(270.0, 30.0), 1000.0)]);
    let mirror = bsdf(Model::Mirror { reflectance: 1.0 });
    let mut emission = Emission {
        site: &site,
        timeline: &timeline,
        bsdfs: vec![&mirror],
        settings: settings(20_000),
    };
    let (_, photons, tally) = trace(&emission);
    assert!((tally.blocked.flux_w / tally.sent.flux_w - 0.5).abs() < 0.01, "{tally:?}");
    assert!(photons.iter().all(|p| p.position.z < 21.0 * 0.5774));
    emission.settings.sun_visibility = false;
    let (_, _, tally) = trace(&emission);
    assert_eq!(tally.blocked.photons, 0);
    assert!((tally.stored.flux_w - 8000.0).abs() < 8.0);
}

#[test]
fn each_timestep_gets_its_share() {
    let site = mirror_scene().site();
    let suns: Vec<_> = (0..40)
        .map(|i| (sun(260.0 + 0.5 * f64::from(i), 20.0 + 0.4 * f64::from(i)), 800.0))
        .collect();
    let timeline = timeline(&suns);
    let mirror = bsdf(Model::Mirror { reflectance: 1.0 });
    let emission = Emission {
        site: &site,
        timeline: &timeline,
        bsdfs: vec![&mirror],
        settings: settings(100_000),
    };
    let (plan, photons, _) = trace(&emission);
    assert!(photons.is_sorted_by_key(|p| p.timestep), "photons come in the order of time");
    let mut found = vec![0.0; suns.len()];
    for p in &photons {
        found[p.timestep as usize] += f64::from(p.flux_w);
    }
    for (i, (sun, irradiance)) in suns.iter().enumerate() {
        let expected = irradiance * 16.0 * sun.z;
        // Stratified: a photon or two at the borders, and what the roulette over the disc does.
        let limit = 3.0 * plan.photon_w + 0.01 * expected;
        assert!((found[i] - expected).abs() < limit, "{i}: {} of {expected} W", found[i]);
    }
}

/// A small neighbourhood: two roofs, a façade and a free sheet of PV, houses, ground, a tower.
fn neighbourhood() -> Site {
    let mut scene = Scene::new()
        .pv([[0., 0., 8.], [0., 10., 8.], [-8., 10., 5.84], [-8., 0., 5.84]], false)
        .pv([[0., 10., 8.], [0., 0., 8.], [8., 0., 5.84], [8., 10., 5.84]], false)
        .pv([[-6., -30., 0.], [4., -30., 0.], [4., -30., 6.], [-6., -30., 6.]], false)
        .pv([[20., 20., 3.], [24., 20., 3.], [24., 24., 4.], [20., 24., 4.]], true)
        .quad(horizontal([-150.0, 150.0], [-150.0, 150.0], 0.0))
        .quad(wall(-3.0, [12.0, 15.0], [0.0, 25.0]))
        .quad(wall(3.0, [12.0, 15.0], [0.0, 25.0]));
    for i in 0..12_i16 {
        let (x, y) = (f32::from((i * 37) % 90) - 45.0, f32::from((i * 53) % 90) - 50.0);
        let h = 3.0 + f32::from(i % 5);
        if x.abs() < 12.0 && (-5.0..15.0).contains(&y) {
            continue;
        }
        scene = scene
            .quad(wall(x, [y, y + 7.0], [0.0, h]))
            .glass(wall(x + 6.0, [y, y + 7.0], [0.0, h]))
            .quad(horizontal([x, x + 6.0], [y, y + 7.0], h));
    }
    scene.site()
}

fn suns_of_a_day() -> Timeline {
    timeline(&[
        (sun(80.0, 0.1), 60.0),
        (sun(90.0, 5.0), 200.0),
        (sun(110.0, 15.0), 500.0),
        (sun(180.0, 60.0), 900.0),
        (sun(250.0, 15.0), 500.0),
        (sun(268.0, 4.0), 200.0),
        // Grazing the west roof's plane from behind: part of the disc lies below it.
        (sun(90.0, 15.2), 400.0),
        (sun(280.0, 0.2), 60.0),
    ])
}

#[test]
fn the_tally_closes_for_every_model() {
    let site = neighbourhood();
    let timeline = suns_of_a_day();
    let models = [
        Model::Lambertian { reflectance: 0.25 },
        Model::Mirror { reflectance: 0.95 },
        Model::Glass { index: 1.52 },
        Model::PvGlass { index: 1.52, ggx_alpha: 0.02, cell_reflectance: 0.03 },
        Model::PvGlass { index: 1.52, ggx_alpha: 0.3, cell_reflectance: 0.05 },
    ];
    // What falls onto the PV: E A cos over the part of the disc above plane and horizon.
    let mut falls_w = 0.0;
    for step in &timeline.steps {
        for pv in &site.pv {
            for side in if pv.two_sided { &[1.0, -1.0][..] } else { &[1.0][..] } {
                falls_w +=
                    step.irradiance_w_m2 * pv.area_m2 * disc_mean(step.sun, pv.normal * *side);
            }
        }
    }
    for model in models {
        let scatter = bsdf(model.clone());
        let emission = Emission {
            site: &site,
            timeline: &timeline,
            bsdfs: vec![&scatter; 4],
            // So many that the narrowest lobe sends some onto the PV.
            settings: settings(40_000),
        };
        let (_, photons, tally) = trace(&emission);
        let flux = photons[0].flux_w;
        assert!(photons.iter().all(|p| p.flux_w == flux), "all carry the same");
        assert!((tally.effective_photons() / photons.len() as f64 - 1.0).abs() < 1e-6);
        assert!((tally.sent.flux_w / falls_w - 1.0).abs() < 0.01, "{model:?}: {tally:?}");
        for (name, account) in [
            ("blocked", tally.blocked),
            ("stored", tally.stored),
            ("not sampled", tally.not_sampled),
            ("absorbed", tally.absorbed),
        ] {
            assert!(account.photons > 0, "{model:?}: no photon was {name}");
            assert!(account.flux_w >= 0.0);
        }
        if !scatter.is_delta() {
            assert!(tally.too_far.photons > 0, "{model:?}: {tally:?}");
            assert!(tally.on_pv.photons > 0 && tally.escaped.photons > 0, "{model:?}: {tally:?}");
        }
    }
}

/// Mean over the sun's disc of the cosine to a normal, without what lies behind or below.
fn disc_mean(centre: DVec3, normal: DVec3) -> f64 {
    let across = centre.any_orthonormal_vector();
    let along = centre.cross(across);
    let radius = 0.2665_f64.to_radians();
    let mut sum = 0.0;
    for i in 0..60 {
        for j in 0..60 {
            let r = radius * ((f64::from(i) + 0.5) / 60.0).sqrt();
            let a = std::f64::consts::TAU * (f64::from(j) + 0.5) / 60.0;
            let d = (centre + (across * libm::cos(a) + along * libm::sin(a)) * libm::tan(r))
                .normalize();
            sum += if d.z > 0.0 { normal.dot(d).max(0.0) } else { 0.0 };
        }
    }
    sum / 3600.0
}

/// The first triangle along a ray by linear search in f64.
fn linear(site: &Site, origin: DVec3, direction: DVec3, min_m: f64) -> Option<(f64, usize)> {
    let mut best: Option<(f64, usize)> = None;
    for (i, triangle) in site.triangles.iter().enumerate() {
        let [a, b, c] = triangle.corners.map(Vec3::as_dvec3);
        let (e1, e2) = (b - a, c - a);
        let p = direction.cross(e2);
        let det = e1.dot(p);
        let u = (origin - a).dot(p) / det;
        let q = (origin - a).cross(e1);
        let v = direction.dot(q) / det;
        let t = e2.dot(q) / det;
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > min_m && best.is_none_or(|(b, _)| t < b) {
            best = Some((t, i));
        }
    }
    best
}

#[test]
fn every_landed_photon_sees_its_pv_and_its_sun() {
    let site = neighbourhood();
    let timeline = suns_of_a_day();
    let satin = bsdf(Model::PvGlass { index: 1.52, ggx_alpha: 0.3, cell_reflectance: 0.05 });
    let emission = Emission {
        site: &site,
        timeline: &timeline,
        bsdfs: vec![&satin; 4],
        settings: Settings { max_path_m: 60.0, ..settings(5_000) },
    };
    let (_, photons, _) = trace(&emission);
    let mut odd = 0;
    let mut seen = [0; 4];
    for p in &photons {
        assert!(p.normal.dot(p.direction) > 0.0);
        assert!(
            (p.direction.length() - 1.0).abs() < 1e-5 && (p.normal.length() - 1.0).abs() < 1e-5
        );
        seen[usize::from(p.surface)] += 1;
        let (at, back) = (p.position.as_dvec3(), p.direction.as_dvec3());
        let first = linear(&site, at, back, 1e-3);
        let from_pv = first.is_some_and(|(distance_m, triangle)| {
            distance_m < 60.0 + 0.01 && site.face_of(triangle as u32).pv == Some(p.surface)
        });
        // The start lies a millimetre above its surface: an edge may miss on the way back.
        if !from_pv {
            odd += 1;
            continue;
        }
        let start = at + back * (first.expect("hit").0 - 0.002);
        odd += usize::from(
            linear(&site, start, timeline.steps[p.timestep as usize].sun, 1e-3).is_some(),
        );
    }
    // Penumbras: the disc's centre may be hidden where its edge is seen.
    assert!(odd < photons.len() / 100, "{odd} of {} photons came through something", photons.len());
    assert!(seen.iter().all(|&n| n > 0), "{seen:?}: every surface throws light");
}

#[test]
fn two_threads_send_the_photons_that_one_sends() {
    let site = neighbourhood();
    let timeline = suns_of_a_day();
    let satin = bsdf(Model::PvGlass { index: 1.52, ggx_alpha: 0.1, cell_reflectance: 0.05 });
    let emission = Emission {
        site: &site,
        timeline: &timeline,
        bsdfs: vec![&satin; 4],
        settings: settings(40_000),
    };
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
        pool.install(|| trace(&emission))
    };
    let (one, two) = (with(1), with(2));
    assert!(one.0.emitted > 3 * glintmap::trace::BATCH_PHOTONS, "{:?}", one.0);
    assert!(one == two, "plans, photons or tallies differ");
    let three = with(3);
    assert!(one == three, "plans, photons or tallies differ");
}

#[test]
fn receivers_may_be_the_diffuse_ones_alone() {
    let site = neighbourhood();
    let timeline = suns_of_a_day();
    let tile = bsdf(Model::Lambertian { reflectance: 0.5 });
    let mut emission = Emission {
        site: &site,
        timeline: &timeline,
        bsdfs: vec![&tile; 4],
        settings: settings(20_000),
    };
    let (plan, _, all) = trace(&emission);
    // The same photons again: what isn't kept has escaped, to the last one.
    emission.settings.receivers = Receivers::Diffuse;
    let mut kept = Kept::default();
    let diffuse = run(&emission, &plan, &mut kept, &Silent).expect("run");
    let lost = all.stored.photons - diffuse.stored.photons;
    assert!(lost > 50, "{lost} landed on glass");
    assert_eq!(diffuse.escaped.photons, all.escaped.photons + lost);
    assert_eq!(kept.0.len() as u64, diffuse.stored.photons);
    let photons = kept.0;
    for p in photons.iter().take(500) {
        let (at, back) = (p.position.as_dvec3(), p.direction.as_dvec3());
        let (_, triangle) = linear(&site, at + back * 0.01, -back, 0.0).expect("it landed there");
        assert_eq!(site.face_of(triangle as u32).material, 0);
    }
}

#[test]
fn what_cannot_work_says_why() {
    let day = suns_of_a_day();
    let tile = bsdf(Model::Lambertian { reflectance: 0.5 });
    let black = bsdf(Model::Lambertian { reflectance: 0.0 });
    let mirror = bsdf(Model::Mirror { reflectance: 1.0 });
    let empty = Scene::new().quad(horizontal([0.0, 1.0], [0.0, 1.0], 0.0)).site();
    let lone = Scene::new().pv(horizontal([0.0, 1.0], [0.0, 1.0], 0.0), false).site();
    let flat = neighbourhood();
    let attempt = |site: &Site, bsdfs: Vec<&Bsdf>, timeline: &Timeline, settings: Settings| {
        plan(&Emission { site, timeline, bsdfs, settings }, &Silent).expect_err("can't work")
    };
    let usual = settings(1000);
    assert!(matches!(attempt(&empty, vec![], &day, usual), Error::NoPv));
    assert!(matches!(attempt(&flat, vec![&tile], &day, usual), Error::Bsdfs { .. }));
    assert!(matches!(attempt(&flat, vec![&tile; 4], &timeline(&[]), usual), Error::NoSun));
    assert!(matches!(attempt(&flat, vec![&black; 4], &day, usual), Error::NoFlux { .. }));
    let no_path = Settings { max_path_m: f64::NAN, ..usual };
    assert!(matches!(attempt(&flat, vec![&tile; 4], &day, no_path), Error::Setting { .. }));
    let down = timeline(&[(sun(90.0, -5.0), 100.0)]);
    assert!(matches!(attempt(&lone, vec![&tile], &down, usual), Error::NoFlux { .. }));
    let error = attempt(&lone, vec![&mirror], &day, usual);
    assert!(matches!(error, Error::NothingLands { stored: 0, .. }), "{error}");
    assert!(error.to_string().contains("100.0 % left towards the sky"), "{error}");
}
