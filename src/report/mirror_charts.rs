//! Tables and charts of the mirror rule.

use std::path::Path;

use super::error::Error;
use crate::base::Provenance;
use crate::picture::Chart;
use crate::picture::chart::{Axis, Cell, SURFACES, Swatch};
use crate::picture::figure::Polyline;
use crate::project::Resolved;
use crate::receivers::mirror::{Mirrored, MirroredAt, NOTE, date, sunrise_and_sunset};

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

impl Mirrored {
    /// A table of all lit days of all receivers, minutes together and by PV surface; for a region
    /// those at which any of its points is lit.
    pub fn daily_csv(&self) -> String {
        let mut out = String::from("receiver,day,date,first_h,last_h,minutes");
        for surface in &self.surfaces {
            out.push(',');
            out.push_str(&quoted(surface));
        }
        out.push('\n');
        for r in self.all() {
            for d in &r.daily {
                let date = date(self.assumptions.year, d.day);
                let head = quoted(&r.name);
                out.push_str(&format!(
                    "{head},{},{date},{:.4},{:.4},{}",
                    d.day, d.first_h, d.last_h, d.minutes
                ));
                for number in 0..self.surfaces.len() {
                    let own = d.by_surface.iter().find(|s| usize::from(s.0) == number);
                    out.push_str(&format!(",{}", own.map_or(0.0, |s| s.1)));
                }
                out.push('\n');
            }
        }
        out
    }

    /// A table of the points of all regions; only its head where none was asked for.
    pub fn points_csv(&self) -> String {
        let mut out = String::from(
            "region,x,y,z,area_m2,hours,most_minutes,most_on,days,first,last,earliest_h,latest_h\n",
        );
        let date = |day| date(self.assumptions.year, day);
        for (region, p) in self.regions.iter().flat_map(|r| r.points.iter().map(move |p| (r, p))) {
            let ([x, y, z], s) = (p.point, &p.year);
            let name = quoted(&region.name);
            out.push_str(&format!("{name},{x:.4},{y:.4},{z:.4},{:.4},", p.area_m2));
            if s.days == 0 {
                out.push_str("0,0,,0,,,,\n");
                continue;
            }
            out.push_str(&format!(
                "{:.4},{},{},{},{},{},{:.4},{:.4}\n",
                s.hours,
                s.most_minutes,
                date(s.most_on_day),
                s.days,
                date(s.first_day),
                date(s.last_day),
                s.earliest_h,
                s.latest_h
            ));
        }
        out
    }

    /// The chart of one receiver: day against clock time, coloured by PV surface.
    fn chart(&self, resolved: &Resolved, at: &MirroredAt) -> Chart {
        let a = &self.assumptions;
        let step_h = f64::from(a.step_s) / 3600.0;
        let (mut cells, mut key) = (Vec::new(), Vec::new());
        for (number, name) in self.surfaces.iter().enumerate() {
            let color = SURFACES[number % SURFACES.len()];
            let before = cells.len();
            for run in at.chart.iter().filter(|run| usize::from(run.surface) == number) {
                let day = f64::from(run.day);
                cells.push(Cell {
                    x: [day, day + 1.0],
                    y: [run.first_h, run.last_h + step_h],
                    color,
                });
            }
            if cells.len() > before {
                let hours = at.minutes_by_surface.get(name).copied().unwrap_or(0.0) / 60.0;
                key.push(Swatch { color, label: format!("{name}: {hours:.1} h a year") });
            }
        }
        let where_ = match at.point {
            Some([x, y, z]) => format!("at {x:.1}, {y:.1}, {z:.1} m"),
            None => "on any of its points".to_owned(),
        };
        let zone = resolved.place.meridian_deg / 15.0;
        let days = sunrise_and_sunset(resolved);
        Chart {
            title: at.name.clone(),
            subtitle: format!(
                "Mirrored sun {}: {:.1} h a year, at most {} min a day ({})",
                where_, at.year.hours, at.year.most_minutes, self.rule
            ),
            x: Axis::days_of_year(days.len() == 366),
            y: Axis::clock(0.0, 24.0, format!("local standard time (UTC{zone:+})")),
            ground: [255, 255, 255],
            cells,
            lines: daylight(&days),
            key,
            caption: vec![format!(
                "{NOTE}. Sun and reflection at least {} degrees apart; steps of {} s; {} suns of {}. Grey: sunrise and sunset on a flat horizon.",
                a.separation_deg, a.step_s, a.sun, a.year
            )],
            watermark: None,
        }
    }

    /// Receivers, then regions as a whole.
    fn all(&self) -> impl Iterator<Item = &MirroredAt> {
        self.receivers.iter().chain(self.regions.iter().map(|r| &r.anywhere))
    }

    /// Writes the chart of each receiver, then of each region (when any of its points is lit): into
    /// `path`, or with its number where there are several.
    ///
    /// # Errors
    /// When the pictures can't be written.
    pub fn write_charts(&self, resolved: &Resolved, path: &Path) -> Result<(), Error> {
        let texts = vec![("Software".to_owned(), Provenance::PROGRAM.to_owned())];
        let all: Vec<&MirroredAt> = self.all().collect();
        for (i, at) in all.iter().enumerate() {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            let end = path.extension().unwrap_or("png".as_ref()).to_string_lossy();
            let path = match all.len() {
                1 => path.to_owned(),
                _ => path.with_file_name(format!("{stem}-{}.{end}", i + 1)),
            };
            self.chart(resolved, at).write_png(&path, &texts)?;
        }
        Ok(())
    }
}

/// Lines of sunrise and sunset.
fn daylight(days: &[[Option<f64>; 2]]) -> Vec<Polyline> {
    const GREY: [u8; 3] = [150, 150, 150];
    let line = |end: usize| {
        let point = |(day, ends): (usize, &[Option<f64>; 2])| {
            [day as f64 + 0.5, ends[end].unwrap_or(f64::NAN)]
        };
        let points = days.iter().enumerate().map(point).collect();
        Polyline { points, color: GREY, width: 0.8, label: String::new() }
    };
    vec![line(0), line(1)]
}
