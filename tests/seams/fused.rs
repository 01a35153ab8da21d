//! A view that is analysed as rendered, without a series.

use std::path::Path;

use crate::support::program::{project, say, succeed};

fn run(folder: &Path, more: &[&str]) {
    let folder = folder.to_str().expect("a path of text");
    let all = [&["run", folder, "--until", "glare", "--quiet"], more].concat();
    succeed(&all);
}

/// Written series or batches of any size: the same counts, the same events, the same peak.
#[test]
fn a_fused_view_gives_what_the_series_gives() {
    let (_keep, written) = project("tiny");
    run(&written, &[]);
    let of = |folder: &Path, name: &str| {
        let path = folder.join("run/standard/plan").join(name);
        std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
    };
    for memory in ["1GiB", "48MiB"] {
        let (_keep, fused) = project("tiny");
        run(&fused, &["--set", "view.plan.fuse=true", "--memory", memory]);
        assert!(!fused.join("run/standard/plan/series.zarr").exists(), "no series is kept");
        for threshold in ["10", "30"] {
            for file in ["cumulative.npy", "sustained.npy", "longest_run.npy", "events.csv"] {
                let name = format!("glare-{threshold}/{file}");
                assert!(of(&written, &name) == of(&fused, &name), "{name} at {memory}");
            }
            for file in [
                "above_h",
                "days",
                "longest_run_h",
                "longest_day_h",
                "first_hour",
                "exceeded_30min_w_m2",
                "exceeded_50h_w_m2",
            ] {
                let name = format!("glare-{threshold}/unfiltered/{file}.npy");
                assert!(of(&written, &name) == of(&fused, &name), "{name} at {memory}");
            }
        }
        // Another threshold later: analysed again, the rest is current.
        let again = ["--set", "view.plan.fuse=true", "--set", "glare.thresholds_w_m2=[10.0, 20.0]"];
        run(&fused, &again);
        assert!(fused.join("run/standard/plan/glare-20/cumulative.npy").exists());
    }
}

/// The same for a view that is integrated directly.
#[test]
fn a_fused_direct_view_gives_what_the_series_gives() {
    let direct = ["--set", "view.plan.estimator=\"direct\""];
    let (_keep, written) = project("tiny");
    run(&written, &direct);
    let of = |folder: &Path, name: &str| {
        let path = folder.join("run/standard/plan").join(name);
        std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
    };
    for memory in ["1GiB", "48MiB"] {
        let (_keep, fused) = project("tiny");
        let more = ["--set", "view.plan.fuse=true", "--memory", memory];
        run(&fused, &[&direct[..], &more].concat());
        assert!(!fused.join("run/standard/plan/series.zarr").exists(), "no series is kept");
        assert!(of(&written, "annual.npy") == of(&fused, "annual.npy"), "the year at {memory}");
        for threshold in ["10", "30"] {
            for file in [
                "cumulative.npy",
                "sustained.npy",
                "longest_run.npy",
                "events.csv",
                "unfiltered/above_h.npy",
                "unfiltered/longest_day_h.npy",
                "unfiltered/exceeded_50h_w_m2.npy",
            ] {
                let name = format!("glare-{threshold}/{file}");
                assert!(of(&written, &name) == of(&fused, &name), "{name} at {memory}");
            }
        }
        let text = String::from_utf8(of(&fused, "glare-10/cumulative.npy")).err();
        assert!(text.is_some_and(|e| e.as_bytes().contains(&1)), "something is lit");
        let again = ["--set", "glare.thresholds_w_m2=[10.0, 20.0]", "--set", "view.plan.fuse=true"];
        run(&fused, &[&direct[..], &again].concat());
        assert!(fused.join("run/standard/plan/glare-20/cumulative.npy").exists());
    }
}

/// Without receivers nothing is made of photons: none are traced, and the run ends in its report.
#[test]
fn a_project_of_direct_views_alone_needs_no_photons() {
    let (_keep, folder) = project("tiny");
    let file = folder.join("project.toml");
    let text = std::fs::read_to_string(&file).expect("the project's file");
    let (head, rest) = text.split_once("[[observer]]").expect("observers");
    let (_, glare) = rest.split_once("[glare]").expect("glare");
    let text = format!("{head}[glare]{glare}");
    let text = text.replace("estimator = \"photons\"", "estimator = \"direct\"");
    std::fs::write(&file, text).expect("can be written");
    let made = folder.join("run/standard");
    std::fs::create_dir_all(&made).expect("a folder");
    // What other settings left there tells nothing of these.
    std::fs::write(made.join("photons.gmp"), "left over").expect("can be written");
    succeed(&["run", folder.to_str().expect("a path of text"), "--quiet"]);
    let left = std::fs::read(made.join("photons.gmp")).expect("still there");
    assert_eq!(left, b"left over", "no photons are traced");
    let events = std::fs::read_to_string(made.join("plan/glare-10/events.csv")).expect("events");
    assert!(events.lines().count() > 2, "{events}");
    assert!(folder.join("run/report.html").exists());
}

#[test]
fn what_makes_no_sense_is_refused_by_name() {
    let (_keep, folder) = project("tiny");
    let folder = folder.to_str().expect("a path of text");
    for (set, expected) in [
        ("view.plan.kernel=\"gauss\"", "epanechnikov"),
        ("view.plan.normal_tolerance_deg=0.0", "1 to 90"),
        ("view.plan.plane_tolerance_m=-1.0", "plane_tolerance_m"),
        ("view.plan.series_mantissa_bits=0", "1 to 23"),
        ("view.plan.view_file=\"x.vf\"", "either `view` or `view_file`"),
    ] {
        let said = say(&["plan", folder, "--set", set]);
        assert_eq!(said.code, 2, "{set}: {}", said.err);
        assert!(said.err.contains(expected), "{set}: {}", said.err);
    }
}
