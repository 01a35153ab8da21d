//! How long much takes.

use super::*;

/// A million triangles: run by hand, in release (`cargo test --release -- --ignored million`).
#[test]
#[ignore = "a measurement"]
fn a_million_triangles() {
    let files = Files::new();
    let edge = 708;
    let mut text = String::new();
    for y in 0..=edge {
        for x in 0..=edge {
            text.push_str(&format!("v {x} {y} {:.3}\n", f64::from((x * 7 + y * 13) % 19) * 0.1));
        }
    }
    for y in 0..edge {
        for x in 0..edge {
            let a = y * (edge + 1) + x + 1;
            let (b, c, d) = (a + 1, a + edge + 2, a + edge + 1);
            text.push_str(&format!("f {a} {b} {c}\nf {a} {c} {d}\n"));
        }
    }
    let spec = files.spec("million.obj", text);
    let (start, before) = (Instant::now(), cpu_s());
    let site = Site::load(&spec, &[]).unwrap();
    let (seconds, cpu_s) = (start.elapsed().as_secs_f64(), cpu_s() - before);
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find(|l| l.starts_with("VmHWM")).unwrap_or_default();
    eprintln!(
        "{} triangles, {} faces: {seconds:.2} s, {cpu_s:.2} CPU s, {peak}",
        site.triangles.len(),
        site.faces.len()
    );
    assert!(site.triangles.len() > 1_000_000);
    assert!(site.findings.iter().all(|f| f.severity != Severity::Error));
}

/// What the process has used, s.
fn cpu_s() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after = stat.rsplit(')').next().unwrap_or_default();
    let ticks = after.split_whitespace().skip(11).take(2).filter_map(|w| w.parse::<f64>().ok());
    ticks.sum::<f64>() / 100.0
}
