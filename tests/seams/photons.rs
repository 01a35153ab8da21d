//! Photons by way of the program: any number of suns, any memory, and one of them retold.

use serde_json::Value;

use crate::support::program::{hashes, project, say, succeed};

/// A year at 52 seconds: 302,000 timesteps.
#[test]
fn three_hundred_thousand_suns_are_traced_stored_and_listed() {
    let (_keep, folder) = project("tiny");
    let folder = folder.to_str().expect("a plain path");
    let mut arguments = vec!["run", folder, "--until", "pages", "--quiet"];
    for set in [
        "time.days={ from = 0, to = 364, step = 1 }",
        "time.hours={ from = 0.0, to = 23.99, step = 0.0144 }",
        "photons.stored=5000",
    ] {
        arguments.extend(["--set", set]);
    }
    succeed(&arguments);
    let suns = std::fs::read_to_string(format!("{folder}/run/suns.csv")).expect("suns");
    let suns = suns.lines().filter(|l| l.starts_with(|c: char| c.is_ascii_digit())).count();
    assert!(suns > 300_000, "{suns} suns");
    let store = format!("{folder}/run/tile/photons.gmp");
    let listed = succeed(&["inspect", &store, "--per-timestep"]);
    let rows: Vec<_> = listed.out.lines().skip(1).collect();
    assert_eq!(rows.len(), suns);
    let photons = |row: &&str| row.split(',').nth(1).and_then(|n| n.parse::<u64>().ok());
    let sum: u64 = rows.iter().filter_map(photons).sum();
    assert!((4500..5500).contains(&sum), "{sum} photons");
    let late = rows[rows.len() - 20_000..].iter().filter_map(photons).sum::<u64>();
    assert!(late > 0, "timesteps beyond 65,536 hold photons");
}

/// So many photons that with little memory each part is spilt again and again.
#[test]
fn little_memory_gives_the_same_bytes() {
    let with = |memory: &str| {
        let (keep, folder) = project("tiny");
        let path = folder.to_str().expect("a plain path");
        let arguments = ["run", path, "--until", "pages", "--quiet", "--memory", memory];
        succeed(&[&arguments[..], &["--set", "photons.stored=600000"]].concat());
        let found = hashes(&folder);
        drop(keep);
        found
    };
    let (little, much) = (with("16MiB"), with("4GiB"));
    assert!(little.keys().filter(|name| name.ends_with(".gmp")).count() == 2);
    assert_eq!(little, much);
}

#[test]
fn a_photon_is_retold_from_the_sun_to_its_end() {
    let (_keep, folder) = project("tiny");
    let path = folder.to_str().expect("a plain path");
    let early = say(&["trace", path, "--replay", "1"]);
    assert_eq!(early.code, 2, "stderr: {}", early.err);
    assert!(early.err.contains("--until trace"), "{}", early.err);
    succeed(&["run", path, "--until", "trace", "--quiet"]);
    let tally: Value = serde_json::from_str(
        &std::fs::read_to_string(folder.join("run/standard/tally.json")).expect("a tally"),
    )
    .expect("JSON");
    let sent = tally["plan"]["emitted"].as_u64().expect("a number");
    let mut fates = std::collections::BTreeMap::<String, u64>::new();
    for i in 0..24 {
        let number = (i * sent / 24).to_string();
        let material = ["--material", "standard", "--replay", &number];
        let said = succeed(&[&["trace", path, "--json"][..], &material].concat());
        let found: Value = serde_json::from_str(&said.out).expect("one document");
        let fate = found["fate"].as_str().expect("a word").to_owned();
        let words = succeed(&[&["trace", path][..], &material].concat()).out;
        assert!(words.contains(&format!("Photon {number} of {sent}")), "{words}");
        assert!(words.contains("roof") && words.contains("incidence"), "{words}");
        if fate == "stored" {
            // It flew straight, and carries what the plan says.
            let list = |name: &str| -> Vec<f64> {
                let list = found[name].as_array().expect("a list");
                list.iter().filter_map(Value::as_f64).collect()
            };
            let (start, way, end) = (list("start"), list("direction"), list("landed"));
            let far = found["distance_m"].as_f64().expect("a number");
            for axis in 0..3 {
                assert!((start[axis] + far * way[axis] - end[axis]).abs() < 1e-3, "{words}");
            }
            let flux = found["flux_w"].as_f64().expect("a number");
            let photon_w = tally["plan"]["photon_w"].as_f64().expect("a number");
            assert!((flux / photon_w - 1.0).abs() < 1e-9);
            assert!(words.contains("is stored"), "{words}");
        }
        *fates.entry(fate).or_default() += 1;
    }
    assert!(fates.contains_key("stored") && fates.len() > 1, "{fates:?}");
    let beyond = say(&["trace", path, "--material", "standard", "--replay", &sent.to_string()]);
    assert_eq!(beyond.code, 2, "stderr: {}", beyond.err);
    assert!(beyond.err.contains(&sent.to_string()), "{}", beyond.err);
    let unknown = say(&["trace", path, "--material", "velvet", "--replay", "0"]);
    assert_eq!(unknown.code, 2);
    assert!(unknown.err.contains("standard"), "{}", unknown.err);
}
