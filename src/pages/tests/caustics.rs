//! Two million photons, most of them in a millimetre, half a million in one point: a concave
//! mirror does that. Work is counted, never timed.

use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::Vec3;

use super::{BOUNDS, about};
use crate::base::{Photon, PhotonSink, Purpose, Silent, Stream};
use crate::pages::{Access, Neighbours, OpenOptions, Query, Spill, Store, build, verify};

const PHOTONS: u32 = 2_000_000;
const FOCUS: Vec3 = Vec3::new(3.1, 4.2, 5.3);
const POINT: Vec3 = Vec3::new(-20.0, 10.0, 1.0);
const TIGHT: u64 = 16 << 20;
const ROOMY: u64 = 1 << 30;
const TASK: &str = "GLINTMAP_TEST_BUILD";

fn fill(dir: &Path) {
    let mut spill = Spill::create(dir, BOUNDS, PHOTONS.into(), TIGHT).expect("creates");
    let mut random = Stream::new(9, Purpose::Survey, 0);
    let mut uniform = || random.uniform() as f32;
    let mut batch = Vec::new();
    for i in 0..PHOTONS {
        let anywhere = Vec3::new(uniform(), uniform(), uniform());
        let position = match i % 4 {
            0 => POINT,
            1 | 2 => FOCUS + 1e-3 * anywhere,
            _ => BOUNDS.min + BOUNDS.size() * anywhere,
        };
        let direction = (anywhere - 0.5).normalize();
        let (timestep, surface) = (i % 1000, (i % 2) as u16);
        let flux_w = 1.0 + uniform();
        batch.push(Photon { position, normal: Vec3::Z, direction, flux_w, timestep, surface });
        if batch.len() == 10_000 {
            spill.accept(&batch).expect("takes");
            batch.clear();
        }
    }
    spill.finish().expect("completes");
}

fn anonymous_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("RssAnon:")).unwrap_or("0 kB");
    line.trim().trim_end_matches("kB").trim().parse::<u64>().unwrap_or(0) << 10
}

/// Not a test by itself: the next one starts it in a process of its own, to see its memory alone.
#[test]
fn a_build_in_a_process_of_its_own() {
    let Some(dir) = std::env::var_os(TASK) else { return };
    let dir = Path::new(&dir);
    let (before, over) = (anonymous_bytes(), AtomicBool::new(false));
    let most = std::thread::scope(|scope| {
        let watch = scope.spawn(|| {
            let mut most = 0;
            while !over.load(Ordering::Relaxed) {
                most = most.max(anonymous_bytes());
                std::thread::sleep(std::time::Duration::from_millis(2));
            }
            most
        });
        build(&dir.join("spill"), &dir.join("tight.gmp"), &about(1000), TIGHT, &Silent)
            .expect("builds");
        over.store(true, Ordering::Relaxed);
        watch.join().expect("watches")
    });
    std::fs::write(dir.join("memory"), most.saturating_sub(before).to_string()).expect("writes");
}

#[test]
fn millions_in_a_millimetre_build_within_the_budget_and_answer() {
    let keep = tempfile::tempdir().expect("a folder");
    let dir = keep.path();
    fill(&dir.join("spill"));
    let roomy = dir.join("roomy.gmp");
    build(&dir.join("spill"), &roomy, &about(1000), ROOMY, &Silent).expect("builds");
    let child = Command::new(std::env::current_exe().expect("a name"))
        .args(["--exact", "pages::tests::caustics::a_build_in_a_process_of_its_own"])
        .env(TASK, dir)
        .output()
        .expect("starts");
    assert!(child.status.success(), "{}", String::from_utf8_lossy(&child.stdout));
    let read = |name: &str| std::fs::read(dir.join(name)).expect("reads");
    assert!(read("tight.gmp") == read("roomy.gmp"), "the budget changed the bytes");
    let memory: u64 = String::from_utf8_lossy(&read("memory")).parse().expect("a number");
    println!("{} KiB of anonymous memory for {} MiB", memory >> 10, TIGHT >> 20);
    #[cfg(target_os = "linux")]
    assert!(memory > 1 << 20 && memory < TIGHT, "{memory} bytes of anonymous memory");

    assert_eq!(verify(&roomy).expect("verifies"), Vec::<String>::new());
    let options = OpenOptions { cache_bytes: 1 << 28, access: Access::Mapped };
    let store = Store::open(&roomy, &options).expect("opens");
    assert_eq!(store.info().photons, u64::from(PHOTONS));
    assert!(store.info().pages < 2 * u64::from(PHOTONS) / 8192, "{} pages", store.info().pages);
    let mut found = Neighbours::default();
    let mut answers = 0;
    for (at, spread) in [(POINT, 0.0), (POINT, 1e-3), (FOCUS + 5e-4, 3e-4), (FOCUS, 0.1)] {
        for count in [400, 4000] {
            for i in 0..20 {
                let point =
                    at + spread * Vec3::new((i % 5) as f32 - 2.0, (i / 5) as f32 - 2.0, 0.1);
                let max_radius_m = store.max_radius_m(count).max(1.0);
                let query = Query { point, normal: Vec3::Z, count, max_radius_m };
                let before = store.cache_stats();
                store.nearest(&query, &mut found).expect("searches");
                let after = store.cache_stats();
                let touched = after.hits + after.misses - before.hits - before.misses;
                assert!(found.full(), "{query:?}");
                // The first has no distance to begin with; 61 pages lie in the one point.
                assert!(touched <= 100, "{query:?}: {touched} pages");
                answers += 1;
            }
        }
    }
    let stats = store.cache_stats();
    assert!(stats.hits + stats.misses < 20 * answers, "{stats:?} for {answers} queries");
    let page_bytes = stats.decompressed_bytes / stats.misses;
    assert!(page_bytes < 512 << 10 && stats.evictions == 0, "{page_bytes} bytes a page");
}
