//! What arrives at points, as tables for spreadsheets.

use std::fmt::Write as _;

use crate::base::Grid;
use crate::receivers::clock::Clock;
use crate::receivers::points::Group;
use crate::receivers::received::Reading;
use crate::render::HitMap;
use crate::volume::TimeAxis;

/// The columns of `sensors.csv`.
pub(super) fn head(thresholds: &[f64]) -> String {
    let mut out = String::from(
        "group,point,x_m,y_m,z_m,nx,ny,nz,stands_on,area_m2,pv_distance_m,annual_wh_m2,\
         annual_normal_wh_m2,peak_w_m2,peak_at,exceeded_30min_w_m2,exceeded_50h_w_m2",
    );
    for t in thresholds {
        for column in [
            "hours",
            "days",
            "longest_run_min",
            "longest_run_at",
            "longest_day_min",
            "longest_day",
            "first_hour",
            "last_hour",
        ] {
            // Writing into a String can't fail.
            let _ = write!(out, ",{column}_above_{t}");
        }
    }
    out.push('\n');
    out
}

/// A row for each point of a group; where nothing is known the values are left out.
pub(super) fn points(
    out: &mut String,
    group: &Group,
    reading: &Reading,
    hits: &HitMap,
    [annual, normal]: [&Grid<f32>; 2],
    clock: &Clock,
    axis: &TimeAxis,
) {
    for (i, point) in reading.points.iter().enumerate() {
        let number = group.first + i;
        let hit = &hits.hits[number];
        let footing = format!("{:?}", group.footing[i]).to_lowercase();
        let _ = write!(out, "{},{i}", quoted(&group.name));
        for v in hit.position.to_array().into_iter().chain(hit.normal.to_array()) {
            let _ = write!(out, ",{v:.4}");
        }
        let _ = write!(out, ",{footing},{:.4},", group.area_m2[i]);
        if let Some(pv) = &group.pv[i] {
            let _ = write!(out, "{:.3}", pv.nearest_m);
        }
        let Some(p) = point else {
            let columns = 6 + 8 * reading.group.thresholds.len();
            out.push_str(&",".repeat(columns));
            out.push('\n');
            continue;
        };
        let _ = write!(out, ",{},{}", annual.data()[number], normal.data()[number]);
        let at = |t: usize| clock.show(axis.day[t], axis.hour[t]);
        let peak_at = if p.peak.0 > 0.0 { at(p.peak.1) } else { String::new() };
        let [worst, year] = p.margins;
        let _ = write!(out, ",{},{peak_at},{worst},{year}", p.peak.0);
        for g in &p.glare {
            if g.hours <= 0.0 {
                out.push_str(",0,0,0,,0,,,");
                continue;
            }
            let [first, last] = g.between_h.unwrap_or_default();
            let _ = write!(
                out,
                ",{:.4},{},{:.2},{},{:.2},{},{first:.4},{last:.4}",
                g.hours,
                g.days,
                g.longest_run_h * 60.0,
                at(g.longest_run_at as usize),
                g.longest_day_h * 60.0,
                clock.date(g.longest_day),
            );
        }
        out.push('\n');
    }
}

/// When a group is lit: a row for each timestep with light.
pub(super) fn occurrence(
    reading: &Reading,
    surfaces: &[String],
    clock: &Clock,
    axis: &TimeAxis,
) -> String {
    let mut out = String::from(
        "timestep,day,hour,at,sun_altitude_deg,sun_azimuth_deg,strongest_w_m2,pv_surface,share\n",
    );
    for (t, value) in reading.strongest.iter().enumerate().filter(|(_, v)| **v > 0.0) {
        let sun = axis.sun[t];
        let _ = write!(
            out,
            "{t},{},{:.4},{},{:.2},{:.2},{value},",
            axis.day[t],
            axis.hour[t],
            clock.show(axis.day[t], axis.hour[t]),
            libm::asin(sun.z).to_degrees(),
            libm::atan2(sun.x, sun.y).to_degrees().rem_euclid(360.0),
        );
        let _ = match reading.surface[t] {
            Some((s, share)) => {
                let name = surfaces.get(usize::from(s)).map_or("", String::as_str);
                writeln!(out, "{},{share:.3}", quoted(name))
            }
            None => writeln!(out, ","),
        };
    }
    out
}

/// A field of CSV (RFC 4180).
pub(in crate::run) fn quoted(text: &str) -> String {
    if text.contains(['"', ',', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
