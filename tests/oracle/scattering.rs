//! What leaves one rectangle of PV, at a known incidence: photons of glintmap and of Radiance's
//! `mkpmap` against the integral of the BSDF file.
//!
//! The rectangle stands in a closed box, so that all that it scatters lands. What should land is
//! summed here from the numbers of the file, by a reader of tensor trees and a square of directions
//! of its own: no line of `bsdf` takes part. Two things are asked for: the flux of all
//! photons, with the sun's real disc, and where they fly, in 16 x 16 cells of the outgoing square,
//! with a sun so small that it lies in one incident cell.
//!
//! `mkpmap` passes both, but for one thing that isn't scattering: with its default `-dp 1000` (PDF
//! samples per steradian) the sun's disc gets a single sample, drawn once for each sun and partition
//! of the port before any photon is sent, and the flux of the sun on the port is taken from there:
//! `cos(sample)` instead of `cos(centre)`. The error is up to `tan(incidence)` times the disc's
//! radius, whatever the number of photons and the seed (the seed is set afterwards). The first draws
//! of `erand48` say how large it is for the first sun; with `-dp 1e6` it is gone.

use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_4, PI, TAU};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use glam::DVec3;
use glintmap::base::{Frame, Purpose, Stream, Timeline};
use glintmap::bsdf::{Bsdf, BsdfFile, Fineness, Preset, Side, write};
use glintmap::site::Site;
use glintmap::trace::{Emission, Settings};

use super::photons::{radiance, run};
use crate::physics::trace::{Scene, settings, timeline, trace};
use crate::support;

/// One value of a file: a cube of the tree's coordinates.
struct Leaf {
    corner: [f64; 4],
    edge: f64,
    value: f64,
}

/// A tensor tree as the file has it.
struct FileTree {
    rank: usize,
    leaves: Vec<Leaf>,
    /// Incident cells along each coordinate: those of the finest leaf.
    fine: f64,
}

impl FileTree {
    fn read(text: &str) -> Self {
        let rank = if text.contains("TensorTree3") { 3 } else { 4 };
        let block = text.split("Reflection Back").nth(1).expect("the block");
        let data = block.split("<ScatteringData>").nth(1).expect("data");
        let data = data.split("</ScatteringData>").next().expect("its end");
        let spaced = data.replace('{', " { ").replace('}', " } ").replace(',', " ");
        let mut tree = Self { rank, leaves: Vec::new(), fine: 1.0 };
        let mut words = spaced.split_whitespace().peekable();
        assert_eq!(words.next(), Some("{"));
        tree.node(&mut words, [0.0; 4], 1.0);
        let finest = tree.leaves.iter().fold(1.0_f64, |m, l| m.min(l.edge));
        tree.fine = 1.0 / finest;
        tree
    }

    /// What follows an opening brace: a brace for each half of each coordinate (the first
    /// coordinate is the number's lowest bit), or a grid of values, the first coordinate slowest.
    fn node<'a>(
        &mut self,
        words: &mut std::iter::Peekable<impl Iterator<Item = &'a str>>,
        corner: [f64; 4],
        edge: f64,
    ) {
        if words.peek() == Some(&"{") {
            for part in 0..1_usize << self.rank {
                assert_eq!(words.next(), Some("{"));
                let shift = |i: usize| if part >> i & 1 == 1 { 0.5 * edge } else { 0.0 };
                let at = std::array::from_fn(|i| corner[i] + shift(i));
                self.node(words, at, 0.5 * edge);
            }
            assert_eq!(words.next(), Some("}"));
            return;
        }
        let values: Vec<f64> = words
            .by_ref()
            .take_while(|w| *w != "}")
            .map(|w| w.parse().expect("a number"))
            .collect();
        let side = (1..=256).find(|s: &usize| s.pow(self.rank as u32) == values.len());
        let side = side.expect("a cube of values");
        let small = edge / side as f64;
        for (k, value) in values.into_iter().enumerate() {
            let place = |i: usize| {
                if i >= self.rank { 0 } else { k / side.pow((self.rank - 1 - i) as u32) % side }
            };
            let at = std::array::from_fn(|i| corner[i] + small * place(i) as f64);
            self.leaves.push(Leaf { corner: at, edge: small, value });
        }
    }

    /// The finest incident cell of light from a local direction.
    fn incident(&self, from: DVec3) -> [u32; 2] {
        let at = if self.rank == 3 {
            [0.5 - 1e-6 - 0.5 * from.x.hypot(from.y), 0.0]
        } else {
            square([-from.x, -from.y])
        };
        at.map(|x| (x * self.fine) as u32)
    }

    /// Flux into each cell of the outgoing square, as a share of the light from an incident cell.
    fn slice(&self, incident: [u32; 2]) -> Vec<f64> {
        let mut out = vec![0.0; EDGE * EDGE];
        let free = self.rank - 2;
        for leaf in &self.leaves {
            let holds = (0..free).all(|i| {
                let low = leaf.corner[i] * self.fine;
                (low..low + leaf.edge * self.fine).contains(&f64::from(incident[i]))
            });
            if !holds {
                continue;
            }
            let span = |i: usize| {
                let first = (leaf.corner[free + i] * EDGE as f64) as usize;
                first..first + ((leaf.edge * EDGE as f64) as usize).max(1)
            };
            let part = (1.0 / EDGE as f64).min(leaf.edge).powi(2);
            for row in span(1) {
                for column in span(0) {
                    out[row * EDGE + column] += PI * part * leaf.value;
                }
            }
        }
        out
    }

    /// The outgoing cell of a local direction.
    fn outgoing(&self, from: DVec3, to: DVec3) -> usize {
        let turn =
            if self.rank == 3 { DVec3::new(-from.x, -from.y, 0.0).normalize() } else { DVec3::X };
        let [x, y] = square([to.x * turn.x + to.y * turn.y, to.y * turn.x - to.x * turn.y]);
        let place = |x: f64| ((x * EDGE as f64) as usize).min(EDGE - 1);
        place(y) * EDGE + place(x)
    }

    /// Watts into each cell for 1 W/m2 facing the sun, on 1 m2, over the sun's disc.
    fn expected(&self, sun: DVec3, diameter_deg: f64) -> Vec<f64> {
        const RINGS: usize = 40;
        const SECTORS: usize = 48;
        let frame = Frame::around(sun);
        let mut cosines: HashMap<[u32; 2], f64> = HashMap::new();
        for i in 0..RINGS * SECTORS {
            let share = ((i / SECTORS) as f64 + 0.5) / RINGS as f64;
            let off = (0.5 * diameter_deg).to_radians() * share.sqrt();
            let (sin, cos) = (TAU * ((i % SECTORS) as f64 + 0.5) / SECTORS as f64).sin_cos();
            let from = (sun + (frame.x * cos + frame.y * sin) * off.tan()).normalize();
            *cosines.entry(self.incident(from)).or_default() += from.z;
        }
        let mut out = vec![0.0; EDGE * EDGE];
        for (incident, cos) in cosines {
            let slice = self.slice(incident);
            for (sum, flux) in out.iter_mut().zip(slice) {
                *sum += flux * cos / (RINGS * SECTORS) as f64;
            }
        }
        out
    }
}

/// Cells along each edge of the outgoing square.
const EDGE: usize = 16;

/// Point of the square `[0, 1]^2` at a point of the unit disc (Shirley and Chiu 1997).
fn square([x, y]: [f64; 2]) -> [f64; 2] {
    let radius = x.hypot(y);
    // In eighths of a turn from the middle of the quadrant about +x, +y, -x or -y.
    let turn = y.atan2(x).rem_euclid(TAU);
    let quadrant = ((turn + FRAC_PI_4) / (2.0 * FRAC_PI_4)).floor() % 4.0;
    let eighths = (turn + FRAC_PI_4).rem_euclid(2.0 * FRAC_PI_4) / FRAC_PI_4 - 1.0;
    let [a, b] = match quadrant as u32 {
        0 => [radius, eighths * radius],
        1 => [-eighths * radius, radius],
        2 => [-radius, -eighths * radius],
        _ => [eighths * radius, -radius],
    };
    [0.5 * (a + 1.0), 0.5 * (b + 1.0)].map(|v| v.clamp(0.0, 1.0 - 1e-12))
}

/// Edge of the PV, m: so small in its box that where a photon lands tells its direction to a
/// thousandth of a radian.
const PV_M: f64 = 0.02;
const BOX_M: f64 = 10.0;
const IRRADIANCE: f64 = 800.0;

/// The rectangle: tilted, so that a file's up and right have a meaning.
fn frame() -> Frame {
    Frame::around(DVec3::new(0.2, -0.35, 0.9).normalize())
}

fn corners() -> [DVec3; 4] {
    let f = frame();
    [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(x, y)| (f.x * x + f.y * y) * PV_M)
}

/// The local direction to the sun at an incidence.
fn from(incidence_deg: f64) -> DVec3 {
    let theta = incidence_deg.to_radians();
    // Where `mkpmap` errs a lot: its one sample lies on the disc's upper side.
    let (sin, cos) = 2.7_f64.sin_cos();
    DVec3::new(theta.sin() * cos, theta.sin() * sin, theta.cos())
}

/// The sides of the box, one of them with a window for the sun, of the given half width.
fn walls(sun: DVec3, window_m: f64) -> Vec<[DVec3; 4]> {
    let (s, mut out) = (sun.to_array(), Vec::new());
    let facing = (0..3).max_by(|&a, &b| s[a].abs().total_cmp(&s[b].abs())).expect("three");
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let quad = |[x0, x1]: [f64; 2], [y0, y1]: [f64; 2]| {
                [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| {
                    let mut at = [0.0; 3];
                    (at[axis], at[u], at[v]) = (sign * BOX_M, x, y);
                    DVec3::from_array(at)
                })
            };
            let all = [-BOX_M, BOX_M];
            if axis != facing || sign * s[axis] < 0.0 || window_m == 0.0 {
                out.push(quad(all, all));
                continue;
            }
            let middle = |k: usize| s[k] / s[axis].abs() * BOX_M;
            let span = |k: usize| [middle(k) - window_m, middle(k) + window_m];
            let ([x0, x1], [y0, y1]) = (span(u), span(v));
            assert!(x0 > -BOX_M && x1 < BOX_M && y0 > -BOX_M && y1 < BOX_M, "{sun}");
            out.push(quad([-BOX_M, x0], all));
            out.push(quad([x1, BOX_M], all));
            out.push(quad([x0, x1], [-BOX_M, y0]));
            out.push(quad([x0, x1], [y1, BOX_M]));
        }
    }
    out
}

fn site() -> Site {
    let narrow = |quad: [DVec3; 4]| quad.map(|c| c.as_vec3().to_array());
    let mut scene = Scene::new().pv(narrow(corners()), false);
    for wall in walls(DVec3::Z, 0.0) {
        scene = scene.quad(narrow(wall));
    }
    scene.site()
}

/// Local directions of photons, and the watts of each.
struct Landed {
    to: Vec<DVec3>,
    each_w: f64,
}

impl Landed {
    fn flux_w(&self) -> f64 {
        self.each_w * self.to.len() as f64
    }

    /// Chi-square of the photons by cells, and its degrees of freedom: the shares of the flux.
    fn chi2(&self, tree: &FileTree, from: DVec3, expected: &[f64]) -> (f64, f64) {
        let mut found = vec![0.0; EDGE * EDGE];
        self.to.iter().for_each(|&to| found[tree.outgoing(from, to)] += 1.0);
        let per_w = self.to.len() as f64 / expected.iter().sum::<f64>();
        let (mut chi2, mut cells) = (0.0, -1.0);
        let (mut rest, mut rest_found) = (0.0, 0.0);
        for (found, flux) in found.into_iter().zip(expected) {
            let wanted = flux * per_w;
            if wanted < 10.0 {
                rest += wanted;
                rest_found += found;
            } else {
                chi2 += (found - wanted).powi(2) / wanted;
                cells += 1.0;
            }
        }
        if rest > 10.0 {
            chi2 += (rest_found - rest).powi(2) / rest;
            cells += 1.0;
        } else {
            assert!(rest_found < 40.0, "{rest_found} photons where {rest} belong");
        }
        (chi2, cells)
    }
}

/// What we store, and the standard error of its flux as a share: photons are shared out evenly, so
/// that only their survival is left to chance.
fn ours(site: &Site, bsdf: &Bsdf, sun: DVec3, diameter_deg: f64) -> (Landed, f64) {
    let suns = timeline(&[(frame().world_from_local(sun), IRRADIANCE)]);
    let timeline = Timeline { sun_diameter_deg: diameter_deg, ..suns };
    let settings = Settings { sun_visibility: false, ..settings(60_000) };
    let emission = Emission { site, timeline: &timeline, bsdfs: vec![bsdf], settings };
    let (plan, photons, _) = trace(&emission);
    let local = |d: glam::Vec3| frame().local_from_world(-d.as_dvec3());
    let stored = photons.len() as f64;
    let error = ((1.0 - stored / plan.emitted as f64) / stored).sqrt();
    let to = photons.iter().map(|p| local(p.direction)).collect();
    (Landed { to, each_w: plan.photon_w }, error)
}

/// A tree of rank 3 as Radiance gets it from us, and one of rank 4 without any symmetry.
fn files() -> [(&'static str, String); 2] {
    let preset = Bsdf::from_model(&Preset::named("standard").expect("known").model());
    let fine = Fineness { resolution: 6, prune: 80.0 };
    let standard = write(&preset.expect("a model"), "standard", fine).expect("written").text;
    let mut random = Stream::new(3, Purpose::Survey, 0);
    let mut numbers = String::from("{");
    for child in 0..16 {
        numbers.push('{');
        for _ in 0..if child == 5 { 1 } else { 256 } {
            write!(numbers, " {:.4}", 0.05 + 0.2 * random.uniform()).expect("text");
        }
        numbers.push_str("}\n");
    }
    numbers.push('}');
    let uneven = standard
        .split("<ScatteringData>")
        .next()
        .map(|head| {
            format!("{}<ScatteringData>{numbers}", head.replace("TensorTree3", "TensorTree4"))
        })
        .and_then(|text| {
            Some(text + "</ScatteringData>" + standard.split("</ScatteringData>").nth(1)?)
        });
    [("rank 3", standard), ("rank 4", uneven.expect("a file"))]
}

const INCIDENCES_DEG: [f64; 7] = [2.0, 30.0, 60.0, 70.0, 75.0, 80.0, 85.0];
/// A sun that lies in one incident cell, and the real one.
const POINT_DEG: f64 = 0.01;
const DISC_DEG: f64 = 0.533;

/// One in 30,000 lies above by chance (normal approximation).
fn limit(degrees: f64) -> f64 {
    degrees + 4.0 * (2.0 * degrees).sqrt()
}

fn check(name: &str, text: &str) {
    let tree = FileTree::read(text);
    let file = BsdfFile::parse(text, name).expect("a good file");
    let bsdf = Bsdf::Measured(file.reflection(Side::Front, None).expect("has it"));
    let site = site();
    for incidence_deg in INCIDENCES_DEG {
        let sun = from(incidence_deg);
        let falls_w = IRRADIANCE * PV_M * PV_M;
        let sum = |diameter_deg| tree.expected(sun, diameter_deg).iter().sum::<f64>() * falls_w;
        let (whole, error) = ours(&site, &bsdf, sun, DISC_DEG);
        let ratio = whole.flux_w() / sum(DISC_DEG);
        let (point, _) = ours(&site, &bsdf, sun, POINT_DEG);
        let (chi2, degrees) = point.chi2(&tree, sun, &tree.expected(sun, POINT_DEG));
        println!(
            "{name}, {incidence_deg} degrees: flux {ratio:.4} of the file's ({error:.4}), chi2 \
             {chi2:.0} over {degrees}"
        );
        // Beyond chance: what the disc's 1,920 points miss of a border of cells.
        assert!((ratio - 1.0).abs() < 4.0 * error + 5e-4, "{name}, {incidence_deg}: {ratio}");
        assert!(
            degrees > 15.0 && chi2 < limit(degrees),
            "{name}, {incidence_deg}: {chi2} over {degrees}"
        );
    }
}

#[test]
fn photons_carry_what_a_tensor_tree_holds() {
    for (name, text) in files() {
        check(name, &text);
    }
}

#[test]
fn photons_carry_what_a_measured_tree_holds() {
    let Some(path) = support::data("bsdf/tensortree_rank3_fabric.xml") else { return };
    check("fabric", &fs::read_to_string(path).expect("text"));
}

/// `erand48` (POSIX): the generator that `mkpmap` draws from.
struct Erand48(u64);

impl Erand48 {
    /// The state of `mkpmap` for directions to the sun, before anything was drawn.
    fn emission() -> Self {
        Self(33997 | 59693 << 16 | 11003 << 32)
    }

    fn next(&mut self) -> f64 {
        self.0 = (self.0.wrapping_mul(0x5_DEEC_E66D) + 0xB) & ((1 << 48) - 1);
        self.0 as f64 / (1_u64 << 48) as f64
    }
}

/// The cosine of the one direction that `mkpmap` takes the first sun's flux from, as a share of
/// the cosine of the disc's centre.
fn first_sample(sun: DVec3) -> f64 {
    let (mut random, normal) = (Erand48::emission(), frame().z);
    let u = DVec3::X.cross(sun).normalize();
    let v = sun.cross(u);
    let below = random.next() * (1.0 - (0.5 * DISC_DEG).to_radians().cos());
    let (sin, cos) = (TAU * random.next()).sin_cos();
    let sample = (u * cos + v * sin) * (below * (2.0 - below)).sqrt() + sun * (1.0 - below);
    sample.dot(normal) / sun.dot(normal)
}

/// What `mkpmap` stores in the same box, with a window for the sun.
fn theirs(radiance: &Path, folder: &Path, sun: DVec3, diameter_deg: f64, samples: &str) -> Landed {
    let sun = frame().world_from_local(sun);
    let mut scene = String::from("void plastic grey 0 0 5 .5 .5 .5 0 0\n");
    let radiance_w = IRRADIANCE / (TAU * (1.0 - (0.5 * diameter_deg).to_radians().cos()));
    scene.push_str("void BSDF pv 6 0 pv.xml 0 0 1 . 0 0\n");
    writeln!(scene, "void light l 0 0 3 {radiance_w} {radiance_w} {radiance_w}").expect("text");
    writeln!(scene, "l source s 0 0 4 {} {} {} {diameter_deg}", sun.x, sun.y, sun.z).expect("text");
    let walls = walls(sun, 0.2).into_iter().map(|wall| ("grey", wall));
    for (i, (modifier, quad)) in walls.chain([("pv", corners())]).enumerate() {
        write!(scene, "{modifier} polygon p{i} 0 0 12").expect("text");
        quad.iter().for_each(|c| write!(scene, " {} {} {}", c.x, c.y, c.z).expect("text"));
        scene.push('\n');
    }
    fs::write(folder.join("scene.rad"), scene).expect("written");
    let octree = run(radiance, folder, &["oconv", "scene.rad"]);
    fs::write(folder.join("scene.oct"), octree).expect("written");
    let command =
        format!("mkpmap -n 1 -fo+ -apC map.pm 400000 -apo- pv -lr 1 -t 0 {samples} scene.oct");
    run(radiance, folder, &command.split_whitespace().collect::<Vec<_>>());
    let listed = run(radiance, folder, &["pmapdump", "-a", "-n", "1000k", "-f", "map.pm"]);
    let (mut to, mut flux) = (Vec::new(), 0.0);
    for line in String::from_utf8(listed).expect("text").lines() {
        let words: Vec<f64> = line.split_whitespace().filter_map(|w| w.parse().ok()).collect();
        let [x, y, z, red, green, blue] = words[..] else { panic!("{line}") };
        to.push(frame().local_from_world(DVec3::new(x, y, z).normalize()));
        // The three channels differ by their rounding to 8 bits alone.
        flux += (red + green + blue) / 3.0;
    }
    Landed { each_w: flux / to.len() as f64, to }
}

#[test]
fn mkpmap_scatters_what_a_tree_holds_and_takes_the_suns_flux_from_one_sample() {
    let Some(radiance) = radiance() else { return };
    for (name, text) in files() {
        let tree = FileTree::read(&text);
        let keep = tempfile::tempdir().expect("a temporary folder");
        fs::write(keep.path().join("pv.xml"), &text).expect("written");
        for incidence_deg in [60.0, 80.0, 85.0] {
            let sun = from(incidence_deg);
            let ratio = |diameter_deg, samples| {
                let landed = theirs(&radiance, keep.path(), sun, diameter_deg, samples);
                let whole: f64 = tree.expected(sun, diameter_deg).iter().sum();
                (landed.flux_w() / (whole * IRRADIANCE * PV_M * PV_M), landed)
            };
            let (_, point) = ratio(POINT_DEG, "");
            let (chi2, degrees) = point.chi2(&tree, sun, &tree.expected(sun, POINT_DEG));
            let (many, _) = ratio(DISC_DEG, "-dp 1e6");
            let (one, _) = ratio(DISC_DEG, "");
            let foreseen = first_sample(frame().world_from_local(sun));
            println!(
                "{name}, {incidence_deg} degrees: mkpmap {many:.4} of the file's flux, by default \
                 {one:.4}, foreseen {foreseen:.4}; chi2 {chi2:.0} over {degrees}"
            );
            // 400,000 photons, 4 sigma of their number: 0.6 %; half a step of 8 bits: 0.2 %.
            const NOISE: f64 = 0.008;
            assert!((many - 1.0).abs() < NOISE, "{name}, {incidence_deg}: {many}");
            assert!((one / foreseen - 1.0).abs() < NOISE, "{name}, {incidence_deg}: {one}");
            assert!(degrees > 15.0 && chi2 < limit(degrees), "{chi2} over {degrees} cells");
        }
    }
}
