use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::glint::{Eye, Glint, SunAt};
use super::hazard::{HazardZone, zone};
use super::instant::EyeInstant;
use super::material::EyeMaterial;
use super::patches::EyePv;
use super::sweep::{SweepLimits, Sweeper};
use crate::base::{Frame, Purpose, Silent, SpectralBasis, Stream, Timeline, Timestep};
use crate::bsdf::{Bsdf, Model, PRESETS, Part, on_circle, on_hemisphere};
use crate::render::reflect::direct::DirectYear;
use crate::render::reflect::direct::PvSight;
use crate::render::reflect::direct::{Direct, DirectScene, DirectScratch};
use crate::site::{Face, Material, Object, PvSurface, Site, Triangle};

/// A level PV square of `2 half_m`, and quads.
fn site(half_m: f32, more: &[[Vec3; 4]]) -> Site {
    let h = half_m;
    let flat = [[-h, -h], [h, -h], [h, h], [-h, h]].map(|[x, y]| Vec3::new(x, y, 0.0));
    let (mut triangles, mut faces) = (Vec::new(), Vec::new());
    for (i, q) in std::iter::once(&flat).chain(more).enumerate() {
        for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
            triangles.push(Triangle { corners: [q[a], q[b], q[c]], face: i as u32 });
        }
        faces.push(Face { object: 0, material: 0, pv: (i == 0).then_some(0) });
    }
    let pv = PvSurface {
        name: "pv".into(),
        entry: 0,
        triangles: vec![0, 1],
        normal: DVec3::Z,
        area_m2: 4.0 * f64::from(half_m * half_m),
        two_sided: false,
    };
    Site::from_parts(
        triangles,
        faces,
        vec![Object { id: String::new(), kind: String::new() }],
        vec![Material { name: "m".into(), reflectance: [0.2; 3], diffuse: true }],
        vec![pv],
        DVec3::ZERO,
        Vec::new(),
    )
}

fn bsdf(model: &Model) -> Bsdf {
    Bsdf::from_model(model).expect("a model")
}

const AT: DVec3 = DVec3::new(-25.0, 3.0, 9.0);
const DNI: f64 = 700.0;

fn eye(at: DVec3) -> Eye {
    Eye { position: at, direction: (-at).normalize() }
}

/// A sun whose mirror image in the square stands at `(x, y, 0)`, seen from `AT`.
fn sun(x: f64, y: f64) -> SunAt {
    let out = AT - DVec3::new(x, y, 0.0);
    let direction = DVec3::new(-out.x, -out.y, out.z).normalize();
    SunAt { direction, irradiance_w_m2: DNI, diameter_deg: 0.533 }
}

fn look(site: &Site, bsdf: &Bsdf, sun: &SunAt) -> (Vec<Glint>, EyeInstant) {
    let pv = EyePv::new(site);
    let seen = pv.seen(eye(AT), 0);
    let lit = pv.lit(sun.direction, &seen, 0);
    let mut glints = Vec::new();
    pv.look(&seen, &lit, sun, &[EyeMaterial::new(bsdf)], &mut glints);
    let instant = EyeInstant::of(&seen.eye, &mut glints);
    (glints, instant)
}

#[test]
fn an_even_surface_shines_evenly() {
    let site = site(4.0, &[]);
    let even = bsdf(&Model::Lambertian { reflectance: 0.4 });
    let sun = sun(1.0, 1.0);
    let (_, instant) = look(&site, &even, &sun);
    let radiance = 0.4 / PI * sun.direction.z * DNI;
    assert!((instant.peak.radiance_w_m2_sr - radiance).abs() < 1e-9);
    assert!((instant.mean_w_m2_sr() - radiance).abs() < 1e-9);
    // The square's own solid angle, by summing small squares.
    let n = 400;
    let mut solid = 0.0;
    for i in 0..n * n {
        let at = |k: usize| (k as f64 + 0.5) / n as f64 * 8.0 - 4.0;
        // The eye lies a little before the place, in case that is on a wall.
        let place = AT + eye(AT).direction * 2e-3;
        let way = place - DVec3::new(at(i % n), at(i / n), 0.0);
        solid += (8.0 / n as f64).powi(2) * way.z / way.length().powi(3);
    }
    assert!((instant.lit_sr / solid - 1.0).abs() < 1e-4, "{} {solid}", instant.lit_sr);
    let seen = EyePv::new(&site).seen(eye(AT), 0);
    assert!((seen.solid_angle_sr / solid - 1.0).abs() < 1e-4);
}

/// The mirror image of the sun has the sun's radiance times the reflectance, and its size.
#[test]
fn a_mirror_shows_the_sun() {
    let site = site(4.0, &[]);
    let mirror = bsdf(&Model::Mirror { reflectance: 0.8 });
    let sun = sun(1.0, -0.5);
    let (_, instant) = look(&site, &mirror, &sun);
    let radiance = 0.8 * DNI / sun.solid_angle_sr();
    assert!((instant.peak.radiance_w_m2_sr / radiance - 1.0).abs() < 1e-9);
    assert!((instant.lit_sr / sun.solid_angle_sr() - 1.0).abs() < 0.01, "{}", instant.lit_sr);
    assert!((instant.normal_w_m2 / (0.8 * DNI) - 1.0).abs() < 0.01, "{}", instant.normal_w_m2);
    let towards = (DVec3::new(1.0, -0.5, 0.0) - AT).normalize();
    assert!(instant.peak.towards.dot(towards) > libm::cos(0.3_f64.to_radians()));
    let h = instant.after_image;
    assert!((h.subtended_rad.to_degrees() / 0.533 - 1.0).abs() < 0.01, "{h:?}");
    let worst = zone(h.after_image_ratio(), instant.burn.burn_ratio());
    assert_eq!(worst, HazardZone::AfterImage);
    let (none, _) = look(&site, &mirror, &super::tests::sun(6.0, 0.0));
    assert!(none.is_empty());
}

/// Radiances of many patches at once against the scattering function itself, over a fine raster of
/// the sun's disc.
#[test]
fn a_patch_is_as_bright_as_the_material_says() {
    let mut random = Stream::new(4, Purpose::Survey, 0);
    for preset in PRESETS {
        let bsdf = Bsdf::from_model(&preset.model()).expect("valid");
        let material = EyeMaterial::new(&bsdf);
        for i in 0..60 {
            let to_sun = on_hemisphere(random.uniform(), 0.02 + 0.96 * random.uniform());
            let sun = SunAt { direction: to_sun, irradiance_w_m2: DNI, diameter_deg: 0.533 };
            // From the mirrored direction to far off; the disc's rim doesn't cross a delta lobe.
            let off = 0.7 * (f64::from(i) / 59.0).powi(2);
            let off = if bsdf.has_delta() { off + 0.01 } else { off };
            let (x, y) = on_circle(random.uniform());
            let frame = Frame::around(DVec3::new(-to_sun.x, -to_sun.y, to_sun.z));
            let out = (frame.z + (frame.x * x + frame.y * y) * off).normalize();
            if out.z <= 0.01 {
                continue;
            }
            let disc = Frame::around(to_sun);
            let (mut sum, mut count) = (0.0, 0.0);
            for a in 0..40 {
                for b in 0..40 {
                    let at = |k: i32| (f64::from(k) + 0.5) / 20.0 - 1.0;
                    if at(a) * at(a) + at(b) * at(b) <= 1.0 {
                        let r = sun.radius_rad();
                        let s = (disc.z + disc.x * (r * at(a)) + disc.y * (r * at(b))).normalize();
                        sum += bsdf.evaluate(s, out) * s.z.max(0.0);
                        count += 1.0;
                    }
                }
            }
            let expected = DNI * sum / count;
            let found = material.under(&sun, to_sun).radiance(out);
            let miss = (found / expected - 1.0).abs();
            let sun = format!("sun {:.3}, out {:.3} over the PV", to_sun.z, out.z);
            // Where light grazes, the lobe is narrower than the places on the disc lie apart.
            let allowed = if to_sun.z.min(out.z) > 0.1 { 3e-3 } else { 0.03 };
            assert!(miss < allowed, "{}, {off:.4} off, {sun}: {found} {expected}", preset.name);
        }
    }
}

/// Two ways to the same number: glints summed here, cells integrated in `direct`.
#[test]
fn what_shines_adds_up_to_what_arrives() {
    let wall = [[-6.0, -9.0, 0.0], [-6.0, 9.0, 0.0], [-6.0, 9.0, 2.6], [-6.0, -9.0, 2.6]];
    for (scene, allowed) in
        [(site(5.0, &[]), 0.01), (site(5.0, &[wall.map(Vec3::from_array)]), 0.06)]
    {
        for alpha in [0.3, 0.1, 0.05, 0.02] {
            let glass =
                bsdf(&Model::PvGlass { index: 1.52, ggx_alpha: alpha, cell_reflectance: 0.04 });
            for (x, y) in [(0.0, 0.0), (-4.5, 2.0), (3.0, -4.0), (9.0, 1.0)] {
                let sun = sun(x, y);
                let (glints, instant) = look(&scene, &glass, &sun);
                let [surface, normal] = integrated(&scene, &glass, &sun);
                let miss = instant.surface_w_m2 / surface - 1.0;
                println!(
                    "alpha {alpha}, {x} {y}: {} glints, {surface:.4} W/m2, {miss:.1e}, peak {:.3e}",
                    glints.len(),
                    instant.peak.radiance_w_m2_sr
                );
                assert!(miss.abs() < allowed, "{} {surface}", instant.surface_w_m2);
                assert!((instant.normal_w_m2 / normal - 1.0).abs() < allowed);
            }
        }
    }
}

fn integrated(site: &Site, bsdf: &Bsdf, sun: &SunAt) -> [f64; 2] {
    let timeline = Timeline {
        steps: vec![Timestep {
            day: 0,
            hour: 12.0,
            sun: sun.direction,
            irradiance_w_m2: sun.irradiance_w_m2,
            weight_h: 1.0,
            segment: 0,
        }],
        step_h: 1.0,
        year: 2025,
        half_year: false,
        sun_diameter_deg: sun.diameter_deg,
        basis: SpectralBasis::Broadband,
    };
    let sight = PvSight::new(site, &timeline, true, &Silent).expect("looks");
    let scene = DirectScene {
        site,
        timeline: &timeline,
        bsdfs: vec![bsdf],
        max_path_m: 1e3,
        sun_visibility: true,
    };
    let direct = Direct::new(scene, &sight).expect("fits");
    let mut year = DirectYear::default();
    direct.year(AT, eye(AT).direction, &mut DirectScratch::default(), &mut year);
    [year.surface_w_m2[0], year.normal_w_m2[0]]
}

#[test]
fn what_lies_behind_the_eye_or_in_shadow_is_not_seen() {
    let glass = bsdf(&Model::Lambertian { reflectance: 0.4 });
    let scene = site(4.0, &[]);
    let pv = EyePv::new(&scene);
    let away = Eye { position: AT, direction: AT.normalize() };
    assert_eq!(pv.seen(away, 0).solid_angle_sr, 0.0);
    assert_eq!(pv.seen(eye(-AT), 0).solid_angle_sr, 0.0, "below it");
    let roof = [[-9.0, -9.0, 20.0], [9.0, -9.0, 20.0], [9.0, 9.0, 20.0], [-9.0, 9.0, 20.0]];
    let shaded = site(4.0, &[roof.map(Vec3::from_array)]);
    let high = SunAt { direction: DVec3::Z, irradiance_w_m2: DNI, diameter_deg: 0.5 };
    assert!(look(&scene, &glass, &high).1.normal_w_m2 > 0.0);
    assert_eq!(look(&shaded, &glass, &high).1, EyeInstant::default());
}

/// Walls that throw shadows onto the square and hide parts of it.
fn walled() -> Site {
    let wall = |x: f32, low: f32, high: f32, top: f32| {
        [[x, low, 0.0], [x, high, 0.0], [x, high, top], [x, low, top]].map(Vec3::from_array)
    };
    site(4.0, &[wall(7.0, -1.0, 0.5, 4.0), wall(-6.0, 1.0, 9.0, 2.5)])
}

/// Some days of a year in steps of two minutes.
fn days(from: u32, to: u32, step: u32) -> Timeline {
    use crate::sky::{DayRange, HourRange, Place, SunModel, SunStrength, TimeSpec};
    let place = Place {
        latitude_deg: 47.038,
        longitude_deg: 8.312,
        meridian_deg: 15.0,
        elevation_m: 450.0,
    };
    let spec = TimeSpec {
        year: 2025,
        days: DayRange { from, to, step },
        hours: HourRange { from: 0.0, to: 23.99, step: 1.0 / 30.0 },
        finer: Vec::new(),
        sun: SunModel::Gensky,
        irradiance: SunStrength::ClearSky,
        half_year: false,
    };
    crate::sky::timeline(&place, &spec).expect("suns")
}

/// Some days of a year, in steps of two minutes: what the adaptive sweep finds is what looking at
/// each of them finds, with a fraction of the looks.
#[test]
fn a_sweep_misses_nothing() {
    let (scene, timeline) = (walled(), days(80, 195, 23));
    let pv = EyePv::new(&scene);
    let limits = SweepLimits {
        irradiances_w_m2: vec![1.0, 10.0, 30.0],
        normal: false,
        radiances_w_m2_sr: vec![300.0, 500.0],
    };
    let glass = |alpha| Model::PvGlass { index: 1.52, ggx_alpha: alpha, cell_reflectance: 0.04 };
    let part = |share, model| Part { share, model };
    let coated = Model::Mixture {
        parts: vec![
            part(0.4, Model::Glass { index: 1.52 }),
            part(0.6, Model::Lambertian { reflectance: 0.1 }),
        ],
    };
    let all_models = [
        (glass(0.1), 0.5),
        (glass(0.05), 0.5),
        (glass(0.01), 0.5),
        (glass(0.003), 0.5),
        (Model::Glass { index: 1.52 }, 0.5),
        (coated, 0.5),
    ];
    for (model, most) in all_models {
        let bsdf = bsdf(&model);
        let materials = [EyeMaterial::new(&bsdf)];
        let seen = [pv.seen(eye(AT), 0)];
        let sweeper = Sweeper {
            pv: &pv,
            seen: &seen,
            timeline: &timeline,
            materials: &materials,
            limits: &limits,
        };
        let full = sweeper.run(1, &Silent).expect("runs");
        assert_eq!(full.looked, timeline.steps.len());
        let sweep = sweeper.run(8, &Silent).expect("runs");
        assert_eq!(sweep.exceeded, full.exceeded);
        let (looked, lit) = (sweep.looked, full.exceeded.iter().filter(|e| **e != 0).count());
        let all = timeline.steps.len() as f64;
        let (share, lit) = (looked as f64 / all, lit as f64 / all);
        println!("width {}: lit {lit:.3}, looked at {share:.3}", materials[0].width());
        // What is lit is looked at, step by step.
        assert!(lit > 0.002 && share < most, "{lit} {share}");
    }
}

/// The same of files, whose values jump.
#[test]
fn a_sweep_of_measured_pv_misses_nothing() {
    let (scene, timeline) = (walled(), days(130, 130, 1));
    let pv = EyePv::new(&scene);
    let seen = [pv.seen(eye(AT), 0)];
    let (mut lit, mut looked) = (0, 0);
    for bsdf in crate::bsdf::samples() {
        let materials = [EyeMaterial::new(&bsdf)];
        let limits = SweepLimits {
            irradiances_w_m2: vec![1.0, 3.0, 6.0],
            normal: true,
            radiances_w_m2_sr: vec![80.0, 160.0],
        };
        let sweeper = Sweeper {
            pv: &pv,
            seen: &seen,
            timeline: &timeline,
            materials: &materials,
            limits: &limits,
        };
        let full = sweeper.run(1, &Silent).expect("runs");
        let sweep = sweeper.run(8, &Silent).expect("runs");
        assert_eq!(sweep.exceeded, full.exceeded);
        lit += full.exceeded.iter().filter(|e| **e != 0).count();
        looked += sweep.looked;
        println!("{} of {} looked at", sweep.looked, full.looked);
    }
    println!("{lit} exceed a limit");
    assert!(lit > 30 && looked > lit, "{lit} {looked}");
}
