//! Annual maps and time series from a store of photons, against sums over all of them.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::Path;
use std::sync::Mutex;

use glam::{Vec3, vec3};
use glintmap::base::Irradiance;
use glintmap::base::{
    Aabb, Photon, PhotonSink, Provenance, Purpose, SeriesEntry, Silent, SinkError, SpectralBasis,
    Stream, Tally, TileRect, TileSink,
};
use glintmap::pages::{About, Access, OpenOptions, Spill, Store, build};
use glintmap::render::{Annual, Estimator, Fused, Gather, Hit, HitKind, HitMap, annual, series};

use super::pool;

/// A store of photons on the plane z = 0, as `trace` and `run` would make it.
pub fn store_of(folder: &Path, photons: &[Photon], timesteps: u32) -> Store {
    let bounds = Aabb { min: vec3(-6.0, -6.0, -1.0), max: vec3(6.0, 6.0, 1.0) };
    store_within(folder, photons, timesteps, bounds)
}

/// The same for photons anywhere.
pub fn store_within(folder: &Path, photons: &[Photon], timesteps: u32, bounds: Aabb) -> Store {
    let (spill, path) = (folder.join("spill"), folder.join("photons.gmp"));
    let mut sink = Spill::create(&spill, bounds, photons.len() as u64, 64 << 20).expect("spills");
    sink.accept(photons).expect("takes photons");
    sink.finish().expect("finishes");
    let about = About {
        provenance: Provenance::default(),
        timesteps,
        surfaces: vec!["roof".to_owned()],
        basis: SpectralBasis::Visible,
        tally: Tally::default(),
    };
    build(&spill, &path, &about, 64 << 20, &Silent).expect("builds");
    let options = OpenOptions { cache_bytes: 1 << 20, access: Access::Mapped };
    Store::open(&path, &options).expect("opens")
}

/// Photons at random over the square of edge 10 at z = 0, from directions at 60 degrees to the
/// normal (its cosine is 1/2); every tenth lies on the underside and must never count.
fn photons_on_the_plane(count: usize, timesteps: u32) -> Vec<Photon> {
    let mut random = Stream::new(5, Purpose::Survey, 0);
    (0..count)
        .map(|i| {
            let mut coordinate = || (10.0 * random.uniform_fine() - 5.0) as f32;
            let position = vec3(coordinate(), coordinate(), 0.0);
            let side = if i % 10 == 9 { -1.0 } else { 1.0 };
            Photon {
                position,
                normal: vec3(0.0, 0.0, side),
                direction: vec3(0.75f32.sqrt(), 0.0, 0.5 * side),
                flux_w: 0.001 * (1.0 + random.uniform() as f32),
                timestep: ((random.uniform() * f64::from(timesteps)) as u32).min(timesteps - 1),
                surface: 0,
            }
        })
        .collect()
}

/// Hits of a plan view over the plane, with some sky in it.
fn plane_hits(edge: usize) -> HitMap {
    let mut hits = vec![Hit::nothing(HitKind::Sky); edge * edge];
    for (i, hit) in hits.iter_mut().enumerate() {
        let place = |n: usize| (n as f32 + 0.5) / edge as f32 * 8.0 - 4.0;
        if i % 11 != 3 {
            let kind = [HitKind::Receiver, HitKind::Beyond, HitKind::Hidden, HitKind::Pv][i % 4];
            let position = vec3(place(i % edge), place(i / edge), 0.0);
            *hit = Hit { position, normal: Vec3::Z, object: 0, face: 0, pv_distance_m: 1.0, kind };
        }
    }
    HitMap { columns: edge, rows: edge, hits }
}

/// Collects tiles in memory.
#[derive(Default)]
struct Tiles {
    tiles: Mutex<BTreeMap<TileRect, Vec<SeriesEntry>>>,
    puts: Mutex<usize>,
}

impl TileSink for Tiles {
    fn has(&self, tile: TileRect) -> bool {
        self.tiles.lock().expect("unpoisoned").contains_key(&tile)
    }
    fn put(&self, tile: TileRect, entries: &[SeriesEntry]) -> Result<(), SinkError> {
        let ordered = |w: &[SeriesEntry]| (w[0].timestep, w[0].pixel) < (w[1].timestep, w[1].pixel);
        assert!(entries.windows(2).all(ordered), "sorted, without doubles");
        *self.puts.lock().expect("unpoisoned") += 1;
        self.tiles.lock().expect("unpoisoned").insert(tile, entries.to_vec());
        Ok(())
    }
}

const TIMESTEPS: u32 = 30;

fn settings(bandwidth: usize) -> Gather {
    Gather { bandwidth, max_radius_m: Some(1.5), ..Gather::default() }
}

/// Annual map and series of a store against sums over all of its photons, and against the truth:
/// 20,000 photons of 1.5 mW on 100 m2 are 0.27 W/m2 from above.
#[test]
fn maps_and_series_are_sums_over_the_store() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = store_of(folder.path(), &photons_on_the_plane(20_000, TIMESTEPS), TIMESTEPS);
    let mut all = Vec::new();
    store.scan(|index, p| all.push((index, *p))).expect("scans");
    let hits = plane_hits(70);
    let weights: Vec<f64> = (0..TIMESTEPS).map(|t| 1.0 + f64::from(t) / 10.0).collect();
    let k = 150;
    let map = annual(&store, None, &hits, &weights, &settings(k), &Silent).expect("gathers");
    let sink = Tiles::default();
    let summary = series(&store, None, &hits, &settings(k), Irradiance::Surface, &sink, &Silent)
        .expect("gathers");
    let steep = Tiles::default();
    series(&store, None, &hits, &settings(k), Irradiance::FacingBeam, &steep, &Silent)
        .expect("gathers");

    let tiles = sink.tiles.into_inner().expect("unpoisoned");
    let mut rows = BTreeMap::new();
    for (tile, entries) in &tiles {
        for e in entries {
            let (r, c) = (e.pixel as usize / tile.columns, e.pixel as usize % tile.columns);
            rows.entry((tile.column + c, tile.row + r))
                .or_insert_with(Vec::new)
                .push((e.timestep, e.irradiance_w_m2));
        }
    }
    let mut lit = 0u64;
    let mut sum = 0.0;
    for (i, hit) in hits.hits.iter().enumerate() {
        let at = (i % 70, i / 70);
        if matches!(hit.kind, HitKind::Sky | HitKind::Pv) {
            assert_eq!((map.surface[at].to_bits(), map.radius_m[at].to_bits()), (0, 0));
            assert!(!rows.contains_key(&at));
            continue;
        }
        if i % 37 != 0 {
            continue;
        }
        let mut near: Vec<(f32, &Photon)> = all
            .iter()
            .filter(|(_, p)| p.normal.z > 0.5)
            .map(|(_, p)| (p.position.distance_squared(hit.position), p))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let area = PI * f64::from(near[k - 1].0);
        let mut by_timestep = vec![0.0f64; TIMESTEPS as usize];
        for (_, p) in &near[..k - 1] {
            by_timestep[p.timestep as usize] += f64::from(p.flux_w) / area;
        }
        let expected: f64 = by_timestep.iter().zip(&weights).map(|(e, w)| e * w).sum();
        let close = |a: f32, b: f64| (f64::from(a) - b).abs() <= 1e-5 * b;
        assert!(close(map.surface[at], expected), "{at:?}: {}, {expected}", map.surface[at]);
        assert!((map.facing_beam[at] / map.surface[at] - 2.0).abs() < 0.01, "all cosines are 1/2");
        assert!(close(map.radius_m[at], (area / PI).sqrt()));
        let found = &rows[&at];
        let lit_here = by_timestep.iter().filter(|e| **e > 0.0).count();
        assert_eq!(found.len(), lit_here);
        for &(timestep, e) in found {
            assert!(close(e, by_timestep[timestep as usize]));
        }
        lit += 1;
        sum += by_timestep.iter().sum::<f64>();
    }
    // k - 1 photons of nearly equal flux: 8 % noise a pixel, pixels far apart.
    let (mean, truth) = (sum / lit as f64, 20_000.0 * 0.9 * 0.0015 / 100.0);
    let sigma = truth * 0.09 / (lit as f64 / 3.0).sqrt();
    assert!((mean - truth).abs() < 4.0 * sigma, "{mean}, expected {truth} +- {sigma}");

    let summary = summary.summary;
    let entries: usize = tiles.values().map(Vec::len).sum();
    assert_eq!(summary.lit_timesteps, entries as u64);
    let per = summary.photons_per_lit_timestep().expect("lit");
    assert!((per - 149.0 * rows.len() as f64 / entries as f64).abs() < 1e-9);
    assert_eq!((summary.tiles_rendered, summary.tiles_present), (9, 0));
    let steep = steep.tiles.into_inner().expect("unpoisoned");
    for (tile, entries) in &tiles {
        for (a, b) in entries.iter().zip(&steep[tile]) {
            assert_eq!((a.timestep, a.pixel), (b.timestep, b.pixel));
            assert!((b.irradiance_w_m2 / a.irradiance_w_m2 - 2.0).abs() < 0.01);
        }
    }
}

#[test]
fn the_gather_is_the_same_for_any_threads_and_resumes() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = store_of(folder.path(), &photons_on_the_plane(20_000, TIMESTEPS), TIMESTEPS);
    let hits = plane_hits(70);
    let weights = vec![1.0; TIMESTEPS as usize];
    let both = [1, 2].map(|threads| {
        pool(threads, || {
            let map =
                annual(&store, None, &hits, &weights, &settings(60), &Silent).expect("gathers");
            let sink = Tiles::default();
            let summary =
                series(&store, None, &hits, &settings(60), Irradiance::Surface, &sink, &Silent)
                    .expect("gathers");
            let summary = (summary.summary, summary.photon_w_m2, summary.radius_m);
            (map, sink.tiles.into_inner().expect("unpoisoned"), summary)
        })
    });
    assert_eq!(both[0], both[1]);
    // Some tiles are there: only the others are rendered, and all is as before.
    let kept: BTreeMap<_, _> = both[0].1.clone().into_iter().step_by(2).collect();
    let sink = Tiles { tiles: Mutex::new(kept), puts: Mutex::new(0) };
    let summary = series(&store, None, &hits, &settings(60), Irradiance::Surface, &sink, &Silent);
    let again = summary.expect("gathers");
    assert_eq!(again.summary.tiles_present, 5);
    assert_eq!(again.photon_w_m2, both[0].2.1, "the noise of tiles that were there, too");
    assert_eq!(*sink.puts.lock().expect("unpoisoned"), 4);
    assert_eq!(sink.tiles.into_inner().expect("unpoisoned"), both[0].1);
}

#[test]
fn too_few_photons_and_wrong_settings() {
    let folder = tempfile::tempdir().expect("a folder");
    let hits = plane_hits(20);
    // 40 photons, 4,000 asked for: all within the radius count, over the radius' disc.
    let few = photons_on_the_plane(40, 3);
    let store = store_of(folder.path(), &few, 3);
    let map = annual(&store, None, &hits, &[1.0; 3], &settings(4000), &Silent).expect("gathers");
    let mut zeros = 0;
    for (i, hit) in hits.hits.iter().enumerate().filter(|(_, h)| h.kind.receives()) {
        let near = |p: &&Photon| p.normal.z > 0.0 && p.position.distance(hit.position) < 1.5;
        let expected: f64 =
            few.iter().filter(near).map(|p| f64::from(p.flux_w)).sum::<f64>() / (PI * 2.25);
        let found = f64::from(map.surface[(i % 20, i / 20)]);
        assert!((found - expected).abs() <= 1e-3 * expected, "{found}, expected {expected}");
        zeros += usize::from(expected == 0.0);
    }
    assert!(zeros > 5, "{zeros} pixels without photons");
    let fault = |g: Gather, weights: &[f64]| {
        annual(&store, None, &hits, weights, &g, &Silent).expect_err("refuses").to_string()
    };
    let one = fault(settings(1), &[1.0; 3]);
    assert!(one.starts_with("bandwidth: expected 2 to ") && one.ends_with("found 1"), "{one}");
    assert!(fault(settings(9), &[1.0; 4]).contains("3 timesteps"));
    let flat = Gather { max_radius_m: Some(0.0), ..settings(9) };
    let flat = fault(flat, &[1.0; 3]);
    assert_eq!(flat, "max_radius_m: expected metres above 0, found 0");
    // No photons at all: all is exactly 0, also where the store has to find the radius.
    let empty = tempfile::tempdir().expect("a folder");
    let store = store_of(empty.path(), &[], 3);
    let own = Gather { max_radius_m: None, ..settings(50) };
    let map = annual(&store, None, &hits, &[1.0; 3], &own, &Silent).expect("gathers");
    assert!(map.surface.data().iter().chain(map.facing_beam.data()).all(|v| v.to_bits() == 0));
    let sink = Tiles::default();
    let summary = series(&store, None, &hits, &own, Irradiance::Surface, &sink, &Silent)
        .expect("gathers")
        .summary;
    assert_eq!((summary.lit_pixels, summary.photons_per_lit_timestep()), (0, None));
    assert!(sink.tiles.into_inner().expect("unpoisoned").values().all(Vec::is_empty));
}

/// Batches of a view whose series is never written hold what the written one does, to the last
/// bit, wherever the year is cut.
#[test]
fn batches_are_the_written_series() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = store_of(folder.path(), &photons_on_the_plane(20_000, TIMESTEPS), TIMESTEPS);
    let hits = plane_hits(70);
    for quantity in [Irradiance::Surface, Irradiance::FacingBeam] {
        let sink = Tiles::default();
        let written = series(&store, None, &hits, &settings(150), quantity, &sink, &Silent);
        let fused = Fused::prepare(&store, None, &hits, &settings(150), (quantity, None), &Silent);
        let fused = fused.expect("prepares");
        assert_eq!(fused.series, written.expect("gathers"));
        let mut joined: BTreeMap<TileRect, Vec<SeriesEntry>> = BTreeMap::new();
        let mut entries = 0;
        for range in [0..7, 7..8, 8..30] {
            let sink = Tiles::default();
            fused.batch(range.clone(), &sink, &Silent).expect("renders");
            let mut here = 0;
            for (tile, values) in sink.tiles.into_inner().expect("unpoisoned") {
                here += values.len() as u64;
                assert!(values.iter().all(|e| range.contains(&e.timestep)));
                joined.entry(tile).or_default().extend(values);
            }
            let bound: u64 = range.map(|t| fused.entries[t as usize]).sum();
            assert!(here <= bound, "{here} entries, at most {bound} were promised");
            entries += here;
        }
        let mut whole = sink.tiles.into_inner().expect("unpoisoned");
        whole.retain(|_, values| !values.is_empty());
        joined.retain(|_, values| !values.is_empty());
        assert_eq!(joined, whole);
        assert!(entries > 50_000, "{entries}");
    }
}

/// A photon on the plane z = 0, lying on its upper side.
fn photon(position: Vec3, flux_w: f32, cos: f32, timestep: u32) -> Photon {
    let direction = vec3((1.0 - cos * cos).sqrt(), 0.0, cos);
    Photon { position, normal: Vec3::Z, direction, flux_w, timestep, surface: 0 }
}

fn on_the_plane(places: &[Vec3], columns: usize) -> HitMap {
    let hit = |&position: &Vec3| {
        let kind = HitKind::Receiver;
        Hit { position, normal: Vec3::Z, object: 0, face: 0, pv_distance_m: 1.0, kind }
    };
    HitMap { columns, rows: places.len() / columns, hits: places.iter().map(hit).collect() }
}

/// k-1 over the disc of the k-th is free of bias, k is too bright by k/(k-1): z-tests at 4 sigma
/// (one in 16,000 fails by chance; the seed is fixed). Poisson clouds of 250 photons per m2, fluxes
/// that differ by a factor of 4.
#[test]
fn photon_clouds_give_their_irradiance() {
    let (k, clouds, per_m2) = (40usize, 4000usize, 250.0);
    let flux = |i: usize| 1.0 + 3.0 * (i * 7919 % 1000) as f32 / 1000.0;
    let truth = per_m2 * (0..1000).map(|i| f64::from(flux(i))).sum::<f64>() / 1000.0;
    let (mut photons, mut middles) = (Vec::new(), Vec::new());
    for n in 0..clouds {
        let mut random = Stream::new(17, Purpose::Survey, n as u64);
        let middle = 4.0 * vec3((n % 80) as f32, (n / 80) as f32, 0.0);
        middles.push(middle);
        // A square of edge 1: the 40th photon lies some 0.23 m from its middle.
        let mut arrival = -(1.0 - random.uniform_fine()).ln();
        while arrival <= per_m2 {
            let mut coordinate = || (random.uniform_fine() - 0.5) as f32;
            let place = middle + vec3(coordinate(), coordinate(), 0.0);
            photons.push(photon(place, flux(photons.len()), 1.0, 0));
            arrival -= (1.0 - random.uniform_fine()).ln();
        }
    }
    let folder = tempfile::tempdir().expect("a folder");
    let bounds = Aabb { min: vec3(-1.0, -1.0, -1.0), max: vec3(320.0, 200.0, 1.0) };
    let store = store_within(folder.path(), &photons, 1, bounds);
    let hits = on_the_plane(&middles, 80);
    let estimates = |bandwidth, max_radius_m, estimator| {
        let max_radius_m = Some(max_radius_m);
        let settings = Gather { bandwidth, max_radius_m, estimator, ..Gather::default() }.open();
        let map = annual(&store, None, &hits, &[1.0], &settings, &Silent).expect("gathers");
        assert!(map.radius_m.data().iter().all(|r| *r < 0.5), "no disc leaves its cloud");
        map.surface.data().iter().map(|e| f64::from(*e) / truth).collect::<Vec<f64>>()
    };
    let kf = k as f64;
    for (name, values, expected) in [
        ("photons", estimates(k, 0.45, Estimator::Photons), 1.0),
        ("radiance", estimates(k, 0.45, Estimator::Radiance), kf / (kf - 1.0)),
        // A radius that holds 20 photons on average: the disc is the limit's, never the k-th's.
        ("within the limit", estimates(90, 0.16, Estimator::Photons), 1.0),
    ] {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0);
        let sigma = (variance / n).sqrt();
        let z = (mean - expected) / sigma;
        assert!(z.abs() < 4.0, "{name}: mean {mean}, expected {expected}, z {z}");
        // The test can tell the two estimators apart.
        assert!(sigma * 4.0 < 1.0 / (kf - 1.0) / 1.5, "{name}: sigma {sigma} is too wide");
    }
}

#[test]
fn small_cases_are_exact() {
    let few = [(0.1, 0.0), (0.0, 0.2), (0.3, 0.0), (0.0, -0.4), (0.5, 0.0)];
    let cosines = [1.0, 0.5, 0.5, 0.01, 0.0];
    let mut photons: Vec<Photon> = (few.iter().zip(cosines).enumerate())
        .map(|(i, (&(x, y), cos))| photon(vec3(x, y, 0.0), (1 << i) as f32, cos, 0))
        .collect();
    let (same_place, nowhere) = (vec3(4.0, 4.0, 0.0), vec3(-4.0, -4.0, 0.0));
    photons.extend((0..5).map(|_| photon(same_place, 4.0, 1.0, 0)));
    let weighted = vec3(4.0, -4.0, 0.0);
    photons.extend([photon(weighted, 2.0, 1.0, 0), photon(weighted, 3.0, 1.0, 1)]);
    let folder = tempfile::tempdir().expect("a folder");
    let store = store_of(folder.path(), &photons, 2);
    // As they are kept: places, fluxes and directions have fewer digits in a store.
    let mut near = Vec::new();
    store
        .scan(|_, p| {
            if p.position.length() < 1.0 {
                near.push(*p);
            }
        })
        .expect("scans");
    near.sort_by(|a, b| a.flux_w.total_cmp(&b.flux_w));
    let radius_m = |i: usize| f64::from(near[i].position.length());
    let e = |count: usize| near[..count].iter().map(|p| f64::from(p.flux_w)).sum::<f64>();
    let e_n = |count: usize| {
        let facing = |p: &Photon| f64::from(p.flux_w / p.direction.dot(p.normal).max(0.05));
        near[..count].iter().map(facing).sum::<f64>()
    };
    let hits = on_the_plane(&[Vec3::ZERO, same_place, nowhere, weighted], 4);
    let gathered = |bandwidth, max_radius_m, estimator, weights: [f64; 2]| -> Annual {
        let max_radius_m = Some(max_radius_m);
        let settings = Gather { bandwidth, max_radius_m, estimator, ..Gather::default() }.open();
        annual(&store, None, &hits, &weights, &settings, &Silent).expect("gathers")
    };
    let close = |a: f32, b: f64| assert!((f64::from(a) - b).abs() < 1e-5 * b, "{a}, expected {b}");
    let even = [1.0, 1.0];
    // Three of five: the third sets the radius and isn't counted; E_n weighs by 1/cos.
    let map = gathered(3, 2.0, Estimator::Photons, even);
    let area_m2 = PI * radius_m(2) * radius_m(2);
    close(map.surface[(0, 0)], e(2) / area_m2);
    close(map.facing_beam[(0, 0)], e_n(2) / area_m2);
    close(map.radius_m[(0, 0)], radius_m(2));
    let map = gathered(3, 2.0, Estimator::Radiance, even);
    close(map.surface[(0, 0)], e(3) / area_m2);
    close(map.facing_beam[(0, 0)], e_n(3) / area_m2);
    // Four inside the limit of 0.45, ten asked for: all count, over the limit's disc; cosines
    // below 0.05 count as 0.05.
    let map = gathered(10, 0.45, Estimator::Photons, even);
    let area_m2 = PI * 0.45 * 0.45;
    close(map.surface[(0, 0)], e(4) / area_m2);
    close(map.facing_beam[(0, 0)], e_n(4) / area_m2);
    assert!((e_n(4) - 173.0).abs() < 0.1, "{}", e_n(4));
    assert_eq!(map.floored, 0);
    // Nothing: exactly 0, also with the sign.
    assert_eq!((map.surface[(2, 0)].to_bits(), map.facing_beam[(2, 0)].to_bits()), (0, 0));
    // All at one place: a disc of a millimetre, and said so.
    let map = gathered(5, 0.45, Estimator::Photons, even);
    assert!(map.floored == 1 && map.surface[(1, 0)].is_finite());
    close(map.radius_m[(1, 0)], 1e-3);
    // Weights by timestep.
    let map = gathered(10, 1.0, Estimator::Photons, [10.0, 0.5]);
    close(map.surface[(3, 0)], 21.5 / PI);
}
