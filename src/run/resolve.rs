//! The plan of a run: what the project file says, checked and in the rooms' own words, and the
//! keys that say what decides each output.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::error::Error;
use super::manifest::key_of;
use super::project::{self, FileEntry, Project};
use super::reader::Reader;
use super::set::Assignment;
use crate::glare;
use crate::render::{Gather, Quantity, View};
use crate::site::bsdf::{Bsdf, Model, Side, Spectrum};
use crate::site::{PvSpec, SceneSpec};
use crate::sky::{Place, TimeSpec};
use crate::trace;

/// Below this many stored photons verdicts and pictures are marked as a draft.
pub const DRAFT_BELOW_PHOTONS: u64 = 4_000_000;

/// What a material is made from: all that decides how it scatters.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Made {
    /// A model.
    Model(Model),
    /// A side of a file.
    File {
        /// Hash of the file.
        bsdf: String,
        /// The side.
        side: Side,
        /// The light that was asked for.
        spectrum: Option<Spectrum>,
    },
}

/// A candidate: what each PV entry is made of.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Names the folder of its results.
    pub name: String,
    /// Model or file of each `[[pv]]` entry, in the order of the project file.
    pub models: Vec<Made>,
    /// The same, ready to scatter.
    pub bsdfs: Vec<Bsdf>,
    /// What its files leave to be desired, for people.
    pub notes: Vec<String>,
}

/// A view and how it is rendered.
#[derive(Clone, Debug)]
pub struct PlannedView {
    /// Names the folder of its results.
    pub name: String,
    /// As written.
    pub options: String,
    /// The camera.
    pub view: View,
    /// How the annual map is gathered.
    pub annual: Gather,
    /// Analysed as rendered: no series is kept.
    pub fuse: bool,
    /// The other irradiance gets a series, too.
    pub both: bool,
    /// How the series is gathered; its bandwidth is fixed once the timesteps are known.
    pub series_bandwidth: Option<usize>,
}

/// A project, checked, with all defaults filled in.
#[derive(Clone, Debug)]
pub struct Resolved {
    /// `project.toml`.
    pub file: PathBuf,
    /// The folder it lies in.
    pub folder: PathBuf,
    /// As written, with defaults.
    pub project: Project,
    /// Where on Earth.
    pub place: Place,
    /// Which instants.
    pub times: TimeSpec,
    /// Which files.
    pub scene: SceneSpec,
    /// Which PV.
    pub pv: Vec<PvSpec>,
    /// Materials and cases.
    pub candidates: Vec<Candidate>,
    /// Index of the reference among the candidates.
    pub reference: Option<usize>,
    /// The pictures.
    pub views: Vec<PlannedView>,
    /// How photons are traced.
    pub trace: trace::Settings,
    /// What is compared with the thresholds.
    pub quantity: Quantity,
    /// How glare is found; the threshold is filled in for each.
    pub glare: glare::Settings,
    /// Hash of each input file by its name.
    pub inputs: BTreeMap<String, String>,
    /// Hash of the weather file, where there is one.
    pub weather: Option<String>,
}

impl Resolved {
    /// Reads and checks a project; `memory_bytes` bounds the analysis.
    ///
    /// # Errors
    /// Any mistake in the project file, with its key; missing input files.
    pub fn read(path: &Path, set: &[Assignment], memory_bytes: u64) -> Result<Self, Error> {
        let (file, project) = project::read(path, set)?;
        let folder = file.parent().map_or_else(PathBuf::new, Path::to_owned);
        let r = Reader { file: &file, project: &project };
        r.names()?;
        let candidates = r.candidates()?;
        let reference = r.reference(&candidates)?;
        let inputs = r.inputs(&folder)?;
        Ok(Self {
            place: r.place()?,
            times: r.times()?,
            scene: r.scene(&folder)?,
            pv: r.pv()?,
            views: project.view.iter().map(|v| r.view(v)).collect::<Result<_, _>>()?,
            trace: r.trace()?,
            quantity: r.quantity()?,
            glare: r.glare(memory_bytes)?,
            weather: r.weather()?,
            candidates,
            reference,
            inputs,
            folder: folder.clone(),
            file: file.clone(),
            project,
        })
    }

    /// Where results lie.
    pub fn run_folder(&self) -> PathBuf {
        self.folder.join("run")
    }

    /// Whether verdicts and pictures are marked as a draft.
    pub fn is_draft(&self) -> bool {
        self.trace.stored < DRAFT_BELOW_PHOTONS
    }

    /// Number of thresholds that glare is analysed at.
    pub fn glare_thresholds(&self) -> usize {
        self.project.glare.thresholds_w_m2.len()
    }

    /// What decides the scene.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn scene_key(&self) -> Result<String, Error> {
        let mut scene = self.project.scene.clone();
        // Where a file lies must not change what a run writes; its name is among the inputs.
        for entry in &mut scene.files {
            let (FileEntry::Path(path) | FileEntry::Table { path, .. }) = entry;
            *path = path.file_name().unwrap_or_default().into();
        }
        // By the projection the site's place says where north lies.
        let place = self.scene.convergence_at;
        key_of("scene", &(scene, &self.project.pv, &self.inputs, place))
    }

    /// What decides the timesteps.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn suns_key(&self) -> Result<String, Error> {
        let s = &self.project.site;
        let place = (s.latitude, s.longitude, s.meridian, s.elevation_m);
        match &self.weather {
            None => key_of("suns", &(place, &self.project.time)),
            // Not the path: where a file lies must not change what a run writes.
            Some(hash) => {
                let mut time = self.project.time.clone();
                time.irradiance = toml::Value::String(hash.clone());
                key_of("suns", &(place, time))
            }
        }
    }

    /// What decides a candidate's photons.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn photons_key(&self, candidate: &Candidate) -> Result<String, Error> {
        let upstream = (self.scene_key()?, self.suns_key()?);
        key_of("photons", &(upstream, &candidate.models, &self.project.photons))
    }

    /// What decides a view's hits.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn hits_key(&self, view: &PlannedView) -> Result<String, Error> {
        #[derive(Serialize)]
        struct Facts<'a> {
            scene: String,
            view: &'a str,
            size: (usize, usize),
            max_path_m: f64,
            seed: u64,
        }
        key_of(
            "hits",
            &Facts {
                scene: self.scene_key()?,
                view: &view.options,
                size: (view.view.columns(), view.view.rows()),
                max_path_m: self.trace.max_path_m,
                seed: self.trace.seed,
            },
        )
    }

    /// What decides a candidate's maps and series in a view.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn render_key(&self, candidate: &Candidate, view: &PlannedView) -> Result<String, Error> {
        let g = &view.annual;
        let upstream = (self.photons_key(candidate)?, self.hits_key(view)?);
        let estimator = format!("{:?} {:?}", g.estimator, g.kernel);
        let surface = (g.normal_tolerance_deg, g.plane_tolerance_m, g.edges);
        let how =
            ((estimator, g.bandwidth, view.series_bandwidth, g.max_radius_m), surface, view.fuse);
        // The names stand in the files, in titles and in legends.
        let names = (&candidate.name, &view.name);
        key_of("render", &(upstream, how, &self.project.glare.quantity, names))
    }

    /// What decides a glare analysis.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn glare_key(&self, render_key: &str, threshold: f64) -> Result<String, Error> {
        let g = &self.project.glare;
        key_of("glare", &(render_key, threshold, g.sigma, g.truncate, g.connectivity))
    }
}
