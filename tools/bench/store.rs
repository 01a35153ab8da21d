//! The photon store by itself: how fast it is built, how large it is, how fast it answers.
//!
//! `cargo run --release -p glintmap-tools --example bench-store -- --photons 1,16,250`
//!
//! Prints one row a store: build rates (photons/s on all threads given), bytes a photon, peak
//! anonymous memory of the build; then one row a set of queries: k nearest a second on one core
//! (seconds on the processor, not on the clock), cache hits and misses, resident memory; last how much faster two threads are than one, on
//! the clock, which needs a machine that does nothing else. `store_peer.py` beside it asks SciPy's cKDTree the
//! same on the same kind of points.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Parser;
use glam::Vec3;
use glintmap::base::{
    Aabb, Photon, PhotonSink, Provenance, Purpose, Silent, SpectralBasis, Stream, Tally,
};
use glintmap::pages::{self, About, Access, Neighbours, OpenOptions, Query, Spill, Store};

/// Build photon stores and ask them
#[derive(Debug, Parser)]
struct Arguments {
    /// Sizes of synthetic stores, millions of photons
    #[arg(long, value_delimiter = ',', default_value = "1")]
    photons: Vec<f64>,
    /// A store that exists, instead of synthetic ones
    #[arg(long, value_name = "FILE")]
    store: Option<PathBuf>,
    /// Photons per query
    #[arg(long, value_delimiter = ',', default_value = "400,4000")]
    k: Vec<usize>,
    /// Queries of a set
    #[arg(long, default_value_t = 16_384)]
    queries: usize,
    /// Distance between the queries of the patch, metres, on average
    #[arg(long, default_value_t = 0.1)]
    pitch: f32,
    /// Memory for building, MiB
    #[arg(long, default_value_t = 1024)]
    memory: u64,
    /// Cache for asking, MiB
    #[arg(long, default_value_t = 256)]
    cache: u64,
    /// Threads for building
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// Folder for the synthetic stores, which are removed again
    #[arg(long, default_value = "/tmp")]
    scratch: PathBuf,
}

const SCENE: Aabb = Aabb { min: Vec3::ZERO, max: Vec3::new(200.0, 200.0, 30.0) };
const TIMESTEPS: u32 = 1280;
const SURFACES: u16 = 8;

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    rayon::ThreadPoolBuilder::new().num_threads(arguments.threads).build_global()?;
    if let Some(path) = &arguments.store {
        return ask(path, &arguments);
    }
    for &millions in &arguments.photons {
        let folder = tempfile::tempdir_in(&arguments.scratch)?;
        let path = folder.path().join("photons.gmp");
        build(&path, (millions * 1e6) as u64, &arguments)?;
        ask(&path, &arguments)?;
    }
    Ok(())
}

/// Photons as they come from a tracer: on the ground, on walls, and some in caustics.
fn photon(random: &mut Stream, number: u64) -> Photon {
    let mut uniform = || random.uniform() as f32;
    let anywhere = Vec3::new(uniform(), uniform(), uniform());
    let (position, normal) = match number % 20 {
        0 => (Vec3::new(50.0, 60.0, 0.0) + anywhere.with_z(0.0) * 0.5, Vec3::Z),
        1..4 => ((anywhere * SCENE.max).with_x(120.0), Vec3::NEG_X),
        _ => ((anywhere * SCENE.max).with_z(0.0), Vec3::Z),
    };
    let bent = Vec3::new(uniform(), uniform(), uniform()) - 0.5;
    Photon {
        position,
        normal,
        direction: (normal + bent).normalize(),
        flux_w: 1.0 + 3.0 * uniform(),
        timestep: (number.wrapping_mul(2_654_435_761) >> 7) as u32 % TIMESTEPS,
        surface: (number % u64::from(SURFACES)) as u16,
    }
}

fn build(path: &Path, count: u64, arguments: &Arguments) -> Result<()> {
    let memory = arguments.memory << 20;
    let spill_dir = pages::spill_dir(path);
    let mut spill = Spill::create(&spill_dir, SCENE, count, memory / 4)?;
    let mut random = Stream::new(1, Purpose::Survey, 0);
    let mut spilling = 0.0;
    let mut done = 0;
    while done < count {
        let batch: Vec<Photon> =
            (done..count.min(done + 65_536)).map(|i| photon(&mut random, i)).collect();
        let began = Instant::now();
        spill.accept(&batch)?;
        spilling += began.elapsed().as_secs_f64();
        done += batch.len() as u64;
    }
    spill.finish()?;
    let about = About {
        provenance: Provenance { program: "bench-store".to_owned(), ..Provenance::default() },
        timesteps: TIMESTEPS,
        surfaces: (0..SURFACES).map(|i| format!("surface {i}")).collect(),
        basis: SpectralBasis::Broadband,
        tally: Tally::default(),
    };
    let watch = Watch::start();
    let (began, cpu) = (Instant::now(), cpu_s("/proc/self/stat")?);
    let summary = pages::build(&spill_dir, path, &about, memory / 2, &Silent)?;
    let (wall, cpu) = (began.elapsed().as_secs_f64(), cpu_s("/proc/self/stat")? - cpu);
    let peak = watch.stop();
    pages::discard(&spill_dir)?;
    println!(
        "{count} photons: spill {:.1} M/s; sort and pages {:.2} M/s on {} threads ({wall:.1} s, {cpu:.1} s on the \
         processor); {} pages, {:.2} bytes a photon; anonymous memory at most {} MiB of {}",
        count as f64 / spilling / 1e6,
        count as f64 / wall / 1e6,
        arguments.threads,
        summary.pages,
        summary.bytes as f64 / count as f64,
        peak >> 10,
        arguments.memory / 2
    );
    Ok(())
}

fn ask(path: &Path, arguments: &Arguments) -> Result<()> {
    let options = OpenOptions { cache_bytes: arguments.cache << 20, access: Access::Mapped };
    let store = Store::open(path, &options)?;
    let depth = store.levels().len();
    println!("{} photons in {} pages, depth {depth}", store.info().photons, store.info().pages);
    println!(
        "| queries | k | pass | 1/s | pages touched by a query | hits | misses | photons found | resident, MiB (anonymous) |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for &k in &arguments.k {
        for (name, points) in
            [("patch", patch(&store, arguments)?), ("all over", spread(&store, arguments)?)]
        {
            for pass in ["first", "warm"] {
                row(&store, (name, pass, k), &points)?;
            }
        }
        let points = patch(&store, arguments)?;
        together(&store, k, &points, 2)?; // warms the cache
        let one = together(&store, k, &points, 1)?;
        let two = together(&store, k, &points, 2)?;
        println!("k = {k}, two threads: {:.2} times one thread, on the clock", one / two);
    }
    Ok(())
}

/// Seconds on the clock for queries that threads ask side by side.
fn together(store: &Store, k: usize, points: &[(Vec3, Vec3)], threads: usize) -> Result<f64> {
    let max_radius_m = store.max_radius_m(k);
    let began = Instant::now();
    std::thread::scope(|scope| {
        let asked: Vec<_> = points
            .chunks(points.len().div_ceil(threads))
            .map(|points| {
                scope.spawn(move || {
                    let mut found = Neighbours::default();
                    points.iter().try_for_each(|&(point, normal)| {
                        store.nearest(&Query { point, normal, count: k, max_radius_m }, &mut found)
                    })
                })
            })
            .collect();
        for thread in asked {
            thread.join().map_err(|_| anyhow::anyhow!("a thread panicked"))??;
        }
        Ok(began.elapsed().as_secs_f64())
    })
}

/// Where photons lie, as a picture's pixels see them: `pitch` apart on average, in the store's own
/// order (that of Morton codes), from its middle on.
fn patch(store: &Store, arguments: &Arguments) -> Result<Vec<(Vec3, Vec3)>> {
    let info = store.info();
    let area_m2 = arguments.queries as f64 * f64::from(arguments.pitch).powi(2);
    let step = (area_m2 / info.area_m2_per_photon / arguments.queries as f64).max(1.0) as usize;
    let mut points = Vec::new();
    let mut seen = 0;
    for number in (info.pages as usize / 2..info.pages as usize).chain(0..info.pages as usize / 2) {
        store.in_page(number, |_, p| {
            if seen % step == 0 {
                points.push((p.position, p.normal));
            }
            seen += 1;
        })?;
        if points.len() >= arguments.queries {
            points.truncate(arguments.queries);
            break;
        }
    }
    Ok(points)
}

/// The first photons of pages from end to end of the store.
fn spread(store: &Store, arguments: &Arguments) -> Result<Vec<(Vec3, Vec3)>> {
    let pages = store.info().pages as usize;
    let each = (arguments.queries / pages).max(1);
    let mut points = Vec::new();
    for number in (0..pages).step_by((pages / arguments.queries).max(1)) {
        let mut here = Vec::new();
        store.in_page(number, |_, p| here.push((p.position, p.normal)))?;
        let step = (here.len() / each).max(1);
        points.extend(here.into_iter().step_by(step).take(each));
    }
    Ok(points)
}

fn row(store: &Store, (name, pass, k): (&str, &str, usize), points: &[(Vec3, Vec3)]) -> Result<()> {
    let max_radius_m = store.max_radius_m(k);
    let queries: Vec<Query> = points
        .iter()
        .map(|&(point, normal)| Query { point, normal, count: k, max_radius_m })
        .collect();
    let before = store.cache_stats();
    let mut photons = 0;
    let mut found = Neighbours::default();
    let began = cpu_s(THREAD)?;
    for query in &queries {
        store.nearest(query, &mut found)?;
        photons += found.items().len();
    }
    let alone = cpu_s(THREAD)? - began;
    let after = store.cache_stats();
    let pages = (after.hits + after.misses - before.hits - before.misses) as f64;
    let rate = |seconds: f64| queries.len() as f64 / seconds;
    println!(
        "| {name} | {k} | {pass} | {:.0} | {:.2} | {} | {} | {:.0} | {} ({}) |",
        rate(alone),
        pages / queries.len() as f64,
        after.hits - before.hits,
        after.misses - before.misses,
        photons as f64 / queries.len() as f64,
        status_kib("VmRSS") >> 10,
        status_kib("RssAnon") >> 10,
    );
    Ok(())
}

const THREAD: &str = "/proc/thread-self/schedstat";

/// Seconds on the processor: of this thread, or of the whole process.
fn cpu_s(from: &str) -> Result<f64> {
    let text = std::fs::read_to_string(from)?;
    if from == THREAD {
        let nanoseconds = text.split(' ').next().context("schedstat")?;
        return Ok(nanoseconds.parse::<f64>()? * 1e-9);
    }
    // User and system time, in hundredths of a second, behind the name in brackets.
    let words: Vec<&str> = text.rsplit(')').next().context("stat")?.split_whitespace().collect();
    let ticks = |i: usize| words.get(i).and_then(|w| w.parse::<f64>().ok()).unwrap_or(0.0);
    Ok((ticks(11) + ticks(12)) / 100.0)
}

fn status_kib(name: &str) -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|l| l.strip_prefix(name)?.strip_prefix(':'));
    line.and_then(|l| l.trim().trim_end_matches("kB").trim().parse().ok()).unwrap_or(0)
}

/// Looks at the anonymous memory while something runs.
struct Watch {
    stop: std::sync::mpsc::Sender<()>,
    thread: std::thread::JoinHandle<u64>,
}

impl Watch {
    fn start() -> Self {
        let (stop, stopped) = std::sync::mpsc::channel();
        let thread = std::thread::spawn(move || {
            let mut peak = 0;
            loop {
                peak = peak.max(status_kib("RssAnon"));
                if stopped.recv_timeout(std::time::Duration::from_millis(5)).is_ok() {
                    return peak;
                }
            }
        });
        Self { stop, thread }
    }

    fn stop(self) -> u64 {
        let _ = self.stop.send(());
        self.thread.join().unwrap_or(0)
    }
}
