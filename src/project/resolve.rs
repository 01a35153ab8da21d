//! The plan of a run: what the project file says, checked and in the rooms' own words.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::error::Error;
use super::places::{Key, Mistakes, Places};
use super::read::read;
use super::reader::Reader;
use super::set::Assignment;
use super::tables::Project;
use super::views::{Picture, PlannedView, Points, Target};
use crate::base::{Irradiance, Timeline};
use crate::bsdf::{Bsdf, Model, Side, Spectrum};
use crate::glare;
use crate::rules::Profile;
use crate::site::{PvSpec, SceneSpec};
use crate::sky::{self, FarHorizon, Place, TimeSpec};
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
        /// Its name, without its folder.
        #[serde(skip)]
        name: String,
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

/// A picture of luminances.
#[derive(Clone, Debug, Serialize)]
pub struct PlannedMoment {
    /// Its `[[moment]]`, from 0.
    #[serde(skip)]
    pub table: usize,
    /// Names its files.
    pub name: String,
    /// Day of the year, 0 is 1 January.
    pub day: u32,
    /// Local standard time, h.
    pub hour: f64,
    /// The camera, as Radiance's options; an observer's without its place.
    pub camera: Camera,
    /// Width and height, pixels.
    pub size: [usize; 2],
}

/// From where a picture of luminances is taken.
#[derive(Clone, Debug, Serialize)]
pub enum Camera {
    /// Radiance's view options.
    Options(String),
    /// An observer's number: along its direction, or half a sphere around it.
    Observer {
        /// Its number in the project file.
        number: usize,
        /// Half a sphere.
        fisheye: bool,
    },
}

/// Points of a region, about, before it is looked up in the scene.
const POINTS_OF_A_REGION: usize = 500;
pub use super::artifacts::MOMENTS;

/// A project, checked, with all defaults filled in.
#[derive(Clone, Debug)]
pub struct Resolved {
    /// `project.toml`, and where in it everything stands.
    pub places: Places,
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
    /// Sets of points that are rendered and analysed as the pictures are; the last one is that of
    /// the observers and regions, if there are any.
    pub sensors: Vec<PlannedView>,
    /// Pictures of luminances.
    pub moments: Vec<PlannedMoment>,
    /// How photons are traced.
    pub trace: trace::Settings,
    /// What is compared with the thresholds.
    pub quantity: Irradiance,
    /// How glare is found; the threshold is filled in for each.
    pub glare: glare::Settings,
    /// What it is judged by.
    pub rules: Vec<Profile>,
    /// Ridges beyond the scene.
    pub horizon: Option<FarHorizon>,
    /// Hash of each input file by its name.
    pub inputs: BTreeMap<String, String>,
    /// Hash of the weather file, where there is one.
    pub weather: Option<String>,
    /// Settings that are without effect, for people.
    pub notes: Vec<String>,
}

impl Resolved {
    /// Reads and checks a project; `memory_bytes` bounds the analysis.
    ///
    /// # Errors
    /// All mistakes in the project file, with their places; missing input files.
    pub fn read(path: &Path, set: &[Assignment], memory_bytes: u64) -> Result<Self, Error> {
        let read = read(path, set)?;
        let r = Reader::new(&read);
        r.names();
        let candidates = r.candidates();
        let reference = r.reference(&candidates);
        let views = r.views();
        let plan = Self {
            place: r.place(),
            times: r.times(),
            horizon: r.horizon(),
            scene: r.scene(),
            pv: r.pv(),
            sensors: r.sensors(),
            rules: r.rules(),
            moments: r.moments(&views),
            trace: r.trace(),
            quantity: read.project.glare.quantity,
            glare: r.glare(memory_bytes),
            weather: r.weather(),
            notes: r.unused_keys(),
            inputs: r.inputs(),
            views,
            candidates,
            reference,
            folder: read.places.file.parent().map_or_else(PathBuf::new, Path::to_owned),
            places: read.places.clone(),
            project: read.project.clone(),
        };
        r.finish()?;
        Ok(plan)
    }

    /// A mistake in the project file that shows only once it is put to use.
    pub fn mistake(&self, key: &Key, what: impl AsRef<str>) -> Error {
        self.places.wrong(key, what.as_ref())
    }

    /// A mistake in what was asked for beside the project file.
    pub fn mistaken(&self, what: impl Into<String>) -> Error {
        Mistakes::nowhere(self.places.file.clone(), what.into()).into()
    }

    /// The pictures, then the sets of points.
    pub fn with_sensors(&self) -> impl Iterator<Item = &PlannedView> {
        self.views.iter().chain(&self.sensors)
    }

    /// How many pixels a view has, or points a set; of regions about how many, as that is known
    /// once they are looked up in the scene.
    pub fn pixels(&self, view: &PlannedView) -> usize {
        match &view.target {
            Target::Picture(Picture { size: [columns, rows], .. }) => columns * rows,
            Target::Points(Points::File { sensors, .. }) => sensors.len(),
            Target::Points(Points::Receivers) => {
                self.project.observer.len() + POINTS_OF_A_REGION * self.project.region.len()
            }
        }
    }

    /// Where results lie.
    pub fn run_folder(&self) -> PathBuf {
        self.folder.join("run")
    }

    /// Whether the run is marked as a draft.
    pub fn is_draft(&self) -> bool {
        self.needs_photons() && self.trace.stored < DRAFT_BELOW_PHOTONS
    }

    /// Whether pictures of a view, or charts of a set of points, are marked as a draft.
    pub fn is_draft_of(&self, view: &PlannedView) -> bool {
        self.is_draft() && !view.is_direct()
    }

    /// Whether any view, sensor, observer or region is made of photons; without any of them photons
    /// are all there is.
    pub fn needs_photons(&self) -> bool {
        let mut all = self.with_sensors();
        all.next().is_none_or(|first| !first.is_direct() || all.any(|v| !v.is_direct()))
    }

    /// Number of thresholds that glare is analysed at.
    pub fn glare_thresholds(&self) -> usize {
        self.project.glare.thresholds_w_m2.len()
    }

    /// Hash of each file that decides an output, by its name: of the scene, and where it is a
    /// material's, of its BSDF files and the weather.
    pub fn inputs_of(&self, about: &[(&str, &str)]) -> BTreeMap<String, String> {
        let mut inputs = self.inputs.clone();
        let name = about.iter().find(|(key, _)| *key == "material").map(|(_, name)| *name);
        let Some(candidate) = self.candidates.iter().find(|c| Some(c.name.as_str()) == name) else {
            return inputs;
        };
        let mut add = |name: String, hash: &String| {
            let mut free = name.clone();
            let mut number = 1;
            while inputs.get(&free).is_some_and(|known| known != hash) {
                number += 1;
                free = format!("{name} ({number})");
            }
            inputs.insert(free, hash.clone());
        };
        for made in &candidate.models {
            if let Made::File { bsdf, name, .. } = made {
                add(name.clone(), bsdf);
            }
        }
        if let Some(hash) = &self.weather {
            add("weather".to_owned(), hash);
        }
        inputs
    }

    /// The timesteps: the suns above the horizon, the far one as well.
    ///
    /// # Errors
    /// See [`sky::timeline`].
    pub fn timeline(&self) -> Result<Timeline, Error> {
        let timeline = sky::timeline(&self.place, &self.times)
            .map_err(|e| self.mistake(&Key::of("time"), e.to_string()))?;
        Ok(match &self.horizon {
            None => timeline,
            Some(horizon) => horizon
                .cut(timeline)
                .map_err(|e| self.mistake(&Key::of("site.horizon"), e.to_string()))?,
        })
    }
}
