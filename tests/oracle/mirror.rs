//! The mirror rule against numbers that were computed elsewhere, and against a computation of its
//! own few lines: a ray against a plane, no hierarchy, no index of suns.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use glam::DVec3;
use glintmap::base::Silent;
use glintmap::project::Resolved;
use glintmap::render::{MirrorReceiver, MirrorRule, MirrorTimes, SEPARATION_DEG};
use glintmap::site::Site;

use crate::support::program::{project, root, say, succeed};

#[test]
fn the_command_gives_the_closed_numbers() {
    let folder = root().join("fixtures/projects/mirror-rule");
    let folder = folder.to_str().expect("a name");
    let keep = tempfile::tempdir().expect("a folder");
    let (csv, plot) = (keep.path().join("days.csv"), keep.path().join("chart.png"));
    let files = [csv.to_str().expect("a name"), plot.to_str().expect("a name")];
    let said = succeed(&["mirror", folder, "--json", "--csv", files[0], "--plot", files[1]]);
    let found: serde_json::Value = serde_json::from_str(&said.out).expect("one document");
    let expected = [
        (69.0, 41.0, 117, 225, Some((7.70, 8.92))),
        (86.4, 51.0, 117, 225, Some((8.17, 9.50))),
        (22.9, 22.0, 136, 206, Some((8.00, 8.58))),
        (2.9, 9.0, 156, 186, None),
    ];
    for (i, (hours, most, first, last, clock)) in expected.into_iter().enumerate() {
        let r = &found["receivers"][i];
        let number = |key: &str| r[key].as_f64().expect("a number");
        assert_eq!((number("hours") * 10.0).round() / 10.0, hours, "{i}");
        assert_eq!(number("most_minutes"), most, "{i}");
        assert_eq!((r["first_day"].as_u64(), r["last_day"].as_u64()), (Some(first), Some(last)));
        if let Some((from, to)) = clock {
            assert_eq!((number("earliest_h") * 100.0).round() / 100.0, from);
            assert_eq!((number("latest_h") * 100.0).round() / 100.0, to);
        }
    }
    // 30 min a day and 30 h a year: strictly above.
    assert_eq!(found["receivers"][0]["exceeded"], serde_json::json!(["day", "year"]));
    assert_eq!(found["receivers"][2]["exceeded"], serde_json::json!([]));
    let table = std::fs::read_to_string(&csv).expect("a table");
    assert_eq!(table.lines().count(), 1 + 109 + 109 + 71 + 31);
    let minutes: f64 = table
        .lines()
        .filter(|l| l.starts_with("\"30 m west\""))
        .map(|l| l.split(',').nth(5).expect("a column").parse::<f64>().expect("minutes"))
        .sum();
    assert_eq!((minutes / 6.0).round() / 10.0, 69.0);
    for i in 1..=4 {
        assert!(keep.path().join(format!("chart-{i}.png")).exists());
    }
}

#[test]
fn the_command_names_what_it_can_t_do() {
    let folder = root().join("fixtures/projects/mirror-rule");
    let folder = folder.to_str().expect("a name");
    for (arguments, words) in [
        (["--observer", "nobody"], "there are: 30 m west"),
        (["--step", "7s"], "1 s to 1 h"),
        (["--step", "fast"], "expected a step"),
        (["--object", "nothing"], "no object of the scene"),
        (["--region", "nowhere"], "no [[region]] is named"),
        (["--spacing", "0"], "0.001 to 10000"),
        (["--point", "1,2"], "expected X,Y,Z"),
        (["--separation", "200"], "0 to 180"),
        (["--set", "site.horizon=[[0, 100]]"], "far horizon"),
    ] {
        let said = say(&[&["mirror", folder], arguments.as_slice()].concat());
        assert_eq!(said.code, 2, "{arguments:?}: {}", said.err);
        assert!(said.err.contains(words), "{arguments:?}: {}", said.err);
    }
}

#[test]
fn a_far_horizon_cuts_suns_and_refraction_adds_some() {
    let folder = root().join("fixtures/projects/mirror-rule");
    let folder = folder.to_str().expect("a name");
    let look = |more: &[&str]| {
        let said = succeed(&[&["mirror", folder, "--json", "--step", "5min"], more].concat());
        let found: serde_json::Value = serde_json::from_str(&said.out).expect("one document");
        let suns = found["assumptions"]["suns"].as_u64().expect("a number");
        (suns, found["receivers"][0]["hours"].as_f64().expect("hours"))
    };
    let (suns, hours) = look(&[]);
    assert!(look(&["--refraction"]).0 > suns);
    // The suns that count stand some 30 degrees high in the east.
    let low = look(&["--set", "site.horizon=[[0, 10.0]]"]);
    assert!(low.0 < suns && low.1 == hours, "{low:?}");
    let east = look(&["--set", "site.horizon=[[60, 60.0], [120, 60.0], [121, 0.0], [59, 0.0]]"]);
    assert_eq!(east.1, 0.0);
    let (_keep, copy) = project("mirror-rule");
    std::fs::write(copy.join("ridge.csv"), "azimuth,altitude\n0,10\n").expect("writes");
    let copy = copy.to_str().expect("a name");
    let set = ["mirror", copy, "--json", "--step", "5min", "--set", "site.horizon=\"ridge.csv\""];
    let found: serde_json::Value = serde_json::from_str(&succeed(&set).out).expect("one document");
    assert_eq!(found["assumptions"]["suns"].as_u64(), Some(low.0));
}

/// gensky's sun of 2018, from the handbook's formulas.
fn sun_at(day: u32, hour: f64) -> DVec3 {
    let (lat, lon, meridian) = (47.038_f64.to_radians(), 8.312_f64, 15.0_f64);
    let jd = f64::from(day) + 1.0;
    let d = 0.4093 * libm::sin(2.0 * PI / 368.0 * (jd - 81.0));
    let st = hour + 0.170 * libm::sin(4.0 * PI / 373.0 * (jd - 80.0))
        - 0.129 * libm::sin(2.0 * PI / 355.0 * (jd - 8.0))
        + 12.0 / PI * (lon - meridian).to_radians();
    let a = PI * st / 12.0;
    let (sl, cl, sd, cd) = (libm::sin(lat), libm::cos(lat), libm::sin(d), libm::cos(d));
    // East, north, up of a sun at declination d and hour angle (st - 12 h).
    DVec3::new(
        cd * libm::sin(a),
        cl * sd + sl * cd * libm::cos(a),
        sl * sd - cl * cd * libm::cos(a),
    )
}

struct Plain {
    triangles: Vec<[DVec3; 3]>,
    pv: Vec<(DVec3, Vec<[DVec3; 3]>)>,
}

impl Plain {
    fn of(site: &Site) -> Self {
        Self {
            triangles: site.triangles.iter().map(|t| t.corners.map(|c| c.as_dvec3())).collect(),
            pv: site
                .pv
                .iter()
                .map(|pv| {
                    let own = |t: &u32| site.triangles[*t as usize].corners.map(|c| c.as_dvec3());
                    (pv.normal, pv.triangles.iter().map(own).collect())
                })
                .collect(),
        }
    }

    /// Möller and Trumbore 1997.
    fn meets([a, b, c]: &[DVec3; 3], from: DVec3, way: DVec3) -> Option<f64> {
        let (e1, e2) = (*b - *a, *c - *a);
        let p = way.cross(e2);
        let det = e1.dot(p);
        let t = from - *a;
        let (u, q) = (t.dot(p) / det, t.cross(e1));
        let v = way.dot(q) / det;
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| e2.dot(q) / det)
    }

    fn blocked(&self, from: DVec3, way: DVec3, most: f64) -> bool {
        self.triangles
            .iter()
            .any(|t| Self::meets(t, from, way).is_some_and(|d| d > 3e-3 && d < most - 3e-3))
    }

    /// Whether the sun's mirror image is seen from `eye` in any PV.
    fn dazzles(&self, eye: DVec3, sun: DVec3) -> bool {
        self.pv.iter().any(|(normal, triangles)| {
            if normal.dot(sun) <= 0.0 {
                return false;
            }
            // What leaves the eye this way goes off the plane towards the sun.
            let way = *normal * (2.0 * normal.dot(sun)) - sun;
            let way = -way;
            if way.dot(sun) > libm::cos(10.0_f64.to_radians()) {
                return false;
            }
            triangles.iter().any(|t| {
                Self::meets(t, eye, way).filter(|d| *d > 0.0 && normal.dot(way) < 0.0).is_some_and(
                    |d| {
                        let spot = eye + way * d;
                        !self.blocked(eye, way, d) && !self.blocked(spot, sun, f64::INFINITY)
                    },
                )
            })
        })
    }
}

#[test]
fn ten_observers_of_the_case_study_to_the_minute() {
    let file = root().join("fixtures/projects/case-study");
    let resolved = Resolved::read(&file, &[], 1 << 30).expect("a project");
    let site = Site::load(&resolved.scene, &resolved.pv).expect("a scene");
    let mut eyes: Vec<DVec3> =
        resolved.project.observer.iter().map(|o| DVec3::from_array(o.point)).collect();
    eyes.extend(
        [
            [-51.02, -5.80, 8.70],
            [-30.0, 3.0, 14.0],
            [-45.0, 14.0, 10.0],
            [-60.0, 0.0, 12.0],
            [-25.0, -12.0, 9.5],
            [-40.0, 25.0, 13.0],
            [10.0, -40.0, 16.0],
        ]
        .map(DVec3::from_array),
    );
    let times = MirrorTimes {
        place: resolved.place,
        model: resolved.times.sun,
        year: resolved.times.year,
        step_s: 60,
        refraction: false,
        horizon: None,
    };
    let rule = MirrorRule::new(&site, times, SEPARATION_DEG).expect("a rule");
    let receivers: Vec<_> =
        eyes.iter().map(|&position| MirrorReceiver { position, normal: None }).collect();
    let years = rule.years(&receivers, &Silent).expect("runs");

    let plain = Plain::of(&site);
    let suns: Vec<(u32, DVec3)> = (0..365 * 1440)
        .map(|i| (i, sun_at(i / 1440, f64::from(i % 1440) / 60.0)))
        .filter(|s| s.1.z > 0.0)
        .collect();
    let (mut lit_observers, mut lit_minutes) = (0, 0);
    for (eye, year) in eyes.iter().zip(&years) {
        let own: BTreeSet<u32> =
            suns.iter().filter(|s| plain.dazzles(*eye, s.1)).map(|s| s.0).collect();
        let theirs: BTreeSet<u32> = year.lit.iter().map(|l| l.instant).collect();
        let differ: Vec<_> = own.symmetric_difference(&theirs).collect();
        println!("{eye}: {} minutes, {} differ", own.len(), differ.len());
        assert!(differ.is_empty(), "{eye}: {differ:?} of {}", own.len());
        lit_observers += usize::from(!own.is_empty());
        lit_minutes += own.len();
    }
    assert!(lit_observers >= 6 && lit_minutes > 10_000, "{lit_observers}, {lit_minutes}");
}

/// Every point of a region against the same few lines; those behind its walls see nothing.
#[test]
fn the_points_of_a_region_are_receivers_on_their_wall() {
    let (_keep, folder) = project("tiny");
    let file = folder.join("project.toml");
    let text = std::fs::read_to_string(&file).expect("reads");
    std::fs::write(&file, text.replace("object = \"wall\"", "object = \"wall\"\nspacing_m = 2.5"))
        .expect("writes");
    let path = folder.to_str().expect("a name");
    let (days, points) = (folder.join("days.csv"), folder.join("points.csv"));
    let plot = folder.join("chart.png");
    let said = succeed(&[
        "mirror",
        path,
        "--json",
        "--region",
        "The wall",
        "--csv",
        days.to_str().expect("a name"),
        "--points-csv",
        points.to_str().expect("a name"),
        "--plot",
        plot.to_str().expect("a name"),
    ]);
    let found: serde_json::Value = serde_json::from_str(&said.out).expect("one document");
    assert_eq!(found["receivers"].as_array().map(Vec::len), Some(0));
    let region = &found["regions"][0];
    let all = region["points"].as_array().expect("points");
    assert!(plot.exists() && all.len() >= 12, "{}", all.len());

    let resolved = Resolved::read(&folder, &[], 1 << 30).expect("a project");
    let site = Site::load(&resolved.scene, &resolved.pv).expect("a scene");
    let plain = Plain::of(&site);
    let mut anywhere = BTreeSet::new();
    let mut lit_points = 0;
    for point in all {
        let at = |i: usize| point["point"][i].as_f64().expect("a number");
        // Its east side stands at x = -14.5 and looks at the roof.
        let eye = DVec3::new(at(0) + 2e-3, at(1), at(2));
        if (eye.x + 14.5).abs() > 0.01 {
            continue;
        }
        let mut minutes = 0;
        for i in 0..365 * 1440_u32 {
            let sun = sun_at(i / 1440, f64::from(i % 1440) / 60.0);
            // Nothing that is mirrored onto the wall comes from the west.
            if sun.z > 0.0 && sun.x > 0.0 && plain.dazzles(eye, sun) {
                minutes += 1;
                anywhere.insert(i);
            }
        }
        lit_points += usize::from(minutes > 0);
        let hours = point["hours"].as_f64().expect("hours");
        assert_eq!((hours * 60.0).round() as u32, minutes, "{eye}");
    }
    assert!(lit_points > 3, "{lit_points}");
    // Its top may be lit at other times.
    assert!(region["lit_points"].as_u64() >= Some(lit_points as u64));
    let hours = region["anywhere"]["hours"].as_f64().expect("hours");
    assert!((hours * 60.0).round() as usize >= anywhere.len(), "{hours}");
    let lines = |path| std::fs::read_to_string(path).expect("a table").lines().count();
    assert_eq!(lines(&points), 1 + all.len());
    let lit_days: BTreeSet<u32> = anywhere.iter().map(|i| i / 1440).collect();
    assert!(lines(&days) > lit_days.len());
}
