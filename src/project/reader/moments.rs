//! From the project file: pictures of luminances.

use std::collections::BTreeSet;

use super::Reader;
use crate::project::places::Key;
use crate::project::resolve::{Camera, PlannedMoment};
use crate::project::view_tables::MomentTable;
use crate::project::views::{Picture, PlannedView};
use crate::render::View;
use crate::sky;

/// Pixels of a picture along an observer's direction; of a fisheye, and of one with view options
/// alone.
const ALONG: [usize; 2] = [1200, 800];
const FISHEYE: [usize; 2] = [1000, 1000];

impl Reader<'_> {
    /// The pictures of luminances; an observer makes two.
    pub fn moments(&self, views: &[PlannedView]) -> Vec<PlannedMoment> {
        let mut out = Vec::new();
        let mut names = BTreeSet::new();
        for (i, t) in self.project.moment.iter().enumerate() {
            let key = Key::item("moment", i);
            for moment in self.moment(i, t, views).unwrap_or_default() {
                self.check_name(&key.key("name"), &moment.name);
                if !names.insert(moment.name.clone()) {
                    let what = "the name is taken; give each a `name` of its own";
                    self.wrong(&key.key("name"), what);
                }
                out.push(moment);
            }
        }
        out
    }

    fn moment(
        &self,
        table: usize,
        t: &MomentTable,
        views: &[PlannedView],
    ) -> Option<Vec<PlannedMoment>> {
        let key = &Key::item("moment", table);
        let year = self.project.time.year;
        let day = self.day(&t.date, &key.key("date"));
        if day >= sky::days_in_year(year) {
            self.wrong(&key.key("date"), format!("{year} has no day {day}"));
            return None;
        }
        let Some(hour) = clock(&t.time) else {
            let what = format!("expected a time such as \"08:30\", found \"{}\"", t.time);
            self.wrong(&key.key("time"), what);
            return None;
        };
        let (month, date) = sky::date_of_day(year, day);
        let named = |of: &str| {
            t.name.clone().unwrap_or_else(|| {
                let digits: String = t.time.chars().filter(char::is_ascii_digit).collect();
                format!("{month:02}-{date:02}-{digits:0>4}-{of}")
            })
        };
        let planned = |name, camera, size| PlannedMoment { table, name, day, hour, camera, size };
        match (&t.view, &t.observer) {
            (Some(view), None) if view.trim_start().starts_with('-') => {
                let size = t.size.unwrap_or(FISHEYE);
                self.said(&key.key("view"), View::parse(view, size[0], size[1]))?;
                Some(vec![planned(named("view"), Camera::Options(view.clone()), size)])
            }
            (Some(view), None) => {
                let pictures = self.project.view.iter().filter(|v| v.sensors.is_none());
                let known: Vec<_> = pictures.map(|v| v.name.as_str()).collect();
                if !known.contains(&view.as_str()) {
                    let known = known.join(", ");
                    self.wrong(&key.key("view"), format!("no [[view]] with a picture is named \"{view}\" (there are: {known}), and view options begin with -"));
                }
                // One that is wrong itself is told of elsewhere.
                let Picture { options, size, view: camera } =
                    views.iter().find(|v| v.name == *view)?.picture()?;
                let size = t.size.unwrap_or(*size);
                self.said(&key.key("size"), camera.resized(size[0], size[1]))?;
                Some(vec![planned(named(view), Camera::Options(options.clone()), size)])
            }
            (None, Some(observer)) => {
                let known = &self.project.observer;
                let Some(number) = known.iter().position(|o| o.name == *observer) else {
                    let names: Vec<_> = known.iter().map(|o| o.name.as_str()).collect();
                    let names = names.join(", ");
                    self.wrong(
                        &key.key("observer"),
                        format!("no [[observer]] is named \"{observer}\" (there are: {names})"),
                    );
                    return None;
                };
                let name = named(&plain(observer));
                let camera = |fisheye| Camera::Observer { number, fisheye };
                let fisheye = format!("{name}-fisheye");
                let edge = t.size.map_or(FISHEYE, |[columns, rows]| [columns.max(rows); 2]);
                Some(vec![
                    planned(name, camera(false), t.size.unwrap_or(ALONG)),
                    planned(fisheye, camera(true), edge),
                ])
            }
            _ => {
                self.wrong(key, "expected either `view` or `observer`");
                None
            }
        }
    }
}

/// `08:30` in hours.
fn clock(text: &str) -> Option<f64> {
    let (hour, minute) = text.trim().split_once(':')?;
    let whole = |t: &str| t.parse::<u32>().ok().filter(|_| t.len() <= 2);
    let (hour, minute) = (whole(hour)?, whole(minute)?);
    (hour < 24 && minute < 60).then(|| f64::from(hour) + f64::from(minute) / 60.0)
}

/// A name that may be a file's.
fn plain(name: &str) -> String {
    let letters =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' });
    let text: String = letters.collect();
    text.split('-').filter(|w| !w.is_empty()).collect::<Vec<_>>().join("-")
}
