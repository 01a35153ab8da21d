//! What is left out reaches nothing, and what is kept is unbiased.

use glam::Vec3;

use super::*;
use crate::base::{Aabb, SensorSheet, SpectralBasis, Timeline, Timestep, VirtualSensor};
use crate::bsdf::{Bsdf, Chart, Cone, Model, Square, on_circle};
use crate::site::{Bvh, Face, Material, Object, PvSurface, Site, Triangle};
use crate::trace::Settings;

/// Terrain of large and small triangles, boxes here and there (some float), and PV.
fn scene(seed: u64, pv: &[([Vec3; 4], bool)]) -> Site {
    let mut triangles = Vec::new();
    let mut faces = Vec::new();
    let mut quad = |corners: [Vec3; 4], pv: Option<u16>| {
        let first = triangles.len() as u32;
        for [i, j, k] in [[0, 1, 2], [0, 2, 3]] {
            let corners = [corners[i], corners[j], corners[k]];
            triangles.push(Triangle { corners, face: faces.len() as u32 });
        }
        faces.push(Face { object: 0, material: 0, pv });
        first
    };
    let mut random = Stream::new(seed, Purpose::Survey, 0);
    let mut one = |low: f32, high: f32| low + (high - low) * random.uniform() as f32;
    for i in 0..6 {
        for j in 0..6 {
            let at = |i: i32, j: i32| {
                let (x, y) = (40.0 * i as f32 - 120.0, 40.0 * j as f32 - 120.0);
                Vec3::new(x, y, -10.0 + 0.03 * x + 3.0 * ((i * 5 + j * 3) % 4) as f32)
            };
            quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], None);
        }
    }
    for _ in 0..40 {
        let base = Vec3::new(one(-90.0, 90.0), one(-90.0, 90.0), one(-12.0, 12.0));
        let size = Vec3::new(one(0.2, 12.0), one(0.2, 12.0), one(0.2, 9.0));
        let at = |x: u8, y: u8, z: u8| base + size * Vec3::new(x.into(), y.into(), z.into());
        quad([at(0, 0, 0), at(1, 0, 0), at(1, 0, 1), at(0, 0, 1)], None);
        quad([at(0, 1, 0), at(1, 1, 0), at(1, 1, 1), at(0, 1, 1)], None);
        quad([at(0, 0, 0), at(0, 1, 0), at(0, 1, 1), at(0, 0, 1)], None);
        // A slanted lid.
        quad([at(0, 0, 1), at(1, 0, 1), at(1, 1, 0), at(0, 1, 0)], None);
    }
    let mut surfaces = Vec::new();
    for (i, &(corners, two_sided)) in pv.iter().enumerate() {
        let first = quad(corners, Some(i as u16));
        let across = (corners[1] - corners[0]).cross(corners[2] - corners[0]).as_dvec3();
        surfaces.push(PvSurface {
            name: format!("pv/{i}"),
            entry: 0,
            triangles: vec![first, first + 1],
            normal: across.normalize(),
            area_m2: across.length(),
            two_sided,
        });
    }
    let bounds = Aabb::around(triangles.iter().flat_map(|t: &Triangle| t.corners));
    Site {
        bvh: Bvh::build(&triangles),
        triangles,
        faces,
        objects: vec![Object { id: String::new(), kind: String::new() }],
        materials: vec![Material { name: "grey".into(), reflectance: [0.25; 3], diffuse: true }],
        pv: surfaces,
        origin: DVec3::ZERO,
        bounds,
        crowns: None,
        findings: Vec::new(),
    }
}

fn noon() -> Timeline {
    Timeline {
        steps: vec![Timestep {
            day: 0,
            hour: 12.0,
            sun: DVec3::new(0.3, 0.4, 0.8).normalize(),
            irradiance_w_m2: 1000.0,
            weight_h: 1.0,
            segment: 0,
        }],
        step_h: 1.0,
        year: 2025,
        half_year: false,
        sun_diameter_deg: 0.533,
        basis: SpectralBasis::Broadband,
    }
}

#[test]
fn what_the_horizon_drops_reaches_nothing_and_it_drops_nearly_all_of_that() {
    let roof = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let pv = [
        // A slope to the west and its ridge, a flat roof, a façade, a free two-sided sheet.
        ([roof(0., 0., 4.0), roof(0., 12., 4.0), roof(-10., 12., 1.3), roof(-10., 0., 1.3)], false),
        ([roof(20., 0., 3.), roof(31., 0., 3.), roof(31., 9., 3.), roof(20., 9., 3.)], false),
        ([roof(5., -20., 0.), roof(15., -20., 0.), roof(15., -20., 7.), roof(5., -20., 7.)], false),
        (
            [roof(-30., 20., 8.), roof(-26., 20., 8.), roof(-26., 25., 9.), roof(-30., 25., 9.)],
            true,
        ),
    ];
    let bsdf = Bsdf::from_model(&Model::Lambertian { reflectance: 0.5 }).expect("valid");
    for (seed, max_path_m) in [(3, 100.0), (4, 25.0), (5, 1000.0)] {
        let site = scene(seed, &pv);
        let timeline = noon();
        let emission = Emission {
            site: &site,
            timeline: &timeline,
            bsdfs: vec![&bsdf; 4],
            settings: Settings {
                stored: 1000,
                max_path_m,
                seed,
                sun_visibility: true,
                receivers: Receivers::All,
            },
        };
        let tracer = Tracer::new(&emission).expect("fits");
        assert_eq!(tracer.emitters.len(), 5);
        let (mut dropped, mut missed) = (0_u32, 0_u32);
        for i in 0..60_000 {
            let mut random = Stream::new(seed, Purpose::Survey, i);
            let index = i as usize % tracer.emitters.len();
            let emitter = &tracer.emitters[index];
            let piece = emitter.piece(emitter.all(), 1.0, &mut random);
            let point = emitter.point(piece, &mut random);
            // Elevations around level: there the horizon runs.
            let z = 0.8 * random.uniform() - 0.3;
            let (cos, sin) = on_circle(random.uniform());
            let level = (1.0 - z * z).sqrt();
            let direction = DVec3::new(level * cos, level * sin, z);
            if emitter.frame.z.dot(direction) <= 0.0 {
                continue;
            }
            let horizon = tracer.horizons[index].as_ref().expect("built");
            let here = horizon.clears(piece, direction);
            let reaching = horizon.reaching(direction);
            let (start, towards) = (point.as_vec3(), direction.as_vec3());
            let hit = site.bvh.closest(start, towards, 0.0, max_path_m as f32);
            assert!(here || reaching >> piece & 1 != 0, "the picture leaves nothing out");
            assert!(!here || hit.is_none(), "emitter {index}, {point}, {direction}: {hit:?}");
            dropped += u32::from(here);
            missed += u32::from(hit.is_none());
        }
        let share = f64::from(dropped) / f64::from(missed);
        println!("limit {max_path_m} m: {share:.3} of {missed} misses dropped");
        assert!(share > 0.75, "{share} of the misses, limit {max_path_m}");
    }
}

fn four() -> Vec<([Vec3; 4], bool)> {
    let at = Vec3::new;
    vec![
        ([at(0., 0., 4.0), at(0., 12., 4.0), at(-10., 12., 1.3), at(-10., 0., 1.3)], false),
        ([at(20., 0., 3.), at(31., 0., 3.), at(31., 9., 3.), at(20., 9., 3.)], false),
        ([at(5., -20., 0.), at(15., -20., 0.), at(15., -20., 7.), at(5., -20., 7.)], false),
        ([at(-30., 20., 8.), at(-26., 20., 8.), at(-26., 25., 9.), at(-30., 25., 9.)], true),
    ]
}

fn days(count: usize) -> Timeline {
    let mut timeline = noon();
    let step = timeline.steps[0];
    timeline.steps = (0..count)
        .map(|i| {
            let (azimuth, height) = (i as f64 / count as f64, 0.02 + 0.9 * (i % 5) as f64 / 5.0);
            let (cos, sin) = on_circle(azimuth);
            let level = (1.0 - height * height).sqrt();
            Timestep { sun: DVec3::new(level * cos, level * sin, height), ..step }
        })
        .collect();
    timeline
}

const SETTINGS: Settings = Settings {
    stored: 60_000,
    max_path_m: 80.0,
    seed: 1,
    sun_visibility: true,
    receivers: Receivers::All,
};

/// Every kind of scattering; files of both kinds.
fn kinds() -> Vec<Bsdf> {
    let mut out: Vec<Bsdf> = [
        Model::Lambertian { reflectance: 0.5 },
        Model::Mirror { reflectance: 0.9 },
        Model::Glass { index: 1.52 },
        Model::PvGlass { index: 1.52, ggx_alpha: 0.02, cell_reflectance: 0.04 },
        Model::PvGlass { index: 1.52, ggx_alpha: 0.3, cell_reflectance: 0.05 },
    ]
    .iter()
    .map(|model| Bsdf::from_model(model).expect("valid"))
    .collect();
    out.extend(crate::bsdf::samples().into_iter().take(4));
    out
}

#[test]
fn what_no_square_holds_reaches_nothing() {
    let site = scene(3, &four());
    let timeline = days(12);
    for (kind, bsdf) in kinds().iter().enumerate() {
        let emission =
            Emission { site: &site, timeline: &timeline, bsdfs: vec![bsdf; 4], settings: SETTINGS };
        let tracer = Tracer::new(&emission).expect("fits");
        let sources = tracer.sources();
        let (mut dropped, mut kept, mut over) = (0, 0, 0_u32);
        for step in 0..timeline.steps.len() {
            let shares = Shares::of(&sources, step);
            for i in 0..4000_u64 {
                let mut random = Stream::new(step as u64, Purpose::Survey, i);
                let number = i as usize % tracer.emitters.len();
                let emitter = &tracer.emitters[number];
                let (u, v) = (random.uniform(), random.uniform());
                let to_sun = tracer.disc.direction(&shares.sun, u, v);
                let incident = emitter.frame.local_from_world(to_sun);
                let lobes = bsdf.charts();
                let lobe = lobes[(i / 5) as usize % lobes.len()];
                // A square as fine as any target.
                const FINE: u8 = 12;
                let side = |bits: u32| (bits % (1 << FINE)) as u16;
                let (x, y) = (side(random.bits()), side(random.bits()));
                let fine = Square { chart: lobe, level: FINE, x, y };
                let (u, v) = (random.uniform(), random.uniform());
                if incident.z <= 0.0 || to_sun.z <= 0.0 {
                    continue;
                }
                let Some((out, density)) = bsdf.density(fine, incident, u, v) else { continue };
                if out.z <= 0.0 || density <= 0.0 {
                    continue;
                }
                let piece = emitter.piece(emitter.all(), 1.0, &mut random);
                let held = shares.aims().iter().find(|aim| {
                    let square = aim.target.square;
                    assert!(square.level <= FINE);
                    let up = FINE - square.level;
                    aim.emitter == number
                        && aim.target.pieces >> piece & 1 != 0
                        && (square.chart == Chart::Whole
                            || (square.chart, square.x, square.y) == (lobe, x >> up, y >> up))
                });
                if let Some(aim) = held {
                    kept += 1;
                    let pointwise = !matches!(aim.target.square.chart, Chart::Whole | Chart::Cells);
                    over += u32::from(pointwise && density * incident.z > aim.target.most);
                    continue;
                }
                dropped += 1;
                let point = emitter.point(piece, &mut random).as_vec3();
                let towards = emitter.frame.world_from_local(out).as_vec3();
                let hit = site.bvh.closest(point, towards, 0.0, 80.0);
                assert!(hit.is_none(), "kind {kind}, step {step}: {lobe:?} {u} {v}: {hit:?}");
            }
        }
        println!("kind {kind}: {dropped} dropped, {kept} kept");
        assert!(
            kept > 400 && (dropped > 400 || kind > 4),
            "kind {kind}: {dropped} dropped, {kept} kept"
        );
        assert_eq!(over, 0, "kind {kind}: the bounds hold");
    }
}

/// Flux by timestep, and by the sector and ring where it landed.
fn landed(batches: &[Batch], steps: usize) -> Vec<f64> {
    let mut out = vec![0.0; steps + 40];
    for p in batches.iter().flat_map(|b| &b.photons) {
        out[p.timestep as usize] += f64::from(p.flux_w);
        let turns = libm::atan2f(p.position.y, p.position.x) / std::f32::consts::TAU + 0.5;
        let ring = usize::from(p.position.truncate().length() > 35.0);
        out[steps + ring * 20 + ((turns * 20.0) as usize).min(19)] += f64::from(p.flux_w);
    }
    out
}

#[test]
fn squares_give_what_whole_lobes_give() {
    let site = scene(4, &four());
    let timeline = days(24);
    for (kind, bsdf) in kinds().iter().enumerate() {
        let emission =
            Emission { site: &site, timeline: &timeline, bsdfs: vec![bsdf; 4], settings: SETTINGS };
        let found = [true, false].map(|cut| {
            let tracer = Tracer::with(&emission, cut, None).expect("fits");
            let emitted = if cut { 40_000 } else { 120_000 };
            let draw = Draw { purpose: Purpose::Photon, seed: u64::from(cut), emitted };
            let batch = tracer.send(draw, 0..emitted, true);
            let stored = batch.photons.len() as f64 / emitted as f64;
            let flux = landed(&[batch], timeline.steps.len());
            (flux, tracer.total_w() / emitted as f64, stored)
        });
        let [(cut, cut_w, cut_share), (whole, whole_w, whole_share)] = &found;
        // Small random cells take more squares than these few photons are worth.
        assert!(kind > 4 || cut_share > whole_share, "kind {kind}: {cut_share} of {whole_share}");
        let (mut chi, mut degrees) = (0.0, 0.0_f64);
        for (a, b) in cut.iter().zip(whole) {
            let variance = 0.5 * (a + b) * (cut_w + whole_w);
            if a + b > 20.0 * (cut_w + whole_w) {
                chi += (a - b).powi(2) / variance;
                degrees += 1.0;
            }
        }
        println!("kind {kind}: {cut_share:.3} of {whole_share:.3}: chi2 {chi:.0} of {degrees}");
        // 4 sigma; stratified, so rather less than chi-square.
        let limit = degrees + 4.0 * (2.0 * degrees).sqrt();
        assert!(degrees > 20.0 && chi < limit, "kind {kind}: {chi} for {degrees} cells");
    }
}

/// Virtual sensors low, high and beside the PV, some overlapping, turned to the PV or not.
fn sensors(count: usize, radius_m: [f64; 2]) -> Vec<VirtualSensor> {
    let mut random = Stream::new(11, Purpose::Survey, 0);
    let mut one = |low: f64, high: f64| low + (high - low) * random.uniform();
    (0..count)
        .map(|_| {
            let centre = DVec3::new(one(-40.0, 40.0), one(-40.0, 40.0), one(-6.0, 14.0));
            let turned = DVec3::new(one(-1.0, 1.0), one(-1.0, 1.0), one(-1.0, 1.0));
            // Most look to the middle of the scene.
            let normal = (turned - centre / 25.0).normalize();
            VirtualSensor { centre, normal, radius_m: one(radius_m[0], radius_m[1]) }
        })
        .collect()
}

fn through(sensors: &[VirtualSensor]) -> Through<'_> {
    Through { sensors, sheet: SensorSheet::new(sensors.len(), 3.0), most: 1 << 24 }
}

#[test]
fn whatever_crosses_a_gate_lies_between_its_horizons() {
    let site = scene(4, &four());
    let timeline = noon();
    let bsdf = Bsdf::from_model(&Model::Lambertian { reflectance: 0.5 }).expect("valid");
    let emission =
        Emission { site: &site, timeline: &timeline, bsdfs: vec![&bsdf; 4], settings: SETTINGS };
    for count in [1, 3, 40] {
        let sensors = sensors(count, [0.1, 0.6]);
        let tracer = Tracer::through(&emission, &through(&sensors)).expect("fits");
        let tree = tracer.sensors.as_ref().expect("there");
        let (mut crossed, mut dropped, mut missed) = (0_u32, 0_u32, 0_u32);
        for i in 0..60_000 {
            let mut random = Stream::new(count as u64, Purpose::Survey, i);
            let index = i as usize % tracer.emitters.len();
            let emitter = &tracer.emitters[index];
            let piece = emitter.piece(emitter.all(), 1.0, &mut random);
            let start = emitter.point(piece, &mut random);
            // Half of them at a virtual sensor, half anywhere.
            let mut jitter = || 2.0 * random.uniform() - 1.0;
            let away = DVec3::new(jitter(), jitter(), jitter());
            let target = sensors[i as usize % count].centre - start;
            let direction = if i % 2 == 0 { target + 0.5 * away } else { away }.normalize();
            if emitter.frame.z.dot(direction) <= 0.0 {
                continue;
            }
            let horizon = tracer.horizons[index].as_ref().expect("built");
            let clears = horizon.clears(piece, direction);
            let crosses = tree.crossed(start, direction, SETTINGS.max_path_m as f32);
            assert!(!(crosses && clears), "emitter {index}, {start}, {direction}");
            if crosses {
                crossed += 1;
                assert!(horizon.reaching(direction) >> piece & 1 != 0, "{start}, {direction}");
                // A cone that holds it, off its middle.
                let axis = (direction + 0.1 * away).normalize();
                let cone = Cone::new(axis, 1.01 * axis.angle_between(direction));
                assert!(horizon.reaching_cone(&cone) >> piece & 1 != 0, "{start}, {direction}");
            } else {
                missed += 1;
                dropped += u32::from(clears);
            }
        }
        println!("{count} sensors: {crossed} crossings; {dropped} of {missed} misses dropped");
        assert!(crossed > 100 && dropped > missed / 4, "{count}: {crossed}, {dropped}, {missed}");
    }
}

/// Aimed at virtual sensors or drawn from whole lobes, the same flux crosses each, at each
/// timestep.
#[test]
fn aiming_at_gates_changes_nothing_but_the_effort() {
    let site = scene(4, &four());
    let timeline = days(12);
    let sensors = sensors(24, [1.0, 3.0]);
    for (kind, bsdf) in kinds().iter().enumerate() {
        let emission =
            Emission { site: &site, timeline: &timeline, bsdfs: vec![bsdf; 4], settings: SETTINGS };
        let found = [true, false].map(|cut| {
            let sensors = SensorTree::of(&through(&sensors));
            let tracer = Tracer::with(&emission, cut, Some(sensors)).expect("fits");
            let emitted = if cut { 60_000 } else { 200_000 };
            let draw = Draw { purpose: Purpose::Sensor, seed: u64::from(cut), emitted };
            let batch = tracer.send(draw, 0..emitted, true);
            assert_eq!(batch.tally.missing_photons(), 0);
            assert!(batch.tally.missing_flux() < 1e-9, "{:?}", batch.tally);
            let share = batch.tally.stored.photons as f64 / emitted as f64;
            let mut flux = vec![0.0; 24 + timeline.steps.len()];
            for p in &batch.photons {
                let cell =
                    (0..24).find(|&g| SensorSheet::new(24, 3.0).cell(g).contains(p.position));
                flux[cell.expect("of a sensor")] += f64::from(p.flux_w);
                flux[24 + p.timestep as usize] += f64::from(p.flux_w);
                assert!(p.normal.dot(p.direction) > 0.0);
            }
            (flux, tracer.total_w() / emitted as f64, share)
        });
        let [(cut, cut_w, cut_share), (whole, whole_w, whole_share)] = &found;
        assert!(kind > 4 || cut_share > whole_share, "kind {kind}: {cut_share} of {whole_share}");
        let (mut chi, mut degrees) = (0.0, 0.0_f64);
        for (a, b) in cut.iter().zip(whole) {
            if a + b > 20.0 * (cut_w + whole_w) {
                chi += (a - b).powi(2) / (0.5 * (a + b) * (cut_w + whole_w));
                degrees += 1.0;
            }
        }
        println!("kind {kind}: {cut_share:.4} of {whole_share:.4}: chi2 {chi:.0} of {degrees}");
        // Some photons cross two virtual sensors: a little wider than counts.
        let limit = degrees + 5.0 * (2.0 * degrees).sqrt();
        assert!(degrees > 5.0 && chi < limit, "kind {kind}: {chi} for {degrees} cells");
    }
}
