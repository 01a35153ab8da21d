//! Figures against what a reader expects to find on them.

use std::path::Path;

use glintmap::base::Grid;
use glintmap::picture::figure::{AxisLabel, Marker, Polyline};
use glintmap::picture::scale::{nice_ceiling, percentile};
use glintmap::picture::{Figure, Rgb, Scale, compose, png};

/// A hill with houses under a low sun, and a lobe of light west of its middle.
fn plan(edge: usize) -> (Rgb, Grid<f32>) {
    let e = edge as f64;
    let height = |x: f64, y: f64| {
        let hill = 30.0 * libm::exp(-((x - 0.3).powi(2) + (y - 0.4).powi(2)) / 0.08);
        let waves = 3.0 * libm::sin(x * 19.0) * libm::cos(y * 13.0);
        let house =
            |cx: f64, cy: f64| f64::from((x - cx).abs() < 0.03 && (y - cy).abs() < 0.04) * 0.5;
        hill + waves
            + 8.0 * (house(0.5, 0.5) + house(0.2, 0.45) + house(0.7, 0.3) + house(0.65, 0.75))
    };
    let mut background = Grid::filled(edge, edge, [0.0f32; 3]);
    let mut data = Grid::filled(edge, edge, 0.0f32);
    for row in 0..edge {
        for column in 0..edge {
            let (x, y) = ((column as f64 + 0.5) / e, (row as f64 + 0.5) / e);
            let d = 0.004;
            let (gx, gy) = (height(x + d, y) - height(x, y), height(x, y + d) - height(x, y));
            let shade = (1.0 - 0.5 * gx - 0.4 * gy).clamp(0.1, 2.2);
            background[(column, row)] =
                [shade as f32 * 40.0, shade as f32 * 38.0, shade as f32 * 30.0];
            let (dx, dy) = (x - 0.5, y - 0.5);
            let distance = (dx * dx + dy * dy).sqrt();
            if !(0.06..0.49).contains(&distance) {
                continue;
            }
            let angle = libm::atan2(dy, -dx);
            let lobe = 4000.0
                * libm::exp(-(angle / 0.25).powi(2))
                * libm::exp(-((distance - 0.2) / 0.1).powi(2));
            let wide = 30.0 / (0.05 + distance) * (1.0 + libm::cos(angle));
            data[(column, row)] = (lobe + wide * 0.2) as f32;
        }
    }
    (background, data)
}

fn panorama() -> (Rgb, Grid<f32>) {
    let (columns, rows) = (500, 125);
    let mut background = Grid::filled(columns, rows, [0.0f32; 3]);
    let mut data = Grid::filled(columns, rows, 0.0f32);
    for row in 0..rows {
        for column in 0..columns {
            let (x, y) = (column as f64 / columns as f64, row as f64 / rows as f64);
            let skyline = 0.5 + 0.06 * libm::sin(x * 40.0) + 0.04 * libm::sin(x * 91.0);
            if y < skyline {
                background[(column, row)] = [3.0 + y as f32, 3.5 + y as f32, 5.0];
                continue;
            }
            let ground = 0.6 + 0.3 * libm::sin(x * 130.0).abs() + (y - skyline);
            background[(column, row)] = [ground as f32; 3];
            let spot = libm::exp(-((x - 0.74) / 0.03).powi(2) - ((y - 0.6) / 0.07).powi(2));
            let value = 3000.0 * spot + 12.0 * (1.0 - y);
            data[(column, row)] = if value > 6.0 { value as f32 } else { 0.0 };
        }
    }
    (background, data)
}

fn plan_figure<'a>(background: &'a Rgb, data: &'a Grid<f32>, edge: f64) -> Figure<'a> {
    let max = nice_ceiling(percentile([data], 0.999));
    let mut figure = Figure::new(data, Scale::logarithmic(max, 3.0, "Wh/m²"));
    figure.title = "Annual irradiation reflected by the PV — standard glass".into();
    figure.subtitle = "St. Michael, plan view 200 × 200 m, 1280 suns".into();
    figure.background = Some(background);
    figure.legend = "Irradiation from the PV in a year".into();
    figure.bare = "nothing arrives within 100 m".into();
    figure.caption = vec![
        "Radiance's visible watts (about half of the full spectrum). Background: direct sunlight, for orientation only.".into(),
        "glintmap 0.1.0 · settings 3f2a91c0 · seed 1".into(),
    ];
    figure.watermark = Some("draft, not for assessment".into());
    figure.metres_per_pixel = Some(200.0 / edge);
    figure.north_deg = Some(0.0);
    figure.markers = [
        ("Chalet", 0.18, 0.47),
        ("Open house", 0.2, 0.56),
        ("Street", 0.66, 0.77),
        ("Tower", 0.97, 0.3),
    ]
    .map(|(label, x, y)| Marker { at: [x * edge, y * edge], label: label.into() })
    .to_vec();
    let roof = [[0.47, 0.46], [0.53, 0.46], [0.53, 0.54], [0.47, 0.54], [0.47, 0.46]];
    figure.polylines = vec![Polyline {
        points: roof.map(|[x, y]| [x * edge, y * edge]).to_vec(),
        color: [0x2b, 0xd9, 0xe8],
        width: 1.0,
        label: "PV".into(),
    }];
    figure
}

fn look(name: &str, figure: &Figure<'_>) -> Grid<[u8; 3]> {
    let picture = figure.draw().expect("draws");
    if let Some(folder) = std::env::var_os("GLINTMAP_LOOK") {
        let path = Path::new(&folder).join(name);
        png::write(&path, &picture, &[]).expect("writes");
    }
    picture
}

#[test]
fn figures_show_what_they_should_at_every_size() {
    let (background, data) = plan(250);
    let figure = plan_figure(&background, &data, 250.0);
    let picture = look("plan.png", &figure);
    assert!(picture == look("plan.png", &figure), "drawn twice, two pictures");
    // The picture is enlarged four times; its colours are those of the scale over the grey.
    assert!((1100..1400).contains(&picture.columns()), "{} wide", picture.columns());
    let plain = Figure { watermark: None, markers: vec![], opacity: 1.0, ..figure.clone() };
    let sheet = plain.draw().expect("draws");
    let expected = figure.scale.color(f64::from(data[(60, 125)]));
    let same = sheet.data().iter().filter(|c| **c == expected).count();
    assert!(same >= 16, "{same} dots in the colour of one pixel");
    let marked = sheet.data().iter().zip(picture.data()).filter(|(a, b)| a != b).count();
    assert!(marked > 10_000, "watermark and markers change {marked} dots");

    let mut linear = plan_figure(&background, &data, 250.0);
    linear.scale = Scale::linear(3.0, "h");
    let hours = data.map(|v| if *v > 100.0 { (v / 100.0).floor() * 0.25 } else { 0.0 });
    linear.data = &hours;
    linear.title = "Longest glare at a stretch".into();
    linear.watermark = None;
    linear.extrema = true;
    look("linear.png", &linear);

    let old = data.map(|v| if *v > 0.0 { 25.0 + v * 0.1 } else { 0.0 });
    let ratio = compose::ratio(&data, &old).expect("one size");
    let mut figure = plan_figure(&background, &ratio, 250.0);
    figure.scale = Scale::ratio(nice_ceiling(percentile([&ratio], 0.995)).max(2.0));
    figure.title = "Reflection of the standard module against today's roof tile".into();
    figure.legend = "Irradiation, new : old".into();
    figure.bare = "no reflection, new or old".into();
    look("ratio.png", &figure);

    let (background, data) = panorama();
    let mut figure = Figure::new(&data, Scale::logarithmic(3000.0, 3.0, "Wh/m²"));
    figure.title = "Annual irradiation reflected by the PV — standard glass".into();
    figure.subtitle = "St. Michael, panorama from the church roof".into();
    figure.background = Some(&background);
    figure.legend = "Irradiation from the PV in a year".into();
    figure.bare = "nothing arrives".into();
    figure.axis =
        ["N", "30°", "60°", "E", "120°", "150°", "S", "210°", "240°", "W", "300°", "330°", "N"]
            .iter()
            .enumerate()
            .map(|(at, l)| AxisLabel {
                column: at as f64 * 500.0 / 12.0,
                label: (*l).into(),
                major: l.len() == 1,
            })
            .collect();
    figure.polylines = (0..5)
        .map(|i| Polyline {
            points: (0..=40)
                .map(|at| {
                    [
                        100.0 + 7.5 * f64::from(at),
                        62.0 - (20.0 + 9.0 * f64::from(i))
                            * libm::sin(f64::from(at) / 40.0 * std::f64::consts::PI),
                    ]
                })
                .collect(),
            color: [255, 214, 90],
            width: 0.6,
            label: if i == 4 { "21 June".into() } else { String::new() },
        })
        .collect();
    figure.markers = vec![Marker { at: [368.0, 72.0], label: "Chalet".into() }];
    figure.watermark = Some("draft, not for assessment".into());
    look("panorama.png", &figure);

    let (background, data) = plan(8);
    look("tiny.png", &plan_figure(&background, &data, 8.0));
    let strip = Grid::filled(3, 400, 2.0f32);
    look("strip.png", &Figure { background: None, ..plan_figure(&background, &strip, 3.0) });
    let (background, data) = plan(1200);
    let mut figure = plan_figure(&background, &data, 1200.0);
    figure.title = "A title that is much too long for one line because a consultant wished to put everything into it, from the project's name to the date of the meeting".into();
    look("large.png", &figure);
}
