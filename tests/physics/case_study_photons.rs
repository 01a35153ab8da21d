//! The photons of the built-in case study: which way they fly, when, from which roof, and where
//! they land. Flux is sorted by the compass sector of the **flight**: the azimuth of minus
//! `Photon::direction`, so that a photon in the sector W flies from the roof to the west.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use crate::support::photons;
use glam::{DVec3, Vec3};
use glintmap::base::{Photon, PhotonSink, Silent, SinkError, Timeline, Timestep};
use glintmap::project::Resolved;
use glintmap::site::Site;
use glintmap::sky::{self, DayRange, altitude_azimuth_deg, date_of_day};
use glintmap::trace::{Emission, Settings};

use crate::support::program::root;

/// Stored photons a material: all on 4 days of June and 4 of December.
const STORED: u64 = 60_000;
/// Sectors of the compass: N, NNE, …; each centred on its direction.
const SECTORS: usize = 16;
const ESE: usize = 5;
const WSW: usize = 11;
const W: usize = 12;
const WNW: usize = 13;

const JUNE: u32 = 6;
const DECEMBER: u32 = 12;

/// The surfaces by the order of the `[[pv]]` entries.
const WEST_LOWER: u16 = 0;
const WEST_UPPER: u16 = 1;
const SOUTH: u16 = 2;

struct Case {
    site: Site,
    timeline: Timeline,
    settings: Settings,
    photons: BTreeMap<String, Vec<Photon>>,
}

#[derive(Default)]
struct Kept(Vec<Photon>);

impl PhotonSink for Kept {
    fn accept(&mut self, photons: &[Photon]) -> Result<(), SinkError> {
        self.0.extend_from_slice(photons);
        Ok(())
    }
}

/// Traced once for all tests. The project's half year holds no December: days of our own.
fn case() -> &'static Case {
    static CASE: OnceLock<Case> = OnceLock::new();
    CASE.get_or_init(|| {
        let folder = root().join("fixtures/projects/case-study");
        let mut resolved = Resolved::read(&folder, &[], 1 << 30).expect("reads");
        resolved.times.days = DayRange { from: 3, to: 364, step: 7 };
        resolved.times.half_year = false;
        let site = Site::load(&resolved.scene, &resolved.pv).expect("loads");
        let mut timeline = sky::timeline(&resolved.place, &resolved.times).expect("has suns");
        timeline.steps.retain(|step| [JUNE, DECEMBER].contains(&month(step)));
        let settings = Settings { stored: STORED, ..resolved.trace };
        let mut photons = BTreeMap::new();
        for candidate in resolved.candidates.iter().filter(|c| c.name != "smooth") {
            let bsdfs = site.pv.iter().map(|s| &candidate.bsdfs[s.entry]).collect();
            let emission = Emission { site: &site, timeline: &timeline, bsdfs, settings };
            let plan = photons::plan(&emission, &Silent).expect("pilot");
            let mut kept = Kept::default();
            photons::run(&emission, &plan, &mut kept, &Silent).expect("runs");
            photons.insert(candidate.name.clone(), kept.0);
        }
        Case { site, timeline, settings, photons }
    })
}

fn month(step: &Timestep) -> u32 {
    date_of_day(2018, step.day).0
}

impl Case {
    fn step(&self, photon: &Photon) -> &Timestep {
        &self.timeline.steps[photon.timestep as usize]
    }

    /// The photons of a month between two hours, the second not included.
    fn of(&self, material: &str, month_: u32, from: f64, to: f64) -> Vec<&Photon> {
        let within = |p: &&Photon| {
            let step = self.step(p);
            month(step) == month_ && (from..to).contains(&step.hour)
        };
        self.photons[material].iter().filter(within).collect()
    }
}

fn flight_azimuth_deg(photon: &Photon) -> f64 {
    altitude_azimuth_deg(-photon.direction.as_dvec3()).1
}

/// Flux by compass sector, W summed over the timesteps.
fn by_sector(photons: &[&Photon]) -> [f64; SECTORS] {
    let mut out = [0.0; SECTORS];
    let width = 360.0 / SECTORS as f64;
    for p in photons {
        let sector = ((flight_azimuth_deg(p) + 0.5 * width) / width) as usize % SECTORS;
        out[sector] += f64::from(p.flux_w);
    }
    out
}

fn flux_w<'a>(photons: impl IntoIterator<Item = &'a &'a Photon>) -> f64 {
    photons.into_iter().map(|p| f64::from(p.flux_w)).sum()
}

fn share_from(photons: &[&Photon], surfaces: &[u16]) -> f64 {
    flux_w(photons.iter().filter(|p| surfaces.contains(&p.surface))) / flux_w(photons)
}

/// Where the ideal mirror would send the light of a timestep.
fn mirrored(case: &Case, photon: &Photon) -> DVec3 {
    let sun = case.step(photon).sun;
    let normal = case.site.pv[usize::from(photon.surface)].normal;
    2.0 * sun.dot(normal) * normal - sun
}

#[test]
fn surfaces_are_the_roofs_in_the_projects_order() {
    let names: Vec<&str> = case().site.pv.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["roof-west-lower", "roof-west-upper", "roof-south"]);
    for (surface, azimuth) in [(WEST_LOWER, 270.0), (WEST_UPPER, 270.0), (SOUTH, 180.0)] {
        let (_, found) = altitude_azimuth_deg(case().site.pv[usize::from(surface)].normal);
        assert!((found - azimuth).abs() < 0.01, "{surface}: {found}");
    }
}

/// The table, in the photons: west on summer mornings, west-southwest before that,
/// east-southeast in the evening, each from the roofs that it names.
#[test]
fn the_standard_module_peaks_where_the_table_says() {
    let case = case();
    let west: &[u16] = &[WEST_LOWER, WEST_UPPER];
    for (from, to, sector, surfaces) in [
        (5.5, 6.3, WSW, &[SOUTH][..]),
        (7.0, 7.3, W, west),
        (7.5, 7.8, W, west),
        (8.0, 8.3, W, west),
        (8.5, 8.8, W, west),
        (18.0, 18.3, ESE, &[SOUTH]),
        (18.5, 18.8, ESE, &[SOUTH]),
        (19.0, 19.3, ESE, &[SOUTH]),
    ] {
        let photons = case.of("standard", JUNE, from, to);
        assert!(photons.len() > 200, "{from} h: {} photons", photons.len());
        let flux = by_sector(&photons);
        let total: f64 = flux.iter().sum();
        let share = flux[sector] / total;
        assert!(share > 0.7, "{from} h: {share:.3} of the flux in sector {sector}: {flux:.0?}");
        let width = 360.0 / SECTORS as f64;
        let there: Vec<&Photon> = photons
            .iter()
            .copied()
            .filter(|p| {
                let off = (flight_azimuth_deg(p) - sector as f64 * width + 540.0).rem_euclid(360.0);
                (off - 180.0).abs() < 0.5 * width
            })
            .collect();
        let share = share_from(&there, surfaces);
        assert!(share > 0.8, "{from} h: {share:.3} from {surfaces:?}");
        if surfaces.len() == 2 {
            for &one in surfaces {
                assert!(share_from(&there, &[one]) > 0.3, "{from} h: both roofs take part");
            }
        }
    }
}

/// Around the mirrored sun the lobe is symmetric in azimuth: its mean is the mirror's.
#[test]
fn the_standard_lobe_lies_around_the_mirrored_sun() {
    let case = case();
    for (from, to, surface) in [
        (7.0, 7.2, WEST_LOWER),
        (7.5, 7.7, WEST_LOWER),
        (8.0, 8.2, WEST_UPPER),
        (6.0, 6.2, SOUTH),
        (18.5, 18.7, SOUTH),
        (19.0, 19.2, SOUTH),
    ] {
        let (mut sum, mut near, mut all) = (0.0, 0.0, 0.0);
        for p in case.of("standard", JUNE, from, to) {
            if p.surface != surface {
                continue;
            }
            let (_, mirror) = altitude_azimuth_deg(mirrored(case, p));
            let off = (flight_azimuth_deg(p) - mirror + 540.0).rem_euclid(360.0) - 180.0;
            let flux = f64::from(p.flux_w);
            all += flux;
            if off.abs() < 20.0 {
                near += flux;
                sum += off * flux;
            }
        }
        assert!(near > 0.9 * all, "{from} h: {near} of {all} W within 20 degrees");
        let mean = sum / near;
        assert!(mean.abs() < 3.0, "{from} h, surface {surface}: {mean:.2} degrees off");
    }
}

#[test]
fn nothing_flies_west_on_december_mornings_but_what_cells_scatter() {
    let case = case();
    let west = |material: &str, month: u32, from: f64, to: f64| {
        let flux = by_sector(&case.of(material, month, from, to));
        flux[WSW] + flux[W] + flux[WNW]
    };
    let (december, tile) =
        (west("standard", DECEMBER, 0.0, 11.0), west("tile", DECEMBER, 0.0, 11.0));
    let june = west("standard", JUNE, 0.0, 11.0);
    assert!(tile > 0.0);
    // The cells send back 4 % of what passes the glass twice; the tile 25 % of everything.
    let bound = 1.5 * 0.04 / 0.25 * tile;
    assert!(december < bound, "{december:.0} W of at most {bound:.0} W");
    assert!(december < 0.005 * june, "{december:.0} W in December, {june:.0} W in June");
}

/// Over how many sectors of 5 degrees the flux spreads: exp of the entropy.
fn spread(photons: &[&Photon]) -> f64 {
    let mut bins = [0.0; 72];
    for p in photons {
        bins[(flight_azimuth_deg(p) / 5.0) as usize % 72] += f64::from(p.flux_w);
    }
    let total: f64 = bins.iter().sum();
    let entropy: f64 =
        bins.iter().filter(|b| **b > 0.0).map(|b| -b / total * (b / total).ln()).sum();
    entropy.exp()
}

#[test]
fn satinated_spreads_wider_than_standard_and_tile_wider_still() {
    let case = case();
    for (from, to) in [(7.0, 7.3), (7.5, 7.8), (8.0, 8.3), (8.5, 8.8), (18.0, 18.3), (18.5, 18.8)] {
        let [standard, satinated, tile] = ["standard", "satinated", "tile"].map(|m| {
            let photons = case.of(m, JUNE, from, to);
            assert!(photons.len() > 60, "{m} {from} h: {}", photons.len());
            spread(&photons)
        });
        assert!(
            satinated > 1.3 * standard && tile > 1.3 * satinated,
            "{from} h: standard {standard:.1}, satinated {satinated:.1}, tile {tile:.1} sectors"
        );
    }
}

/// More than 40 degrees from the mirrored sun only the dark cells are left.
#[test]
fn outside_the_lobes_the_dark_module_sends_less_than_the_tile() {
    let case = case();
    let outside = |photons: &[&Photon]| {
        let cos = libm::cos(40_f64.to_radians());
        flux_w(photons.iter().filter(|p| {
            let flight = -p.direction.as_dvec3();
            flight.dot(mirrored(case, p)) < cos
        }))
    };
    let (mut dark, mut bright) = (0.0, 0.0);
    for month in [JUNE, DECEMBER] {
        for hour in 6..20 {
            let (from, to) = (f64::from(hour), f64::from(hour + 1));
            let tile = case.of("tile", month, from, to);
            if tile.len() < 300 {
                continue;
            }
            let (a, b) = (outside(&case.of("standard", month, from, to)), outside(&tile));
            assert!(a < 0.6 * b, "month {month}, {hour} h: {a:.0} W, the tile {b:.0} W");
            dark += a;
            bright += b;
        }
    }
    let ratio = dark / bright;
    // 0.04 / 0.25 times twice the glass's transmittance (at most 0.96), less on slanted ways.
    assert!((0.05..0.2).contains(&ratio), "{ratio:.3}");
}

/// Each photon, looked at from where it landed: on a surface that isn't PV, on the side that it
/// came from, and with a free way back to the PV surface that it names. So none lies behind a
/// wall or inside a closed building.
#[test]
fn photons_lie_on_surfaces_that_their_pv_sees() {
    let case = case();
    let site = &case.site;
    for (material, photons) in &case.photons {
        let stride = photons.len() / 5000;
        let mut tested = 0;
        for p in photons.iter().step_by(stride).take(5000) {
            tested += 1;
            let told = || format!("{material}: {p:?}");
            assert!(p.normal.dot(p.direction) > 0.0, "{}: lit from behind", told());
            assert!((p.normal.length() - 1.0).abs() < 1e-5, "{}", told());

            let above = p.position + p.direction * 0.02;
            let hit = site.bvh.closest(above, -p.direction, 0.0, 0.03);
            let hit = hit.unwrap_or_else(|| panic!("{}: no surface", told()));
            assert!((hit.distance_m - 0.02).abs() < 1e-3, "{}: {hit:?}", told());
            assert_eq!(site.face_of(hit.triangle).pv, None, "{}: on PV", told());

            // Where the way back meets the plane of its PV, in f64.
            let pv = &site.pv[usize::from(p.surface)];
            let (at, back) = (p.position.as_dvec3(), p.direction.as_dvec3());
            let slope = pv.normal.dot(back);
            assert!(slope < 0.0, "{}: comes from the back of the PV", told());
            let corners: Vec<DVec3> = pv
                .triangles
                .iter()
                .flat_map(|&t| site.triangles[t as usize].corners.map(Vec3::as_dvec3))
                .collect();
            let way_m = pv.normal.dot(corners[0] - at) / slope;
            // It starts a millimetre above the plane: along a slanted way, a little farther off.
            let slack_m = 1e-3 + 2e-3 / -slope;
            assert!(way_m > 0.0 && way_m < case.settings.max_path_m + slack_m, "{}", told());
            let start = at + back * way_m;
            let low = corners.iter().copied().fold(DVec3::INFINITY, DVec3::min) - slack_m;
            let high = corners.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max) + slack_m;
            assert!(start.cmpge(low).all() && start.cmple(high).all(), "{}: {start}", told());
            let free_m = (way_m - slack_m) as f32;
            assert!(!site.bvh.occluded(p.position, p.direction, 2e-3, free_m), "{}", told());
        }
        assert_eq!(tested, 5000, "{material}");
    }
}
