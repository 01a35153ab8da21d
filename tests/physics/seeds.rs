//! What the standard error promises, held by the real tracer, store and gather on the case study:
//! many runs that differ by their seed alone.

use std::path::Path;

use crate::support::photons;
use glam::DVec3;
use glintmap::base::{Photon, PhotonSink, Silent, SinkError, Timeline};
use glintmap::bsdf::Bsdf;
use glintmap::project::Resolved;
use glintmap::render::{
    Annual, Direct, DirectScene, DirectScratch, DirectYear, Gather, Hit, HitMap, PvSight, Surfaces,
    View, annual, hits,
};
use glintmap::site::Site;
use glintmap::sky;
use glintmap::trace::{Emission, Plan, Settings};

use super::render::gather::store_within;
use crate::support::program::root;

#[derive(Default)]
struct Kept(Vec<Photon>);

impl PhotonSink for Kept {
    fn accept(&mut self, photons: &[Photon]) -> Result<(), SinkError> {
        // The stores of tests know of one surface.
        self.0.extend(photons.iter().map(|p| Photon { surface: 0, ..*p }));
        Ok(())
    }
}

/// One roof of the case study under a few suns, and a small picture of the meadow, the houses and the trees
/// that that roof shines on.
struct Case {
    resolved: Resolved,
    site: Site,
    timeline: Timeline,
    hits: HitMap,
    weights: Vec<f64>,
}

impl Case {
    fn new() -> Self {
        let folder = root().join("fixtures/projects/case-study");
        let resolved = Resolved::read(&folder, &[], 1 << 30).expect("reads");
        let site = Site::load(&resolved.scene, &resolved.pv[..1]).expect("loads");
        let mut timeline = sky::timeline(&resolved.place, &resolved.times).expect("has suns");
        timeline.steps.retain(|s| s.day == 154 && [7.0, 8.0, 9.0].contains(&s.hour));
        assert_eq!(timeline.steps.len(), 3);
        let view = View::parse("-vtl -vp -35 0 200 -vd 0 0 -1 -vu 0 1 0 -vh 60 -vv 60", 40, 40);
        let hits = hits(&view.expect("a view"), &site, 100.0, 1, &Silent).expect("hits");
        let weights = timeline.steps.iter().map(|s| s.weight_h).collect();
        Self { resolved, site, timeline, hits, weights }
    }

    fn bsdfs(&self) -> Vec<&Bsdf> {
        let found = self.resolved.candidates.iter().find(|c| c.name == "satinated");
        let candidate = found.expect("there");
        self.site.pv.iter().map(|s| &candidate.bsdfs[s.entry]).collect()
    }

    fn emission(&self, stored: u64, seed: u64) -> Emission<'_> {
        let settings = Settings { stored, seed, ..self.resolved.trace };
        Emission { site: &self.site, timeline: &self.timeline, bsdfs: self.bsdfs(), settings }
    }

    /// The map of a seed. The plan is that of the first seed: as many photons are sent in each.
    fn map(
        &self,
        folder: &Path,
        surfaces: &Surfaces<'_>,
        (stored, plan): (u64, &Plan),
        seed: u64,
        how: &Gather,
    ) -> Annual {
        let mut photons = Kept::default();
        photons::run(&self.emission(stored, seed), plan, &mut photons, &Silent).expect("runs");
        let folder = folder.join(format!("{stored}-{seed}"));
        std::fs::create_dir(&folder).expect("makes a folder");
        let steps = self.timeline.steps.len() as u32;
        let store = store_within(&folder, &photons.0, steps, self.site.bounds);
        annual(&store, Some(surfaces), &self.hits, &self.weights, how, &Silent).expect("gathers")
    }

    fn maps(&self, stored: u64, seeds: u64, how: &Gather) -> Vec<Annual> {
        let keep = tempfile::tempdir().expect("a folder");
        let plan = photons::plan(&self.emission(stored, 1), &Silent).expect("pilot");
        let surfaces = Surfaces::of(&self.site);
        let map = |seed| self.map(keep.path(), &surfaces, (stored, &plan), seed, how);
        (1..=seeds).map(map).collect()
    }

    /// Whether a disc lies on one even surface with nothing standing on it: no edge.
    fn is_open(&self, hit: &Hit, radius_m: f64) -> bool {
        let (position, normal) = (hit.position.as_dvec3(), hit.normal.as_dvec3());
        let (x, y) = normal.any_orthonormal_pair();
        (0..24).all(|i| {
            let turn = f64::from(i % 12) / 12.0 * std::f64::consts::TAU;
            let r = radius_m * if i < 12 { 1.0 } else { 0.5 };
            let place = position + x * (r * libm::cos(turn)) + y * (r * libm::sin(turn));
            let from = (place + normal * 0.5).as_vec3();
            let met = self.site.bvh.closest(from, -hit.normal, 0.0, 1.0);
            met.is_some_and(|m| (m.distance_m - 0.5).abs() < 0.2)
        })
    }
}

/// A pixel over many seeds.
struct Pixel {
    values: Vec<f64>,
    errors: Vec<f64>,
    mean: f64,
    open: bool,
}

fn pixels(case: &Case, maps: &[Annual]) -> Vec<(usize, Pixel)> {
    let mut out = Vec::new();
    for (i, hit) in case.hits.hits.iter().enumerate() {
        let of = |pick: fn(&Annual) -> &glintmap::base::Grid<f32>| -> Vec<f64> {
            maps.iter().map(|m| f64::from(pick(m).data()[i])).collect()
        };
        let (values, errors) = (of(|m| &m.surface), of(|m| &m.error));
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let error = errors.iter().sum::<f64>() / errors.len() as f64;
        // Thirty photons and more: fewer aren't normal.
        if hit.kind.receives() && mean > 0.0 && mean * mean > 30.0 * error * error {
            let radius_m = of(|m| &m.radius_m).into_iter().fold(0.0, f64::max);
            let open = case.is_open(hit, radius_m);
            out.push((i, Pixel { values, errors, mean, open }));
        }
    }
    out
}

/// Share of values that lie within 1.96 standard errors of the mean over the seeds.
fn covered<'a>(pixels: impl Iterator<Item = &'a Pixel>) -> (f64, usize) {
    let (mut within, mut all) = (0, 0);
    for p in pixels {
        for (value, error) in p.values.iter().zip(&p.errors) {
            within += usize::from((value - p.mean).abs() <= 1.96 * error);
            all += 1;
        }
    }
    (100.0 * within as f64 / all as f64, all / 64)
}

/// The standard error that a map gives covers the mean of 64 seeds in 95 % of the pixels, +-2.
#[test]
fn the_standard_error_covers_the_mean_of_64_seeds() {
    let case = Case::new();
    let how = Gather { bandwidth: 100, ..Gather::default() };
    let maps = case.maps(30_000, 64, &how);
    let pixels = pixels(&case, &maps);
    let of = |open: bool| pixels.iter().map(|(_, p)| p).filter(move |p| p.open == open);
    let (share, count) = covered(of(true));
    let (at_edges, edges) = covered(of(false));
    println!("covered: {share:.2} % of {count} open pixels, {at_edges:.2} % of {edges} at edges");

    // The bias, against the integral at the pixel: what the disc blurs, and what edges add.
    let scene = DirectScene {
        site: &case.site,
        timeline: &case.timeline,
        bsdfs: case.bsdfs(),
        max_path_m: case.resolved.trace.max_path_m,
        sun_visibility: true,
    };
    let sight = PvSight::new(&case.site, &case.timeline, true, &Silent).expect("looks");
    let direct = Direct::new(scene, &sight).expect("fits");
    let (mut scratch, mut year) = (DirectScratch::default(), DirectYear::default());
    let mut bias = |open: bool| {
        let (mut sum, mut truths) = (0.0, 0.0);
        for (i, p) in pixels.iter().filter(|(_, p)| p.open == open) {
            let hit = &case.hits.hits[*i];
            let [at, normal]: [DVec3; 2] = [hit.position, hit.normal].map(|v| v.as_dvec3());
            direct.year(at, normal, &mut scratch, &mut year);
            let steps = year.lit.iter().map(|&t| t as usize);
            let truth: f64 = steps.map(|t| year.surface_w_m2[t] * case.weights[t]).sum();
            sum += p.mean - truth;
            truths += truth;
        }
        100.0 * sum / truths
    };
    let (open_bias, edge_bias) = (bias(true), bias(false));
    println!("bias of the sum: {open_bias:+.2} % of open pixels, {edge_bias:+.2} % at edges");
    assert!(count > 30 && edges > 10, "{count}, {edges}");
    assert!((share - 95.0).abs() <= 2.0, "{share}");
    // Discs of some metres blur the light's gradient.
    assert!(open_bias.abs() < 8.0, "{open_bias}");
}

/// As many more photons in the same disc: the noise falls with the root of their number.
#[test]
fn noise_falls_with_the_root_of_the_photons_that_are_traced() {
    let case = Case::new();
    let mut found: Vec<(f64, f64)> = Vec::new();
    let mut chosen: Option<Vec<usize>> = None;
    for (stored, bandwidth) in [(7_500, 25), (15_000, 50), (30_000, 100), (60_000, 200)] {
        let maps = case.maps(stored, 16, &Gather { bandwidth, ..Gather::default() });
        let values = |i: usize| maps.iter().map(move |m| f64::from(m.surface.data()[i]));
        let mean = |i: usize| values(i).sum::<f64>() / 16.0;
        let full = |i: usize| {
            let radii = maps.iter().map(|m| m.radius_m.data()[i]);
            maps.iter().all(|m| {
                m.error.data()[i] < 1.1 * m.surface.data()[i] / (bandwidth as f32 - 1.0).sqrt()
            }) && case.is_open(&case.hits.hits[i], f64::from(radii.fold(0.0, f32::max)))
        };
        let pixels = chosen.get_or_insert_with(|| {
            (0..case.hits.hits.len()).filter(|&i| mean(i) > 0.0 && full(i)).collect()
        });
        assert!(pixels.len() > 20, "{}", pixels.len());
        let off = |&i: &usize| {
            let mean = mean(i);
            values(i).map(|v| (v / mean - 1.0) * (v / mean - 1.0)).sum::<f64>() / 15.0
        };
        let noise = (pixels.iter().map(off).sum::<f64>() / pixels.len() as f64).sqrt();
        println!("{stored} photons: {:.2} % in {} pixels", 100.0 * noise, pixels.len());
        found.push(((stored as f64).ln(), noise.ln()));
    }
    let mean = |of: fn(&(f64, f64)) -> f64| found.iter().map(of).sum::<f64>() / 4.0;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let slope = found.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>()
        / found.iter().map(|p| (p.0 - x) * (p.0 - x)).sum::<f64>();
    println!("slope {slope:.3}");
    assert!((slope + 0.5).abs() < 0.08, "{slope}");
}
