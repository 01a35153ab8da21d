//! Each key of a view does what it says, is refused, or is said to do nothing.

use std::path::Path;

use glintmap::volume::Volume;
use serde_json::Value;

use crate::support::program::{Said, project, say, succeed};

const DIRECT: &str = "view.plan.estimator=\"direct\"";
const FEW_BITS: &str = "view.plan.series_mantissa_bits=4";

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

fn run(folder: &Path, set: &[&str]) -> Said {
    let mut arguments = vec!["run", text(folder), "--until", "glare", "--json"];
    set.iter().for_each(|set| arguments.extend(["--set", set]));
    succeed(&arguments)
}

fn made(said: &Said) -> Vec<String> {
    let summary: Value = serde_json::from_str(&said.out).expect("one JSON document");
    let list = summary["made"].as_array().expect("a list");
    list.iter().filter_map(|m| m.as_str().map(str::to_owned)).collect()
}

/// The numbers of a series, and what it says about their error.
fn series(folder: &Path) -> (Vec<f32>, Option<String>) {
    let path = folder.join("run/standard/plan/series.zarr");
    let volume = Volume::open(&path).expect("a series");
    let [timesteps, rows, columns] = volume.shape();
    let mut numbers = vec![0.0; timesteps * rows * columns];
    volume.read(0..timesteps, &mut numbers).expect("reads");
    let group = std::fs::read(path.join("zarr.json")).expect("a group");
    let group: Value = serde_json::from_slice(&group).expect("JSON");
    let said = group
        .to_string()
        .split("largest_relative_error\":\"")
        .nth(1)
        .map(|rest| rest.split('"').next().expect("a value").to_owned());
    (numbers, said)
}

/// `series_mantissa_bits` of a view that is integrated directly: the series is as exact as it
/// says, another setting makes another one, and an analysis that keeps none sees the same numbers.
#[test]
fn a_direct_series_has_the_bits_that_it_claims() {
    let (_keep, folder) = project("tiny");
    run(&folder, &[DIRECT]);
    let (exact, claim) = series(&folder);
    assert_eq!(claim, None);
    let annual = |folder: &Path| {
        std::fs::read(folder.join("run/standard/plan/annual.npy")).expect("an annual map")
    };
    let whole = annual(&folder);
    let again = made(&run(&folder, &[DIRECT, FEW_BITS]));
    assert!(again.contains(&"render standard plan".to_owned()), "{again:?}");
    let (few, claim) = series(&folder);
    assert_eq!(claim.as_deref(), Some("2^-5"));
    assert!(exact.iter().any(|v| *v > 0.0), "something is lit");
    assert!(exact != few, "something was rounded");
    for (exact, few) in exact.iter().zip(&few) {
        assert_eq!(few.to_bits() & ((1 << 19) - 1), 0, "{few} has more than 4 bits");
        assert!((few - exact).abs() <= exact * 2.0_f32.powi(-5), "{exact} became {few}");
    }
    assert!(whole == annual(&folder), "maps are exact whatever the series keeps");

    let (_keep, fused) = project("tiny");
    run(&fused, &[DIRECT, FEW_BITS, "view.plan.fuse=true"]);
    let of = |folder: &Path, name: &str| {
        std::fs::read(folder.join("run/standard/plan").join(name)).expect(name)
    };
    for name in ["cumulative.npy", "events.csv", "unfiltered/exceeded_50h_w_m2.npy"] {
        let name = format!("glare-10/{name}");
        assert!(of(&folder, &name) == of(&fused, &name), "{name} of a fused view");
    }
}

/// Comparing estimators is changing one key: what it makes meaningless is said, not refused.
#[test]
fn keys_without_a_meaning_are_named() {
    let (_keep, folder) = project("tiny");
    let warned = |set: &[&str]| {
        let mut arguments = vec!["plan", text(&folder)];
        set.iter().for_each(|set| arguments.extend(["--set", set]));
        let said = succeed(&arguments).err;
        said.lines().find(|line| line.contains("ignored")).map(str::to_owned)
    };
    assert_eq!(warned(&[]), None);
    let direct = warned(&[DIRECT, "view.plan.edges=true"]).expect("a warning");
    assert!(direct.contains("view.plan") && direct.contains("\"direct\""), "{direct}");
    assert!(direct.ends_with("`bandwidth`, `series_bandwidth`, `edges`"), "{direct}");
    let radiance = "view.plan.estimator=\"radiance\"";
    assert_eq!(warned(&[radiance]), None);
    let radiance = warned(&[radiance, "view.plan.kernel=\"flat\""]).expect("a warning");
    assert!(radiance.ends_with("`kernel`"), "{radiance}");
    // In the summary of a run and in what `check` understood, too.
    let said = run(&folder, &[DIRECT]);
    let summary: Value = serde_json::from_str(&said.out).expect("JSON");
    assert!(summary["warnings"].to_string().contains("`series_bandwidth`"), "{summary}");
    let said = succeed(&["check", text(&folder), "--set", DIRECT]);
    assert!(said.out.contains("note: view.plan: ignored"), "{}", said.out);

    // Observers and regions by photons are gathered as the first view says.
    let file = folder.join("project.toml");
    let project = std::fs::read_to_string(&file).expect("reads");
    let photons = format!("{project}\n[receivers]\nestimator = \"photons\"\n");
    std::fs::write(&file, photons).expect("writes");
    let said = succeed(&["plan", text(&folder), "--set", DIRECT]);
    assert!(!said.err.contains("ignored"), "{}", said.err);
}

#[test]
fn keys_that_can_only_be_a_mistake_are_refused() {
    let (_keep, folder) = project("tiny");
    let said = say(&["plan", text(&folder), "--set", "view.plan.coordinates=\"map\""]);
    assert_eq!(said.code, 2, "{}", said.err);
    assert!(said.err.contains("`coordinates` goes with `sensors`"), "{}", said.err);
    std::fs::write(folder.join("points.txt"), "0 0 1 0 0 1\n").expect("writes");
    let file = folder.join("project.toml");
    let project = std::fs::read_to_string(&file).expect("reads");
    let spots = "\n[[view]]\nname = \"spots\"\nsensors = \"points.txt\"\nboth_quantities = true\n";
    std::fs::write(&file, format!("{project}{spots}")).expect("writes");
    let said = say(&["plan", text(&folder)]);
    assert_eq!(said.code, 2, "{}", said.err);
    assert!(said.err.contains("`both_quantities`"), "{}", said.err);
}

/// `[receivers] estimator = "photons"` beside a first view of Radiance's estimator.
#[test]
fn receivers_by_photons_are_not_gathered_as_radiance_does() {
    let annual = |estimator: &str| {
        let (_keep, folder) = project("tiny");
        let file = folder.join("project.toml");
        let text = std::fs::read_to_string(&file).expect("reads");
        let text = format!("{text}\n[receivers]\nestimator = \"photons\"\n");
        std::fs::write(&file, text).expect("writes");
        run(&folder, &[&format!("view.plan.estimator=\"{estimator}\"")]);
        std::fs::read(folder.join("run/standard/receivers/annual.npy")).expect("a map")
    };
    assert!(annual("photons") == annual("radiance"));
}

/// Where other views have photons, those tell which PV surface sends an event of a direct view:
/// other photons make other tables.
#[test]
fn events_of_a_direct_view_know_the_photons_that_tell_their_senders() {
    let (_keep, folder) = project("tiny");
    let file = folder.join("project.toml");
    let text = std::fs::read_to_string(&file).expect("reads");
    let text = format!("{text}\n[receivers]\nestimator = \"photons\"\n");
    std::fs::write(&file, text).expect("writes");
    run(&folder, &[DIRECT]);
    let again = made(&run(&folder, &[DIRECT, "photons.stored=5000"]));
    assert!(again.contains(&"glare standard plan 10".to_owned()), "{again:?}");
}
