//! A spot wholly inside the beam of a large mirror: what the whole chain says, from the photons
//! through the store to the series, against E = DNI R(theta) cos(theta_receiver).

use std::collections::BTreeMap;
use std::sync::Mutex;

use crate::support::photons;
use glam::{DVec3, Vec3};
use glintmap::base::Irradiance;
use glintmap::base::{Grid, SeriesEntry, Silent, SinkError, TileRect, TileSink, Timeline};
use glintmap::bsdf::{Bsdf, Model};
use glintmap::pages::{self, About, Access, OpenOptions, Spill, Store};
use glintmap::render::{self, Gather, Hit, HitKind, HitMap};
use glintmap::site::{Face, Material, Object, PvSurface, Site, Triangle};
use glintmap::trace::{Emission, Receivers, Settings};

use super::trace::{sun, timeline};

const BANDWIDTH: usize = 4000;
const SUN_RADIUS_DEG: f64 = 0.2665;
/// Elevations of the suns: incidences on the flat mirror of 85, 80 and 60 degrees.
const SUNS: [(f64, f64, f64); 3] =
    [(270.0, 5.0, 400.0), (262.0, 10.0, 600.0), (275.0, 30.0, 850.0)];

/// 60 x 40 m of level PV around the origin, and a wall of 12 x 8 m on it at x = 10.
fn site() -> Site {
    let quads = [
        ([[-50., -20., 0.], [10., -20., 0.], [10., 20., 0.], [-50., 20., 0.]], Some(0_u16)),
        ([[10.5, -6., 0.2], [10.5, 6., 0.2], [10.5, 6., 8.2], [10.5, -6., 8.2]], None),
    ];
    let mut triangles = Vec::new();
    let mut faces = Vec::new();
    for (corners, pv) in quads {
        let [a, b, c, d]: [Vec3; 4] = corners.map(Vec3::from_array);
        let face = faces.len() as u32;
        triangles.extend([[a, b, c], [a, c, d]].map(|corners| Triangle { corners, face }));
        faces.push(Face { object: 0, material: 0, pv });
    }
    let pv = PvSurface {
        name: "mirror".into(),
        entry: 0,
        triangles: vec![0, 1],
        normal: DVec3::Z,
        area_m2: 2400.0,
        two_sided: false,
    };
    let object = Object { id: "all".into(), kind: String::new() };
    let material = Material { name: "grey".into(), reflectance: [0.25; 3], diffuse: true };
    Site::from_parts(
        triangles,
        faces,
        vec![object],
        vec![material],
        vec![pv],
        DVec3::ZERO,
        Vec::new(),
    )
}

fn suns() -> Timeline {
    let suns = SUNS
        .map(|(azimuth, elevation, irradiance_w_m2)| (sun(azimuth, elevation), irradiance_w_m2));
    let mut out = timeline(&suns);
    for (i, step) in out.steps.iter_mut().enumerate() {
        step.weight_h = 0.25 + i as f64;
    }
    Timeline { sun_diameter_deg: 2.0 * SUN_RADIUS_DEG, ..out }
}

/// Fresnel's equations for unpolarised light, written down once more.
fn fresnel(index: f64, cos: f64) -> f64 {
    let inside = (1.0 - (1.0 - cos * cos) / (index * index)).sqrt();
    let s = (cos - index * inside) / (cos + index * inside);
    let p = (index * cos - inside) / (index * cos + inside);
    0.5 * (s * s + p * p)
}

/// Mean of `f` over the sun's disc around `centre`.
fn over_disc(centre: DVec3, f: impl Fn(DVec3) -> f64) -> f64 {
    let across = centre.any_orthonormal_vector();
    let along = centre.cross(across);
    let radius = libm::tan(SUN_RADIUS_DEG.to_radians());
    let mut sum = 0.0;
    for i in 0..40 {
        for j in 0..40 {
            let r = radius * ((f64::from(i) + 0.5) / 40.0).sqrt();
            let a = std::f64::consts::TAU * (f64::from(j) + 0.5) / 40.0;
            sum += f((centre + (across * libm::cos(a) + along * libm::sin(a)) * r).normalize());
        }
    }
    sum / 1600.0
}

struct Series {
    width: usize,
    values: Mutex<BTreeMap<(usize, u32), f64>>,
}

impl TileSink for Series {
    fn has(&self, _tile: TileRect) -> bool {
        false
    }

    fn put(&self, tile: TileRect, entries: &[SeriesEntry]) -> Result<(), SinkError> {
        let mut values = self.values.lock().expect("not poisoned");
        for e in entries {
            let (row, column) =
                (usize::from(e.pixel) / tile.columns, usize::from(e.pixel) % tile.columns);
            let pixel = (tile.row + row) * self.width + tile.column + column;
            values.insert((pixel, e.timestep), f64::from(e.irradiance_w_m2));
        }
        Ok(())
    }
}

fn store(site: &Site, timeline: &Timeline, model: Model, folder: &std::path::Path) -> Store {
    let bsdf = Bsdf::from_model(&model).expect("valid");
    let settings = Settings {
        stored: 300_000,
        max_path_m: 200.0,
        seed: 5,
        sun_visibility: true,
        receivers: Receivers::All,
    };
    let emission = Emission { site, timeline, bsdfs: vec![&bsdf], settings };
    let plan = photons::plan(&emission, &Silent).expect("pilot");
    let (spilled, path) = (folder.join("spill"), folder.join("photons.gmp"));
    let mut spill =
        Spill::create(&spilled, site.bounds, settings.stored, 64 << 20).expect("begins");
    let tally = photons::run(&emission, &plan, &mut spill, &Silent).expect("runs");
    spill.finish().expect("finishes");
    let about = About {
        provenance: crate::support::series::provenance(),
        timesteps: timeline.steps.len() as u32,
        surfaces: vec!["mirror".into()],
        basis: timeline.basis,
        tally,
    };
    pages::build(&spilled, &path, &about, 64 << 20, &Silent).expect("builds");
    let options = OpenOptions { cache_bytes: 64 << 20, access: Access::Pread };
    Store::open(&path, &options).expect("opens")
}

#[test]
fn a_spot_inside_the_mirrored_beam_gets_dni_times_fresnel_times_cosine() {
    let (site, timeline) = (site(), suns());
    // Along the wall, far from the border of every beam: discs of some 0.5 m.
    let spots: Vec<Vec3> = (0..5).map(|i| Vec3::new(10.5, -2.4 + 1.2 * i as f32, 1.3)).collect();
    let hit = |position: &Vec3| Hit {
        position: *position,
        normal: Vec3::NEG_X,
        object: 0,
        face: 1,
        pv_distance_m: 1.0,
        kind: HitKind::Receiver,
    };
    let hits = HitMap { columns: spots.len(), rows: 1, hits: spots.iter().map(hit).collect() };
    let gather = Gather { bandwidth: BANDWIDTH, max_radius_m: Some(2.0), ..Gather::default() };
    for model in [Model::Glass { index: 1.52 }, Model::Mirror { reflectance: 0.9 }] {
        let folder = tempfile::tempdir().expect("folder");
        let store = store(&site, &timeline, model.clone(), folder.path());
        let reflectance = |cos: f64| match model {
            Model::Glass { index } => fresnel(index, cos),
            _ => 0.9,
        };
        let expected: Vec<f64> = timeline
            .steps
            .iter()
            .map(|step| {
                // On the wall, which faces west, the mirrored sun stands as far up as the sun.
                step.irradiance_w_m2 * over_disc(step.sun, |s| reflectance(s.z) * -s.x)
            })
            .collect();
        for (quantity, factor) in [(Irradiance::Surface, false), (Irradiance::FacingBeam, true)] {
            let sink = Series { width: spots.len(), values: Mutex::default() };
            render::series(&store, None, &hits, &gather, quantity, &sink, &Silent)
                .expect("renders");
            let values = sink.values.into_inner().expect("not poisoned");
            for (t, step) in timeline.steps.iter().enumerate() {
                // E_n: the same without the cosine on the wall.
                let truth = if factor { expected[t] / -step.sun.x } else { expected[t] };
                let share = expected[t] / expected.iter().sum::<f64>();
                let sigma = (1.0 / (share * BANDWIDTH as f64)).sqrt();
                let mut mean = 0.0;
                for pixel in 0..spots.len() {
                    let found = values[&(pixel, t as u32)];
                    mean += found / spots.len() as f64;
                    let z = (found / truth - 1.0) / sigma;
                    assert!(z.abs() < 4.5, "{model:?} sun {t}: {found:.2} of {truth:.2}, z {z:.1}");
                }
                // Neighbouring discs overlap a little: as if there were 4 of them.
                let z = (mean / truth - 1.0) / (0.5 * sigma);
                assert!(z.abs() < 4.0, "{model:?} sun {t}: {mean:.2} of {truth:.2}, z {z:.1}");
            }
        }
        // The year's map says the same: sum of E times hours.
        let weights: Vec<f64> = timeline.steps.iter().map(|s| s.weight_h).collect();
        let annual =
            render::annual(&store, None, &hits, &weights, &gather, &Silent).expect("renders");
        let truth: f64 = expected.iter().zip(&weights).map(|(e, h)| e * h).sum();
        for &found in Grid::data(&annual.surface) {
            let off = f64::from(found) / truth - 1.0;
            assert!(off.abs() < 4.5 / (BANDWIDTH as f64 / 3.0).sqrt(), "{model:?}: {off:.4}");
        }
    }
}
