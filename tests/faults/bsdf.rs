//! Broken BSDF and weather files: refused by line, never a panic.

use std::time::Duration;

use glam::DVec3;
use glintmap::base::{Purpose, Stream};
use glintmap::bsdf::{BsdfFile, Goniophotometer, Interpolation, Side, Way};
use glintmap::sky::Weather;

use super::site_formats::fuzz::{damage, executions};

use crate::physics::bsdf_files::file;
use crate::support::{self, cpu_time};

const SQUARE: &str = "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>";

#[test]
fn broken_files_say_where_and_what() {
    let quarter = "<ColumnAngleBasis>LBNL/Klems Quarter</ColumnAngleBasis><RowAngleBasis>LBNL/Klems Quarter</RowAngleBasis>";
    let deep = format!("{}0{}", "{".repeat(40), "}".repeat(40));
    for (text, expected) in [
        (String::new(), "XML"),
        ("<a/>".into(), "WindowElement"),
        ("<WindowElement/>".into(), "Optical"),
        (file("Diagonal", SQUARE, "1"), "Columns, Rows, TensorTree3 or TensorTree4"),
        (file("Columns", SQUARE, "1"), "ColumnAngleBasis"),
        (file("Columns", quarter, "1 2 3"), "1681 numbers"),
        (file("Columns", quarter, &"0.1 ".repeat(1682)), "the end after 1681"),
        (file("Columns", quarter, &"0.1,,".repeat(1681)), "a number"),
        (file("Columns", quarter, &"nan ".repeat(1681)), "a number"),
        (file("TensorTree3", "", "{1}"), "LBNL/Shirley-Chiu"),
        (file("TensorTree3", SQUARE, ""), "`{`"),
        (file("TensorTree3", SQUARE, "{ 1 2 3 }"), "numbers between braces"),
        (file("TensorTree4", SQUARE, "{ 1 1 1 1 1 1 1 1 }"), "numbers between braces"),
        (file("TensorTree3", SQUARE, "{ 1"), "`}`"),
        (file("TensorTree3", SQUARE, "{ 1e99 }"), "a number up to"),
        (file("TensorTree3", SQUARE, &deep), "levels"),
        (file("TensorTree3", SQUARE, "{ 0.1 } 2"), "the end of the tree"),
    ] {
        let error = BsdfFile::parse(&text, "x.xml").expect_err(expected).to_string();
        assert!(error.contains(expected) && error.contains("x.xml"), "{expected}: {error}");
    }
}

#[test]
fn a_side_that_a_file_lacks_is_named() {
    let good = BsdfFile::parse(&file("TensorTree3", SQUARE, "{ 0.1 }"), "x.xml").unwrap();
    let error = good.reflection(Side::Back, None).expect_err("only one side").to_string();
    assert!(error.contains("Reflection Front") && error.contains("Reflection Back"), "{error}");
    let led = format!("Created by a program\nof ours\n{}", file("TensorTree3", SQUARE, "{ 0.1 }"));
    let led = BsdfFile::parse(&led, "x.xml").unwrap();
    assert!(led.notes.iter().any(|n| n.contains("before the XML")), "{:?}", led.notes);
}

#[test]
fn cut_and_mangled_files_never_panic() {
    let good =
        file("TensorTree3", SQUARE, "{ {0.1}{0.1 0.2 0.1 0.1 0 0 0 0}{0}{0}{0}{0}{0}{1e-3} }");
    BsdfFile::parse(&good, "x.xml").expect("good as it is");
    for cut in 0..good.len() {
        let _ = BsdfFile::parse(&good[..cut], "x.xml");
        for with in ["{", "}", "<", "-", "9", ",", "\u{e9}"] {
            let mut text = good.clone();
            text.replace_range(cut..cut + 1, with);
            let _ = BsdfFile::parse(&text, "x.xml");
        }
    }
}

const HEAD: &str = "LOCATION,Here,-,-,-,-,47.0,8.0,1,400\nDATA PERIODS,1,1,Data,Sunday,1/1,12/31\n";

fn row(month: u32, day: u32, hour: u32, direct: &str) -> String {
    format!("2020,{month},{day},{hour},60,?,1,1,1,1,0,0,0,0,{direct},0,0\n")
}

/// All hours of a day.
fn whole_day(month: u32, day: u32) -> String {
    (1..=24).map(|hour| row(month, day, hour, "10.5")).collect()
}

#[test]
fn weather_is_read_or_refused_by_line() {
    assert!(Weather::parse(&format!("{HEAD}{}", whole_day(2, 29)), "w.epw").is_ok());
    for (text, expected) in [
        (String::new(), "w.epw:1: header"),
        (HEAD.to_owned(), "at least one record"),
        (format!("{HEAD}{}", row(6, 1, 12, "9999")), "w.epw:3: direct normal irradiance"),
        (format!("{HEAD}{}{}", row(6, 1, 12, "1"), row(6, 1, 12, "1")), "w.epw:4: date"),
        (format!("{HEAD}{}", row(6, 31, 12, "1")), "month and day"),
        (format!("{HEAD}{}", row(6, 1, 25, "1")), "1 to 24"),
        (format!("{HEAD}{}", row(6, 1, 12, "-5")), "0 to 1500"),
        (format!("{HEAD}1,2,3\n"), "15 comma-separated fields"),
        (HEAD.replace("47.0", "97.0"), "latitude"),
        (format!("{HEAD}{}{}", whole_day(6, 1), row(6, 2, 1, "1")), "1 of 06-02"),
        (format!("{HEAD}{}", row(6, 1, 1, "1").replace(",60,", ",61,")), "0 to 60"),
        (HEAD.replace("1,1,Data", "1,7,Data"), "a divisor of 60"),
        (format!("COMMENTS\n{HEAD}"), "LOCATION"),
        (
            format!("{HEAD}{}", whole_day(6, 1))
                .replace("PERIODS,1,1", "PERIODS,1,4")
                .replace(",60,", ",20,"),
            "the end of a record, 4 an hour",
        ),
        (
            HEAD.replace("DATA", "COMMENTS 2,Irradiance Time Offset (h):x\nDATA"),
            "Irradiance Time Offset",
        ),
    ] {
        let error = Weather::parse(&text, "w.epw").expect_err(expected).to_string();
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

#[test]
fn real_weather_is_read_or_refused_for_the_missing_values() {
    for (name, zone_h) in
        [("weather/DEU_NW_Aachen.105010_TMYx.epw", 1.0), ("weather/pvgis_tmy_45_8.epw", 1.0)]
    {
        let Some(path) = support::data(name) else { return };
        assert_eq!(Weather::read(&path).expect("complete").zone_h, zone_h);
    }
    let Some(path) = support::data("weather/LAUSANNE_20230901_20230911_partial.epw") else {
        return;
    };
    let error = Weather::read(&path).expect_err("missing values").to_string();
    assert!(error.contains(":9: direct normal irradiance") && error.contains("9999"), "{error}");
}

#[test]
fn comments_stand_among_numbers_and_a_missing_way_is_filled_in() {
    let numbers: Vec<String> =
        (0..1681).map(|i| format!("{:.4}", 1e-4 * f64::from(i % 97))).collect();
    let quarter = "<ColumnAngleBasis>LBNL/Klems Quarter</ColumnAngleBasis><RowAngleBasis>LBNL/Klems Quarter</RowAngleBasis>";
    let plain = file("Columns", quarter, &numbers.join(", "));
    let told = plain.replacen("0.0003,", "0.0003,<!-- 5 6 -->\n", 2);
    let a = BsdfFile::parse(&plain, "x.xml").unwrap();
    let b = BsdfFile::parse(&told, "x.xml").unwrap();
    assert_eq!(a.blocks, b.blocks);
    let error = BsdfFile::parse(&told.replace("0.0050, 0.0051", "0.0050, oh"), "x.xml");
    // Behind two comments, each with a line of its own.
    let error = error.expect_err("no number").to_string();
    assert!(error.contains("x.xml:3: ") || error.contains("x.xml:4: "), "{error}");
    let error = BsdfFile::parse(&told.replacen("<!-- 5 6 -->", "<b/>", 1), "x.xml");
    assert!(error.expect_err("an element").to_string().contains("elements among them"));
    // Transmission from the back is the one from the front, read backwards.
    let front = plain.replace("Reflection Back", "Transmission Front");
    let through = BsdfFile::parse(&front, "x.xml").unwrap();
    let block = through.blocks.iter().find(|b| b.way == Way::TransmissionBack).expect("filled in");
    assert!(block.reciprocal && through.notes.iter().any(|n| n.contains("reciprocity")));
}

const GONIO: &str = "#sample_name \"x\"\n#colorimetry: CIE-Y\n#format: theta phi BSDF\n#intheta 30\n#inphi 0\n10 0 0.1\n30 180 2.5\n40 90 0.2\n60 180 0.3\n70 10 0.05\n100 20 7\n#intheta 60\n#inphi 0\n60 180 5\n20, 30, 0.1\n80 170 0.4\n";

#[test]
fn goniophotometer_data_are_read_or_refused_by_line() {
    let good = Goniophotometer::parse(GONIO, "g.txt").expect("good");
    assert_eq!(good.incidents.len(), 2);
    assert_eq!(good.incidents[0].points.len(), 5);
    assert!(good.is_isotropic());
    assert!(good.notes.iter().any(|n| n.contains("1 transmitted")), "{:?}", good.notes);
    let dsf = Goniophotometer::parse(&GONIO.replace("BSDF", "DSF"), "g.txt").unwrap();
    let (a, b) = (good.incidents[0].points[3], dsf.incidents[0].points[3]);
    assert!((b.1 / a.1 - 2.0).abs() < 1e-6, "60 degrees: DSF is half of BSDF");
    let other = GONIO.replacen("#inphi 0\n60", "#inphi 45\n60", 1);
    assert!(!Goniophotometer::parse(&other, "g.txt").unwrap().is_isotropic());
    for (text, expected) in [
        (String::new(), "no reflected direction"),
        (GONIO.replace("#intheta 30\n", ""), "g.txt:5: header: expected `#intheta`"),
        (GONIO.replace("#format: theta phi BSDF\n", ""), "#format: theta phi BSDF"),
        (GONIO.replace("theta phi BSDF", "theta phi gloss"), "BSDF, BRDF, BTDF or DSF"),
        (GONIO.replace("#intheta 30", "#intheta 95"), "degrees from 0 to 90"),
        (GONIO.replace("CIE-Y", "spectral"), "CIE-Y or CIE-XYZ"),
        (GONIO.replace("40 90 0.2", "40 90"), "g.txt:8: data"),
        (GONIO.replace("40 90 0.2", "40 90 0.2 7"), "g.txt:8: data"),
        (GONIO.replace("40 90 0.2", "40 90 nan"), "g.txt:8: data"),
        (GONIO.replace("40 90 0.2", "240 90 1"), "theta from 0 to 180"),
        (GONIO.replace("40 90 0.2", "40 90 1e12"), "1/sr"),
    ] {
        let error = Goniophotometer::parse(&text, "g.txt").expect_err(expected).to_string();
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

/// Damaged BSDFs, weather and goniophotometer data: an error or an answer in its bounds, at once.
/// `GLINTMAP_FUZZ=1000000` for the long run.
#[test]
fn damaged_bsdfs_weather_and_points_never_panic() {
    let quarter = "<ColumnAngleBasis>LBNL/Klems Quarter</ColumnAngleBasis><RowAngleBasis>LBNL/Klems Quarter</RowAngleBasis>";
    let own = "<ColumnAngleBasis>own</ColumnAngleBasis><RowAngleBasis>own</RowAngleBasis>";
    let ring = |low, high, n| {
        format!(
            "<AngleBasisBlock><ThetaBounds><LowerTheta>{low}</LowerTheta><UpperTheta>{high}</UpperTheta></ThetaBounds><nPhis>{n}</nPhis></AngleBasisBlock>"
        )
    };
    let defined = format!(
        "</IncidentDataStructure><AngleBasis><AngleBasisName>own</AngleBasisName>{}{}</AngleBasis>",
        ring(0, 30, 1),
        ring(30, 90, 4)
    );
    let seeds: Vec<(&str, String)> = vec![
        ("xml", file("Columns", quarter, &"0.1 ".repeat(1681))),
        (
            "xml",
            file("Rows", own, &"0.1,\t".repeat(25)).replace("</IncidentDataStructure>", &defined),
        ),
        (
            "xml",
            file(
                "TensorTree3",
                SQUARE,
                "{ {0.1}{0.1 0.2 0.1 0.1 0 0 0 0}{0}{{1}{2}{3}{4}{5}{6}{7}{8}}{0}{0}{0}{1e-3} }",
            ),
        ),
        (
            "xml",
            file(
                "TensorTree4",
                SQUARE,
                &format!("{{ {} {{ {} }} }}", "{0.1}".repeat(15), "0.2 ".repeat(16)),
            ),
        ),
        ("epw", format!("{HEAD}{}", whole_day(6, 1))),
        (
            "epw",
            format!("{HEAD}{}", whole_day(2, 29))
                .replace("DATA", "COMMENTS 2,Irradiance Time Offset (h):-0.8\nDATA"),
        ),
        ("txt", GONIO.to_owned()),
    ];
    let (mut read, mut refused) = (0, 0);
    for case in 0..executions().unwrap_or(400) * seeds.len() as u64 {
        let mut random = Stream::new(12, Purpose::Survey, case);
        let (kind, seed) = &seeds[case as usize % seeds.len()];
        let mut bytes = seed.clone().into_bytes();
        damage(&mut bytes, &mut random);
        let text = String::from_utf8_lossy(&bytes);
        let from = DVec3::new(-0.6, 0.0, 0.8);
        let start = cpu_time();
        let result = match *kind {
            "xml" => BsdfFile::parse(&text, "f.xml").map_err(|e| e.to_string()).map(|f| {
                if let Ok(m) = f.reflection(Side::Front, None) {
                    let (r, f) = (m.reflectance(from), m.evaluate(from, DVec3::Z));
                    assert!(
                        (0.0..=1.0 + 1e-6).contains(&r) && f >= 0.0 && f.is_finite(),
                        "{r} {f}"
                    );
                }
            }),
            "epw" => Weather::parse(&text, "f.epw").map_err(|e| e.to_string()).map(|_| ()),
            _ => Goniophotometer::parse(&text, "f.txt").map_err(|e| e.to_string()).map(|g| {
                let value = Interpolation::of(&g).value(from, DVec3::new(0.6, 0.0, 0.8));
                assert!(value >= 0.0 && value.is_finite(), "{value}");
            }),
        };
        match result {
            Ok(()) => read += 1,
            Err(error) => {
                refused += 1;
                assert!(error.len() > 20, "{error}");
            }
        }
        assert!(cpu_time() - start < Duration::from_secs(5), "case {case} of {kind}");
    }
    assert!(read > 100 && refused > 100, "{read} read, {refused} refused");
}
