//! Spill, build, search: each held against a slow twin that knows no pages.

mod caustics;
mod killed;
mod spills;
mod timesteps;

use std::path::{Path, PathBuf};
use std::time::Duration;

use glam::Vec3;

use super::build::{Size, build_sized};
use super::query::SAME_SIDE;
use super::{
    About, Access, Error, Neighbours, OpenOptions, Query, Spill, SpillSummary, Store, join, verify,
};
use crate::base::{
    Aabb, FaultKind, Photon, PhotonSink, Provenance, Purpose, Silent, SpectralBasis, Stream, Tally,
};

const BOUNDS: Aabb = Aabb { min: Vec3::new(-50.0, -40.0, 0.0), max: Vec3::new(50.0, 60.0, 30.0) };
const PLAIN: Size = Size {
    page_photons: 8192,
    batch_photons: 1 << 20,
    buffer_bytes: 1 << 16,
    checkpoint_every: Duration::from_secs(10),
};

fn about(timesteps: u32) -> About {
    About {
        provenance: Provenance { program: Provenance::PROGRAM.to_owned(), ..Provenance::default() },
        timesteps,
        surfaces: vec!["west".to_owned(), "south".to_owned()],
        basis: SpectralBasis::Broadband,
        tally: Tally::default(),
    }
}

#[derive(Clone, Copy, Debug)]
enum Shape {
    Cloud,
    Clusters,
    Point,
    Spot,
    Planes,
}

const SHAPES: [Shape; 5] =
    [Shape::Cloud, Shape::Clusters, Shape::Point, Shape::Spot, Shape::Planes];

/// Photons whose timestep is their number, so that each is known again in the store.
fn photons(shape: Shape, count: u32) -> Vec<Photon> {
    let mut random = Stream::new(7, Purpose::Survey, shape as u64);
    let mut uniform = || random.uniform() as f32;
    (0..count)
        .map(|i| {
            let anywhere = Vec3::new(uniform(), uniform(), uniform());
            let mut normal = (Vec3::new(uniform(), uniform(), uniform()) - 0.5).normalize();
            let position = match shape {
                Shape::Cloud => BOUNDS.min + BOUNDS.size() * anywhere,
                Shape::Clusters => {
                    let near = 0.001 * 10f32.powi(i as i32 % 5);
                    Vec3::new((i % 7) as f32, 3.0, 5.0) + near * anywhere
                }
                Shape::Point => Vec3::new(3.0, 4.0, 5.0),
                Shape::Spot => Vec3::new(3.0, 4.0, 5.0) + 3e-5 * anywhere,
                Shape::Planes => {
                    let p = BOUNDS.min + BOUNDS.size() * anywhere;
                    normal = if i % 3 == 0 { Vec3::Z } else { Vec3::NEG_X };
                    if i % 3 == 0 { p.with_z(0.25 * p.x) } else { p.with_x(12.5) }
                }
            };
            let direction = (normal + 0.8 * (anywhere - 0.5)).normalize();
            let flux_w = 1.0 + 3.0 * uniform();
            let surface = (i % 2) as u16;
            Photon { position, normal, direction, flux_w, timestep: i, surface }
        })
        .collect()
}

struct Built {
    dir: tempfile::TempDir,
}

impl Built {
    fn new(photons: &[Photon], size: Size) -> Self {
        let dir = tempfile::tempdir().expect("a folder");
        let built = Self { dir };
        let mut spill =
            Spill::create(&built.spill(), BOUNDS, photons.len() as u64, 1 << 24).expect("creates");
        for batch in photons.chunks(777) {
            spill.accept(batch).expect("accepts");
        }
        assert_eq!(spill.finish().expect("finishes").photons, photons.len() as u64);
        let about = about(photons.len().max(1) as u32);
        build_sized(&built.spill(), &built.store(), &about, size, &Silent).expect("builds");
        built
    }

    fn spill(&self) -> PathBuf {
        self.dir.path().join("spill")
    }

    fn store(&self) -> PathBuf {
        self.dir.path().join("photons.gmp")
    }

    fn bytes(&self) -> Vec<u8> {
        std::fs::read(self.store()).expect("reads")
    }

    fn open(&self, cache_bytes: u64, access: Access) -> Store {
        Store::open(&self.store(), &OpenOptions { cache_bytes, access }).expect("opens")
    }
}

fn all(store: &Store) -> Vec<(u64, Photon)> {
    let mut out = Vec::new();
    store.scan(|i, p| out.push((i, *p))).expect("scans");
    out
}

#[test]
fn every_photon_comes_back_within_the_stated_error() {
    for shape in SHAPES {
        for page_photons in [1, 100, 8192] {
            let photons = photons(shape, if page_photons == 1 { 700 } else { 20_000 });
            let built = Built::new(&photons, Size { page_photons, ..PLAIN });
            let store = built.open(1 << 20, Access::Mapped);
            let found = all(&store);
            assert_eq!(found.len(), photons.len());
            let mut seen = vec![false; photons.len()];
            for (number, (index, back)) in found.iter().enumerate() {
                assert_eq!(*index, number as u64);
                let i = back.timestep as usize;
                assert!(!std::mem::replace(&mut seen[i], true), "{shape:?}: photon {i} twice");
                let p = &photons[i];
                let page = store.pages.partition_point(|e| e.first_photon <= *index) - 1;
                let entry = &store.pages[page];
                let size = Vec3::from(entry.max) - Vec3::from(entry.min);
                let step = size.max_element() / 65535.0;
                let error = (p.position - back.position).abs().max_element();
                assert!(error <= 0.5 * step + 8e-6, "{shape:?}: {error} m, step {step}");
                assert!((p.normal - back.normal).length() < 7e-5);
                assert!((p.direction - back.direction).length() < 7e-5);
                assert!((p.flux_w / back.flux_w - 1.0).abs() <= 1.0 / 4095.0);
                assert_eq!(p.surface, back.surface);
            }
            let info = store.info();
            let flux_w: f64 = photons.iter().map(|p| f64::from(p.flux_w)).sum();
            assert!((info.flux_w / flux_w - 1.0).abs() < 1e-12);
            assert_eq!(info.photons, photons.len() as u64);
            assert_eq!(verify(&built.store()).expect("verifies"), Vec::<String>::new());
            assert_eq!(store.levels().iter().map(|l| l.photons).sum::<u64>(), info.photons);
            let steps = store.per_timestep().expect("reads");
            assert!(steps.iter().all(|s| s.photons == 1));
        }
    }
}

#[test]
fn a_page_of_normal_size_moves_photons_by_less_than_a_tenth_of_a_millimetre() {
    // 160 photons on a square metre, as the case study has them at 6 million: pages of 6.25 m.
    let mut photons = photons(Shape::Cloud, 100_000);
    for p in &mut photons {
        p.position = (BOUNDS.min + (p.position - BOUNDS.min) * 0.25).with_z(7.0);
    }
    let built = Built::new(&photons, PLAIN);
    let store = built.open(1 << 20, Access::Mapped);
    let (mut place, mut direction, mut flux) = (0.0f64, 0.0f64, 0.0f64);
    store
        .scan(|_, back| {
            let p = &photons[back.timestep as usize];
            place = place.max((p.position.as_dvec3() - back.position.as_dvec3()).length());
            let angle = (p.direction.as_dvec3() - back.direction.as_dvec3()).length();
            direction = direction.max(angle);
            flux = flux.max((f64::from(back.flux_w) / f64::from(p.flux_w) - 1.0).abs());
        })
        .expect("scans");
    println!("{place} m, {direction} radians, {flux} of the flux at most");
    assert!(place < 1e-4 && place > 1e-6, "{place} m");
    assert!(direction < 7e-5 && direction > 1e-6, "{direction} radians");
    assert!(flux <= 1.0 / 4096.0 && flux > 1e-5, "{flux} of the flux");
}

#[test]
fn the_store_depends_on_the_photons_alone() {
    for shape in SHAPES {
        for page_photons in [30, 400] {
            let mut photons = photons(shape, 2000);
            // Doubles too: nothing tells them apart.
            photons.extend_from_within(..100);
            let size = Size { page_photons, ..PLAIN };
            let expected = Built::new(&photons, size).bytes();
            photons.reverse();
            photons.rotate_left(234);
            for (batch_photons, buffer_bytes) in [(40, 5000), (500, 50_000)] {
                let size = Size { page_photons, batch_photons, buffer_bytes, ..PLAIN };
                let built = Built::new(&photons, size);
                assert!(built.bytes() == expected, "{shape:?} {size:?}");
                let spill = std::fs::read_dir(built.spill()).expect("lists");
                let folders = spill.filter(|e| e.as_ref().is_ok_and(|e| e.path().is_dir())).count();
                assert_eq!(folders, 0, "a folder of a split partition is left");
            }
        }
    }
}

/// What a search must find: positions by distance, then by index, cut, and in order of index.
fn linear(all: &[(u64, Photon)], query: &Query) -> Vec<(u64, f32)> {
    let mut near: Vec<(f32, u64)> = all
        .iter()
        .filter(|(_, p)| query.normal == Vec3::ZERO || p.normal.dot(query.normal) >= SAME_SIDE)
        .map(|(i, p)| {
            let d = p.position - query.point;
            (d.x * d.x + d.y * d.y + d.z * d.z, *i)
        })
        .filter(|(d, _)| *d <= query.max_radius_m * query.max_radius_m)
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.truncate(query.count);
    let mut out: Vec<(u64, f32)> = near.into_iter().map(|(d, i)| (i, d)).collect();
    out.sort_by_key(|(i, _)| *i);
    out
}

fn check_query(store: &Store, all: &[(u64, Photon)], query: &Query, found: &mut Neighbours) {
    store.nearest(query, found).expect("searches");
    let expected = linear(all, query);
    let got: Vec<(u64, f32)> = found.items().iter().map(|n| (n.index, n.distance2_m2)).collect();
    assert!(got == expected, "{query:?}: {} found, {} expected", got.len(), expected.len());
    assert_eq!(found.full(), query.count > 0 && expected.len() == query.count);
    let far =
        expected.iter().enumerate().max_by(|a, b| a.1.1.total_cmp(&b.1.1).then(a.1.0.cmp(&b.1.0)));
    assert_eq!(found.farthest(), far.map(|(at, _)| at));
    for n in found.items() {
        let p = &all[n.index as usize].1;
        assert_eq!((n.flux_w, n.timestep, n.surface), (p.flux_w, p.timestep, p.surface));
        assert!((n.cos - p.normal.dot(p.direction)).abs() < 1e-6);
    }
}

#[test]
fn the_nearest_are_those_of_a_linear_search() {
    for shape in SHAPES {
        for page_photons in [20, 300, 8192] {
            let photons = photons(shape, 5000);
            let built = Built::new(&photons, Size { page_photons, ..PLAIN });
            let store = built.open(1 << 22, Access::Mapped);
            let all = all(&store);
            let mut random = Stream::new(8, Purpose::Survey, 0);
            let mut found = Neighbours::default();
            let mut point = photons[0].position;
            for round in 0..60 {
                let mut step =
                    || Vec3::from_array(std::array::from_fn(|_| random.uniform() as f32 - 0.5));
                // A walk of small steps with leaps between, so that guesses are good and bad.
                point += step() * if round % 10 == 9 { 60.0 } else { 0.3 };
                if round % 7 == 0 {
                    point = photons[round * 31].position;
                }
                let normal = match round % 3 {
                    0 => Vec3::ZERO,
                    1 => Vec3::Z,
                    _ => step().normalize(),
                };
                let count = [1, 7, 50, 400, 4999, 6000, 0][round % 7];
                let max_radius_m = [f32::INFINITY, 3.0, 20.0, 0.0, 1e-5][round % 5];
                let query = Query { point, normal, count, max_radius_m };
                check_query(&store, &all, &query, &mut found);
            }
        }
    }
}

#[test]
fn twenty_thousand_photons_in_one_point() {
    let photons = photons(Shape::Point, 20_000);
    let built = Built::new(&photons, PLAIN);
    let store = built.open(1 << 20, Access::Mapped);
    assert_eq!(store.pages.len(), 3);
    let all = all(&store);
    let mut found = Neighbours::default();
    for point in [photons[0].position, Vec3::ZERO, photons[0].position + 1e-3] {
        for count in [1, 8192, 9000, 19_999, 20_000, 20_001] {
            let query = Query { point, normal: Vec3::ZERO, count, max_radius_m: 100.0 };
            check_query(&store, &all, &query, &mut found);
        }
    }
    assert_eq!(store.max_radius_m(400), 0.05);
}

#[test]
fn boxes_hold_what_a_scan_finds_in_them() {
    for shape in SHAPES {
        let photons = photons(shape, 5000);
        let built = Built::new(&photons, Size { page_photons: 100, ..PLAIN });
        let store = built.open(1 << 20, Access::Pread);
        let all = all(&store);
        let centre = photons[1].position;
        for half in [0.0, 1e-5, 0.4, 20.0, 500.0] {
            let region = Aabb { min: centre - half, max: centre + half * 0.5 };
            let mut got = Vec::new();
            store.in_box(region, |i, p| got.push((i, *p))).expect("reads");
            let expected: Vec<(u64, Photon)> =
                all.iter().filter(|(_, p)| region.contains(p.position)).copied().collect();
            assert!(got == expected, "{shape:?} {half}");
        }
    }
}

#[test]
fn cache_access_and_threads_change_nothing_but_the_statistics() {
    let photons = photons(Shape::Planes, 60_000);
    let built = Built::new(&photons, Size { page_photons: 2000, ..PLAIN });
    let run = |store: &Store, seed: u64| {
        let mut random = Stream::new(seed, Purpose::Survey, 1);
        let mut found = Neighbours::default();
        let mut out = Vec::new();
        for _ in 0..80 {
            let at = (random.uniform() * photons.len() as f64) as usize;
            let query = Query {
                point: photons[at].position + 0.01,
                normal: photons[at].normal,
                count: 90,
                max_radius_m: 9.0,
            };
            store.nearest(&query, &mut found).expect("searches");
            out.extend_from_slice(found.items());
        }
        out
    };
    let expected = run(&built.open(1 << 28, Access::Mapped), 1);
    for cache_bytes in [0, 70_000, 300_000, 1 << 20, 1 << 28] {
        let store = built.open(cache_bytes, Access::Pread);
        assert!(run(&store, 1) == expected, "cache of {cache_bytes} bytes");
        let stats = store.cache_stats();
        assert_eq!(stats.hits == 0, cache_bytes == 0, "{stats:?}");
        // Enough for all pages: each is read once at most. Enough for a few: some had to go.
        let roomy = cache_bytes == 1 << 28;
        assert_eq!(stats.misses <= store.pages.len() as u64, roomy, "{stats:?}");
        assert_eq!(stats.evictions > 0, !roomy && cache_bytes > 0, "{stats:?}");
        std::thread::scope(|scope| {
            let threads: Vec<_> = (0..4).map(|_| scope.spawn(|| run(&store, 1))).collect();
            for thread in threads {
                assert!(thread.join().expect("ends") == expected);
            }
        });
    }
}

#[test]
fn an_empty_store_answers() {
    let built = Built::new(&[], PLAIN);
    let store = built.open(1 << 20, Access::Mapped);
    assert_eq!((store.info().photons, store.info().flux_w, store.info().pages), (0, 0.0, 0));
    let mut found = Neighbours::default();
    let query =
        Query { point: Vec3::ZERO, normal: Vec3::ZERO, count: 5, max_radius_m: f32::INFINITY };
    store.nearest(&query, &mut found).expect("searches");
    assert!(found.items().is_empty() && !found.full() && found.farthest().is_none());
    store.in_box(BOUNDS, |_, _| unreachable!("nothing is in it")).expect("reads");
    assert!(verify(&built.store()).expect("verifies").is_empty());
    assert!(store.levels().is_empty());
}

#[test]
fn the_radius_serves_the_dim_rest_beside_a_hot_spot() {
    // 19 of 20 photons in a spot of a centimetre, the rest over 100 x 100 m.
    let mut all = photons(Shape::Cloud, 200_000);
    for (i, p) in all.iter_mut().enumerate() {
        p.position.z = 0.0;
        if i % 20 != 0 {
            p.position = Vec3::new(1.0, 1.0, 0.0) + 1e-4 * p.position;
        }
    }
    let built = Built::new(&all, PLAIN);
    let store = built.open(1 << 26, Access::Mapped);
    let radius_m = store.max_radius_m(50);
    // Lit are 10,000 m2: 0.05 m2 a photon, 2 sqrt(50 * 0.05 / pi) = 1.78 m; cells follow the outline roughly.
    assert!((1.6..2.0).contains(&radius_m), "{radius_m} m");
    let mut found = Neighbours::default();
    let point = Vec3::new(30.0, 30.0, 0.0);
    let query = Query { point, normal: Vec3::ZERO, count: 50, max_radius_m: radius_m };
    store.nearest(&query, &mut found).expect("searches");
    assert!(found.items().len() >= 8, "{} photons", found.items().len());
}

fn kind<T>(result: Result<T, Error>) -> (FaultKind, String) {
    let error = result.err().expect("must fail");
    (error.kind(), error.to_string())
}

#[test]
fn photons_that_contradict_the_header_are_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let (spill_dir, store) = (dir.path().join("spill"), dir.path().join("photons.gmp"));
    let mut spill = Spill::create(&spill_dir, BOUNDS, 10, 1).expect("creates");
    let photons = photons(Shape::Cloud, 10);
    spill.accept(&photons).expect("accepts");
    let broken = Photon { flux_w: f32::NAN, ..photons[0] };
    assert!(spill.accept(&[broken]).is_err());
    let broken = Photon { position: Vec3::splat(f32::INFINITY), ..photons[0] };
    assert!(spill.accept(&[broken]).is_err());
    spill.finish().expect("finishes");
    let (_, message) = kind(build_sized(&spill_dir, &store, &about(9), PLAIN, &Silent));
    assert!(message.contains("timestep 9"), "{message}");
    assert!(!store.exists() && !dir.path().join("photons.gmp.tmp").exists());

    let bounds = Aabb { min: Vec3::NAN, max: Vec3::ONE };
    assert_eq!(kind(Spill::create(&spill_dir, bounds, 1, 1)).0, FaultKind::Input);
}
