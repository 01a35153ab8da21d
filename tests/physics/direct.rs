//! Direct integration against the photons: the same light by two ways that share nothing but the
//! scene and the material.

use std::collections::HashMap;

use crate::support::photons;
use glam::DVec3;
use glintmap::base::{Photon, PhotonSink, Silent, SinkError};
use glintmap::project::Resolved;
use glintmap::render::{Direct, DirectScene, DirectScratch, DirectYear, Hit, PvSight, View, hits};
use glintmap::site::Site;
use glintmap::sky::{self, DayRange};
use glintmap::trace::{Emission, Settings};

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
const RADIUS_M: f64 = 1.0;

/// Places of a disc on the plane, each for the same share of it.
fn disc(position: DVec3, normal: DVec3) -> Vec<DVec3> {
    let (x, y) = normal.any_orthonormal_pair();
    let mut out = Vec::new();
    for (share, around) in [(0.2, 4), (0.7, 6)] {
        for i in 0..around {
            let a = std::f64::consts::TAU * f64::from(i) / f64::from(around);
            let r = RADIUS_M * f64::sqrt(share);
            out.push(position + x * (r * libm::cos(a)) + y * (r * libm::sin(a)));
        }
    }
    out
}

/// Photons by cells of the search radius.
struct Index<'a> {
    photons: &'a [Photon],
    cells: HashMap<[i32; 3], Vec<usize>>,
}

impl<'a> Index<'a> {
    fn of(photons: &'a [Photon]) -> Self {
        let mut cells: HashMap<_, Vec<usize>> = HashMap::new();
        for (i, p) in photons.iter().enumerate() {
            cells.entry(Self::cell(p.position.as_dvec3())).or_default().push(i);
        }
        Self { photons, cells }
    }

    fn cell(at: DVec3) -> [i32; 3] {
        (at / RADIUS_M).floor().as_ivec3().to_array()
    }

    fn near(&self, at: DVec3) -> impl Iterator<Item = &'a Photon> {
        let [x, y, z] = Self::cell(at);
        let all = (-1..=1).flat_map(move |i| {
            (-1..=1).flat_map(move |j| (-1..=1).map(move |k| [x + i, y + j, z + k]))
        });
        all.filter_map(|cell| self.cells.get(&cell)).flatten().map(|&i| &self.photons[i])
    }
}

/// Every material, both views of the case study: photons in discs that lie on one plane and hold
/// no border of light, against the mean of direct integration over them.
#[test]
fn photons_and_direct_integration_agree_within_their_noise() {
    let folder = root().join("fixtures/projects/case-study");
    let mut resolved = Resolved::read(&folder, &[], 1 << 30).expect("reads");
    resolved.times.days = DayRange { from: 3, to: 181, step: 35 };
    let site = Site::load(&resolved.scene, &resolved.pv).expect("loads");
    let timeline = sky::timeline(&resolved.place, &resolved.times).expect("has suns");
    let settings = Settings { stored: 300_000, ..resolved.trace };
    let spots: Vec<Hit> = [
        ("-vtl -vp -30 0 200 -vd 0 0 -1 -vu 0 1 0 -vh 90 -vv 90", 50, 50),
        ("-vtc -vp 1 5 25 -vd 0 -1 0 -vu 0 0 1 -vh 360 -vv 76.3 -vo 32", 120, 30),
    ]
    .into_iter()
    .flat_map(|(view, columns, rows)| {
        let view = View::parse(view, columns, rows).expect("a view");
        hits(&view, &site, 100.0, 1, &Silent).expect("hits").hits
    })
    // A disc on nearly one plane, with nothing standing on it.
    .filter(|hit| {
        let (position, normal) = (hit.position.as_dvec3(), hit.normal.as_dvec3());
        hit.kind.receives()
            && disc(position, normal).iter().all(|p| {
                let above = (*p + (*p - position) * 0.2 + normal * 0.5).as_vec3();
                let found = site.bvh.closest(above, -hit.normal, 0.0, 1.0);
                found.is_some_and(|f| (f.distance_m - 0.5).abs() < 0.03)
            })
    })
    .collect();
    let sight = PvSight::new(&site, &timeline, true, &Silent).expect("looks");
    for candidate in &resolved.candidates {
        let name = &candidate.name;
        let bsdfs: Vec<_> = site.pv.iter().map(|s| &candidate.bsdfs[s.entry]).collect();
        let emission =
            Emission { site: &site, timeline: &timeline, bsdfs: bsdfs.clone(), settings };
        let plan = photons::plan(&emission, &Silent).expect("pilot");
        let mut photons = Kept::default();
        photons::run(&emission, &plan, &mut photons, &Silent).expect("runs");
        let index = Index::of(&photons.0);
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
        let (mut compared, mut outside, mut off) = (0, 0, 0.0);
        for hit in &spots {
            let (position, normal) = (hit.position.as_dvec3(), hit.normal.as_dvec3());
            let (mut flux, mut squares, mut count) = (0.0, 0.0, 0);
            for p in index.near(position) {
                let way = p.position.as_dvec3() - position;
                if way.length_squared() < RADIUS_M * RADIUS_M
                    && way.dot(normal).abs() < 0.1
                    && p.normal.dot(hit.normal) > 0.97
                {
                    let part = f64::from(p.flux_w) * timeline.steps[p.timestep as usize].weight_h;
                    flux += part;
                    squares += part * part;
                    count += 1;
                }
            }
            if count < 20 {
                continue;
            }
            let around: Vec<f64> =
                disc(position, normal).iter().map(|p| annual(*p, normal)).collect();
            let (least, most) =
                around.iter().fold((f64::MAX, 0.0_f64), |(a, b), e| (a.min(*e), b.max(*e)));
            // A shadow's border crosses the disc.
            if least == 0.0 || most > 1.8 * least {
                continue;
            }
            let area = std::f64::consts::PI * RADIUS_M * RADIUS_M;
            let mean = around.iter().sum::<f64>() / around.len() as f64;
            let error = squares.sqrt() / area * (mean * area / flux).sqrt();
            let z = (flux / area - mean) / error;
            compared += 1;
            outside += usize::from(z.abs() > 4.0);
            off += z;
        }
        let mean = off / f64::from(compared);
        println!("{name}: {compared} discs, {outside} outside 4 standard errors, mean {mean:+.3}");
        assert!(compared >= if name == "smooth" { 3 } else { 60 }, "{compared} discs");
        assert!(outside * 100 <= compared as usize, "{name}: {outside} of {compared}");
        // What all have in common: 4 of its own standard errors, and curvature within discs.
        let most = 4.0 / f64::from(compared).sqrt() + 0.1;
        assert!(mean.abs() < most, "{name}: {mean}");
    }
}
