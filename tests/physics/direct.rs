//! Direct integration against the photons: the same light by two ways that share nothing but the
//! scene and the material.

use glam::DVec3;
use glintmap::base::{Photon, PhotonSink, Silent, SinkError};
use glintmap::render::{Direct, DirectScene, DirectScratch, DirectYear, PvSight, View, hits};
use glintmap::run::Resolved;
use glintmap::site::Site;
use glintmap::sky::{self, DayRange};
use glintmap::trace::{self, Emission, Settings};

use crate::support::program::root;

#[derive(Default)]
struct Kept(Vec<Photon>);

impl PhotonSink for Kept {
    fn accept(&mut self, photons: &[Photon]) -> Result<(), SinkError> {
        self.0.extend_from_slice(photons);
        Ok(())
    }
}

/// Photons are counted in discs of this radius, m.
const RADIUS_M: f64 = 1.5;

/// Places of a disc on the plane, each for the same share of it.
fn disc(position: DVec3, normal: DVec3) -> Vec<DVec3> {
    let (x, y) = normal.any_orthonormal_pair();
    let mut out = Vec::new();
    for (share, around) in [(0.25, 6), (0.75, 10)] {
        for i in 0..around {
            let a = std::f64::consts::TAU * f64::from(i) / f64::from(around);
            let r = RADIUS_M * f64::sqrt(share);
            out.push(position + x * (r * libm::cos(a)) + y * (r * libm::sin(a)));
        }
    }
    out
}

#[test]
fn photons_and_direct_integration_agree_within_their_noise() {
    let folder = root().join("fixtures/projects/case-study");
    let mut resolved = Resolved::read(&folder, &[], 1 << 30).expect("reads");
    resolved.times.days = DayRange { from: 3, to: 181, step: 30 };
    let site = Site::load(&resolved.scene, &resolved.pv).expect("loads");
    let timeline = sky::timeline(&resolved.place, &resolved.times).expect("has suns");
    let settings = Settings { stored: 400_000, ..resolved.trace };
    let view = View::parse("-vtl -vp -35 0 200 -vd 0 0 -1 -vu 0 1 0 -vh 60 -vv 60", 20, 20)
        .expect("a view");
    let hits = hits(&view, &site, 100.0, 1, &Silent).expect("hits");
    let sight = PvSight::new(&site, &timeline, true, &Silent).expect("looks");
    for name in ["satinated", "tile"] {
        let candidate = resolved.candidates.iter().find(|c| c.name == name).expect("there");
        let bsdfs: Vec<_> = site.pv.iter().map(|s| &candidate.bsdfs[s.entry]).collect();
        let emission =
            Emission { site: &site, timeline: &timeline, bsdfs: bsdfs.clone(), settings };
        let plan = trace::plan(&emission, &Silent).expect("pilot");
        let mut photons = Kept::default();
        trace::run(&emission, &plan, &mut photons, &Silent).expect("runs");
        let scene = DirectScene {
            site: &site,
            timeline: &timeline,
            bsdfs,
            max_path_m: settings.max_path_m,
            sun_visibility: true,
        };
        let direct = Direct::new(scene, &sight).expect("fits");
        let (mut scratch, mut year) = (DirectScratch::default(), DirectYear::default());
        let mut annual = |at: DVec3, normal: DVec3| {
            direct.year(at, normal, &mut scratch, &mut year);
            timeline.steps.iter().zip(&year.surface_w_m2).map(|(s, e)| s.weight_h * e).sum::<f64>()
        };
        let (mut compared, mut outside, mut sums) = (0, 0, [0.0, 0.0]);
        for hit in hits.hits.iter().filter(|h| h.kind.receives()) {
            let (position, normal) = (hit.position.as_dvec3(), hit.normal.as_dvec3());
            let places = disc(position, normal);
            // A disc on nearly one plane, with nothing standing on it.
            let plain = places.iter().all(|p| {
                let above = (*p + normal * 0.5).as_vec3();
                let found = site.bvh.closest(above, -hit.normal, 0.0, 1.0);
                found.is_some_and(|f| (f.distance_m - 0.5).abs() < 0.05)
            });
            if !plain {
                continue;
            }
            let (mut flux, mut squares, mut count) = (0.0, 0.0, 0);
            for p in &photons.0 {
                let off = p.position - hit.position;
                if off.length_squared() < (RADIUS_M * RADIUS_M) as f32
                    && off.dot(hit.normal).abs() < 0.1
                    && p.normal.dot(hit.normal) > 0.97
                {
                    let part = f64::from(p.flux_w) * timeline.steps[p.timestep as usize].weight_h;
                    flux += part;
                    squares += part * part;
                    count += 1;
                }
            }
            if count < 10 {
                continue;
            }
            let around: Vec<f64> = places.iter().map(|p| annual(*p, normal)).collect();
            let (least, most) =
                around.iter().fold((f64::MAX, 0.0_f64), |(a, b), e| (a.min(*e), b.max(*e)));
            // A shadow's border crosses the disc.
            if most > 3.0 * least {
                continue;
            }
            let area = std::f64::consts::PI * RADIUS_M * RADIUS_M;
            let mean = around.iter().sum::<f64>() / around.len() as f64;
            let (found, error) = (flux / area, squares.sqrt() / area);
            compared += 1;
            outside += usize::from((found - mean).abs() > 4.0 * error);
            sums[0] += found;
            sums[1] += mean;
        }
        let ratio = sums[0] / sums[1];
        println!("{name}: {compared} discs, {outside} outside 4 standard errors, ratio {ratio:.4}");
        assert!(compared >= 10, "{compared} discs");
        assert!(outside * 100 <= compared, "{outside} of {compared}");
        // All discs together hold some ten thousand photons.
        assert!((ratio - 1.0).abs() < 0.04, "{ratio}");
    }
}
