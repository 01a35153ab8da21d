//! From the project file: the candidates, the views, and how light and glare are computed.

use std::collections::BTreeMap;

use super::{Reader, view_file};
use crate::base::limits::{self, EXACT_MANTISSA_BITS};
use crate::bsdf::{Bsdf, BsdfFile};
use crate::glare;
use crate::project::error::Error;
use crate::project::places::Key;
use crate::project::resolve::{Candidate, Made};
use crate::project::tables::{GlareTable, MaterialTable, PhotonsTable};
use crate::project::view_tables::ViewTable;
use crate::project::views::{
    Estimator, PhotonGather, Picture, PlannedView, SeriesKept, Sight, Target,
};
use crate::project::words::ViewBy;
use crate::render::{self, Gather, View};
use crate::trace;

impl Reader<'_> {
    /// Materials and cases; those that can't be used are left out.
    pub fn candidates(&self) -> Vec<Candidate> {
        let p = self.project;
        let mut models: BTreeMap<&str, Material> = BTreeMap::new();
        let mut out = Vec::new();
        for (i, t) in p.material.iter().enumerate() {
            let Some(model) = self.material(t, &Key::item("material", i)) else { continue };
            out.push(candidate(&t.name, &vec![&model; p.pv.len()]));
            models.insert(&t.name, model);
        }
        for (i, case) in p.case.iter().enumerate() {
            let key = Key::item("case", i).key("assign");
            for entry in case.assign.keys().filter(|e| p.pv.iter().all(|t| t.name != **e)) {
                self.wrong(&key, format!("it names the PV \"{entry}\", which no [[pv]] has"));
            }
            let mut chosen = Vec::new();
            for t in &p.pv {
                let Some(name) = case.assign.get(&t.name) else {
                    self.wrong(&key, format!("it says nothing about the PV \"{}\"", t.name));
                    continue;
                };
                self.is_a_material(&key, name);
                chosen.extend(models.get(name.as_str()));
            }
            if chosen.len() == p.pv.len() {
                out.push(candidate(&case.name, &chosen));
            }
        }
        out
    }

    fn is_a_material(&self, key: &Key, name: &str) {
        let names = || self.project.material.iter().map(|t| t.name.as_str());
        if !names().any(|known| known == name) {
            let known = names().collect::<Vec<_>>().join(", ");
            self.wrong(key, format!("no [[material]] is named \"{name}\" (there are: {known})"));
        }
    }

    fn material(&self, t: &MaterialTable, key: &Key) -> Option<Material> {
        let wrong = |source| Error::Material { name: t.name.clone(), source };
        match (&t.model, &t.bsdf) {
            (Some(model), None) if t.side.is_none() && t.spectrum.is_none() => {
                let bsdf = Bsdf::from_model(model);
                let bsdf = self.checked(&key.key("model"), bsdf, wrong)?;
                Some(Material { made: Made::Model(model.clone()), bsdf, notes: Vec::new() })
            }
            (None, Some(path)) => {
                let (key, path) = (key.key("bsdf"), self.beside(path));
                let file = self.checked(&key, BsdfFile::read(&path), wrong)?;
                let side = t.side.unwrap_or_default();
                let measured = self.checked(&key, file.reflection(side, t.spectrum), wrong)?;
                let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                let notes = file.notes.iter().cloned().chain(measured.notes()).collect();
                let bsdf = self.hash(&key, &path)?;
                let made = Made::File { bsdf, name, side, spectrum: t.spectrum };
                Some(Material { made, bsdf: Bsdf::Measured(measured), notes })
            }
            (Some(_), None) => {
                self.wrong(key, "`side` and `spectrum` go with `bsdf`, not with `model`");
                None
            }
            _ => {
                self.wrong(key, "expected either `model` or `bsdf`");
                None
            }
        }
    }

    /// The reference among the candidates.
    pub fn reference(&self, candidates: &[Candidate]) -> Option<usize> {
        let name = &self.project.reference.as_ref()?.material;
        if self.project.case.iter().all(|case| case.name != *name) {
            self.is_a_material(&Key::of("reference.material"), name);
        }
        candidates.iter().position(|c| c.name == *name)
    }

    /// The pictures; sets of sensors apart.
    pub fn views(&self) -> Vec<PlannedView> {
        let pictures = self.project.view.iter().enumerate().filter(|(_, v)| v.sensors.is_none());
        pictures.filter_map(|(i, v)| self.view(v, &Key::item("view", i))).collect()
    }

    fn view(&self, t: &ViewTable, key: &Key) -> Option<PlannedView> {
        if t.fuse && t.both_quantities {
            self.wrong(
                key,
                "`fuse` keeps no series, so `both_quantities` has none to add; leave one out",
            );
        }
        if t.coordinates.is_some() {
            self.wrong(
                &key.key("coordinates"),
                "`coordinates` goes with `sensors`; a picture's own are local: leave it out",
            );
        }
        let (estimator, mantissa_bits) = (self.estimator(t, key), self.mantissa_bits(t, key));
        let Some([columns, rows]) = t.size else {
            self.wrong(key, "expected `size = [columns, rows]`, found none");
            return None;
        };
        let edge = 1..=limits::MAX_VIEW_EDGE;
        if !edge.contains(&columns)
            || !edge.contains(&rows)
            || columns.saturating_mul(rows) > limits::MAX_VIEW_PIXELS
        {
            let (edge, all) = (limits::MAX_VIEW_EDGE, limits::MAX_VIEW_PIXELS);
            self.wrong(&key.key("size"), format!("expected 1 to {edge} pixels along each edge and at most {all} in all, found {columns} x {rows}"));
            return None;
        }
        let (options, view) = self.camera(t, key, [columns, rows])?;
        Some(PlannedView {
            name: t.name.clone(),
            target: Target::Picture(Picture { options, size: [columns, rows], view }),
            estimator,
            series: match (t.fuse, t.both_quantities) {
                (true, _) => SeriesKept::None,
                (_, true) => SeriesKept::Both,
                _ => SeriesKept::One,
            },
            mantissa_bits,
        })
    }

    /// A view and its options: as written, or of a view file or a picture.
    fn camera(&self, t: &ViewTable, key: &Key, size: [usize; 2]) -> Option<(String, View)> {
        let [columns, rows] = size;
        match (&t.view, &t.view_file) {
            (Some(options), None) => {
                let view = View::parse(options, columns, rows);
                Some((options.clone(), self.said(&key.key("view"), view)?))
            }
            (None, Some(path)) => {
                let path = self.beside(path);
                let read = view_file::read(&path, columns, rows)
                    .map_err(|what| format!("{}: {what}", path.display()));
                let view = self.said(&key.key("view_file"), read)?;
                // What it says, not where it lies, decides what is made.
                Some((view.to_options(), view))
            }
            (both, _) => {
                let found = if both.is_some() { "both" } else { "none" };
                self.wrong(key, format!("expected either `view` or `view_file`, found {found}"));
                None
            }
        }
    }

    /// The value, or `None` after its mistake was noted.
    pub(super) fn said<T, E: ToString>(&self, key: &Key, result: Result<T, E>) -> Option<T> {
        result.map_err(|e| self.wrong(key, e.to_string())).ok()
    }

    /// How a view is computed. What is integrated directly has no photons: whatever its keys say of
    /// them (they are checked all the same), none of it is kept.
    pub(super) fn estimator(&self, t: &ViewTable, key: &Key) -> Estimator {
        let gather = self.gather(t, key);
        match t.estimator {
            ViewBy::Direct => Estimator::Direct(self.sight()),
            ViewBy::Photons | ViewBy::Radiance => Estimator::Photons(gather),
        }
    }

    pub(super) fn sight(&self) -> Sight {
        let PhotonsTable {
            stored: _,
            max_path_m,
            bounces: _,
            seed: _,
            sun_visibility,
            receivers: _,
        } = self.project.photons;
        Sight { max_path_m, sun_visibility }
    }

    /// How a view's photons become irradiance.
    pub(super) fn gather(&self, t: &ViewTable, key: &Key) -> PhotonGather {
        let default = Gather::default();
        let annual = Gather {
            bandwidth: t.bandwidth.unwrap_or(default.bandwidth),
            max_radius_m: t.max_radius_m,
            estimator: match t.estimator {
                ViewBy::Radiance => render::Estimator::Radiance,
                ViewBy::Photons | ViewBy::Direct => render::Estimator::Photons,
            },
            kernel: t.kernel.unwrap_or(default.kernel),
            normal_tolerance_deg: t.normal_tolerance_deg.unwrap_or(default.normal_tolerance_deg),
            plane_tolerance_m: match t.plane_tolerance_m {
                None => default.plane_tolerance_m,
                Some(0.0) => None,
                Some(m) => Some(m),
            },
            edges: t.edges.unwrap_or(default.edges),
        };
        for (name, what) in annual.mistakes() {
            self.wrong(&key.key(name), what);
        }
        if let Some(bandwidth) = t.series_bandwidth {
            let series = Gather { bandwidth, ..Gather::default() };
            for (_, what) in series.mistakes() {
                self.wrong(&key.key("series_bandwidth"), what);
            }
        }
        let (series_bandwidth, series_edges) = (t.series_bandwidth, t.series_edges == Some(true));
        PhotonGather { annual, series_bandwidth, series_edges }
    }

    /// Bits of mantissa of a view's series.
    pub(super) fn mantissa_bits(&self, t: &ViewTable, key: &Key) -> u32 {
        let bits = t.series_mantissa_bits.unwrap_or(EXACT_MANTISSA_BITS);
        if !(1..=EXACT_MANTISSA_BITS).contains(&bits) {
            let what = format!("expected 1 to {EXACT_MANTISSA_BITS}, found {bits}");
            self.wrong(&key.key("series_mantissa_bits"), what);
        }
        bits
    }

    /// A sentence for each view whose estimator has no use for some of its keys. They are no
    /// mistake: whoever compares estimators changes `estimator` alone, by `--set`.
    pub fn unused_keys(&self) -> Vec<String> {
        let p = self.project;
        let nobody = p.observer.is_empty() && p.region.is_empty();
        let photons = self.receivers_by() == ViewBy::Photons;
        let mut out = Vec::new();
        for (i, t) in p.view.iter().enumerate() {
            // Observers and regions are gathered as the first view would be.
            if i == 0 && photons && !nobody {
                continue;
            }
            let search = [
                ("bandwidth", t.bandwidth.is_some()),
                ("series_bandwidth", t.series_bandwidth.is_some()),
                ("max_radius_m", t.max_radius_m.is_some()),
            ];
            let discs = [
                ("kernel", t.kernel.is_some()),
                ("normal_tolerance_deg", t.normal_tolerance_deg.is_some()),
                ("plane_tolerance_m", t.plane_tolerance_m.is_some()),
                ("edges", t.edges.is_some()),
                ("series_edges", t.series_edges.is_some()),
            ];
            let unused = match t.estimator {
                ViewBy::Direct => [&search[..], &discs[..]].concat(),
                ViewBy::Radiance => discs.to_vec(),
                ViewBy::Photons => continue,
            };
            let written = unused.iter().filter(|(_, is_written)| *is_written);
            let keys: Vec<String> = written.map(|(key, _)| format!("`{key}`")).collect();
            if !keys.is_empty() {
                out.push(format!(
                    "view.{}: ignored, of no meaning for estimator = \"{}\": {}",
                    t.name,
                    t.estimator.name(),
                    keys.join(", ")
                ));
            }
        }
        out
    }

    /// How photons are traced.
    pub fn trace(&self) -> trace::Settings {
        let PhotonsTable { stored, max_path_m, bounces, seed, sun_visibility, receivers } =
            self.project.photons;
        let key = Key::of("photons");
        if bounces != 1 {
            self.wrong(
                &key.key("bounces"),
                format!(
                    "this version follows one scattering, by the PV; expected 1, found {bounces}"
                ),
            );
        }
        if !(1..=limits::MAX_PHOTONS).contains(&stored) {
            let what = format!("expected 1 to {}, found {stored}", limits::MAX_PHOTONS);
            self.wrong(&key.key("stored"), what);
        }
        if !(max_path_m > 0.0 && max_path_m.is_finite()) {
            let what = format!("expected metres above 0, found {max_path_m}");
            self.wrong(&key.key("max_path_m"), what);
        }
        trace::Settings { stored, max_path_m, seed, sun_visibility, receivers }
    }

    /// How glare is found.
    pub fn glare(&self, memory_bytes: u64) -> glare::Settings {
        let GlareTable { thresholds_w_m2, quantity: _, sigma, truncate, connectivity, rules: _ } =
            &self.project.glare;
        let key = Key::of("glare");
        let mut seen = Vec::new();
        for &t in thresholds_w_m2 {
            if !(t >= 0.0 && t.is_finite()) || seen.contains(&t) {
                let what = format!("expected different finite numbers from 0, found {t}");
                self.wrong(&key.key("thresholds_w_m2"), what);
            }
            seen.push(t);
        }
        if sigma.iter().any(|s| !(0.0..=1000.0).contains(s)) {
            let what = format!("expected numbers from 0 to 1000, found {sigma:?}");
            self.wrong(&key.key("sigma"), what);
        }
        if truncate.is_nan() || *truncate < 0.0 {
            let what = format!("expected a number from 0, found {truncate}");
            self.wrong(&key.key("truncate"), what);
        }
        glare::Settings {
            threshold: 0.0,
            sigma: *sigma,
            truncate: *truncate,
            connectivity: *connectivity,
            allow_nonfinite: false,
            memory_bytes,
            ..glare::Settings::default()
        }
    }
}

/// A `[[material]]`, ready to scatter.
#[derive(Clone)]
struct Material {
    made: Made,
    bsdf: Bsdf,
    notes: Vec<String>,
}

fn candidate(name: &str, materials: &[&Material]) -> Candidate {
    let mut notes: Vec<String> = Vec::new();
    for note in materials.iter().flat_map(|m| &m.notes) {
        if !notes.contains(note) {
            notes.push(note.clone());
        }
    }
    Candidate {
        name: name.to_owned(),
        models: materials.iter().map(|m| m.made.clone()).collect(),
        bsdfs: materials.iter().map(|m| m.bsdf.clone()).collect(),
        notes,
    }
}
