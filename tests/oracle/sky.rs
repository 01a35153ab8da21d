//! Times and suns against the paper's count, Radiance's gensky, NREL's SPA and pvlib.

use std::process::Command;

use glam::DVec3;
use glintmap::base::{SpectralBasis, Timeline};
use glintmap::sky::{
    self, DayRange, Error, HourRange, Place, SunModel, SunStrength, TimeSpec, altitude_azimuth_deg,
    sun_direction, timeline,
};

use crate::support;

const CHURCH: Place =
    Place { latitude_deg: 47.038, longitude_deg: 8.312, meridian_deg: 15.0, elevation_m: 450.0 };

/// The paper's Table 3.
fn table_3(sun: SunModel) -> TimeSpec {
    TimeSpec {
        year: 2018,
        days: DayRange { from: 0, to: 181, step: 7 },
        hours: HourRange { from: 4.5, to: 20.5, step: 0.25 },
        finer: Vec::new(),
        sun,
        irradiance: sun.default_irradiance(),
        half_year: true,
    }
}

fn whole_year(year: i32, day_step: u32) -> TimeSpec {
    let last = sky::days_in_year(year) - 1;
    TimeSpec {
        year,
        days: DayRange { from: 0, to: last, step: day_step },
        hours: HourRange { from: 0.0, to: 23.75, step: 0.25 },
        finer: Vec::new(),
        sun: SunModel::Spa,
        irradiance: SunStrength::ClearSky,
        half_year: false,
    }
}

#[test]
fn table_3_has_the_papers_1280_suns() {
    let paper = timeline(&CHURCH, &table_3(SunModel::Gensky2018)).unwrap();
    assert_eq!(paper.steps.len(), 1280);
    assert_eq!(timeline(&CHURCH, &table_3(SunModel::Gensky)).unwrap().steps.len(), 1281);
    for (year, count) in [(2017, 1288), (2018, 1285), (2019, 1285), (2021, 1288), (2022, 1288)] {
        let spec = TimeSpec { year, ..table_3(SunModel::Spa) };
        assert_eq!(timeline(&CHURCH, &spec).unwrap().steps.len(), count, "{year}");
    }
    // Equation (1): 2 x 0.25 h x 7 d.
    assert!(paper.steps.iter().all(|s| s.weight_h == 3.5));
    assert_eq!(paper.basis, SpectralBasis::Visible);
    assert_eq!(paper.sun_diameter_deg, 0.5);
    // One segment a day: nights and skipped days lie between.
    assert_eq!(paper.segments().len(), 26);
    chronological(&paper);
}

fn chronological(timeline: &Timeline) {
    for pair in timeline.steps.windows(2) {
        let t = |i: usize| f64::from(pair[i].day) * 24.0 + pair[i].hour;
        assert!(t(1) > t(0));
        let next = (t(1) - t(0) - timeline.step_h).abs() < 1e-6;
        assert_eq!(pair[0].segment == pair[1].segment, next, "at {} h", t(0));
        assert!(pair[1].segment - pair[0].segment <= 1);
    }
    assert_eq!(timeline.steps[0].segment, 0);
    assert!(timeline.steps.iter().all(|s| s.sun.z > 0.0 && s.irradiance_w_m2 > 0.0));
}

#[test]
fn a_full_year_at_15_minutes_has_17_500_suns_and_all_its_days() {
    for (year, days) in [(2023, 365), (2024, 366)] {
        for step in [1, 7, 30] {
            let found = timeline(&CHURCH, &whole_year(year, step)).unwrap();
            chronological(&found);
            if step == 1 {
                assert!((17_500..17_700).contains(&found.steps.len()), "{}", found.steps.len());
            }
            let mut seen: Vec<(u32, f64)> =
                found.steps.iter().map(|s| (s.day, s.weight_h)).collect();
            seen.dedup();
            let sum_h: f64 = seen.iter().map(|(_, weight_h)| weight_h * 96.0).sum();
            assert!((sum_h - f64::from(days * 24)).abs() < 1e-6, "{year}/{step}: {sum_h} h");
        }
    }
}

#[test]
fn the_midnight_sun_is_one_segment() {
    let place = Place { latitude_deg: 78.2, longitude_deg: 15.6, ..CHURCH };
    let found = timeline(&place, &whole_year(2025, 1)).unwrap();
    chronological(&found);
    let longest = found.segments().iter().map(std::ops::Range::len).max().unwrap();
    assert!(longest > 110 * 96, "{longest} timesteps");
    // Steps that don't fill the day, or skipped days, do end a segment at midnight.
    let summer = TimeSpec {
        days: DayRange { from: 160, to: 169, step: 1 },
        hours: HourRange { from: 0.0, to: 23.0, step: 0.25 },
        ..whole_year(2025, 1)
    };
    assert_eq!(timeline(&place, &summer).unwrap().segments().len(), 10);
    let skipping = TimeSpec {
        days: DayRange { from: 160, to: 169, step: 2 },
        hours: HourRange { from: 0.0, to: 23.75, step: 0.25 },
        ..whole_year(2025, 1)
    };
    assert_eq!(timeline(&place, &skipping).unwrap().segments().len(), 5);
}

#[test]
fn impossible_times_and_places_are_named() {
    let spec = table_3(SunModel::Gensky2018);
    let late = TimeSpec { days: DayRange { from: 0, to: 183, step: 7 }, ..spec.clone() };
    assert!(matches!(timeline(&CHURCH, &late), Err(Error::HalfYear { to: 183, .. })));
    let last = TimeSpec { days: DayRange { from: 0, to: 182, step: 7 }, ..spec.clone() };
    assert!(timeline(&CHURCH, &last).is_ok());
    let beyond =
        TimeSpec { half_year: false, days: DayRange { from: 0, to: 365, step: 1 }, ..late };
    let refused = timeline(&CHURCH, &beyond).unwrap_err();
    assert_eq!(refused, Error::DaysOutside { year: 2018, last: 364, from: 0, to: 365 });
    let night = TimeSpec { hours: HourRange { from: 0.0, to: 3.0, step: 0.25 }, ..spec.clone() };
    assert!(matches!(timeline(&CHURCH, &night), Err(Error::Night { .. })));
    for bad in [f64::NAN, 91.0, -90.1] {
        let place = Place { latitude_deg: bad, ..CHURCH };
        assert!(matches!(timeline(&place, &spec), Err(Error::Place { field: "latitude", .. })));
    }
    for bad in [1582, 6000, i32::MAX, i32::MIN] {
        let spec = TimeSpec { year: bad, ..spec.clone() };
        assert_eq!(timeline(&CHURCH, &spec), Err(Error::Year(bad)));
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let spec = TimeSpec { irradiance: SunStrength::Constant(bad), ..spec.clone() };
        assert!(matches!(timeline(&CHURCH, &spec), Err(Error::Irradiance { .. })));
    }
    let mut linke = [3.0; 12];
    linke[4] = 0.5;
    let spec = TimeSpec { irradiance: SunStrength::Ineichen { linke }, ..spec };
    assert!(matches!(timeline(&CHURCH, &spec), Err(Error::Irradiance { .. })));
}

/// All 512 rows of NREL's spa.c. They hold the refracted zenith (1000 mbar, 10 degrees C); ours is
/// geometric, so the reference's refraction (Reda and Andreas 2004, equation 42) is added here.
#[test]
fn spa_agrees_with_nrel_to_0_0003_degrees() {
    let Some(path) = support::data("solar/spa_azimuth_zenith.csv") else { return };
    let mut rows = 0;
    let (mut worst_zenith, mut worst_azimuth) = (0.0_f64, 0.0_f64);
    for line in std::fs::read_to_string(path).unwrap().lines() {
        if line.starts_with('#') || line.trim().is_empty() {
            continue;
        }
        rows += 1;
        let fields: Vec<&str> = line.split(',').collect();
        let year: i32 = fields[0][..4].parse().unwrap();
        let day = sky::parse_day(&fields[0][5..10], year).unwrap();
        let part = |range: std::ops::Range<usize>| fields[0][range].parse::<f64>().unwrap();
        let utc_h = part(11..13) + part(14..16) / 60.0 + part(17..19) / 3600.0;
        let number = |i: usize| fields[i].parse::<f64>().unwrap();
        let place = Place {
            latitude_deg: number(1),
            longitude_deg: number(2),
            meridian_deg: 30.0,
            elevation_m: 0.0,
        };
        // Local standard time of the meridian, two hours ahead of UTC.
        let sun = sun_direction(&place, SunModel::Spa, year, day, utc_h + 2.0);
        let (altitude, azimuth) = altitude_azimuth_deg(sun);
        let refraction = if altitude >= -(0.26667 + 0.5667) {
            let phase = altitude + 10.3 / (altitude + 5.11);
            (1000.0 / 1010.0) * (283.0 / 283.0) * 1.02 / (60.0 * phase.to_radians().tan())
        } else {
            0.0
        };
        let zenith_off = (90.0 - altitude - refraction - number(4)).abs();
        let azimuth_off = (azimuth - number(3) + 540.0).rem_euclid(360.0) - 180.0;
        worst_zenith = worst_zenith.max(zenith_off);
        worst_azimuth = worst_azimuth.max(azimuth_off.abs());
        assert!(zenith_off < 0.0003, "{line}: zenith off by {zenith_off}");
        assert!(azimuth_off.abs() < 0.0003, "{line}: azimuth off by {azimuth_off}");
    }
    assert_eq!(rows, 512);
    eprintln!("worst: zenith {worst_zenith:.6}, azimuth {worst_azimuth:.6} degrees");
}

/// Radiance's own gensky, for the formulas of today; it prints the sun with six digits and its
/// radiance with three.
#[test]
fn gensky_agrees_with_radiance() {
    let Some(python) = support::python() else { return };
    let script = "
import os, subprocess, pyradiance
gensky = os.path.join(os.path.dirname(pyradiance.__file__), 'bin', 'gensky')
for month, day, doy in [(1, 1, 0), (3, 21, 79), (6, 11, 161), (6, 21, 171), (11, 5, 308), (12, 31, 364)]:
    for hour in ['9:00', '12:15', '15:45', '6:30']:
        out = subprocess.run([gensky, str(month), str(day), hour, '+s', '-a', '47.038', '-o', '-8.312', '-m', '-15'],
                             capture_output=True, text=True, check=True).stdout.split()
        if 'source' not in out: continue
        light = out[out.index('light') + 5]
        at = out.index('source')
        h, m = hour.split(':')
        print(doy, int(h) + int(m) / 60, *out[at + 5:at + 8], light)
";
    let out = Command::new(python).args(["-c", script]).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let mut rows = 0;
    for line in String::from_utf8(out.stdout).unwrap().lines() {
        rows += 1;
        let n: Vec<f64> = line.split(' ').map(|t| t.parse().unwrap()).collect();
        let day = n[0] as u32;
        let theirs = DVec3::new(n[2], n[3], n[4]);
        let spec = TimeSpec {
            days: DayRange { from: day, to: day, step: 1 },
            hours: HourRange { from: n[1], to: n[1], step: 1.0 },
            half_year: false,
            ..table_3(SunModel::Gensky)
        };
        let ours = timeline(&CHURCH, &spec).unwrap().steps[0];
        assert!((ours.sun - theirs).length() < 2e-6, "{line}: {}", ours.sun);
        let theirs_w_m2 = n[5] * 5.981e-5;
        let off = (ours.irradiance_w_m2 / theirs_w_m2 - 1.0).abs();
        assert!(off < 0.006, "{line}: {} and {theirs_w_m2} W/m2", ours.irradiance_w_m2);
    }
    assert!(rows >= 16, "gensky printed {rows} suns");
}

type Reference = (f64, f64, f64, i32, u32, f64, f64, f64, f64);

/// Latitude, longitude, elevation, year, day (from 0), UTC hour, Linke turbidity, and what pvlib
/// 0.16.1 says (`pip install pvlib`):
/// ```python
/// place = pvlib.location.Location(latitude, longitude, altitude=elevation)
/// times = pandas.DatetimeIndex([time])
/// sun = pvlib.solarposition.spa_python(times, latitude, longitude, altitude=elevation,
///     pressure=pvlib.atmosphere.alt2pres(elevation), delta_t=0.0)
/// dni = place.get_clearsky(times, model="ineichen", solar_position=sun, linke_turbidity=linke)["dni"]
/// print(sun["elevation"], dni)
/// ```
#[rustfmt::skip]
const PVLIB: [Reference; 12] = [
    (47.038, 8.312, 450.0, 2018, 171, 12.0, 3.0, 65.568086116, 916.654727272),
    (47.038, 8.312, 450.0, 2018, 171, 5.0, 3.0, 12.328609012, 507.227282699),
    (47.038, 8.312, 450.0, 2018, 354, 8.5, 3.0, 9.272486864, 429.144778545),
    (47.038, 8.312, 0.0, 2018, 79, 9.0, 3.0, 32.472724756, 815.184243253),
    (47.038, 8.312, 0.0, 2018, 79, 6.75, 2.0, 12.168309275, 751.243150599),
    (47.038, 8.312, 3500.0, 2018, 212, 10.0, 2.0, 55.217110426, 1131.144276795),
    (-33.9, 18.4, 10.0, 2024, 14, 8.0, 4.5, 49.403943897, 772.687645341),
    (-33.9, 18.4, 10.0, 2024, 196, 8.0, 3.0, 21.120218393, 666.318780152),
    (0.0, -78.5, 2850.0, 2023, 273, 17.0, 5.0, 86.599236410, 947.820515179),
    (64.1, -21.9, 30.0, 2025, 171, 22.0, 2.5, 6.496091792, 367.341476815),
    (51.9, 4.47, -3.0, 2025, 58, 16.0, 7.0, 10.807401125, 70.983963568),
    (47.038, 8.312, 450.0, 2018, 171, 4.0, 3.0, 3.186586657, 103.261948092),
];

#[test]
fn the_clear_sky_is_pvlibs() {
    for row in PVLIB {
        let (latitude_deg, longitude_deg, elevation_m, year, day, hour, linke, altitude, dni) = row;
        let place = Place { latitude_deg, longitude_deg, meridian_deg: 0.0, elevation_m };
        let mut spec = TimeSpec {
            year,
            days: DayRange { from: day, to: day, step: 1 },
            hours: HourRange { from: hour, to: hour, step: 1.0 },
            finer: Vec::new(),
            sun: SunModel::Spa,
            irradiance: SunStrength::Ineichen { linke: [linke; 12] },
            half_year: false,
        };
        let found = timeline(&place, &spec).unwrap();
        let step = found.steps[0];
        assert!((altitude_azimuth_deg(step.sun).0 - altitude).abs() < 1e-4, "{row:?}");
        assert!((step.irradiance_w_m2 / dni - 1.0).abs() < 5e-5, "{row:?}: {step:?}");
        assert_eq!((found.basis, found.sun_diameter_deg), (SpectralBasis::Broadband, 0.533));
        if linke == 3.0 {
            spec.irradiance = SunStrength::ClearSky;
            assert_eq!(timeline(&place, &spec).unwrap().steps[0], step);
        }
    }
}

#[test]
fn constant_suns_are_constant() {
    let spec = TimeSpec { irradiance: SunStrength::Constant(1000.0), ..table_3(SunModel::Spa) };
    let found = timeline(&CHURCH, &spec).unwrap();
    assert!(found.steps.iter().all(|s| s.irradiance_w_m2 == 1000.0));
    assert_eq!(found.basis, SpectralBasis::Broadband);
}

/// The command, as its users start it.
#[test]
fn the_command_prints_what_the_handbook_says() {
    let run = |words: &[&str]| {
        let out = Command::new(env!("CARGO_BIN_EXE_glintmap")).arg("suns").args(words).output();
        let out = out.unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (out.status.code(), text(out.stdout), text(out.stderr))
    };
    let site = ["--latitude", "47.038", "--longitude", "8.312", "--meridian", "15"];
    let table = ["--days", "01-01:07-01:7", "--hours", "4.5:20.5:0.25", "--sun", "gensky-2018"];
    let all: Vec<&str> = site.into_iter().chain(table).chain(["--half-year"]).collect();
    let (code, csv, error) = run(&all);
    assert_eq!((code, error.as_str()), (Some(0), ""));
    assert_eq!(csv.lines().count(), 1281);
    assert_eq!(
        csv.lines().nth(1),
        Some("0,0,8.500000,1.551823,126.991859,0.798428,-0.601481,0.027081,98.451570,3.500000")
    );
    let json: Vec<&str> = all.iter().copied().chain(["--json"]).collect();
    let (_, document, _) = run(&json);
    let document: serde_json::Value = serde_json::from_str(&document).unwrap();
    assert_eq!(document["timesteps"].as_array().unwrap().len(), 1280);
    assert_eq!(document["basis"], "visible");

    let refused = |extra: [&str; 2], words: &[&str]| {
        let (code, out, error) = run(&[&site[..], &extra[..]].concat());
        assert_eq!((code, out.as_str()), (Some(2), ""), "{extra:?}: {error}");
        for word in words {
            assert!(error.contains(word), "{extra:?}: `{word}` is missing in: {error}");
        }
    };
    refused(["--days", "0:365:1"], &["0 to 364", "found 0 to 365"]);
    refused(["--days", "02-30:07-01:1"], &["02-30"]);
    refused(["--days", "0:181"], &["A:B:STEP", "`0:181`"]);
    refused(["--hours", "0:24:0.25"], &["24 - S"]);
    refused(["--hours", "0:2:0.25"], &["below the horizon", "EAST"]);
    refused(["--sun", "grena"], &["gensky-2018"]);
    refused(["--elevation", "14700"], &["-500 to 9000 m", "14700"]);
}
