//! Weather at instants keeps what each hour holds.

use glintmap::sky::{
    DayRange, HourRange, Irradiance, Place, SunModel, TimeSpec, Weather, timeline,
};

use crate::support;

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
        sun: SunModel::Spa,
        irradiance: Irradiance::Epw(weather),
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
