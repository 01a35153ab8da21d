//! Where surfaces end: rims, corners, walls. And what noise is said to be.

use glam::{Vec3, vec3};
use glintmap::base::{Photon, Purpose, Silent, Stream};
use glintmap::render::{Annual, Estimator, Gather, Hit, HitKind, HitMap, Kernel, Surfaces, annual};
use glintmap::site::Site;

use super::Builder;
use super::gather::store_of;

/// Photons of 1 W at random over rectangles that lie level: corner, corner, number.
fn rain(parts: &[(Vec3, Vec3, usize)], seed: u64) -> Vec<Photon> {
    let mut random = Stream::new(seed, Purpose::Survey, 0);
    let mut out = Vec::new();
    for &(low, high, count) in parts {
        for _ in 0..count {
            let share = vec3(random.uniform_fine() as f32, random.uniform_fine() as f32, 0.0);
            out.push(Photon {
                position: low + (high - low) * share,
                normal: Vec3::Z,
                direction: vec3(0.6, 0.0, 0.8),
                flux_w: 1.0,
                timestep: 0,
                surface: 0,
            });
        }
    }
    out
}

/// A map whose pixels lie in these places on level ground.
fn places(places: &[Vec3]) -> HitMap {
    let hit = |&position: &Vec3| Hit {
        position,
        normal: Vec3::Z,
        object: 0,
        face: 0,
        pv_distance_m: 1.0,
        kind: HitKind::Receiver,
    };
    HitMap { columns: places.len(), rows: 1, hits: places.iter().map(hit).collect() }
}

fn gather(site: &Site, photons: &[Photon], at: &[Vec3], settings: &Gather) -> Annual {
    let folder = tempfile::tempdir().expect("a folder");
    let store = store_of(folder.path(), photons, 1);
    let surfaces = Surfaces::of(site);
    annual(&store, Some(&surfaces), &places(at), &[1.0], settings, &Silent).expect("gathers")
}

fn mean(map: &Annual, truth: f64) -> f64 {
    let data = map.surface.data();
    data.iter().map(|v| f64::from(*v)).sum::<f64>() / data.len() as f64 / truth
}

/// Mean over many seeds at some places, relative to the truth.
fn means(
    site: &Site,
    parts: &[(Vec3, Vec3, usize)],
    at: &[Vec3],
    settings: &Gather,
    truth: f64,
) -> f64 {
    let seeds = 12;
    (0..seeds).map(|seed| mean(&gather(site, &rain(parts, seed), at, settings), truth)).sum::<f64>()
        / seeds as f64
}

fn quad(low: Vec3, high: Vec3) -> [Vec3; 4] {
    [low, vec3(high.x, low.y, low.z), high, vec3(low.x, high.y, high.z)]
}

fn settings(bandwidth: usize) -> Gather {
    Gather { bandwidth, max_radius_m: Some(1.5), ..Gather::default() }
}

fn line(from: Vec3, to: Vec3, count: usize) -> Vec<Vec3> {
    (0..count).map(|i| from + (to - from) * ((i as f32 + 0.5) / count as f32)).collect()
}

/// A roof of 6 m with the truth of 100 W/m2 everywhere on it: rims and corners are as bright as
/// the middle, for both kernels; without edges they would be half and a quarter as bright.
#[test]
fn rims_are_as_bright_as_the_middle() {
    let mut b = Builder::default();
    b.polygon("roof", &quad(vec3(-3.0, -3.0, 4.0), vec3(3.0, 3.0, 4.0)), false);
    let site = b.site();
    let parts = [(vec3(-3.0, -3.0, 4.0), vec3(3.0, 3.0, 4.0), 14_400)];
    // All four sides, all four corners: as many photons as possible for each seed.
    let turned = |places: Vec<Vec3>| -> Vec<Vec3> {
        let turn =
            |p: &Vec3| [*p, vec3(-p.y, p.x, p.z), vec3(-p.x, -p.y, p.z), vec3(p.y, -p.x, p.z)];
        places.iter().flat_map(turn).collect()
    };
    let rim = turned(line(vec3(-2.0, -2.98, 4.0), vec3(2.0, -2.98, 4.0), 40));
    let corner = turned(line(vec3(2.9, 2.9, 4.0), vec3(2.98, 2.98, 4.0), 4));
    for kernel in [Kernel::Flat, Kernel::Epanechnikov] {
        let with = Gather { kernel, ..settings(100) };
        let at_rim = means(&site, &parts, &rim, &with, 400.0);
        let at_corner = means(&site, &parts, &corner, &with, 400.0);
        // The noise of the means is 0.7 and 1.5 %.
        assert!((at_rim - 1.0).abs() < 0.02, "{kernel:?}: {at_rim}");
        assert!((at_corner - 1.0).abs() < 0.05, "{kernel:?}: {at_corner}");
    }
    let without = Gather { edges: false, ..settings(100) };
    let dark = means(&site, &parts, &rim, &without, 400.0);
    assert!(dark < 0.65, "the check sees dark rims: {dark}");
}

/// Ground around a house that stands on it: as bright at the foot of its walls as elsewhere, and
/// nothing is spread over the ground under the house.
#[test]
fn the_foot_of_a_wall_is_as_bright_as_open_ground() {
    let mut b = Builder::default();
    b.polygon("ground", &quad(vec3(-6.0, -6.0, 0.0), vec3(6.0, 6.0, 0.0)), false);
    b.block("house", vec3(0.0, -4.0, 0.0), vec3(4.0, 4.0, 5.0));
    let site = b.site();
    let parts = [(vec3(-4.0, -6.0, 0.0), vec3(0.0, 6.0, 0.0), 4800)];
    let foot = line(vec3(-0.04, -2.5, 0.0), vec3(-0.04, 2.5, 0.0), 40);
    let bright = means(&site, &parts, &foot, &settings(100), 100.0);
    assert!((bright - 1.0).abs() < 0.02, "{bright}");
    let open = line(vec3(-2.0, -3.0, 0.0), vec3(-2.0, 3.0, 0.0), 40);
    let bright = means(&site, &parts, &open, &settings(100), 100.0);
    assert!((bright - 1.0).abs() < 0.02, "{bright}");
    let inside = gather(&site, &rain(&parts, 1), &[vec3(1.0, 0.0, 0.0)], &settings(100));
    assert_eq!(inside.surface.data(), [0.0]);
}

/// A garden wall without thickness, and a slab above the ground: light stays on its side.
#[test]
fn nothing_leaks_through_a_thin_wall_or_a_slab() {
    let mut b = Builder::default();
    b.polygon("ground", &quad(vec3(-6.0, -6.0, 0.0), vec3(6.0, 6.0, 0.0)), false);
    let wall =
        [vec3(0.0, -6.0, 0.0), vec3(0.0, 6.0, 0.0), vec3(0.0, 6.0, 2.0), vec3(0.0, -6.0, 2.0)];
    b.polygon("wall", &wall, false);
    b.polygon("slab", &quad(vec3(2.0, -4.0, 0.5), vec3(5.0, 4.0, 0.5)), false);
    let site = b.site();
    let lit = [
        (vec3(-4.0, -6.0, 0.0), vec3(0.0, 6.0, 0.0), 4800),
        (vec3(2.0, -4.0, 0.5), vec3(5.0, 4.0, 0.5), 2400),
    ];
    let behind = line(vec3(0.06, 0.0, 0.0), vec3(1.0, 0.0, 0.0), 10);
    let below = line(vec3(2.5, -2.0, 0.0), vec3(4.5, 2.0, 0.0), 10);
    let dark = [behind, below].concat();
    let photons = rain(&lit, 1);
    let map = gather(&site, &photons, &dark, &settings(100));
    assert_eq!(map.surface.data(), [0.0; 20]);
    let leaky = Gather { edges: false, plane_tolerance_m: None, ..settings(100) };
    let map = gather(&site, &photons, &dark, &leaky);
    assert!(map.surface.data().iter().all(|v| *v > 1.0), "the check sees leaks");
    let top = gather(&site, &photons, &[vec3(3.5, 0.0, 0.5)], &settings(100));
    assert!((top.surface.data()[0] - 100.0).abs() < 40.0);
}

/// On an open surface edges and tolerances change no bit.
#[test]
fn open_ground_is_not_touched() {
    let mut b = Builder::default();
    b.polygon("ground", &quad(vec3(-20.0, -20.0, 0.0), vec3(20.0, 20.0, 0.0)), false);
    let site = b.site();
    let photons = rain(&[(vec3(-5.0, -5.0, 0.0), vec3(5.0, 5.0, 0.0), 8000)], 3);
    let at: Vec<Vec3> = (0..400)
        .map(|i| vec3((i % 20) as f32 * 0.2 - 2.0, (i / 20) as f32 * 0.2 - 2.0, 0.0))
        .collect();
    let map = gather(&site, &photons, &at, &settings(150));
    let plain = Gather { edges: false, plane_tolerance_m: None, ..settings(150) };
    assert_eq!(map, gather(&site, &photons, &at, &plain));
    // The paper's counts the k-th photon, too.
    let radiance = Gather { estimator: Estimator::Radiance, ..settings(150) };
    let theirs = gather(&site, &photons, &at, &radiance);
    for (ours, theirs) in map.surface.data().iter().zip(theirs.surface.data()) {
        assert!((theirs / ours - 150.0 / 149.0).abs() < 1e-5, "{theirs}, {ours}");
    }
}

/// The paper's estimator counts what lands beside the pixel on a steep roof or a crown, as Radiance
/// does; ours takes normals within 60 degrees.
#[test]
fn only_the_papers_estimator_counts_steep_neighbours() {
    let mut b = Builder::default();
    b.polygon("ground", &quad(vec3(-5.0, -5.0, 0.0), vec3(5.0, 5.0, 0.0)), false);
    let site = b.site();
    let inclined = |degrees: f32| {
        let mut photons = rain(&[(vec3(-5.0, -5.0, 0.0), vec3(5.0, 5.0, 0.0), 4000)], 7);
        for photon in photons.iter_mut().skip(1).step_by(2) {
            photon.normal = vec3(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos());
        }
        photons
    };
    let at = line(vec3(-3.0, 0.0, 0.0), vec3(3.0, 0.0, 0.0), 30);
    let default = settings(100);
    let theirs = Gather { estimator: Estimator::Radiance, ..default };
    let share = |degrees, how| mean(&gather(&site, &inclined(degrees), &at, how), 40.0);
    for (degrees, ours, paper) in
        [(50.0, 1.0, 1.0), (70.0, 0.5, 1.0), (88.0, 0.5, 1.0), (95.0, 0.5, 0.5)]
    {
        let found = share(degrees, &default);
        assert!((found - ours).abs() < 0.1, "{degrees} degrees: ours {found}, expected {ours}");
        let found = share(degrees, &theirs);
        assert!(
            (found - paper).abs() < 0.1,
            "{degrees} degrees: the paper's {found}, expected {paper}"
        );
    }
}

/// The standard error covers the mean of 64 seeds in 95 of 100 cases.
#[test]
fn the_standard_error_is_what_seeds_differ_by() {
    let mut b = Builder::default();
    b.polygon("ground", &quad(vec3(-5.0, -5.0, 0.0), vec3(5.0, 5.0, 0.0)), false);
    let site = b.site();
    let at: Vec<Vec3> = (0..49)
        .map(|i| vec3((i % 7) as f32 * 1.4 - 4.2, (i / 7) as f32 * 1.4 - 4.2, 0.0))
        .collect();
    let (seeds, parts) = (64, [(vec3(-5.0, -5.0, 0.0), vec3(5.0, 5.0, 0.0), 4000)]);
    let settings = Gather { max_radius_m: Some(3.0), ..settings(100) };
    let maps: Vec<Annual> =
        (0..seeds).map(|seed| gather(&site, &rain(&parts, 100 + seed), &at, &settings)).collect();
    let mut covered = 0;
    for pixel in 0..at.len() {
        let value = |m: &Annual| f64::from(m.surface.data()[pixel]);
        let mean = maps.iter().map(value).sum::<f64>() / seeds as f64;
        let error = |m: &Annual| f64::from(m.error.data()[pixel]);
        covered += maps.iter().filter(|m| (value(m) - mean).abs() <= 1.96 * error(m)).count();
    }
    let share = covered as f64 / (seeds as usize * at.len()) as f64;
    assert!((share - 0.95).abs() < 0.02, "{share}");
}

/// Four times the photons, half the noise.
#[test]
fn noise_falls_with_the_root_of_the_photons() {
    let mut b = Builder::default();
    b.polygon("ground", &quad(vec3(-5.0, -5.0, 0.0), vec3(5.0, 5.0, 0.0)), false);
    let site = b.site();
    let at = [vec3(0.0, 0.0, 0.0), vec3(2.0, 1.0, 0.0), vec3(-2.0, -1.0, 0.0)];
    let noise = |photons: usize, bandwidth: usize| {
        let parts = [(vec3(-5.0, -5.0, 0.0), vec3(5.0, 5.0, 0.0), photons)];
        let (mut sum, mut count) = (0.0, 0.0);
        for seed in 0..32 {
            let map = gather(&site, &rain(&parts, seed), &at, &settings(bandwidth));
            let truth = photons as f64 / 100.0;
            for v in map.surface.data() {
                let off = f64::from(*v) / truth - 1.0;
                sum += off * off;
                count += 1.0;
            }
        }
        (sum / count).sqrt()
    };
    // The same radius: as many more photons in it as there are in all.
    let (few, many) = (noise(4000, 50), noise(16_000, 200));
    assert!((few / many - 2.0).abs() < 0.35, "{few}, {many}");
}
