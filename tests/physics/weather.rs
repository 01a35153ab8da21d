//! Weather at instants keeps what each hour holds.

use glintmap::sky::{
    DayRange, HourRange, Place, SunModel, SunStrength, TimeSpec, Weather, timeline,
};

use crate::support;

fn epw(head: &str, rows: impl Iterator<Item = String>) -> Weather {
    let text = format!(
        "LOCATION,Here,-,-,-,-,47.0,8.0,1,400\n{head}\n{}",
        rows.collect::<Vec<_>>().join("\n")
    );
    Weather::parse(&text, "w.epw").expect("good weather")
}

fn row(month: u32, day: u32, hour: u32, minute: u32, direct: f64) -> String {
    format!("2020,{month},{day},{hour},{minute},?,1,1,1,1,0,0,0,0,{direct},0,0")
}

const HERE: Place =
    Place { latitude_deg: 47.0, longitude_deg: 8.0, meridian_deg: 15.0, elevation_m: 400.0 };

fn days(year: i32, from: u32, to: u32, hours: HourRange, weather: Weather) -> TimeSpec {
    let days = DayRange { from, to, step: 1 };
    let irradiance = SunStrength::Epw(weather);
    TimeSpec {
        year,
        days,
        hours,
        finer: Vec::new(),
        sun: SunModel::Spa,
        irradiance,
        half_year: false,
    }
}

#[test]
fn records_shorter_than_an_hour_hold_their_own_quarter() {
    let head = "DATA PERIODS,1,4,Data,Sunday,6/1,6/1";
    let quarters = (1..=24).flat_map(|hour| {
        // The last of an hour as minute 60, or as minute 0.
        [15, 30, 45, if hour % 2 == 0 { 60 } else { 0 }].map(|minute| {
            let nth = if minute == 0 { 4 } else { minute / 15 };
            let direct = if hour == 13 { 100.0 * f64::from(nth) } else { 500.0 };
            row(6, 1, hour, minute, direct)
        })
    });
    let weather = epw(head, quarters);
    assert_eq!(weather.per_hour, 4);
    let hours = HourRange { from: 12.125, to: 12.9, step: 0.25 };
    let steps = timeline(&HERE, &days(2025, 151, 151, hours, weather)).expect("noon").steps;
    let seen: Vec<f64> = steps.iter().map(|s| (s.irradiance_w_m2 / 10.0).round()).collect();
    assert_eq!(seen, [10.0, 20.0, 30.0, 40.0]);
}

#[test]
fn leap_days_are_taken_from_the_file_or_from_the_day_before() {
    let head = "DATA PERIODS,1,1,Data,Sunday,2/28,3/1";
    let of = |dates: &[(u32, u32, f64)]| {
        let dates = dates.to_vec();
        epw(
            head,
            dates.into_iter().flat_map(|(m, d, v)| (1..=24).map(move |h| row(m, d, h, 60, v))),
        )
    };
    let noon = HourRange { from: 12.5, to: 12.5, step: 1.0 };
    let seen = |year, from, to, weather| {
        let line = timeline(&HERE, &days(year, from, to, noon, weather))?;
        Ok::<_, glintmap::sky::Error>(
            line.steps
                .iter()
                .map(|s| (s.irradiance_w_m2 / 10.0).round() * 10.0)
                .collect::<Vec<_>>(),
        )
    };
    let with = of(&[(2, 28, 200.0), (2, 29, 400.0), (3, 1, 600.0)]);
    let without = of(&[(2, 28, 200.0), (3, 1, 600.0)]);
    // 28 February is day 58.
    assert_eq!(seen(2024, 58, 60, with.clone()).unwrap(), [200.0, 400.0, 600.0]);
    assert_eq!(seen(2024, 58, 60, without.clone()).unwrap(), [200.0, 200.0, 600.0]);
    assert_eq!(seen(2025, 58, 59, with).unwrap(), [200.0, 600.0]);
    let error = seen(2025, 57, 59, without).expect_err("27 February is missing").to_string();
    assert!(error.contains("02-27"), "{error}");
}

#[test]
fn instants_of_pvgis_are_utcs() {
    let Some(path) = support::data("weather/pvgis_tmy_45_8.epw") else { return };
    let weather = Weather::read(&path).expect("complete");
    assert_eq!(weather.instant_offset_h, Some(-0.8239));
    let place =
        Place { latitude_deg: 45.0, longitude_deg: 8.0, meridian_deg: 15.0, elevation_m: 250.0 };
    let text = std::fs::read_to_string(&path).unwrap();
    let records: Vec<(f64, f64)> = text
        .lines()
        .skip(8)
        .map(|l| l.split(',').map(|w| w.parse().unwrap_or(0.0)).collect::<Vec<f64>>())
        .map(|r| (r[13], r[14]))
        .collect();
    // Global irradiance under a sun that is down, or none under one that is up: the reading is
    // wrong. At -0.8239 h of UTC there is none of the first, in local time or an hour later many.
    let off = |shift_h: f64| {
        let lit = |i: usize| {
            let local_h = (i % 24) as f64 + 1.0 + shift_h + 1.0;
            let sun =
                glintmap::sky::sun_direction(&place, SunModel::Spa, 2025, i as u32 / 24, local_h);
            sun.z.asin().to_degrees()
        };
        let wrong = |(i, r): (usize, &(f64, f64))| {
            (r.0 > 0.0 && lit(i) < -0.5) || (r.0 <= 0.0 && lit(i) > 3.0)
        };
        records.iter().enumerate().filter(|&x| wrong(x)).count()
    };
    let (right, local, later) = (off(-0.8239), off(-1.8239), off(-0.5));
    assert!(right < 80, "{right}");
    assert!(local > 300 && later > 2 * right, "{right} {local} {later}");
    // At the instants themselves the file's values come out: 11:10:34 UTC on 21 June.
    let hour = 12.0 - 0.8239 + 1.0;
    let hours = HourRange { from: hour, to: hour + 0.5, step: 1.0 };
    let steps =
        timeline(&place, &days(2025, 171, 171, hours, weather.clone())).expect("noon").steps;
    assert!((steps[0].irradiance_w_m2 - 804.04).abs() < 1.0, "{}", steps[0].irradiance_w_m2);
    // Halfway between two of them it lies between.
    let hours = HourRange { from: hour + 2.5, to: hour + 3.0, step: 1.0 };
    let steps = timeline(&place, &days(2025, 171, 171, hours, weather)).expect("noon").steps;
    assert!((127.5..725.8).contains(&steps[0].irradiance_w_m2), "{}", steps[0].irradiance_w_m2);
}

#[test]
fn an_hours_mean_is_kept_whatever_the_step() {
    let Some(path) = support::data("weather/DEU_NW_Aachen.105010_TMYx.epw") else { return };
    let weather = Weather::read(&path).expect("complete");
    let place =
        Place { latitude_deg: 50.8, longitude_deg: 6.02, meridian_deg: 15.0, elevation_m: 232.0 };
    let spec = TimeSpec {
        year: 2024,
        days: DayRange { from: 100, to: 100, step: 1 },
        hours: HourRange { from: 1.0 / 120.0, to: 23.99, step: 1.0 / 60.0 },
        finer: Vec::new(),
        sun: SunModel::Spa,
        irradiance: SunStrength::Epw(weather),
        half_year: false,
    };
    let fine = timeline(&place, &spec).expect("a day");
    let text = std::fs::read_to_string(&path).unwrap();
    // Day 100 of 2024 is 10 April.
    let rows = text.lines().skip(8).map(|l| l.split(',').collect::<Vec<_>>());
    let mut compared = 0;
    for row in rows.filter(|r| r[1] == "4" && r[2] == "10") {
        let hour: f64 = row[3].parse().unwrap();
        let direct: f64 = row[14].parse().unwrap();
        let within = |h: f64| h > hour - 1.0 && h < hour;
        let steps: Vec<_> = fine.steps.iter().filter(|s| within(s.hour)).collect();
        // Hours that the sun rises or sets in are coarser than twelve instants.
        if steps.len() < 60 {
            continue;
        }
        let mean = steps.iter().map(|s| s.irradiance_w_m2).sum::<f64>() / 60.0;
        assert!((mean - direct).abs() <= 0.005 * direct + 1e-9, "hour {hour}: {mean}, {direct}");
        compared += usize::from(direct > 0.0);
    }
    assert!(compared >= 5, "{compared} hours of sun");
    let elsewhere = Place { meridian_deg: 0.0, ..place };
    let error = timeline(&elsewhere, &spec).expect_err("another standard time").to_string();
    assert!(error.contains("meridian"), "{error}");
}
