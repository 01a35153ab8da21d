//! Reflection models: sampled as they are evaluated, reciprocal, never more light than there was.

use glam::DVec3;
use glintmap::base::{Purpose, Stream};
use glintmap::bsdf::{Bsdf, Error, Model, fresnel_reflectance};

pub(super) fn from_degrees(theta: f64, phi: f64) -> DVec3 {
    let (theta, phi) = (theta.to_radians(), phi.to_radians());
    let (sin, cos) = (libm::sin(theta), libm::cos(theta));
    DVec3::new(sin * libm::cos(phi), sin * libm::sin(phi), cos)
}

pub(super) fn pv_glass(ggx_alpha: f64, cell_reflectance: f64) -> Bsdf {
    Bsdf::from_model(&Model::PvGlass { index: 1.52, ggx_alpha, cell_reflectance }).expect("valid")
}

fn lambertian(reflectance: f64) -> Bsdf {
    Bsdf::from_model(&Model::Lambertian { reflectance }).expect("valid")
}

pub(super) const SAMPLES: u64 = 60_000;

/// Sampled directions, the dead as `None`.
pub(super) fn draws(bsdf: &Bsdf, incident: DVec3, seed: u64) -> Vec<Option<DVec3>> {
    (0..SAMPLES)
        .map(|i| {
            let mut random = Stream::new(seed, Purpose::Survey, i);
            bsdf.sample(incident, &mut random).map(|s| {
                assert_eq!(s.weight, 1.0, "a bound was too low");
                assert!((s.direction.length() - 1.0).abs() < 1e-9 && s.direction.z > 0.0);
                s.direction
            })
        })
        .collect()
}

/// Upper 0.1 % point of chi-square with `n` degrees of freedom (Wilson and Hilferty 1931).
pub(super) fn chi_square_limit(n: f64) -> f64 {
    let a = 2.0 / (9.0 * n);
    n * (1.0 - a + 3.0902 * a.sqrt()).powi(3)
}

/// Edges that cut sorted values into `parts` of about equal count, from `low` to `high`.
fn quantiles(mut values: Vec<f64>, parts: usize, low: f64, high: f64) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let mut edges = vec![low];
    edges.extend((1..parts).map(|i| values[i * values.len() / parts]));
    edges.push(high);
    edges
}

/// Points and weights of the three-point Gauss rule on `panels` parts of an interval.
fn gauss(interval: &[f64], panels: u32) -> Vec<(f64, f64)> {
    let half = 0.5 * (interval[1] - interval[0]) / f64::from(panels);
    (0..panels)
        .flat_map(|i| {
            let middle = interval[0] + half * f64::from(2 * i + 1);
            [(-0.6_f64.sqrt(), 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.6_f64.sqrt(), 5.0 / 9.0)]
                .map(|(at, weight)| (middle + half * at, half * weight))
        })
        .collect()
}

/// Chi-square of drawn directions against `evaluate() * cos / bound` integrated over bins of
/// (cos theta, phi). The bins follow the quantiles of other draws, so that they resolve the lobe.
pub(super) fn sampling_error(bsdf: &Bsdf, degrees: f64) -> (f64, f64) {
    // So that the lobe lies around azimuth 0, in the middle of the columns.
    let incident = from_degrees(degrees, 180.0);
    let cos_phi = |d: DVec3| (d.z, libm::atan2(d.y, d.x));
    let seen: Vec<_> = draws(bsdf, incident, 71).into_iter().flatten().map(cos_phi).collect();
    let rows = quantiles(seen.iter().map(|s| s.0).collect(), 10, 0.0, 1.0);
    let pi = std::f64::consts::PI;
    let columns = quantiles(seen.iter().map(|s| s.1).collect(), 8, -pi, pi);
    let bin = |edges: &[f64], at: f64| edges[1..edges.len() - 1].partition_point(|&e| e <= at);
    let mut found = [[0_u64; 8]; 10];
    let mut dead = 0_u64;
    for direction in draws(bsdf, incident, 72) {
        match direction.map(cos_phi) {
            Some((z, phi)) => found[bin(&rows, z)][bin(&columns, phi)] += 1,
            None => dead += 1,
        }
    }
    let bound = bsdf.bound(incident);
    let (mut chi2, mut freedom, mut alive) = (0.0, 0.0, 0.0);
    for (i, row) in rows.windows(2).enumerate() {
        for (j, column) in columns.windows(2).enumerate() {
            let (across, around) =
                (gauss(row, 20), gauss(column, if j == 0 || j == 7 { 60 } else { 8 }));
            let mut sum = 0.0;
            for &(z, dz) in &across {
                let level = (1.0 - z * z).sqrt();
                for &(phi, dphi) in &around {
                    let out = DVec3::new(level * libm::cos(phi), level * libm::sin(phi), z);
                    sum += bsdf.evaluate(incident, out) * z * dz * dphi;
                }
            }
            let expected = sum / bound * SAMPLES as f64;
            alive += expected;
            if expected > 8.0 {
                chi2 += (found[i][j] as f64 - expected).powi(2) / expected;
                freedom += 1.0;
            }
        }
    }
    let expected_dead = SAMPLES as f64 - alive;
    if expected_dead > 8.0 {
        chi2 += (dead as f64 - expected_dead).powi(2) / expected_dead;
    } else {
        assert!(dead < 30, "{dead} died where none should");
        freedom -= 1.0;
    }
    (chi2, freedom)
}

#[test]
fn directions_follow_the_function() {
    // Fixed seeds; each of the nine fails by chance at 0.1 %.
    let mut cases = vec![("lambertian".to_owned(), lambertian(0.6), 30.0)];
    for alpha in [0.05, 0.3] {
        for degrees in [10.0, 45.0, 75.0, 85.0] {
            cases.push((format!("alpha {alpha}"), pv_glass(alpha, 0.05), degrees));
        }
    }
    for (name, bsdf, degrees) in cases {
        let (chi2, freedom) = sampling_error(&bsdf, degrees);
        assert!(freedom > 40.0, "{name}: only {freedom} bins at {degrees} degrees");
        assert!(
            chi2 < chi_square_limit(freedom),
            "{name} at {degrees} degrees: chi2 {chi2:.1} with {freedom} degrees of freedom"
        );
    }
}

#[test]
fn survivors_add_up_to_the_reflectance() {
    let glass = Bsdf::from_model(&Model::Glass { index: 1.52 }).expect("valid");
    let mirror = Bsdf::from_model(&Model::Mirror { reflectance: 0.9 }).expect("valid");
    let cases = [
        lambertian(0.3),
        mirror,
        glass,
        pv_glass(0.02, 0.04),
        pv_glass(0.3, 0.2),
        pv_glass(1.0, 0.0),
    ];
    for bsdf in cases {
        for degrees in [0.0, 10.0, 45.0, 75.0, 85.0, 89.0] {
            let incident = from_degrees(degrees, 40.0);
            let (bound, reflectance) = (bsdf.bound(incident), bsdf.reflectance(incident));
            assert!(bound >= reflectance * (1.0 - 1e-3), "{bsdf:?} at {degrees}");
            let alive = draws(&bsdf, incident, 73).iter().flatten().count() as f64;
            let p = (reflectance / bound).min(1.0);
            // Binomial; 4 sigma: 36 checks fail by chance at 0.2 %. 1e-3 is the quadrature's.
            let sigma = (SAMPLES as f64 * p * (1.0 - p)).sqrt();
            let limit = 4.0 * sigma + 1e-3 * SAMPLES as f64 * p;
            let off = alive - SAMPLES as f64 * p;
            assert!(off.abs() <= limit, "{bsdf:?} at {degrees}: {off} off, allowed {limit}");
        }
    }
}

#[test]
fn a_bound_from_outside_changes_the_odds_not_the_light() {
    let bsdf = pv_glass(0.1, 0.1);
    let incident = from_degrees(70.0, 0.0);
    let own = bsdf.bound(incident);
    for bound in [1.7 * own, 0.8 * own] {
        let mut light = 0.0;
        for i in 0..SAMPLES {
            let mut random = Stream::new(74, Purpose::Survey, i);
            if let Some(s) = bsdf.sample_within(incident, bound, &mut random) {
                assert_eq!(s.weight > 1.0, bound < own);
                light += s.weight * bound / SAMPLES as f64;
            }
        }
        let expected = bsdf.reflectance(incident);
        assert!((light / expected - 1.0).abs() < 0.03, "{light} instead of {expected}");
    }
}

#[test]
fn light_may_go_either_way() {
    let bsdf = pv_glass(0.15, 0.3);
    for i in 0..500 {
        let mut random = Stream::new(75, Purpose::Survey, i);
        let mut one = || from_degrees(89.0 * random.uniform(), 360.0 * random.uniform());
        let (a, b) = (one(), one());
        let (there, back) = (bsdf.evaluate(a, b), bsdf.evaluate(b, a));
        assert!((there - back).abs() <= 1e-12 * there.max(back), "{a} {b}: {there} {back}");
    }
}

#[test]
fn nothing_reflects_more_than_it_gets() {
    for index in [1.05, 1.52, 3.0] {
        for ggx_alpha in [0.001, 0.05, 0.3, 1.0] {
            for cell_reflectance in [0.0, 0.5, 0.9] {
                let model = Model::PvGlass { index, ggx_alpha, cell_reflectance };
                let bsdf = Bsdf::from_model(&model).expect("valid");
                for step in 0..=17 {
                    let r = bsdf.reflectance(from_degrees(f64::from(step) * 5.2, 0.0));
                    assert!((0.0..=1.0).contains(&r), "{model:?} at {}: {r}", step * 5);
                }
            }
        }
    }
}

#[test]
fn glass_is_right_where_glare_happens() {
    let smooth = Bsdf::from_model(&Model::Glass { index: 1.52 }).expect("valid");
    // (0.52 / 2.52)^2, and the shares that the handbook names.
    for (degrees, share, within) in
        [(0.0, 0.0426, 1e-4), (75.0, 0.25, 0.01), (80.0, 0.39, 0.01), (85.0, 0.61, 0.01)]
    {
        let incident = from_degrees(degrees, 0.0);
        let r = smooth.reflectance(incident);
        assert!((r - share).abs() < within, "{r} at {degrees}");
        // Fresnel's own form, by angles.
        let (i, t) = (libm::acos(incident.z), libm::asin(libm::sin(libm::acos(incident.z)) / 1.52));
        if degrees > 0.0 {
            let across = libm::sin(i - t) / libm::sin(i + t);
            let along = libm::tan(i - t) / libm::tan(i + t);
            assert!((r - 0.5 * (across * across + along * along)).abs() < 1e-12);
        }
        assert_eq!(r, fresnel_reflectance(incident.z, 1.52));
        // Clear PV glass does what smooth glass does, to the share that its lobe loses.
        let clear = pv_glass(0.005, 0.0).reflectance(incident);
        assert!((clear / r - 1.0).abs() < 0.02, "{clear} for {r} at {degrees}");
    }
    // The diffuse part: what enters, times the cells' share.
    let dark = pv_glass(0.005, 0.0).reflectance(from_degrees(20.0, 0.0));
    let grey = pv_glass(0.005, 0.1).reflectance(from_degrees(20.0, 0.0));
    let enters = 1.0 - fresnel_reflectance(libm::cos(20.0_f64.to_radians()), 1.52);
    assert!((grey - dark - 0.1 * enters).abs() < 1e-9);
}

#[test]
fn the_disc_is_bounded_as_a_whole() {
    for bsdf in [lambertian(0.4), pv_glass(0.05, 0.05), pv_glass(0.4, 0.9)] {
        for step in 0..900 {
            let degrees = f64::from(step) * 0.1;
            let (low, high) = (degrees - 0.2665, degrees + 0.2665);
            let cos = |d: f64| libm::cos(d.clamp(0.0, 180.0).to_radians());
            let whole = bsdf.bound_between(cos(high), cos(low));
            for part in 0..=10 {
                let at = from_degrees((low + 0.0533 * f64::from(part)).abs(), 10.0);
                assert!(whole >= bsdf.bound(at) * (1.0 - 1e-12), "{bsdf:?} at {degrees}");
            }
        }
    }
}

#[test]
fn models_are_read_strictly() {
    let read = |text: &str| serde_json::from_str::<Model>(text);
    let model =
        read(r#"{"kind":"pv-glass","index":1.52,"ggx_alpha":0.02,"cell_reflectance":0.03}"#)
            .expect("valid");
    assert_eq!(model, Model::PvGlass { index: 1.52, ggx_alpha: 0.02, cell_reflectance: 0.03 });
    let again = serde_json::to_string(&model).expect("plain data");
    assert_eq!(read(&again).expect("what was written"), model);
    assert!(read(r#"{"kind":"glass","index":1.5,"alpha":1}"#).is_err());
    assert!(read(r#"{"kind":"glas","index":1.5}"#).is_err());
    for (model, field) in [
        (Model::Lambertian { reflectance: 1.2 }, "reflectance"),
        (Model::Mirror { reflectance: f64::NAN }, "reflectance"),
        (Model::Glass { index: 1.0 }, "index"),
        (Model::PvGlass { index: 1.5, ggx_alpha: 0.0, cell_reflectance: 0.1 }, "ggx_alpha"),
    ] {
        let error = Bsdf::from_model(&model).expect_err("out of range");
        let Error::OutOfRange { field: named, .. } = &error else { panic!("{error}") };
        assert_eq!(*named, field);
        assert!(error.to_string().contains(field), "{error}");
    }
}
