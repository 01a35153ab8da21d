//! Coated glass, metal, mixtures and the presets: sampled as evaluated, energy in its bounds, and
//! the figures at the angles where glare happens.

use std::fmt::Write as _;

use glam::DVec3;
use glintmap::base::{Purpose, Stream};
use glintmap::bsdf::{Bsdf, Coating, Error, Model, PRESETS, Part, fresnel_reflectance};

use super::bsdf::{SAMPLES, chi_square_limit, draws, from_degrees, pv_glass, sampling_error};

const FILM: Coating = Coating { index: 1.27, thickness_nm: 118.0 };

fn made(model: &Model) -> Bsdf {
    Bsdf::from_model(model).expect("valid")
}

fn coated(ggx_alpha: f64, cell_reflectance: f64, coating: Option<Coating>) -> Model {
    Model::CoatedGlass { index: 1.52, ggx_alpha, cell_reflectance, coating }
}

fn metal(ggx_alpha: f64) -> Model {
    Model::Metal { index: 0.96, extinction: 6.69, ggx_alpha }
}

fn mixed() -> Model {
    Model::Mixture {
        parts: vec![
            Part { share: 0.5, model: coated(0.05, 0.1, Some(FILM)) },
            Part { share: 0.3, model: metal(0.3) },
            Part { share: 0.1, model: Model::Lambertian { reflectance: 0.5 } },
        ],
    }
}

#[test]
fn directions_follow_the_function() {
    // Fixed seeds; each of the sixteen fails by chance at 0.1 %.
    for (name, model) in [
        ("coated", coated(0.05, 0.1, Some(FILM))),
        ("bare", coated(0.3, 0.5, None)),
        ("metal", metal(0.4)),
        ("mixture", mixed()),
    ] {
        for degrees in [10.0, 45.0, 75.0, 85.0] {
            let (chi2, freedom) = sampling_error(&made(&model), degrees);
            assert!(freedom > 40.0, "{name}: only {freedom} bins at {degrees} degrees");
            assert!(
                chi2 < chi_square_limit(freedom),
                "{name} at {degrees} degrees: chi2 {chi2:.1} with {freedom} degrees of freedom"
            );
        }
    }
}

#[test]
fn survivors_add_up_to_the_reflectance_and_bounds_hold() {
    let mut models = vec![
        coated(0.0, 0.1, Some(FILM)),
        coated(0.0, 0.0, None),
        coated(0.02, 0.04, Some(FILM)),
        coated(1.0, 0.9, None),
        metal(0.02),
        metal(1.0),
        mixed(),
    ];
    models.extend(PRESETS.map(|p| p.model()));
    for model in models {
        let bsdf = made(&model);
        for degrees in [0.0, 10.0, 60.0, 75.0, 85.0, 89.0] {
            let incident = from_degrees(degrees, 40.0);
            let (bound, reflectance) = (bsdf.bound(incident), bsdf.reflectance(incident));
            assert!(bound >= reflectance * (1.0 - 1e-3), "{model:?} at {degrees}");
            // Metal's compensation is right in the mean, and a little off at one angle.
            assert!((0.0..=1.003).contains(&reflectance), "{model:?} at {degrees}: {reflectance}");
            let alive = draws(&bsdf, incident, 76).iter().flatten().count() as f64;
            let p = (reflectance / bound).min(1.0);
            // Binomial, 4 sigma: the 84 checks fail by chance at 0.5 %. 1.5e-3 is the quadrature's.
            let limit = 4.0 * (SAMPLES as f64 * p * (1.0 - p)).sqrt() + 1.5e-3 * SAMPLES as f64 * p;
            let off = alive - SAMPLES as f64 * p;
            assert!(off.abs() <= limit, "{model:?} at {degrees}: {off} off, allowed {limit}");
        }
        for step in 0..450 {
            let (low, high) = (f64::from(step) * 0.2 - 0.2665, f64::from(step) * 0.2 + 0.2665);
            let cos = |d: f64| libm::cos(d.clamp(0.0, 180.0).to_radians());
            let whole = bsdf.bound_between(cos(high), cos(low));
            for part in 0..=5 {
                let at = from_degrees((low + 0.1066 * f64::from(part)).abs(), 10.0);
                assert!(whole >= bsdf.bound(at) * (1.0 - 1e-12), "{model:?} at {low}");
            }
        }
    }
}

#[test]
fn light_may_go_either_way() {
    for model in [coated(0.15, 0.3, Some(FILM)), metal(0.4), mixed()] {
        let bsdf = made(&model);
        for i in 0..300 {
            let mut random = Stream::new(77, Purpose::Survey, i);
            let mut one = || from_degrees(89.0 * random.uniform(), 360.0 * random.uniform());
            let (a, b) = (one(), one());
            let (there, back) = (bsdf.evaluate(a, b), bsdf.evaluate(b, a));
            assert!((there - back).abs() <= 1e-12 * there.max(back), "{model:?} {a} {b}");
        }
    }
}

#[test]
fn without_a_film_it_is_pv_glass() {
    let (new, old) = (made(&coated(0.1, 0.2, None)), pv_glass(0.1, 0.2));
    for i in 0..300 {
        let mut random = Stream::new(78, Purpose::Survey, i);
        let mut one = || from_degrees(88.0 * random.uniform(), 360.0 * random.uniform());
        let (a, b) = (one(), one());
        let (x, y) = (new.evaluate(a, b), old.evaluate(a, b));
        assert!((x - y).abs() <= 1e-4 * y, "{a} {b}: {x} {y}");
    }
}

#[test]
fn smooth_glass_mirrors_what_fresnel_says_and_the_cell_the_rest() {
    let bsdf = made(&coated(0.0, 0.1, None));
    for degrees in [0.0, 60.0, 75.0, 88.0] {
        let incident = from_degrees(degrees, 0.0);
        let fresnel = fresnel_reflectance(incident.z, 1.52);
        assert!((bsdf.mirrored(incident) - fresnel).abs() < 2e-5);
        let expected = fresnel + 0.1 * (1.0 - fresnel);
        assert!((bsdf.reflectance(incident) - expected).abs() < 1e-4);
        let lobe = bsdf.lobe(degrees);
        assert!(lobe.width_deg == 0.0 || fresnel < 0.1);
    }
}

/// A photon among GGX facets until it leaves them (Heitz, Hanika, d'Eon and Dachsbacher 2016,
/// "Multiple-scattering microfacet BSDFs with the Smith model"); what enters the glass is lost.
/// Mean share that leaves after the first facet, and after any number of them.
fn walked(alpha: f64, degrees: f64, reflectance: impl Fn(f64) -> f64) -> (f64, f64) {
    let hidden = |v: DVec3| {
        let tan2 = (v.x * v.x + v.y * v.y) / (v.z * v.z);
        0.5 * (v.z.signum() * (1.0 + alpha * alpha * tan2).sqrt() - 1.0)
    };
    let facet = |to: DVec3, u: f64, v: f64| {
        let std = DVec3::new(to.x * alpha, to.y * alpha, to.z).normalize();
        let z = (1.0 - v) * (1.0 + std.z) - std.z;
        let (sin, phi) = ((1.0 - z * z).max(0.0).sqrt(), std::f64::consts::TAU * u);
        let h = DVec3::new(sin * phi.cos(), sin * phi.sin(), z) + std;
        DVec3::new(h.x * alpha, h.y * alpha, h.z.max(0.0)).normalize()
    };
    let (mut single, mut all) = (0.0, 0.0);
    const WALKS: u64 = 60_000;
    for n in 0..WALKS {
        let mut random = Stream::new(79, Purpose::Survey, n);
        let (mut going, mut weight, mut level) = (-from_degrees(degrees, 0.0), 1.0, 1.0_f64);
        for met in 0..40 {
            // Share of the facets that lie below, at heights from -1 to 1.
            let below = 0.5 * (level + 1.0);
            let u = random.uniform();
            let lambda = hidden(going);
            if going.z > 0.0 && u >= 1.0 - below.powf(lambda) {
                if met == 1 {
                    single += weight;
                }
                all += weight;
                break;
            }
            level = 2.0 * (below / (1.0 - u).powf(1.0 / lambda)).min(1.0) - 1.0;
            let (u, v) = (random.uniform(), random.uniform());
            let half = facet(-going, u, v);
            let cos = -going.dot(half);
            weight *= reflectance(cos);
            going = (going + half * (2.0 * cos)).normalize();
        }
    }
    (single / WALKS as f64, all / WALKS as f64)
}

#[test]
fn what_one_facet_leaves_out_is_as_little_as_said() {
    let fresnel = |cos: f64| fresnel_reflectance(cos, 1.52);
    for (alpha, degrees, most) in [
        (0.05, 60.0, 0.01),
        (0.05, 75.0, 0.025),
        (0.05, 85.0, 0.09),
        (0.28, 10.0, 0.04),
        (0.28, 75.0, 0.10),
        (0.28, 85.0, 0.07),
        (0.5, 80.0, 0.08),
    ] {
        let (single, all) = walked(alpha, degrees, fresnel);
        let ours = pv_glass(alpha, 0.0).reflectance(from_degrees(degrees, 0.0));
        assert!((ours / single - 1.0).abs() < 0.02, "{alpha} {degrees}: {ours}, walked {single}");
        eprintln!("alpha {alpha} at {degrees}: one facet {single:.4}, all {all:.4}");
        assert!(all / single - 1.0 < most, "{alpha} at {degrees}: {single} of {all}");
    }
    // Metal loses much more, and gets it back.
    let aluminium = |cos: f64| glintmap::bsdf::metal_reflectance(cos, 0.96, 6.69);
    for (alpha, degrees) in [(0.25, 30.0), (0.6, 10.0), (0.6, 60.0), (0.6, 80.0)] {
        let (single, all) = walked(alpha, degrees, aluminium);
        let ours = made(&metal(alpha)).reflectance(from_degrees(degrees, 0.0));
        eprintln!(
            "metal {alpha} at {degrees}: one facet {single:.4}, all {all:.4}, ours {ours:.4}"
        );
        assert!((ours - all).abs() < 0.02, "{alpha} {degrees}: {ours}, {all}");
    }
}

/// The table of `src/bsdf/presets.md`.
fn table() -> String {
    let mut out = String::from("| preset | | 10° | 60° | 75° | 85° |\n|---|---|---|---|---|---|\n");
    for preset in PRESETS {
        let bsdf = made(&preset.model());
        let angles = [10.0, 60.0, 75.0, 85.0];
        let shares =
            angles.map(|a| format!("{:.1} %", 100.0 * bsdf.reflectance(from_degrees(a, 0.0))));
        let widths = angles.map(|a| format!("{:.1}°", bsdf.lobe(a).width_deg));
        writeln!(out, "| {} | reflects | {} |", preset.name, shares.join(" | ")).unwrap();
        writeln!(out, "| | width | {} |", widths.join(" | ")).unwrap();
    }
    out
}

#[test]
fn the_table_of_presets_says_what_they_do() {
    let page = include_str!("../../src/bsdf/presets.md");
    let table = table();
    assert!(page.contains(&table), "presets.md must hold:\n{table}");
}

#[test]
fn presets_and_mixtures_are_read_strictly() {
    #[derive(Debug, serde::Deserialize)]
    struct Holder {
        #[serde(deserialize_with = "glintmap::bsdf::preset_or_model")]
        model: Model,
    }
    let read = |text: &str| toml::from_str::<Holder>(text).map(|h| h.model);
    for preset in PRESETS {
        assert!(preset.source.len() > 40 && preset.about.len() > 10);
        let model = preset.model();
        model.check().expect("a good preset");
        assert_eq!(read(&format!("model = {:?}", preset.name)).unwrap(), model);
        assert_eq!(read(&format!("model = {{ preset = {:?} }}", preset.name)).unwrap(), model);
        let again = serde_json::to_string(&model).unwrap();
        assert_eq!(serde_json::from_str::<Model>(&again).unwrap(), model);
    }
    let parts = r#"model = { kind = "mixture", parts = [{ share = 0.9, model = "satinated" }, { share = 0.1, model = { kind = "lambertian", reflectance = 0.5 } }] }"#;
    assert!(matches!(read(parts).unwrap(), Model::Mixture { parts } if parts.len() == 2));
    for (text, expected) in [
        ("model = \"satin\"", "there are: standard, anti-reflective"),
        ("model = { preset = \"satin\" }", "no preset is named"),
        ("model = { preset = \"tile\", index = 2 }", "kind"),
        ("model = { kind = \"coated-glass\", index = 1.5, gloss = 2 }", "gloss"),
    ] {
        let error = read(text).expect_err(expected).to_string();
        assert!(error.contains(expected), "{error}");
    }
    let part = |share, model| Part { share, model };
    for (parts, expected) in [
        (vec![], "1 to 16 parts"),
        (vec![part(0.7, Model::Lambertian { reflectance: 0.1 }); 2], "add up to 1"),
        (vec![part(0.5, mixed())], "no mixtures"),
        (vec![part(0.0, Model::Lambertian { reflectance: 0.1 })], "share"),
        (vec![part(0.5, coated(1e-4, 0.0, None))], "ggx_alpha"),
    ] {
        let error: Error = Bsdf::from_model(&Model::Mixture { parts }).expect_err(expected);
        assert!(error.to_string().contains(expected), "{error}");
    }
}
