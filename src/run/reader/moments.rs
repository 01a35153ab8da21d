//! From the project file: pictures of luminances.

use std::collections::BTreeSet;

use super::Reader;
use crate::render::View;
use crate::run::Error;
use crate::run::project::MomentTable;
use crate::run::resolve::{Camera, PlannedMoment};
use crate::sky;

/// Pixels of a picture along an observer's direction; of a fisheye, and of one with view options
/// alone.
const ALONG: [usize; 2] = [1200, 800];
const FISHEYE: [usize; 2] = [1000, 1000];

impl Reader<'_> {
    /// The pictures of luminances; an observer makes two.
    pub fn moments(&self) -> Result<Vec<PlannedMoment>, Error> {
        let mut out = Vec::new();
        let mut names = BTreeSet::new();
        for t in &self.project.moment {
            for moment in self.moment(t)? {
                self.check_name("[[moment]]", &moment.name)?;
                self.check_size(&format!("[[moment]] \"{}\": size", moment.name), moment.size)?;
                if !names.insert(moment.name.clone()) {
                    let what = "the name is taken; give each a `name` of its own";
                    return Err(self.wrong(format!("[[moment]] \"{}\": {what}", moment.name)));
                }
                out.push(moment);
            }
        }
        Ok(out)
    }

    fn moment(&self, t: &MomentTable) -> Result<Vec<PlannedMoment>, Error> {
        let wrong = |what: String| {
            let name = t.name.clone().unwrap_or_else(|| t.time.clone());
            self.wrong(format!("[[moment]] \"{name}\": {what}"))
        };
        let year = self.project.time.year;
        let day = self.day(&t.date, "moment.date")?;
        if day >= sky::days_in_year(year) {
            return Err(wrong(format!("date: {year} has no day {day}")));
        }
        let hour = clock(&t.time).ok_or_else(|| {
            wrong(format!("time: expected a time such as \"08:30\", found \"{}\"", t.time))
        })?;
        let (month, date) = sky::date_of_day(year, day);
        let named = |of: &str| {
            t.name.clone().unwrap_or_else(|| {
                let digits: String = t.time.chars().filter(char::is_ascii_digit).collect();
                format!("{month:02}-{date:02}-{digits:0>4}-{of}")
            })
        };
        let planned = |name, camera, size| PlannedMoment { name, day, hour, camera, size };
        match (&t.view, &t.observer) {
            (Some(view), None) if view.trim_start().starts_with('-') => {
                let size = t.size.unwrap_or(FISHEYE);
                View::parse(view, size[0], size[1]).map_err(|e| wrong(format!("view: {e}")))?;
                Ok(vec![planned(named("view"), Camera::Options(view.clone()), size)])
            }
            (Some(view), None) => {
                let all = self.views()?;
                let found = all.iter().find(|v| v.name == *view).ok_or_else(|| {
                    let known: Vec<_> = all.iter().map(|v| v.name.as_str()).collect();
                    let known = known.join(", ");
                    wrong(format!(
                        "view: no [[view]] with a picture is named \"{view}\" (there are: {known}), and view options begin with -"
                    ))
                })?;
                let size = t.size.unwrap_or([found.view.columns(), found.view.rows()]);
                found.view.resized(size[0], size[1]).map_err(|e| wrong(format!("size: {e}")))?;
                Ok(vec![planned(named(view), Camera::Options(found.options.clone()), size)])
            }
            (None, Some(observer)) => {
                let known = &self.project.observer;
                let number = known.iter().position(|o| o.name == *observer).ok_or_else(|| {
                    let names: Vec<_> = known.iter().map(|o| o.name.as_str()).collect();
                    let names = names.join(", ");
                    wrong(format!("no [[observer]] is named \"{observer}\" (there are: {names})"))
                })?;
                let name = named(&plain(observer));
                let camera = |fisheye| Camera::Observer { number, fisheye };
                let fisheye = format!("{name}-fisheye");
                let edge = t.size.map_or(FISHEYE, |[columns, rows]| [columns.max(rows); 2]);
                Ok(vec![
                    planned(name, camera(false), t.size.unwrap_or(ALONG)),
                    planned(fisheye, camera(true), edge),
                ])
            }
            _ => Err(wrong("expected either `view` or `observer`".into())),
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
