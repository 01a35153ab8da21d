//! Annual maps against closed forms: from the sun through the tracer, the store and the default
//! estimator to the pixel.

use std::f64::consts::PI;

use glam::{Vec3, vec3};
use glintmap::base::{Photon, Silent};
use glintmap::bsdf::Model;
use glintmap::render::{Annual, Gather, Hit, HitKind, HitMap, Surfaces, annual};
use glintmap::site::Site;
use glintmap::trace::{Emission, Settings};

use super::render::gather::store_within;
use super::trace::{
    Scene, bsdf, horizontal, mirror_scene, settings, square_factor, sun, timeline, trace, wall,
};

/// A square of 2 m that scatters evenly, lit by two suns; what stands around it is `scene`'s.
fn photons_of_a_tile(site: &Site, stored: u64, seed: u64) -> (Vec<Photon>, f64) {
    let timeline = timeline(&[(sun(200.0, 40.0), 900.0), (sun(250.0, 10.0), 300.0)]);
    let tile = bsdf(Model::Lambertian { reflectance: 0.7 });
    let settings = Settings { sun_visibility: false, seed, ..settings(stored) };
    let emission = Emission { site, timeline: &timeline, bsdfs: vec![&tile], settings };
    let (_, photons, _) = trace(&emission);
    // Every timestep stands for an hour: W/m2 summed over the suns are Wh/m2.
    let radiosity = timeline.steps.iter().map(|s| 0.7 * s.irradiance_w_m2 * s.sun.z).sum();
    (photons, radiosity)
}

fn tile() -> Scene {
    Scene::new().pv(horizontal([-1.0, 1.0], [-1.0, 1.0], 0.0), false)
}

/// The map at some places with one normal.
fn map(site: &Site, photons: &[Photon], at: &[Vec3], normal: Vec3, settings: &Gather) -> Annual {
    let hit = |&position: &Vec3| Hit {
        position,
        normal,
        object: 0,
        face: 0,
        pv_distance_m: 1.0,
        kind: HitKind::Receiver,
    };
    let hits = HitMap { columns: at.len(), rows: 1, hits: at.iter().map(hit).collect() };
    let folder = tempfile::tempdir().expect("a folder");
    let timesteps = photons.iter().map(|p| p.timestep + 1).max().unwrap_or(1);
    let store = store_within(folder.path(), photons, timesteps, site.bounds);
    let weights = vec![1.0; timesteps as usize];
    let surfaces = Surfaces::of(site);
    annual(&store, Some(&surfaces), &hits, &weights, settings, &Silent).expect("gathers")
}

/// What the default estimator finds over what is true, on average.
fn ratio(map: &Annual, truth: impl Fn(usize) -> f64) -> f64 {
    let values = map.surface.data();
    let sum: f64 = values.iter().enumerate().map(|(i, v)| f64::from(*v) / truth(i)).sum();
    sum / values.len() as f64
}

#[test]
fn a_lambertian_square_by_the_closed_form() {
    let site = tile().quad(horizontal([-3.0, 3.0], [-3.0, 3.0], 2.0)).site();
    let (photons, radiosity) = photons_of_a_tile(&site, 200_000, 1);
    let at: Vec<Vec3> = (0..225)
        .map(|i| vec3((i % 15) as f32 * 0.3 - 2.1, (i / 15) as f32 * 0.3 - 2.1, 2.0))
        .collect();
    let map = map(&site, &photons, &at, Vec3::NEG_Z, &Gather::default());
    let truth = |i: usize| {
        let p = at[i].as_dvec3();
        radiosity * square_factor(p.x, p.y, 1.0, 2.0)
    };
    let mean = ratio(&map, truth);
    // 225 discs of 400 photons: 0.33 % is one sigma.
    assert!((mean - 1.0).abs() < 0.012, "{mean}");
    let outside = (0..at.len())
        .filter(|&i| {
            let (found, error) = (map.surface.data()[i], map.error.data()[i]);
            (f64::from(found) - truth(i)).abs() > 2.0 * f64::from(error)
        })
        .count();
    // 5 % are 10 +- 3.
    assert!(outside <= 21, "{outside} of {} beyond two standard errors", at.len());
}

/// The receiver ends in the middle, where the truth is level across the edge: a disc there is half
/// a disc.
#[test]
fn no_dark_rim_where_the_receiver_ends() {
    let site = tile().quad(horizontal([0.0, 3.0], [-3.0, 3.0], 2.0)).site();
    let at: Vec<Vec3> = (0..40).map(|i| vec3(0.005, i as f32 * 0.05 - 0.975, 2.0)).collect();
    let (mut with, mut without) = (0.0, 0.0);
    let seeds = 3;
    for seed in 0..seeds {
        let (photons, radiosity) = photons_of_a_tile(&site, 200_000, seed);
        let truth = |i: usize| radiosity * square_factor(0.005, f64::from(at[i].y), 1.0, 2.0);
        let settings = Gather { bandwidth: 200, ..Gather::default() };
        with += ratio(&map(&site, &photons, &at, Vec3::NEG_Z, &settings), truth);
        let open = Gather { edges: false, ..settings };
        without += ratio(&map(&site, &photons, &at, Vec3::NEG_Z, &open), truth);
    }
    let (with, without) = (with / f64::from(seeds as u32), without / f64::from(seeds as u32));
    assert!((with - 1.0).abs() < 0.02, "{with}");
    assert!(without < 0.65, "the check sees dark rims: {without}");
}

/// A wall without thickness beside the tile: nothing behind it, and nothing leaks.
#[test]
fn nothing_leaks_through_a_thin_wall() {
    let site = tile()
        .quad(horizontal([-3.0, 3.0], [-3.0, 3.0], 2.0))
        .quad(wall(1.2, [-3.0, 3.0], [-1.0, 2.0]))
        .site();
    let (photons, _) = photons_of_a_tile(&site, 100_000, 1);
    let at: Vec<Vec3> = (0..20).map(|i| vec3(1.23 + 0.02 * i as f32, 0.1, 2.0)).collect();
    let settings = Gather { max_radius_m: Some(0.5), ..Gather::default() };
    let dark = map(&site, &photons, &at, Vec3::NEG_Z, &settings);
    assert_eq!(dark.surface.data(), [0.0; 20]);
    let leaky = Gather { edges: false, ..settings };
    let leaks = map(&site, &photons, &at[..10], Vec3::NEG_Z, &leaky);
    assert!(leaks.surface.data().iter().all(|v| *v > 1.0), "the check sees leaks");
}

/// The border of a mirror's footprint is as soft as the sun is wide: the share of its disc that a
/// place sees in the mirror.
#[test]
fn a_footprint_ends_in_the_suns_penumbra() {
    let site = mirror_scene().site();
    let timeline = timeline(&[(sun(270.0, 30.0), 1000.0)]);
    let mirror = bsdf(Model::Mirror { reflectance: 0.9 });
    let settings = settings(300_000);
    let emission = Emission { site: &site, timeline: &timeline, bsdfs: vec![&mirror], settings };
    let (_, photons, _) = trace(&emission);
    let (elevation, sun_rad) = (30_f64.to_radians(), 0.2665_f64.to_radians());
    let beam = 900.0 * libm::cos(elevation);
    // A place on the wall at height z sees the mirror's far edge, 22 m away, as far below it.
    let truth = |z: f64| {
        let u = ((elevation - libm::atan(z / 22.0)) / sun_rad).clamp(-1.0, 1.0);
        beam * (0.5 + (u * (1.0 - u * u).sqrt() + libm::asin(u)) / PI)
    };
    let top = 22.0 * libm::tan(elevation);
    let gather = Gather { bandwidth: 150, max_radius_m: Some(0.2), ..Gather::default() };
    for off in [-0.4, -0.1, -0.05, 0.0, 0.05, 0.1] {
        let z = top + off;
        let at: Vec<Vec3> = (0..60).map(|i| vec3(20.0, i as f32 * 0.06 - 1.77, z as f32)).collect();
        let map = map(&site, &photons, &at, Vec3::NEG_X, &gather);
        // A disc shows the mean of the truth within.
        let blurred = |radius: f64| {
            let strips = 200;
            let part = |i: i32| {
                let h = (f64::from(i) + 0.5) / f64::from(strips) * 2.0 - 1.0;
                (truth(z + radius * h), (1.0 - h * h).sqrt())
            };
            let (sum, weights) = (0..strips)
                .map(part)
                .fold((0.0, 0.0), |(s, w), (e, weight)| (s + e * weight, w + weight));
            sum / weights
        };
        let mean = ratio(&map, |i| blurred(f64::from(map.radius_m.data()[i])));
        // Some 30 discs that share no photons: 1.5 % is one sigma; more where they are wide.
        assert!((mean - 1.0).abs() < 0.05, "{off} m: {mean}");
    }
    let beyond = [vec3(20.0, 0.0, top as f32 + 0.4)];
    let dark = map(&site, &photons, &beyond, Vec3::NEG_X, &gather);
    assert_eq!(dark.surface.data(), [0.0]);
    // Were the sun a point, the border would be sharp.
    assert!((truth(top) / beam - 0.5).abs() < 1e-3 && truth(top - 0.1) < 0.95 * beam);
}
