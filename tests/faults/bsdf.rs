//! Broken BSDF and weather files: refused by line, never a panic.

use glintmap::site::bsdf::{BsdfFile, Side};
use glintmap::sky::Weather;

use crate::physics::bsdf_files::file;
use crate::support;

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

#[test]
fn weather_is_read_or_refused_by_line() {
    assert!(Weather::parse(&format!("{HEAD}{}", row(2, 29, 1, "0.0")), "w.epw").is_ok());
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
