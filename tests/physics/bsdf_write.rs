//! Written files read again: the same light, the peak that was said, and what scattering costs.

use glam::DVec3;
use glintmap::base::{Purpose, Stream};
use glintmap::bsdf::{
    ANGLES_DEG, Bsdf, BsdfFile, Fineness, Goniophotometer, Interpolation, Model, PRESETS, Preset,
    Side, write, write_points,
};

use super::bsdf::from_degrees;
use super::trace::processor_s;

fn preset(name: &str) -> Bsdf {
    Bsdf::from_model(&Preset::named(name).expect("a preset").model()).expect("valid")
}

fn again(text: &str) -> Bsdf {
    let file = BsdfFile::parse(text, "ours.xml").expect("a good file");
    assert!(file.notes.is_empty(), "{:?}", file.notes);
    Bsdf::Measured(file.reflection(Side::Front, None).expect("has it"))
}

/// Mean reflectance of a model over the angles that share a cell, even in the sine.
fn over_cell(bsdf: &Bsdf, (low, high): (f64, f64)) -> f64 {
    let (low, high) = (low.to_radians().sin(), high.to_radians().sin());
    let sines = (0..16).map(|i| low + (high - low) * (f64::from(i) + 0.5) / 16.0);
    sines.map(|s| bsdf.reflectance(DVec3::new(s, 0.0, (1.0 - s * s).sqrt()))).sum::<f64>() / 16.0
}

#[test]
fn a_written_preset_scatters_the_same_light_when_read_again() {
    for p in PRESETS {
        let bsdf = preset(p.name);
        let resolution = if p.name == "standard" { 7 } else { 5 };
        let whole = write(&bsdf, p.name, Fineness { resolution, prune: 0.0 }).expect("fits");
        let pruned = write(&bsdf, p.name, Fineness { resolution, prune: 80.0 }).expect("fits");
        assert!(pruned.values <= whole.values && whole.rank == 3);
        assert!(whole.corrected < 0.03, "{}: cells are off by {}", p.name, whole.corrected);
        let (read, read_pruned) = (again(&whole.text), again(&pruned.text));
        for (cost, degrees) in pruned.costs.iter().zip(ANGLES_DEG) {
            let expected = over_cell(&bsdf, cost.cell_deg);
            let from = from_degrees(degrees, 30.0);
            // Coarse cells that are merged over several incident ones are off by more.
            let merged = if resolution == 7 { 0.01 } else { 0.02 };
            for (read, within) in [(&read, 0.01), (&read_pruned, merged)] {
                let seen = read.reflectance(from);
                assert!(
                    (seen / expected - 1.0).abs() < within,
                    "{} at {degrees}: {seen} {expected}",
                    p.name
                );
            }
            // The peak in the plane of incidence is at most the one that was told.
            let (lobe, lobe_pruned) = (read.lobe(degrees), read_pruned.lobe(degrees));
            assert!(lobe.peak_per_sr <= cost.peak_per_sr * 1.0001 + 1e-6);
            assert!(
                lobe.peak_per_sr >= cost.peak_per_sr * 0.7,
                "{} at {degrees}: {lobe:?} {cost:?}",
                p.name
            );
            assert!(lobe_pruned.peak_per_sr <= cost.pruned_per_sr * 1.0001 + 1e-6);
        }
    }
}

#[test]
fn a_delta_lobe_fills_its_cell() {
    let model =
        Model::CoatedGlass { index: 1.52, ggx_alpha: 0.0, cell_reflectance: 0.05, coating: None };
    let bsdf = Bsdf::from_model(&model).unwrap();
    let written = write(&bsdf, "smooth", Fineness { resolution: 5, prune: 0.0 }).unwrap();
    let read = again(&written.text);
    for cost in &written.costs {
        let seen = read.reflectance(from_degrees(cost.angle_deg, 0.0));
        let expected = over_cell(&bsdf, cost.cell_deg);
        assert!((seen / expected - 1.0).abs() < 0.02, "{cost:?}: {seen} {expected}");
        let lobe = read.lobe(cost.angle_deg);
        assert!(
            (lobe.peak_deg - cost.angle_deg).abs() < 16.0 && lobe.peak_per_sr > 1.0,
            "{lobe:?}"
        );
    }
}

#[test]
fn what_is_not_isotropic_is_written_with_rank_4() {
    let text = crate::physics::bsdf_files::file(
        "TensorTree4",
        "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>",
        &format!(
            "{{ {} }}",
            (0..256)
                .map(|i| format!("{:.3} ", 0.1 + 0.0005 * f64::from(i * 37 % 256)))
                .collect::<String>()
        ),
    );
    let bsdf = again(&text);
    let written = write(&bsdf, "uneven", Fineness { resolution: 2, prune: 0.0 }).unwrap();
    assert_eq!(written.rank, 4);
    let read = again(&written.text);
    for i in 0..300 {
        let mut random = Stream::new(80, Purpose::Survey, i);
        let mut one = || from_degrees(88.0 * random.uniform(), 360.0 * random.uniform());
        let (a, b) = (one(), one());
        let (x, y) = (bsdf.evaluate(a, b), read.evaluate(a, b));
        assert!((x - y).abs() < 2e-5 * x.max(1.0), "{a} {b}: {x} {y}");
    }
    let too_fine = write(&bsdf, "x", Fineness { resolution: 7, prune: 0.0 });
    assert!(too_fine.expect_err("268 million cells").to_string().contains("rank 4"));
}

#[test]
fn pruning_eighty_of_a_hundred_keeps_the_lobe_and_less_of_the_rest() {
    let bsdf = preset("satinated");
    let of = |prune| write(&bsdf, "x", Fineness { resolution: 6, prune }).unwrap();
    let (none, most, nearly_all) = (of(0.0), of(80.0), of(99.9));
    assert!(most.values < none.values * 6 / 10, "{} of {}", most.values, none.values);
    assert!(nearly_all.values < most.values / 4);
    for (a, b) in none.costs.iter().zip(&most.costs) {
        assert_eq!(a.peak_per_sr, a.pruned_per_sr);
        assert!(b.pruned_per_sr > 0.9 * b.peak_per_sr, "{b:?}");
    }
    let loss = |c: &glintmap::bsdf::Cost| c.pruned_per_sr / c.peak_per_sr;
    assert!(nearly_all.costs.iter().map(loss).fold(1.0, f64::min) < 0.9, "{:?}", nearly_all.costs);
}

/// Points of a model on an even grid, light at some angles and azimuths.
fn points(bsdf: &Bsdf, incident: &[(f64, f64)]) -> Goniophotometer {
    let mut text = String::from("#format: theta phi DSF\n");
    for &(theta, phi) in incident {
        text.push_str(&format!("#intheta {theta}\n#inphi {phi}\n"));
        for i in 0..1600 {
            let (u, v) = ((f64::from(i / 40) + 0.5) / 40.0, (f64::from(i % 40) + 0.5) / 40.0);
            let out = glintmap::bsdf::on_hemisphere(u, v);
            let value = bsdf.evaluate(from_degrees(theta, phi), out) * out.z;
            let (t, p) = (out.z.acos().to_degrees(), out.y.atan2(out.x).to_degrees());
            text.push_str(&format!("{t:.4} {p:.4} {value:.7}\n"));
        }
    }
    Goniophotometer::parse(&text, "points.txt").expect("good data")
}

#[test]
fn measured_points_are_met_and_joined() {
    let bsdf =
        Bsdf::from_model(&Model::PvGlass { index: 1.52, ggx_alpha: 0.3, cell_reflectance: 0.1 })
            .unwrap();
    let angles = [0.0, 20.0, 40.0, 60.0, 75.0];
    let flat: Vec<_> = angles.map(|a| (a, 90.0)).to_vec();
    let round: Vec<_> = angles
        .iter()
        .flat_map(|&a| (0..if a > 0.0 { 8 } else { 1 }).map(move |i| (a, 45.0 * f64::from(i))))
        .collect();
    for (incident, rank, resolution) in [(flat, 3, 5), (round, 4, 3)] {
        let data = points(&bsdf, &incident);
        let surface = Interpolation::of(&data);
        for (theta, most) in [(40.0, 0.1), (50.0, 0.2), (68.0, 0.35)] {
            let (mut off, mut all) = (0.0, 0.0);
            for n in 0..200 {
                let mut random = Stream::new(81, Purpose::Survey, n);
                let (u, v) = (0.9 * random.uniform(), random.uniform());
                let out = glintmap::bsdf::on_hemisphere(u, v);
                // Azimuths that were not measured, too.
                let from = from_degrees(theta, if rank == 4 { 100.0 } else { 10.0 });
                let (seen, real) = (surface.value(from, out), bsdf.evaluate(from, out));
                off += (seen - real).abs();
                all += real;
            }
            assert!(off < most * all, "rank {rank} at {theta}: off by {}", off / all);
        }
        let reach = surface.reach();
        assert_eq!(reach.incidence_deg, (0.0, 75.0));
        assert!((reach.beyond - 0.067).abs() < 1e-3);
        assert!(reach.unseen.iter().all(|u| u.1 < 0.02), "{reach:?}");
        let written = write_points(&data, Fineness { resolution, prune: 0.0 }).unwrap();
        assert_eq!(written.rank, rank);
        let read = again(&written.text);
        for degrees in [10.0, 40.0, 55.0] {
            let from = from_degrees(degrees, 90.0);
            let (seen, true_) = (read.reflectance(from), bsdf.reflectance(from));
            assert!((seen / true_ - 1.0).abs() < 0.08, "{rank} {degrees}: {seen} {true_}");
        }
    }
}

#[test]
fn points_on_half_of_the_hemisphere_are_said_to_miss_the_rest() {
    let bsdf = preset("tile");
    let mut data = points(&bsdf, &[(30.0, 0.0), (60.0, 0.0)]);
    for i in &mut data.incidents {
        i.points.retain(|p| p.0.z > 0.8);
    }
    let reach = Interpolation::of(&data).reach();
    // An even surface sends 36 % beyond 37 degrees.
    assert!(reach.unseen.iter().all(|u| u.1 > 0.4), "{reach:?}");
    assert!((reach.beyond - 0.25).abs() < 1e-9);
}

/// What a photon costs, Lambertian and a file of 12 MB in turn: a ray to the sun, a draw, a ray
/// through a village. The rays are the same ones for both, so that only the draws differ.
/// `tools/bench/scatter.sh` runs it.
#[test]
#[ignore = "a measurement"]
fn what_scattering_costs() {
    let lambertian = Bsdf::from_model(&Model::Lambertian { reflectance: 0.25 }).unwrap();
    let written =
        write(&preset("standard"), "standard", Fineness { resolution: 7, prune: 0.0 }).unwrap();
    let start = processor_s();
    let tree = again(&written.text);
    println!(
        "{:.1} MB, {} values, read in {:.2} s",
        written.text.len() as f64 / 1e6,
        written.values,
        processor_s() - start
    );
    const DRAWS: u64 = 2_000_000;
    let village = super::trace::village();
    for round in 0..3 {
        let cost = |bsdf: &Bsdf, rays: bool| {
            let start = processor_s();
            let (mut sum, mut hits) = (DVec3::ZERO, 0u64);
            for n in 0..DRAWS {
                let mut random = Stream::new(1, Purpose::Photon, n);
                let from = from_small(&mut random);
                if rays {
                    let place = [-10.0, 0.0].map(|low| low + 10.0 * random.uniform());
                    let at = DVec3::new(place[0], place[1], 13.5).as_vec3();
                    hits += u64::from(village.bvh.occluded(at, from.as_vec3(), 0.0, 1e3));
                    let down = DVec3::new(-from.x, random.uniform() - 0.5, -from.z);
                    let down = down.normalize().as_vec3();
                    hits += u64::from(village.bvh.closest(at, down, 0.3, 100.0).is_some());
                }
                if let Some(s) = bsdf.sample_within(from, 0.6, &mut random) {
                    sum += s.direction;
                }
            }
            assert!(sum.is_finite() && (hits > 0) == rays);
            1e9 * (processor_s() - start) / DRAWS as f64
        };
        let draws = [cost(&lambertian, false), cost(&tree, false)];
        let photons = [cost(&lambertian, true), cost(&tree, true)];
        println!(
            "round {round}: Lambertian {:.0} ns a photon, {:.0} of them the draw; tree {:.0} and {:.0}: {:.2} times for a photon, {:.2} for the draw alone",
            photons[0],
            draws[0],
            photons[1],
            draws[1],
            photons[1] / photons[0],
            draws[1] / draws[0]
        );
    }
}

/// Incident directions as of a year's suns: 20 to 88 degrees.
fn from_small(random: &mut Stream) -> DVec3 {
    let z = 0.035 + 0.9 * random.uniform();
    let x = (1.0 - z * z).sqrt();
    DVec3::new(-x, 0.0, z)
}
