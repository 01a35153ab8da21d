//! From the project file: points instead of pixels, and what they are judged by.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use super::Reader;
use crate::base::limits;
use crate::glare::rules::{self, Profile};
use crate::render::sensors::parse_sensors;
use crate::render::{Estimator, Gather, View};
use crate::run::Error;
use crate::run::manifest::hash_path;
use crate::run::project::{RegionTable, ViewTable};
use crate::run::resolve::{PlannedView, Points, RECEIVERS};

/// Finest lattice of a region, m: below, its points would share their photons.
const FINEST_M: f64 = 0.01;

impl Reader<'_> {
    /// Sets of points: the files of sensors, then that of the observers and regions.
    pub fn sensors(&self) -> Result<Vec<PlannedView>, Error> {
        let p = self.project;
        let mut out = Vec::new();
        for t in p.view.iter().filter(|v| v.sensors.is_some()) {
            out.push(self.sensor_file(t)?);
        }
        self.observers()?;
        self.regions()?;
        if p.observer.is_empty() && p.region.is_empty() {
            return Ok(out);
        }
        // They are gathered as the first picture is: what it shows and what is said of them agree.
        let (annual, series_bandwidth, series_edges) = match p.view.first() {
            Some(t) => (self.gather(t)?, t.series_bandwidth, t.series_edges),
            None => {
                let default = Gather { estimator: Estimator::Photons, ..Gather::default() };
                (default, None, false)
            }
        };
        out.push(PlannedView {
            fuse: false,
            both: false,
            name: RECEIVERS.to_owned(),
            options: String::new(),
            view: self.no_view()?,
            annual,
            series_bandwidth,
            series_edges,
            points: Some(Points::Receivers),
            direct: self.receivers_are_direct()?,
        });
        Ok(out)
    }

    /// Whether observers and regions are integrated; as the first picture where nothing is said.
    fn receivers_are_direct(&self) -> Result<bool, Error> {
        let p = self.project;
        let said = p.receivers.as_ref().map(|t| t.estimator.as_str());
        match said.or(p.view.first().map(|t| t.estimator.as_str())) {
            Some("direct") => Ok(true),
            Some(other) if said.is_some() && other != "photons" => Err(self.wrong(format!(
                "receivers.estimator: expected \"photons\" or \"direct\", found \"{other}\""
            ))),
            _ => Ok(false),
        }
    }

    /// What stands in the place of a view where points have none.
    fn no_view(&self) -> Result<View, Error> {
        Ok(View::parse("-vtv", 1, 1)?)
    }

    fn sensor_file(&self, t: &ViewTable) -> Result<PlannedView, Error> {
        let wrong = |what: String| self.wrong(format!("[[view]] \"{}\": {what}", t.name));
        let picture = t.view.is_some() || t.view_file.is_some() || t.size.is_some();
        if picture || t.fuse || t.both_quantities {
            let what = "`sensors` stands alone, without `view`, `view_file`, `size`, `fuse` and `both_quantities`";
            return Err(wrong(what.into()));
        }
        let map = self.map(&t.coordinates).map_err(wrong)?;
        let name = t.sensors.clone().unwrap_or_default();
        let path = self.file.parent().unwrap_or(Path::new("")).join(&name);
        let read = |source| Error::Read { path: path.clone(), source };
        if fs::metadata(&path).map_err(read)?.len() > limits::MAX_TEXT_FILE_BYTES {
            return Err(wrong(format!("{} is too large", path.display())));
        }
        let bytes = fs::read(&path).map_err(read)?;
        let sensors = parse_sensors(&String::from_utf8_lossy(&bytes)).map_err(|e| {
            Error::Project { path: path.clone(), line: 0, column: 0, message: e.to_string() }
        })?;
        Ok(PlannedView {
            fuse: false,
            both: false,
            name: t.name.clone(),
            options: String::new(),
            view: self.no_view()?,
            annual: self.gather(t)?,
            series_bandwidth: t.series_bandwidth,
            series_edges: t.series_edges,
            points: Some(Points::File { hash: hash_path(&path).map_err(read)?, sensors, map }),
            direct: t.estimator == "direct",
        })
    }

    /// Whether coordinates are those of the map.
    fn map(&self, coordinates: &Option<String>) -> Result<bool, String> {
        match coordinates.as_deref() {
            None | Some("local") => Ok(false),
            Some("map") => Ok(true),
            Some(other) => {
                Err(format!("coordinates: expected \"map\" or \"local\", found \"{other}\""))
            }
        }
    }

    fn observers(&self) -> Result<(), Error> {
        let mut names = BTreeSet::new();
        for o in &self.project.observer {
            let wrong = |what: String| self.wrong(format!("[[observer]] \"{}\": {what}", o.name));
            if o.name.trim().is_empty() || !names.insert(&o.name) {
                return Err(wrong("expected a name of its own".into()));
            }
            self.map(&o.coordinates).map_err(wrong)?;
            if o.direction.is_some_and(|d| d == [0.0; 3]) {
                return Err(wrong("direction: expected a direction, found zero".into()));
            }
        }
        for r in &self.project.region {
            if r.name.trim().is_empty() || !names.insert(&r.name) {
                return Err(self.wrong(format!(
                    "[[region]] \"{}\": expected a name of its own; observers and regions share one table",
                    r.name
                )));
            }
        }
        Ok(())
    }

    fn regions(&self) -> Result<(), Error> {
        for r in &self.project.region {
            self.region(r)
                .map_err(|what| self.wrong(format!("[[region]] \"{}\": {what}", r.name)))?;
        }
        Ok(())
    }

    fn region(&self, r: &RegionTable) -> Result<(), String> {
        self.map(&r.coordinates)?;
        if r.spacing_m.is_some_and(|s| !(s >= FINEST_M && s.is_finite())) {
            return Err(format!("spacing_m: expected metres from {FINEST_M}"));
        }
        if r.height_m.is_some_and(|h| !h.is_finite()) {
            return Err("height_m: expected metres".into());
        }
        let polygon = match (&r.object, &r.polygon) {
            (Some(ids), None) => {
                if ids.list().is_empty() || r.view.is_some() || r.height_m.is_some() {
                    return Err(
                        "`object` names one object or more, without `view` and `height_m`".into()
                    );
                }
                return Ok(());
            }
            (None, Some(polygon)) => polygon,
            _ => return Err("expected either `object` or `polygon`".into()),
        };
        if polygon.len() < 3 || polygon.len() > limits::MAX_POLYGON_VERTICES {
            return Err(format!(
                "polygon: expected 3 to {} corners, found {}",
                limits::MAX_POLYGON_VERTICES,
                polygon.len()
            ));
        }
        if polygon.iter().flatten().any(|v| !v.is_finite()) {
            return Err("polygon: expected finite numbers".into());
        }
        let Some(name) = &r.view else { return Ok(()) };
        let pictures = self.project.view.iter().filter(|v| v.sensors.is_none());
        let known: Vec<&str> = pictures.map(|v| v.name.as_str()).collect();
        if !known.contains(&name.as_str()) {
            return Err(format!(
                "no [[view]] with a picture is named \"{name}\" (there are: {})",
                known.join(", ")
            ));
        }
        if r.height_m.is_some() || r.coordinates.is_some() {
            return Err(
                "a polygon in the pixels of `view` has neither `height_m` nor `coordinates`".into(),
            );
        }
        Ok(())
    }

    /// The profiles that are asked for: built in, or in files beside the project.
    pub fn rules(&self) -> Result<Vec<Profile>, Error> {
        let mut out: Vec<Profile> = Vec::new();
        for rule in &self.project.glare.rules {
            let profile = if rule.ends_with(".toml") {
                let path = self.file.parent().unwrap_or(Path::new("")).join(rule);
                let read = |source| Error::Read { path: path.clone(), source };
                let text = fs::read_to_string(&path).map_err(read)?;
                rules::load(&path.display().to_string(), &text)?
            } else {
                rules::built_in(rule).map_err(|e| {
                    self.wrong(format!(
                        "glare.rules: {e}; a file of one's own ends in .toml and lies beside the project file"
                    ))
                })?
            };
            if out.iter().any(|p| p.id == profile.id) {
                return Err(self.wrong(format!("glare.rules: \"{}\" is there twice", profile.id)));
            }
            out.push(profile);
        }
        Ok(out)
    }
}
