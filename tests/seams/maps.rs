//! The maps of a run against each other and against the photons, computed anew from the store by
//! linear search: what joins render, volume, glare and pictures must not lose or invent anything.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use glintmap::base::{Grid, Photon};
use glintmap::pages::{Access, OpenOptions, Store};
use glintmap::picture::exr;
use glintmap::project::Resolved;
use glintmap::receivers::probe::{Spot, probe};
use glintmap::render::{HitKind, HitMap};
use glintmap::volume::Volume;
use glintmap_formats::npy;

use crate::support::program::{project, succeed};
use crate::support::series::run_python;

const MATERIALS: [&str; 2] = ["standard", "tile"];
/// For the annual map and the series: then both look at the same photons.
const BANDWIDTH: usize = 50;
/// Low enough that the small project has glare at both.
const THRESHOLDS: [&str; 2] = ["2", "5"];

/// From the east and above: the lit wall and ground, the PV, sky. (The project's own view from
/// straight above sees little of the wall, where the light is.)
const VIEW: &str = "-vtl -vp 30 0 20 -vd -1 0 -0.5 -vu 0 0 1 -vh 44 -vv 30";

/// Discs without edges and of any height: the handbook's definition, which a linear search follows,
/// and that of the series.
fn settings() -> [String; 5] {
    [
        "view.plan.edges=false".to_owned(),
        "view.plan.plane_tolerance_m=0.0".to_owned(),
        format!("view.plan.series_bandwidth={BANDWIDTH}"),
        format!("glare.thresholds_w_m2=[{}.0, {}.0]", THRESHOLDS[0], THRESHOLDS[1]),
        format!("view.plan.view=\"{VIEW}\""),
    ]
}

/// A run of the tiny project, made once for all tests of this file.
fn run() -> &'static Path {
    static RUN: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let (_, folder) = RUN.get_or_init(|| {
        let (keep, folder) = project("tiny");
        let mut arguments = vec!["run".to_owned(), folder.display().to_string()];
        arguments.push("--quiet".to_owned());
        arguments.extend(settings().into_iter().flat_map(|s| ["--set".to_owned(), s]));
        succeed(&arguments);
        (keep, folder.join("run"))
    });
    folder
}

fn plan(material: &str) -> PathBuf {
    run().join(material).join("plan")
}

fn channel(path: &Path, name: &str) -> Grid<f32> {
    let channels = exr::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    channels.get(name).unwrap_or_else(|| panic!("{}: no {name}", path.display())).clone()
}

fn hits() -> HitMap {
    HitMap::read(&run().join("plan/hits.gmh")).expect("reads").0
}

/// Hours of each timestep, as suns.csv has them.
fn weights_h() -> Vec<f64> {
    let text = fs::read_to_string(run().join("suns.csv")).expect("reads");
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("names").split(',').collect();
    let at = names.iter().position(|n| *n == "weight_h").expect("a column");
    lines.map(|l| l.split(',').nth(at).expect("a number").parse().expect("a number")).collect()
}

fn series(material: &str) -> (Vec<f32>, [usize; 3]) {
    let volume = Volume::open(&plan(material).join("series.zarr")).expect("opens");
    let shape = volume.shape();
    let mut all = vec![f32::NAN; shape.iter().product()];
    volume.read(0..shape[0], &mut all).expect("reads");
    (all, shape)
}

fn integers(path: &Path) -> Vec<i32> {
    npy::Reader::open(path).and_then(|r| r.read_all()).expect("reads")
}

fn close(found: f32, expected: f64, relative: f64) -> bool {
    (f64::from(found) - expected).abs() <= relative * expected.abs()
}

/// Every pixel anew: the k nearest of all photons in f64, k-1 of them over the disc of the k-th.
#[test]
fn the_annual_map_is_what_a_linear_search_through_the_store_says() {
    let (hits, weights) = (hits(), weights_h());
    for material in MATERIALS {
        let options = OpenOptions { cache_bytes: 1 << 20, access: Access::Pread };
        let store =
            Store::open(&run().join(material).join("photons.gmp"), &options).expect("opens");
        let mut photons: Vec<Photon> = Vec::new();
        store.scan(|_, photon| photons.push(*photon)).expect("reads");
        assert!(photons.len() > 3000, "{}", photons.len());
        let max_radius_m = f64::from(store.max_radius_m(BANDWIDTH));

        let path = plan(material).join("annual.exr");
        let surface = channel(&path, "annual.wh_m2");
        let normal = channel(&path, "annual_normal.wh_m2");
        let radius = channel(&path, "radius.m");
        let (mut full, mut sparse, mut dark) = (0, 0, 0);
        for (i, hit) in hits.hits.iter().enumerate() {
            if !hit.kind.receives() {
                continue;
            }
            let mut near: Vec<(f64, &Photon)> = photons
                .iter()
                .filter(|p| p.normal.as_dvec3().dot(hit.normal.as_dvec3()) >= 0.5)
                .map(|p| (p.position.as_dvec3().distance(hit.position.as_dvec3()), p))
                .filter(|(distance, _)| *distance <= max_radius_m)
                .collect();
            near.sort_by(|a, b| a.0.total_cmp(&b.0));
            let radius_m = if near.len() >= BANDWIDTH {
                full += 1;
                near.truncate(BANDWIDTH);
                near.pop().expect("the k-th").0.max(1e-3)
            } else {
                sparse += 1;
                max_radius_m
            };
            dark += u32::from(near.is_empty());
            let (mut h, mut h_n) = (0.0, 0.0);
            for (_, p) in near {
                let wh = f64::from(p.flux_w) * weights[p.timestep as usize];
                let cos = p.normal.as_dvec3().dot(p.direction.as_dvec3());
                h += wh;
                h_n += wh / cos.max(0.05);
            }
            let area_m2 = PI * radius_m * radius_m;
            for (name, found, expected) in [
                ("H", surface.data()[i], h / area_m2),
                ("H_n", normal.data()[i], h_n / area_m2),
                ("radius", radius.data()[i], radius_m),
            ] {
                let told = || format!("{material} pixel {i}: {name} {found}, expected {expected}");
                assert!(close(found, expected, 5e-5), "{}", told());
            }
        }
        assert!(full > 100 && sparse > 0, "{material}: {full} full, {sparse} sparse, {dark} dark");
    }
}

#[test]
fn the_year_is_the_sum_of_the_series_and_the_peak_its_largest() {
    let weights = weights_h();
    for material in MATERIALS {
        let (series, [timesteps, rows, columns]) = series(material);
        assert_eq!(timesteps, weights.len());
        let annual = channel(&plan(material).join("annual.exr"), "annual.wh_m2");
        let peak = channel(&plan(material).join("peak.exr"), "peak.w_m2");
        let npy: Vec<f32> = npy::Reader::open(&plan(material).join("annual.npy"))
            .and_then(|r| r.read_all())
            .expect("reads");
        assert_eq!(npy, annual.data(), "{material}: annual.npy and annual.exr");
        let mut lit = 0;
        for i in 0..rows * columns {
            let of = |t: usize| series[t * rows * columns + i];
            let sum: f64 = (0..timesteps).map(|t| f64::from(of(t)) * weights[t]).sum();
            let found = annual.data()[i];
            assert!(close(found, sum, 1e-5), "{material} pixel {i}: {found}, the series {sum}");
            let most = (0..timesteps).map(of).fold(0.0, f32::max);
            assert_eq!(peak.data()[i].to_bits(), most.to_bits(), "{material} pixel {i}");
            lit += u32::from(most > 0.0);
        }
        assert!(lit > 200, "{material}: {lit} pixels");
    }
}

#[test]
fn hours_are_counts_times_their_step() {
    let weights = weights_h();
    let weight_h = weights[0];
    assert!(weights.iter().all(|w| *w == weight_h));
    let mut seen = BTreeMap::new();
    for material in MATERIALS {
        for threshold in THRESHOLDS {
            let folder = plan(material).join(format!("glare-{threshold}"));
            for (map, step_h) in
                [("cumulative", weight_h), ("sustained", 0.25), ("longest_run", 0.25)]
            {
                let counts = integers(&folder.join(format!("{map}.npy")));
                let hours = channel(&folder.join(format!("{map}.exr")), &format!("{map}.h"));
                assert_eq!(counts.len(), hours.data().len());
                for (i, (count, hours)) in counts.iter().zip(hours.data()).enumerate() {
                    let expected = (f64::from(*count) * step_h) as f32;
                    assert_eq!(*hours, expected, "{material} {threshold} {map} pixel {i}");
                }
                *seen.entry(map).or_insert(0) += counts.iter().map(|n| i64::from(*n)).sum::<i64>();
            }
        }
    }
    assert!(seen.values().all(|n| *n > 100), "glare to count: {seen:?}");
}

#[test]
fn the_ratio_is_new_over_old() {
    let annual = |m: &str| channel(&plan(m).join("annual.exr"), "annual.wh_m2");
    let (new, old) = (annual("standard"), annual("tile"));
    let ratio = channel(&plan("standard").join("ratio.exr"), "ratio");
    let mut kinds = [0; 3];
    for (i, ratio) in ratio.data().iter().enumerate() {
        let (new, old) = (new.data()[i], old.data()[i]);
        if old == 0.0 {
            assert_eq!(ratio.to_bits(), 0, "pixel {i}: {new} / {old}");
            kinds[usize::from(new > 0.0)] += 1;
        } else {
            assert!(close(*ratio, f64::from(new) / f64::from(old), 1e-6), "pixel {i}");
            kinds[2] += 1;
        }
    }
    assert!(kinds[0] > 0 && kinds[2] > 300, "{kinds:?}");
}

fn files(folder: &Path, ending: &str, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files(&path, ending, out);
        } else if path.extension().is_some_and(|e| e == ending) {
            out.push(path);
        }
    }
}

/// Whether a pixel lies within the reach of the glare filter (sigma 1, 4 pixels) of a true one.
fn grown(mask: &[bool], columns: usize, rows: usize) -> Vec<bool> {
    let near = |at: usize, end: usize| at.saturating_sub(4)..(at + 5).min(end);
    let any = |row: usize, column: usize| {
        near(row, rows).any(|r| near(column, columns).any(|c| mask[r * columns + c]))
    };
    (0..rows * columns).map(|i| any(i / columns, i % columns)).collect()
}

/// NaN nowhere; and where the view sees sky, PV or nothing, exactly 0. The maps of glare are made
/// from the filtered series, as the reference makes them: there the light may reach 4 pixels over
/// the border.
#[test]
fn maps_are_finite_and_exactly_zero_where_nothing_receives() {
    let hits = hits();
    let receives: Vec<bool> = hits.hits.iter().map(|h| h.kind.receives()).collect();
    let reached = grown(&receives, hits.columns, hits.rows);
    assert!(reached.iter().any(|r| !r), "the view shows sky");
    let check = |path: &Path, name: &str, values: &[f32]| {
        let glare =
            path.components().any(|c| c.as_os_str().to_string_lossy().starts_with("glare-"));
        // The receivers' maps are rows of points, all of which receive.
        let points = path.components().any(|c| c.as_os_str() == "receivers");
        let lit = match (points, glare) {
            (true, _) => &vec![true; values.len()],
            (_, true) => &reached,
            _ => &receives,
        };
        assert_eq!(values.len(), lit.len());
        for (i, value) in values.iter().enumerate() {
            let told = || format!("{} {name} pixel {i}: {value}", path.display());
            assert!(value.is_finite() && *value >= 0.0, "{}", told());
            assert!(lit[i] || value.to_bits() == 0, "{}", told());
        }
    };
    let mut exrs = Vec::new();
    files(run(), "exr", &mut exrs);
    assert!(exrs.len() > 15, "{exrs:?}");
    for path in &exrs {
        let channels = exr::read(path).expect("reads");
        for (name, grid) in channels.list() {
            if path.file_name().is_some_and(|n| n == "direct.exr") {
                assert!(grid.data().iter().all(|v| v.is_finite()), "{}", path.display());
            } else {
                check(path, name, grid.data());
            }
        }
    }
    let mut npys = Vec::new();
    files(run(), "npy", &mut npys);
    assert!(npys.len() > 10, "{npys:?}");
    for path in &npys {
        // Counts are integers, all else is float32.
        match npy::Reader::<f32>::open(path).and_then(|r| r.read_all()) {
            Ok(values) => check(path, "", &values),
            Err(_) => {
                let counts: Vec<f32> = integers(path).iter().map(|v| *v as f32).collect();
                check(path, "", &counts);
            }
        }
    }
    for material in MATERIALS {
        let (series, [timesteps, rows, columns]) = series(material);
        for t in 0..timesteps {
            let slice = &series[t * rows * columns..(t + 1) * rows * columns];
            check(&plan(material).join("series.zarr"), &format!("timestep {t}"), slice);
        }
    }
}

/// A probe says what the maps say; of sky and PV it says nothing, and no zero has a sign.
#[test]
fn a_probe_agrees_with_the_maps() {
    let set = settings().map(|s| s.parse().expect("an assignment"));
    let folder = run().parent().expect("the project");
    let resolved = Resolved::read(folder, &set, 1 << 30).expect("reads");
    let hits = hits();
    let annual = MATERIALS.map(|m| channel(&plan(m).join("annual.exr"), "annual.wh_m2"));
    let brightest = (0..hits.hits.len())
        .max_by(|&a, &b| annual[0].data()[a].total_cmp(&annual[0].data()[b]))
        .expect("pixels");
    let of = |kind: HitKind| hits.hits.iter().position(|h| h.kind == kind).expect("in the view");
    for (pixel, lit) in [(brightest, true), (of(HitKind::Sky), false), (of(HitKind::Pv), false)] {
        let spot = Spot::Pixel(pixel % hits.columns, pixel / hits.columns);
        let probed = probe(&resolved, "plan", spot).expect("probes");
        assert_eq!(probed.materials.len(), MATERIALS.len());
        for (found, annual) in probed.materials.iter().zip(&annual) {
            let map = annual.data()[pixel];
            assert!(close(map, found.annual_wh_m2, 1e-5), "{found:?}, the map {map}");
            assert_eq!(found.shares.is_empty(), !lit, "{found:?}");
            assert_eq!(found.series.is_empty(), !lit, "{found:?}");
            let zeros = found.hours_above.iter().map(|(_, hours)| *hours);
            assert!(zeros.chain([found.annual_wh_m2]).all(f64::is_sign_positive), "{found:?}");
        }
        if lit {
            let total: f64 = probed.materials[0].shares.values().sum();
            assert!((total - 1.0).abs() < 1e-9);
        }
    }
}

#[test]
fn xarray_sums_the_series_to_the_annual_map() {
    let Some(python) = crate::support::python() else { return };
    let script = r#"
import sys, numpy as np, xarray as xr
for folder in sys.argv[1:]:
    ds = xr.open_zarr(folder + "/series.zarr")
    h = (ds.irradiance.astype("f8") * ds.weight_h).sum("timestep").values
    annual = np.load(folder + "/annual.npy")
    assert annual.dtype == np.float32 and annual.shape == h.shape and (annual > 0).sum() > 200
    np.testing.assert_allclose(annual, h, rtol=1e-5, atol=0)
print("fine")
"#;
    let folders = MATERIALS.map(plan);
    let said = run_python(&python, script, &[&folders[0], &folders[1]]);
    assert!(said.contains("fine"), "{said}");
}
