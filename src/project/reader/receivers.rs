//! From the project file: points instead of pixels, and what they are judged by.

use std::collections::BTreeSet;
use std::fs;

use super::Reader;
use crate::base::limits;
use crate::project::error::Error;
use crate::project::places::Key;
use crate::project::view_tables::{RegionTable, ViewTable};
use crate::project::views::{
    Estimator, PhotonGather, PlannedView, Points, RECEIVERS, SeriesKept, Target,
};
use crate::project::words::{ReceiversBy, ViewBy};
use crate::render::sensors::parse_sensors;
use crate::render::{self, Gather};
use crate::rules::{self, Profile};
use crate::site::Coordinates;

/// Finest lattice of a region, m: below, its points would share their photons.
const FINEST_M: f64 = 0.01;

impl Reader<'_> {
    /// Sets of points: the files of sensors, then that of the observers and regions.
    pub fn sensors(&self) -> Vec<PlannedView> {
        let p = self.project;
        let views = p.view.iter().enumerate().filter(|(_, v)| v.sensors.is_some());
        let mut out: Vec<PlannedView> =
            views.filter_map(|(i, t)| self.sensor_file(t, &Key::item("view", i))).collect();
        self.observers();
        for (i, r) in p.region.iter().enumerate() {
            self.region(r, &Key::item("region", i));
        }
        if p.observer.is_empty() && p.region.is_empty() {
            return out;
        }
        // They are gathered as the first view is: what it shows and what is said of them agree.
        let first = Key::item("view", 0);
        let (gather, mantissa_bits) = match p.view.first() {
            Some(t) => (self.gather(t, &first), self.mantissa_bits(t, &first)),
            None => (PhotonGather::default(), limits::EXACT_MANTISSA_BITS),
        };
        let photons = |estimator| {
            let annual = Gather { estimator, ..gather.annual };
            Estimator::Photons(PhotonGather { annual, ..gather })
        };
        let estimator = match self.receivers_by() {
            ViewBy::Direct => Estimator::Direct(self.sight()),
            ViewBy::Photons => photons(render::Estimator::Photons),
            ViewBy::Radiance => photons(render::Estimator::Radiance),
        };
        out.push(PlannedView {
            name: RECEIVERS.to_owned(),
            target: Target::Points(Points::Receivers),
            estimator,
            series: SeriesKept::One,
            mantissa_bits,
        });
        out
    }

    /// How observers and regions are computed: as `[receivers]` says, else as the first view.
    pub(super) fn receivers_by(&self) -> ViewBy {
        let p = self.project;
        match p.receivers.as_ref().map(|t| t.estimator) {
            Some(ReceiversBy::Direct) => ViewBy::Direct,
            Some(ReceiversBy::Photons) => ViewBy::Photons,
            None => p.view.first().map(|t| t.estimator).unwrap_or_default(),
        }
    }

    fn sensor_file(&self, t: &ViewTable, key: &Key) -> Option<PlannedView> {
        if t.view.is_some() || t.view_file.is_some() || t.size.is_some() || t.fuse {
            let what = "`sensors` stands alone, without `view`, `view_file`, `size` and `fuse`";
            self.wrong(key, what);
        }
        if t.both_quantities {
            self.wrong(&key.key("both_quantities"), "`both_quantities` adds maps to a picture; `sensors` have both in their tables: leave it out");
        }
        let (estimator, mantissa_bits) = (self.estimator(t, key), self.mantissa_bits(t, key));
        let key = key.key("sensors");
        let path = self.beside(t.sensors.as_ref()?);
        let read = |source| Error::Read { path: path.clone(), source };
        if self.checked(&key, fs::metadata(&path), read)?.len() > limits::MAX_TEXT_FILE_BYTES {
            self.wrong(&key, format!("{} is too large", path.display()));
            return None;
        }
        let hash = self.hash(&key, &path)?;
        let bytes = self.checked(&key, fs::read(&path), read)?;
        let sensors = parse_sensors(&String::from_utf8_lossy(&bytes))
            .map_err(|e| self.wrong(&key, format!("{}: {e}", path.display())))
            .ok()?;
        let map = t.coordinates == Some(Coordinates::Map);
        Some(PlannedView {
            name: t.name.clone(),
            target: Target::Points(Points::File { hash, sensors, map }),
            estimator,
            series: SeriesKept::One,
            mantissa_bits,
        })
    }

    fn observers(&self) {
        let mut names = BTreeSet::new();
        for (i, o) in self.project.observer.iter().enumerate() {
            let key = Key::item("observer", i);
            if o.name.trim().is_empty() || !names.insert(&o.name) {
                self.wrong(&key.key("name"), "expected a name of its own");
            }
            if o.direction.is_some_and(|d| d == [0.0; 3]) {
                self.wrong(&key.key("direction"), "expected a direction, found zero");
            }
        }
        for (i, r) in self.project.region.iter().enumerate() {
            if r.name.trim().is_empty() || !names.insert(&r.name) {
                let key = Key::item("region", i).key("name");
                self.wrong(
                    &key,
                    "expected a name of its own; observers and regions share one table",
                );
            }
        }
    }

    fn region(&self, r: &RegionTable, key: &Key) {
        if r.spacing_m.is_some_and(|s| !(s >= FINEST_M && s.is_finite())) {
            self.wrong(&key.key("spacing_m"), format!("expected metres from {FINEST_M}"));
        }
        if r.height_m.is_some_and(|h| !h.is_finite()) {
            self.wrong(&key.key("height_m"), "expected metres");
        }
        let polygon = match (&r.object, &r.polygon) {
            (Some(ids), None) => {
                if ids.list().is_empty() || r.view.is_some() || r.height_m.is_some() {
                    let what = "`object` names one object or more, without `view` and `height_m`";
                    self.wrong(key, what);
                }
                return;
            }
            (None, Some(polygon)) => polygon,
            _ => return self.wrong(key, "expected either `object` or `polygon`"),
        };
        if polygon.len() < 3 || polygon.len() > limits::MAX_POLYGON_VERTICES {
            let (most, found) = (limits::MAX_POLYGON_VERTICES, polygon.len());
            let what = format!("expected 3 to {most} corners, found {found}");
            self.wrong(&key.key("polygon"), what);
        }
        if polygon.iter().flatten().any(|v| !v.is_finite()) {
            self.wrong(&key.key("polygon"), "expected finite numbers");
        }
        let Some(name) = &r.view else { return };
        let pictures = self.project.view.iter().filter(|v| v.sensors.is_none());
        let known: Vec<&str> = pictures.map(|v| v.name.as_str()).collect();
        if !known.contains(&name.as_str()) {
            let known = known.join(", ");
            self.wrong(
                &key.key("view"),
                format!("no [[view]] with a picture is named \"{name}\" (there are: {known})"),
            );
        }
        if r.height_m.is_some() || r.coordinates.is_some() {
            self.wrong(
                key,
                "a polygon in the pixels of `view` has neither `height_m` nor `coordinates`",
            );
        }
    }

    /// The profiles that are asked for: built in, or in files beside the project.
    pub fn rules(&self) -> Vec<Profile> {
        let key = Key::of("glare.rules");
        let mut out: Vec<Profile> = Vec::new();
        for rule in &self.project.glare.rules {
            let profile = if rule.ends_with(".toml") {
                let path = self.beside(rule.as_ref());
                let read = |source| Error::Read { path: path.clone(), source };
                self.checked(&key, fs::read_to_string(&path), read).and_then(|text| {
                    let profile = rules::load(&path.display().to_string(), &text);
                    self.checked(&key, profile, Error::Rules)
                })
            } else {
                rules::built_in(rule).map_err(|e| self.wrong(&key, format!("{e}; a file of one's own ends in .toml and lies beside the project file"))).ok()
            };
            let Some(profile) = profile else { continue };
            if out.iter().any(|p| p.id == profile.id) {
                self.wrong(&key, format!("\"{}\" is there twice", profile.id));
            }
            out.push(profile);
        }
        out
    }
}
