//! How fast photons are traced, in a village like the case study's.

use super::*;

/// Some 17,000 triangles as in the case study: a slope rising to the west, houses, round trees,
/// three roofs of PV 10 m up.
pub fn village() -> Site {
    let ground = |x: f32, y: f32| -0.04 * x + 0.4 * libm::sinf(0.13 * y);
    let mut scene = Scene::new()
        .pv([[0., -12., 13.2], [0., 0., 13.2], [-10., 0., 10.5], [-10., -12., 10.5]], false)
        .pv([[0., 2., 13.2], [0., 14., 13.2], [-10., 14., 10.5], [-10., 2., 10.5]], false)
        .pv([[2., 14., 10.], [12., 14., 10.], [12., 24., 13.5], [2., 24., 13.5]], false)
        .quad(wall(2.0, [-12.0, 14.0], [0.0, 10.0]))
        .quad([[-10., 0., 10.49], [-10., -12., 10.49], [-10., -12., 0.], [-10., 0., 0.]]);
    for i in 0..70_i16 {
        for j in 0..70_i16 {
            let at = |i: i16, j: i16| {
                let (x, y) = (f32::from(i) * 200. / 70. - 100., f32::from(j) * 200. / 70. - 100.);
                [x, y, ground(x, y)]
            };
            scene = scene.quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    for i in 0..25_i16 {
        let (x, y) = (f32::from((i * 37) % 170) - 85.0, f32::from((i * 61) % 170) - 85.0);
        let z = ground(x, y);
        if x.abs() < 20.0 && y.abs() < 32.0 {
            continue;
        }
        let (eaves, ridge) = (z + 5.0, z + 8.0);
        scene = scene
            .quad(wall(x, [y, y + 9.0], [z - 2.0, eaves]))
            .quad(wall(x + 8.0, [y, y + 9.0], [z - 2.0, eaves]))
            .quad([[x, y, eaves], [x, y + 9., eaves], [x + 4., y + 9., ridge], [x + 4., y, ridge]])
            .quad([
                [x + 8., y, eaves],
                [x + 8., y + 9., eaves],
                [x + 4., y + 9., ridge],
                [x + 4., y, ridge],
            ]);
    }
    for i in 0..30_i16 {
        let (x, y) = (f32::from((i * 53) % 150) - 75.0, f32::from((i * 29) % 150) - 75.0);
        if x.abs() < 20.0 && y.abs() < 32.0 {
            continue;
        }
        let at = |a: i16, b: i16| {
            let (theta, phi) = (
                f32::from(a) / 8. * std::f32::consts::PI,
                f32::from(b) / 8. * std::f32::consts::PI,
            );
            let level = 3.0 * libm::sinf(theta);
            let z = ground(x, y) + 6.0 + 4.0 * libm::cosf(theta);
            [x + level * libm::cosf(phi), y + level * libm::sinf(phi), z]
        };
        for a in 0..8 {
            for b in 0..16 {
                scene = scene.quad([at(a, b), at(a + 1, b), at(a + 1, b + 1), at(a, b + 1)]);
            }
        }
    }
    scene.site()
}

/// Suns of half a year as the paper has them, to a degree or two.
fn suns_of_half_a_year() -> Timeline {
    let mut suns = Vec::new();
    for day in (0..182).step_by(7) {
        let declination = 0.4093 * libm::sin(std::f64::consts::TAU * f64::from(day - 80) / 365.0);
        for quarter in 0..65 {
            let hour = (4.5 + 0.25 * f64::from(quarter) - 12.5) / 12.0 * std::f64::consts::PI;
            let latitude = 47.0_f64.to_radians();
            let up = libm::sin(latitude) * libm::sin(declination)
                + libm::cos(latitude) * libm::cos(declination) * libm::cos(hour);
            let east = -libm::cos(declination) * libm::sin(hour);
            let north = libm::cos(latitude) * libm::sin(declination)
                - libm::sin(latitude) * libm::cos(declination) * libm::cos(hour);
            if up > 0.0 {
                suns.push((DVec3::new(east, north, up), 100.0 + 325.0 * up.sqrt()));
            }
        }
    }
    timeline(&suns)
}

/// Processor time that this process has used, s: unlike the clock it doesn't see other programs.
pub fn processor_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<_> = stat.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    let ticks = |i: usize| fields.get(i).and_then(|f| f.parse::<f64>().ok()).unwrap_or(f64::NAN);
    (ticks(11) + ticks(12)) / 100.0
}

#[test]
#[ignore = "measures speed; run by hand, best in the release profile"]
fn speed() {
    let site = village();
    let timeline = suns_of_half_a_year();
    println!("{} triangles, {} suns", site.triangles.len(), timeline.steps.len());
    for model in [
        Model::PvGlass { index: 1.52, ggx_alpha: 0.02, cell_reflectance: 0.03 },
        Model::PvGlass { index: 1.52, ggx_alpha: 0.2, cell_reflectance: 0.03 },
        Model::Lambertian { reflectance: 0.25 },
        Model::Glass { index: 1.52 },
    ] {
        let scatter = bsdf(model.clone());
        let emission = Emission {
            site: &site,
            timeline: &timeline,
            bsdfs: vec![&scatter; 3],
            settings: settings(200_000),
        };
        let start = processor_s();
        let planned = plan(&emission, &Silent).expect("plan");
        let pilot_s = processor_s() - start;
        let start = processor_s();
        let none = Plan { emitted: 1, ..planned.clone() };
        run(&emission, &none, &mut Kept::default(), &Silent).expect("run");
        let set_up_s = processor_s() - start;
        let start = processor_s();
        let tally = run(&emission, &planned, &mut Kept::default(), &Silent).expect("run");
        let took_s = processor_s() - start - set_up_s;
        let sent = tally.sent.photons as f64;
        let share = |n: u64| 100.0 * n as f64 / sent;
        println!(
            "{model:?}: set up {set_up_s:.2} s, pilot {pilot_s:.2} s; a core emits {:.2} M/s and \
             stores {:.3} M/s; of {:.1} M: {:.1} % absorbed, {:.1} % not sampled, {:.2} % blocked, \
             {:.2} % on PV, {:.2} % stored, {:.2} % escaped, {:.2} % too far",
            sent / took_s / 1e6,
            tally.stored.photons as f64 / took_s / 1e6,
            sent / 1e6,
            share(tally.absorbed.photons),
            share(tally.not_sampled.photons),
            share(tally.blocked.photons),
            share(tally.on_pv.photons),
            share(tally.stored.photons),
            share(tally.escaped.photons),
            share(tally.too_far.photons),
        );
    }
}
