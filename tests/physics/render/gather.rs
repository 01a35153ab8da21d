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
use glintmap::render::{Fused, Gather, Hit, HitKind, HitMap, annual, series};

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
    assert!(fault(settings(1), &[1.0; 3]).contains("bandwidth is 1"));
    assert!(fault(settings(9), &[1.0; 4]).contains("3 timesteps"));
    let flat = Gather { max_radius_m: Some(0.0), ..settings(9) };
    assert!(fault(flat, &[1.0; 3]).contains("max_radius_m is 0"));
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
