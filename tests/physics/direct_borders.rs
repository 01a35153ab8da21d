//! The slow twin of direct integration where shadows' borders cross the PV: rays for both sides at
//! every one of thousands of places, each with its own point of the sun's disc.

use glam::DVec3;
use glintmap::base::{Frame, Silent};
use glintmap::bsdf::Bsdf;
use glintmap::project::Resolved;
use glintmap::render::{Direct, DirectScene, DirectScratch, DirectYear, PvSight, View, hits};
use glintmap::site::Site;
use glintmap::sky::{self, DayRange};

use crate::support::program::root;

/// Places on each triangle of PV.
const PLACES: u32 = 2400;

/// The i-th point of Roberts's R2 sequence (2018), turned by a start.
fn quasi(i: u32, start: [f64; 2]) -> [f64; 2] {
    [
        (f64::from(i) * 0.754_877_666_246_692_7 + start[0]) % 1.0,
        (f64::from(i) * 0.569_840_290_998_053_2 + start[1]) % 1.0,
    ]
}

/// By sun: from every other place, twice.
fn dense(scene: &DirectScene<'_>, at: DVec3, normal: DVec3, suns: &[usize]) -> Vec<[f64; 2]> {
    let (site, timeline) = (scene.site, scene.timeline);
    let radius = 0.5 * timeline.sun_diameter_deg.to_radians();
    let mut out = vec![[0.0; 2]; suns.len()];
    for (pv, bsdf) in site.pv.iter().zip(&scene.bsdfs) {
        let frame = Frame::around(pv.normal);
        for &t in &pv.triangles {
            let [a, b, c] = site.triangles[t as usize].corners.map(|c| c.as_dvec3());
            let area_m2 = 0.5 * (b - a).cross(c - a).length();
            for i in 0..PLACES {
                let [mut u, mut v] = quasi(i, [0.3, 0.7]);
                if u + v > 1.0 {
                    (u, v) = (1.0 - u, 1.0 - v);
                }
                let place = a + (b - a) * u + (c - a) * v;
                let start = place + pv.normal * 5e-3;
                let way = at + normal * 2e-3 - start;
                let (length, cos) = (way.length(), -normal.dot(way.normalize()));
                let towards = frame.local_from_world((at - place).normalize());
                let blocked = |way: DVec3, most: f64| {
                    site.bvh.occluded(start.as_vec3(), way.as_vec3(), 0.0, most as f32)
                };
                if cos <= 0.0
                    || towards.z <= 0.0
                    || length > scene.max_path_m
                    || blocked(way / length, length - 1e-3)
                {
                    continue;
                }
                let solid = area_m2 / f64::from(PLACES / 2) * towards.z * cos / (length * length);
                for (sum, &step) in out.iter_mut().zip(suns) {
                    let step = &timeline.steps[step];
                    let sun = frame.local_from_world(step.sun);
                    if sun.z <= 0.0 || blocked(step.sun, f64::INFINITY) {
                        continue;
                    }
                    let [p, q] = quasi(i, [0.1 + 0.37 * step.hour, 0.2]);
                    let (r, turn) = (radius * libm::sqrt(p), std::f64::consts::TAU * q);
                    let axes = Frame::around(sun);
                    let side = axes.x * (r * libm::cos(turn)) + axes.y * (r * libm::sin(turn));
                    let sun = (sun + side).normalize();
                    let value = bsdf.evaluate(sun, towards) * sun.z * step.irradiance_w_m2 * solid;
                    sum[(i % 2) as usize] += value;
                }
            }
        }
    }
    out
}

#[test]
fn borders_of_shadows_stay_within_the_bound() {
    let folder = root().join("fixtures/projects/case-study");
    let mut resolved = Resolved::read(&folder, &[], 1 << 30).expect("reads");
    resolved.times.days = DayRange { from: 10, to: 181, step: 57 };
    let site = Site::load(&resolved.scene, &resolved.pv).expect("loads");
    let timeline = sky::timeline(&resolved.place, &resolved.times).expect("has suns");
    let view = View::parse("-vtl -vp -30 0 200 -vd 0 0 -1 -vu 0 1 0 -vh 70 -vv 70", 14, 14)
        .expect("a view");
    let hits = hits(&view, &site, 100.0, 1, &Silent).expect("hits");
    let sight = PvSight::new(&site, &timeline, true, &Silent).expect("looks");
    for name in ["satinated", "tile"] {
        let candidate = resolved.candidates.iter().find(|c| c.name == name).expect("there");
        let bsdfs: Vec<&Bsdf> = site.pv.iter().map(|s| &candidate.bsdfs[s.entry]).collect();
        let scene = DirectScene {
            site: &site,
            timeline: &timeline,
            bsdfs,
            max_path_m: 100.0,
            sun_visibility: true,
        };
        let direct = Direct::new(scene.clone(), &sight).expect("fits");
        let (mut scratch, mut year) = (DirectScratch::default(), DirectYear::default());
        let (mut cases, mut outside, mut miss, mut sums) = (0, 0, 0.0, [0.0, 0.0]);
        for hit in hits.hits.iter().filter(|h| h.kind.receives()).step_by(5) {
            let (at, normal) = (hit.position.as_dvec3(), hit.normal.as_dvec3());
            direct.year(at, normal, &mut scratch, &mut year);
            let suns: Vec<usize> = (0..timeline.steps.len())
                .filter(|&i| year.surface_w_m2[i] > 0.0)
                .step_by(7)
                .collect();
            if suns.is_empty() {
                continue;
            }
            for ([even, odd], &i) in dense(&scene, at, normal, &suns).into_iter().zip(&suns) {
                let (expected, noise) = (0.5 * (even + odd), (even - odd).abs());
                let (found, bound) = (year.surface_w_m2[i], year.error_w_m2[i]);
                cases += 1;
                // What stands between corners that agree isn't held by the bound.
                let most = bound + noise + 1e-2 * expected + 1e-4;
                outside += usize::from((found - expected).abs() > most);
                miss += (found - expected).abs();
                sums[0] += found;
                sums[1] += expected;
            }
        }
        let ratio = sums[0] / sums[1];
        println!(
            "{name}: {cases} cases, {outside} outside, ratio {ratio:.5}, {:.1e}",
            miss / sums[1]
        );
        assert!(cases > 60, "{cases}");
        assert!(outside * 50 <= cases, "{name}: {outside} of {cases} outside of the bound");
        assert!((ratio - 1.0).abs() < 5e-3 && miss < 0.01 * sums[1], "{name}: {ratio}");
    }
}
