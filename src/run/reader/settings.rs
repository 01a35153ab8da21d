//! From the project file: the candidates, the views, and how light and glare are computed.

use std::collections::BTreeMap;
use std::path::Path;

use super::{Reader, view_file};
use crate::base::limits;
use crate::glare;
use crate::render::{EXACT_BITS, Estimator, Gather, Kernel, Quantity, View};
use crate::run::Error;
use crate::run::manifest::hash_path;
use crate::run::project::{MaterialTable, ViewTable};
use crate::run::resolve::{Candidate, Made, PlannedView};
use crate::site::bsdf::{Bsdf, BsdfFile};
use crate::trace::{self, Receivers};

impl Reader<'_> {
    pub fn candidates(&self) -> Result<Vec<Candidate>, Error> {
        let p = self.project;
        let mut models: BTreeMap<&str, Material> = BTreeMap::new();
        let mut out = Vec::new();
        for t in &p.material {
            let model = match (&t.model, &t.bsdf) {
                (Some(model), None) if t.side.is_none() && t.spectrum.is_none() => {
                    let bsdf = Bsdf::from_model(model)
                        .map_err(|source| Error::Material { name: t.name.clone(), source })?;
                    Material { made: Made::Model(model.clone()), bsdf, notes: Vec::new() }
                }
                (None, Some(path)) => self.measured(t, path)?,
                (Some(_), None) => {
                    return Err(self.wrong(format!(
                        "[[material]] \"{}\": `side` and `spectrum` go with `bsdf`, not with `model`",
                        t.name
                    )));
                }
                _ => {
                    return Err(self.wrong(format!(
                        "[[material]] \"{}\": expected either `model` or `bsdf`",
                        t.name
                    )));
                }
            };
            out.push(candidate(&t.name, &vec![&model; p.pv.len()]));
            models.insert(&t.name, model);
        }
        for case in &p.case {
            let known = || models.keys().copied().collect::<Vec<_>>().join(", ");
            for entry in case.assign.keys() {
                if !p.pv.iter().any(|t| &t.name == entry) {
                    return Err(self.wrong(format!(
                        "[[case]] \"{}\": assign names the PV \"{entry}\", which no [[pv]] has",
                        case.name
                    )));
                }
            }
            let mut chosen = Vec::new();
            for t in &p.pv {
                let name = case.assign.get(&t.name).ok_or_else(|| {
                    self.wrong(format!(
                        "[[case]] \"{}\": assign says nothing about the PV \"{}\"",
                        case.name, t.name
                    ))
                })?;
                let model = models.get(name.as_str()).ok_or_else(|| {
                    self.wrong(format!(
                        "[[case]] \"{}\": no [[material]] is named \"{name}\" (there are: {})",
                        case.name,
                        known()
                    ))
                })?;
                chosen.push(model);
            }
            out.push(candidate(&case.name, &chosen));
        }
        Ok(out)
    }

    fn measured(&self, t: &MaterialTable, path: &Path) -> Result<Material, Error> {
        let path = self.file.parent().unwrap_or(Path::new("")).join(path);
        let wrong = |source| Error::Material { name: t.name.clone(), source };
        let file = BsdfFile::read(&path).map_err(wrong)?;
        let side = t.side.unwrap_or_default();
        let measured = file.reflection(side, t.spectrum).map_err(wrong)?;
        let hash = hash_path(&path).map_err(|source| Error::Read { path: path.clone(), source })?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let notes = file.notes.iter().cloned().chain(measured.notes()).collect();
        let made = Made::File { bsdf: hash, name, side, spectrum: t.spectrum };
        Ok(Material { made, bsdf: Bsdf::Measured(measured), notes })
    }

    pub fn reference(&self, candidates: &[Candidate]) -> Result<Option<usize>, Error> {
        let Some(table) = &self.project.reference else { return Ok(None) };
        let at = candidates.iter().position(|c| c.name == table.material);
        let known = || candidates.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ");
        at.map(Some).ok_or_else(|| {
            self.wrong(format!(
                "reference.material: no [[material]] is named \"{}\" (there are: {})",
                table.material,
                known()
            ))
        })
    }

    fn view(&self, t: &ViewTable) -> Result<PlannedView, Error> {
        let Some([columns, rows]) = t.size else {
            return Err(self.wrong(format!(
                "[[view]] \"{}\": expected `size = [columns, rows]`, found none",
                t.name
            )));
        };
        self.check_size(&format!("view.{}.size", t.name), [columns, rows])?;
        if t.fuse && t.both_quantities {
            return Err(self.wrong(format!(
                "view.{}: `fuse` keeps no series, so `both_quantities` has none to add; leave one out",
                t.name
            )));
        }
        let annual = self.gather(t)?;
        let (options, view) = self.camera(t, columns, rows)?;
        Ok(PlannedView {
            name: t.name.clone(),
            options,
            view,
            annual,
            fuse: t.fuse,
            both: t.both_quantities,
            series_bandwidth: t.series_bandwidth,
            series_edges: t.series_edges,
            points: None,
            direct: t.estimator == "direct",
        })
    }

    /// Whether a picture has pixels, and no more than fit.
    pub(super) fn check_size(&self, key: &str, [columns, rows]: [usize; 2]) -> Result<(), Error> {
        let edge = 1..=limits::MAX_VIEW_EDGE;
        if edge.contains(&columns)
            && edge.contains(&rows)
            && columns.saturating_mul(rows) <= limits::MAX_VIEW_PIXELS
        {
            return Ok(());
        }
        Err(self.wrong(format!(
            "{key}: expected 1 to {} pixels along each edge and at most {} in all, found {columns} x {rows}",
            limits::MAX_VIEW_EDGE,
            limits::MAX_VIEW_PIXELS
        )))
    }

    /// How a view's photons become irradiance.
    pub(super) fn gather(&self, t: &ViewTable) -> Result<Gather, Error> {
        let estimator = match t.estimator.as_str() {
            "photons" => Estimator::Photons,
            "radiance" => Estimator::Radiance,
            // Without photons; the bandwidths mean nothing then.
            "direct" => Estimator::Photons,
            other => {
                return Err(self.wrong(format!(
                    "view.{}.estimator: expected \"photons\", \"radiance\" or \"direct\", found \"{other}\"",
                    t.name
                )));
            }
        };
        for (key, value) in
            [("bandwidth", Some(t.bandwidth)), ("series_bandwidth", t.series_bandwidth)]
        {
            if value.is_some_and(|v| !(2..=1_000_000).contains(&v)) {
                return Err(self.wrong(format!(
                    "view.{}.{key}: expected 2 to 1000000 photons, found {}",
                    t.name,
                    value.unwrap_or(0)
                )));
            }
        }
        if t.max_radius_m.is_some_and(|r| !(r > 0.0 && r.is_finite())) {
            return Err(
                self.wrong(format!("view.{}.max_radius_m: expected metres above 0", t.name))
            );
        }
        if !(1..=EXACT_BITS).contains(&t.series_mantissa_bits) {
            return Err(self.wrong(format!(
                "view.{}.series_mantissa_bits: expected 1 to {EXACT_BITS}, found {}",
                t.name, t.series_mantissa_bits
            )));
        }
        Ok(Gather {
            bandwidth: t.bandwidth,
            max_radius_m: t.max_radius_m,
            estimator,
            kernel: self.kernel(t)?,
            normal_tolerance_deg: self.within(
                t,
                "normal_tolerance_deg",
                t.normal_tolerance_deg,
                1.0..=90.0,
            )?,
            plane_tolerance_m: if t.plane_tolerance_m == 0.0 {
                None
            } else {
                Some(self.within(t, "plane_tolerance_m", t.plane_tolerance_m, 0.01..=100.0)?)
            },
            edges: t.edges,
            mantissa_bits: t.series_mantissa_bits,
        })
    }

    /// A view and its options: as written, or of a view file or a picture.
    fn camera(&self, t: &ViewTable, columns: usize, rows: usize) -> Result<(String, View), Error> {
        let name = &t.name;
        match (&t.view, &t.view_file) {
            (Some(options), None) => {
                let view = View::parse(options, columns, rows)
                    .map_err(|e| self.wrong(format!("view.{name}.view: {e}")))?;
                Ok((options.clone(), view))
            }
            (None, Some(path)) => {
                let path = self.file.parent().unwrap_or(Path::new("")).join(path);
                let view = view_file::read(&path, columns, rows).map_err(|what| {
                    self.wrong(format!("view.{name}.view_file: {}: {what}", path.display()))
                })?;
                // What it says, not where it lies, decides what is made.
                Ok((view.to_options(), view))
            }
            (both, _) => Err(self.wrong(format!(
                "[[view]] \"{name}\": expected either `view` or `view_file`, found {}",
                if both.is_some() { "both" } else { "none" }
            ))),
        }
    }

    fn kernel(&self, t: &ViewTable) -> Result<Kernel, Error> {
        match t.kernel.as_str() {
            "flat" => Ok(Kernel::Flat),
            "epanechnikov" => Ok(Kernel::Epanechnikov),
            other => Err(self.wrong(format!(
                "view.{}.kernel: expected \"flat\" or \"epanechnikov\", found \"{other}\"",
                t.name
            ))),
        }
    }

    fn within(
        &self,
        t: &ViewTable,
        key: &str,
        value: f32,
        range: std::ops::RangeInclusive<f32>,
    ) -> Result<f32, Error> {
        if range.contains(&value) {
            return Ok(value);
        }
        let (low, high) = (range.start(), range.end());
        let name = &t.name;
        Err(self.wrong(format!("view.{name}.{key}: expected {low} to {high}, found {value}")))
    }

    /// The pictures; sets of sensors apart.
    pub fn views(&self) -> Result<Vec<PlannedView>, Error> {
        let pictures = self.project.view.iter().filter(|v| v.sensors.is_none());
        pictures.map(|v| self.view(v)).collect()
    }

    pub fn trace(&self) -> Result<trace::Settings, Error> {
        let p = &self.project.photons;
        if p.bounces != 1 {
            return Err(Error::Unsupported(format!(
                "{}: photons.bounces: this version follows one scattering, by the PV; expected 1, found {}",
                self.file.display(),
                p.bounces
            )));
        }
        if !(1..=limits::MAX_PHOTONS).contains(&p.stored) {
            return Err(self.wrong(format!(
                "photons.stored: expected 1 to {}, found {}",
                limits::MAX_PHOTONS,
                p.stored
            )));
        }
        if !(p.max_path_m > 0.0 && p.max_path_m <= limits::MAX_PATH_M) {
            return Err(self.wrong(format!(
                "photons.max_path_m: expected metres above 0 and at most {}, found {}",
                limits::MAX_PATH_M,
                p.max_path_m
            )));
        }
        let receivers = match p.receivers.as_str() {
            "all" => Receivers::All,
            "diffuse" => Receivers::Diffuse,
            other => {
                return Err(self.wrong(format!(
                    "photons.receivers: expected \"all\" or \"diffuse\", found \"{other}\""
                )));
            }
        };
        Ok(trace::Settings {
            stored: p.stored,
            max_path_m: p.max_path_m,
            seed: p.seed,
            sun_visibility: p.sun_visibility,
            receivers,
        })
    }

    pub fn quantity(&self) -> Result<Quantity, Error> {
        match self.project.glare.quantity.as_str() {
            "surface" => Ok(Quantity::Surface),
            "normal" => Ok(Quantity::Normal),
            other => Err(self.wrong(format!(
                "glare.quantity: expected \"surface\" or \"normal\", found \"{other}\""
            ))),
        }
    }

    pub fn glare(&self, memory_bytes: u64) -> Result<glare::Settings, Error> {
        let g = &self.project.glare;
        let mut seen = Vec::new();
        for &t in &g.thresholds_w_m2 {
            if !(t >= 0.0 && t.is_finite()) || seen.contains(&t) {
                return Err(self.wrong(format!(
                    "glare.thresholds_w_m2: expected different finite numbers from 0, found {t}"
                )));
            }
            seen.push(t);
        }
        let connectivity =
            glare::Connectivity::from_neighbours(g.connectivity).ok_or_else(|| {
                self.wrong(format!(
                    "glare.connectivity: expected 6, 18 or 26, found {}",
                    g.connectivity
                ))
            })?;
        if g.sigma.iter().any(|s| !(0.0..=1000.0).contains(s))
            || g.truncate.is_nan()
            || g.truncate < 0.0
        {
            return Err(self.wrong(format!(
                "glare.sigma and glare.truncate: expected numbers from 0, found {:?} and {}",
                g.sigma, g.truncate
            )));
        }
        let settings = glare::Settings {
            threshold: 0.0,
            sigma: g.sigma,
            truncate: g.truncate,
            connectivity,
            allow_nonfinite: false,
            memory_bytes,
            ..glare::Settings::default()
        };
        for threshold in g.thresholds_w_m2.iter().copied().chain([0.0]) {
            let one = glare::Settings { threshold, ..settings.clone() };
            one.check().map_err(|e| self.wrong(format!("[glare]: {e}")))?;
        }
        Ok(settings)
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
